"""The command nearest to the nominal one inside given bounds: acceleration and slip angle."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, part, rare
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.frame import outside
from rss_shield.shield.lanes.pair import STANDSTILL

_STEEP = 1.5  # steeper angles to the lane are left to the exact solution [rad]
_JUST_BELOW = 1.0 - 1e-9
_TOLERANCE = 1e-9  # rounding [m/s]
_HEADING_FIRST = 2.0  # half wheelbases per frame: the heading of a faster car would not calm down by itself


class Body(NamedTuple):
    """What the ego's kinematics add to its `ROAD_USER` record."""

    half_wheelbase: float  # distance from the centre to the rear axle [m]
    max_slip: float  # largest slip angle the steering reaches [rad]
    curvature: float  # of the lane under the ego, see `shield.lanes.frame.Bend` [1/m]
    slack: float = 0.0  # likewise [rad]
    turned: float = 0.0  # likewise [rad]
    idle: float = 0.0  # likewise [rad]
    backs_up: bool = False  # its driver asks for reverse by braking at standstill; others only hold then
    a_stop: float = np.inf  # with which it stops backing up [m/s^2]


@compiled
def restrict(nominal, bounds, ego, body, rules, dt):
    """The command nearest to the nominal one inside the bounds."""
    a = min(max(nominal.acceleration, bounds.a_lower), bounds.a_upper)
    if bounds.a_lower > -np.inf or bounds.a_upper < 0.0:
        a = max(a, _least_acceleration(nominal.acceleration, bounds, ego.speed, body, dt))
    slip = _restrict_slip(nominal.slip, bounds, ego, a, body, rules, dt)
    longest = _HEADING_FIRST * body.half_wheelbase / dt
    if ego.speed < longest <= ego.speed + a * dt:
        return _once_calm(Command(a, slip), nominal.slip, longest, bounds, ego, body, rules, dt)
    return Command(a, slip)


@rare
def _once_calm(command, wish, longest, bounds, ego, body, rules, dt):
    """The command, or one that stays slower than `longest` [m/s] while the heading is not calm."""
    if _is_calm(command.slip, bounds, ego, command.acceleration, body, dt):
        return command
    a = (_JUST_BELOW * longest - ego.speed) / dt
    return Command(a, _restrict_slip(wish, bounds, ego, a, body, rules, dt))


@inner
def _is_calm(slip, bounds, ego, a, body, dt):
    """Does the heading after a frame commit a car that gets as fast as `_HEADING_FIRST` to no more than it may?

    A slower one turns back and forth where it may not move sideways at all, which changes nothing: it sets its lateral
    speed first. A faster one could not any more, so it does not get that fast before its heading is calm (C9).
    """
    v, v_next = ego.speed, ego.speed + a * dt
    free = _idle_headings(body, v, v_next, dt)
    psi_next = ego.heading + v * dt / body.half_wheelbase * np.sin(slip) - body.curvature * v * dt
    u = v_next * np.sin(outside(psi_next, free[0], free[1]))
    return -bounds.left_next - _TOLERANCE <= u <= bounds.right_next + _TOLERANCE


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
        return _restrict_slip_backwards(slip, bounds, ego, a, body, rules, dt)
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
    return _solve_slip(slip, bounds, psi, turned, drift, gain, v, v_next, free, body.max_slip, rules.heading_bound)


@part
def _solve_slip(slip, bounds, psi, turned, drift, gain, v, v_next, free, max_slip, heading_bound):
    """The exact solution of `_restrict_slip`, where the slip that is asked for is not permitted as it is."""
    neutral = _straightening_slip(psi, turned, drift, gain, v, v_next, free, bounds)

    # lateral speed of this frame: -left <= v sin(psi + slip) - drift <= right
    low = min(_arcsin((-bounds.left + drift) / v) - psi, neutral)
    high = max(_arcsin((bounds.right + drift) / v) - psi, neutral)
    # heading after this frame, by the speed it commits to and by the heading bound
    psi_low, psi_high = _arcsin(-bounds.left_next / v_next) + free[0], _arcsin(bounds.right_next / v_next) + free[1]
    if heading_bound < 1.0:
        # the course, slip included, keeps the bound too: a leader's way along the lane relies on it
        largest = np.arcsin(heading_bound)
        low, high = max(low, min(-largest - psi, neutral)), min(high, max(largest - psi, neutral))
        psi_low, psi_high = max(psi_low, -largest), min(psi_high, largest)
    low = max(low, min(_arcsin((psi_low - psi + turned) / gain), neutral))
    high = min(high, max(_arcsin((psi_high - psi + turned) / gain), neutral))
    low, high = max(low, -max_slip), min(high, max_slip)
    return min(max(slip, low), high)


@rare
def _restrict_slip_backwards(slip, bounds, ego, a, body, rules, dt):
    """The same in reverse: first the lateral speed of this frame, then the heading.

    The slip that ends the sideways motion turns the car farther from the lane there, by v dt / half_wheelbase of its
    angle. So it backs up only as fast, and turned only as far, as lets it come to rest inside the heading bound with
    that slip (`straight_enough`): its box is no longer than the bound says, and its side sweeps no more than the speed
    at its angle to the lane does, which is less than its share (Def. 6).
    """
    v, psi, gain = ego.speed, ego.heading, ego.speed * dt / body.half_wheelbase
    turned = body.curvature * v * dt
    drift = 0.5 * turned * v
    low, high = _arcsin((bounds.right + drift) / v) - psi, _arcsin((-bounds.left + drift) / v) - psi
    if rules.heading_bound < 1.0:
        largest = np.arcsin(rules.heading_bound) * straight_enough(v + a * dt, body.a_stop, body.half_wheelbase, dt)
        straight_low = _arcsin((largest - psi + turned) / gain)
        straight_high = _arcsin((-largest - psi + turned) / gain)
        low, high = min(max(low, straight_low), high), max(min(high, straight_high), low)
    low, high = max(low, -body.max_slip), min(high, body.max_slip)
    return min(max(slip, low), high)


@inner
def straight_enough(v, a_stop, half_wheelbase, dt):
    """Share of the heading bound within which a car that backs up comes to rest inside it, moving straight (H12).

    Moving straight turns it farther by the factor e on each half wheelbase that it goes back.
    """
    back, in_a_frame = max(-v, 0.0), a_stop * dt
    way = back * dt
    if back > in_a_frame:
        way = 0.5 * (way + back * back / a_stop) + in_a_frame * dt / 8  # by explicit Euler (C5)
    return np.exp(-way / half_wheelbase)


@inner
def _idle_headings(body, v, v_next, dt):
    """Headings after a frame that commit the car to no sideways motion: (lowest, highest), relative to the lane [rad].

    On a straight lane that is 0. In a bend a car which keeps to it turns about its rear axle, whose lane has another
    heading: anything up to that is harmless, because the next slip sets the lateral speed as it should be. No longer so
    once the heading has to be set instead (`_straightening_slip`): what counts then is the very heading that keeps the
    car to the lane frame by frame (`shield.lanes.frame.Bend.idle`), and it is on the other side (C9).
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
    committed = outside(psi_next, free[0], free[1])
    sin, sin_next = np.sin(course), np.sin(psi_next)
    sin_committed = sin_next if committed == psi_next else np.sin(committed)
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
