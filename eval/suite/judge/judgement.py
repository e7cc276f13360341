"""What a log amounts to: who was in danger with whom, who owed what and broke it, and who is to blame for contacts."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rss_shield.eval.suite.judge.directions import directions, roads_of
from rss_shield.eval.suite.judge.lanes import Seen, see_all, table_of
from rss_shield.eval.suite.judge.plans import see_junction
from rss_shield.eval.suite.judge.smoothing import EXACT, SURE, Noise, filled_in
from rss_shield.shield.definitions.response import AXES, LAT, LON
from rss_shield.shield.params import Preset, Rules, Table
from rss_shield.shield.trace import Trace, stretches
from rss_shield.shield.verdicts import DUTIES, KEPT, VERDICTS, weight_of


class Danger(NamedTuple):
    """A stretch of time in which one user owed another a response."""

    user: int  # who owes
    partner: int
    start: float  # first dangerous sample [s]
    end: float  # first one after it that is safe, or the end of what is judged [s]
    axis: str  # that was safe last: "longitudinal", "lateral", "both", or "inherited"
    role: str  # of the user at the start: "rear", "front", "head-on"
    brakes_from: float  # from when on it had to brake, NaN = it had not [s]
    stops_from: float  # from when on it had to have stopped moving toward the other across the lane, NaN = had not [s]
    duty: str  # that it broke first, "" = none
    excess: float  # by how much, in the unit that the duty says
    broken_at: float  # when, NaN = never [s]
    is_sure: bool  # neither noise nor the direction of a road that is not known makes it broken, or kept


class Blame(NamedTuple):
    """A contact of two users, and whose fault it was."""

    time: float  # [s]
    users: tuple[int, int]
    at_fault: tuple[int, ...]  # users who broke a duty; empty = see `verdict`
    verdict: str  # "first", "second", "both", "inherited", "none"
    views: dict[int, dict[str, Any]]  # by user: what its own view says, as a shield's `blame_evidence`
    is_sure: bool  # the same without what noise explains, and on every road that the log may have been on


@dataclass(frozen=True)
class Judgement:
    """All pairs of a log, judged relative to one table."""

    trace: Trace  # with accelerations filled in
    table: Table
    seen: dict[int, Seen]  # on common roads, by the user whose view it is
    dangers: tuple[Danger, ...]
    blames: tuple[Blame, ...]
    noise: Noise
    notes: tuple[str, ...] = field(default=())  # what could not be judged, and why

    def verdict_of(self, user: int) -> str:
        """What a shield on this user would say of its first contact; "" = it had none."""
        said = [str(blame.views[user]["verdict"]) for blame in self.blames if user in blame.views]
        return max(said, key=lambda verdict: weight_of(VERDICTS.index(verdict)), default="")


def judge_trace(
    trace: Trace, params: str | Preset | None = None, rules: Rules | None = None, users: list[int] | None = None
) -> Judgement:
    """Judge every pair of road users of a log.

    Nothing that a shield believed is used: positions, sizes, speeds, lanes and what the wheels did are read, and routes
    where they were announced. Accelerations that the log does not have are estimated (`smoothing`).

    Args:
      trace: `Trace`.
      params: name of a preset or `Preset`; None = that of the trace's own shield, or "slides".
      rules: None = likewise, or the default ones.
      users: from whose views; None = everybody's.

    Raises:
      ValueError: no such preset, or nothing is marked where the log is from: lanes and plans say nothing there.
    """
    if trace.meta.get("scheme") == "open space":
        raise ValueError(
            "trace.meta.scheme = 'open space': expected 'lanes' or 'plans'; the shield itself judged there"
        )
    trace, noise = filled_in(trace)
    table = table_of(trace, params, rules)
    chosen = list(range(len(trace.users.ids))) if users is None else users
    if trace.meta.get("scheme") == "plans":
        views, notes = see_junction(trace, table, users)
        return Judgement(trace, table, {}, (), _joined(trace, views, views), noise, notes)
    sights = [_sight(road, table, chosen, noise) for road in roads_of(trace)]
    dangers = [one for i in chosen for one in _dangers(trace, table, i, sights)]
    blames, *elsewhere = [
        _joined(trace, *({(i, j): view for i in chosen for j, view in _views(trace, one[i]).items()} for one in sight))
        for sight in sights
    ]
    return Judgement(
        trace,
        table,
        sights[0].seen,
        tuple(sorted(dangers, key=lambda one: (one.start, one.user, one.partner))),
        _doubted(blames, elsewhere),
        noise,
        _notes(trace, noise),
    )


class _Sight(NamedTuple):
    """What users see on one road, by the user."""

    seen: dict[int, Seen]
    sure: dict[int, Seen]  # what noise explains counts as kept


def _sight(trace: Trace, table: Table, users: list[int], noise: Noise) -> _Sight:
    seen = see_all(trace, table, users)
    return _Sight(seen, seen if noise == EXACT else see_all(trace, table, users, noise))


def _dangers(trace: Trace, table: Table, i: int, sights: list[_Sight]) -> list[Danger]:
    """Stretches of danger of one user. Of duties those count that were surely broken, or else those that seem to be.

    They are those on the first road; on the others the same must be broken, or kept, for it to be sure.
    """
    own = table.ego if i in trace.ego_users else table.other
    seen, found = sights[0].seen[i], []
    for j in np.flatnonzero(seen.frames["dangerous"].any(axis=0)):
        frames = seen.frames[:, j]
        for start, end in stretches(frames["dangerous"]):
            part, surely = frames[start:end], [one.sure[i].frames[start:end, j] for one in sights]
            is_broken = [bool((frames["ego_broke"] != KEPT).any()) for frames in surely]
            judged = surely[0] if is_broken[0] else part
            broken = np.flatnonzero(judged["ego_broke"] != KEPT)
            duty = int(judged["ego_broke"][broken[0]]) if len(broken) else KEPT
            excess = float(judged["ego_excess"][judged["ego_broke"] == duty].max()) if len(broken) else 0.0
            brakes, stops = part["owes_braking"].any(), part["owes_stop"].any()
            first = trace.time[start] - trace.dt * part["since"][0]  # the threshold
            found.append(
                Danger(
                    i,
                    int(j),
                    float(trace.time[start]),
                    float(trace.time[min(end, len(trace.time) - 1)]),
                    _axis(int(part["axes"][0])),
                    "head-on" if part["opposite"][0] else "rear" if part["ego_is_rear"][0] else "front",
                    float(first + own.response_time) if brakes else np.nan,
                    float(first + own.response_time) if stops else np.nan,
                    DUTIES[duty],
                    excess,
                    float(trace.time[start + broken[0]]) if len(broken) else np.nan,
                    not any(is_broken) if duty == KEPT else all(is_broken),
                )
            )
    return found


def _axis(axes: int) -> str:
    return AXES[axes & (LON | LAT)]


def _views(trace: Trace, seen: Seen) -> dict[int, dict[str, Any]]:
    """Contacts from one view, by the other, as a shield writes them."""
    found = {}
    for j in np.flatnonzero(seen.verdicts["frame"] >= 0):
        said = seen.verdicts[j]
        found[int(j)] = {
            "frame": int(said["frame"]),
            "verdict": VERDICTS[said["verdict"]],
            "danger": _axis(int(said["kind"])),
            "seconds_since_threshold": float(said["frames"] * trace.dt),
            "ego_duty": DUTIES[said["ego_duty"]],
            "ego_excess": float(said["ego_excess"]),
            "other_duty": DUTIES[said["other_duty"]],
            "other_excess": float(said["other_excess"]),
        }
    return found


Views = dict[tuple[int, int], dict[str, Any]]  # contacts by (user, partner), from the view of the user


def _joined(trace: Trace, seen: Views, sure: Views) -> tuple[Blame, ...]:
    """The two views of every contact as one; what is surely broken counts, or else what seems to be."""
    blames = []
    for i, j in sorted({(min(pair), max(pair)) for pair in seen}):
        both = ((i, j), (j, i))
        is_sure = [seen.get(pair) for pair in both] == [sure.get(pair) for pair in both] or bool(_at_fault(sure, i, j))
        views = sure if is_sure else seen
        at_fault = _at_fault(views, i, j)
        sides = {a: views[a, b] for a, b in both if (a, b) in views}
        if len(at_fault) == 2:
            verdict = "both"
        elif at_fault:
            verdict = "first" if i in at_fault else "second"
        else:
            verdict = "inherited" if "inherited" in {side["verdict"] for side in sides.values()} else "none"
        frame = min(side["frame"] for side in sides.values())
        blames.append(Blame(float(trace.time[frame]), (i, j), tuple(sorted(at_fault)), verdict, sides, is_sure))
    return tuple(sorted(blames, key=lambda blame: blame.time))


def _doubted(blames: tuple[Blame, ...], elsewhere: list[tuple[Blame, ...]]) -> tuple[Blame, ...]:
    """Contacts with those only left sure that are surely the same on every other road that the log may have been on."""
    for others in elsewhere:
        same = {(one.users, one.at_fault, one.verdict) for one in others if one.is_sure}
        blames = tuple(
            one._replace(is_sure=one.is_sure and (one.users, one.at_fault, one.verdict) in same) for one in blames
        )
    return blames


def _at_fault(views: Views, i: int, j: int) -> set[int]:
    """Who broke a duty is known best from the own view, commands included; else by the view of the other."""
    found = {a for a, b in ((i, j), (j, i)) if (a, b) in views and views[a, b]["ego_duty"]}
    found |= {b for a, b in ((i, j), (j, i)) if (b, a) not in views and (a, b) in views and views[a, b]["other_duty"]}
    if not found:
        found = {b for a, b in ((i, j), (j, i)) if (a, b) in views and views[a, b]["verdict"] == "other"}
    return found


def _notes(trace: Trace, noise: Noise) -> tuple[str, ...]:
    notes = []
    if noise.acceleration > 0.0:
        notes.append(
            f"accelerations are estimated, within {noise.acceleration:.2f} m/s^2 (one standard deviation): a duty that "
            f"was broken by less than {SURE:g} of these is marked as not sure"
        )
    unlike = sorted(set(trace.users.kinds) & {"pedestrian", "bicycle"})
    if unlike:
        notes.append(f"there is a {' and a '.join(unlike)}: judged by the rules for cars, of which not all fit")
    if trace.meta.get("conditions") or trace.meta.get("classes"):
        notes.append(
            "parameters changed with the road or the kind of vehicle: all are judged by one table, that of the ego "
            "where the log ends and that of cars"
        )
    if not trace.lanes:
        best, *others = directions(trace)
        doubt = np.degrees(max((abs(one - best) for one in others), default=0.0))
        off = f", within {doubt:.1f} degrees: what depends on it is marked as not sure" if others else ""
        notes.append(
            "the log has no lanes: everybody is taken to drive along one straight road, whose direction is estimated "
            f"from headings{off}; lanes of a CSV file are given by --lanes FILE, or along x by --lanes-at Y,..."
        )
    return tuple(notes)
