"""What the ego does at a junction: what it wants, or the smoothest that leaves a plan, or the plan in force (Def. 18).

Who has none left takes what harms least.
"""

import numpy as np

from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.junctions.easing import RISE, SEARCH, caps
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import (
    ANY_PLACE,
    ANYWHERE,
    EVERY_FRAME,
    EVERYBODY,
    NEVER,
    SLACK,
    TAIL,
    Scene,
    first_met,
    go_plan,
    go_plan_past,
    plan_conflict,
    stop_conflict,
    throttle,
)
from rss_shield.shield.junctions.toward_one import alone_with, plans_and_duty

_IMMINENT = 2.0  # [s]


@inner
def choose(scene, plan, a, at_line, holds):
    """Acceleration of this frame, whether a plan remains, and whether none is left to the ego."""
    if not holds:
        if stop_conflict(scene, a, EVERYBODY, at_line, SLACK + scene.drift) == NEVER:
            plan.go = 0
            return a, True, False
        go, _ = go_plan(scene, a, EVERYBODY, at_line, SLACK + scene.drift)
        if go >= 0:
            plan.go = go
            return a, True, False
    go_now = throttle(scene, scene.track.s, scene.track.v)
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if plan.go >= 0 and plan_conflict(scene, plan.go, EVERYBODY, 0.0) == NEVER:
        goes = plan.go > 0
        plan.go = max(plan.go - 1, 0)
        return (go_now if goes else brake), True, False
    return _escape(scene, plan, go_now, brake)


@apart
def is_trapped(scene):
    """Is there no plan from now on that stays clear of everybody: neither to brake, nor to go on for however long?"""
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, brake, EVERYBODY, ANYWHERE, 0.0) == NEVER:
        return False
    go_now = throttle(scene, scene.track.s, scene.track.v)
    return go_plan_past(scene, go_now, EVERYBODY, ANYWHERE, 0.0, ANY_PLACE, EVERY_FRAME)[0] < 0


@inner
def ease(scene, plan, memory, wish, at_line, rate):
    """The smoothest acceleration toward a wish that leaves a plan, see `shield.junctions.easing`.

    Returns:
      (acceleration, does it leave a plan, does the wish as well). Without a plan nothing is decided.
    """
    ego, slack = scene.table.ego, SLACK + scene.drift
    limits = caps(scene, memory, at_line, rate)
    rise = max(plan.held_at, -ego.a_min_brake) + RISE * scene.table.dt
    if stop_conflict(scene, wish, EVERYBODY, at_line, slack) == NEVER:
        if wish <= min(limits.behind, limits.line, rise):
            plan.go = 0
            return wish, True, True
        return _ease_off(scene, plan, wish, limits, rise, at_line)
    go, _ = go_plan(scene, wish, EVERYBODY, at_line, slack)
    if go >= 0:
        a, plan.go = _pull_away(scene, wish, go, min(limits.behind, rise), at_line, ANY_PLACE)
        return a, True, True
    if plan.go > 0:  # what has begun is gone through with
        return wish, False, False
    cap = limit(min(limits.behind, limits.line, rise), scene.track.v, ego, scene.table.dt)
    a, stops = _largest_that_stops(scene, wish, cap, at_line)
    if stops:
        plan.go = 0
    return a, stops, False


@apart
def _ease_off(scene, plan, wish, limits, rise, at_line):
    """`ease` where a wish leaves a plan to stop, but is more than its caps."""
    track, dt, slack = scene.track, scene.table.dt, SLACK + scene.drift
    rest = track.s + track.v * dt + stopping_distance(track.v + wish * dt, scene.table.ego.a_min_brake)
    cap, line = min(limits.behind, rise), limits.line
    if rest >= limits.place:  # it comes to rest past the line
        line = np.inf
    if line < wish:
        go, _ = go_plan_past(scene, wish, EVERYBODY, at_line, slack, limits.place, TAIL)
        if go >= 0:
            a, plan.go = _pull_away(scene, wish, go, cap, at_line, limits.place)
            return a, True, True
        if plan.go > 0 and plan_conflict(scene, plan.go, EVERYBODY, 0.0) == NEVER:
            go_now = throttle(scene, track.s, track.v)
            if wish >= go_now:  # what has begun is gone through with
                plan.go -= 1
                return go_now, True, True
    plan.go = 0
    eased = limit(min(cap, line), track.v, scene.table.ego, dt)
    if eased >= wish or stop_conflict(scene, eased, EVERYBODY, at_line, slack) != NEVER:
        return wish, True, True
    return eased, True, True


@apart
def _pull_away(scene, wish, go, cap, at_line, place):
    """Acceleration of a plan to go on, below a cap if that leaves one, and its frames of throttle.

    Args:
      go: frames of throttle after the wish.
      place: the plan may not come to rest before it [m].
    """
    eased = limit(cap, scene.track.v, scene.table.ego, scene.table.dt)
    if eased < wish:
        gently, _ = go_plan_past(scene, eased, EVERYBODY, at_line, SLACK + scene.drift, place, TAIL)
        if gently > 0:
            return eased, gently
    return wish, go


@apart
def _largest_that_stops(scene, wish, cap, at_line):
    """Largest acceleration, up to a cap below a wish that leaves no plan to stop, that leaves one.

    Returns:
      (acceleration, is there any), to within 2^-`SEARCH` of what is between braking and the wish.
    """
    slack = SLACK + scene.drift
    low, high = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt), wish
    if cap < wish:
        if stop_conflict(scene, cap, EVERYBODY, at_line, slack) == NEVER:
            return cap, True
        high = cap
    if high < low or stop_conflict(scene, low, EVERYBODY, at_line, slack) != NEVER:
        return low, False
    for _ in range(SEARCH):
        middle = 0.5 * (low + high)
        if stop_conflict(scene, middle, EVERYBODY, at_line, slack) == NEVER:
            low = middle
        else:
            high = middle
    return low, True


@apart
def _escape(scene, plan, go_now, brake):
    """Somebody left their bounds, or appeared: a plan that stays clear of everybody, or on most ways, or for longest.

    Most of the ways that a road user may take are not taken: a plan is the better the fewer of them it meets.
    """
    stop_at = stop_conflict(scene, brake, EVERYBODY, ANYWHERE, 0.0)
    if stop_at == NEVER:
        plan.go = 0
        return brake, True, False
    go, go_at = go_plan(scene, go_now, EVERYBODY, ANYWHERE, 0.0)
    if go >= 0:
        plan.go = go
        return go_now, True, False
    plan.go = -1
    hard = limit(-scene.table.ego.a_max_brake, scene.track.v, scene.table.ego, scene.table.dt)
    best = brake
    ways, at = _stops_among(scene, brake, scene.table.ego.a_min_brake)
    hard_ways, hard_at = _stops_among(scene, hard, scene.table.ego.a_max_brake)
    if (hard_ways, -hard_at) < (ways, -at):
        best, ways, at = hard, hard_ways, hard_at
    # to stop comes first, unless somebody is about to arrive (junction hole H7)
    if at * scene.table.dt < _IMMINENT and (_goes_among(scene, go_now), -go_at) < (ways, -at):
        best = go_now
    return best, False, True


@inner
def _stops_among(scene, a, brake):
    """On how many ways of others "this frame `a`, then `brake`" may meet somebody, and the first frame of that."""
    ways, first = 0, NEVER
    for k in range(len(scene.threats)):
        at = first_met(_with_way(scene, k), a, brake)
        ways += at < NEVER
        first = min(first, at)
    return ways, first


@inner
def _goes_among(scene, a):
    """On how many ways of others no plan to go on stays clear of them."""
    ways = 0
    for k in range(len(scene.threats)):
        ways += go_plan(_with_way(scene, k), a, EVERYBODY, ANYWHERE, 0.0)[0] < 0
    return ways


@inner
def _with_way(scene, k):
    """The scene with one way of the others only."""
    return Scene(scene.paths, scene.track, scene.threats[k : k + 1], scene.table, scene.drift)


@apart
def least_harm(scene, a, users):
    """Of what is left to a trapped ego, what breaks the fewest duties; braking if that breaks no more [m/s^2]."""
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    best, fewest = a, _duties_broken(scene, a, users)
    if fewest > 0:
        broken = _duties_broken(scene, brake, users)
        if broken < fewest or (broken == fewest and a > brake):
            best, fewest = brake, broken
        go_on = throttle(scene, scene.track.s, scene.track.v)
        if fewest > 0 and _duties_broken(scene, go_on, users) < fewest:
            best = go_on
    return best


@apart
def _duties_broken(scene, a, users):
    """How many road users would an acceleration leave no plan toward, though there is one now?

    One that cannot move out of the way counts more than all that can.
    """
    broken = 0
    for i in range(users):
        alone = alone_with(scene, i)
        items, kept = plans_and_duty(alone, i, a)
        if items != 0 and not kept:
            broken += 1 if alone.threats[0].path >= 0 else users
    return broken
