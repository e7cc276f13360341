"""Routes of different geometry and right of way: Defs. 14-18.

Two routes share a conflict area: a crossing, which both cars leave again, or a merge, which has no end. Each car is
described by distances along its own route, so the geometry stays outside. All functions take floats.

Where the paper leaves a choice the safest reading counts: without a priority route *all* cars must be able to stop
(W1), right of way is given, never taken (W3), every item that was true asks for its braking (W4), item 2 counts on a
crossing only if the first car leaves (W5), and each car has its own speed cap (W7). Sampled at frames, each car needs
`shield.sampling.with_euler_margin` first.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.definitions.kinematics import (
    forward_reach,
    reach,
    stopping_distance,
    time_to_cover,
    time_to_cover_accelerating,
    time_to_cover_braking,
)
from rss_shield.shield.definitions.longitudinal import d_min_following, is_safe_longitudinally
from rss_shield.shield.definitions.response import FRONT, REAR, lateral_response, longitudinal_response
from rss_shield.shield.geometry import signed_gap

CAN_STOP, IN_ORDER, IN_TIME = 1, 2, 4  # items of Def. 17 that hold; 0 = none: dangerous


class Approach(NamedTuple):
    """One car on its way through a conflict area, along its own route."""

    enter: float  # D  from its front to the area, negative inside   [m]
    leave: float  # E  until its rear has left; inf where routes merge [m]
    length: float  # l  of the car                                    [m]
    v: float  # speed, >= 0                                           [m/s]
    priority: float  # rank of its route: the higher one goes first; equal ranks: nobody has priority


@compiled
def distances_to_area(s, half_length, start, end):
    """(enter, leave) of a car whose centre is at `s`; its route runs through the area from `start` to `end` [m]."""
    return start - (s + half_length), end - (s - half_length)


class Threshold(NamedTuple):
    """What a pair remembers of its last safe sample, seen from the first car."""

    items: int  # of Def. 17 that held there
    order: float  # +1 the first car was in front, -1 behind, 0 undecided
    priority: float  # +1 the first car had priority, -1 the second, 0 nobody
    since: int  # frames since; 0 = safe now


UNSEEN = Threshold(0, 0.0, 0.0, 0)  # of a new pair


# ---------------------------------------------------------------- lateral: Defs. 14, 15


@compiled
def lateral_interval(x, u, params):
    """Lateral positions a car can come to on its own route (Def. 14) [m].

    It accelerates sideways, either way, for its response time and then brakes sideways.

    Args:
      x, u: lateral position [m] and speed [m/s] on the own route, same sign convention.
      params: `RSSParams` of the driver.

    Returns:
      (x_min, x_max) [m].
    """
    rho, a, b = params.response_time, params.a_lat_max_accel, params.a_lat_min_brake
    return x - forward_reach(-u, rho, a, b), x + forward_reach(u, rho, a, b)


@compiled
def strip_gap(distance, one, two, half_width_one, half_width_two):
    """Gap between the strips that two cars sweep (Def. 14) [m], negative where they overlap.

    Args:
      distance: from the first route to the second, signed like lateral positions [m].
      one, two: `lateral_interval` of each car on its own route.
      half_width_one, half_width_two: of the cars [m].
    """
    middle_one, middle_two = 0.5 * (one[0] + one[1]), distance + 0.5 * (two[0] + two[1])
    half_one, half_two = half_width_one + 0.5 * (one[1] - one[0]), half_width_two + 0.5 * (two[1] - two[0])
    return signed_gap(middle_two - middle_one, half_one, half_two)


@compiled
def is_safe_across_routes(gap, one, two):
    """Are the swept strips mu apart (Def. 14)? mu alone: the strips contain the motion (M1)."""
    return gap > 0.0 and gap >= 0.5 * (one.mu + two.mu)


@compiled
def route_lateral_response(tau, u, params):
    """Lateral proper response on the own route (Def. 15): no side is "away", so the car stops sideways and stays.

    That is the answer to a neighbour on the left and to one on the right at once.

    Args:
      tau: time since the threshold [s].
      u: lateral speed on the own route, positive to the right [m/s].
      params: `RSSParams` of the driver.

    Returns:
      (a_lower, a_upper, u_lower, u_upper) as `lateral_response`.
    """
    as_right, as_left = lateral_response(1.0, tau, u, params), lateral_response(-1.0, tau, u, params)
    return (
        max(as_right[0], as_left[0]),
        min(as_right[1], as_left[1]),
        max(as_right[2], as_left[2]),
        min(as_right[3], as_left[3]),
    )


# ---------------------------------------------------------------- longitudinal safety: Defs. 16, 17


@compiled
def longitudinal_order(enter_one, enter_two):
    """Who is in front (Def. 16): +1 the first car, -1 the second, 0 undecided.

    The car nearer to the area along its own route; inside, on a common piece of road, the one that is farther in.
    """
    return np.sign(enter_two - enter_one)


@compiled
def can_stop_before(distance, v, params):
    """Can the driver still stop within a distance (Def. 17, item 1)? The standstill gap stays free."""
    reached = reach(v, params.response_time, params.a_max_accel, params.a_min_brake, params.v_cap)
    return reached + params.standstill_gap <= distance


@compiled
def non_priority_can_stop(one, two, params_one, params_two):
    """Item 1 of Def. 17: can every car without priority stop before the area?

    Of two equal routes none has priority: both must be able to stop (W1).
    """
    stops_one = one.priority > two.priority or can_stop_before(one.enter, one.v, params_one)
    stops_two = two.priority > one.priority or can_stop_before(two.enter, two.v, params_two)
    return stops_one and stops_two


@compiled
def gap_behind(rear, front):
    """Room between the front of one car and the rear of the other, measured through the area (Def. 17, item 2) [m].

    Through the merge point where routes merge. On a crossing the first car is out of the way only once it has left,
    so the gap runs from its way out: while that is positive the two are never inside together (W5).

    Args:
      rear, front: `Approach` of each car.
    """
    if np.isinf(front.leave):
        return rear.enter - front.enter - front.length
    return rear.enter - front.leave


@compiled
def is_ahead(front, rear, params_front, params_rear):
    """Item 2 of Def. 17: the front car stays in front whatever both do, by Lemma 2 at every instant.

    Args:
      front, rear: `Approach` of each car, in the order of Def. 16.
      params_front, params_rear: `RSSParams` of each driver.
    """
    d_min = d_min_following(rear.v, front.v, params_rear, params_front)
    return is_safe_longitudinally(gap_behind(rear, front), d_min)


@compiled
def first_arrival(car, params):
    """Earliest time at which a car that answers in time enters the area [s]; inf if it would stop before (Def. 17)."""
    rho, a, b = params.response_time, params.a_max_accel, params.a_min_brake
    return time_to_cover(car.enter, car.v, rho, a, b, params.v_cap)


@compiled
def last_departure(car, params):
    """Latest time at which a car leaves the area [s]; inf if it could stop before, -inf if it has left (Def. 17)."""
    if car.leave <= 0.0:
        return -np.inf
    return time_to_cover_braking(car.leave, car.v, params.a_max_brake)


@compiled
def are_apart(one, two, params_one, params_two):
    """Item 3 of Def. 17: the times at which the cars may be inside do not overlap, or both would stop before.

    One car that would stop is not enough while the other may linger inside (W6): it might have the right of way.
    """
    first_one, first_two = first_arrival(one, params_one), first_arrival(two, params_two)
    both_stop = np.isinf(first_one) and np.isinf(first_two)
    return both_stop or last_departure(one, params_one) < first_two or last_departure(two, params_two) < first_one


@compiled
def junction_items(one, two, params_one, params_two):
    """Longitudinal safety of two cars whose routes meet (Def. 17).

    Args:
      one, two: `Approach` of each car.
      params_one, params_two: `RSSParams` of each driver.

    Returns:
      The items that hold, CAN_STOP | IN_ORDER | IN_TIME. Dangerous iff 0.
    """
    order = longitudinal_order(one.enter, two.enter)
    ahead = (order > 0 and is_ahead(one, two, params_one, params_two)) or (
        order < 0 and is_ahead(two, one, params_two, params_one)
    )
    stop = non_priority_can_stop(one, two, params_one, params_two)
    apart = are_apart(one, two, params_one, params_two)
    return (CAN_STOP if stop else 0) | (IN_ORDER if ahead else 0) | (IN_TIME if apart else 0)


@compiled
def clears_before(ego, other, a_go, ego_params, other_params):
    """Item 3': an ego that goes now, at `a_go` up to its speed cap, has left before the other can arrive.

    Item 3 is hardly ever true below some 9 m/s, because a slow car could always stop inside; this one takes the ego
    at its word. The other may drive flat out and never brakes, so nobody has to give way. The decision is a
    commitment: once in, the ego must not brake again.

    Sampled at frames, `leave` needs `euler_margin(v_cap - v, a_go, dt)` on top: a car that accelerates lags behind.

    Args:
      ego, other: `Approach` of each car.
      a_go: acceleration the ego commits to, >= 0 [m/s^2].
      ego_params, other_params: `RSSParams` of each driver.
    """
    if ego.leave <= 0.0:
        return True
    clears = time_to_cover_accelerating(ego.leave, ego.v, a_go, ego_params.v_cap)
    return clears < time_to_cover_accelerating(other.enter, other.v, other_params.a_max_accel, other_params.v_cap)


# ---------------------------------------------------------------- longitudinal response: Def. 18


@compiled
def step_junction(threshold, one, two, items):
    """Danger threshold of one pair, one sample on: the last sample at which any item held.

    A light may change in the middle of a danger: priority, too, is that of the threshold.

    Args:
      threshold: `Threshold` after the previous sample, `UNSEEN` at first.
      one, two: `Approach` of each car now.
      items: of `junction_items` now.

    Returns:
      The `Threshold` after this sample. Dangerous iff its `since` > 0.
    """
    if items != 0:
        return Threshold(items, longitudinal_order(one.enter, two.enter), np.sign(one.priority - two.priority), 0)
    return Threshold(threshold.items, threshold.order, threshold.priority, threshold.since + 1)


@compiled
def must_brake(items, has_priority, order):
    """Is the driver a braking party (Def. 18)? Every item that was true asks for its braking (W4).

    Args:
      items: items that were true at the threshold; 0 = danger from the start, where everybody brakes.
      has_priority: the driver's route had priority over the other's at the threshold.
      order: at the threshold, +1 the driver was in front, -1 behind.
    """
    yields = (items & CAN_STOP) != 0 and not has_priority
    follows = (items & IN_ORDER) != 0 and order < 0
    return items == 0 or yields or follows or (items & IN_TIME) != 0


@compiled
def would_strand(car, params):
    """Would braking at `a_min_brake` bring the car to rest inside the area (hole H7)?"""
    rest = stopping_distance(car.v, params.a_min_brake)
    return car.enter < rest < car.leave


@compiled
def junction_response(items, has_priority, order, tau, v, params, brake_freely):
    """Accelerations a driver may choose in danger at a junction (Def. 18). Sideways: `route_lateral_response`.

    Args:
      items, has_priority, order: as in `must_brake`.
      tau: time since the threshold [s].
      v: own speed, >= 0 [m/s].
      params: `RSSParams` of the driver.
      brake_freely: brake although nothing asks for it, as for a car that runs through (hole H7). A driver does so
        unless `would_strand`.

    Returns:
      (lower, upper) [m/s^2]; upper is inf where nothing bounds it.
    """
    role = REAR if brake_freely or must_brake(items, has_priority, order) else FRONT
    return longitudinal_response(role, tau, v, params)
