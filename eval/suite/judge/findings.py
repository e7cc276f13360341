"""A judgement as text, as JSON and as a table of pair-frames."""

from typing import Any

import numpy as np
import pandas as pd

from rss_shield.eval.suite.judge.judgement import Blame, Danger, Judgement
from rss_shield.shield.definitions.response import AXES
from rss_shield.shield.verdicts import DUTIES

_FEW = 12  # stretches of danger that are all told


def text_of(judgement: Judgement, name: str = "") -> str:
    """What is to be said, for people."""
    trace = judgement.trace
    lines = [
        f"{name or 'log'}: {len(trace.users.ids)} road users, {len(trace.time)} samples of {trace.dt:g} s",
        f"judged by: ego {_params(judgement.table.ego)}; others {_params(judgement.table.other)}",
    ]
    lines += [f"note: {note}" for note in judgement.notes]
    told = [danger for danger in judgement.dangers if _matters(judgement, danger)]
    lines += [danger_line(judgement, danger) for danger in told]
    rest = [danger for danger in judgement.dangers if danger not in told]
    if rest:
        broken = sum(bool(danger.duty) for danger in rest)
        lines.append(f"and {len(rest)} more stretches of danger between others, {broken} with a broken duty")
    if judgement.seen and not judgement.dangers:
        lines.append("nobody was in danger")
    for blame in judgement.blames:
        lines.append(blame_line(judgement, blame))
    if not judgement.blames:
        lines.append("no contact")
    return "\n".join(lines)


def _matters(judgement: Judgement, danger: Danger) -> bool:
    """Is a danger told in full? All of few; else those of egos, and of those who touch."""
    if len(judgement.dangers) <= _FEW:
        return True
    egos = judgement.trace.ego_users
    touching = any({danger.user, danger.partner} == set(blame.users) for blame in judgement.blames)
    return danger.user in egos or touching


def danger_line(judgement: Judgement, danger: Danger) -> str:
    """One stretch of danger in one line."""
    ids = judgement.trace.users.ids
    line = f"{danger.start:.2f} to {danger.end:.2f} s: {ids[danger.user]} in danger with {ids[danger.partner]}"
    line += f" ({danger.axis}, {danger.role})"
    if danger.brakes_from < danger.end:
        line += f", owed braking from {danger.brakes_from:.2f} s"
    if danger.stops_from < danger.end:
        line += f", owed no approach from {danger.stops_from:.2f} s"
    sure = "" if danger.is_sure else ", not sure"
    if danger.duty:
        return f"{line}: {danger.duty} by {danger.excess:.2f} from {danger.broken_at:.2f} s{sure}"
    return f"{line}: kept its duty{sure}"


def blame_line(judgement: Judgement, blame: Blame) -> str:
    """One contact in one line."""
    ids = judgement.trace.users.ids
    first, second = (ids[i] for i in blame.users)
    whose = " and ".join(ids[i] for i in blame.at_fault) or {"inherited": "nobody: danger from the start"}.get(
        blame.verdict, "nobody"
    )
    line = f"{blame.time:.2f} s: contact of {first} and {second}, at fault: {whose}"
    for user, view in blame.views.items():
        if view["ego_duty"]:
            line += f"; {ids[user]} {view['ego_duty']} by {view['ego_excess']:.2f}"
    return line + ("" if blame.is_sure else " (not sure)")


def _params(params: Any) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in params._asdict().items())


def json_of(judgement: Judgement, name: str = "") -> dict[str, Any]:
    """Everything but the pair-frames, as JSON."""
    trace = judgement.trace
    ids = trace.users.ids
    return {
        "log": name,
        "users": list(ids),
        "samples": len(trace.time),
        "dt": trace.dt,
        "table": {
            "ego": judgement.table.ego._asdict(),
            "other": judgement.table.other._asdict(),
            "rules": judgement.table.rules._asdict(),
        },
        "noise": judgement.noise._asdict(),
        "notes": list(judgement.notes),
        "dangers": [
            danger._asdict() | {"user": ids[danger.user], "partner": ids[danger.partner]}
            for danger in judgement.dangers
        ],
        "contacts": [
            {
                "time": blame.time,
                "users": [ids[i] for i in blame.users],
                "at_fault": [ids[i] for i in blame.at_fault],
                "verdict": blame.verdict,
                "is_sure": blame.is_sure,
                "views": {ids[i]: view for i, view in blame.views.items()},
            }
            for blame in judgement.blames
        ],
    }


def pair_frames(judgement: Judgement, dangerous_only: bool = False) -> pd.DataFrame:
    """One row per ordered pair and sample: gaps, required gaps, what is owed and what was broken."""
    trace, parts = judgement.trace, []
    ids = np.array(trace.users.ids)
    for i, seen in judgement.seen.items():
        chosen = seen.frames["dangerous" if dangerous_only else "present"]
        t, j = np.nonzero(chosen)
        frames = seen.frames[t, j]
        columns: dict[str, Any] = {"time": trace.time[t], "user": ids[i], "partner": ids[j]}
        for name in ("dangerous", "gap_lon", "required_lon", "gap_lat", "required_lat", "v_ego", "v_other"):
            columns[name] = frames[name]
        columns["safe_last"] = [AXES[int(axes)] if axes else "neither" for axes in frames["axes"]]
        columns["since"] = frames["since"] * trace.dt
        columns["ahead"] = frames["ego_is_rear"]
        for name in ("owes_braking", "owes_stop"):
            columns[name] = frames[name]
        columns["duty"] = [DUTIES[k] for k in frames["duty"]]
        columns["excess"] = frames["excess"]
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
