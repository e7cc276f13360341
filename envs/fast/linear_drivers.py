"""Drivers of `LinearVehicle` and its kinds: accelerations and steering are weighted sums.

A scenario has an array `linear` `[6]` if its traffic is of that kind: the usual weights, in the order of `LINEAR_CAR`,
and the exponent 2. Elsewhere it is None, and numba leaves out what is here.
"""

import numpy as np
from highway_env.vehicle.behavior import AggressiveVehicle, DefensiveVehicle, IDMVehicle, LinearVehicle

from rss_shield.envs._numpy.blas import THREE_ARE_KNOWN
from rss_shield.envs._numpy.floats import clip, dot, dot_3, not_zero, wrap_to_pi
from rss_shield.envs.fast.draws import random, uniform
from rss_shield.envs.fast.record import Unsupported
from rss_shield.envs.fast.state import DIRECT, OBSTACLE
from rss_shield.envs.roads.network import heading_at, local_coordinates
from rss_shield.envs.roads.steering import MAX_STEERING, PURSUIT
from rss_shield.shield._numba.compiled import inner, part

KINDS: dict[str, type[IDMVehicle]] = {
    f"{kind.__module__}.{kind.__name__}": kind
    for kind in (IDMVehicle, LinearVehicle, AggressiveVehicle, DefensiveVehicle)
}
_LOWEST = np.concatenate([LinearVehicle.ACCELERATION_RANGE[0], LinearVehicle.STEERING_RANGE[0]])
_SPAN = np.concatenate(
    [np.diff(LinearVehicle.ACCELERATION_RANGE, axis=0)[0], np.diff(LinearVehicle.STEERING_RANGE, axis=0)[0]]
)


def usual_habits(kind: type[IDMVehicle]) -> np.ndarray | None:
    """`Scenario.linear` of a kind of vehicle, None for IDM.

    Raises:
      Unsupported: nobody knows how numpy rounds a sum of three products here.
    """
    if not issubclass(kind, LinearVehicle):
        return None
    if not THREE_ARE_KNOWN:
        raise Unsupported(f"{kind.__name__} with the way in which numpy rounds here", "IDMVehicle")
    return np.array([*kind.ACCELERATION_PARAMETERS, *kind.STEERING_PARAMETERS, 2.0])


@part
def start_habits(cars, linear):
    """Everybody has the usual habits until told otherwise."""
    if linear is not None:
        for i in range(len(cars)):
            _set_habits(cars[i], linear[0], linear[1], linear[2], linear[3], linear[4])


@inner
def _set_habits(car, speed, approach, gap, turn, shift):
    car.gain_speed, car.gain_approach, car.gain_gap = speed, approach, gap
    car.gain_turn, car.gain_shift = turn, shift


@part
def randomize(cars, episode, i, config, linear):
    """`randomize_behavior` of car `i`."""
    if linear is not None:
        speed = _LOWEST[0] + random(episode) * _SPAN[0]
        approach = _LOWEST[1] + random(episode) * _SPAN[1]
        gap = _LOWEST[2] + random(episode) * _SPAN[2]
        turn = _LOWEST[3] + random(episode) * _SPAN[3]
        _set_habits(cars[i], speed, approach, gap, turn, _LOWEST[4] + random(episode) * _SPAN[4])
    cars[i].delta = uniform(episode, config.delta_low, config.delta_high)


@inner
def linear_acceleration(driver, cars, i, ahead, lanes, s, config):
    """What a driver would have car `i`, -1 = none, do behind car `ahead`, -1 = none [m/s^2]."""
    wanted, approach, gap = 0.0, 0.0, 0.0
    if i >= 0:
        user = cars[i]
        if user.kind != DIRECT and user.kind != OBSTACLE:
            wanted = user.target_speed - user.speed
        if ahead >= 0:
            there, here = s[user.lane, ahead], s[user.lane, i]
            if np.isnan(there):
                there, _ = local_coordinates(lanes[user.lane], cars[ahead].x, cars[ahead].y)
            if np.isnan(here):
                here, _ = local_coordinates(lanes[user.lane], user.x, user.y)
            approach = min(cars[ahead].speed - user.speed, 0.0)
            gap = min(there - here - (config.distance_wanted + max(user.speed, 0.0) * config.time_wanted), 0.0)
    return dot_3(driver.gain_speed, driver.gain_approach, driver.gain_gap, wanted, approach, gap)


@inner
def linear_steering(car, lane, s, lateral, exponent):
    """Steering angle of a car at a point of the lane that it heads for [rad]."""
    speed = not_zero(car.speed)
    turn = wrap_to_pi(heading_at(lane, s + car.speed * PURSUIT) - car.heading) * car.length / speed
    shift = -lateral * car.length / speed**exponent  # of the C library, as highway-env's: no product of the two
    return clip(dot(car.gain_turn, car.gain_shift, turn, shift), -MAX_STEERING, MAX_STEERING)
