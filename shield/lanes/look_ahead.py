"""Whom anticipation may be about, and how far it caps the command for each of them."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.lateral import d_min_no_credit
from rss_shield.shield.geometry import signed_gap
from rss_shield.shield.ground import table_of_kind
from rss_shield.shield.lanes.anticipation import acceleration_cap, farthest_bound, lateral_cap
from rss_shield.shield.lanes.pair import is_following, toward
from rss_shield.shield.sampling import lateral_euler_margin, sampling_margin


class LookAhead(NamedTuple):
    """Whom anticipation may be about."""

    within: float  # margin below which it may bind behind a leader that stands, -inf = never [m]
    horizon: float  # how much farther per speed of the leader [s]
    lateral: float  # distance across the lane that keeps a car safe which does not move sideways [m]


@compiled
def look_ahead_of(ego, table):
    """`LookAhead` of the ego on one frame."""
    rules, dt = table.rules, table.dt
    if rules.anticipation == 0.0:
        return LookAhead(-np.inf, 0.0, 0.0)
    w = max(toward(1.0, ego), toward(-1.0, ego), 0.0)
    lateral = d_min_no_credit(w, 0.0, table.ego, table.other) + rules.overlap_margin
    lateral += lateral_euler_margin(w, table.ego, dt) + sampling_margin(0.0, table.other, dt)
    within, horizon = farthest_bound(max(ego.speed, 0.0), table.ego, table.other, rules.anticipation, dt)
    return LookAhead(within, horizon, lateral)


@inner
def look_ahead_at(look, ego, table, others, kind):
    """`LookAhead` at one road user; `look`: at those who are like `Table.other`, `others`: `Table.others`."""
    if others is None:
        return look
    return look_ahead_of(ego, table_of_kind(table, others, kind))


@compiled
def may_bind(ahead, margin, gap_lat, drifts, speed, look):
    """May anticipation cap the ego's acceleration for somebody? If not, nothing depends on measuring the pair.

    Args:
      ahead: of the ego.
      margin: a lower bound of the margin of Def. 1 [m].
      gap_lat: across the lane, or less [m].
      drifts: does the user move sideways?
      speed: of the user [m/s].
      look: `LookAhead`.
    """
    if not ahead or (gap_lat >= look.lateral and not drifts):
        return False
    return margin < look.within + look.horizon * max(speed, 0.0)


@inner
def may_bind_for(ego, user, margin, look):
    """`may_bind` of a measured pair."""
    gap_lat = signed_gap(user.y - ego.y, ego.half_width, user.half_width)
    return may_bind(user.s >= ego.s, margin, gap_lat, user.u != 0.0 or user.sin != 0.0, user.speed, look)


class Caps(NamedTuple):
    """How far anticipation lets the ego go."""

    acceleration: float  # [m/s^2]
    left: float  # speed toward either side [m/s]
    right: float


@inner
def anticipate(caps, pair, memory, table):
    """`Caps` after one more pair that is safe: by one axis alone, so that it must not come to lose that one.

    Args:
      caps: so far.
      pair: `Pair`.
      memory: its `MEMORY` record.
      table: `Table` of this pair.
    """
    rules = table.rules
    if rules.anticipation == 0.0 or memory.since > 0 or pair.safe_lon == pair.safe_lat:
        return caps
    if pair.safe_lon:
        return Caps(min(caps.acceleration, _cap_behind(pair, memory, table)), caps.left, caps.right)
    limit = lateral_cap(pair.margin_lat, pair.w_ego, pair.w_other, table.ego, rules.anticipation, table.dt)
    if pair.side > 0.0:
        return Caps(caps.acceleration, caps.left, min(caps.right, limit))
    return Caps(caps.acceleration, min(caps.left, limit), caps.right)


@inner
def _cap_behind(pair, memory, table):
    """Cap of the acceleration behind a pair's other, inf where it is not ahead the same way [m/s^2]."""
    if not pair.ego_is_rear or not is_following(pair.v_ego, pair.v_other, pair.opposite):
        return np.inf
    return acceleration_cap(
        pair.gap_lon,
        pair.margin_lon,
        pair.v_ego,
        pair.v_other,
        memory.acceleration_other,
        table.ego,
        table.other,
        table.rules.anticipation,
        table.dt,
    )
