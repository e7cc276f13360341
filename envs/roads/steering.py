"""The steering law of highway-env's drivers."""

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs._numpy.floats import clip, not_zero, wrap_to_pi
from rss_shield.envs._numpy.ufuncs import arcsin, arcsin_each, arctan, arctan_each, tan, tan_each
from rss_shield.envs.roads.network import heading_at
from rss_shield.shield._numba.compiled import inner

PURSUIT = ControlledVehicle.TAU_PURSUIT  # [s]
_KP_HEADING = ControlledVehicle.KP_HEADING  # [1/s]
_KP_LATERAL = ControlledVehicle.KP_LATERAL
MAX_STEERING = ControlledVehicle.MAX_STEERING_ANGLE  # [rad]
MAX_SLIP = float(np.arctan(np.tan(MAX_STEERING) / 2))  # of a car's centre [rad]


@inner
def slip_at(steering):
    """Slip of a car's centre at a steering angle [rad]: its axles are equally far from it."""
    return arctan(0.5 * tan(steering))


@inner
def steering_for(slip):
    """The inverse of `slip_at` [rad]."""
    return arctan(2.0 * tan(slip))


@inner
def is_aligned(lane, s, lateral, heading, speed):
    """Is there nothing to steer at a point in lane coordinates?"""
    return (lateral == 0.0) & (heading_at(lane, s + speed * PURSUIT) == heading)


@inner
def steering_angle(lane, s, lateral, heading, speed, length):
    """Steering angle of `ControlledVehicle.steering_control` at a point in lane coordinates [rad]."""
    if is_aligned(lane, s, lateral, heading, speed):
        return 0.0
    course = arcsin(_sine_back(lateral, speed))
    slip = arcsin(_sine_of_slip(lane, s, heading, speed, length, course))
    return clip(steering_for(slip), -MAX_STEERING, MAX_STEERING)


@inner
def steering_within(lane, s, lateral, heading, speed, length, drift):
    """`steering_angle` with a largest speed across the lane, `drift` [m/s], inf = none [rad]."""
    if is_aligned(lane, s, lateral, heading, speed):
        return 0.0
    across = clip(-_KP_LATERAL * lateral, -drift, drift)
    course = arcsin(clip(across / not_zero(speed), -1.0, 1.0))
    slip = arcsin(_sine_of_slip(lane, s, heading, speed, length, course))
    return clip(steering_for(slip), -MAX_STEERING, MAX_STEERING)


@inner
def steer(cars, count, lanes, sight):
    """`steering_angle` for the first `count` cars of `sight.some`, step by step for all of them at once.

    Args:
      cars: `[N]` CAR, their steering is set.
      count: how many of those listed steer; none is aligned.
      lanes: `[L]` LANE.
      sight: this frame's.
    """
    some, x, y = sight.some, sight.x, sight.y
    for b in range(count):
        i = some[b]
        x[b] = _sine_back(sight.lateral[cars[i].target_lane, i], cars[i].speed)
    arcsin_each(x, y, count)
    for b in range(count):
        i = some[b]
        car, k = cars[i], cars[i].target_lane
        x[b] = _sine_of_slip(lanes[k], sight.s[k, i], car.heading, car.speed, car.length, y[b])
    arcsin_each(x, y, count)
    tan_each(y, x, count)
    for b in range(count):
        y[b] = 2 * x[b]
    arctan_each(y, x, count)
    for b in range(count):
        cars[some[b]].steering = clip(x[b], -MAX_STEERING, MAX_STEERING)


@inner
def slip_toward(offset, turn, psi, speed, length):
    """Slip angle that the law steers with, seen from a lane frame [rad].

    Args:
      offset: from the middle of the lane, positive to the right [m].
      turn: heading of the lane where the driver looks, `PURSUIT` ahead, relative to the frame [rad].
      psi: heading of the car, relative to the frame [rad].
      speed: [m/s], length: of the car [m].
    """
    course = clip(np.arcsin(_sine_back(offset, speed)), -np.pi / 4, np.pi / 4)
    rate = _KP_HEADING * wrap_to_pi(turn + course - psi)
    slip = np.arcsin(clip(length / 2 / not_zero(speed) * rate, -1.0, 1.0))
    return clip(slip, -MAX_SLIP, MAX_SLIP)


@inner
def _sine_back(lateral, speed):
    """Sine of the course, relative to the lane, that leads back to its middle."""
    return clip(-_KP_LATERAL * lateral / not_zero(speed), -1.0, 1.0)


@inner
def _sine_of_slip(lane, s, heading, speed, length, course):
    """Sine of the slip that turns a car to a course relative to the lane [rad], bounded to 45 degrees."""
    reference = heading_at(lane, s + speed * PURSUIT) + clip(course, -np.pi / 4, np.pi / 4)
    rate = _KP_HEADING * wrap_to_pi(reference - heading)
    return clip(length / 2 / not_zero(speed) * rate, -1.0, 1.0)
