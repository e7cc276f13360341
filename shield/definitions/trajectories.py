"""Two trajectories in open space that do not collide. Defs. 19, 20."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, larger, smaller


@compiled
def stopping_sample(speed):
    """Def. 19: index of the first sample of a trajectory at which it stands for good; `len(speed)` if it never does.

    Args:
      speed: `[T]` >= 0 [m/s].
    """
    k = len(speed)
    while k > 0 and speed[k - 1] <= 0.0:
        k -= 1
    return k


@inner
def _closest_in_step(one, two, k):
    """Smallest distance of two motions from sample `k` to the next [m], and the share of the step before it."""
    x, y = two[k, 0] - one[k, 0], two[k, 1] - one[k, 1]
    dx, dy = two[k + 1, 0] - one[k + 1, 0] - x, two[k + 1, 1] - one[k + 1, 1] - y
    length = dx * dx + dy * dy
    share = 0.0 if length <= 0.0 else smaller(larger(-(x * dx + y * dy) / length, 0.0), 1.0)
    return np.hypot(x + share * dx, y + share * dy), share


@compiled
def first_contact(time, one, two, eps):
    """When two trajectories are first no farther than `eps` apart [s]; inf if never.

    Args:
      time: `[T]` increasing [s].
      one, two: `[T, 3]` x, y [m] and heading [rad] at these times, straight in between.
      eps: clearance >= 0 [m].
    """
    if np.hypot(two[0, 0] - one[0, 0], two[0, 1] - one[0, 1]) <= eps:
        return time[0]
    for k in range(len(time) - 1):
        distance, share = _closest_in_step(one, two, k)
        if distance <= eps:
            return time[k] + share * (time[k + 1] - time[k])
    return np.inf


@compiled
def angle_away(x_1, y_1, x_2, y_2, heading_2):
    """Angle between the way from the first to the second and the heading of the second [rad]; 0: straight away."""
    away = np.arctan2(y_2 - y_1, x_2 - x_1)
    return np.abs((heading_2 - away + np.pi) % (2 * np.pi) - np.pi)


@compiled
def do_not_collide(time, one, two, stop_1, stop_2, eps, theta):
    """Def. 20: do two trajectories not collide? Not commutative.

    Either they are farther than `eps` apart until both have stopped, or until the first has, and the second then
    drives away from it.

    Args:
      time, one, two: as in `first_contact`.
      stop_1, stop_2: samples at which each has stopped, `stopping_sample`; T = never: then as far as the samples go.
      eps: clearance >= 0 [m].
      theta: largest angle that counts as driving away [rad].
    """
    contact = first_contact(time, one, two, eps)
    last = len(time) - 1
    if contact > time[min(max(stop_1, stop_2), last)]:
        return True
    if stop_1 > last or contact <= time[stop_1]:
        return False
    return angle_away(one[stop_1, 0], one[stop_1, 1], two[stop_1, 0], two[stop_1, 1], two[stop_1, 2]) <= theta
