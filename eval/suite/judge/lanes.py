"""Every pair of a log on common roads, judged by the shield's own rules, from the view of either."""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.roads.slip import slip_of
from rss_shield.eval.suite.judge.contacts import near_pairs, touches
from rss_shield.eval.suite.judge.smoothing import EXACT, SURE, Noise, sigma_of
from rss_shield.eval.suite.judge.world import World, views
from rss_shield.shield.lanes.trial import PAIR_FRAME, VERDICT, try_pairs
from rss_shield.shield.params import PRESETS, Preset, RSSParams, Rules, Table
from rss_shield.shield.sampling import frames_for
from rss_shield.shield.trace import Trace
from rss_shield.shield.verdicts import DUTIES

RULES = Rules()
REAL_RULES = Rules(discretisation_margin=False, overlap_margin=0.0)  # cars that move as cars do need no such margins


class Seen(NamedTuple):
    """All pairs from the view of one user. T samples, N users."""

    frames: np.ndarray  # `[T, N]` PAIR_FRAME; nothing is said of the user itself, nor after its first contact
    verdicts: np.ndarray  # `[N]` VERDICT


def table_of(trace: Trace, params: str | Preset | None = None, rules: Rules | None = None) -> Table:
    """The table to judge a trace by: that of its own shield where it has one, or "slides".

    Args:
      trace: `Trace`.
      params: name of a preset, or a `Preset`; None = the trace's own.
      rules: None = the trace's own, or the default ones.

    Raises:
      ValueError: no such preset.
    """
    own = trace.meta.get("judge_params") if params is None else None
    if own is not None:
        ego, other = (RSSParams(**{k: float(v) for k, v in own[name].items()}) for name in ("ego", "other"))
    else:
        if isinstance(params, str) and params not in PRESETS:
            raise ValueError(f"params = {params!r}: expected one of {', '.join(PRESETS)}")
        preset = PRESETS[params or "slides"] if not isinstance(params, Preset) else params
        ego, other = preset.ego, preset.other
    if rules is None:
        rules = Rules(**trace.meta["judge_rules"]) if own is not None else RULES if is_simulated(trace) else REAL_RULES
    return Table(whole_frames(ego, trace.dt), whole_frames(other, trace.dt), rules, trace.dt)


def is_simulated(trace: Trace) -> bool:
    """Did a simulator move everybody by explicit Euler, from one sample to the next?"""
    return trace.meta.get("integration") == "euler"


def whole_frames(params: RSSParams, dt: float) -> RSSParams:
    """Parameters whose response time is rounded up to whole frames, one at least (condition C2)."""
    return params._replace(response_time=float(frames_for(max(params.response_time, dt), dt) * dt))


def slips(trace: Trace) -> np.ndarray:
    """`[T, N]` angle between heading and motion during each frame [rad], NaN = not known.

    By the wheels where the log has them, else by where everybody is one sample later. Who hardly moves has none.
    """
    u = trace.users
    slip = slip_of(u.steering)
    dx, dy = np.diff(u.x, axis=0), np.diff(u.y, axis=0)
    course = np.where(u.speed[:-1] >= 0.0, np.arctan2(dy, dx), np.arctan2(-dy, -dx))
    moved = (course - u.heading[:-1] + np.pi) % (2.0 * np.pi) - np.pi
    moved = np.where(np.hypot(dx, dy) > 0.01, moved, 0.0)
    unknown = np.isnan(slip[:-1])
    slip[:-1][unknown] = moved[unknown]
    return slip


def tolerances_of(noise: Noise) -> np.ndarray:
    """By how much each of DUTIES may seem to be broken because of noise, in its unit."""
    return np.array([SURE * sigma_of(duty, noise) for duty in range(len(DUTIES))])


def see_all(trace: Trace, table: Table, users: list[int] | None = None, noise: Noise = EXACT) -> dict[int, Seen]:
    """What each user sees of all others, judged.

    Args:
      trace: `Trace` with accelerations.
      table: `Table`; `ego` is that of the trace's egos, `other` that of everybody else.
      users: whose views; None = everybody's.
      noise: of the log: what it explains counts as kept.
    """
    tolerances = tolerances_of(noise)
    world, slip = World(trace), slips(trace)
    step = trace.dt if is_simulated(trace) else 0.0
    count, egos = len(trace.users.ids), set(trace.ego_users)
    touching: dict[tuple[int, int], np.ndarray] = {}
    for i, j in near_pairs(trace):
        hit = touches(trace, i, j)
        if hit.any():
            touching[i, j] = touching[j, i] = hit
    seen = {}
    for i in range(count) if users is None else users:
        frames, verdicts = np.zeros((len(trace.time), count), PAIR_FRAME), np.zeros(count, VERDICT)
        verdicts["frame"] = -1
        own = table.ego if i in egos else table.other
        hits = np.zeros((len(trace.time), count), bool)
        for j in range(count):
            if (i, j) in touching:
                hits[:, j] = touching[i, j]
        over = False
        for view in views(world, i, table, slip):
            if over:
                break
            start, others, log = view
            window = slice(start, start + len(log.ego))
            hit = hits[window][:, others]
            found, said = np.zeros((len(log.ego), count - 1), PAIR_FRAME), np.zeros(count - 1, VERDICT)
            said["frame"] = -1
            for params, who in (
                (table.ego, [k for k, j in enumerate(others) if j in egos]),
                (table.other, [k for k, j in enumerate(others) if j not in egos]),
            ):
                if who:
                    toward = table._replace(ego=own, other=params)
                    try_pairs(log, hit, np.array(who), toward, step, tolerances, found, said)
            frames[window][:, others] = found
            said["frame"][said["frame"] >= 0] += start
            verdicts[others] = said
            over = bool((said["frame"] >= 0).any())
        seen[i] = Seen(frames, verdicts)
    return seen
