"""Road users who are known within bounds: the worst that they may be, as one record.

What a sensor says of somebody is some way off what is there. Where the bounds of its errors are known, the record of
that road user is *inflated* before the shield measures anything: longer and wider, nearer in speed to what is worse,
and faster toward the ego across the lane. Every required distance of `shield.lanes.pair` grows with each of these and
every gap shrinks, so

    the inflated record is safe on an axis  =>  every state within the bounds is safe on it,

and more so for wider bounds: nothing that is in danger is missed. Nor is the answer too late or the wrong one. The
danger of the inflated record begins no later than the true one, wherever within its bounds that is, and goes on no
shorter. On which axis the true pair was safe last is not known, so the record is marked as `vague` and danger is
answered on both (`shield.lanes.memory`): braking at `a_min_brake` for whoever may be ahead, and no more speed toward
the side than the least since the danger began. Both are permitted in every role, and whatever duty the true danger
puts on the ego is among them. So an ego that keeps its duties toward inflated records keeps those toward the true
ones, and Lemma 5 holds for what is there.

A measurement of age `tau` counts for where its road user is now if it is moved on at its own speed first: meanwhile
the other may have braked or sped up at the limits of the table, and moved across the lane at those. Drivers who
exceed these limits are out of bounds, as an error is that is larger than said.

Assumed: the ego knows its own state; lanes are straight (on a bend the coordinates of a displaced point differ in
second order of the error); the error across the lane is less than half the width of a car, or it isn't known which
side somebody is on who is beside the ego. See `LARGEST_ACROSS`.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.ground import table_of
from rss_shield.shield.lanes.pair import assess

LARGEST_ACROSS = 0.9  # error across the lane up to which a side is known [m]
_BARELY = 1e-9


class Accuracy(NamedTuple):
    """How far what is measured of a road user may be off what is there."""

    along: float  # along its heading [m]
    across: float  # across its heading [m]
    speed: float  # [m/s]
    heading: float  # [rad]


class Spread(NamedTuple):
    """How far a road user may be off in the lane frame, after the age of what is known of it."""

    lon: float  # [m]
    lat: float  # [m]
    speed: float  # [m/s]
    lateral: float  # of its speed across the lane over the last frame [m/s]
    turning: float  # lateral speed that its driver may have gained meanwhile [m/s]


@compiled
def spread_of(user, accuracy, age, other):
    """`Spread` of a measurement.

    Args:
      user: `ROAD_USER` record as measured, moved on along its heading for its age.
      accuracy: `Accuracy`.
      age: of the measurement [s].
      other: `RSSParams` of its driver.
    """
    slant = min(abs(user.sin) + accuracy.heading, 1.0)  # sine of the largest angle to the lane
    harder, sideways = max(other.a_max_brake, other.a_max_accel), max(other.a_lat_max_accel, other.a_lat_min_brake)
    way = (abs(user.speed) + accuracy.speed) * age
    along = accuracy.along + accuracy.speed * age + 0.5 * harder * age**2 + 0.5 * way * accuracy.heading**2
    across = accuracy.across + way * accuracy.heading + 0.5 * sideways * age**2
    return Spread(
        along + across * slant,
        across + along * slant,
        accuracy.speed + harder * age,
        accuracy.speed * slant,
        sideways * age,
    )


@compiled
def inflate(user, ego, accuracy, age, table):
    """Make of what is measured of a road user the worst that it may be, in place.

    Args:
      user: `ROAD_USER` record as measured, moved on along its heading for its age.
      ego: `ROAD_USER` record.
      accuracy: `Accuracy`.
      age: of the measurement [s].
      table: `Table` in force.
    """
    spread = spread_of(user, accuracy, age, table_of(table, user).other)
    side = 1.0 if user.y >= ego.y else -1.0
    committed = max(accuracy.heading - side * user.sin, 0.0)
    fastest = abs(user.speed) + spread.speed
    w = max(spread.lateral - side * user.u, fastest * min(committed, 1.0)) + spread.turning
    user.u = -side * w

    turned = np.hypot(user.half_length, user.half_width) * accuracy.heading  # a box that is turned is longer and wider
    user.half_length += spread.lon + turned
    user.half_width += spread.lat + turned

    ahead = user.s + spread.lon >= ego.s
    if ahead:
        user.s = max(user.s, ego.s)
    if abs(user.cos) <= accuracy.heading:
        user.cos = -_BARELY if ahead else _BARELY  # it may face the ego, which requires more
    opposite = user.cos < 0.0
    user.speed += spread.speed if ahead == opposite else -spread.speed
    if not opposite:
        user.cos = _worst_cosine(user, ahead, accuracy.heading)
    user.vague = True
    if opposite:
        _take_worse_lane(user, ego, table)


@inner
def _worst_cosine(user, ahead, heading):
    """Of the angle to the lane of somebody who drives the ego's way."""
    if ahead and user.speed < 0.0:
        return min(user.cos + heading, 1.0)
    return max(user.cos * np.cos(heading) - abs(user.sin) * np.sin(heading), _BARELY)


@inner
def _take_worse_lane(user, ego, table):
    """Who is in its own lane is not known either: it decides how hard each of two has to brake (Def. 2)."""
    user.in_own_lane = True
    own = assess(ego, user, table).margin_lon
    user.in_own_lane = False
    user.in_own_lane = own <= assess(ego, user, table).margin_lon
