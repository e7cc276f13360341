"""Slip and steering of highway-env's kinematic bicycle, in numpy's arithmetic: what highway-env itself computes.

The engine's own, for many cars at once and to the last bit the same, are in `envs.roads.steering`.
"""

import numpy as np
from numba.extending import register_jitable


@register_jitable
def slip_of(steering):
    """Slip angle of a car's centre, half-way between its axles, at a steering angle; numbers or arrays [rad]."""
    return np.arctan(0.5 * np.tan(steering))


@register_jitable
def steering_of(slip):
    """The inverse of `slip_of` [rad]."""
    return np.arctan(2.0 * np.tan(slip))
