"""Extra evasive effort on one frame (Def. 13): who offends, and which manoeuvre gets out of its way.

A manoeuvre takes the place of what the ego's driver wants, and nothing else: the filter restricts it like any other
wish. So the ego keeps its proper response toward everybody, and is not to blame, whatever is tried here. Manoeuvres
stay within the published table for the same reason, though tyres could do more (Def. 12.1), and are looked for anew on
every frame. Of the family those are left out that leave the road, or would not keep clear of somebody who is not in
danger with the ego, whatever he does within his own response (Def. 12.3); whoever is in danger with it is predicted
naively.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import apart, compiled, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.evasion import (
    Motion,
    Plan,
    ends_safely,
    follow,
    keeps_clear,
    must_evade,
    naive,
    smallest_separation,
)
from rss_shield.shield.definitions.lateral import d_min_no_credit
from rss_shield.shield.ground import table_of
from rss_shield.shield.lanes.memory import owes_braking
from rss_shield.shield.lanes.pair import STANDSTILL
from rss_shield.shield.lanes.restriction import straighten
from rss_shield.shield.verdicts import KEPT

HORIZON = 4.0  # that manoeuvres are followed for [s]
STEP = 0.1  # between two looks on the way [s]
_STRAIGHT, _ASIDE = 4, 4  # brakings, and accelerating; as many with a swerve, going on instead of accelerating
_SWERVES = 3
_LANE = 4.0  # [m]
FAMILY = _STRAIGHT + _ASIDE * _SWERVES * 2  # how many manoeuvres there are
_MOST_AT_ONCE = 60  # of road users in danger with the ego that are told apart


class Room(NamedTuple):
    """How far the ego may move to either side before it leaves its road [m]."""

    left: float
    right: float


class Effort(NamedTuple):
    """What it comes to."""

    wish: Command  # to be restricted: the driver's, or that of a manoeuvre
    evading: bool  # a manoeuvre has begun, and the danger lasts
    changed: bool  # the wish is not the driver's


@compiled
def manoeuvre(k, driver, first=-1.0):
    """Manoeuvre `k` of the family, gentle ones first: `FAMILY` plans.

    Straight on with `a_min_brake`, halfway, `a_max_brake`, `a_max_accel`; then moving over by 1 m (within the lane),
    2 m and 4 m (to the next one) to either side, at the same speed and with each of the brakings. `first`: the side
    that comes first, -1 = left.
    """
    middle = 0.5 * (driver.a_min_brake + driver.a_max_brake)
    if k < _STRAIGHT:
        if k == 3:
            return Plan(driver.a_max_accel, 0.0, 0.0)
        return Plan(-(driver.a_min_brake if k == 0 else middle if k == 1 else driver.a_max_brake), 0.0, 0.0)
    k -= _STRAIGHT
    side, far, braking = (1 - 2 * (k % 2)) * first, (k // 2) % _SWERVES, k // (2 * _SWERVES)
    a_lat = driver.a_lat_max_accel
    swerve = np.sqrt(2.0**far / max(a_lat, 1e-9))  # moves over by a_lat swerve^2
    a = 0.0
    if braking > 0:
        a = -(driver.a_min_brake if braking == 1 else middle if braking == 2 else driver.a_max_brake)
    return Plan(a, side * a_lat, swerve)


@apart
def evade(wish, evading, ego, users, memory, room, body, bounds, table, who=None):
    """Def. 13: a manoeuvre out of the family, if one is owed and there is one.

    It is owed in danger with somebody who has broken its duty, or who is hit, as predicted naively, although the ego
    keeps its basic response; unless that response is such a manoeuvre itself. Among those that touch nobody the first
    that ends out of danger counts; where somebody would be hit else, the one that stays farthest from whoever is in
    danger with the ego. As long as none swerves, the driver steers. Once the ego has moved over, and until the danger
    is over, it goes straight on wherever its driver would return to where it is hit.

    Args:
      wish: `Command` of the ego's driver.
      evading: of the `Effort` on the frame before.
      ego, users, memory: as in `find_danger`, which has carried the memory over to this frame.
      room: `Room`.
      body: `Body` of the ego.
      bounds: `Bounds` of its duties.
      table: `Table` in force.
      who: `[K]` indices of those to look at, if not everybody; all others are far apart.

    Returns:
      `Effort`.
    """
    dangerous, offenders, urgent = _offenders(ego, users, memory, table, who)
    if not dangerous:
        return Effort(wish, False, False)
    if offenders != 0:
        me, best, widest = _motion_of_ego(ego), -1, -1.0
        first = 1.0 if _sideways(wish, ego) > 0.0 else -1.0
        for k in range(FAMILY):
            plan = manoeuvre(k, table.ego, first)
            if not _is_possible(me, plan, room, table):
                continue
            separation, ends = _outcome(me, plan, users, memory, offenders, table, who)
            if separation < 0.0 or not _harms_nobody(me, plan, users, memory, table, who):
                continue
            if ends:
                best = k
                break
            if urgent and separation > widest + 1e-3:
                best, widest = k, separation
        if best >= 0:
            plan = manoeuvre(best, table.ego, first)
            evading = evading or plan.swerve > 0.0
            held = plan.swerve == 0.0 and evading and _returns(wish, ego, users, memory, table, who)
            return Effort(_command(plan, wish, held, ego, body, bounds, table), evading, True)
    if evading and _returns(wish, ego, users, memory, table, who):
        straight = straighten(ego, wish.acceleration, bounds, body, table.dt)
        return Effort(Command(wish.acceleration, straight), True, True)
    return Effort(wish, evading, False)


@inner
def _offenders(ego, users, memory, table, who):
    """(is there danger, set of bits: who of those in it makes an evasion owed, is one of them hit else)."""
    me, place, offenders, urgent = _motion_of_ego(ego), 0, 0, False
    for a in range(how_many(who, users)):
        i = which(who, a)
        if memory[i].since == 0:
            continue
        other = _motion_of(users[i], memory[i])
        braking = table.ego.a_min_brake if owes_braking(memory[i], table.rules) != 0 else 0.0
        basic = Plan(-braking, 0.0, 0.0)
        collides = smallest_separation(me, basic, other, HORIZON, STEP) < 0.0
        enough = not collides and _is_over(me, basic, other, table_of(table, users[i]))
        # whether the family has a way out is found out afterwards; the basic response may be one already
        if place < _MOST_AT_ONCE and not enough and must_evade(True, memory[i].other_broke == KEPT, collides, True):
            offenders |= 1 << place
            urgent = urgent or collides
        place += 1
    return place > 0, offenders, urgent


@inner
def _is_possible(me, plan, room, table):
    """Does a manoeuvre stay on the road, within the table and within what wheels can do at that speed?"""
    if plan.swerve == 0.0:
        return True
    if 2.0 * plan.swerve > HORIZON or plan.a_lat == 0.0:
        return False
    aside = me.u + plan.a_lat * plan.swerve  # fastest across
    slowest = me.v + min(plan.a, 0.0) * plan.swerve
    if abs(aside) > table.rules.heading_bound * max(slowest, 0.0):
        return False
    moved = follow(me, plan, HORIZON)[2] - me.y
    return -room.left <= moved <= room.right


@inner
def _outcome(me, plan, users, memory, offenders, table, who):
    """(smallest separation from those in danger with the ego, is it out of danger with the offenders in the end)."""
    smallest, ends, place = np.inf, True, 0
    for a in range(how_many(who, users)):
        i = which(who, a)
        if memory[i].since == 0:
            continue
        other = _motion_of(users[i], memory[i])
        smallest = min(smallest, smallest_separation(me, plan, other, HORIZON, STEP))
        if smallest < 0.0:
            break
        if place < _MOST_AT_ONCE and (offenders >> place) & 1:
            ends = ends and _is_over(me, plan, other, table_of(table, users[i]))
        place += 1
    return smallest, ends


@inner
def _is_over(me, plan, other, table):
    """Is the danger over in the end? An ego at rest is still in the way of somebody who comes up from behind."""
    x, v, _, _ = follow(me, plan, HORIZON)
    x_other, v_other = naive(other.x, other.v, other.a, HORIZON)
    if v <= 0.0 and x_other < x and v_other > 0.0:
        return False
    return ends_safely(me, plan, other, table.ego, table.other, HORIZON)


@inner
def _harms_nobody(me, plan, users, memory, table, who):
    """Does a manoeuvre keep clear of everybody with whom there is no danger, at his worst?"""
    for a in range(how_many(who, users)):
        i = which(who, a)
        if memory[i].since > 0:
            continue
        other, toward = _motion_of(users[i], memory[i]), table_of(table, users[i])
        if other.v < 0.0:
            if plan.swerve > 0.0 and not _keeps_aside(me, plan, other, toward):
                return False
        elif not keeps_clear(me, plan, other, toward.ego, toward.other, HORIZON, STEP):
            return False
    return True


@inner
def _keeps_aside(me, plan, other, table):
    """Does a swerve stay clear across the lane of somebody who comes the other way?"""
    for k in range(int(HORIZON / STEP + 1e-9) + 1):
        _, _, y, u = follow(me, plan, k * STEP)
        side = 1.0 if other.y >= y else -1.0
        across = side * (other.y - y) - me.half_width - other.half_width
        if across < d_min_no_credit(side * u, -side * other.u, table.ego, table.other):
            return False
    return True


@inner
def _command(plan, wish, held, ego, body, bounds, table):
    """The first frame of a manoeuvre. Without a swerve the driver steers, unless the ego is `held` on its course."""
    if plan.swerve == 0.0 or ego.speed < STANDSTILL:
        return Command(plan.a, straighten(ego, plan.a, bounds, body, table.dt) if held else wish.slip)
    u = ego.speed * np.sin(ego.heading) + plan.a_lat * table.dt
    course = np.arcsin(min(max(u / ego.speed, -1.0), 1.0))
    return Command(plan.a, course - ego.heading)


@inner
def _sideways(wish, ego):
    """How fast the driver moves across the lane, to the right [m/s]."""
    return ego.speed * np.sin(ego.heading + wish.slip)


@inner
def _returns(wish, ego, users, memory, table, who):
    """Does the driver move over to where it is hit, as predicted naively, and is not if it goes straight on?"""
    me, u = _motion_of_ego(ego), _sideways(wish, ego)
    side = 1.0 if u > 0.0 else -1.0 if u < 0.0 else 0.0
    ahead = Motion(me.x, me.v, me.a, me.y, 0.0, 0.0, me.half_length, me.half_width)
    a_lat, hit = table.ego.a_lat_max_accel, False
    for a in range(how_many(who, users)):
        i = which(who, a)
        if memory[i].since == 0:
            continue
        braking = table.ego.a_min_brake if owes_braking(memory[i], table.rules) != 0 else 0.0
        other = _motion_of(users[i], memory[i])
        if smallest_separation(ahead, Plan(-braking, 0.0, 0.0), other, HORIZON, STEP) < 0.0:
            return False
        aside = Plan(-braking, side * a_lat, np.sqrt(_LANE / max(a_lat, 1e-9)))
        hit = hit or smallest_separation(me, aside, other, HORIZON, STEP) < 0.0
    return hit


@inner
def _motion_of_ego(ego):
    u = ego.speed * np.sin(ego.heading)
    return Motion(ego.s, ego.speed * ego.cos, 0.0, ego.y, u, 0.0, ego.half_length, ego.half_width)


@inner
def _motion_of(user, memory):
    """Somebody else, as naive prediction has him: he keeps his acceleration along the lane, and his speed across."""
    a = memory.acceleration_other * user.cos
    return Motion(user.s, user.speed * user.cos, a, user.y, user.u, 0.0, user.half_length, user.half_width)
