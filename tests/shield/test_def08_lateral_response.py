"""Def. 8: the lateral proper response, two-sided as published and one-sided as the shield obeys it."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.lateral import approach_no_credit, d_min_lateral
from rss_shield.shield.definitions.response import lateral_response, lateral_speed_limit
from rss_shield.shield.params import PRESETS
from rss_shield.shield.sampling import lateral_euler_margin

# rho 1 s, lateral acceleration 0.2, lateral braking 0.8 m/s^2
CAR = PRESETS["slides"].ego
LEFT, RIGHT = -1.0, 1.0  # the side the driver is on
INF = math.inf


# ---------------------------------------------------------------- as published


@pytest.mark.parametrize("side", [LEFT, RIGHT])
@pytest.mark.parametrize("u", [-0.4, 0.0, 0.4])
def test_during_the_response_time_lateral_acceleration_is_bounded_both_ways(side, u):
    assert lateral_response(side, 0.5, u, CAR) == (-0.2, 0.2, -INF, INF)


def test_afterwards_a_car_that_moves_toward_the_other_brakes():
    assert lateral_response(LEFT, 1.5, 0.4, CAR) == (-INF, -0.8, -INF, INF)
    assert lateral_response(RIGHT, 1.5, -0.4, CAR) == (0.8, INF, -INF, INF)


@pytest.mark.parametrize("away", [0.0, 0.3])
def test_afterwards_a_car_that_has_stopped_or_moves_away_must_not_come_back(away):
    assert lateral_response(LEFT, 1.5, -away, CAR) == (-INF, INF, -INF, 0.0)
    assert lateral_response(RIGHT, 1.5, away, CAR) == (-INF, INF, 0.0, INF)


def test_the_response_time_ends_at_rho():
    assert lateral_response(LEFT, math.nextafter(1.0, 0.0), 0.4, CAR)[1] == 0.2
    assert lateral_response(LEFT, 1.0, 0.4, CAR)[1] == -0.8


def test_left_and_right_are_mirror_images():
    for tau in (0.3, 1.7):
        for u in (-0.5, 0.0, 0.5):
            a_lower, a_upper, u_lower, u_upper = lateral_response(LEFT, tau, u, CAR)
            assert lateral_response(RIGHT, tau, -u, CAR) == (-a_upper, -a_lower, -u_upper, -u_lower)


def test_as_published_a_car_between_two_may_be_asked_for_the_impossible():
    # hole H22: bounded by 0.2 m/s^2 toward the left car, at least 0.8 m/s^2 of braking for the right one
    for_left_neighbour = lateral_response(RIGHT, 0.5, 0.5, CAR)
    for_right_neighbour = lateral_response(LEFT, 1.5, 0.5, CAR)
    assert max(for_left_neighbour[0], for_right_neighbour[0]) > min(for_left_neighbour[1], for_right_neighbour[1])


# ---------------------------------------------------------------- one-sided, in frames


def test_the_limit_rises_with_the_response_time_then_falls_to_zero_for_good():
    # 0.4 m/s toward the neighbour, frames of 0.25 s: up by 0.05 a frame to 0.6 m/s, then down by 0.2 a frame
    limits = [lateral_speed_limit(frame, 0.4, CAR, 0.25) for frame in range(10)]
    assert limits == pytest.approx([0.45, 0.5, 0.55, 0.6, 0.6, 0.4, 0.2, 0.0, 0.0, 0.0], abs=1e-12)


def test_stopping_at_once_or_moving_away_is_always_allowed():
    for frame in range(60):
        for w in (0.0, 0.3, 2.0):
            assert lateral_speed_limit(frame, w, CAR, 1 / 15) >= 0.0


def test_a_car_between_two_can_always_obey_both():
    # limits toward left and right are both >= 0: no lateral speed at all satisfies them, whatever the phases
    rng = np.random.default_rng(1)
    for _ in range(300):
        dt = rng.choice([1 / 15, 1 / 5])
        car = CAR._replace(response_time=dt * rng.integers(1, 30), a_lat_max_accel=rng.uniform(0.0, 2.0))
        toward_left, toward_right = (
            lateral_speed_limit(int(rng.integers(0, 60)), rng.uniform(0.0, 2.0), car, dt) for _ in range(2)
        )
        assert -toward_left <= 0.0 <= toward_right


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
@pytest.mark.parametrize("frames", [1, 2, 10])
def test_a_car_at_its_limit_comes_no_closer_than_its_share(dt, frames):
    car = CAR._replace(response_time=frames * dt, a_lat_max_accel=1.0, a_lat_min_brake=1.5)
    for w in (0.0, 0.1, 0.73, 2.0):
        come = sum(lateral_speed_limit(frame, w, car, dt) * dt for frame in range(400))
        share = approach_no_credit(w, car) + lateral_euler_margin(w, car, dt)
        assert come <= share + 1e-12
        # and the margin is needed: without it the share would be too small
        assert come > approach_no_credit(w, car) or w == 0.0


def test_two_cars_that_both_keep_the_limit_never_touch_and_one_that_ignores_it_does():
    # many pairs at 15 Hz: in safe frames everybody speeds up sideways at random, in danger one frame late
    # (rho = one frame) everybody is clipped to the limit
    dt, n, frames = 1 / 15, 500, 450
    car = CAR._replace(response_time=dt, a_lat_max_accel=1.0, a_lat_min_brake=1.5, mu=0.0)
    for ignores in (False, True):
        rng = np.random.default_rng(2)
        u_left, u_right, since = np.zeros(n), np.zeros(n), np.zeros(n, int)
        gap, w_left, w_right = np.full(n, 3.0), np.zeros(n), np.zeros(n)
        smallest = np.inf
        for frame in range(frames):
            if frame % 30 == 0:
                wish_left, wish_right = rng.choice([-1.0, 0.5, 1.0, 1.0], (2, n))
            toward_left, toward_right = np.maximum(u_left, 0.0), np.maximum(-u_right, 0.0)
            needed = d_min_lateral(u_left, u_right, car, car)
            needed += lateral_euler_margin(u_left, car, dt) + lateral_euler_margin(-u_right, car, dt)
            safe = gap >= needed
            since = np.where(safe, 0, since + 1)
            w_left, w_right = np.where(safe, toward_left, w_left), np.where(safe, toward_right, w_right)
            # the speed of a frame is chosen at its start; toward the other it grows by at most a dt
            u_left = np.minimum(u_left + wish_left * dt, toward_left + dt)
            u_right = np.maximum(u_right - wish_right * dt, -toward_right - dt)
            for i in np.flatnonzero(~safe):
                if not ignores:
                    u_left[i] = min(u_left[i], lateral_speed_limit(since[i], w_left[i], car, dt))
                u_right[i] = max(u_right[i], -lateral_speed_limit(since[i], w_right[i], car, dt))
            gap += (u_right - u_left) * dt
            smallest = min(smallest, gap.min())
        assert (smallest < 0.0) == ignores
