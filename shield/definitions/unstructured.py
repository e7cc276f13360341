"""Open space, where there are no lanes: trajectories, and what all of a driver's together may occupy. Defs. 19-22.

The paper compares sets of trajectories. Here a set is the space that it may occupy at each time, bounded from outside:

- distances covered lie between those of the slowest and of the fastest motion, which bound all others at every time;
- headings lie between those of the hardest turns to either side, and always include the one at the start, because a car
  that brakes at once hardly turns;
- so each step of a motion lies in a sector of a ring, and a position in the sum of the sectors of all steps before. How
  far such a sum extends in a direction is the sum of how far its parts do: no polygon is ever built;
- between two instants it extends no farther than linearly in time, but for what a braking car is ahead of that.

Two sets are apart during a step if there is a direction in which they are, at its start and at its end.

Where the paper leaves a choice: distances are between bodies, not points (U5); sets are bounded from outside (U4); a
car that may change gear, or a pedestrian, may set out anew as soon as it has come to rest within its response time; the
condition "drives away" refers to the car that brakes (U3); who drives away is who has to turn least (U2).
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

# Def. 22: who brakes to keep the pair safe; the proper response that each item asks for
FIRST_BRAKES, SECOND_BRAKES, BOTH_BRAKE, DANGEROUS = range(4)
BRAKE, GO_ON, DRIVE_AWAY, STAY = range(4)


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


# ---------------------------------------------------------------- Defs. 19, 20: two trajectories


@compiled
def stopping_sample(speed):
    """Def. 19: index of the first sample of a trajectory at which it stands for good; `len(speed)` if it never does.

    Args:
      speed: `[T]` >= 0 [m/s].
    """
    k = len(speed)
    while k > 0 and speed[k - 1] <= 0.0:
        k -= 1
    return k


@inner
def _closest_in_step(one, two, k):
    """Smallest distance of two motions from sample `k` to the next [m], and the share of the step before it."""
    x, y = two[k, 0] - one[k, 0], two[k, 1] - one[k, 1]
    dx, dy = two[k + 1, 0] - one[k + 1, 0] - x, two[k + 1, 1] - one[k + 1, 1] - y
    length = dx * dx + dy * dy
    share = 0.0 if length <= 0.0 else smaller(larger(-(x * dx + y * dy) / length, 0.0), 1.0)
    return np.hypot(x + share * dx, y + share * dy), share


@compiled
def first_contact(time, one, two, eps):
    """When two trajectories are first no farther than `eps` apart [s]; inf if never.

    Args:
      time: `[T]` increasing [s].
      one, two: `[T, 3]` x, y [m] and heading [rad] at these times, straight in between.
      eps: clearance >= 0 [m].
    """
    if np.hypot(two[0, 0] - one[0, 0], two[0, 1] - one[0, 1]) <= eps:
        return time[0]
    for k in range(len(time) - 1):
        distance, share = _closest_in_step(one, two, k)
        if distance <= eps:
            return time[k] + share * (time[k + 1] - time[k])
    return np.inf


@compiled
def angle_away(x_1, y_1, x_2, y_2, heading_2):
    """Angle between the way from the first to the second and the heading of the second [rad]; 0: straight away."""
    away = np.arctan2(y_2 - y_1, x_2 - x_1)
    return np.abs((heading_2 - away + np.pi) % (2 * np.pi) - np.pi)


@compiled
def do_not_collide(time, one, two, stop_1, stop_2, eps, theta):
    """Def. 20: do two trajectories not collide? Not commutative.

    Either they are farther than `eps` apart until both have stopped, or until the first has, and the second then
    drives away from it.

    Args:
      time, one, two: as in `first_contact`.
      stop_1, stop_2: samples at which each has stopped, `stopping_sample`; T = never: then as far as the samples go.
      eps: clearance >= 0 [m].
      theta: largest angle that counts as driving away [rad].
    """
    contact = first_contact(time, one, two, eps)
    last = len(time) - 1
    if contact > time[min(max(stop_1, stop_2), last)]:
        return True
    if stop_1 > last or contact <= time[stop_1]:
        return False
    return angle_away(one[stop_1, 0], one[stop_1, 1], two[stop_1, 0], two[stop_1, 1], two[stop_1, 2]) <= theta


# ---------------------------------------------------------------- Def. 21: the trajectories of one driver


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
    braking: np.ndarray  # `[K, 9]` C_b: accelerates as it likes, then brakes
    going_on: np.ndarray  # `[K, 9]` C_f: accelerates as it likes all along


@compiled
def occupy(mover, driver, steering, dt, braking, going_on):
    """Fill the arrays of an `Occupancy`, `[K, 9]` each, K <= MAX_STEPS, in steps of `dt` [s]; returns its `Bounds`."""
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


# ---------------------------------------------------------------- sets against sets


class _Side(NamedTuple):
    """A direction as one road user sees it: angles relative to its heading [rad], in [-pi, pi)."""

    angle: float  # of the direction
    back: float  # of the opposite one
    # to which it would have to turn for a corner to point there
    front_corners: tuple[float, float]
    rear_corners: tuple[float, float]
    cos: float  # of the angle
    sin: float


@inner
def _wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@inner
def _opposite(angle):
    return angle - np.pi if angle >= 0.0 else angle + np.pi


@inner
def _side(occupancy, nx, ny):
    x, y = occupancy.bounds.cos, occupancy.bounds.sin
    cos, sin = nx * x + ny * y, ny * x - nx * y
    angle = np.arctan2(sin, cos)
    front, rear = _both_sides(angle, occupancy.bounds.front_corner), _both_sides(angle, occupancy.bounds.rear_corner)
    return _Side(angle, _opposite(angle), front, rear, cos, sin)


@inner
def _both_sides(angle, corner):
    """`angle` less and plus `corner`, which is in [0, pi]."""
    right, left = angle - corner, angle + corner
    return right + 2 * np.pi if right < -np.pi else right, left - 2 * np.pi if left >= np.pi else left


@inner
def _may_point(row, angle):
    return -row[LEFT] <= angle <= row[RIGHT]


@inner
def _largest_cos(row, side):
    """Largest cosine of the angle between a direction and the headings of a step."""
    if _may_point(row, side.angle):
        return 1.0
    at_right = side.cos * row[COS_RIGHT] + side.sin * row[SIN_RIGHT]
    at_left = side.cos * row[COS_LEFT] - side.sin * row[SIN_LEFT]
    return larger(at_right, at_left)


@inner
def _smallest_cos(row, side):
    if _may_point(row, side.back):
        return -1.0
    at_right = side.cos * row[COS_RIGHT] + side.sin * row[SIN_RIGHT]
    at_left = side.cos * row[COS_LEFT] - side.sin * row[SIN_LEFT]
    return smaller(at_right, at_left)


@inner
def _advance(row, side, cos):
    """How much farther a position may extend in a direction after one step [m]; `cos` as of `_largest_cos`."""
    if row[LO] < 0.0:
        return larger(row[HI] * cos, row[LO] * _smallest_cos(row, side))
    return row[HI] * cos if cos > 0.0 else row[LO] * cos


@inner
def _half_box(row, side, occupancy):
    """How far a box extends from x, y in a direction, at any heading of a step [m]."""
    bounds, mover = occupancy.bounds, occupancy.mover
    if bounds.turns_around:
        return bounds.diagonal + row[WIDER]
    cos, sin = side.cos, side.sin
    c_right, s_right, c_left, s_left = row[COS_RIGHT], row[SIN_RIGHT], row[COS_LEFT], row[SIN_LEFT]
    at_right = _box_at(cos * c_right + sin * s_right, sin * c_right - cos * s_right, mover)
    at_left = _box_at(cos * c_left - sin * s_left, sin * c_left + cos * s_left, mover)
    most = larger(at_right, at_left)
    if _may_point(row, side.front_corners[0]) or _may_point(row, side.front_corners[1]):
        most = larger(most, bounds.front)
    if _may_point(row, side.rear_corners[0]) or _may_point(row, side.rear_corners[1]):
        most = larger(most, bounds.rear)
    return most + row[WIDER]


@inner
def _box_at(cos, sin, mover):
    """How far a box extends in a direction that is at an angle, of this cosine and sine, to its heading [m]."""
    return mover.offset * cos + mover.half_length * np.abs(cos) + mover.half_width * np.abs(sin)


@inner
def _or_anew(extent, row, cos, occupancy):
    """An extent, or that of one that stopped and set out anew in any direction."""
    if not occupancy.bounds.turns_around:
        return extent
    return larger(extent, occupancy.bounds.detour * larger(cos, 0.0) + row[ANEW])


@compiled
def extent(occupancy, rows, k, nx, ny):
    """How far an occupancy extends in a direction during step `k` [m], at its start and at its end, from the centre.

    In between it extends no farther than linearly from one to the other, plus `slack`.

    Args:
      rows: `occupancy.braking` or `occupancy.going_on`.
      nx, ny: the direction, a unit vector.
    """
    side = _side(occupancy, nx, ny)
    before = 0.0
    for j in range(k):
        before += _advance(rows[j], side, _largest_cos(rows[j], side))
    cos = _largest_cos(rows[k], side)
    after = before + _advance(rows[k], side, cos)
    box = _half_box(rows[k], side, occupancy)
    return _or_anew(before, rows[k], cos, occupancy) + box, _or_anew(after, rows[k], cos, occupancy) + box


@inner
def _steps_apart(one, rows_1, two, rows_2, nx, ny, steps, eps):
    """Bits of the steps in which two occupancies are more than `eps` apart in one direction, the second ahead."""
    first, second = one.mover, two.mover
    side_1, side_2 = _side(one, nx, ny), _side(two, -nx, -ny)
    distance = (second.x - first.x) * nx + (second.y - first.y) * ny - one.bounds.slack - two.bounds.slack - eps
    reached_1, reached_2 = 0.0, 0.0
    apart = np.int64(0)
    for k in range(steps):
        row_1, row_2 = rows_1[k], rows_2[k]
        cos_1, cos_2 = _largest_cos(row_1, side_1), _largest_cos(row_2, side_2)
        before = _or_anew(reached_1, row_1, cos_1, one) + _or_anew(reached_2, row_2, cos_2, two)
        reached_1 += _advance(row_1, side_1, cos_1)
        reached_2 += _advance(row_2, side_2, cos_2)
        after = _or_anew(reached_1, row_1, cos_1, one) + _or_anew(reached_2, row_2, cos_2, two)
        needed = larger(before, after) + _half_box(row_1, side_1, one) + _half_box(row_2, side_2, two)
        if needed < distance:
            apart |= np.int64(1) << np.int64(k)
    return apart


@inner
def _between_centres(one, two):
    """From the centre of one box to that of the other at the start [m]."""
    first, second = one.mover, two.mover
    dx = second.x + second.offset * two.bounds.cos - first.x - first.offset * one.bounds.cos
    return dx, second.y + second.offset * two.bounds.sin - first.y - first.offset * one.bounds.sin


@inner
def _all(steps):
    return (np.int64(1) << np.int64(steps)) - np.int64(1)


@compiled
def steps_apart(one, rows_1, two, rows_2, steps, eps):
    """Bits of the steps, of the first `steps`, during which two occupancies are surely more than `eps` apart.

    Looks in the direction from one to the other, along and across both headings and halfway between, both ways: what
    it looks in is the same for both road users.
    """
    first, second = one.mover, two.mover
    dx, dy = _between_centres(one, two)
    centres = np.arctan2(dy, dx)
    found, wanted = np.int64(0), _all(steps)
    for backwards in range(2):
        for j in range(12):
            start = centres if j < 4 else (first.heading if j < 8 else second.heading)
            angle = start + 0.25 * np.pi * (j % 4)
            nx, ny = np.cos(angle), np.sin(angle)
            along = dx * nx + dy * ny
            if backwards and np.abs(along) > one.bounds.least + two.bounds.least:
                continue  # nobody is sure to get past the other in this direction
            if (along < 0.0) != (backwards == 1):
                nx, ny = -nx, -ny
            found |= _steps_apart(one, rows_1, two, rows_2, nx, ny, steps, eps)
            if found == wanted:
                return found
    return found


@compiled
def drives_away(braker, goer, theta):
    """Does a road user that goes on drive away from one that brakes, whenever that comes to rest? Def. 20 (ii) on sets.

    Looks at the box, upright on the line between both at the start, that holds all differences of their positions.
    """
    first, second, steps = braker.mover, goer.mover, braker.bounds.steps
    dx, dy = second.x - first.x, second.y - first.y
    start = np.hypot(dx, dy)
    if start <= 0.0 or steps > len(goer.going_on) or goer.bounds.turns_around:
        return False
    nx, ny = dx / start, dy / start
    heading = _wrapped(second.heading - np.arctan2(ny, nx))
    ahead, behind = _sides(braker, goer, nx, ny), _sides(braker, goer, -nx, -ny)
    right, left = _sides(braker, goer, -ny, nx), _sides(braker, goer, ny, -nx)
    near, far, low, high = start, start, 0.0, 0.0
    slack = braker.bounds.slack + goer.bounds.slack
    for k in range(steps):
        row_1, row_2 = braker.braking[k], goer.going_on[k]
        near_next, far_next = near - _closing(row_1, row_2, ahead), far + _closing(row_1, row_2, behind)
        low_next, high_next = low - _closing(row_1, row_2, right), high + _closing(row_1, row_2, left)
        if k >= braker.bounds.first_stop:
            more = slack + (braker.bounds.detour + row_1[ANEW] if braker.bounds.turns_around else 0.0)
            nearest, farthest = smaller(near, near_next) - more, larger(far, far_next) + more
            lowest, highest = smaller(low, low_next) - more, larger(high, high_next) + more
            if nearest <= 0.0:
                return False
            leftmost = np.arctan2(lowest, nearest if lowest < 0.0 else farthest)
            rightmost = np.arctan2(highest, nearest if highest > 0.0 else farthest)
            if larger(heading + row_2[RIGHT] - leftmost, rightmost - heading + row_2[LEFT]) > theta:
                return False
        near, far, low, high = near_next, far_next, low_next, high_next
    return True


@inner
def _sides(one, two, nx, ny):
    """A direction as one road user sees it, and the opposite one as another does."""
    return _side(one, nx, ny), _side(two, -nx, -ny)


@inner
def _closing(row_1, row_2, sides):
    """How much closer two positions may come in a direction in one step [m]."""
    closing = _advance(row_1, sides[0], _largest_cos(row_1, sides[0]))
    return closing + _advance(row_2, sides[1], _largest_cos(row_2, sides[1]))


# ---------------------------------------------------------------- Def. 22: the distance of two road users


@compiled
def who_brakes(one, two, eps, theta):
    """Def. 22: is the distance of two road users safe, and who has to brake to keep it so?

    Args:
      one, two: `Occupancy` of each, in the same steps.
      eps: clearance >= 0 [m].
      theta: largest angle that counts as driving away [rad].

    Returns:
      FIRST_BRAKES or SECOND_BRAKES: safe by item 1, if this one brakes the other may go on.
      BOTH_BRAKE: safe by item 2 only.
      DANGEROUS: the sets may collide.
    """
    first, second = one.mover, two.mover
    rows = min(len(one.braking), len(two.braking))
    steps = max(one.bounds.steps, two.bounds.steps)
    if steps > rows:
        return DANGEROUS  # nobody has looked far enough ahead
    distance = np.hypot(second.x - first.x, second.y - first.y)
    if distance > one.bounds.reach + one.bounds.diagonal + two.bounds.reach + two.bounds.diagonal + eps:
        return BOTH_BRAKE
    if _meet_straight_ahead(one, two, min(one.bounds.steps, two.bounds.steps)):
        return DANGEROUS
    apart = steps_apart(one, one.braking, two, two.braking, steps, eps)
    first_suffices = _suffices(one, two, apart, eps, theta)
    second_suffices = _suffices(two, one, apart, eps, theta)
    if first_suffices != second_suffices:
        return FIRST_BRAKES if first_suffices else SECOND_BRAKES
    return BOTH_BRAKE if apart == _all(steps) else DANGEROUS


@inner
def _meet_straight_ahead(one, two, steps):
    """Can two boxes that brake straight ahead touch after some steps? No direction parts them then.

    This is not needed, but soon told, and true of most pairs that are in danger.
    """
    least_1, most_1, least_2, most_2 = 0.0, 0.0, 0.0, 0.0
    for k in range(steps):
        least_1, most_1 = least_1 + one.braking[k, LO], most_1 + one.braking[k, HI]
        least_2, most_2 = least_2 + two.braking[k, LO], most_2 + two.braking[k, HI]
    first, second = one.mover, two.mover
    length_1, length_2 = first.half_length + 0.5 * (most_1 - least_1), second.half_length + 0.5 * (most_2 - least_2)
    middle_1, middle_2 = first.offset + 0.5 * (least_1 + most_1), second.offset + 0.5 * (least_2 + most_2)
    c_1, s_1, c_2, s_2 = one.bounds.cos, one.bounds.sin, two.bounds.cos, two.bounds.sin
    dx = second.x + middle_2 * c_2 - first.x - middle_1 * c_1
    dy = second.y + middle_2 * s_2 - first.y - middle_1 * s_1
    cos, sin = np.abs(c_1 * c_2 + s_1 * s_2), np.abs(c_1 * s_2 - s_1 * c_2)
    return (
        np.abs(dx * c_1 + dy * s_1) <= length_1 + length_2 * cos + second.half_width * sin
        and np.abs(dy * c_1 - dx * s_1) <= first.half_width + length_2 * sin + second.half_width * cos
        and np.abs(dx * c_2 + dy * s_2) <= length_2 + length_1 * cos + first.half_width * sin
        and np.abs(dy * c_2 - dx * s_2) <= second.half_width + length_1 * sin + first.half_width * cos
    )


@inner
def _suffices(braker, goer, apart, eps, theta):
    """Do the sets of one that brakes and of one that goes on not collide? `apart`: steps in which both brake apart."""
    wanted = _all(braker.bounds.steps)
    return (
        apart & wanted == wanted
        and drives_away(braker, goer, theta)
        and steps_apart(braker, braker.braking, goer, goer.going_on, braker.bounds.steps, eps) == wanted
    )


@compiled
def who_stays(last, first_stands, second_stands, turn_1, turn_2):
    """Def. 22.1: once both have come to rest one may drive away, who has to turn less, and the other one stays.

    Args:
      last: `who_brakes` when it was safe last; DANGEROUS if it never was.
      first_stands, second_stands: is each at rest?
      turn_1, turn_2: `turn_to_drive_away` of each [rad].

    Returns:
      What takes the place of `last` until it is safe again: FIRST_BRAKES if the first one stays. Else `last`.
    """
    if first_stands and second_stands and last in (BOTH_BRAKE, DANGEROUS):
        return SECOND_BRAKES if turn_1 <= turn_2 else FIRST_BRAKES
    return last


@compiled
def proper_response(last, first_stands, second_stands):
    """Def. 22: what both have to do while their distance is not safe, (of the first, of the second).

    Args:
      last: `who_brakes` when it was safe last, or `who_stays`.
      first_stands, second_stands: is each at rest?

    Returns:
      BRAKE: keep C_b, that is brake once the response time is over. GO_ON: keep C_f. DRIVE_AWAY: move only within theta
      of the direction away from the other. STAY: keep standing.
    """
    if last == FIRST_BRAKES:
        return (STAY, DRIVE_AWAY) if first_stands else (BRAKE, GO_ON)
    if last == SECOND_BRAKES:
        return (DRIVE_AWAY, STAY) if second_stands else (GO_ON, BRAKE)
    return (STAY if first_stands else BRAKE), (STAY if second_stands else BRAKE)


@compiled
def headings_away(x, y, x_other, y_other, theta):
    """Headings in which one drives away from another: from the first angle, to the right, to the second [rad]."""
    away = np.arctan2(y - y_other, x - x_other)
    return _wrapped(away - theta), _wrapped(away + theta)


@compiled
def turn_to_drive_away(x, y, heading, x_other, y_other, theta):
    """By how much one has to turn before it may drive away from another [rad], 0 if it may at once."""
    return larger(angle_away(x_other, y_other, x, y, heading) - theta, 0.0)
