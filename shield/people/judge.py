"""Who is to blame for a contact with a pedestrian, or with somebody who was hidden: Def. 27 with Section 14, Def. 25.

The ego owes a plan that stays clear of where pedestrians may be (`shield.junctions.judge.judge_user`). A
pedestrian owes to stay within what it could reach when the last such plan was there, on the crossing if it was on one,
and not to walk into a car. Who came out of hiding faster than is reasonable is to blame for what follows; toward
whoever else comes out the ego must have a plan when it sees them.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.occlusion import is_unreasonable_speed
from rss_shield.shield.definitions.pedestrians import distance_to_reach
from rss_shield.shield.people.reach import sampled_room
from rss_shield.shield.verdicts import (
    HURRIED,
    KEPT,
    LEAPED,
    LEFT_CROSSING,
    NO_CAUTION,
    UNREASONABLE,
    WALKED_IN,
)

_JITTER = 0.05  # [m/s]

# What is remembered of one pedestrian. SI units.
WATCHED = np.dtype(
    [
        ("x", "f8"),  # at the last sample with a plan
        ("y", "f8"),
        ("heading", "f8"),
        ("v", "f8"),
        ("has_way", "?"),  # was on a crossing then, with the right of way
        ("in_way", "?"),  # was on the ego's way at the last sample
        ("came_after", "?"),  # and had come there where the ego was already
    ],
    align=True,
)


class Seen(NamedTuple):
    """A pedestrian on one sample."""

    x: float  # [m]
    y: float
    heading: float  # [rad]
    v: float  # [m/s]
    v_high: float  # largest speed that is reasonable there [m/s]
    has_way: bool  # on a crossing, with the right of way
    on_crossing: bool  # on its stripes or where they are waited for
    in_way: bool  # on the ego's way, bodies included
    beside: bool  # the front of the ego has passed it
    near: bool  # it touches the ego, or nearly
    stands: bool  # the ego does


@compiled
def watch_person(memory, crossing, seen, walk, dt):
    """Take in one sample of a pedestrian: what has it broken? Before the ego is judged on it.

    `judge_user` forgets what was broken if the ego has a plan toward it all the same.

    Args:
      memory: WATCHED, changed in place.
      crossing: CROSSING of the same up to the sample before; what the pedestrian broke is entered.
      seen: `Seen`.
      walk: `Walk`.
      dt: length of a frame [s].
    """
    if seen.in_way and not memory.in_way:
        memory.came_after = seen.beside
    memory.in_way = seen.in_way
    duty, excess = KEPT, 0.0
    if crossing.age > 0:
        duty, excess = broken_by(memory, seen, (crossing.since + 1) * dt, walk, dt)
    if seen.near and (memory.came_after or seen.stands):
        duty, excess = WALKED_IN, 0.0
    if duty != KEPT and crossing.other_broke == KEPT:
        crossing.other_broke, crossing.other_excess = duty, excess


@compiled
def remember_person(memory, crossing, seen):
    """What it does from now on is measured from this sample if the ego has a plan on it; after `judge_user`."""
    if crossing.age == 1 or crossing.since == 0:
        memory.x, memory.y, memory.heading, memory.v = seen.x, seen.y, seen.heading, seen.v
        memory.has_way = seen.has_way


@inner
def broken_by(memory, seen, since, walk, dt):
    """(duty, excess) that a pedestrian has broken since the last sample with a plan, `since` ago [s]."""
    if memory.has_way:
        faster = seen.v - max(memory.v, min(memory.v + walk.a_max_accel * since, seen.v_high))
        if faster > _JITTER:
            return HURRIED, faster
        return (KEPT, 0.0) if seen.on_crossing else (LEFT_CROSSING, 0.0)
    faster = seen.v - (memory.v + walk.a_max_accel * min(since, walk.response_time))
    if faster > _JITTER:
        return HURRIED, faster
    dx, dy = seen.x - memory.x, seen.y - memory.y
    excess = distance_to_reach(dx, dy, memory.heading, memory.v, walk) - sampled_room(memory.v, walk, dt)
    return (LEAPED, excess) if excess > 0.0 else (KEPT, 0.0)


@compiled
def note_exposure(crossing, v, v_low, v_high):
    """Somebody was hidden and is seen first on this sample (Defs. 24, 25). Before the ego is judged on it.

    Args:
      crossing: CROSSING of who has not been sampled yet.
      v: its speed, v_low, v_high: what is reasonable there [m/s].
    """
    if is_unreasonable_speed(v, v_low, v_high + _JITTER):
        crossing.other_broke, crossing.other_excess = UNREASONABLE, v - v_high


@compiled
def judge_caution(crossing):
    """After `judge_user` on that sample: toward who comes out reasonably the ego must have a plan (Def. 26)."""
    if crossing.age == 1 and crossing.items == 0 and crossing.other_broke == KEPT and crossing.ego_broke == KEPT:
        crossing.ego_broke, crossing.ego_excess = NO_CAUTION, 0.0


@compiled
def stay_uncautious(crossing):
    """On the samples after, as long as no plan has stayed clear of everybody since: what it gets into is its own doing.

    A plan toward the one who came out alone, for a moment, does not make up for it (J15).
    """
    if crossing.since > 0 and crossing.other_broke == KEPT and crossing.ego_broke == KEPT:
        crossing.ego_broke, crossing.ego_excess = NO_CAUTION, 0.0
