"""One frame of the shield at a junction: keep a plan that stays clear of everybody (Defs. 17, 18, 27).

Whatever the agent wants, it may do as long as a plan remains afterwards that meets nobody. If none
would remain, the plan that was found before is carried out: it stays clear because everybody keeps to
the bounds it was made for. That is the proper response of Def. 18: stop where stopping was safe, go on
where only going on was. With anticipation, the ego does so smoothly (`shield.junctions.easing`): of what leaves a
plan to stop, it takes the most instead of the hardest braking, and it eases off before that.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import apart, compiled, inner, records
from rss_shield.shield.definitions.kinematics import stopping_distance, time_to_collision
from rss_shield.shield.junctions.conflict_areas import CELL, boxes_overlap, cell_of
from rss_shield.shield.junctions.easing import RISE, SEARCH, caps
from rss_shield.shield.junctions.examined import TABLE, count_examined, examine, is_left_out
from rss_shield.shield.junctions.plans import (
    ANY_PLACE,
    ANYWHERE,
    EVERYBODY,
    GO,
    NEVER,
    PATIENCE,
    SLACK,
    START_UP,
    STOP,
    Scene,
    behind_by,
    can_give_way,
    distance_behind,
    first_met,
    go_plan,
    go_plan_past,
    look_ahead,
    on_path_of_ego,
    plan_conflict,
    stop_conflict,
    throttle,
)
from rss_shield.shield.junctions.reach import STANDING
from rss_shield.shield.lanes.controller import RESPONSE_BRAKE, RESPONSE_GO
from rss_shield.shield.verdicts import (
    ACCELERATED,
    BRAKED,
    CRASHED,
    CUT_IN,
    GAVE_NO_WAY,
    KEPT,
    LEFT_NO_PLAN,
    LEFT_PATHS,
    OTHER,
    REVERSED,
    TOO_FAR,
    TOO_HARD,
    TRAPPED,
    WAVERED,
    judged,
    who_broke,
)

CAUTIOUS, PRIORITY, ASSERTIVE = range(3)  # whom the ego expects to give way: nobody, who must, who can
ENTRIES = ("cautious", "priority", "assertive")
_IMMINENT = 2.0  # [s]
_TOLERANCE = 1e-6
_REVERSING = 0.1  # slower than this backwards is standing [m/s]
_JITTER = 0.02  # speeds of others are read off a simulator that integrates in steps [m/s]

# What the ego remembers of one road user. SI units.
CROSSING = records(
    [
        ("age", "i8"),  # samples since first sight
        ("since", "i8"),  # frames since the last sample with a plan; 0 = there is one now
        ("items", "i8"),  # plans at that sample: STOP, GO or both; 0 = never any
        ("follows", "?"),  # was the ego's follower at the last sample, on one of its ways at least
        ("behind", "?"),  # and has been so at a safe distance
        ("stood", "i8"),  # frames for which it has been standing, 0 = it moves
        ("counted_on", "i8"),  # frames for which the ego has had no plan but one that counts on that (rule J9)
        ("relied", "?"),  # is counted on to give way on this frame
        ("relied_before", "?"),  # was so on the frame before
        ("way", "i8"),  # path of the ego then
        ("path", "i8"),  # path that its announced route followed then, -1 = none announced
        ("wreck", "?"),  # at the last sample
        ("astray", "?"),  # was on no path then
        ("x", "f8"),  # at the last sample
        ("y", "f8"),
        ("speed", "f8"),
        ("lanes", "i8"),  # lanes on which it may be now or next, as a set of bits
        ("ways", "i8"),  # paths that it may be on, likewise
        ("reachable", "i8"),  # likewise, if it changes lanes
        ("ego_broke", "i8"),  # first duty each broke since the last sample with a plan, index into `verdicts.DUTIES`
        ("ego_excess", "f8"),
        ("other_broke", "i8"),
        ("other_excess", "f8"),
        ("was_lawless", "?"),  # the other broke one up to this sample, though the ego may have a plan toward it again
    ]
)

# What the ego reads of one road user on one sample. SI units.
SAMPLE = records(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("speed", "f8"),
        ("lanes", "i8"),  # lanes on which it may be, as a set of bits
        ("next_lanes", "i8"),  # these and the ones that follow
        ("reachable", "i8"),  # those, and lanes beside them
        ("path", "i8"),  # path that its announced route follows, -1 = none announced
        ("wreck", "?"),
        ("ways", "i8"),  # paths that it may be on, as a set of bits
        ("strays", "?"),  # has gone on where none of the ways leads that it might be on before
        ("astray", "?"),  # on no lane at all
        ("alert", "?"),  # is known to wait: nobody counts on it to stand
    ]
)

# The plan in force.
PLAN = records(
    [
        ("go", "i8"),  # frames of throttle left, -1 = no plan
        ("held_at", "f8"),  # acceleration to which the ego was held back on the last frame, inf = it was not [m/s^2]
        ("wronged", "?"),  # somebody broke a duty, and there has been no plan since that stays clear of everybody
    ]
)


class JunctionReport(NamedTuple):
    """What the shield saw and did on one frame."""

    acceleration: float  # what it lets through [m/s^2]
    overridden: bool  # somebody's presence changed it
    anticipated: bool  # anticipation did, though what was asked for would have left a plan
    limited: bool  # only the limits of acceleration did
    response: int  # RESPONSE_BRAKE or RESPONSE_GO where it was overridden, else 0
    pairs: int  # road users toward whom the ego is not free
    broken: int  # those toward whom it broke its duty
    trapped: bool  # no plan stays clear of everybody
    ttc: float  # time to collision with a car ahead on the path [s]
    examined: int  # road users against whom plans are checked
    possible: int  # all road users


@apart
def junction_frame(scene, samples, memory, plan, nominal, entry, at_line, which, overrides, rate, holds=False):
    """Restrict the ego's acceleration to what leaves it a plan, and judge everybody.

    Args:
      scene: `Scene`; what its threats say about plans is changed.
      samples: `[N]` SAMPLE of all road users.
      memory: `[N]` CROSSING, changed in place.
      plan: PLAN, or any record with its fields, changed in place.
      nominal: acceleration that the ego's own controller asks for [m/s^2].
      entry: CAUTIOUS, PRIORITY or ASSERTIVE.
      at_line: the ego may rest only where it is in nobody's way, whoever may come.
      which: against whom plans are checked, index into `shield.junctions.examined.EXAMINED`.
      overrides: False = watch only.
      rate: of anticipation, see `Rules` [1/s]; 0 = none.
      holds: the plan in force is carried out, whatever the controller asks for.

    Returns:
      `JunctionReport`.
    """
    sort_out(scene, memory, entry)
    examine(scene, samples, which, SLACK + scene.drift)
    limited = limit(nominal, scene.track.v, scene.table.ego, scene.table.dt)
    a, clear, trapped, anticipated = nominal, False, False, False
    if overrides:
        if rate > 0.0 and not holds:
            a, clear, anticipated = _ease(scene, plan, memory, limited, at_line, rate)
        if not clear:
            a, clear, trapped = _choose(scene, plan, limited, at_line, holds or rate > 0.0)
        if trapped:
            a = _least_harm(scene, a, len(samples))
        plan.held_at = a if a < limited else np.inf
    else:
        trapped = _is_trapped(scene, plan)
    pairs = broken = 0
    for i in range(len(samples)):
        known = clear and (which <= TABLE or not is_left_out(scene, i))
        dangerous, kept = judge_user(scene, i, samples[i], memory[i], a, known, trapped)
        pairs += dangerous
        broken += not kept
    _note_who_trapped(plan, memory, trapped, trapped and _is_resolute(scene, a))
    anticipated = anticipated and a != limited
    changed = overrides and a != limited and not anticipated
    response = 0
    if changed:
        response = RESPONSE_BRAKE if a < limited else RESPONSE_GO
    return JunctionReport(
        a,
        changed,
        anticipated,
        limited != nominal and a == limited,
        response,
        pairs,
        broken,
        trapped,
        _ttc(scene),
        count_examined(scene),
        len(samples),
    )


@inner
def _note_who_trapped(plan, memory, trapped, resolute):
    """Whoever broke a duty and so trapped the ego is to blame for contacts with those toward whom no plan is left.

    They may have done nothing wrong, and the ego had to break its plans toward somebody (hole H24): that it did is no
    fault of its own, as long as it is `resolute`.
    """
    if not trapped:
        plan.wronged = False
        return
    for i in range(len(memory)):
        plan.wronged |= memory[i].was_lawless
    for i in range(len(memory)):
        if plan.wronged and resolute and memory[i].since == 0 and memory[i].ego_broke == LEFT_NO_PLAN:
            memory[i].ego_broke, memory[i].ego_excess = KEPT, 0.0
        if plan.wronged and memory[i].since == 1 and memory[i].other_broke == KEPT:
            memory[i].other_broke = TRAPPED


@apart
def has_plan(scene, memory, entry, at_line):
    """Would braking now, or going on, stay clear of everybody? Asked before a lane change.

    Nobody may find the ego closer ahead than a follower's safe distance who did not follow it before.
    """
    _find_those_behind(scene, memory)
    for i in range(len(memory)):
        _, follows, gap_is_safe = _is_behind(scene, i)
        if follows and not (gap_is_safe or memory[i].behind):
            return False
    sort_out(scene, memory, entry)
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, brake, EVERYBODY, at_line, SLACK + scene.drift) == NEVER:
        return True
    return (
        go_plan(scene, throttle(scene, scene.track.s, scene.track.v), EVERYBODY, at_line, SLACK + scene.drift)[0] >= 0
    )


@apart
def leaves_plan(scene, samples, memory, wish, entry, at_line, which):
    """Would one frame of what the ego's controller asks for leave a plan that stays clear of everybody?

    Args:
      wish: acceleration asked for [m/s^2].
      scene, samples, memory, entry, at_line, which: as in `junction_frame`.
    """
    slack = SLACK + scene.drift
    sort_out(scene, memory, entry)
    examine(scene, samples, which, slack)
    a = limit(wish, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, a, EVERYBODY, at_line, slack) == NEVER:
        return True
    return go_plan(scene, a, EVERYBODY, at_line, slack)[0] >= 0


@compiled
def limit(a, v, ego, dt):
    """Limits that always hold: never harder than the parameters say, never backwards [m/s^2]."""
    a = min(max(a, -ego.a_max_brake), ego.a_max_accel, max((ego.v_cap - v) / dt, 0.0))
    return max(a, -max(v, 0.0) / dt)


@compiled
def sort_out(scene, memory, entry):
    """Mark the ways of others that the ego need not stay clear of: followers, and who must give way."""
    _find_followers(scene, memory)
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        threat.ignored, threat.left_out = threat.follows, False
        threat.stands_for = _stands_for(threat, memory[threat.user], entry, scene.table.dt) if threat.path >= 0 else 0.0
        look_ahead(scene, threat)
        if threat.path >= 0 and not threat.follows and entry != CAUTIOUS and not threat.wreck and threat.red_for == 0.0:
            obliged = entry == ASSERTIVE or threat.priority > 0
            if obliged and can_give_way(scene, threat):
                threat.ignored = True
                memory[threat.user].relied = True


@inner
def _stands_for(threat, memory, entry, dt):
    """How long is a road user counted on to stand still, because it has stood for long (rule J9) [s]? 0 = it is not.

    Its time runs from when the ego has no other plan left, once: only when the ego has one it begins anew.
    """
    if threat.wreck or abs(threat.v) >= STANDING or memory.stood * dt < PATIENCE[entry]:
        return 0.0
    return max(START_UP - memory.counted_on * dt, 0.0)


@inner
def _find_those_behind(scene, memory):
    """Note who drives behind the ego, at whatever distance."""
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        threat.follows = threat.path >= 0 and is_follower(scene, threat, memory[threat.user].behind)


@inner
def _find_followers(scene, memory):
    """Note who has to keep its distance behind the ego.

    Whoever comes to be behind it at less than its distance is none yet, whether it merged or the ego did: plans go on
    staying clear of it, as they did before. Who was there at first sight is one at any distance.
    """
    _find_those_behind(scene, memory)
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.follows:  # a light is nobody, and follows nobody
            known = memory[threat.user]
            if known.age > 0 and not known.follows:
                threat.follows = _keeps_distance(scene, threat)


@compiled
def is_follower(scene, threat, established):
    """Does a road user drive behind the ego on its way, or is it behind on a way that has just parted from it?

    Beside the ego it is no follower, unless it has been one before.
    """
    paths, track = scene.paths, scene.track
    bodies = 0.0 if established else track.half_length + threat.half_length
    if behind_by(paths, track, threat) > bodies:
        return True
    entered_ego, from_ego = _entered(paths, track.path, track.s)
    entered_other, from_other = _entered(paths, threat.path, threat.s)
    return from_ego >= 0 and from_ego == from_other and track.s - entered_ego - (threat.s - entered_other) > bodies


@inner
def _entered(paths, path, s):
    """Where on a path a driver at `s` headed for its lane [m], and the lane before, -1 = none."""
    first = paths.reached[path, cell_of(s, paths.cells[path])]
    return first * CELL, paths.lane[path, first - 1] if first > 0 else -1


@inner
def _choose(scene, plan, a, at_line, holds):
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
def _is_trapped(scene, plan):
    """Would the shield have no plan now that stays clear of everybody, if it were on? It only watches.

    As in `_choose` and `_escape`; `plan` is the one that would be in force then.
    """
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, brake, EVERYBODY, ANYWHERE, 0.0) == NEVER:
        plan.go = 0
        return False
    if plan.go >= 0 and plan_conflict(scene, plan.go, EVERYBODY, 0.0) == NEVER:
        plan.go = max(plan.go - 1, 0)
        return False
    go_now = throttle(scene, scene.track.s, scene.track.v)
    plan.go = go_plan(scene, go_now, EVERYBODY, ANYWHERE, 0.0)[0]
    return plan.go < 0


@inner
def _ease(scene, plan, memory, wish, at_line, rate):
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
    """`_ease` where a wish leaves a plan to stop, but is more than its caps."""
    track, dt, slack = scene.track, scene.table.dt, SLACK + scene.drift
    rest = track.s + track.v * dt + stopping_distance(track.v + wish * dt, scene.table.ego.a_min_brake)
    cap, line = min(limits.behind, rise), limits.line
    if rest >= limits.place:  # it comes to rest past the line
        line = np.inf
    if line < wish:
        go, _ = go_plan_past(scene, wish, EVERYBODY, at_line, slack, limits.place)
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
        gently, _ = go_plan_past(scene, eased, EVERYBODY, at_line, SLACK + scene.drift, place)
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
def _least_harm(scene, a, users):
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
        alone = _alone_with(scene, i)
        items, kept = _plans_and_duty(alone, i, a)
        if items != 0 and not kept:
            broken += 1 if alone.threats[0].path >= 0 else users
    return broken


# ---------------------------------------------------------------- who broke a duty: Def. 27


@compiled
def judge_user(scene, i, sample, memory, a, clear, trapped):
    """Take in one sample of one road user and judge the ego's acceleration toward it.

    Args:
      scene: `Scene`.
      i: index of the road user; sample: its SAMPLE; memory: its CROSSING, changed in place.
      a: acceleration that the ego executes on this frame [m/s^2].
      clear: a plan that stays clear of everybody is known to remain afterwards.
      trapped: no plan stays clear of everybody, because somebody appeared or left the bounds. Duties
        toward several then contradict each other: what is owed is to brake, or to go on, with all it has.

    Returns:
      (dangerous, kept): is the ego not free toward this road user, and did it keep its duty? A contact is
      judged more strictly: whoever left itself no plan toward the other is to blame, unless somebody's breach has
      trapped it (`_note_who_trapped`).
    """
    _judge_motion(sample, memory, scene.table.other, scene.table.dt)
    memory.was_lawless = memory.other_broke != KEPT
    scene = _alone_with(scene, i)
    memory.stood = memory.stood + 1 if abs(sample.speed) < STANDING and not sample.alert else 0
    memory.counted_on = memory.counted_on + 1 if _counts_on_standing(scene, i, a) else 0
    may_follow, follows, gap_is_safe = _is_behind(scene, i)
    dangerous, kept, items, cut_in = False, True, STOP, False
    followed, memory.behind = memory.behind, may_follow and (memory.behind or gap_is_safe)
    if not follows:
        strongest = max(limit(scene.table.ego.a_max_accel, scene.track.v, scene.table.ego, scene.table.dt), a)
        if stop_conflict(scene, strongest, i, ANYWHERE, 0.0) != NEVER:
            dangerous = True
            if not clear:
                items, kept = _plans_and_duty(scene, i, a)
        had_plan = memory.age > 0 and memory.since == 0 and not followed
        cut_in = items == 0 and had_plan and memory.way != scene.track.path and memory.other_broke == KEPT
    if may_follow and not memory.behind:
        items = 0
    too_hard = may_follow and a < -scene.table.ego.a_max_brake - _TOLERANCE
    if too_hard and not gap_is_safe:
        dangerous, kept = True, False
    if items != 0:
        memory.items, memory.since = items, 0
        memory.other_broke, memory.other_excess = KEPT, 0.0
        # having braked too hard in front of a follower counts until that has its distance again
        if memory.ego_broke != TOO_HARD or gap_is_safe or not may_follow:
            memory.ego_broke, memory.ego_excess = KEPT, 0.0
    else:
        memory.since += 1
        if followed and not may_follow and memory.other_broke == KEPT:
            memory.other_broke = TOO_FAR  # their ways part, and it had not kept its distance
    if cut_in:
        kept = False
        memory.ego_broke = CUT_IN
    if memory.ego_broke == KEPT and (too_hard or not kept):
        memory.ego_broke = TOO_HARD if too_hard else LEFT_NO_PLAN if items != 0 else WAVERED
        memory.ego_excess = abs(a)
    if trapped and not kept and not cut_in:
        kept = _is_resolute(scene, a)
    memory.follows, memory.way = may_follow, scene.track.path
    memory.x, memory.y, memory.speed, memory.lanes = sample.x, sample.y, sample.speed, sample.next_lanes
    memory.reachable, memory.path, memory.ways = sample.reachable, sample.path, sample.ways
    memory.wreck, memory.astray = sample.wreck, sample.astray
    memory.age += 1
    memory.relied, memory.relied_before = False, memory.relied
    return dangerous, kept


@inner
def _alone_with(scene, i):
    """The scene without the ways of others before and after those of a road user, which stand together."""
    first, last = len(scene.threats), 0
    for k in range(len(scene.threats)):
        if scene.threats[k].user == i:
            first, last = min(first, k), k + 1
    return Scene(scene.paths, scene.track, scene.threats[first:last], scene.table, scene.drift)


@inner
def _judge_motion(sample, memory, other, dt):
    """Did a road user leave the bounds that plans assume, since the last sample?"""
    if memory.age == 0:
        return
    faster = sample.speed - max(memory.speed, min(memory.speed + other.a_max_accel * dt, other.v_cap))
    slower = memory.speed - other.a_max_brake * dt - sample.speed
    duty, excess = KEPT, 0.0
    moved = np.hypot(sample.x - memory.x, sample.y - memory.y)
    if sample.wreck and (not memory.wreck or moved > _JITTER * dt):
        duty = CRASHED
    elif _leaves_paths(sample, memory):
        duty = LEFT_PATHS
    elif faster > _JITTER and not sample.wreck:
        duty, excess = ACCELERATED, faster / dt
    elif slower > _JITTER and not sample.wreck:
        duty, excess = BRAKED, slower / dt
    elif sample.speed < -_REVERSING:
        duty, excess = REVERSED, -sample.speed
    elif memory.relied_before or (memory.counted_on > 0 and abs(sample.speed) >= STANDING):
        duty = GAVE_NO_WAY  # forgotten by `judge_user` if the ego still has a plan
    if duty != KEPT and memory.other_broke == KEPT:
        memory.other_broke, memory.other_excess = duty, excess


@inner
def _leaves_paths(sample, memory):
    """Has a road user gone where none of its ways leads? Who is off all of them is expected to stand, or to come back.

    So whoever drives on there has left them anew on every sample, also one that has never been on any (J12).
    """
    off = sample.astray and not (memory.astray and abs(sample.speed) < STANDING)
    return off or sample.strays or sample.lanes & ~memory.lanes != 0


@apart
def _counts_on_standing(scene, i, a):
    """Has the ego no plan after its acceleration, but one that counts on a road user to stand?"""
    stands_for = scene.threats[0].stands_for if len(scene.threats) > 0 else 0.0  # the same on all its ways
    if stands_for == 0.0:
        return False
    _count_on(scene, 0.0)
    counts = not _leaves_plan(scene, i, a)
    _count_on(scene, stands_for)
    return counts


@inner
def _count_on(scene, stands_for):
    for k in range(len(scene.threats)):
        scene.threats[k].stands_for = stands_for
        look_ahead(scene, scene.threats[k])


@inner
def _is_behind(scene, i):
    """Does a road user follow the ego on any of its ways, on all of them, and at a safe distance on those (Lemma 2)?"""
    some, every, safe = False, True, True
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.user != i:
            continue
        some |= threat.follows
        every &= threat.follows
        safe = safe and (not threat.follows or _keeps_distance(scene, threat))
    return some, some and every, safe


@inner
def _keeps_distance(scene, threat):
    """Is a road user behind the ego at a safe distance (Lemma 2)? Where their ways have parted none is needed."""
    distance = behind_by(scene.paths, scene.track, threat)
    gap = distance - scene.track.half_length - threat.half_length
    return distance < 0.0 or gap >= distance_behind(threat, max(threat.v, 0.0), scene.track.v, scene.table.other)


@apart
def _plans_and_duty(scene, i, a):
    """Kinds of plans that stay clear of one road user from this sample on, and does the ego do its duty toward it?"""
    items = _plans_now(scene, i)
    return items, (_leaves_plan(scene, i, a) if items != 0 else _is_resolute(scene, a))


@inner
def _plans_now(scene, i):
    """Kinds of plans that stay clear of one road user from this sample on."""
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, brake, i, ANYWHERE, 0.0) == NEVER:
        return STOP
    return GO if go_plan(scene, throttle(scene, scene.track.s, scene.track.v), i, ANYWHERE, 0.0)[0] >= 0 else 0


@inner
def _is_resolute(scene, a):
    """Where there is no plan, does the ego brake or go on with all it has?"""
    stops = scene.track.v + a * scene.table.dt <= _TOLERANCE
    goes = a >= throttle(scene, scene.track.s, scene.track.v) - _TOLERANCE
    return stops or goes or a <= -scene.table.ego.a_min_brake + _TOLERANCE


@inner
def _leaves_plan(scene, i, a):
    """Does the ego's acceleration leave it a plan toward a road user?"""
    return stop_conflict(scene, a, i, ANYWHERE, 0.0) == NEVER or go_plan(scene, a, i, ANYWHERE, 0.0)[0] >= 0


@apart
def judge_crossing(sample, memory, outside, other, dt):
    """Verdict at the first contact with one road user (Def. 27).

    Args:
      sample: SAMPLE at the sample at which there is contact or it is predicted.
      memory: CROSSING after the one before.
      outside: does it reach beyond what cars sweep on every way it may take?

    Returns:
      `Verdict`.
    """
    _judge_motion(sample, memory, other, dt)
    if outside and memory.other_broke == KEPT:
        memory.other_broke = LEFT_PATHS
    if memory.behind and memory.ego_broke == KEPT:
        if memory.other_broke == KEPT:
            memory.other_broke = TOO_FAR
        return judged(OTHER, memory.items, memory)
    return judged(who_broke(memory, memory.items == 0), memory.items, memory)


@inner
def _ttc(scene):
    """Time to collision with a slower road user ahead on the ego's lane [s]; inf if there is none."""
    ttc, track = np.inf, scene.track
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path >= 0 and threat.v < track.v:
            s = on_path_of_ego(scene.paths, track, track.s, threat, threat.s)
            gap = s - track.s - track.half_length - threat.half_length
            if track.s <= s < np.inf:
                ttc = min(ttc, time_to_collision(gap, track.v - threat.v))
    return ttc


@compiled
def block(paths, track, box, threat):
    """Fill in which cells of the ego's path ahead, and of the lane that it is leaving, an obstacle is in the way of."""
    threat.from_cell, threat.to_cell = _blocked(paths, track.path, track.s, box)
    threat.from_cell_beside, threat.to_cell_beside = NEVER, -1
    if track.beside >= 0:
        threat.from_cell_beside, threat.to_cell_beside = _blocked(paths, track.beside, track.s + track.shift, box)


@compiled
def _blocked(paths, path, s, box):
    """First and last cell of a path from `s` on that overlap an obstacle; `NEVER` and -1 if none does."""
    first, last = NEVER, -1
    for i in range(cell_of(s, paths.cells[path]), paths.cells[path]):
        if boxes_overlap(paths.boxes[path, i], box, 0.0):
            first, last = min(first, i), i
    return first, last
