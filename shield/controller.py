"""One frame of the shield: scene + memory -> danger; danger + nominal command -> restricted command."""

from typing import NamedTuple

import numpy as np

from shield.chosen import how_many, which
from shield.command import Command
from shield.compiled import compiled, inner
from shield.geometry import signed_gap
from shield.lane_frame import beyond
from shield.pair import assess, leading_speed, least_cosine, least_margin, own_share, toward
from shield.response import Bounds, catch_up, merge, owes_braking, owes_lateral_stop, remember


class Danger(NamedTuple):
    """What the shield saw on one frame."""

    free: Bounds  # what the ego may do while it owes nobody anything
    bounds: Bounds  # what it may do now
    dangerous: bool
    partner: int  # index of the road user nearest to danger, -1 if alone
    margin_lon: float  # of that pair [m]; inf if alone
    margin_lat: float
    response: int  # sum of RESPONSE_BRAKE, RESPONSE_STEER, RESPONSE_CUT_IN, RESPONSE_GO
    ttc: float  # time to collision with a car ahead in the way of the ego [s]; inf if none


class Response(NamedTuple):
    """What it makes of the ego's command."""

    command: Command  # what it lets through
    overridden: bool  # a duty toward somebody changed the command
    limited: bool  # only the always-on limits did


RESPONSE_BRAKE, RESPONSE_STEER, RESPONSE_CUT_IN, RESPONSE_GO = 1, 2, 4, 8  # GO: on through a junction

SAFE_BEYOND_DOUBT = 1e-6  # margin of a pair that is far apart: more than rounding can change [m]
_STEEP = 1.5  # steeper angles to the lane are left to the exact solution [rad]
_STANDSTILL = 1e-6  # below this speed nothing moves sideways [m/s]


class Body(NamedTuple):
    """What the ego's kinematics add to its `ROAD_USER` record."""

    half_wheelbase: float  # distance from the centre to the rear axle [m]
    max_slip: float  # largest slip angle the steering reaches [rad]
    curvature: float  # of the lane under the ego, see `shield.lane_frame.Bend` [1/m]
    slack: float = 0.0  # likewise [rad]


@compiled
def find_danger(
    ego,
    users,
    ego_before,
    users_before,
    memory,
    ego_params,
    other_params,
    rules,
    dt,
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
      ego_params, other_params: `RSSParams`, response times in whole frames.
      rules: `Rules` in force.
      dt: length of a frame [s].
      who: `[K]` indices in ascending order of those to look at, if not everybody. All others are known to be far
        apart, and marked as skipped.
      nearest: partner and margins are of interest only if nearer to danger than this [m].
      soonest: likewise the time to collision [s].

    Returns:
      `Danger`.
    """
    free = always_on(ego, ego_params, rules, dt)
    bounds = free
    worst, partner, margin_lon, margin_lat, ttc = nearest, -1, np.inf, np.inf, soonest
    dangerous, response = False, 0
    share_ego = own_share(ego.speed, ego.cos, ego_params, dt)
    lead_ego, least_cos = leading_speed(ego, rules), least_cosine(rules)
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
            ego_params,
            other_params,
            dt,
        )
        if memory[i].since == 0 and margin > max(worst, SAFE_BEYOND_DOUBT) and not _may_be_next(ego, user, ttc, rules):
            memory[i].skipped = True
            continue
        catch_up(memory[i], ego_before, users_before[i], ego_params, other_params, rules, dt)
        pair = assess(ego, user, ego_params, other_params, rules, dt)
        remember(memory[i], pair, ego, user, dt)
        bounds = merge(bounds, memory[i], pair, ego_params, rules, dt)
        if memory[i].since > 0:
            dangerous = True
            braking = owes_braking(memory[i], pair, rules)
            response |= RESPONSE_BRAKE if braking == 1 else (RESPONSE_CUT_IN if braking == 2 else 0)
            response |= RESPONSE_STEER if owes_lateral_stop(memory[i], rules) else 0
        margin = max(pair.margin_lon, pair.margin_lat)
        if margin < worst:
            worst, partner, margin_lon, margin_lat = margin, i, pair.margin_lon, pair.margin_lat
        if pair.gap_lat < 0.0 and pair.ego_is_rear and pair.v_ego > pair.v_other:
            ttc = min(ttc, max(pair.gap_lon, 0.0) / (pair.v_ego - pair.v_other))
    return Danger(free, bounds, dangerous, partner, margin_lon, margin_lat, response, ttc)


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
    command = restrict(nominal, danger.bounds, ego, body, rules, dt) if danger.bounds != danger.free else limited
    overridden = command != limited
    return Response(command, overridden, limited != nominal and not overridden)


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
        return Bounds(-np.inf, np.inf, np.inf, np.inf, np.inf, np.inf)
    cap = max((params.v_cap - ego.speed) / dt, 0.0)
    growth = params.a_lat_max_accel * dt
    left, right = max(toward(-1.0, ego), 0.0) + growth, max(toward(1.0, ego), 0.0) + growth
    return Bounds(-params.a_max_brake, min(params.a_max_accel, cap), left, right, left, right)


@compiled
def restrict(nominal, bounds, ego, body, rules, dt):
    """The command nearest to the nominal one inside the bounds."""
    a = min(max(nominal.acceleration, bounds.a_lower), bounds.a_upper)
    if bounds.a_lower > -np.inf or bounds.a_upper < 0.0:
        a = max(a, -max(ego.speed, 0.0) / dt)  # never reverse; the last braking step is partial
    return Command(a, _restrict_slip(nominal.slip, bounds, ego, a, body, rules, dt))


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
    if v < _STANDSTILL or (bounds.left == np.inf and bounds.right == np.inf):
        return slip
    v_next = max(v + a * dt, _STANDSTILL)
    psi, gain = ego.heading, v * dt / body.half_wheelbase
    turned = body.curvature * v * dt  # the lane turns under the car during the frame ...
    drift = 0.5 * turned * v  # ... and curves away from its tangent [m/s]
    psi_next = psi + gain * np.sin(slip) - turned
    permitted = _is_permitted(psi + slip, psi_next, body.slack, v, v_next, drift, bounds, rules)
    if permitted and abs(slip) <= body.max_slip:
        return slip
    neutral = _straightening_slip(psi, turned, drift, gain, v, v_next, bounds)

    # lateral speed of this frame: -left <= v sin(psi + slip) - drift <= right
    low = min(_arcsin((-bounds.left + drift) / v) - psi, neutral)
    high = max(_arcsin((bounds.right + drift) / v) - psi, neutral)
    # heading after this frame, by the speed it commits to and by the heading bound
    psi_low = _arcsin(-bounds.left_next / v_next) + min(body.slack, 0.0)
    psi_high = _arcsin(bounds.right_next / v_next) + max(body.slack, 0.0)
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
def _is_permitted(course, psi_next, slack, v, v_next, drift, bounds, rules):
    """Do course and next heading [rad] keep all bounds? The bounds in closed form, without solving for the slip."""
    if abs(course) >= _STEEP or abs(psi_next) >= _STEEP:
        return False
    sin, sin_next, sin_committed = np.sin(course), np.sin(psi_next), np.sin(beyond(psi_next, slack))
    steepest = rules.heading_bound
    return (
        -bounds.left <= v * sin - drift <= bounds.right
        and -bounds.left_next <= v_next * sin_committed <= bounds.right_next
        and abs(sin) <= steepest
        and abs(sin_next) <= steepest
    )


@inner
def _straightening_slip(psi, turned, drift, gain, v, v_next, bounds):
    """Slip that ends the sideways motion [rad].

    For G <= 1 the lateral speed itself is set to 0 and the heading follows by the factor 1 - G.
    Beyond, the heading is set as the lane asks, and the lateral speed shrinks by 1 - 1/G on the way. While
    G < 2 the heading still calms down by itself, and the lateral speed keeps its bound first.
    """
    if gain <= 1.0:
        return _arcsin(drift / v) - psi
    along = _arcsin(drift * v_next / v**2) - _arcsin(turned / gain)  # heading of a car that keeps to the bend
    slip = _arcsin((turned - psi + along) / gain)
    if gain < 2.0:
        u = v * np.sin(psi + slip) - drift
        slip = _arcsin((min(max(u, -bounds.left), bounds.right) + drift) / v) - psi
    return slip


@inner
def _arcsin(x):
    return np.arcsin(min(max(x, -1.0), 1.0))
