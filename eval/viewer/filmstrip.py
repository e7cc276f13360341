"""One episode on paper: five moments from above and the margins over time, a strip per trace of the same episode."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from rss_shield.eval.plots import STYLE, save
from rss_shield.eval.viewer.from_above import box_at, draw_from_above
from rss_shield.shield.trace import CHANGED_BY, SIDES, Ego, Trace, stretches

MOMENTS = 5
EGO, PARTNER, OTHERS = "#0072B2", "#D55E00", "#999999"
SIDE_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#E69F00")  # as SIDES
RESPONSE = CHANGED_BY.index("response")
AHEAD = SIDES.index("ahead")
REACH = 45.0  # from the ego to either end of a picture [m]


def key_moments(trace: Trace, ego: Ego) -> list[int]:
    """Five samples in order: contact, smallest margin, start of the longest response, and what lies between."""
    there = np.flatnonzero(trace.users.present[:, ego.user])
    contacts = [
        round(contact.time / trace.dt) for contact in trace.contacts if ego.user in (contact.user, contact.partner)
    ]
    chosen = [min(max(t, int(there[0])), int(there[-1])) for t in contacts[:1]]
    least = margins_of(ego).min(axis=1, initial=np.inf, where=np.isfinite(margins_of(ego)))
    if np.isfinite(least).any():
        chosen.append(int(least.argmin()))
    stretch = longest_response(ego)
    chosen += [stretch[0]] if stretch else []
    chosen = [t for t in dict.fromkeys(chosen) if t in there][:MOMENTS]
    chosen = chosen or [int(there[0])]
    while len(chosen) < min(MOMENTS, len(there)):  # the sample that is farthest from all chosen ones
        chosen.append(int(there[np.abs(there[:, None] - chosen).min(axis=1).argmax()]))
    return sorted(chosen)


def longest_response(ego: Ego) -> tuple[int, int] | None:
    """First sample of the longest stretch on which a proper response changed the command, and the one after it."""
    return max(stretches(ego.changed_by == RESPONSE), key=lambda stretch: stretch[1] - stretch[0], default=None)


def margins_of(ego: Ego) -> np.ndarray:
    """`[T, 4]` gap less required gap, by SIDES [m]; NaN where nobody is."""
    return ego.gap - ego.required


def room_before_area(ego: Ego) -> np.ndarray:
    """`[T]` way left to the first stretch that lies in somebody's way, where roads cross [m]."""
    if not ego.area.shape[1]:
        return np.full(len(ego.path_s), np.nan)
    return np.fmin.reduce(ego.area[:, :, 0], axis=1) - ego.path_s


def draw(traces: Sequence[Trace], labels: Sequence[str], title: str) -> Figure:
    """The figure; every trace has an ego.

    Args:
      traces: of the same episode under different conditions.
      labels: one each.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.4 + 3.4 * len(traces)))
        grid = figure.add_gridspec(2 * len(traces), MOMENTS, height_ratios=[1.0, 1.1] * len(traces))
        latest = max(float(trace.time[-1]) for trace in traces)
        for row, (trace, label) in enumerate(zip(traces, labels, strict=True)):
            ego = trace.egos[0]
            moments = key_moments(trace, ego)
            for k, t in enumerate(moments):
                _from_above(figure.add_subplot(grid[2 * row, k]), trace, ego, t)
            _margins(figure.add_subplot(grid[2 * row + 1, :]), trace, ego, moments, label, latest)
        figure.suptitle(title, fontsize=9)
        return figure


def write_filmstrip(traces: Sequence[Trace], labels: Sequence[str], path: Path, title: str) -> None:
    """Write `path`, whose ending is another, with the endings .png and .pdf."""
    save(draw(traces, labels, title), path.with_suffix(""))


def _from_above(axes: Any, trace: Trace, ego: Ego, t: int) -> None:
    u, me = trace.users, ego.user
    required = ego.required[t, AHEAD]
    if np.isfinite(required) and required > 0.0:
        band = box_at(u.x[t, me], u.y[t, me], u.heading[t, me], required, u.width[me], 0.5 * (u.length[me] + required))
        axes.add_patch(Polygon(band, color=EGO, alpha=0.2, lw=0))
    draw_from_above(axes, trace, t, lambda k: EGO if k == me else PARTNER if k == ego.partner[t] else OTHERS)
    x, y = u.x[t, me], u.y[t, me]
    across = 0.55 * REACH
    axes.set_xlim(x - REACH, x + REACH)
    axes.set_ylim(y + across, y - across)  # y grows to the right of x
    axes.set_title(f"{trace.time[t]:.1f} s{_said(trace, ego, t)}", fontsize=7)


def _said(trace: Trace, ego: Ego, t: int) -> str:
    """What happened at a sample, in a word or two."""
    for contact in trace.contacts:
        if ego.user in (contact.user, contact.partner) and round(contact.time / trace.dt) <= t:
            return f", contact: {contact.verdict}"
    changed = CHANGED_BY[ego.changed_by[t]] if ego.changed_by[t] >= 0 else ""
    return f", {changed}" if changed else ""


def _margins(axes: Any, trace: Trace, ego: Ego, moments: list[int], label: str, latest: float) -> None:
    margins, drawn = margins_of(ego), False
    for k, (side, colour) in enumerate(zip(SIDES, SIDE_COLOURS, strict=True)):
        if np.isfinite(margins[:, k]).any():
            axes.plot(trace.time, margins[:, k], color=colour, lw=1.0, label=f"margin {side}")
            drawn = True
    room = room_before_area(ego)
    if np.isfinite(room).any():
        axes.plot(trace.time, room, color="black", lw=1.0, label="way to the first place in somebody's way")
        drawn = True
    for start, end in stretches(ego.changed_by == RESPONSE):
        axes.axvspan(trace.time[start], trace.time[end - 1] + trace.dt, color=PARTNER, alpha=0.15, lw=0)
    for contact in trace.contacts:
        if ego.user in (contact.user, contact.partner):
            axes.axvline(contact.time, color="black", lw=1.2)
    for t in moments:
        axes.axvline(trace.time[t], color=OTHERS, lw=0.5, ls=":")
    axes.axhline(0.0, color="black", lw=0.5)
    known = np.concatenate([margins[np.isfinite(margins)], room[np.isfinite(room)], [0.0]])
    axes.set_ylim(max(float(known.min()), -20.0) - 2.0, min(float(np.quantile(known, 0.95)), 60.0) + 5.0)
    axes.set_xlim(0.0, latest)
    axes.set_ylabel("[m]", fontsize=8)
    axes.set_title(f"{label}: margins; shaded: proper response; line: contact", loc="left", fontsize=8)
    axes.set_xlabel("time [s]", fontsize=8)
    axes.tick_params(labelsize=7)
    if drawn:
        axes.legend(loc="upper right", ncols=4, fontsize=7)
