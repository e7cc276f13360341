"""What all trajectories of a driver in open space together may occupy, bounded from outside. Def. 21.

The paper compares sets of trajectories. Here a set is the space that it may occupy at each time:

- distances covered lie between those of the slowest and of the fastest motion, which bound all others at every time;
- headings lie between those of the hardest turns to either side, and always include the one at the start, because a car
  that brakes at once hardly turns;
- so each step of a motion lies in a sector of a ring, and a position in the sum of the sectors of all steps before.

Where the paper leaves a choice: sets are bounded from outside (U4); a car that may change gear, or a pedestrian, may
set out anew as soon as it has come to rest within its response time.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, larger, smaller
from rss_shield.shield.definitions.kinematics import (
    reach,
    response_distance,
    speed_after_response,
    stopping_distance,
    time_to_stop,
    travel,
)
from rss_shield.shield.params import RSSParams

MAX_STEPS = 62  # of an occupancy: one bit each
LO, HI, RIGHT, LEFT, COS_RIGHT, SIN_RIGHT, COS_LEFT, SIN_LEFT, ANEW, WIDER = range(10)
ROW_FIELDS = 10
# how a road user that came to rest within its response time may set out again
STAYS_PUT, BACKWARDS, ANY_WAY = 0, 1, 2


class Mover(NamedTuple):
    """A road user in open space. `y` and angles run the same way: to the right of the driving direction."""

    x: float  # centre                                 [m]
    y: float  #                                        [m]
    heading: float  # direction of travel              [rad]
    v: float  # speed along it, >= 0                   [m/s]
    yaw_rate: float  #                                 [rad/s]
    half_length: float  # of its box                   [m]
    half_width: float  #                               [m]
    offset: float = 0.0  # of the box's centre, ahead of x, y, which is the point that moves along the heading [m]


class Steering(NamedTuple):
    """How a road user may turn (the lateral part of the constraints of Def. 21)."""

    yaw_acceleration: float  # largest change of its yaw rate during the response time [rad/s^2]
    min_radius: float  # of its turns                                                 [m]
    keeps_turning: bool  # afterwards on the circle that it is on; else straight on
    sets_out: int  # STAYS_PUT, BACKWARDS or ANY_WAY, once at rest within the response time


VEHICLE = Steering(0.3, 3.5, True, STAYS_PUT)  # CARLA, RssCheck.cpp
CHANGES_GEAR = VEHICLE._replace(sets_out=BACKWARDS)  # a car that is being parked
PEDESTRIAN = Steering(np.inf, 2.0, False, ANY_WAY)  # CARLA, RssCheck.cpp; a standing one may walk anywhere


@compiled
def trajectory(t, mover, driver, steering, a, yaw_acceleration, b):
    """Where one trajectory of Def. 21 is at time `t`: (x, y [m], heading [rad], speed [m/s]).

    Accelerates at `a` and turns by `yaw_acceleration` during the response time; then keeps its curvature, or goes
    straight on, and brakes at `b` to rest, or accelerates where `b` is negative.

    Args:
      t: time >= 0 [s].
      mover, driver, steering: `Mover`, `RSSParams`, `Steering`.
      a: in [-a_max_brake, a_max_accel] [m/s^2]; a car that comes to rest stays there.
      yaw_acceleration: within that of `steering` [rad/s^2].
      b: braking afterwards [m/s^2].
    """
    rho, v, w = driver.response_time, mover.v, mover.yaw_rate
    t_response = smaller(t, rho)
    x, y, steps = mover.x, mover.y, 64
    h = t_response / steps
    for k in range(2 * steps + 1):  # Simpson's rule, three points a step
        tau = 0.5 * k * h
        weight = (1.0 if k == 0 or k == 2 * steps else 2.0 + 2.0 * (k % 2)) * h / 6
        angle = mover.heading + w * tau + 0.5 * yaw_acceleration * tau**2
        speed = _speed_at(tau, v, a, driver.v_cap)
        x += weight * speed * np.cos(angle)
        y += weight * speed * np.sin(angle)
    heading = mover.heading + w * t_response + 0.5 * yaw_acceleration * t_response**2
    v_rho = _speed_at(t_response, v, a, driver.v_cap)
    if t <= rho or v_rho <= 0.0:
        return x, y, heading, v_rho
    tau = t - rho
    if b > 0.0:
        s, speed = travel(tau, v_rho, 0.0, 0.0, b), larger(v_rho - b * tau, 0.0)
    else:
        s = response_distance(v_rho, tau, -b, driver.v_cap)
        speed = speed_after_response(v_rho, tau, -b, driver.v_cap)
    limit = 1.0 / steering.min_radius
    curvature = smaller(larger((w + yaw_acceleration * rho) / v_rho, -limit), limit)
    turn = curvature * s if steering.keeps_turning else 0.0
    chord = s * (1.0 if np.abs(turn) < 1e-9 else np.sin(0.5 * turn) / (0.5 * turn))
    return x + chord * np.cos(heading + 0.5 * turn), y + chord * np.sin(heading + 0.5 * turn), heading + turn, speed


@inner
def _speed_at(t, v, a, v_cap):
    """Speed after accelerating at `a` of any sign, never below 0 nor, if `a` > 0, beyond the cap [m/s]."""
    return larger(smaller(v + a * t, larger(v_cap, v)), 0.0)


class Bounds(NamedTuple):
    """What holds for all trajectories of one road user together."""

    steps: int  # until the last one that brakes has stopped, more than there are rows if that is later
    first_stop: int  # the step in which the first one may have stopped
    reach: float  # farthest that the centre gets until then                            [m]
    least: float  # covered by the one that brakes hardest                              [m]
    slack: float  # by which one may be ahead of the linear course of the extent        [m]
    detour: float  # farthest from its start at which one that sets out anew has stopped [m]
    turns_around: bool  # after which its box may point anywhere
    cos: float  # of its heading
    sin: float
    diagonal: float  # farthest that its box gets from x, y                             [m]
    front: float  # a front corner's distance from x, y                                 [m]
    rear: float  # a rear one's                                                         [m]
    front_corner: float  # angle between the heading and a front corner                 [rad]
    rear_corner: float  # and a rear one                                                [rad]


class Occupancy(NamedTuple):
    """What the trajectories of one road user may occupy at each time: the sets of Def. 21, from outside.

    Each row is one step: the distance covered in it, at least and at most (LO, HI) [m]; the angles up to which the
    road user may have turned by its end, to the right and to the left (RIGHT, LEFT) [rad, >= 0], with their cosines and
    sines; how far one that came to rest may have walked off (ANEW) [m]; and by how much its box counts as wider on all
    sides (WIDER) [m].
    """

    mover: Mover
    bounds: Bounds
    braking: np.ndarray  # `[K, 10]` C_b: accelerates as it likes, then brakes
    going_on: np.ndarray  # `[K, 10]` C_f: accelerates as it likes all along


@compiled
def occupy(mover, driver, steering, dt, braking, going_on):
    """Fill the arrays of an `Occupancy`, `[K, 10]` each, K <= MAX_STEPS, in steps of `dt` [s]; returns its `Bounds`."""
    rho, a, b, v_cap = driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap
    _fill(braking, mover, driver, steering, dt, True)
    _fill(going_on, mover, driver, steering, dt, False)
    turns_around = steering.sets_out == ANY_WAY
    return bounds_of(
        mover,
        int(np.ceil(time_to_stop(mover.v, rho, a, b, v_cap) / dt - 1e-9)),
        int(mover.v / driver.a_max_brake / dt),
        reach(mover.v, rho, a, b, v_cap),
        stopping_distance(mover.v, driver.a_max_brake),
        b * dt**2 / 8,
        0.5 * mover.v * rho if turns_around else 0.0,
        turns_around,
    )


@compiled
def bounds_of(mover, steps, first_stop, reach, least, slack, detour, turns_around):
    """`Bounds` with what follows from the box of a `Mover`."""
    ahead, behind, aside = mover.offset + mover.half_length, mover.offset - mover.half_length, mover.half_width
    front, rear = np.hypot(ahead, aside), np.hypot(behind, aside)
    return Bounds(
        steps,
        first_stop,
        reach,
        least,
        slack,
        detour,
        turns_around,
        np.cos(mover.heading),
        np.sin(mover.heading),
        larger(front, rear),
        front,
        rear,
        np.arctan2(aside, ahead),
        np.arctan2(aside, behind),
    )


def occupied(mover: Mover, driver: RSSParams, steering: Steering, dt: float = 0.1, steps: int = MAX_STEPS) -> Occupancy:
    """The occupancy of one road user, in `steps` steps of `dt` [s].

    Raises:
      ValueError: more steps than MAX_STEPS, or fewer than the road user needs to stop.
    """
    if not 0 < steps <= MAX_STEPS:
        raise ValueError(f"steps = {steps} is out of range: expected 1 to {MAX_STEPS}")
    braking, going_on = np.zeros((steps, ROW_FIELDS)), np.zeros((steps, ROW_FIELDS))
    bounds = occupy(mover, driver, steering, dt, braking, going_on)
    if bounds.steps > steps:
        needed = dt * bounds.steps / steps
        raise ValueError(f"dt = {dt} is out of range: expected >= {needed:g} s, or the road user won't stand in time")
    return Occupancy(mover, bounds, braking, going_on)


@inner
def _fill(rows, mover, driver, steering, dt, brakes):
    rho, v = driver.response_time, mover.v
    slow, fast = 0.0, 0.0
    right, left = -1.0, -1.0
    for k in range(len(rows)):
        t = (k + 1) * dt
        slow_next, fast_next = _least(t, v, driver, steering, brakes), _most(t, v, driver, brakes)
        rows[k, LO], rows[k, HI] = slow_next - slow, fast_next - fast
        slow, fast = slow_next, fast_next
        right_next = _turn(t, 1.0, mover, driver, steering, brakes)
        left_next = _turn(t, -1.0, mover, driver, steering, brakes)
        if larger(right_next, left_next) >= np.pi:
            right_next = left_next = np.pi
        if k > 0 and right_next == right and left_next == left:
            for field in range(RIGHT, SIN_LEFT + 1):
                rows[k, field] = rows[k - 1, field]
        else:
            right, left = right_next, left_next
            rows[k, RIGHT], rows[k, LEFT] = right, left
            rows[k, COS_RIGHT], rows[k, SIN_RIGHT] = np.cos(right), np.sin(right)
            rows[k, COS_LEFT], rows[k, SIN_LEFT] = np.cos(left), np.sin(left)
        rows[k, ANEW] = rows[k, WIDER] = 0.0
        if steering.sets_out == ANY_WAY:
            rows[k, ANEW] = _set_out(t - v / driver.a_max_brake, rho - v / driver.a_max_brake, driver, brakes)


@inner
def _most(t, v, driver, brakes):
    """Distance covered after `t` by whoever accelerates as long as it may [m]."""
    if brakes:
        return travel(t, v, driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap)
    return response_distance(v, t, driver.a_max_accel, driver.v_cap)


@inner
def _least(t, v, driver, steering, brakes):
    """Distance covered after `t` by whoever brakes as hard as it may, and then backs up if it may [m]."""
    rest = v / driver.a_max_brake
    forward = travel(t, v, 0.0, 0.0, driver.a_max_brake)
    if steering.sets_out != BACKWARDS:
        return forward
    return forward - _set_out(t - rest, driver.response_time - rest, driver, brakes)


@inner
def _set_out(t, rho, driver, brakes):
    """Distance covered `t` after coming to rest, with `rho` of the response time left [m]."""
    if t <= 0.0 or (brakes and rho <= 0.0):
        return 0.0
    if brakes:
        return travel(t, 0.0, rho, driver.a_max_accel, driver.a_min_brake, driver.v_cap)
    return response_distance(0.0, t, driver.a_max_accel, driver.v_cap)


@inner
def _turn(t, side, mover, driver, steering, brakes):
    """Largest angle turned to one side until `t` [rad], >= 0."""
    rho, radius = driver.response_time, steering.min_radius
    t_response = smaller(t, rho)
    angle = larger((side * mover.yaw_rate + 0.5 * steering.yaw_acceleration * t_response) * t_response, 0.0)
    way = response_distance(mover.v, t_response, driver.a_max_accel, driver.v_cap)
    angle = smaller(angle, way / radius)
    w = larger(side * mover.yaw_rate + steering.yaw_acceleration * rho, 0.0)
    if t <= rho or not steering.keeps_turning or w <= 0.0:
        return angle
    # on the circle of radius v / w, or the smallest one: of all speeds the one that turns farthest
    v = speed_after_response(mover.v, rho, driver.a_max_accel, driver.v_cap)
    if v <= 0.0:
        return angle
    if brakes:
        further = _most(t, mover.v, driver, True) - way
    else:
        slowest = larger(mover.v - driver.a_max_brake * rho, 0.0) if steering.sets_out == STAYS_PUT else 0.0
        v = smaller(v, larger(slowest, w * radius))
        further = response_distance(v, t - rho, driver.a_max_accel, driver.v_cap)
    return angle + further * smaller(1.0 / radius, w / v)
