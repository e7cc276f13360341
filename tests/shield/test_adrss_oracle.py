"""Random inputs against Intel's ad-rss-lib 5.0.0, where it is installed (pip install .[oracle]).

How it treats what the paper leaves open, found out by calling it:

- speeds are ranges; the follower's maximum and the leader's minimum count. Here both ends are equal;
- `max_speed_on_acceleration` caps the speed during the response time, never below the current speed, like `v_cap`;
- `min_longitudinal_safety_distance` is added to the clamped distance: the follower's to a same-direction distance, the
  larger of the two to an opposite-direction one, like `standstill_gap`;
- Lemma 2 compares end positions only, like mode "lemma2";
- mu is the mean of both fluctuation margins, and inside the clamp at zero;
- physical quantities compare with a precision of 1e-3, and a gap must exceed the safe distance. A car that starts or
  ends its response time within 1e-3 m/s of its speed cap is taken to be at the cap, which its braking distance feels.
"""

import math

import numpy as np
import pytest
from adrss_objects import become, new_object, physics, rss

from rss_shield.shield.definitions.kinematics import reach, time_to_cover
from rss_shield.shield.definitions.lateral import d_min_lateral
from rss_shield.shield.definitions.longitudinal import (
    d_min_opposite_direction,
    d_min_same_direction,
    is_safe_longitudinally,
)
from rss_shield.shield.definitions.response import LAT, lateral_response
from rss_shield.shield.lanes.memory import MEMORY, owes_braking, remember
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.params import PRESETS, RSSParams, Rules, Table

structured, positions = rss.structured, rss.core
PRECISION = 1e-3
CASES = 10_000


ONE, TWO, DISTANCE = new_object(), new_object(), physics.Distance(0.0)


def theirs(formula, one, two):
    assert formula(one, two, DISTANCE), "the library refused the input"
    return DISTANCE.mDistance


def random_params(rng):
    b_min = rng.uniform(1.5, 9.0)
    return RSSParams(
        response_time=rng.uniform(0.05, 3.0),
        a_max_accel=rng.choice([0.0, rng.uniform(0.0, 6.0)]),
        a_min_brake=b_min,
        a_max_brake=rng.uniform(b_min, 12.0),
        a_min_brake_correct=rng.uniform(1.0, b_min),
        a_lat_max_accel=rng.choice([0.0, rng.uniform(0.0, 3.0)]),
        a_lat_min_brake=rng.uniform(0.2, 4.0),
        mu=rng.uniform(0.0, 1.0),
        standstill_gap=rng.choice([0.0, rng.uniform(0.0, 3.0)]),
        v_cap=rng.uniform(5.0, 60.0),
    )


def cases(seed):
    """Random drivers and standing or moving cars; a new pair of drivers now and then, new speeds every time."""
    rng = np.random.default_rng(seed)
    for k in range(CASES):
        if k % 4 == 0:
            one, two = random_params(rng), random_params(rng)
        moving = rng.random(2) < 0.9
        yield one, two, *(rng.uniform(-4.0, 4.0, 2) * moving), rng


def precision(*braking_cars):
    """What the library's own comparisons may cost: 1e-3 m, and 1e-3 m/s for a car that is almost at its cap."""
    allowed = PRECISION
    for car, v, b in braking_cars:
        below_cap = np.array([car.v_cap - v, car.v_cap - (v + car.a_max_accel * car.response_time)])
        if np.any(np.abs(below_cap) <= PRECISION):
            allowed += PRECISION * (car.response_time + car.v_cap / b)
    return allowed


def test_same_direction_distances_agree():
    for rear, front, u_rear, u_front, _ in cases(seed=1):
        v_rear, v_front = abs(u_rear) * 12.0, abs(u_front) * 12.0
        expected = theirs(
            structured.calculateSafeLongitudinalDistanceSameDirection,
            become(ONE, front, lon=v_front),
            become(TWO, rear, lon=v_rear),
        )
        d = d_min_same_direction(v_rear, v_front, rear, front, "lemma2")
        assert abs(d - expected) <= precision((rear, v_rear, rear.a_min_brake))
        # in a pair whose rear car brakes no harder than the front one the default is the same distance
        exact = d_min_same_direction(v_rear, v_front, rear, front)
        assert exact == d if rear.a_min_brake <= front.a_max_brake else exact >= d


def test_opposite_direction_distances_agree():
    for correct, wrong, u_correct, u_wrong, _ in cases(seed=2):
        v_correct, v_wrong = abs(u_correct) * 12.0, abs(u_wrong) * 12.0
        expected = theirs(
            structured.calculateSafeLongitudinalDistanceOppositeDirection,
            become(ONE, correct, lon=v_correct),
            become(TWO, wrong, lon=v_wrong),
        )
        d = d_min_opposite_direction(v_correct, v_wrong, correct, wrong)
        assert abs(d - expected) <= precision(
            (correct, v_correct, correct.a_min_brake_correct), (wrong, v_wrong, wrong.a_min_brake)
        )


def test_lateral_distances_agree_but_for_the_clamp_around_mu():
    clamped = 0
    for left, right, u_left, u_right, _ in cases(seed=3):
        expected = theirs(
            structured.calculateSafeLateralDistance,
            become(ONE, left, lat=u_left),
            become(TWO, right, lat=u_right),
        )
        d, mu = d_min_lateral(u_left, u_right, left, right, "pair"), 0.5 * (left.mu + right.mu)
        if d > mu:
            assert abs(d - expected) <= PRECISION
        else:  # a pair that separates: mu here, something between nothing and mu there
            assert -PRECISION <= expected <= mu + PRECISION
            clamped += 1
        assert d_min_lateral(u_left, u_right, left, right, "no_credit") >= expected - PRECISION
    assert CASES / 20 < clamped < CASES / 2


def test_times_to_cover_a_distance_agree():
    duration, arrived = physics.Duration(0.0), 0
    for car, _, u, _, rng in list(cases(seed=5))[:3000]:
        v, rho, a, b = abs(u) * 12.0, car.response_time, car.a_max_accel, car.a_min_brake
        end = reach(v, rho, a, b, car.v_cap)
        distance = end * rng.choice([rng.uniform(0.0, 0.98), rng.uniform(1.02, 2.0)]) + 0.01
        motion = [physics.Speed(v), physics.Speed(car.v_cap), physics.Duration(rho)]
        motion += [physics.Acceleration(a), physics.Acceleration(-b)]
        assert positions.calculateTimeToCoverDistance(*motion, physics.Distance(distance), duration)
        t = time_to_cover(distance, v, rho, a, b, car.v_cap)
        arrived += math.isfinite(t)
        # its own precision decides at the cap, at the end of the way and at that of the response time: just after
        # the latter it may answer with a time after standstill
        if min(abs(car.v_cap - v), abs(v + a * rho - car.v_cap), abs(distance - end), abs(t - rho)) > 0.1:
            assert min(t, 1e6) == pytest.approx(duration.mDuration, rel=0.0, abs=5e-3)  # forever is 1e6 s there
    assert arrived > 1000


def judged(checker, time, ego, other, lon, lat):
    """State of one pair in the library's own checker: (longitudinal, lateral right) of a same-direction pair."""
    pair = rss.core.RelativeConstellation()
    pair.constellation_id, pair.ego_id, pair.object_id = 1, 1, 2
    pair.constellation_type = rss.world.ConstellationType.SameDirection
    pair.ego_state, pair.other_state = ego, other
    pair.relative_position.longitudinal_position, gap_lon = lon
    pair.relative_position.lateral_position, gap_lat = lat
    pair.relative_position.longitudinal_distance = physics.Distance(gap_lon)
    pair.relative_position.lateral_distance = physics.Distance(gap_lat)
    state = rss.state.RssState()
    assert checker.calculateRssStateNonIntersection(time, pair, state)
    return state.longitudinal_state, state.lateral_state_right


BEHIND, ON_THE_LEFT = positions.LongitudinalRelativePosition.AtBack, positions.LateralRelativePosition.AtLeft
ABREAST, IN_LANE = positions.LongitudinalRelativePosition.Overlap, positions.LateralRelativePosition.Overlap


def test_longitudinal_predicates_agree_outside_the_precision():
    for rear, front, u_rear, u_front, rng in list(cases(seed=4))[:1000]:
        v_rear, v_front = abs(u_rear) * 12.0, abs(u_front) * 12.0
        d = d_min_same_direction(v_rear, v_front, rear, front, "lemma2")
        for gap in (d + 2e-3, max(d - 2e-3, 0.0), d * rng.uniform(0.0, 2.0)):
            checker = structured.RssNonIntersectionConstellationChecker()
            ego, other = become(ONE, rear, lon=v_rear), become(TWO, front, lon=v_front)
            lon, _ = judged(checker, 1, ego, other, (BEHIND, gap), (IN_LANE, 0.0))
            if abs(gap - d) > PRECISION:
                assert lon.is_safe == is_safe_longitudinally(gap, d)


# ---------------------------------------------------------------- deliberate differences

CAR = PRESETS["ad-rss"].other


def test_a_gap_equal_to_the_safe_distance_is_safe_here_and_unsafe_there():
    # 20 m/s, rho 2 s: 47 + 27^2 / 8 - 25 m
    assert d_min_same_direction(20.0, 20.0, CAR, CAR) == 113.125
    for gap, safe_there in ((113.125, False), (113.1255, False), (113.127, True)):
        checker = structured.RssNonIntersectionConstellationChecker()
        ego, other = become(ONE, CAR, lon=20.0), become(TWO, CAR, lon=20.0)
        lon, _ = judged(checker, 1, ego, other, (BEHIND, gap), (IN_LANE, 0.0))
        assert lon.is_safe == safe_there
        assert is_safe_longitudinally(gap, 113.125)


@pytest.mark.parametrize("u", [0.3, 0.0, -0.3])
def test_a_car_that_moves_away_is_asked_to_brake_sideways_there_but_not_here(u):
    checker = structured.RssNonIntersectionConstellationChecker()
    ego, other = become(ONE, CAR, lon=20.0, lat=u), become(TWO, CAR, lon=20.0, lat=-0.6)
    for time, gap in ((1, 9.0), (2, 0.2)):
        _, right = judged(checker, time, ego, other, (ABREAST, 0.0), (ON_THE_LEFT, gap))
    assert right.response == rss.state.LateralResponse.BrakeMin
    assert (lateral_response(-1.0, 2.0, u, CAR)[1] == -CAR.a_lat_min_brake) == (u > 0.0)


def test_behind_a_cut_in_nobody_brakes_there_but_the_ego_does_here():
    # 20 m behind a car of the same speed, first beside its lane, then half a metre from overlapping
    checker = structured.RssNonIntersectionConstellationChecker()
    ego, other = become(ONE, CAR, lon=20.0), become(TWO, CAR, lon=20.0, lat=-1.0)
    users = np.zeros(2, ROAD_USER)
    users["half_length"], users["half_width"], users["speed"], users["in_own_lane"] = 2.5, 1.0, 20.0, True
    users["s"], users["u"], users["cos"] = [0.0, 25.0], [0.0, -1.0], 1.0
    memory = np.zeros(1, MEMORY)[0]
    for time, gap in ((1, 9.0), (2, 0.5)):
        lon, right = judged(checker, time, ego, other, (BEHIND, 20.0), (ON_THE_LEFT, gap))
        users[1]["y"] = 2.0 + gap
        pair = assess(users[0], users[1], Table(CAR, CAR, Rules(), 1 / 15))
        remember(memory, pair, users[0], users[1], 1 / 15)
    assert not lon.is_safe and not right.is_safe
    assert lon.response == getattr(rss.state.LongitudinalResponse, "None")
    assert right.response == rss.state.LateralResponse.BrakeMin
    assert memory["axes"] == LAT and memory["since"] == 1
    assert owes_braking(memory, Rules()) == 2
    assert owes_braking(memory, Rules(present_duties=False)) == 0


def test_reversing_cars_are_an_input_error_there():
    one, two = become(ONE, CAR, lon=-1.0), become(TWO, CAR, lon=1.0)
    assert not structured.calculateSafeLongitudinalDistanceSameDirection(one, two, DISTANCE)
    assert math.isfinite(d_min_same_direction(1.0, 1.0, CAR, CAR))
