"""What drivers are assumed to do on dry, wet, snowy and icy roads."""

import math

import pytest

from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.params import GRAVITY, PRESETS, ROADS, Road, RSSParams, on_road

SIMULATOR = PRESETS["simulator"].ego


@pytest.mark.parametrize("base", ["simulator", "slides", "carla", "rodionova-assertive"])
@pytest.mark.parametrize("name", ROADS)
def test_nobody_is_assumed_to_do_what_the_road_does_not_admit(base, name):
    road, car = ROADS[name], on_road(PRESETS[base].ego, ROADS[name])
    assert RSSParams.validated(**car._asdict()) == car
    # braking and steering at once share the grip (hole H13)
    assert math.hypot(car.a_min_brake, car.a_lat_min_brake) <= road.low * GRAVITY + 1e-12
    for feared in (car.a_max_brake, car.a_max_accel, car.a_lat_max_accel):
        assert feared <= road.high * GRAVITY
    for field in ("response_time", "mu", "standstill_gap", "v_cap"):
        assert getattr(car, field) == getattr(PRESETS[base].ego, field)


def test_on_a_dry_road_the_simulator_keeps_its_own_limits():
    assert on_road(SIMULATOR, ROADS["dry"]) == SIMULATOR
    assert PRESETS["dry"][:2] == PRESETS["simulator"][:2]


def test_the_presets_are_the_published_friction():
    # Noon 1994: snow 0.20 to 0.25; the braking relied on shares the grip with 1.5 m/s^2 to the side of 5 along
    snow = PRESETS["snow"].other
    assert snow.a_max_brake == pytest.approx(0.25 * 9.81)
    assert snow.a_min_brake == pytest.approx(0.20 * 9.81 * 5.0 / math.hypot(5.0, 1.5))
    assert snow.a_lat_min_brake == pytest.approx(0.3 * snow.a_min_brake)
    assert snow.a_max_accel == pytest.approx(0.25 * 9.81)
    assert all("Noon" in PRESETS[name].source for name in ROADS)


@pytest.mark.parametrize("v", [5.0, 15.0, 30.0])
def test_the_slippier_the_road_the_larger_the_gap(v):
    gaps = [d_min_same_direction(v, v, PRESETS[name].ego, PRESETS[name].other) for name in ROADS]
    assert gaps == sorted(gaps) and len(set(gaps)) == 4


def test_a_car_that_brakes_with_the_grip_of_a_wetter_road_than_assumed_hits_the_one_ahead():
    # at the gap of a dry road the follower brakes as snow admits, the leader as hard as on a dry road
    dry, snow = PRESETS["dry"], PRESETS["snow"]
    for assumed, hits in ((dry, True), (snow, False)):
        gap = d_min_same_direction(20.0, 20.0, assumed.ego, assumed.other)
        v_rear = v_front = 20.0
        for k in range(3000):
            leader, rho = (6.0 if assumed is dry else snow.other.a_max_brake), 2 / 15
            a = assumed.ego.a_max_accel if 0.01 * k < rho else -snow.ego.a_min_brake
            v_next, front_next = max(v_rear + 0.01 * a, 0.0), max(v_front - 0.01 * leader, 0.0)
            gap += 0.005 * (v_front + front_next - v_rear - v_next)
            v_rear, v_front = v_next, front_next
        assert (gap < 0.0) == hits


@pytest.mark.parametrize("road", [Road(0.0, 0.5), Road(0.6, 0.5), Road(0.5, math.inf), Road(-0.1, 0.2)])
def test_impossible_friction_is_refused(road):
    with pytest.raises(ValueError, match=r"^friction = .* expected 0 < low <= high"):
        on_road(SIMULATOR, road)
