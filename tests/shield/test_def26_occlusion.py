"""Def. 26: how fast one may drive where somebody may be hidden."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.definitions.longitudinal import d_min_opposite_direction
from rss_shield.shield.definitions.occlusion import (
    REASONABLE,
    is_exonerated_by_mean_speed,
    is_hidden,
    mean_speed_until_contact,
    permitted_speed,
    permitted_speed_head_on,
    v_visible,
)
from rss_shield.shield.definitions.pedestrians import WALKS, reach_ahead
from rss_shield.shield.params import PRESETS

CAR = PRESETS["ad-rss"].ego
WALK = WALKS["paper"]


@pytest.mark.parametrize("v_cap", [math.inf, 6.0, 15.0])
def test_the_bound_inverts_the_reach_exactly(v_cap):
    rng = np.random.default_rng(1)
    capped = 0
    for _ in range(500):
        rho, a, b = rng.uniform(0.05, 2.0), rng.choice([0.0, rng.uniform(0.0, 5.0)]), rng.uniform(1.0, 9.0)
        v = rng.uniform(0.0, 25.0)
        distance = reach(v, rho, a, b, v_cap)
        capped += v + a * rho > v_cap
        assert v_visible(distance, rho, a, b, v_cap) == pytest.approx(v, abs=1e-6)
    assert capped > 50 or v_cap == math.inf
    distances = np.array([5.0, 20.0, 60.0])
    np.testing.assert_allclose(reach(v_visible(distances, 1.0, 3.5, 4.0, v_cap), 1.0, 3.5, 4.0, v_cap), distances)


def test_too_short_a_view_permits_no_speed():
    assert v_visible(3.28125, 1.0, 3.5, 4.0) == pytest.approx(0.0)  # who stands may still come that far
    assert v_visible(3.0, 1.0, 3.5, 4.0) < 0.0
    assert permitted_speed(3.0, 0.0, 1.0, CAR) == 0.0


def test_a_ghost_that_cannot_come_into_the_way_limits_nothing():
    ghost_reach = reach_ahead(REASONABLE["pedestrian", "parked cars"].v_high, WALK)
    assert permitted_speed(10.0, ghost_reach + 0.01, ghost_reach, CAR) == math.inf
    assert permitted_speed(10.0, ghost_reach - 0.01, ghost_reach, CAR) == pytest.approx(v_visible(10.0, 1.0, 3.5, 4.0))


def test_a_ghost_that_comes_along_the_own_way_needs_the_gap_of_def_2():
    one = CAR._replace(a_min_brake_correct=CAR.a_min_brake)
    for v_ghost in (0.0, 5.0, 14.0):
        theirs = reach(v_ghost, 1.0, 3.5, 4.0, 100.0)
        v = permitted_speed_head_on(90.0, theirs, CAR)
        assert d_min_opposite_direction(v, v_ghost, one, one) == pytest.approx(90.0)


# ---------------------------------------------------------------- a street with parked cars


EYE = (0.0, 0.0)  # of an ego that drives along x, 2 m wide


def random_walls(rng):
    """Sides of obstacles along a street, on both sides of it."""
    n = rng.integers(1, 8)
    x, y = rng.uniform(2.0, 40.0, n), rng.choice([-1.0, 1.0], n) * rng.uniform(1.3, 5.0, n)
    return np.column_stack([x, y, x + rng.uniform(0.0, 5.0, n), y + rng.uniform(-1.0, 1.0, n)])


def street_speed(walls, ghost_reach):
    """Permitted speed among people who may stand at any hidden place of a grid, and walk straight across."""
    slowest = math.inf
    for x in np.arange(1.0, 45.0, 1.0):
        for y in (-6.0, -4.0, -2.5, -1.5, 1.5, 2.5, 4.0, 6.0):
            if is_hidden(*EYE, x, y, walls):
                slowest = min(slowest, permitted_speed(x, abs(y) - 1.0, ghost_reach, CAR))
    return slowest


def test_removing_an_occluder_never_lowers_the_permitted_speed():
    rng = np.random.default_rng(2)
    raised = 0
    for _ in range(60):
        walls = random_walls(rng)
        before = street_speed(walls, 2.5)
        for k in range(len(walls)):
            after = street_speed(np.delete(walls, k, axis=0), 2.5)
            assert after >= before
            raised += after > before
    assert raised > 20


def test_a_speed_that_forgets_the_occluders_between_is_lowered_by_removing_one():
    # the measure of the test above: a rule that looks at the nearest wall only is found out
    def by_nearest_wall_alone(walls):
        if len(walls) == 0:
            return math.inf
        return street_speed(walls[[np.argmin(walls[:, 0])]], 2.5)

    rng = np.random.default_rng(2)
    lowered = 0
    for _ in range(60):
        walls = random_walls(rng)
        for k in range(len(walls)):
            lowered += by_nearest_wall_alone(np.delete(walls, k, axis=0)) < by_nearest_wall_alone(walls)
    assert lowered > 5


def overruns(v, distance, rng, dt=0.01):
    """Does an ego of speed `v` come farther than `distance`, where somebody steps into its way?"""
    position, speed, t = 0.0, v, 0.0
    while speed > 0.0:
        a = rng.choice([0.0, 1.0]) * CAR.a_max_accel if t < CAR.response_time - 1e-9 else -CAR.a_min_brake
        speed_next = max(speed + a * dt, 0.0)
        position += 0.5 * (speed + speed_next) * dt
        speed, t = speed_next, t + dt
    return position > distance


@pytest.mark.parametrize(("rule", "touches"), [("permitted", False), ("without a response time", True)])
def test_a_hidden_pedestrian_within_reason_is_never_hit_by_a_car_that_keeps_to_it(rule, touches):
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(200):
        distance, clearance = rng.uniform(4.0, 40.0), rng.uniform(0.0, 2.0)
        v = permitted_speed(distance, clearance, 2.5, CAR)
        if rule != "permitted":
            v = math.sqrt(2 * CAR.a_min_brake * distance)  # a well-known mistake
        hits += overruns(v, distance, rng)
    assert (hits > 0) == touches


# ---------------------------------------------------------------- the older rule


def test_the_mean_speed_counts_until_contact_or_rest():
    assert mean_speed_until_contact(8.0, 0.5, 1.0, 4.0) == pytest.approx(8.0)  # within the response time
    assert mean_speed_until_contact(8.0, math.inf, 1.0, 4.0) == pytest.approx((8.0 + 8.0) / 3.0)  # 8 m, then 8 m in 2 s
    assert mean_speed_until_contact(8.0, 9.0, 1.0, 4.0) == mean_speed_until_contact(8.0, 3.0, 1.0, 4.0)
    assert is_exonerated_by_mean_speed(8.0, 3.0, 1.0, 4.0, 5.4) and not is_exonerated_by_mean_speed(
        8.0, 3.0, 1.0, 4.0, 5.3
    )


def test_the_older_rule_exonerates_some_who_drove_too_fast_for_the_new_one():
    # 4 m ahead at 4 m/s, where Def. 26 permits 0.7: hit after 1.0 s while not braking yet, slower than a running child
    assert permitted_speed(4.0, 0.0, 2.5, CAR) < 1.0
    assert is_exonerated_by_mean_speed(4.0, 1.0, 1.0, 4.0, 5.0)
