"""What a road user may occupy where a simulator moves everybody in whole frames: Def. 21, sampled.

The definition is about continuous time (`definitions.occupancy`). highway-env moves a car frame by frame with the
speed that it has at the start of the frame, and turns its wheels at once. Two things make that easy to bound:

- the middle of a car's rear end moves along the heading, whatever the wheels do, because the slip of highway-env's
  bicycle is that of a point half a car length ahead of it. So that point is where a `Mover` is, `offset` from its box;
- how far it gets in a frame is known from the speeds of the fastest and of the slowest motion, and how far it has
  turned by then from the way of the fastest.

The simulator also tests whether boxes will touch within the next frame, at constant speed along the heading, side by
side and not as a whole. Boxes are widened by what such a test may see too much (`WIDER`).
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, part
from rss_shield.shield.definitions.occupancy import (
    ANEW,
    COS_LEFT,
    COS_RIGHT,
    HI,
    LEFT,
    LO,
    RIGHT,
    SIN_LEFT,
    SIN_RIGHT,
    WIDER,
    Mover,
    Occupancy,
    bounds_of,
)
from rss_shield.shield.params import RSSParams

FIXED, CAR, PEDESTRIAN = range(3)  # walls and parked cars; who drives; who walks, in any direction

# A road user as it is on one frame.
USER = np.dtype(
    [
        ("x", "f8"),  # centre of its box [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("speed", "f8"),  # along it, negative in reverse [m/s]
        ("half_length", "f8"),  # [m]
        ("half_width", "f8"),
        ("kind", "i8"),
        ("first", "?"),  # comes before the ego in an order that all agree on
    ],
    align=True,
)
STANDS = 1e-6  # slower than this is rounding: whoever hands a USER over says 0 [m/s]
WHEELS = np.pi / 4  # largest steering angle of highway-env's cars [rad]
_TAN = 0.5 * np.tan(WHEELS)  # of the slip that it makes
MAX_SLIP = np.arctan(_TAN)
_SIN, _COS = np.sin(MAX_SLIP), np.cos(MAX_SLIP)
LOOK_AHEAD = 0.5  # share of the ways of two in a frame by which a test of contact that looks a frame ahead errs


class Space(NamedTuple):
    """What holds for everybody in open space, beside the table."""

    theta: float  # largest angle to the way from another at which one drives away from it [rad]
    clearance: float  # eps: distance that is kept [m]
    patience: float  # who may drive away and does not move for so long lets the other one [s]
    pedestrian: RSSParams


# theta: ad-rss-lib 5.0.0 and CARLA (RssCheck.cpp). Pedestrians walk at up to 2 m/s (brisk walking), whichever way
LOT = Space(2.4, 0.1, 2.0, RSSParams(0.5, 2.0, 2.0, 4.0, 2.0, 0.0, 2.0, 0.0, 0.0, 2.0))


@compiled
def mover_of(user):
    """A road user (`USER`) as a `Mover`: cars by the middle of their rear end, in the direction in which they drive."""
    speed = np.abs(user.speed)
    if user.kind != CAR:
        return Mover(user.x, user.y, user.heading, speed, 0.0, user.half_length, user.half_width, 0.0)
    lag, heading = user.half_length, user.heading
    x, y = user.x - lag * np.cos(heading), user.y - lag * np.sin(heading)
    if user.speed < 0.0:
        heading, lag = heading + np.pi, -lag
    return Mover(x, y, heading, speed, 0.0, user.half_length, user.half_width, lag)


@compiled
def fastest(v, driver, dt):
    """Highest speed a frame later of one that drives at `v` >= 0 [m/s]."""
    return max(v, min(v + driver.a_max_accel * dt, driver.v_cap))


@compiled
def slowest(v, driver, dt):
    """Lowest likewise, negative if it changes gear and then accelerates; `v` of any sign [m/s]."""
    if v > driver.a_max_brake * dt:
        return v - driver.a_max_brake * dt
    if v > 0.0:
        return -driver.a_max_accel * (dt - v / driver.a_max_brake)
    return -fastest(-v, driver, dt)


@compiled
def sampled_occupancy(user, driver, dt, braking, going_on):
    """The `Occupancy` of one road user in frames of `dt` [s]; fills `[K, ROW_FIELDS]` arrays.

    Args:
      user: `USER`.
      driver: `RSSParams`, the response time in whole frames.
      braking, going_on: what it may occupy if it brakes after its response time (C_b), and if it never does (C_f).
    """
    mover = mover_of(user)
    steps, reach, least = _fill(mover, user.kind, driver, dt, braking, int(driver.response_time / dt + 0.5))
    _fill(mover, user.kind, driver, dt, going_on, len(going_on))
    first_stop = int(mover.v / driver.a_max_brake / dt)
    bounds = bounds_of(mover, steps, first_stop, reach, least, 0.0, 0.0, user.kind == PEDESTRIAN)
    return Occupancy(mover, bounds, braking, going_on)


@compiled
def braking_at_once(user, driver, dt, rows):
    """Fill `rows` with what a road user may occupy that brakes without any response time."""
    _fill(mover_of(user), user.kind, driver, dt, rows, 0)


@part
def _fill(mover, kind, driver, dt, rows, response):
    """Fill the rows of one that brakes after `response` frames.

    Returns:
      Frames until all stand, how far the farthest gets by then, widened, and how far the nearest [m].
    """
    fast, slow = mover.v, mover.v
    wheel = np.abs(mover.offset) / _SIN if kind == CAR else 1.0  # radius on which the centre turns
    wider = LOOK_AHEAD + 2.0 * np.sin(0.5 * MAX_SLIP) if kind == CAR else LOOK_AHEAD
    way, widest, least, steps = 0.0, 0.0, 0.0, len(rows) + 1
    if kind == FIXED:
        fast = slow = 0.0
        response = steps = 0
    for k in range(len(rows)):
        row = rows[k]
        if steps > k and k >= response and fast <= 0.0 and slow >= 0.0:
            steps = k
        hi, lo = fast * dt, slow * dt
        way += hi
        if kind == CAR:
            lo = (lo * _COS if lo > 0.0 else lo) - 0.5 * np.abs(mover.offset) * (lo / wheel) ** 2
        if kind == PEDESTRIAN:
            lo = -hi
        least += lo
        turn = min(way / wheel, np.pi) if kind == CAR else (np.pi if kind == PEDESTRIAN else 0.0)
        row[LO], row[HI] = lo, hi
        if k > 0 and turn == rows[k - 1, RIGHT]:
            for field in range(RIGHT, SIN_LEFT + 1):
                row[field] = rows[k - 1, field]
        else:
            row[RIGHT] = row[LEFT] = turn
            row[COS_RIGHT] = row[COS_LEFT] = np.cos(turn)
            row[SIN_RIGHT] = row[SIN_LEFT] = np.sin(turn)
        row[ANEW], row[WIDER] = 0.0, wider * hi
        widest = max(widest, wider * hi)
        if k < response:
            fast, slow = fastest(fast, driver, dt), slowest(slow, driver, dt)
        else:
            fast = max(fast - driver.a_min_brake * dt, 0.0)
            hard, weak = slow - driver.a_max_brake * dt, slow + driver.a_min_brake * dt
            slow = max(hard, 0.0) if slow > 0.0 else min(weak, 0.0)
    return steps, way + widest, max(least, 0.0)
