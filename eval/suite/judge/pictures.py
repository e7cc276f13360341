"""A judgement as a picture: along the road over time, gap and required gap, duties, and the road from above."""

from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rss_shield.eval.files import atomic
from rss_shield.eval.suite.judge.findings import blame_line, danger_line
from rss_shield.eval.suite.judge.judgement import Judgement
from rss_shield.eval.viewer.from_above import draw_from_above
from rss_shield.shield.trace import stretches

USER, PARTNER, OTHERS, DANGER, BROKEN = "#0072b2", "#e69f00", "#999999", "#f6d5c5", "#c0392b"
_KEY_FRAMES = 5
_LONGEST_LINE = 150  # of a title
_AROUND = 45.0  # of the pair, on the road from above [m]


def chosen_pair(judgement: Judgement) -> tuple[int, int]:
    """Whom a picture is about: the first contact, else the longest danger that was answered wrongly, else the longest.

    Raises:
      ValueError: one user only.
    """
    if judgement.blames:
        blame = judgement.blames[0]
        i = blame.at_fault[0] if blame.at_fault else blame.users[0]
        return i, sum(blame.users) - i
    if judgement.dangers:
        worst = max(judgement.dangers, key=lambda one: (bool(one.duty), one.end - one.start))
        return worst.user, worst.partner
    users = judgement.trace.users
    if len(users.ids) < 2:
        raise ValueError("a log with one road user: expected two for a picture")
    apart = np.hypot(users.x[:, 1:] - users.x[:, :1], users.y[:, 1:] - users.y[:, :1])
    return 0, 1 + int(np.unravel_index(np.nanargmin(apart), apart.shape)[1]) if np.isfinite(apart).any() else 1


def draw(judgement: Judgement, path: Path, pair: tuple[int, int] | None = None) -> None:
    """Draw one pair into a file: .png, .svg or .pdf.

    Args:
      judgement: `Judgement`.
      path: of the picture.
      pair: (user, partner); None = `chosen_pair`.
    """
    i, j = pair or chosen_pair(judgement)
    with matplotlib.rc_context({"font.size": 8, "svg.hashsalt": "rss-shield"}):
        figure = Figure(figsize=(11, 8.5), layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(4, _KEY_FRAMES, height_ratios=(1.3, 1.3, 0.7, 1.2))
        if i in judgement.seen:
            upper = figure.add_subplot(grid[0, :])
            _space_time(upper, judgement, i, j)
            _gaps(figure.add_subplot(grid[1, :], sharex=upper), judgement, i, j)
            _duties(figure.add_subplot(grid[2, :], sharex=upper), judgement, i, j)
        for k, t in enumerate(key_frames(judgement, i, j)):
            _from_above(figure.add_subplot(grid[3, k]), judgement, i, j, t)
        title = [part for line in _title(judgement, i, j) for part in wrap(line, _LONGEST_LINE)]
        figure.suptitle("\n".join(title), fontsize=9)
        with atomic(path) as temporary:
            figure.savefig(temporary, format=path.suffix[1:], dpi=110, metadata=_undated(path.suffix))


def key_frames(judgement: Judgement, i: int, j: int) -> list[int]:
    """Five samples: start, danger begins, a response is due, it is broken, contact; where one lacks, another."""
    trace = judgement.trace
    there = np.flatnonzero(trace.users.present[:, i] & trace.users.present[:, j])
    if not len(there):
        there = np.arange(len(trace.time))
    moments = [trace.time[there[0]]]
    for danger in judgement.dangers:
        if (danger.user, danger.partner) == (i, j):
            moments += [danger.start, danger.brakes_from, danger.stops_from, danger.broken_at, danger.end]
    moments = [blame.time for blame in judgement.blames if set(blame.users) == {i, j}] + moments
    wanted = [int(np.argmin(np.abs(trace.time - m))) for m in moments if not np.isnan(m)]
    chosen = list(dict.fromkeys(t for t in wanted if t in there))[:_KEY_FRAMES]
    while len(chosen) < min(_KEY_FRAMES, len(there)):  # the sample that is farthest from all chosen ones
        chosen.append(int(there[np.abs(there[:, None] - chosen).min(axis=1).argmax()]))
    return sorted(chosen)


def _title(judgement: Judgement, i: int, j: int) -> list[str]:
    lines = [blame_line(judgement, blame) for blame in judgement.blames if set(blame.users) == {i, j}]
    own = [one for one in judgement.dangers if (one.user, one.partner) == (i, j)]
    lines += [danger_line(judgement, one) for one in own[: 3 - len(lines)]]
    return lines or [f"{judgement.trace.users.ids[i]} and {judgement.trace.users.ids[j]}: no danger"]


def _space_time(axes: Any, judgement: Judgement, i: int, j: int) -> None:
    """Everybody's place along the direction in which the user drives at the start, over time."""
    u, time = judgement.trace.users, judgement.trace.time
    start = np.flatnonzero(u.present[:, i])[0]
    cos, sin = np.cos(u.heading[start, i]), np.sin(u.heading[start, i])
    along = (u.x - u.x[start, i]) * cos + (u.y - u.y[start, i]) * sin
    for k in range(len(u.ids)):
        if k not in (i, j):
            axes.plot(time, along[:, k], color=OTHERS, lw=0.6, alpha=0.6)
    for k, colour in ((j, PARTNER), (i, USER)):
        half = 0.5 * u.length[k]
        axes.fill_between(time, along[:, k] - half, along[:, k] + half, color=colour, alpha=0.5, lw=0)
        axes.plot(time, along[:, k], color=colour, lw=1.0, label=u.ids[k])
    pair = along[:, [i, j]]
    if np.isfinite(pair).any():
        axes.set_ylim(np.nanmin(pair) - 20.0, np.nanmax(pair) + 20.0)
    _shade(axes, judgement, i, j)
    axes.set_ylabel("along the road [m]")
    axes.legend(loc="upper left", frameon=False)


def _gaps(axes: Any, judgement: Judgement, i: int, j: int) -> None:
    time, frames = judgement.trace.time, judgement.seen[i].frames[:, j]
    there = frames["present"]
    for name, colour in (("lon", USER), ("lat", PARTNER)):
        gap, required = (np.where(there, frames[f"{what}_{name}"], np.nan) for what in ("gap", "required"))
        label = "along" if name == "lon" else "across"
        axes.plot(time, gap, color=colour, lw=1.2, label=f"gap {label}")
        axes.plot(time, required, color=colour, lw=1.0, ls="--", label=f"required {label}")
    axes.axhline(0.0, color="black", lw=0.5)
    drawn = np.concatenate([frames[f"{what}_{name}"][there] for what in ("gap", "required") for name in ("lon", "lat")])
    drawn = drawn[np.isfinite(drawn)]
    if len(drawn):
        axes.set_ylim(min(float(drawn.min()), -1.0) - 1.0, float(drawn.max()) + 2.0)
    _shade(axes, judgement, i, j)
    axes.set_ylabel("[m]")
    axes.legend(loc="upper right", ncols=4, frameon=False)


def _duties(axes: Any, judgement: Judgement, i: int, j: int) -> None:
    """When each of the two owed what, and when its command broke it."""
    time, dt, ids = judgement.trace.time, judgement.trace.dt, judgement.trace.users.ids
    labels: list[str] = []
    for a, b, colour in ((i, j, USER), (j, i, PARTNER)):
        if a not in judgement.seen:
            continue
        frames = judgement.seen[a].frames[:, b]
        owed = judgement.table.ego if a in judgement.trace.ego_users else judgement.table.other
        late = frames["since"] * dt >= owed.response_time
        for text, on in (("brakes", frames["owes_braking"] & late), ("no approach", frames["owes_stop"] & late)):
            row = len(labels)
            labels.append(f"{ids[a]}: {text}")
            for start, end in stretches(on):
                axes.barh(row, (end - start) * dt, left=time[start], color=colour, alpha=0.5, height=0.6)
            broken = np.flatnonzero(on & (frames["duty"] != 0))
            axes.plot(time[broken], np.full(len(broken), row), ls="", marker="|", color=BROKEN, ms=8)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("time [s]; red: the command broke the duty")


def _shade(axes: Any, judgement: Judgement, i: int, j: int) -> None:
    time = judgement.trace.time
    for start, end in stretches(judgement.seen[i].frames["dangerous"][:, j]):
        axes.axvspan(time[start], time[min(end, len(time) - 1)], color=DANGER, lw=0, zorder=0)
    for blame in judgement.blames:
        if set(blame.users) == {i, j}:
            axes.axvline(blame.time, color=BROKEN, lw=1.2)


def _from_above(axes: Any, judgement: Judgement, i: int, j: int, t: int) -> None:
    trace, u = judgement.trace, judgement.trace.users
    draw_from_above(axes, trace, t, lambda k: USER if k == i else PARTNER if k == j else OTHERS)
    middle = np.nanmean(u.x[t, [i, j]]), np.nanmean(u.y[t, [i, j]])
    apart = np.nan_to_num(np.hypot(*(np.diff(v[t, [i, j]])[0] for v in (u.x, u.y))))
    reach = float(np.clip(0.75 * apart + 8.0, 12.0, _AROUND))
    axes.set_xlim(middle[0] - reach, middle[0] + reach)
    axes.set_ylim(middle[1] + reach, middle[1] - reach)  # y grows to the right of x
    axes.set_title(f"{trace.time[t]:.2f} s, {2 * reach:.0f} m", fontsize=8)


def _undated(suffix: str) -> dict[str, Any]:
    return {"Date": None} if suffix == ".svg" else {}
