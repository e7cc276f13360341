"""Def. 4: the longitudinal proper response, in the driver's own driving direction."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.definitions.response import CORRECT, FRONT, REAR, WRONG, braking_owed, longitudinal_response
from rss_shield.shield.params import PRESETS

# rho 1 s, acceleration 3.5, braking 4 to 8, in its own lane 3 m/s^2
CAR = PRESETS["ad-rss"].ego
ROLES = (REAR, FRONT, CORRECT, WRONG)


@pytest.mark.parametrize("role", [REAR, CORRECT, WRONG])
def test_during_the_response_time_only_the_limits_hold(role):
    assert longitudinal_response(role, 0.0, 20.0, CAR) == (-8.0, 3.5)
    assert longitudinal_response(role, 0.999, 20.0, CAR) == (-8.0, 3.5)


def test_afterwards_each_role_brakes_by_its_own_table():
    # the car in its own lane is asked for less
    assert longitudinal_response(REAR, 1.0, 20.0, CAR) == (-8.0, -4.0)
    assert longitudinal_response(WRONG, 1.0, 20.0, CAR) == (-8.0, -4.0)
    assert longitudinal_response(CORRECT, 1.0, 20.0, CAR) == (-8.0, -3.0)
    assert [braking_owed(role, CAR) for role in ROLES] == [4.0, 0.0, 3.0, 4.0]


@pytest.mark.parametrize("role", [REAR, CORRECT, WRONG])
def test_after_standstill_the_car_holds_instead_of_reversing(role):
    assert longitudinal_response(role, 1.0, 0.0, CAR) == (0.0, 0.0)
    assert longitudinal_response(role, 60.0, 0.0, CAR) == (0.0, 0.0)


@pytest.mark.parametrize("tau", [0.0, 0.4, 1.0, 9.0])
@pytest.mark.parametrize("v", [0.0, 20.0])
def test_the_front_car_only_must_not_brake_harder_than_the_model_allows(tau, v):
    assert longitudinal_response(FRONT, tau, v, CAR) == (-8.0, math.inf)


def test_any_set_of_neighbours_can_be_obeyed_at_once():
    rng = np.random.default_rng(1)
    for _ in range(3000):
        b_min = rng.uniform(1.0, 8.0)
        car = CAR._replace(
            response_time=rng.uniform(0.1, 2.0), a_min_brake=b_min, a_min_brake_correct=rng.uniform(0.5, b_min)
        )
        v = rng.choice([0.0, rng.uniform(0.0, 40.0)])
        taus = rng.uniform(0.0, 4.0, 5)
        bounds = [longitudinal_response(rng.choice(ROLES), tau, v, car) for tau in taus]
        assert max(lower for lower, _ in bounds) <= min(upper for _, upper in bounds)


def test_a_pair_that_keeps_the_response_never_touches_and_one_that_forgets_it_does():
    # the induction behind Defs. 1 to 4, over repeated episodes: the rear car accelerates whenever it may,
    # the front car brakes and speeds up at random, 15 times a second, responses as tabulated
    dt, frames = 1 / 15, 1800
    rear = CAR._replace(response_time=dt)
    for forgets in (False, True):
        rng = np.random.default_rng(2)
        v_rear, v_front = 20.0, 20.0
        # each frame advances with the mean speed; a partial last braking step costs b dt^2 / 8 more
        gap = d_min_same_direction(v_rear, v_front, rear, CAR) + 1.0
        tau, smallest, a_front = 0.0, gap, 0.0
        for frame in range(frames):
            needed = d_min_same_direction(v_rear, v_front, rear, CAR) + rear.a_min_brake * dt**2 / 8
            tau = 0.0 if gap >= needed else tau + dt
            upper = 3.5 if tau == 0.0 or forgets else longitudinal_response(REAR, tau, v_rear, rear)[1]
            if frame % 30 == 0:
                a_front = rng.choice([-8.0, 0.0, 3.5, 3.5])
            v_rear_next, v_front_next = max(v_rear + upper * dt, 0.0), min(max(v_front + a_front * dt, 0.0), 30.0)
            gap += 0.5 * (v_front + v_front_next - v_rear - v_rear_next) * dt
            v_rear, v_front = v_rear_next, v_front_next
            smallest = min(smallest, gap)
        assert (smallest < 0.0) == forgets
