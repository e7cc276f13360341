"""One frame of the shield: scene + memory -> danger; danger + nominal command -> restricted command."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.geometry import signed_gap
from rss_shield.shield.ground import table_of
from rss_shield.shield.lanes.far_pairs import least_margin, own_share
from rss_shield.shield.lanes.lane_changes import Rooms, beside
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.look_ahead import Caps, LookAhead, anticipate, look_ahead_at, look_ahead_of, may_bind_for
from rss_shield.shield.lanes.memory import Bounds, catch_up, hold, may_back_up, merge, remember, response_to
from rss_shield.shield.lanes.pair import STANDSTILL, assess, leading_speed, least_cosine
from rss_shield.shield.lanes.restriction import restrict
from rss_shield.shield.sampling import reach_from_rest, slowest_in_danger


class Danger(NamedTuple):
    """What the shield saw on one frame."""

    free: Bounds  # what the ego may do while it owes nobody anything
    bounds: Bounds  # what its duties leave of that
    eased: Bounds  # and what anticipation leaves
    room_left: float  # how far it may go to either side beside who is alongside [m]; inf if nobody is
    room_right: float
    dangerous: bool
    partner: int  # index of the road user nearest to danger, -1 if alone
    margin_lon: float  # of that pair [m]; inf if alone
    margin_lat: float
    response: int  # sum of RESPONSE_BRAKE, RESPONSE_STEER, RESPONSE_PRESENT, RESPONSE_GO
    ttc: float  # time to collision with a car ahead in the way of the ego [s]; inf if none


class Response(NamedTuple):
    """What it makes of the ego's command."""

    command: Command  # what it lets through
    overridden: bool  # a duty toward somebody changed the command
    anticipated: bool  # no duty did, but anticipation
    limited: bool  # only the always-on limits did


_SAFE_BEYOND_DOUBT = 1e-6  # margin of a pair that is far apart: more than rounding can change [m]


@compiled
def find_danger(
    ego,
    users,
    ego_before,
    users_before,
    memory,
    table,
    who=None,
    nearest=np.inf,
    soonest=np.inf,
):
    """Carry the memory of all pairs over to this frame, and find out what the ego owes to whom.

    Pairs that are far apart cannot bound the command and are not looked at. If one comes near later,
    the sample before is taken in first, so nothing depends on that.

    Args:
      ego: `ROAD_USER` record.
      users: `[N]` `ROAD_USER` records of everybody else.
      ego_before, users_before: the same on the frame before; zeros on the first.
      memory: `[N]` `MEMORY` records, changed in place.
      table: `Table` in force.
      who: `[K]` indices in ascending order of those to look at, if not everybody. All others are known to be far
        apart, and marked as skipped.
      nearest: partner and margins are of interest only if nearer to danger than this [m].
      soonest: likewise the time to collision [s].

    Returns:
      `Danger`.
    """
    rules, dt = table.rules, table.dt
    free = always_on(ego, table.ego, rules, dt)
    bounds, caps, rooms = free, Caps(np.inf, np.inf, np.inf), Rooms(np.inf, np.inf)
    worst, partner, margin_lon, margin_lat, ttc = nearest, -1, np.inf, np.inf, soonest
    dangerous, response = False, 0
    own = _own_parts(ego, table)
    held = slowest_in_danger(ego.speed, table.ego, dt)
    for a in range(how_many(who, users)):
        i = which(who, a)
        user, known = users[i], memory[i]
        if known.since == 0 and _is_far_apart(ego, user, own, worst, ttc, table):
            known.skipped = True
            continue
        catch_up(known, ego_before, users_before[i], table)
        pair = assess(ego, user, table)
        remember(known, pair, ego, user, dt)
        bounds = merge(bounds, known, table.ego, rules, dt)
        caps = anticipate(caps, pair, known, table_of(table, user))
        if rules.take_back:
            rooms = beside(rooms, pair, ego, user, table.ego, dt)
        if known.since > 0:
            dangerous = True
            response |= response_to(known, rules)
        if rules.limits and (not may_back_up(known, pair) or (user.vague and known.since > 0)):
            bounds = hold(bounds, held)
        margin = max(pair.margin_lon, pair.margin_lat)
        if margin < worst:
            worst, partner, margin_lon, margin_lat = margin, i, pair.margin_lon, pair.margin_lat
        if pair.gap_lat < 0.0 and pair.ego_is_rear and pair.v_ego > pair.v_other:
            ttc = min(ttc, time_to_collision(pair.gap_lon, pair.v_ego - pair.v_other))
    eased = _eased(bounds, caps)
    return Danger(
        free, bounds, eased, rooms.left, rooms.right, dangerous, partner, margin_lon, margin_lat, response, ttc
    )


class _OwnParts(NamedTuple):
    """What the ego alone contributes to bounds of pairs."""

    share: tuple[float, float]  # `own_share`
    lead: float  # `leading_speed` [m/s]
    least_cos: float  # `least_cosine`
    far: float  # `beyond_doubt` [m]
    look: LookAhead


@inner
def _own_parts(ego, table):
    return _OwnParts(
        own_share(ego.speed, ego.cos, table.ego, table.dt),
        leading_speed(ego, table.rules),
        least_cosine(table.rules),
        beyond_doubt(ego.speed, table.ego, table.dt),
        look_ahead_of(ego, table),
    )


@inner
def _is_far_apart(ego, user, own, worst, ttc, table):
    """Does nothing depend on a pair that is safe? `worst`, `ttc`: what is nearest to danger, and in time, so far."""
    margin = least_margin(
        user.s - ego.s,
        ego.half_length + user.half_length,
        user.speed,
        user.cos,
        user.wreck,
        own.share,
        own.lead,
        own.least_cos,
        table_of(table, user),
    )
    return (
        margin > max(worst, own.far)
        and not _may_be_next(ego, user, ttc, table.rules)
        and not may_bind_for(ego, user, margin, look_ahead_at(own.look, ego, table, table.others, user.kind))
    )


@inner
def _eased(bounds, caps):
    """Bounds after `Caps`."""
    return Bounds(
        bounds.a_lower,
        min(bounds.a_upper, caps.acceleration),
        min(bounds.left, caps.left),
        min(bounds.right, caps.right),
        min(bounds.left_next, caps.left),
        min(bounds.right_next, caps.right),
        bounds.v_lower,
    )


@compiled
def respond(nominal, danger, ego, body, rules, dt):
    """Restrict the ego's nominal command to what RSS permits on this frame.

    Acceleration is clipped after the ego's own controller; an override brakes directly. Steering is
    chosen so that the lateral speed of this frame, the one that the new heading commits to, course and
    heading stay inside their bounds.

    Args:
      nominal: `Command` of the ego's own controller.
      danger: `Danger` on this frame.
      ego: `ROAD_USER` record.
      body: `Body` of the ego.
      rules: `Rules` in force.
      dt: length of a frame [s].

    Returns:
      `Response`.
    """
    limited = restrict(nominal, danger.free, ego, body, rules, dt)
    owed = restrict(nominal, danger.bounds, ego, body, rules, dt) if danger.bounds != danger.free else limited
    command = restrict(nominal, danger.eased, ego, body, rules, dt) if danger.eased != danger.bounds else owed
    overridden = owed != limited
    anticipated = command != owed and not overridden
    return Response(command, overridden, anticipated, limited != nominal and not overridden and not anticipated)


@compiled
def beyond_doubt(v, params, dt):
    """Margin of a pair that is far apart [m]: a standing ego may even begin to back up."""
    if v > STANDSTILL:
        return _SAFE_BEYOND_DOUBT
    return _SAFE_BEYOND_DOUBT + reach_from_rest(params, params.a_min_brake, dt)


@inner
def _may_be_next(ego, user, ttc, rules):
    """`may_be_next` of a measured pair, driving the same way."""
    gap_lon = signed_gap(user.s - ego.s, ego.half_length, user.half_length)
    gap_lat = signed_gap(user.y - ego.y, ego.half_width, user.half_width)
    return may_be_next(user.s >= ego.s, gap_lon, gap_lat, ego.speed - leading_speed(user, rules), ttc)


@compiled
def may_be_next(ahead, gap_lon, gap_lat, closing, ttc):
    """May a user be ahead in the way of the ego, and nearer in time than `ttc` [s]? Gaps [m], closing speed [m/s]."""
    return ahead and gap_lat < 0.0 and closing > 0.0 and gap_lon < ttc * closing
