"""The steering law of highway-env's drivers."""

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle

from envs.fast.compiled import merged
from envs.fast.floats import clip, not_zero, wrap_to_pi
from envs.fast.network import heading_at

_PURSUIT = ControlledVehicle.TAU_PURSUIT  # [s]
_KP_HEADING = ControlledVehicle.KP_HEADING  # [1/s]
_KP_LATERAL = ControlledVehicle.KP_LATERAL
_MAX_STEERING = ControlledVehicle.MAX_STEERING_ANGLE  # [rad]


@merged
def is_aligned(lane, s, lateral, heading, speed):
    """Is there nothing to steer at a point in lane coordinates?"""
    return (lateral == 0.0) & (heading_at(lane, s + speed * _PURSUIT) == heading)


@merged
def steering_angle(lane, s, lateral, heading, speed, length):
    """Steering angle of `ControlledVehicle.steering_control` at a point in lane coordinates [rad]."""
    reference = heading_at(lane, s + speed * _PURSUIT)
    if is_aligned(lane, s, lateral, heading, speed):
        return 0.0
    speed = not_zero(speed)
    reference += clip(np.arcsin(clip(-_KP_LATERAL * lateral / speed, -1.0, 1.0)), -np.pi / 4, np.pi / 4)
    rate = _KP_HEADING * wrap_to_pi(reference - heading)
    slip = np.arcsin(clip(length / 2 / speed * rate, -1.0, 1.0))
    return clip(np.arctan(2 * np.tan(slip)), -_MAX_STEERING, _MAX_STEERING)
