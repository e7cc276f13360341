"""Pedestrians off the crossings: what is theirs to reach. On crossings they have routes, Defs. 14-18.

A pedestrian may accelerate in any direction during its response time and then walks on that way, braking, until it
stands. What it may reach meanwhile is its own: a car that enters is responsible for the contact, a pedestrian who gets
farther is. The region is bounded by the cone from where it stands to a disc ahead of it: a disc around one that stands.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, compiled_for_arrays, inner
from rss_shield.shield.definitions.kinematics import reach


class Walk(NamedTuple):
    """What pedestrians are assumed to do."""

    response_time: float  # rho  [s]
    a_max_accel: float  # a      [m/s^2]
    a_min_brake: float  # b      [m/s^2]


WALKS = {
    "paper": Walk(0.5, 2.0, 2.0),  # the 50 cm disc; CARLA's C++ default too
    "carla-python": Walk(0.8, 2.0, 2.0),  # CARLA, Python example of the RSS sensor
}


@compiled_for_arrays
def reach_ahead(v, walk):
    """How far a pedestrian of speed `v` >= 0 [m/s] gets in the direction in which it walks [m]; floats or arrays."""
    return reach(v, walk.response_time, walk.a_max_accel, walk.a_min_brake, np.inf)


@compiled
def reach_disc(v, walk):
    """(distance ahead, radius) [m] of the disc that bounds where a pedestrian may come to rest.

    With w = v + rho a: it ends v rho + w v / 2b ahead, but for rho^2 a / 2 + w rho a / 2b in any direction. To the side
    that is more than a standing one reaches, because who walks brakes along its way, not along each axis.

    Args:
      v: speed >= 0 [m/s].
      walk: `Walk`.
    """
    rho, a, b = walk.response_time, walk.a_max_accel, walk.a_min_brake
    w = v + rho * a
    return v * rho + w * v / (2 * b), 0.5 * a * rho**2 + w * rho * a / (2 * b)


@inner
def _to_cone(ahead, aside, centre, radius):
    """Signed distance of a point from the hull of the origin and a disc ahead [m]; negative inside."""
    if centre <= radius:
        return np.hypot(ahead - centre, aside) - radius
    aside = np.abs(aside)
    sin = radius / centre  # of half the opening angle
    cos = np.sqrt(1.0 - sin * sin)
    along = ahead * cos + aside * sin  # along the flank
    if along <= 0.0:
        return np.hypot(ahead, aside)
    if along >= centre * cos:
        return np.hypot(ahead - centre, aside) - radius
    return aside * cos - ahead * sin


@compiled
def distance_to_reach(dx, dy, heading, v, walk):
    """Distance of a point from what a pedestrian may reach [m], negative inside: the bodies' radii are not in it.

    Args:
      dx, dy: from the pedestrian to the point [m].
      heading: in which it walks [rad].
      v: speed >= 0 [m/s].
      walk: `Walk`.
    """
    centre, radius = reach_disc(v, walk)
    cos, sin = np.cos(heading), np.sin(heading)
    return _to_cone(dx * cos + dy * sin, dy * cos - dx * sin, centre, radius)


@compiled
def leaped(dx, dy, heading, v, walk, tolerance=1e-9):
    """Has a pedestrian got farther than it may? Then a contact there is its own doing.

    Args:
      dx, dy: from where it was when the situation became dangerous to where it is [m].
      heading, v: at that time [rad, m/s].
    """
    return distance_to_reach(dx, dy, heading, v, walk) > tolerance
