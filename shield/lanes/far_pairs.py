"""Bounds by which pairs that are far apart need not be looked at: what `pair.assess` would say, at less of a price.

They change no result: `assess` is the readable form, and its margin is never below them.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import reach, stopping_distance
from rss_shield.shield.lanes.pair import slowed
from rss_shield.shield.sampling import euler_margin


@compiled
def own_share(v, cos, params, dt):
    """What a follower may need of the distance of Def. 1: (its way to rest, its margins) [m].

    The way is inf for a car that reverses or is turned round.

    Args:
      v: speed [m/s].
      cos: of the heading relative to the lane.
      params: `RSSParams` of the follower.
      dt: length of a frame [s].
    """
    if v < 0.0 or cos <= 0.0:
        return np.inf, 0.0
    b = params.a_min_brake
    way = reach(v, params.response_time, params.a_max_accel, b, params.v_cap)
    return way, params.standstill_gap + euler_margin(v, b, dt)


@compiled
def least_margin(distance, half_lengths, v, cos, wreck, share_ego, lead_ego, least_cos, table):
    """Lower bound of `Pair.margin_lon` at a fraction of the price of `assess` [m]; -inf where none is known.

    Args:
      distance: along the lane from the ego to the user, positive ahead [m].
      half_lengths: of both, added up, or more [m].
      v, cos, wreck: of the user, as in `ROAD_USER`.
      share_ego: `own_share` of the ego.
      lead_ego: `leading_speed` of the ego.
      least_cos: `least_cosine`.
      table: as in `assess`.
    """
    if v < 0.0 or cos <= 0.0 or share_ego[0] == np.inf:
        return -np.inf
    if distance >= 0.0:
        way, margins = share_ego
        way -= _credit(slowed(v, cos, wreck, least_cos), table.ego, table.other)
    else:
        way, margins = own_share(v, cos, table.other, table.dt)
        way -= _credit(lead_ego, table.other, table.ego)
    return abs(distance) - half_lengths - (max(way, 0.0) + margins)


@inner
def _credit(v_front, rear, front):
    """The leader's own way to rest [m]; 0 if the cars may be closest before they stand."""
    if rear.a_min_brake > front.a_max_brake:
        return 0.0
    return stopping_distance(1.0, front.a_max_brake) * v_front**2  # the first factor is the same for all leaders
