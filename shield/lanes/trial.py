"""A whole log tried at once: every sample of every pair of one road user, and the verdict of its first contact.

The samples go in order through `assess`, `remember`, `judge_motion_in` and `audit_command`, as while a shield drives,
so that who judges a log afterwards and who judged on the spot say the same.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled_for_arrays, inner, records
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.closed_roads import go_around, keep_place
from rss_shield.shield.lanes.judge import NEXT_FRAME, NOW, audit_command, blame_ego, judge_motion_in, sum_up
from rss_shield.shield.lanes.memory import (
    MEMORY,
    catch_up,
    forget_safe,
    owes_braking,
    owes_lateral_stop,
    owes_no_approach,
    remember,
)
from rss_shield.shield.lanes.pair import assess
from rss_shield.shield.verdicts import KEPT

# One pair on one sample, from the view of the first of the two.
PAIR_FRAME = records(
    [
        ("present", "?"),
        ("dangerous", "?"),
        ("axes", "i8"),  # safe at the threshold: LON | LAT, NEITHER = inherited; while it is safe: safe now
        ("since", "i8"),  # frames since the threshold, 0 = safe now
        ("ego_is_rear", "?"),
        ("opposite", "?"),
        ("gap_lon", "f8"),  # [m]
        ("gap_lat", "f8"),
        ("required_lon", "f8"),  # by Defs. 1, 2 [m]
        ("required_lat", "f8"),  # by Def. 6
        ("v_ego", "f8"),  # along the lane, as the distance assumes it [m/s]
        ("v_other", "f8"),
        ("owes_braking", "?"),  # after its response time
        ("owes_stop", "?"),  # moving toward the other across the lane
        ("duty", "i8"),  # that its command breaks on this frame, index into DUTIES, 0 = kept
        ("excess", "f8"),  # by how much
        ("ego_broke", "i8"),  # first duty broken since the threshold, by command or by way driven
        ("ego_excess", "f8"),
        ("other_broke", "i8"),
        ("other_excess", "f8"),
    ]
)

# The verdict of a contact; see `Verdict`.
VERDICT = records(
    [
        ("frame", "i8"),  # sample at which it was reached, -1 = no contact
        ("verdict", "i8"),
        ("kind", "i8"),
        ("frames", "i8"),
        ("ego_duty", "i8"),
        ("ego_excess", "f8"),
        ("other_duty", "i8"),
        ("other_excess", "f8"),
    ]
)


@compiled_for_arrays
def try_pairs(log, touches, who, table, step, tolerances, found, verdicts):
    """Judge one road user against some others, sample by sample, up to its first contact.

    Args:
      log: `Log` with N others; on closed roads their places are changed (`go_around`).
      touches: `[T, N]` bool: they touch, or it is predicted for the next sample.
      who: `[K]` indices of the others that have these parameters.
      table: `Table` in force toward them.
      step: of explicit Euler, 0 where cars move as cars do, see `judge_motion_in` [s].
      tolerances: `[D]` by how much each of DUTIES may be broken before it counts, in its unit.
      found: `[T, N]` PAIR_FRAME, filled in for those.
      verdicts: `[N]` VERDICT, likewise.
    """
    rules, dt = table.rules, table.dt
    memory, gap = np.zeros(len(who), MEMORY), np.zeros(len(who))  # from the ego to each on the last sample [m]
    unknown = np.zeros(1, MEMORY)
    for t in range(len(log.ego)):
        ego = log.ego[t]
        command = Command(log.acceleration[t], log.slip[t])
        drift = 0.5 * log.curvature[t] * ego.speed**2 * dt
        ends = touches[t].any()
        for k in range(len(who)):
            i = who[k]
            if not log.present[t, i]:
                memory[k] = unknown[0]
                continue
            known, user, cell = memory[k], log.users[t, i], found[t, i]
            before = log.users_before[t, i]
            if log.jumped[t, i]:
                forget_safe(known)
            if known.age > 0 or known.skipped:
                keep_place(log.ego_before[t], before, gap[k])
            go_around(ego, user, log.ego_before[t], before, known, table)
            gap[k] = user.s - ego.s
            catch_up(known, log.ego_before[t], before, table)
            if ends and not touches[t, i]:
                continue
            pair = assess(ego, user, table)
            remember(known, pair, ego, user, dt)
            if known.since > 0:
                judge_motion_in(known, ego, user, table, NOW, 0.0, step, tolerances)
            if ends:
                if known.since > 0:
                    slack = rules.overlap_margin
                    judge_motion_in(known, ego, user, table, NEXT_FRAME, slack, step, tolerances)
                _write(sum_up(known), t, verdicts[i])
                continue
            cell.duty, cell.excess = KEPT, 0.0
            if known.since > 0 and not np.isnan(log.acceleration[t]):
                cell.duty, cell.excess = audit_command(known, ego, command, drift, table.ego, dt, tolerances)
                blame_ego(known, cell.duty, cell.excess, tolerances)
            cell.present, cell.dangerous = True, known.since > 0
            cell.axes, cell.since = known.axes, known.since
            cell.ego_is_rear, cell.opposite = pair.ego_is_rear, pair.opposite
            cell.gap_lon, cell.gap_lat = pair.gap_lon, pair.gap_lat
            cell.required_lon, cell.required_lat = pair.gap_lon - pair.margin_lon, pair.gap_lat - pair.margin_lat
            cell.v_ego, cell.v_other = pair.v_ego, pair.v_other
            cell.owes_braking = owes_braking(known, rules) > 0
            cell.owes_stop = owes_lateral_stop(known, rules) or owes_no_approach(known, rules)
            cell.ego_broke, cell.ego_excess = known.ego_broke, known.ego_excess
            cell.other_broke, cell.other_excess = known.other_broke, known.other_excess
        if ends:
            break


@inner
def _write(verdict, t, out):
    out.frame, out.verdict, out.kind, out.frames = t, verdict.verdict, verdict.kind, verdict.frames
    out.ego_duty, out.ego_excess = verdict.ego_duty, verdict.ego_excess
    out.other_duty, out.other_excess = verdict.other_duty, verdict.other_excess
