"""One frame of the shield: scene + memory -> danger; danger + nominal command -> restricted command."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.definitions.lateral import d_min_no_credit
from rss_shield.shield.geometry import signed_gap
from rss_shield.shield.ground import table_of, table_of_kind
from rss_shield.shield.lanes.anticipation import acceleration_cap, farthest_bound, lateral_cap
from rss_shield.shield.lanes.far_pairs import least_margin, own_share
from rss_shield.shield.lanes.frame import outside
from rss_shield.shield.lanes.lane_changes import room_beside
from rss_shield.shield.lanes.memory import (
    Bounds,
    catch_up,
    may_back_up,
    merge,
    owes_braking,
    owes_lateral_stop,
    owes_no_approach,
    remember,
)
from rss_shield.shield.lanes.pair import (
    STANDSTILL,
    assess,
    is_following,
    leading_speed,
    least_cosine,
    toward,
)
from rss_shield.shield.sampling import lateral_euler_margin, reach_from_rest, sampling_margin, slowest_in_danger


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


# PRESENT: brake for who is ahead by now; GO: on through a junction
RESPONSE_BRAKE, RESPONSE_STEER, RESPONSE_PRESENT, RESPONSE_GO = 1, 2, 4, 8

_SAFE_BEYOND_DOUBT = 1e-6  # margin of a pair that is far apart: more than rounding can change [m]
_STEEP = 1.5  # steeper angles to the lane are left to the exact solution [rad]
_CROOKED = 1.2  # times the heading bound: a car turned farther than this does not back up
_HEADING_FIRST = 2.0  # half wheelbases per frame: the heading of a faster car would not calm down by itself
_STRAIGHT = 1.0 / 1.2  # times the heading bound: likewise one that must not move toward somebody beside it


class Body(NamedTuple):
    """What the ego's kinematics add to its `ROAD_USER` record."""

    half_wheelbase: float  # distance from the centre to the rear axle [m]
    max_slip: float  # largest slip angle the steering reaches [rad]
    curvature: float  # of the lane under the ego, see `shield.lanes.frame.Bend` [1/m]
    slack: float = 0.0  # likewise [rad]
    turned: float = 0.0  # likewise [rad]
    idle: float = 0.0  # likewise [rad]
    backs_up: bool = False  # its driver asks for reverse by braking at standstill; others only hold then


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
    bounds, cap, left, right = free, np.inf, np.inf, np.inf
    room_left = room_right = np.inf
    look = look_ahead_of(ego, table)
    worst, partner, margin_lon, margin_lat, ttc = nearest, -1, np.inf, np.inf, soonest
    dangerous, response = False, 0
    share_ego = own_share(ego.speed, ego.cos, table.ego, dt)
    lead_ego, least_cos = leading_speed(ego, rules), least_cosine(rules)
    far, held = beyond_doubt(ego.speed, table.ego, dt), slowest_in_danger(ego.speed, table.ego, dt)
    for a in range(how_many(who, users)):
        i = which(who, a)
        user = users[i]
        margin = least_margin(
            user.s - ego.s,
            ego.half_length + user.half_length,
            user.speed,
            user.cos,
            user.wreck,
            share_ego,
            lead_ego,
            least_cos,
            table_of(table, user),
        )
        if (
            memory[i].since == 0
            and margin > max(worst, far)
            and not _may_be_next(ego, user, ttc, rules)
            and not _may_bind(ego, user, margin, look_ahead_at(look, ego, table, table.others, user.kind))
        ):
            memory[i].skipped = True
            continue
        catch_up(memory[i], ego_before, users_before[i], table)
        pair = assess(ego, user, table)
        remember(memory[i], pair, ego, user, dt)
        bounds = merge(bounds, memory[i], table.ego, rules, dt)
        if rules.limits and (not may_back_up(memory[i], pair) or (user.vague and memory[i].since > 0)):
            bounds = _hold(bounds, held)
        if memory[i].since == 0 and rules.anticipation > 0.0:
            if pair.safe_lon and not pair.safe_lat:
                cap = min(cap, _cap_behind(pair, memory[i], table_of(table, user)))
            elif pair.safe_lat and not pair.safe_lon:
                limit = lateral_cap(pair.margin_lat, pair.w_ego, pair.w_other, table.ego, rules.anticipation, dt)
                if pair.side > 0.0:
                    right = min(right, limit)
                else:
                    left = min(left, limit)
        if rules.take_back and not pair.safe_lon and pair.gap_lat > -min(ego.half_width, user.half_width):
            room = room_beside(pair.margin_lat, pair.w_ego, table.ego, dt)
            if pair.side > 0.0:
                room_right = min(room_right, room)
            else:
                room_left = min(room_left, room)
        if memory[i].since > 0:
            dangerous = True
            braking = owes_braking(memory[i], rules)
            response |= RESPONSE_BRAKE if braking == 1 else (RESPONSE_PRESENT if braking == 2 else 0)
            if owes_lateral_stop(memory[i], rules) or owes_no_approach(memory[i], rules):
                response |= RESPONSE_STEER
                if abs(ego.sin) > _STRAIGHT * rules.heading_bound:
                    bounds = _hold(bounds, held)
        margin = max(pair.margin_lon, pair.margin_lat)
        if margin < worst:
            worst, partner, margin_lon, margin_lat = margin, i, pair.margin_lon, pair.margin_lat
        if pair.gap_lat < 0.0 and pair.ego_is_rear and pair.v_ego > pair.v_other:
            ttc = min(ttc, time_to_collision(pair.gap_lon, pair.v_ego - pair.v_other))
    eased = Bounds(
        bounds.a_lower,
        min(bounds.a_upper, cap),
        min(bounds.left, left),
        min(bounds.right, right),
        min(bounds.left_next, left),
        min(bounds.right_next, right),
        bounds.v_lower,
    )
    rooms = room_left, room_right
    return Danger(free, bounds, eased, *rooms, dangerous, partner, margin_lon, margin_lat, response, ttc)


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
def _may_bind(ego, user, margin, look):
    """`may_bind` of a measured pair."""
    gap_lat = signed_gap(user.y - ego.y, ego.half_width, user.half_width)
    return may_bind(user.s >= ego.s, margin, gap_lat, user.u != 0.0 or user.sin != 0.0, user.speed, look)


@inner
def _hold(bounds, v_lower):
    return Bounds(
        bounds.a_lower, bounds.a_upper, bounds.left, bounds.right, bounds.left_next, bounds.right_next, v_lower
    )


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


@compiled
def always_on(ego, params, rules, dt):
    """Limits that hold even where nobody is in danger (conditions C1, C1y of the sampled proof)."""
    if not rules.limits:
        return Bounds(-np.inf, np.inf, np.inf, np.inf, np.inf, np.inf, min(ego.speed, 0.0))
    cap = max((params.v_cap - ego.speed) / dt, 0.0)
    growth = params.a_lat_max_accel * dt
    left, right = max(toward(-1.0, ego), 0.0) + growth, max(toward(1.0, ego), 0.0) + growth
    slowest = _slowest(ego, params, rules, dt)
    return Bounds(-params.a_max_brake, min(params.a_max_accel, cap), left, right, left, right, slowest)


@inner
def _slowest(ego, params, rules, dt):
    """Least speed after this frame where nobody is behind [m/s]: one that stands may back up slowly, if it is straight.

    Backwards its wheels cannot both keep it from moving sideways and turn it straight.
    """
    held = slowest_in_danger(ego.speed, params, dt)
    if ego.speed > STANDSTILL or ego.cos <= 0.0 or abs(ego.sin) > _CROOKED * rules.heading_bound:
        return held
    return min(max(ego.speed - params.a_max_accel * dt, -rules.reverse_speed), held)


@compiled
def restrict(nominal, bounds, ego, body, rules, dt):
    """The command nearest to the nominal one inside the bounds."""
    a = min(max(nominal.acceleration, bounds.a_lower), bounds.a_upper)
    if bounds.a_lower > -np.inf or bounds.a_upper < 0.0:
        a = max(a, _least_acceleration(nominal.acceleration, bounds, ego.speed, body, dt))
    return Command(a, _restrict_slip(nominal.slip, bounds, ego, a, body, rules, dt))


@inner
def _least_acceleration(nominal, bounds, v, body, dt):
    """No braking goes on behind standstill, unless the driver asks for reverse then: its last step is partial."""
    v_next = v + min(nominal, abs(bounds.a_upper)) * dt
    if v > STANDSTILL or not body.backs_up or (v > -STANDSTILL and v_next > -STANDSTILL):
        return -max(v, 0.0) / dt
    return (max(bounds.v_lower, min(v_next, 0.0)) - v) / dt


@inner
def _restrict_slip(slip, bounds, ego, a, body, rules, dt):
    """Slip angle nearest to the nominal one inside the lateral bounds [rad].

    With psi the heading relative to the lane, slip beta moves the car sideways at v sin(psi + beta)
    at once and turns it by G sin(beta), G = v dt / half_wheelbase. For G > 1 the heading overshoots,
    for G > 2 holding the lateral speed alone makes it diverge: so the lateral speed of this frame, the
    one that the next heading commits to, the course and the heading are bounded together. Their
    intervals always share the slip that straightens the car (see `_straightening_slip`): it moves
    the car no faster than its heading already does, so no bound that was kept so far is lost.
    """
    v = ego.speed
    if abs(v) < STANDSTILL or (bounds.left == np.inf and bounds.right == np.inf):
        return slip
    if v < 0.0:
        return _restrict_slip_backwards(slip, bounds, ego, body, rules, dt)
    v_next = max(v + a * dt, STANDSTILL)
    psi, gain = ego.heading, v * dt / body.half_wheelbase
    arc = body.curvature * v * dt  # the lane turns under the car during the frame ...
    turned = body.turned if gain >= _HEADING_FIRST else arc
    drift = 0.5 * arc * v  # ... and curves away from its tangent [m/s]
    psi_next = psi + gain * np.sin(slip) - turned
    free = _idle_headings(body, v, v_next, dt)
    permitted = _is_permitted(psi + slip, psi_next, free, v, v_next, drift, bounds, rules)
    if permitted and abs(slip) <= body.max_slip:
        return slip
    neutral = _straightening_slip(psi, turned, drift, gain, v, v_next, free, bounds)

    # lateral speed of this frame: -left <= v sin(psi + slip) - drift <= right
    low = min(_arcsin((-bounds.left + drift) / v) - psi, neutral)
    high = max(_arcsin((bounds.right + drift) / v) - psi, neutral)
    # heading after this frame, by the speed it commits to and by the heading bound
    psi_low, psi_high = _arcsin(-bounds.left_next / v_next) + free[0], _arcsin(bounds.right_next / v_next) + free[1]
    if rules.heading_bound < 1.0:
        # the course, slip included, keeps the bound too: a leader's way along the lane relies on it
        largest = np.arcsin(rules.heading_bound)
        low, high = max(low, min(-largest - psi, neutral)), min(high, max(largest - psi, neutral))
        psi_low, psi_high = max(psi_low, -largest), min(psi_high, largest)
    low = max(low, min(_arcsin((psi_low - psi + turned) / gain), neutral))
    high = min(high, max(_arcsin((psi_high - psi + turned) / gain), neutral))
    low, high = max(low, -body.max_slip), min(high, body.max_slip)
    return min(max(slip, low), high)


@inner
def _restrict_slip_backwards(slip, bounds, ego, body, rules, dt):
    """The same in reverse: first the lateral speed of this frame, then the heading.

    The slip that ends the sideways motion turns the car farther from the lane there, by v dt / half_wheelbase of its
    angle. So a car that has to stop moving sideways also stops backing up, and comes to rest before that matters: until
    then its side sweeps no more than the speed at its angle to the lane does, which is less than its share (Def. 6).
    """
    v, psi, gain = ego.speed, ego.heading, ego.speed * dt / body.half_wheelbase
    turned = body.curvature * v * dt
    drift = 0.5 * turned * v
    low, high = _arcsin((bounds.right + drift) / v) - psi, _arcsin((-bounds.left + drift) / v) - psi
    if rules.heading_bound < 1.0:
        largest = np.arcsin(rules.heading_bound)
        straight_low = _arcsin((largest - psi + turned) / gain)
        straight_high = _arcsin((-largest - psi + turned) / gain)
        low, high = min(max(low, straight_low), high), max(min(high, straight_high), low)
    low, high = max(low, -body.max_slip), min(high, body.max_slip)
    return min(max(slip, low), high)


@inner
def _idle_headings(body, v, v_next, dt):
    """Headings after a frame that commit the car to no sideways motion: (lowest, highest), relative to the lane [rad].

    On a straight lane that is 0. In a bend a car which keeps to it turns about its rear axle, whose lane has another
    heading: anything up to that is harmless, because the next slip sets the lateral speed as it should be. No longer so
    once the heading has to be set instead (`_straightening_slip`): what counts then is the very heading that keeps the
    car to the lane frame by frame (`shield.lanes.frame.Bend.idle`), and it is on the other side (hole C9).
    """
    if v_next * dt < _HEADING_FIRST * body.half_wheelbase:
        return min(body.slack, 0.0), max(body.slack, 0.0)
    idle = body.idle + 0.5 * body.curvature * (v_next - v) * dt  # at the speed after the frame
    return idle, idle


@inner
def _is_permitted(course, psi_next, free, v, v_next, drift, bounds, rules):
    """Do course and next heading [rad] keep all bounds? The bounds in closed form, without solving for the slip."""
    if abs(course) >= _STEEP or abs(psi_next) >= _STEEP:
        return False
    sin, sin_next, sin_committed = np.sin(course), np.sin(psi_next), np.sin(outside(psi_next, free[0], free[1]))
    steepest = rules.heading_bound
    return (
        -bounds.left <= v * sin - drift <= bounds.right
        and -bounds.left_next <= v_next * sin_committed <= bounds.right_next
        and abs(sin) <= steepest
        and abs(sin_next) <= steepest
    )


@compiled
def straighten(ego, a, bounds, body, dt):
    """Slip angle that ends the sideways motion of a car that drives forward [rad]; 0 for one that does not.

    Args:
      ego: `ROAD_USER` record.
      a: its acceleration on this frame [m/s^2].
      bounds: `Bounds`.
      body: `Body`.
      dt: length of a frame [s].
    """
    v = ego.speed
    if v < STANDSTILL:
        return 0.0
    v_next, gain = max(v + a * dt, STANDSTILL), v * dt / body.half_wheelbase
    free = _idle_headings(body, v, v_next, dt)
    arc = body.curvature * v * dt
    turned = body.turned if gain >= _HEADING_FIRST else arc
    return _straightening_slip(ego.heading, turned, 0.5 * arc * v, gain, v, v_next, free, bounds)


@inner
def _straightening_slip(psi, turned, drift, gain, v, v_next, free, bounds):
    """Slip that ends the sideways motion [rad].

    For G <= 1 the lateral speed itself is set to 0 and the heading follows by the factor 1 - G.
    Beyond, the heading is set as the lane asks, and the lateral speed shrinks by 1 - 1/G on the way. While
    G < 2 the heading still calms down by itself, and the lateral speed keeps its bound first. For G > 2 it would not:
    what the speed is short of its bound by comes back by the factor G - 1 on the other side, so that is done only as
    far as the bound there permits.
    """
    if gain <= 1.0:
        return _arcsin(drift / v) - psi
    along = _arcsin(drift * v_next / v**2) - _arcsin(turned / gain)  # heading of a car that keeps to the bend
    if gain >= _HEADING_FIRST and free[0] == free[1]:
        along = free[0]
    slip = _arcsin((turned - psi + along) / gain)
    u = v * np.sin(psi + slip) - drift
    within = min(max(u, -bounds.left), bounds.right)
    if gain < _HEADING_FIRST:
        return _arcsin((within + drift) / v) - psi
    if within == u:
        return slip
    low = min(_arcsin((_arcsin(-bounds.left_next / v_next) + free[0] - psi + turned) / gain), slip)
    high = max(_arcsin((_arcsin(bounds.right_next / v_next) + free[1] - psi + turned) / gain), slip)
    return min(max(_arcsin((within + drift) / v) - psi, low), high)


@inner
def _arcsin(x):
    return np.arcsin(min(max(x, -1.0), 1.0))


def response_name(response: int) -> str:
    """Name of a sum of RESPONSE_* bits."""
    if response & RESPONSE_GO:
        return "go"
    brakes = response & (RESPONSE_BRAKE | RESPONSE_PRESENT)
    if response & RESPONSE_STEER:
        return "both" if brakes else "lateral"
    return "longitudinal" if brakes else "none"
