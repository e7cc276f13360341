"""Def. 21: the trajectories of one driver, and that the occupancy holds all of them."""

import math

import numpy as np
import pytest
from open_space import drive, random_mover, support

from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.definitions.occupancy import (
    CHANGES_GEAR,
    PEDESTRIAN,
    VEHICLE,
    Mover,
    Steering,
    occupied,
    trajectory,
)
from rss_shield.shield.definitions.separation import extent
from rss_shield.shield.params import PRESETS

CAR = PRESETS["ad-rss"].ego
WALKER = CAR._replace(response_time=0.5, a_max_accel=2.0, a_min_brake=2.0, a_max_brake=4.0, v_cap=10.0)
DT = 0.1


def beyond(mover, driver, steering, brakes, rng, assumed=None, n=150):
    """How far random motions get out of the occupancy at worst [m], over time and ten directions.

    `assumed`: (driver, steering) that the occupancy is made of, if others than those who drive.
    """
    occupancy = occupied(mover, *(assumed or (driver, steering)), DT)
    rows = occupancy.braking if brakes else occupancy.going_on
    steps = occupancy.bounds.steps
    track = drive(mover, driver, steering, brakes, rng, n, steps * DT)
    at = track.time / DT
    worst = -np.inf
    for angle in np.arange(10) * np.pi / 5 + 0.1:
        nx, ny = np.cos(angle), np.sin(angle)
        ends = np.array([extent(occupancy, rows, k, nx, ny) for k in range(steps)])
        step = np.minimum(at.astype(int), steps - 1)
        share = at - step
        bound = ends[step, 0] * (1 - share) + ends[step, 1] * share + occupancy.bounds.slack
        worst = max(worst, float((support(track, mover, nx, ny) - bound).max()))
    return worst


CASES = {
    "cars": (CAR, VEHICLE),
    "cars that change gear": (CAR._replace(response_time=0.6), CHANGES_GEAR),
    "quick drivers of tight turns": (PRESETS["simulator"].ego, Steering(1.0, 3.0, True, 1)),
    "at a speed cap": (CAR._replace(v_cap=6.0), VEHICLE._replace(yaw_acceleration=0.8)),
    "pedestrians": (WALKER, PEDESTRIAN),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("brakes", [True, False])
def test_no_motion_leaves_the_occupancy(name, brakes):
    driver, steering = CASES[name]
    rng = np.random.default_rng(1)
    for _ in range(6):
        mover = random_mover(rng, heading=rng.uniform(-3.0, 3.0), v_max=2.0 if driver is WALKER else 8.0)
        if driver is WALKER:
            mover = mover._replace(half_length=0.3, half_width=0.3, yaw_rate=0.0)
        # the fine steps of the simulation themselves cost up to a millimetre
        assert beyond(mover, driver, steering, brakes, rng) < 2e-3


WRONG = {
    "who would turn less": (CAR, VEHICLE, (CAR, VEHICLE._replace(yaw_acceleration=0.15))),
    "who would turn wider": (CAR, VEHICLE._replace(yaw_acceleration=9.0), (CAR, Steering(9.0, 7.0, True, 0))),
    "who would accelerate less": (CAR, VEHICLE, (CAR._replace(a_max_accel=3.0), VEHICLE)),
    "who would brake harder": (CAR, VEHICLE, (CAR._replace(a_min_brake=4.5), VEHICLE)),
    "who would react sooner": (CAR, VEHICLE, (CAR._replace(response_time=0.8), VEHICLE)),
    "who would straighten up": (CAR, VEHICLE, (CAR, VEHICLE._replace(keeps_turning=False))),
    "who would not change gear": (CAR, CHANGES_GEAR, (CAR, VEHICLE)),
    "who would not turn on the spot": (WALKER, PEDESTRIAN, (WALKER, PEDESTRIAN._replace(sets_out=0))),
}


@pytest.mark.parametrize("name", WRONG)
def test_the_occupancy_of_another_driver_is_left(name):
    driver, steering, assumed = WRONG[name]
    rng = np.random.default_rng(2)
    movers = [random_mover(rng, v_max=2.0 if driver is WALKER else 6.0) for _ in range(6)]
    movers += [movers[0]._replace(v=0.0, yaw_rate=0.0)]
    assert max(beyond(mover, driver, steering, True, rng, assumed) for mover in movers) > 0.02


def test_ahead_the_occupancy_reaches_as_far_as_the_driver_and_no_farther():
    for v in (0.0, 3.0, 12.0):
        mover = Mover(1.0, 2.0, 0.7, v, 0.0, 2.5, 1.0)
        occupancy = occupied(mover, CAR, VEHICLE._replace(yaw_acceleration=0.0), DT)
        _, end = extent(occupancy, occupancy.braking, occupancy.bounds.steps, math.cos(0.7), math.sin(0.7))
        assert end == pytest.approx(2.5 + reach(v, 1.0, 3.5, 4.0, 100.0))
        _, end = extent(occupancy, occupancy.braking, occupancy.bounds.steps, -math.sin(0.7), math.cos(0.7))
        assert end == pytest.approx(1.0)


def test_a_pedestrian_that_stands_owns_a_disc_of_half_a_metre():
    driver = WALKER._replace(v_cap=math.inf)
    occupancy = occupied(Mover(0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0), driver, PEDESTRIAN, DT)
    for angle in np.linspace(-3.0, 3.0, 11):
        _, end = extent(occupancy, occupancy.braking, 20, math.cos(angle), math.sin(angle))
        assert end == pytest.approx(0.5)


def test_single_trajectories_agree_with_fine_integration():
    rng = np.random.default_rng(3)
    for _ in range(20):
        mover = random_mover(rng, *rng.uniform(-9.0, 9.0, 3))
        a, turn, b = rng.uniform(0.0, 3.5), rng.uniform(-0.3, 0.3), rng.uniform(4.0, 8.0)
        x, y, heading, v, w = mover.x, mover.y, mover.heading, mover.v, mover.yaw_rate
        dt, t, curvature = 1e-4, 0.0, 0.0
        while t < 3.0 - 1e-9:
            if t < 1.0 - 1e-9:
                step, v_next, turned = (v + 0.5 * a * dt) * dt, v + a * dt, (w + 0.5 * turn * dt) * dt
                w += turn * dt
                curvature = min(max(w / v_next, -1 / 3.5), 1 / 3.5) if v_next > 0.0 else 0.0
            else:
                v_next = max(v - b * dt, 0.0)
                step = 0.5 * (v + v_next) * dt
                turned = curvature * step
            x, y = x + step * math.cos(heading + turned / 2), y + step * math.sin(heading + turned / 2)
            heading, v, t = heading + turned, v_next, t + dt
        expected = trajectory(3.0, mover, CAR, VEHICLE, a, turn, b)
        assert expected == pytest.approx((x, y, heading, v), abs=2e-3)


def test_too_few_steps_are_refused():
    fast = Mover(0.0, 0.0, 0.0, 30.0, 0.0, 2.5, 1.0)
    with pytest.raises(ValueError, match=r"^dt = 0\.1 .* expected >= "):
        occupied(fast, CAR, VEHICLE, 0.1)
    occupied(fast, CAR, VEHICLE, 0.2)
    with pytest.raises(ValueError, match=r"^steps = 80 .* expected 1 to 62"):
        occupied(fast, CAR, VEHICLE, 0.2, 80)
