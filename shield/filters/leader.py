"""Whom the filters that know nothing but a leader look at."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.geometry import signed_gap


class Leader(NamedTuple):
    """The nearest road user ahead, in the way of the ego."""

    gap: float  # bumper to bumper [m]; inf if nobody is there
    speed: float  # along the lane, in the ego's direction [m/s]


@compiled
def leader_of(ego, users, offset, who=None):
    """The nearest of those ahead whom the ego would touch if it went straight on, here or in the lane it heads for.

    Args:
      ego: `ROAD_USER` record.
      users: `[N]` `ROAD_USER` records of everybody else.
      offset: of the ego from the middle of the lane it heads for, positive to the right [m].
      who: `[K]` indices of those who are near, None = everybody.

    Returns:
      `Leader`.
    """
    gap, speed = np.inf, np.inf
    for a in range(how_many(who, users)):
        user = users[which(who, a)]
        if user.s < ego.s or not (_is_in_way(ego, user, ego.y) or _is_in_way(ego, user, ego.y - offset)):
            continue
        distance = signed_gap(user.s - ego.s, ego.half_length, user.half_length)
        if distance < gap:
            gap, speed = distance, user.speed * user.cos
    return Leader(gap, speed)


@inner
def _is_in_way(ego, user, y):
    """Would an ego at `y` [m] across the lane touch a road user?"""
    return signed_gap(user.y - y, ego.half_width, user.half_width) < 0.0
