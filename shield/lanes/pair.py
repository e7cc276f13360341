"""One ego-other pair in the lane frame of the ego: gaps, speeds, and whether each axis is safe."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, records
from rss_shield.shield.definitions.lateral import d_min_no_credit, d_min_of_pair
from rss_shield.shield.definitions.longitudinal import d_min_longitudinal, is_safe_longitudinally
from rss_shield.shield.geometry import signed_gap
from rss_shield.shield.sampling import euler_margin, lateral_euler_margin, reach_from_rest, sampling_margin

# One road user in the lane frame of the ego. SI units; lateral values positive to the right.
ROAD_USER = records(
    [
        ("s", "f8"),  # arc length of the centre
        ("y", "f8"),  # lateral offset of the centre
        ("heading", "f8"),  # relative to the lane
        ("cos", "f8"),  # of the heading
        ("sin", "f8"),  # less what the bend of the lane explains of a car that keeps to it
        ("speed", "f8"),  # along its own heading, negative in reverse
        ("along", "f8"),  # speed along the lane over the last frame, slip included
        ("u", "f8"),  # speed across the lane over the last frame: what `y` changed by
        ("around", "f8"),  # way round to the same place again; inf where there is none
        ("half_length", "f8"),
        ("half_width", "f8"),
        ("in_own_lane", "?"),  # drives in a lane meant for its direction
        ("wreck", "?"),  # has crashed, or never moves: it may stop on the spot
    ]
)


STANDSTILL = 1e-6  # slower than this is standing [m/s]


class Pair(NamedTuple):
    """What Defs. 1-9 say about the ego and one other road user now."""

    safe_lon: bool
    safe_lat: bool
    margin_lon: float  # gap minus required gap [m]
    margin_lat: float
    gap_lon: float  # [m]
    gap_lat: float
    ego_is_rear: bool
    opposite: bool  # they drive in opposite directions
    side: float  # +1 the other is on the right of the ego, -1 on the left
    v_ego: float  # speeds along the lane, in the ego's direction, as the distance assumes them [m/s]
    v_other: float
    w_ego: float  # speeds toward each other across the lane, not negative [m/s]
    w_other: float
    hems_in: bool  # a standing ego has no room to back up toward the other, which is behind it
    way_back: float  # else how far it may [m]


@compiled
def toward(side, user):
    """Lateral speed toward `side`: the larger of the last frame's and the one the heading commits to [m/s].

    The slip angle acts at once, so the speed of the last frame alone hides what the next one does.
    """
    return max(side * user.u, side * user.speed * user.sin)


@compiled
def assess(ego, user, table):
    """Evaluate both axes of one pair on one frame.

    Args:
      ego, user: `ROAD_USER` records.
      table: `Table` in force.

    Returns:
      `Pair`.
    """
    rules, dt = table.rules, table.dt
    ego_is_rear = user.s >= ego.s
    opposite = user.cos < 0.0
    side = 1.0 if user.y >= ego.y else -1.0
    gap_lon = signed_gap(user.s - ego.s, ego.half_length, user.half_length)
    gap_lat = signed_gap(user.y - ego.y, ego.half_width, user.half_width)

    v_ego, v_other, d_lon = _longitudinal(ego, user, ego_is_rear, opposite, table)

    w_ego, w_other = toward(side, ego), toward(-side, user)
    if rules.no_credit:
        d_lat = d_min_no_credit(w_ego, w_other, table.ego, table.other)
    else:
        d_lat = d_min_of_pair(w_ego, w_other, table.ego, table.other)
    w_ego, w_other = max(w_ego, 0.0), max(w_other, 0.0)
    if rules.discretisation_margin:
        d_lat += lateral_euler_margin(w_ego, table.ego, dt) + sampling_margin(w_other, table.other, dt)
    d_lat += rules.overlap_margin

    hems_in, way_back = False, 0.0
    if not ego_is_rear and v_ego == 0.0 and is_following(v_ego, v_other, opposite):
        # the distance of Lemma 2 leaves a leader nothing to go back
        way_back = reach_from_rest(table.ego, table.ego.a_min_brake, dt)
        hems_in = gap_lon < d_lon + way_back
        way_back = 0.0 if hems_in else way_back

    return Pair(
        is_safe_longitudinally(gap_lon, d_lon),
        gap_lat >= d_lat,
        gap_lon - d_lon,
        gap_lat - d_lat,
        gap_lon,
        gap_lat,
        ego_is_rear,
        opposite,
        side,
        v_ego,
        v_other,
        w_ego,
        w_other,
        hems_in,
        way_back,
    )


@compiled
def leading_speed(user, rules):
    """Least speed along the lane that a leader is expected to have [m/s].

    It may turn within the heading bound while it brakes, and a wreck may stop on the spot.
    """
    return slowed(user.speed, user.cos, user.wreck, least_cosine(rules))


@compiled
def least_cosine(rules):
    """Cosine of the largest angle to the lane within the heading bound."""
    return np.sqrt(1.0 - rules.heading_bound**2) if rules.heading_bound < 1.0 else 1.0


@compiled
def slowed(v, cos, wreck, least_cos):
    """`leading_speed` of a user that drives at `v` [m/s]; `cos`, `wreck` as in `ROAD_USER`."""
    v = v * min(cos, least_cos)
    return min(v, 0.0) if wreck else v


@inner
def _longitudinal(ego, user, ego_is_rear, opposite, table):
    """Speeds along the lane as Def. 1 or 2 must assume them, and the required gap."""
    rules, dt = table.rules, table.dt
    # A follower may turn back into the lane at any time: its whole speed counts.
    # An ego that backs up may straighten, too.
    v_ego = _fastest(ego) if ego_is_rear else min(leading_speed(ego, rules), ego.speed)
    if opposite:
        v_other = -user.speed
        if user.wreck and ego_is_rear:
            v_other = min(v_other, 0.0)
    else:
        v_other = leading_speed(user, rules) if ego_is_rear else _fastest(user)
    v_ego, v_other = _settled(v_ego), _settled(v_other)

    b_ego, b_other = head_on_braking(opposite, user.in_own_lane, table.ego, table.other)
    if ego_is_rear:
        d = d_min_longitudinal(v_ego, v_other, opposite, table.ego, table.other, b_ego, b_other)
    else:
        d = d_min_longitudinal(v_other, v_ego, opposite, table.other, table.ego, b_other, b_ego)
    if rules.discretisation_margin:
        direction = 1.0 if ego_is_rear else -1.0
        if is_following(v_ego, v_other, opposite):
            b_rear = table.ego.a_min_brake if ego_is_rear else table.other.a_min_brake
            d += euler_margin(direction * (v_ego - v_other), b_rear, dt)
        else:
            d += euler_margin(direction * v_ego, b_ego, dt) + euler_margin(-direction * v_other, b_other, dt)
    return v_ego, v_other, d


@inner
def _fastest(user):
    """Speed along the lane that a follower must be expected to have [m/s]: one turned round may reverse forward."""
    return max(user.speed, user.speed * user.cos)


@inner
def _settled(v):
    """A speed without the rounding error that a car which has just stopped is left with [m/s]."""
    return 0.0 if abs(v) < STANDSTILL else v


@compiled
def is_following(v_ego, v_other, opposite):
    """Do both drive the same way, so that Lemma 2 holds and not the sum of two reaches?"""
    return not opposite and v_ego >= 0.0 and v_other >= 0.0


@compiled
def head_on_braking(opposite, other_in_own_lane, ego_params, other_params):
    """Braking owed by the ego and by the other where they are not following each other (Def. 2) [m/s^2]."""
    if not opposite:
        return ego_params.a_min_brake, other_params.a_min_brake
    if other_in_own_lane:
        return ego_params.a_min_brake, other_params.a_min_brake_correct
    return ego_params.a_min_brake_correct, other_params.a_min_brake
