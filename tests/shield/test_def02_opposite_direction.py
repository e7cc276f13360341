"""Def. 2 and Lemma 3: the safe distance between cars driving at each other, and what holds for any signs of speed."""

import itertools
import math

import numpy as np
import pytest

from rss_shield.shield.definitions.kinematics import forward_reach
from rss_shield.shield.definitions.longitudinal import (
    d_min_longitudinal,
    d_min_opposite_direction,
    d_min_same_direction,
)
from rss_shield.shield.params import PRESETS

# rho 1 s, acceleration 3.5, braking 4 m/s^2, in its own lane 3 m/s^2
CAR = PRESETS["ad-rss"].ego._replace(v_cap=math.inf)
SLOW = CAR._replace(response_time=2.0)
OWN, WRONG = CAR.a_min_brake_correct, CAR.a_min_brake


def farthest(v, rho, a, b, dt=1e-3):
    """Farthest point ever of a car that accelerates at `a` for `rho` and then brakes at `b`, driven frame by frame."""
    t = np.arange(0.0, 60.0, dt)
    speed = v + a * np.minimum(t, rho)
    speed = np.where(t > rho, np.maximum(speed - b * (t - rho), 0.0), speed)
    return max(np.max(np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt)), 0.0)


# ---------------------------------------------------------------- Lemma 3


def test_two_cars_at_14_metres_per_second_by_hand():
    # each 15.75 m in the first second, up to 17.5 m/s; then 306.25 / 6 m in the own lane and 306.25 / 8 m in the
    # wrong one: 31.5 + 51.0416... + 38.28125
    assert d_min_opposite_direction(14.0, 14.0, CAR, CAR) == pytest.approx(120.822916667)


def test_two_standing_cars_may_both_pull_away():
    # 1.75 m each, then 12.25 / 6 and 12.25 / 8 m
    assert d_min_opposite_direction(0.0, 0.0, CAR, CAR) == pytest.approx(3.5 + 12.25 / 6 + 12.25 / 8)


def test_each_driver_is_granted_the_own_response_time():
    # 20 m/s, 1 s: 21.75 + 23.5^2 / 6; 10 m/s, 2 s: 27 + 17^2 / 8
    assert d_min_opposite_direction(20.0, 10.0, CAR, SLOW) == pytest.approx(21.75 + 552.25 / 6 + 27 + 36.125)


def test_the_larger_standstill_gap_of_the_two_counts():
    polite = CAR._replace(standstill_gap=1.0)
    bare = d_min_opposite_direction(14.0, 14.0, CAR, CAR)
    assert d_min_opposite_direction(14.0, 14.0, polite, CAR) == bare + 1.0
    assert d_min_opposite_direction(14.0, 14.0, CAR, polite) == bare + 1.0
    assert d_min_opposite_direction(14.0, 14.0, polite, polite._replace(standstill_gap=2.0)) == bare + 2.0


def test_the_speed_cap_binds_both_drivers():
    # both keep 14 m/s: 14 + 196 / 6 and 14 + 196 / 8
    capped = CAR._replace(v_cap=10.0)
    assert d_min_opposite_direction(14.0, 14.0, capped, capped) == pytest.approx(28 + 196 / 6 + 196 / 8)


def test_the_distance_is_exactly_what_the_two_use_up():
    rng = np.random.default_rng(1)
    for _ in range(50):
        rho_1, rho_2, a_1, a_2 = rng.uniform(0.1, 2.0, 4)
        b_1, b_2 = rng.uniform(2.0, 6.0, 2)
        correct = CAR._replace(response_time=rho_1, a_max_accel=a_1, a_min_brake_correct=b_1)
        wrong = CAR._replace(response_time=rho_2, a_max_accel=a_2, a_min_brake=b_2)
        v_1, v_2 = rng.uniform(0.0, 35.0, 2)
        used = farthest(v_1, rho_1, a_1, b_1) + farthest(v_2, rho_2, a_2, b_2)
        assert d_min_opposite_direction(v_1, v_2, correct, wrong) == pytest.approx(used, abs=2e-3)


def test_roles_are_interchangeable_only_if_both_brake_alike():
    alike = CAR._replace(a_min_brake_correct=CAR.a_min_brake)
    assert d_min_opposite_direction(20.0, 7.0, alike, alike) == d_min_opposite_direction(7.0, 20.0, alike, alike)
    # the faster car needs more room where it may brake weaker
    assert d_min_opposite_direction(20.0, 7.0, CAR, CAR) > d_min_opposite_direction(7.0, 20.0, CAR, CAR)


def test_an_oncoming_car_needs_more_room_than_a_standing_one_and_that_more_than_a_leaving_one():
    v = np.linspace(0.0, 40.0, 41)
    standing = d_min_same_direction(v, np.zeros_like(v), CAR, CAR)
    assert np.all(d_min_opposite_direction(v, np.zeros_like(v), CAR, CAR) > standing)
    assert np.all(standing >= d_min_same_direction(v, np.full_like(v, 5.0), CAR, CAR))


def test_the_distance_grows_with_both_speeds():
    v, still = np.linspace(0.0, 40.0, 401), np.full(401, 9.0)
    assert np.all(np.diff(d_min_opposite_direction(v, still, CAR, SLOW)) > 0.0)
    assert np.all(np.diff(d_min_opposite_direction(still, v, CAR, SLOW)) > 0.0)


def test_arrays_give_what_a_loop_over_floats_gives():
    v_1, v_2 = np.random.default_rng(2).uniform(0.0, 35.0, (2, 200))
    d = d_min_opposite_direction(v_1, v_2, CAR, SLOW)
    assert d.tolist() == [d_min_opposite_direction(a, b, CAR, SLOW) for a, b in zip(v_1, v_2, strict=True)]


# ---------------------------------------------------------------- any signs of speed


@pytest.mark.parametrize(("v", "expected"), [(10.0, 34.53125), (0.0, 3.28125), (-1.0, 1.53125), (-5.0, 0.0)])
def test_forward_reach_by_hand(v, expected):
    # 10 + 1.75 + 13.5^2 / 8; 1.75 + 12.25 / 8; -1 + 1.75 + 2.5^2 / 8; -5 + 1.75 and still rolling back
    assert forward_reach(v, 1.0, 3.5, 4.0) == expected


def test_forward_and_forward_on_one_heading_is_lemma_2():
    for v_rear, v_front in itertools.product((0.0, 7.0, 30.0), repeat=2):
        d = d_min_longitudinal(v_rear, v_front, False, CAR, SLOW, WRONG, WRONG)
        assert d == d_min_same_direction(v_rear, v_front, CAR, SLOW)


def test_driving_at_each_other_is_lemma_3():
    for v_1, v_2 in itertools.product((0.0, 7.0, 30.0), repeat=2):
        lemma_3 = pytest.approx(d_min_opposite_direction(v_1, v_2, CAR, SLOW))
        assert d_min_longitudinal(v_1, -v_2, True, CAR, SLOW, OWN, WRONG) == lemma_3
        assert d_min_longitudinal(v_2, -v_1, True, SLOW, CAR, WRONG, OWN) == lemma_3


def test_with_a_speed_cap_the_general_distance_is_at_least_lemma_3():
    capped = CAR._replace(v_cap=15.0)
    for v_1, v_2 in itertools.product((0.0, 14.0, 30.0), repeat=2):
        lemma_3 = d_min_opposite_direction(v_1, v_2, capped, capped)
        assert d_min_longitudinal(v_1, -v_2, True, capped, capped, OWN, WRONG) >= lemma_3 - 1e-9


@pytest.mark.parametrize(("v_rear", "v_front"), [(-6.0, 5.0), (-6.0, -2.0), (9.0, -2.0), (-0.5, 0.0), (0.0, -0.5)])
@pytest.mark.parametrize("facing", [False, True])
def test_every_other_combination_grants_each_car_all_it_can_reach(v_rear, v_front, facing):
    d = d_min_longitudinal(v_rear, v_front, facing, CAR, SLOW, WRONG, OWN)
    both = farthest(v_rear, 1.0, 3.5, WRONG) + farthest(-v_front, 2.0, 3.5, OWN)
    assert d == pytest.approx(both, abs=2e-3)


def test_a_leader_that_reverses_is_not_credited_as_one_that_drives_away():
    # Lemma 2 squares the speed of the front car and would hide its sign
    toward = d_min_longitudinal(10.0, -10.0, False, CAR, CAR, WRONG, WRONG)
    away = d_min_longitudinal(10.0, 10.0, False, CAR, CAR, WRONG, WRONG)
    assert toward > d_min_same_direction(10.0, 0.0, CAR, CAR) > away


def test_a_standing_oncoming_car_may_still_start_toward_us():
    facing = d_min_longitudinal(10.0, 0.0, True, CAR, CAR, WRONG, WRONG)
    parked = d_min_longitudinal(10.0, 0.0, False, CAR, CAR, WRONG, WRONG)
    assert facing - parked == pytest.approx(3.28125)


def test_the_distance_never_falls_as_the_cars_close_faster():
    speeds = np.linspace(-20.0, 20.0, 41)
    for facing in (False, True):
        for v_front in (-8.0, 0.0, 8.0):
            d = [d_min_longitudinal(v, v_front, facing, CAR, CAR, WRONG, WRONG) for v in speeds if v >= 0.0]
            assert np.all(np.diff(d) >= 0.0)
        d = [d_min_longitudinal(9.0, -v, facing, CAR, CAR, WRONG, WRONG) for v in speeds]
        assert np.all(np.diff(d) >= 0.0)
