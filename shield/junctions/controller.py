"""One frame of the shield at a junction: keep a plan that stays clear of everybody (Defs. 17, 18, 27).

Whatever the agent wants, it may do as long as a plan remains afterwards that meets nobody. If none
would remain, the plan that was found before is carried out: it stays clear because everybody keeps to
the bounds it was made for. That is the proper response of Def. 18: stop where stopping was safe, go on
where only going on was. With anticipation, the ego does so smoothly (`shield.junctions.easing`): of what leaves a
plan to stop, it takes the most instead of the hardest braking, and it eases off before that.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.junctions.choice import choose, ease, is_trapped, least_harm
from rss_shield.shield.junctions.examined import TABLE, count_examined, examine, is_left_out
from rss_shield.shield.junctions.followers import find_those_behind, is_behind, sort_out
from rss_shield.shield.junctions.judge import asks_who_trapped, judge_user, note_who_trapped
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import (
    EVERYBODY,
    NEVER,
    SLACK,
    braking_after,
    go_plan,
    on_path_of_ego,
    stop_conflict,
    throttle,
)
from rss_shield.shield.junctions.toward_one import is_resolute, next_alone
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE, RESPONSE_GO


class JunctionReport(NamedTuple):
    """What the shield saw and did on one frame."""

    acceleration: float  # what it lets through [m/s^2]
    overridden: bool  # somebody's presence changed it
    anticipated: bool  # anticipation did, though what was asked for would have left a plan
    limited: bool  # only the limits of acceleration did
    response: int  # RESPONSE_BRAKE or RESPONSE_GO where it was overridden, else 0
    pairs: int  # road users toward whom the ego is not free
    broken: int  # those toward whom it broke its duty
    trapped: bool  # no plan stays clear of everybody; who watches looks only where that matters to a verdict
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
            a, clear, anticipated = ease(scene, plan, memory, limited, at_line, rate)
        if not clear:
            a, clear, trapped = choose(scene, plan, limited, at_line, holds or rate > 0.0)
        if trapped:
            a = least_harm(scene, a, len(samples))
        plan.held_at = a if a < limited else np.inf
    pairs = broken = excused = at = 0
    hardest = limit(scene.table.ego.a_max_accel, scene.track.v, scene.table.ego, scene.table.dt)
    strongest = braking_after(scene, max(hardest, a))
    for i in range(len(samples)):
        known = clear and (which <= TABLE or not is_left_out(scene, i))
        alone, at = next_alone(scene, i, at)
        dangerous, kept, resolute = judge_user(alone, i, samples[i], memory[i], a, strongest, known)
        pairs += dangerous
        broken += not kept
        excused += resolute
    if not overrides and (excused > 0 or asks_who_trapped(plan, memory)):  # who watches need not know it else
        trapped = is_trapped(scene)
    if trapped:
        broken -= excused
    note_who_trapped(plan, memory, trapped, trapped and is_resolute(scene, a))
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


@apart
def has_plan(scene, memory, entry, at_line):
    """Would braking now, or going on, stay clear of everybody? Asked before a lane change.

    Nobody may find the ego closer ahead than a follower's safe distance who did not follow it before.
    """
    find_those_behind(scene, memory)
    for i in range(len(memory)):
        _, follows, gap_is_safe = is_behind(scene, i)
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
