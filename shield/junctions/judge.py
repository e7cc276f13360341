"""Who broke a duty at a junction (Def. 27)."""

import numpy as np

from rss_shield.shield._numba.compiled import apart, compiled, inner
from rss_shield.shield.geometry import wrap_angle
from rss_shield.shield.junctions.followers import is_behind
from rss_shield.shield.junctions.plans import NEVER, STOP, look_ahead, meets_braking
from rss_shield.shield.junctions.reach import STANDING
from rss_shield.shield.junctions.toward_one import (
    is_resolute,
    leaves_plan_toward,
    may_meet,
    plans_and_duty,
)
from rss_shield.shield.verdicts import (
    ACCELERATED,
    BRAKED,
    CRASHED,
    CUT_IN,
    GAVE_NO_WAY,
    JUMPED,
    KEPT,
    LEFT_NO_PLAN,
    LEFT_PATHS,
    NOBODY,
    OTHER,
    REVERSED,
    TOO_FAR,
    TOO_HARD,
    TRAPPED,
    WAVERED,
    judged,
    who_broke,
)

_TOLERANCE = 1e-6
_REVERSING = 0.1  # slower than this backwards is standing [m/s]
_JITTER = 0.02  # speeds of others are read off a simulator that integrates in steps [m/s]
_JUMP = 0.1  # likewise their places [m]
_SEEN, _FAINT = (
    1.0,
    1e-6,
)  # shares of these tolerances: what counts at once, and what counts where nothing else does (J14)


@compiled
def judge_user(scene, i, sample, memory, a, strongest, clear):
    """Take in one sample of one road user and judge the ego's acceleration toward it.

    Args:
      scene: `Scene` with the ways of this road user only, see `alone_with`.
      i: index of the road user; sample: its SAMPLE; memory: its CROSSING, changed in place.
      a: acceleration that the ego executes on this frame [m/s^2].
      strongest: what follows if it accelerates as hard as it can, or as hard as that: `Braking`.
      clear: a plan that stays clear of everybody is known to remain afterwards.

    Returns:
      (dangerous, kept, excused): is the ego not free toward this road user, did it keep its duty, and does it do so
      all the same if it is trapped? Then no plan stays clear of everybody, because somebody appeared or left the
      bounds, and duties toward several contradict each other: what is owed is to brake, or to go on, with all it has.
      A contact is judged more strictly: whoever left itself no plan toward the other is to blame, unless somebody's
      breach has trapped it (`note_who_trapped`).
    """
    _judge_motion(sample, memory, scene.table.other, scene.table.dt)
    memory.was_lawless = memory.other_broke != KEPT
    memory.stood = memory.stood + 1 if abs(sample.speed) < STANDING and not sample.alert else 0
    memory.counted_on = memory.counted_on + 1 if _counts_on_standing(scene, i, a) else 0
    may_follow, follows, gap_is_safe = is_behind(scene, i)
    dangerous, kept, items, cut_in = False, True, STOP, False
    followed, memory.behind = memory.behind, may_follow and (memory.behind or gap_is_safe)
    if not follows:
        if may_meet(scene) and meets_braking(scene, strongest, i) != NEVER:
            dangerous = True
            if not clear:
                items, kept = plans_and_duty(scene, i, a)
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
        memory.faint, memory.faint_excess = KEPT, 0.0
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
    excused = not kept and not cut_in and is_resolute(scene, a)
    memory.follows, memory.way = may_follow, scene.track.path
    memory.x, memory.y, memory.heading = sample.x, sample.y, sample.heading
    memory.speed, memory.lanes = sample.speed, sample.next_lanes
    memory.reachable, memory.path, memory.ways = sample.reachable, sample.path, sample.ways
    memory.wreck, memory.astray = sample.wreck, sample.astray
    memory.age += 1
    memory.relied, memory.relied_before = False, memory.relied
    return dangerous, kept, excused


@inner
def _judge_motion(sample, memory, other, dt):
    """Did a road user leave the bounds that plans assume, since the last sample?

    By less than the tolerances it may do so for long, and get far: that counts where nothing else explains a contact
    (J14).
    """
    if memory.age == 0:
        return
    duty, excess = _broken(sample, memory, other, dt, _FAINT)
    if duty == KEPT:
        return
    if memory.faint == KEPT:
        memory.faint, memory.faint_excess = duty, excess
    if memory.other_broke == KEPT:
        memory.other_broke, memory.other_excess = _broken(sample, memory, other, dt, _SEEN)


@inner
def _broken(sample, memory, other, dt, share):
    """(duty, excess) that a road user has broken since the last sample, with a share of the tolerances."""
    faster = sample.speed - max(memory.speed, min(memory.speed + other.a_max_accel * dt, other.v_cap))
    slower = memory.speed - other.a_max_brake * dt - sample.speed
    jumped = _jump(sample, memory, dt)
    if sample.wreck and (not memory.wreck or np.hypot(sample.x - memory.x, sample.y - memory.y) > _JITTER * dt):
        return CRASHED, 0.0
    if jumped > share * _JUMP and not sample.wreck:
        return JUMPED, jumped
    if _leaves_paths(sample, memory, share * STANDING):
        return LEFT_PATHS, 0.0
    if faster > share * _JITTER and not sample.wreck:
        return ACCELERATED, faster / dt
    if slower > share * _JITTER and not sample.wreck:
        return BRAKED, slower / dt
    if sample.speed < -share * _REVERSING:
        return REVERSED, -sample.speed
    if memory.relied_before or (memory.counted_on > 0 and abs(sample.speed) >= STANDING):
        return GAVE_NO_WAY, 0.0  # forgotten by `judge_user` if the ego still has a plan
    return KEPT, 0.0


@inner
def _jump(sample, memory, dt):
    """How much farther than its wheels took it a road user has moved, or has turned its ends, in a frame [m]."""
    way = max(abs(sample.speed), abs(memory.speed)) * dt
    dx, dy, turned = sample.x - memory.x, sample.y - memory.y, 0.0
    if sample.heading != memory.heading:
        turned = abs(wrap_angle(sample.heading - memory.heading)) * sample.half_length
    return max(np.sqrt(dx * dx + dy * dy), turned) - way


@inner
def _leaves_paths(sample, memory, standing):
    """Has a road user gone where none of its ways leads? Who is off all of them is expected to stand, or to come back.

    So whoever drives on there has left them anew on every sample, also one that has never been on any (J12).
    `standing`: slower than this is standing [m/s].
    """
    off = sample.astray and not (memory.astray and abs(sample.speed) < standing)
    return off or sample.strays or sample.lanes & ~memory.lanes != 0


@apart
def _counts_on_standing(scene, i, a):
    """Has the ego no plan after its acceleration, but one that counts on a road user to stand?"""
    stands_for = scene.threats[0].stands_for if len(scene.threats) > 0 else 0.0  # the same on all its ways
    if stands_for == 0.0:
        return False
    _count_on(scene, 0.0)
    counts = not leaves_plan_toward(scene, i, a)
    _count_on(scene, stands_for)
    return counts


@inner
def _count_on(scene, stands_for):
    for k in range(len(scene.threats)):
        scene.threats[k].stands_for = stands_for
        look_ahead(scene, scene.threats[k])


@inner
def asks_who_trapped(plan, memory):
    """Does it matter whether the ego is trapped, because somebody has broken a duty?"""
    asks = plan.wronged
    for i in range(len(memory)):
        asks |= memory[i].was_lawless
    return asks


@inner
def note_who_trapped(plan, memory, trapped, resolute):
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
    verdict = who_broke(memory, memory.items == 0)
    if verdict == NOBODY and memory.faint != KEPT:
        memory.other_broke, memory.other_excess = memory.faint, memory.faint_excess
        verdict = OTHER
    return judged(verdict, memory.items, memory)
