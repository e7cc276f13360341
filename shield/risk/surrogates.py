"""The usual measures of criticality beside the field, under the names of CommonRoad-CriMe.

`time_to_collision` (TTC) is the shield's own, in `shield.definitions.kinematics`.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.definitions.kinematics import stopping_distance, time_to_collision
from rss_shield.shield.geometry import signed_gap


class Surrogates(NamedTuple):
    """Measures toward the road user ahead in the ego's way."""

    ttc: float  # TTC [s]
    thw: float  # THW [s]
    drac: float  # DRAC [m/s^2]
    lead: int  # index of the nearest one ahead, -1 if nobody is


@compiled
def inverse_ttc(gap, closing):
    """TTCi [1/s], the paper's measure for comparison: 0 when not closing."""
    return 1.0 / time_to_collision(gap, closing) if gap > 0.0 else (np.inf if closing > 0.0 else 0.0)


@compiled
def time_headway(gap, v):
    """THW of CriMe [s]: time until the ego, at its speed `v` [m/s], is where a leader `gap` [m] ahead is now."""
    return max(gap, 0.0) / v if v > 0.0 else np.inf


@compiled
def required_braking(gap, closing):
    """DRAC [m/s^2], minus the ALongReq of CriMe for a leader at constant speed: braking that just avoids contact.

    Args:
      gap: [m].
      closing: speed at which it shrinks [m/s]; 0 is returned when it does not, inf at contact.
    """
    if closing <= 0.0:
        return 0.0
    return stopping_distance(closing, 1.0) / gap if gap > 0.0 else np.inf


@compiled
def toward_leader(ego, users):
    """`Surrogates` toward the nearest road user ahead whose lane frame box overlaps the ego's way.

    Args:
      ego: `ROAD_USER` record of `shield.lanes.pair`.
      users: `[N]` likewise, of everybody else.
    """
    lead, gap = -1, np.inf
    for i in range(len(users)):
        user = users[i]
        if user.s >= ego.s and signed_gap(user.y - ego.y, user.half_width, ego.half_width) < 0.0:
            here = signed_gap(user.s - ego.s, user.half_length, ego.half_length)
            if here < gap:
                lead, gap = i, here
    if lead < 0:
        return Surrogates(np.inf, np.inf, 0.0, -1)
    v = ego.speed * ego.cos
    closing = v - users[lead].speed * users[lead].cos
    return Surrogates(time_to_collision(gap, closing), time_headway(gap, v), required_braking(gap, closing), lead)
