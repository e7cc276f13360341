"""Def. 1 and Lemma 2: the safe distance to a car ahead that drives the same way."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.longitudinal import d_min_same_direction, is_safe_longitudinally
from rss_shield.shield.params import PRESETS

# rho 1 s, acceleration 3.5, braking 4 (rear) against 8 (front) m/s^2, no standstill gap, no speed cap
CAR = PRESETS["slides"].ego._replace(standstill_gap=0.0)


def random_driver(rng, brakes_harder=False):
    """Drivers of all sorts; those behind may brake harder than those ahead only if asked for (hole H1)."""
    return CAR._replace(
        response_time=rng.uniform(0.05, 2.5),
        a_max_accel=rng.uniform(0.0, 5.0),
        a_min_brake=rng.uniform(6.0, 9.0) if brakes_harder else rng.uniform(2.0, 6.0),
        a_max_brake=rng.uniform(3.0, 6.0) if brakes_harder else rng.uniform(6.0, 10.0),
        v_cap=rng.choice([math.inf, 15.0, 30.0]),
    )


def travelled(speed, dt):
    """Distance covered up to each sample of a speed profile."""
    steps = 0.5 * (speed[1:] + speed[:-1]) * dt
    return np.concatenate((np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)))


def worst_case(v_rear, v_front, rear, front, dt=1e-3):
    """Distances covered by a rear car that uses all it may and a front car that brakes as hard as it may."""
    t = np.arange(0.0, 30.0, dt)
    speed = np.minimum(v_rear + rear.a_max_accel * np.minimum(t, rear.response_time), max(v_rear, rear.v_cap))
    speed = np.maximum(speed - rear.a_min_brake * np.maximum(t - rear.response_time, 0.0), 0.0)
    return travelled(speed, dt), travelled(np.maximum(v_front - front.a_max_brake * t, 0.0), dt)


# ---------------------------------------------------------------- golden numbers


def test_two_cars_at_20_metres_per_second_by_hand():
    # response 20 + 1.75 m, then 23.5^2 / 8 = 69.03125 m; the front car stops in 400 / 16 = 25 m
    assert d_min_same_direction(20.0, 20.0, CAR, CAR) == 65.78125
    # rho 0.5, acceleration 3: 10 + 0.375 + 21.5^2 / 8 - 25
    nimble = CAR._replace(response_time=0.5, a_max_accel=3.0)
    assert d_min_same_direction(20.0, 20.0, nimble, nimble) == 43.15625


def test_a_standing_car_may_still_pull_away():
    # 1.75 m in the first second, then 3.5^2 / 8 = 1.53125 m
    assert d_min_same_direction(0.0, 0.0, CAR, CAR) == 3.28125


def test_a_much_faster_front_car_needs_no_distance():
    assert d_min_same_direction(10.0, 30.0, CAR, CAR) == 0.0


def test_the_standstill_gap_of_the_rear_car_comes_on_top():
    polite = CAR._replace(standstill_gap=1.0)
    assert d_min_same_direction(20.0, 20.0, polite, CAR) == 66.78125
    assert d_min_same_direction(10.0, 30.0, polite, CAR) == 1.0
    assert d_min_same_direction(20.0, 20.0, CAR, polite) == 65.78125


def test_rho_acceleration_and_weak_braking_are_the_rear_cars_and_hard_braking_the_front_cars():
    other = CAR._replace(response_time=2.0, a_max_accel=1.0, a_min_brake=2.0)
    assert d_min_same_direction(20.0, 20.0, CAR, other) == 65.78125
    assert d_min_same_direction(20.0, 20.0, CAR._replace(a_max_brake=5.0), CAR) == 65.78125


def test_nobody_accelerates_beyond_the_speed_cap():
    # to 22 m/s in 4/7 s: 12 m; 3/7 s at 22 m/s: 66/7 m; braking 22^2 / 8 = 60.5 m; less 25 m
    capped = CAR._replace(v_cap=22.0)
    assert d_min_same_direction(20.0, 20.0, capped, capped) == pytest.approx(47.5 + 66 / 7)
    # faster than the cap already: keeps 25 m/s; 25 + 78.125 - 25
    assert d_min_same_direction(25.0, 20.0, capped, capped) == pytest.approx(78.125)


# ---------------------------------------------------------------- hole H1: closest in the middle of braking


def test_a_rear_car_that_brakes_harder_may_be_closest_while_both_still_roll():
    # no response time, braking 8 behind 4 m/s^2, 30 and 20 m/s: equal speeds after 2.5 s,
    # 50 m against 37.5 m by then; at rest 56.25 m against 50 m
    rear = CAR._replace(response_time=0.0, a_max_accel=0.0, a_min_brake=8.0)
    front = CAR._replace(a_max_brake=4.0)
    assert d_min_same_direction(30.0, 20.0, rear, front) == 12.5
    assert d_min_same_direction(30.0, 20.0, rear, front, "lemma2") == 6.25


def test_both_modes_agree_where_the_rear_car_brakes_no_harder_than_the_front_car():
    rng = np.random.default_rng(1)
    v_rear, v_front = rng.uniform(0.0, 40.0, (2, 2000))
    exact = d_min_same_direction(v_rear, v_front, CAR, CAR, "exact")
    assert exact.tolist() == d_min_same_direction(v_rear, v_front, CAR, CAR, "lemma2").tolist()


def test_the_printed_closed_form_is_never_above_the_exact_distance():
    rng = np.random.default_rng(2)
    v_rear, v_front = rng.uniform(0.0, 40.0, (2, 2000))
    some_differ = False
    for _ in range(50):
        rear, front = random_driver(rng, brakes_harder=True), random_driver(rng, brakes_harder=True)
        exact = d_min_same_direction(v_rear, v_front, rear, front, "exact")
        lemma2 = d_min_same_direction(v_rear, v_front, rear, front, "lemma2")
        assert np.all(exact >= lemma2)
        some_differ = some_differ or bool(np.any(exact > lemma2 + 1.0))
    assert some_differ


def test_an_unknown_mode_is_refused():
    with pytest.raises(ValueError, match="'exact' or 'lemma2'"):
        d_min_same_direction(20.0, 20.0, CAR, CAR, "printed")


# ---------------------------------------------------------------- theorems


@pytest.mark.parametrize("brakes_harder", [False, True])
def test_the_distance_is_exactly_what_the_worst_case_uses_up(brakes_harder):
    rng = np.random.default_rng(3)
    for _ in range(150):
        rear, front = random_driver(rng, brakes_harder), random_driver(rng, brakes_harder)
        v_rear, v_front = rng.uniform(0.0, 35.0, 2)
        d_rear, d_front = worst_case(v_rear, v_front, rear, front)
        closed = max(np.max(d_rear - d_front), 0.0)
        assert d_min_same_direction(v_rear, v_front, rear, front) == pytest.approx(closed, abs=1e-3)


def test_a_follower_that_starts_nearer_than_the_safe_distance_touches_in_the_worst_case():
    d_rear, d_front = worst_case(20.0, 20.0, CAR, CAR)
    d_min = d_min_same_direction(20.0, 20.0, CAR, CAR)
    assert np.min(d_min - 0.01 + d_front - d_rear) < 0.0
    assert np.min(d_min + 0.01 + d_front - d_rear) > 0.0


def test_random_drivers_inside_their_bounds_never_touch():
    # 20 000 pairs start exactly at the safe distance. Every second the front car draws a new acceleration
    # it may have, the rear car one of the response time first and one of the braking phase afterwards.
    rng = np.random.default_rng(4)
    n, dt = 20_000, 0.02
    v_rear, v_front = rng.uniform(0.0, 35.0, (2, n))
    start = d_min_same_direction(v_rear, v_front, CAR, CAR)
    gap = start.copy()
    smallest = gap.copy()
    for frame in range(500):
        if frame % 50 == 0:
            a_front = rng.uniform(-CAR.a_max_brake, 0.5 * CAR.a_max_accel, n)
            a_front[rng.random(n) < 0.5] = -CAR.a_max_brake
            a_rear = rng.uniform(-CAR.a_max_brake, -CAR.a_min_brake, n)
            a_rear[rng.random(n) < 0.5] = -CAR.a_min_brake
            if frame * dt < CAR.response_time:
                a_rear = rng.uniform(-CAR.a_max_brake, CAR.a_max_accel, n)
                a_rear[rng.random(n) < 0.5] = CAR.a_max_accel
        before = v_front - v_rear
        v_rear, v_front = np.maximum(v_rear + a_rear * dt, 0.0), np.maximum(v_front + a_front * dt, 0.0)
        gap += 0.5 * (before + v_front - v_rear) * dt
        smallest = np.minimum(smallest, gap)
    # a last braking step that ends in the middle of a frame is off by at most b dt^2 / 8
    assert smallest.min() >= -CAR.a_min_brake * dt**2 / 8 - 1e-9
    assert np.mean(smallest < 0.25 * start) > 0.01  # the test does come close


def test_the_distance_grows_with_the_rear_speed_and_shrinks_with_the_front_speed():
    v = np.linspace(0.0, 40.0, 401)
    assert np.all(np.diff(d_min_same_direction(v, np.full_like(v, 17.0), CAR, CAR)) >= 0.0)
    assert np.all(np.diff(d_min_same_direction(np.full_like(v, 17.0), v, CAR, CAR)) <= 0.0)


@pytest.mark.parametrize("brakes_harder", [False, True])
def test_more_careless_drivers_need_more_distance(brakes_harder):
    rng = np.random.default_rng(5)
    for _ in range(300):
        rear, front = random_driver(rng, brakes_harder), random_driver(rng, brakes_harder)
        v_rear, v_front = rng.uniform(0.0, 35.0, 2)
        d = d_min_same_direction(v_rear, v_front, rear, front) - 1e-9
        assert d_min_same_direction(v_rear, v_front, rear._replace(response_time=rear.response_time + 0.1), front) >= d
        assert d_min_same_direction(v_rear, v_front, rear._replace(a_max_accel=rear.a_max_accel + 0.5), front) >= d
        assert d_min_same_direction(v_rear, v_front, rear._replace(a_min_brake=rear.a_min_brake - 0.5), front) >= d
        assert d_min_same_direction(v_rear, v_front, rear._replace(v_cap=rear.v_cap + 3.0), front) >= d
        assert d_min_same_direction(v_rear, v_front, rear, front._replace(a_max_brake=front.a_max_brake + 0.5)) >= d


# ---------------------------------------------------------------- predicate and shapes


def test_overlapping_cars_are_unsafe_even_where_no_distance_is_needed():
    assert not is_safe_longitudinally(-3.0, 0.0)
    assert not is_safe_longitudinally(0.0, 0.0)
    assert is_safe_longitudinally(0.5, 0.0)


def test_the_safe_distance_itself_is_safe():
    assert is_safe_longitudinally(65.78125, 65.78125)
    assert not is_safe_longitudinally(np.nextafter(65.78125, 0.0), 65.78125)


def test_no_car_ahead_is_an_infinite_gap_and_safe():
    assert is_safe_longitudinally(math.inf, 65.78125)


@pytest.mark.parametrize("brakes_harder", [False, True])
def test_arrays_give_what_a_loop_over_floats_gives(brakes_harder):
    rng = np.random.default_rng(6)
    rear, front = random_driver(rng, brakes_harder), random_driver(rng, brakes_harder)
    v_rear, v_front = rng.uniform(0.0, 35.0, (2, 500))
    d = d_min_same_direction(v_rear, v_front, rear, front)
    assert d.tolist() == [d_min_same_direction(r, f, rear, front) for r, f in zip(v_rear, v_front, strict=True)]
    assert np.all(np.isfinite(d)) and np.all(d >= 0.0)


def test_an_array_and_a_float_broadcast():
    v = np.linspace(0.0, 40.0, 5)
    against_20 = [d_min_same_direction(x, 20.0, CAR, CAR) for x in v]
    assert d_min_same_direction(v, 20.0, CAR, CAR).tolist() == against_20
