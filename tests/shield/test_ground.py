"""Parameters by place and by road user: what holds where somebody will be."""

import math

import numpy as np
import pytest

from rss_shield.shield.ground import (
    CLASSES,
    CONDITIONS,
    make_ground,
    of_class,
    params_at,
    state_along,
    state_between,
    table_on,
    worse_of,
)
from rss_shield.shield.lanes.judge import judge_motion
from rss_shield.shield.lanes.memory import MEMORY, start_over
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.params import PRESETS, ROADS, Rules, on_road
from rss_shield.shield.table import table_for

DT = 1 / 15
TABLE = table_for(PRESETS["simulator"], Rules(), DT)
DRY, WET, SNOW, ICE = range(4)
# dry up to 100 m, ice from there to 200 m, wet beyond
GROUND = make_ground(TABLE, [(-math.inf, "dry"), (100.0, "ice"), (200.0, "wet")], ["car", "truck"])


def state(worst, best):
    return 4 * worst + best


def car(s, speed, kind=0):
    record = np.zeros(1, ROAD_USER)[0]
    record["s"], record["speed"], record["cos"], record["along"] = s, speed, 1.0, speed
    record["half_length"], record["half_width"], record["in_own_lane"] = 2.5, 1.0, True
    record["around"], record["kind"] = np.inf, kind
    return record


def test_the_order_of_conditions_is_that_of_their_grip():
    assert CONDITIONS == ("dry", "wet", "snow", "ice")
    assert [road.low for road in ROADS.values()] == sorted((road.low for road in ROADS.values()), reverse=True)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-50.0, 99.0, state(DRY, DRY)),
        (-50.0, 100.0, state(ICE, DRY)),
        (120.0, 130.0, state(ICE, ICE)),
        (150.0, 260.0, state(ICE, WET)),
        (0.0, 999.0, state(ICE, DRY)),
        (201.0, 202.0, state(WET, WET)),
    ],
)
def test_a_stretch_has_its_worst_and_its_best_condition(low, high, expected):
    assert state_between(GROUND, low, high) == expected
    assert worse_of(expected, state(WET, WET)) == state(max(expected // 4, WET), min(expected % 4, WET))


def test_a_row_relies_on_the_worst_and_fears_the_best():
    both = params_at(GROUND.ego, state(ICE, DRY))
    ice, dry = on_road(TABLE.ego, ROADS["ice"]), on_road(TABLE.ego, ROADS["dry"])
    assert (both.a_min_brake, both.a_lat_min_brake) == (ice.a_min_brake, ice.a_lat_min_brake)
    assert (both.a_max_brake, both.a_max_accel) == (dry.a_max_brake, dry.a_max_accel)
    assert params_at(GROUND.ego, state(WET, WET)) == on_road(TABLE.ego, ROADS["wet"])


def test_what_counts_is_the_whole_stopping_way_at_the_worst_on_it():
    # on a dry road 20 m/s stop within 44.3 m: 20.4^2 / 10 + 2.69 for the response time; from 53 m on that reaches the
    # ice, and at its grip, below 1 m/s^2, far beyond it onto the wet road
    def seen(x, speed=20.0, cos=1.0):
        return state_along(GROUND, GROUND.ego, 0, x, cos, speed, 2.5)

    reach = 2 / 15 * 20 + 0.5 * 3 * (2 / 15) ** 2 + 20.4**2 / 10 + 2.5
    assert seen(100.0 - reach - 0.01) == state(DRY, DRY)
    assert seen(100.0 - reach + 0.01) == state(ICE, DRY)
    assert seen(150.0) == state(ICE, WET)
    assert seen(150.0, 1.0) == state(ICE, ICE)
    assert seen(300.0) == state(WET, WET) and seen(220.0, cos=-1.0) == state(ICE, DRY)


def test_kinds_of_vehicles_brake_as_regulations_ask():
    truck = of_class(TABLE.other, CLASSES["truck"], DT)
    assert truck.a_min_brake == pytest.approx(5.0 * 5.0 / 6.43) and truck.a_max_brake == pytest.approx(6.0 * 5.0 / 6.43)
    assert truck.response_time == pytest.approx(18 * DT)  # 1.18 s in whole frames
    assert of_class(TABLE.other, CLASSES["car"], DT) == TABLE.other
    motorcycle = of_class(TABLE.other, CLASSES["motorcycle"], DT)
    assert motorcycle.a_max_brake == TABLE.other.a_max_brake and motorcycle.a_min_brake < TABLE.other.a_min_brake


def test_a_pair_is_held_to_the_row_of_the_other():
    mixed = table_on(TABLE._replace(others=GROUND.other), GROUND, state(DRY, DRY))
    ego = car(0.0, 20.0)
    for kind, params in ((0, TABLE.other), (16, of_class(TABLE.other, CLASSES["truck"], DT))):
        for s in (-60.0, 40.0):
            alone = assess(ego, car(s, 20.0), TABLE._replace(other=params))
            assert assess(ego, car(s, 20.0, kind), mixed) == alone
    # ahead of a truck more is required, behind it less
    behind = [assess(ego, car(-60.0, 20.0, kind), mixed).margin_lon for kind in (0, 16)]
    ahead = [assess(ego, car(40.0, 20.0, kind), mixed).margin_lon for kind in (0, 16)]
    assert behind[1] < behind[0] and ahead[1] > ahead[0]


def test_the_slippier_the_place_the_larger_the_gap():
    mixed = TABLE._replace(others=GROUND.other)
    margins = [
        assess(car(0.0, 20.0), car(300.0, 20.0, state(k, k)), table_on(mixed, GROUND, state(k, k))).margin_lon
        for k in range(4)
    ]
    assert margins == sorted(margins, reverse=True) and margins[0] > margins[3] + 50.0


def test_a_truck_that_brakes_as_trucks_do_has_kept_its_duty_and_a_car_has_not():
    # behind the ego, in danger, it has braked at 4 m/s^2 for long
    mixed = table_on(TABLE._replace(others=GROUND.other), GROUND, state(DRY, DRY))
    for kind, broke in ((0, True), (16, False)):
        memory = np.zeros(1, MEMORY)[0]
        memory["age"], memory["since"], memory["axes"] = 50, 40, 1
        memory["v_ego"] = memory["v_other"] = 20.0
        memory["speed_other"], memory["acceleration_other"] = 12.0, -4.0
        memory["travel_ego"] = 60.0
        judge_motion(memory, car(0.0, 5.0), car(-20.0, 12.0, kind), mixed, 0, 0.0)
        assert (memory["other_broke"] != 0) == broke


def test_where_parameters_change_danger_is_nobodys_doing():
    safe, dangerous = np.zeros(2, MEMORY)
    safe["age"], safe["axes"] = 9, 3
    dangerous["age"], dangerous["axes"], dangerous["since"] = 9, 3, 4
    start_over(safe)
    start_over(dangerous)
    assert (safe["age"], safe["axes"], bool(safe["skipped"])) == (0, 0, True)
    assert (dangerous["since"], dangerous["axes"]) == (4, 0)
