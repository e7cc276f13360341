"""Two road users in open space: is their distance safe, what is remembered of it, and what it permits.

Def. 22 compares sets, of everybody by the parameters of others: nobody knows what another one has in mind. While the
sets are apart, everybody does what it likes. When they no longer are, who has to brake may still do what leaves it a
way out: a trajectory of its own, to rest, that stays clear of the other's set (of all that brakes, or if the other
may go on, of all that it may do until it has come to rest itself). When it has no such command, it carries out the
last way out that it had. Three cases cover who is safe from whom, by the last frame on which each of two had a way out:

- one has had it more recently: the other has been braking since, which is in the set that was looked at;
- both at once: each carries out a trajectory that is in the set that the other has looked at;
- one may go on because the other has to brake: the other stays clear of all that it may do, and it of all places
  where the other may stop from now on, so that it is clear of it when that stands.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, part
from rss_shield.shield.definitions.occupancy import HI, LO, WIDER
from rss_shield.shield.definitions.separation import steps_apart
from rss_shield.shield.definitions.trajectories import angle_away
from rss_shield.shield.definitions.unstructured import (
    BOTH_BRAKE,
    DANGEROUS,
    FIRST_BRAKES,
    SECOND_BRAKES,
    turn_to_drive_away,
    who_brakes,
    who_stays,
)
from rss_shield.shield.open_space.frames import CAR, FIXED, PEDESTRIAN, STANDS

GIVES_WAY, HAS_WAY, NEITHER = range(3)  # Def. 22: whose turn it is to brake, or to stay
# kinds of danger: what was so when the distance was safe last
DANGER_NAMES = ("ego gives way", "other gives way", "both brake", "never apart")

# What is remembered of one other road user. A new record is all zeros.
PAIR = np.dtype(
    [
        ("age", "i8"),  # samples seen
        ("last", "i8"),  # `who_brakes` when it was safe last, in the order that all agree on, or `who_stays`
        ("kind", "i8"),  # of danger, index into DANGER_NAMES
        ("since", "i8"),  # samples since it was safe
        ("never", "?"),  # has not been safe since it was seen first
        ("waited", "i8"),  # samples on which both have stood in danger
        ("ego_slip", "f8"),  # of the last motion of each [rad]
        ("other_slip", "f8"),
        ("ego_broke", "i8"),
        ("ego_excess", "f8"),
        ("other_broke", "i8"),
        ("other_excess", "f8"),
    ],
    align=True,
)


@part
def clear(one, rows_1, two, rows_2, steps, eps):
    """Are two occupancies surely more than `eps` apart during the first `steps` steps?"""
    if steps <= 0:
        return True
    if steps > len(rows_1):
        return False  # nobody has looked far enough ahead
    first, second = one.mover, two.mover
    reach, wider = one.bounds.diagonal + two.bounds.diagonal + eps, 0.0
    for k in range(steps):
        reach += max(np.abs(rows_1[k, LO]), np.abs(rows_1[k, HI])) + max(np.abs(rows_2[k, LO]), np.abs(rows_2[k, HI]))
        wider = max(wider, rows_1[k, WIDER] + rows_2[k, WIDER])
    if np.hypot(second.x - first.x, second.y - first.y) > reach + wider:
        return True  # their discs do not meet
    return steps_apart(one, rows_1, two, rows_2, steps, eps) == (np.int64(1) << np.int64(steps)) - np.int64(1)


@part
def distance_between(ego, other, kind, other_first, space):
    """Def. 22 for the ego and another: `who_brakes`, in the order that all agree on.

    Toward what never moves, and toward pedestrians, whom nobody expects to stop, only the ego brakes.
    """
    steps = ego.bounds.steps
    if kind != CAR:
        rows = other.going_on if kind == PEDESTRIAN else other.braking
        return BOTH_BRAKE if clear(ego, ego.braking, other, rows, steps, space.clearance) else DANGEROUS
    if other_first:
        return _of_cars(other, ego, space)
    return _of_cars(ego, other, space)


@part
def _of_cars(one, two, space):
    answer = who_brakes(one, two, space.clearance, space.theta)
    if answer in (FIRST_BRAKES, SECOND_BRAKES):
        # who goes on may have to brake later: then, too, they have to be apart until both stand
        steps = max(one.bounds.steps, two.bounds.steps)
        if not clear(one, one.braking, two, two.braking, steps, space.clearance):
            return DANGEROUS
    return answer


@compiled
def remember(memory, distance, ego, user, space, dt):
    """Take in one sample, in place.

    Args:
      memory: `PAIR`.
      distance: `distance_between`.
      ego, user: `USER`.
    """
    if distance != DANGEROUS:
        memory.last = distance
        memory.since = memory.waited = memory.ego_broke = memory.other_broke = 0
        memory.ego_excess = memory.other_excess = 0.0
        memory.never = False
        memory.kind = _kind_of(distance, user.first)
        memory.age += 1
        return
    if memory.age == 0:
        memory.never, memory.last, memory.kind = True, DANGEROUS, 3
    memory.age += 1
    memory.since += 1
    if user.kind != CAR:
        return
    ego_stands, other_stands = ego.speed == 0.0, user.speed == 0.0
    own, others = _turn(ego, user, space.theta), _turn(user, ego, space.theta)
    if user.first:
        memory.last = who_stays(memory.last, other_stands, ego_stands, others, own)
    else:
        memory.last = who_stays(memory.last, ego_stands, other_stands, own, others)
    memory.waited = memory.waited + 1 if ego_stands and other_stands else 0
    if memory.waited * dt > space.patience:
        memory.last, memory.waited = (SECOND_BRAKES if memory.last == FIRST_BRAKES else FIRST_BRAKES), 0


@part
def _kind_of(distance, other_first):
    if distance == BOTH_BRAKE:
        return 2
    return 1 if (distance == FIRST_BRAKES) == other_first else 0


@part
def _turn(one, other, theta):
    """By how much a car has to turn before it may drive away, in either gear [rad]."""
    ahead = turn_to_drive_away(one.x, one.y, one.heading, other.x, other.y, theta)
    return min(ahead, turn_to_drive_away(one.x, one.y, one.heading + np.pi, other.x, other.y, theta))


@compiled
def role_of(last, is_first):
    """What one of two has to do in danger."""
    if last == FIRST_BRAKES:
        return GIVES_WAY if is_first else HAS_WAY
    if last == SECOND_BRAKES:
        return HAS_WAY if is_first else GIVES_WAY
    return NEITHER


@part
def permits(plan, actor, acceleration, other, at_once, user, role, eps, space, dt):
    """Does a way out leave a car clear of another, in danger?

    Args:
      plan: `intention` of the car, actor: the car (`USER`), acceleration: what it begins with [m/s^2].
      other: `Occupancy` of the other, at_once: rows if that brakes at once, user: the other (`USER`).
      role: of the car.
      eps: clearance [m].
    """
    until, own = plan.bounds.steps, plan.braking
    if until == 0 and actor.speed == 0.0:
        return True  # it stands
    if user.kind == FIXED:
        return clear(plan, own, other, other.braking, until, eps)
    if user.kind == PEDESTRIAN:
        return clear(plan, own, other, other.going_on, until, eps)
    both = max(until, other.bounds.steps)
    if clear(plan, own, other, other.braking, both, eps) and (
        role != GIVES_WAY or clear(plan, own, other, other.going_on, until, eps)
    ):
        return True
    if role != HAS_WAY or not clear(plan, own, other, at_once, both, eps):
        return False
    if user.speed != 0.0:
        return True
    v = actor.speed + acceleration * dt
    if np.abs(v) < STANDS:
        v = actor.speed
    heading = actor.heading + np.pi if v < 0.0 else actor.heading
    return angle_away(user.x, user.y, actor.x, actor.y, heading) <= space.theta
