"""Two cars on routes that cross or merge, driven at random within what Def. 18 allows, frame by frame as simulators do.

Each frame moves a car at the speed it has at the start (explicit Euler); response times are whole frames and every
car gets its `with_euler_margin`. While a car is free it does anything between full braking and full throttle; a car
that must brake does so as weakly as it may, mostly.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from rss_shield.shield.definitions.right_of_way import (
    CAN_STOP,
    IN_ORDER,
    IN_TIME,
    UNSEEN,
    Approach,
    clears_before,
    junction_items,
    junction_response,
    step_junction,
    would_strand,
)
from rss_shield.shield.params import PRESETS
from rss_shield.shield.sampling import euler_margin, with_euler_margin

DT = 1 / 15  # [s]
AREA = 6.0  # way through the conflict area [m]
LENGTH = 5.0

# two drivers with different tables; the second one reacts late and brakes harder than the first one may ever
QUICK = PRESETS["simulator"].ego._replace(response_time=2 * DT, standstill_gap=0.0, v_cap=25.0)
SLOW = PRESETS["simulator"].other._replace(
    response_time=12 * DT, a_max_accel=2.5, a_min_brake=6.5, a_max_brake=8.0, standstill_gap=0.0, v_cap=20.0
)

SOUND, SWAPPED, NO_ITEM_3, FORGETFUL, AS_A_MERGE, NO_MARGIN, LATE, NEW_PRIORITY = range(8)


class Result(NamedTuple):
    overlap: bool  # both were inside the area at once
    started_safe: bool
    seen: int  # items that were lost, each alone, on the way to danger
    passed: bool  # at least one car has left the area


@njit
def approach(enter, v, rank, area, car, change):
    exact = Approach(enter, enter + area + LENGTH, LENGTH, v, rank)
    return exact if change == NO_MARGIN else with_euler_margin(exact, car, DT)


@njit
def touch(d_1, d_2, area):
    """Are both inside the crossing at once, or in each other on the road after the merge?"""
    inside = -area - LENGTH < d_1 < 0.0 and -area - LENGTH < d_2 < 0.0
    return inside and (area < np.inf or abs(d_1 - d_2) < LENGTH)


@njit
def wish(style, car, rng):
    """Acceleration a free driver picks: flat out, mostly; braking hard; or anything."""
    roll = rng.random()
    if roll < style:
        return car.a_max_accel
    if roll < style + 0.5 * (1.0 - style):
        return -car.a_max_brake
    return rng.uniform(-car.a_max_brake, car.a_max_accel)


@njit
def within(a, lower, upper, rng):
    """The wish inside the bounds; a brake that is owed is a little harder than asked now and then."""
    if upper < 0.0 and rng.random() < 0.1:
        return rng.uniform(lower, upper)
    return min(max(a, lower), upper)


@njit
def respond(items, first, order, tau, v, car, brake_freely, change):
    if change == FORGETFUL:
        items = CAN_STOP
    if change == NO_ITEM_3 and items != 0:
        items &= ~IN_TIME
        if items == 0:
            return -car.a_max_brake, np.inf
    if change == SWAPPED:
        first = not first
    if change == LATE:
        tau -= DT
    return junction_response(items, first, order, tau, v, car, brake_freely)


@njit
def items_of(one, two, car_1, car_2, change):
    items = junction_items(one, two, car_1, car_2)
    if change == AS_A_MERGE:
        endless_1 = Approach(one.enter, np.inf, one.length, one.v, one.priority)
        endless_2 = Approach(two.enter, np.inf, two.length, two.v, two.priority)
        items |= junction_items(endless_1, endless_2, car_1, car_2) & IN_ORDER
    return items


@njit
def move(enter, v, a, car):
    return enter - v * DT, min(max(v + a * DT, 0.0), max(car.v_cap, v))


@njit
def drive(start, ranks, lights, area, car_1, car_2, frames, change, rng):
    """Drive both cars from a start (d_1, v_1, d_2, v_2). Returns a `Result`.

    Priority goes by `ranks`, or changes every `lights` frames, if that is not 0, without all-red.
    """
    d_1, v_1, d_2, v_2 = start
    rank_1, rank_2 = ranks
    style_1, style_2 = rng.random(), rng.random()
    kind = change == SOUND and rng.random() < 0.5  # brakes for a runner, too
    restless = 1.0 if rng.random() < 0.5 else 0.05  # makes up its mind every frame, or rarely
    wish_1, wish_2 = wish(style_1, car_1, rng), wish(style_2, car_2, rng)
    danger, seen = UNSEEN, 0
    for frame in range(frames):
        if lights > 0:
            rank_1 = float(frame // lights % 2)
            rank_2 = 1.0 - rank_1
        one, two = approach(d_1, v_1, rank_1, area, car_1, change), approach(d_2, v_2, rank_2, area, car_2, change)
        danger = step_junction(danger, one, two, items_of(one, two, car_1, car_2, change))
        if frame == 0 and danger.since > 0:
            return Result(False, False, 0, False)
        if touch(d_1, d_2, area):
            return Result(True, True, seen, False)
        wish_1 = wish(style_1, car_1, rng) if rng.random() < restless else wish_1
        wish_2 = wish(style_2, car_2, rng) if rng.random() < restless else wish_2
        a_1, a_2 = wish_1, wish_2
        if danger.since > 0:
            if danger.items in (CAN_STOP, IN_ORDER, IN_TIME):
                seen |= danger.items
            first = rank_1 - rank_2 if change == NEW_PRIORITY else danger.priority
            free_1, free_2 = kind and not would_strand(one, car_1), kind and not would_strand(two, car_2)
            tau = danger.since * DT
            low_1, high_1 = respond(danger.items, first > 0.0, danger.order, tau, v_1, car_1, free_1, change)
            low_2, high_2 = respond(danger.items, first < 0.0, -danger.order, tau, v_2, car_2, free_2, change)
            a_1, a_2 = within(a_1, low_1, high_1, rng), within(a_2, low_2, high_2, rng)
        d_1, v_1 = move(d_1, v_1, a_1, car_1)
        d_2, v_2 = move(d_2, v_2, a_2, car_2)
    return Result(False, True, seen, min(d_1, d_2) < -AREA - LENGTH)


@njit
def drive_many(starts, ranks, area, car_1, car_2, change, rng, lights=0, frames=180):
    """`drive` from each row of starts. Returns (drives from safe starts, overlaps, items lost alone, cars through)."""
    safe, overlaps, seen, passed = 0, 0, 0, 0
    for k in range(len(starts)):
        start = (starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3])
        result = drive(start, ranks, lights, area, car_1, car_2, frames, change, rng)
        safe += result.started_safe
        overlaps += result.overlap
        seen |= result.seen
        passed += result.passed
    return safe, overlaps, seen, passed


@njit
def go_many(starts, a_go, early, car_1, car_2, rng, frames=180):
    """The first car goes by item 3' and the second does as it likes. Returns (drives that were allowed, overlaps).

    `early` is a mutation: the first car believes that it clears so much sooner [m].
    """
    allowed, overlaps = 0, 0
    for k in range(len(starts)):
        d_1, v_1, d_2, v_2 = starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3]
        lag = euler_margin(max(car_1.v_cap - v_1, 0.0), a_go, DT)
        ego = Approach(d_1, d_1 + AREA + LENGTH + lag - early, LENGTH, v_1, 0.0)
        other = Approach(d_2, d_2 + AREA + LENGTH, LENGTH, v_2, 1.0)
        if clears_before(ego, other, a_go, car_1, car_2):
            allowed += 1
            overlaps += meet(d_1, v_1, a_go, d_2, v_2, car_1, car_2, rng, frames)
    return allowed, overlaps


@njit
def meet(d_1, v_1, a_go, d_2, v_2, car_1, car_2, rng, frames):
    style = 1.0 if rng.random() < 0.5 else rng.random()
    for _ in range(frames):
        if touch(d_1, d_2, AREA):
            return True
        d_1, v_1 = move(d_1, v_1, a_go, car_1)
        d_2, v_2 = move(d_2, v_2, wish(style, car_2, rng), car_2)
    return False


def on_a_grid(area):
    """Starts on a coarse grid, before, inside and behind the area, standing and fast; without those that touch."""
    d, v = np.array([-13.0, -8.0, -3.0, 0.5, 3.0, 8.0, 15.0, 30.0, 60.0]), np.array([0.0, 3.0, 8.0, 14.0, 20.0])
    starts = np.stack(np.meshgrid(d, v, d, v, indexing="ij"), axis=-1).reshape(-1, 4)
    return without_contact(starts, area)


def at_random(number, area, rng):
    """Starts at random, without those that touch."""
    return without_contact(rng.uniform([-12.0, 0.0, -12.0, 0.0], [70.0, 20.0, 70.0, 20.0], (number, 4)), area)


def without_contact(starts, area):
    return starts[[not touch(d_1, d_2, area) for d_1, _, d_2, _ in starts]]
