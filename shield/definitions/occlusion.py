"""Caution where the view is limited: whom a driver must expect where nobody can be seen. Defs. 23-26.

At every place that is hidden there is a ghost: a road user of the worst kind that is still reasonable there, which has
kept its own proper response so far. The ordinary rules hold toward ghosts. What is reasonable is a published table.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import choose, compiled, compiled_for_arrays, larger, smaller
from rss_shield.shield.definitions.kinematics import travel


class Reasonable(NamedTuple):
    """Speeds that must be expected of hidden road users of one class in one place (Def. 24)."""

    v_low: float  # [m/s]
    v_high: float  # [m/s]
    source: str


_KMH = 1 / 3.6
# by class and place
REASONABLE: dict[tuple[str, str], Reasonable] = {
    ("pedestrian", "crossing"): Reasonable(0.0, 10 * _KMH, "the article on RSS: 10 km/h"),
    ("pedestrian", "roadside"): Reasonable(0.0, 10 * _KMH, "the article on RSS: 10 km/h"),
    ("pedestrian", "parked cars"): Reasonable(0.0, 10 * _KMH, "our choice: a child runs out as fast as on a crossing"),
    ("cyclist", "road"): Reasonable(0.0, 25 * _KMH, "our choice: where electric bicycles stop helping"),
    ("car", "parking row"): Reasonable(0.0, 10 * _KMH, "our choice: walking pace"),
    ("car", "residential"): Reasonable(0.0, 30 * _KMH, "our choice: the limit of a 30 km/h zone"),
    ("car", "urban"): Reasonable(0.0, 50 * _KMH, "our choice: the limit in towns, Vienna Convention countries"),
    ("car", "priority road"): Reasonable(0.0, 70 * _KMH, "our choice: more than in town, as the paper asks"),
}


# ---------------------------------------------------------------- Def. 23: what has been seen, and when


@compiled
def exposure_time(time, visible):
    """Def. 23: the first time at which an object is seen [s]; inf if it never is.

    Args:
      time: `[T]` increasing [s].
      visible: `[T]` bool.
    """
    for k in range(len(time)):
        if visible[k]:
            return time[k]
    return np.inf


@compiled
def is_hidden(x, y, x_point, y_point, obstacles):
    """Does an obstacle stand between the eye and a point? One that only touches the line of sight hides it too.

    Args:
      x, y: of the eye [m].
      x_point, y_point: of the point [m].
      obstacles: `[M, 4]` walls from (x, y) to (x, y) [m].
    """
    dx, dy = x_point - x, y_point - y
    for k in range(len(obstacles)):
        wall = obstacles[k]
        start = dx * (wall[1] - y) - dy * (wall[0] - x)
        end = dx * (wall[3] - y) - dy * (wall[2] - x)
        wx, wy = wall[2] - wall[0], wall[3] - wall[1]
        eye = wx * (y - wall[1]) - wy * (x - wall[0])
        point = wx * (y_point - wall[1]) - wy * (x_point - wall[0])
        if start * end <= 0.0 and eye * point < 0.0:
            return True
    return False


@compiled
def visible_distance(x, y, path, obstacles):
    """How far along a path the eye sees [m], up to the last point before the first hidden one.

    Args:
      x, y: of the eye [m].
      path: `[P, 3]` points x, y and the distance along the path to each [m].
      obstacles: `[M, 4]` walls [m].
    """
    seen = 0.0
    for k in range(len(path)):
        if is_hidden(x, y, path[k, 0], path[k, 1], obstacles):
            return seen
        seen = path[k, 2]
    return seen


# ---------------------------------------------------------------- Defs. 24, 25: whom nobody need expect


@compiled_for_arrays
def is_unreasonable_speed(v, v_low, v_high):
    """Def. 24: is a hidden road user's speed outside what is reasonable for its class and place? Speeds in [m/s]."""
    return (v < v_low) | (v > v_high)


@compiled_for_arrays
def is_unreasonable_behaviour(time, violates, exposure):
    """Def. 25: had a hidden road user broken its proper response, as if both had seen each other, before exposure?

    Args:
      time: `[T]` [s].
      violates: `[T]` bool: breaks it at that time.
      exposure: `exposure_time` [s].
    """
    return bool(np.any(violates & (time < exposure)))


# ---------------------------------------------------------------- Def. 26: how fast one may drive


@compiled_for_arrays
def v_visible(distance, rho, a, b, v_cap=np.inf):
    """Def. 26 on a straight road: largest speed from which one can stop within a distance, `reach(v) = distance` [m/s].

    Negative where none is small enough: whoever stands there already may be too near after its response time.

    Args:
      distance: that one sees [m], a float or an array.
      rho, a, b, v_cap: response time [s], acceleration, braking [m/s^2] and speed cap [m/s] as in `reach`.
    """
    free = np.sqrt(larger((b * rho) ** 2 + 2 * b * (distance + 0.5 * a * rho**2), 0.0)) - b * rho - a * rho
    if np.isinf(v_cap):
        return free
    # reaches the cap within its response time: reach = c rho - (c - v)^2 / 2a + c^2 / 2b
    at_cap = v_cap * rho + v_cap**2 / (2 * b)
    capped = v_cap - np.sqrt(larger(2 * a * (at_cap - distance), 0.0))
    # is faster than the cap already, and does not accelerate
    beyond = np.sqrt(larger((b * rho) ** 2 + 2 * b * distance, 0.0)) - b * rho
    return choose(distance >= at_cap, beyond, choose(free + a * rho > v_cap, capped, free))


@compiled
def permitted_speed(distance, clearance, ghost_reach, driver):
    """Def. 26: largest speed that does not trust in nobody being at one hidden place [m/s]; the smallest of all counts.

    The ghost heads for the ego's way. If it may come into it, the ego must be able to stop before it gets there.

    Args:
      distance: along the ego's way from its front to where the ghost would enter it [m].
      clearance: between the hidden place and the ego's way, bodies included [m].
      ghost_reach: how far the ghost may get at the largest reasonable speed there, `Reasonable.v_high` [m].
      driver: `RSSParams` of the ego.

    Returns:
      inf if the ghost cannot come into the way; 0 if no speed is small enough.
    """
    if ghost_reach < clearance:
        return np.inf
    v = v_visible(distance, driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap)
    return larger(v, 0.0)


@compiled
def permitted_speed_head_on(distance, ghost_reach, driver):
    """Def. 26 for a ghost that comes along the ego's own way from where that is hidden (Def. 2) [m/s]; at least 0.

    Args:
      distance: from the ego's front to the hidden part of its way [m].
      ghost_reach, driver: as in `permitted_speed`.
    """
    v = v_visible(distance - ghost_reach, driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap)
    return larger(v, 0.0)


# ---------------------------------------------------------------- an older rule, for scores only


@compiled
def mean_speed_until_contact(v, t_contact, rho, b):
    """Mean speed of a car that goes on for `rho` after exposure and then brakes, until contact or rest [m/s].

    Args:
      v: speed at exposure > 0 [m/s].
      t_contact: after exposure [s]; inf: the car comes to rest first.
      rho, b: response time [s] and braking [m/s^2].
    """
    end = smaller(t_contact, rho + v / b)
    return travel(end, v, rho, 0.0, b) / end


@compiled
def is_exonerated_by_mean_speed(v, t_contact, rho, b, v_pedestrian):
    """Was the car slower than the pedestrian on average? A rule of an earlier version of the paper, not of safety."""
    return mean_speed_until_contact(v, t_contact, rho, b) < v_pedestrian
