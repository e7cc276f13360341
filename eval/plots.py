"""The two figures of a run: learning curves, and who was to blame. PNG and PDF, fit for a paper."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from rss_shield.eval.arms import ARMS, arm_named
from rss_shield.eval.files import atomic
from rss_shield.eval.stats import Interval, completion_weights, weighted_mean, weighted_rate, wilson
from rss_shield.shield.verdicts import AT_FAULT, BLAMES

# Okabe & Ito's colours, told apart with every common colour blindness
BLAME_COLOURS = {
    "ego": "#D55E00",
    "both": "#E69F00",
    "other": "#56B4E9",
    "inherited": "#BBBBBB",
    "none": "#000000",
}
STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "pdf.fonttype": 42,  # text stays text
    "savefig.dpi": 200,
}
MANY = 4  # cells whose bars have room for names below them
BINS = 10  # points of a learning curve, at most
UNFINISHED = 0.05  # a point is drawn where at most this share of the episodes has an unknown end


def label_over_training(axes: Axes, name: str, share: bool) -> None:
    """Title and scales of a panel over training timesteps; a share is drawn from 0 to 100 %."""
    axes.set_title(name, loc="left")
    if share:
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_ylim(-0.03, 1.03)
    place = axes.get_subplotspec()
    if place is not None and place.is_last_row():
        axes.set_xlabel("Training timesteps [decisions]")


def plot_learning_curve(curve: pd.DataFrame, folder: Path, title: str) -> None:
    """Return, crashes, blame and overrides against timesteps, one line per arm with its 95 % band.

    A point stands for all episodes that began in its bin, however long they lasted and whether or not
    they were cut off (`completion_weights`). Bins are joined where too few of them could be finished.

    Args:
      curve: one row per training episode of all arms and seeds; columns arm, train_seed, timesteps,
        started, cut, length, return, crashed, blame, override_share.
      folder: gets learning_curve.png and learning_curve.pdf.
    """
    at_fault = curve["blame"].isin(AT_FAULT)
    panels = (
        ("Return per episode", curve["return"], weighted_mean),
        ("Episodes with a crash", curve["crashed"], weighted_rate),
        ("Episodes with the ego at fault", at_fault, weighted_rate),
        ("Frames overridden by the shield", curve["override_share"], weighted_mean),
    )
    edges = np.linspace(0, max(curve["timesteps"].max(), 1) if len(curve) else 1, BINS + 1)
    bins = {arm: joined_bins(rows, edges) for arm, rows in curve.groupby("arm", sort=False)}
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 4.2 + 0.08 * len(bins)))
        for axes, (name, values, statistic) in zip(figure.subplots(2, 2, sharex=True).flat, panels, strict=True):
            for arm, rows in curve.groupby("arm", sort=False):
                label = f"{arm} (n = {len(rows)} episodes, {seeds_text(rows['train_seed'].nunique())})"
                points = [
                    ((low + high) / 2, _point(statistic, values[inside.index], inside))
                    for low, high, inside in bins[arm]
                ]
                _line(axes, points, label, str(arm))
            if not any(np.isfinite(line.get_ydata()).any() for line in axes.get_lines()):
                axes.text(0.5, 0.5, "too few episodes have ended", transform=axes.transAxes, ha="center", color="0.4")
            label_over_training(axes, name, share=name != "Return per episode")
            if name.startswith("Frames"):  # often a percent or two, which from 0 to 100 % looks like nothing
                axes.autoscale(axis="y")
                axes.set_ylim(bottom=0.0)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=7)  # long names fit side by side
        explained = (
            "point: all episodes begun in its bin, those cut off weighted in; band: 95 % interval over these episodes"
        )
        figure.suptitle(f"{title}: training\n({explained})", size=8)
        save(figure, folder / "learning_curve")


def plot_blame(episodes: pd.DataFrame, folder: Path, title: str) -> None:
    """Who broke their duty in the crashes: one stacked bar per cell, n below it.

    The left whisker is the 95 % interval of the ego's share (ego and both), the right one that of all
    crashes.

    Args:
      episodes: one row per test episode; columns train, test, crashed, blame.
      folder: gets blame.png and blame.pdf.
    """
    cells = list(episodes.groupby(["train", "test"], sort=False))
    with matplotlib.rc_context(STYLE):
        many = len(cells) > MANY
        figure = Figure(figsize=(max(6.5, (0.6 if many else 1.2) * len(cells)), 4.6 if many else 4.0))
        axes = figure.subplots()
        tops = np.zeros(len(cells))
        for blame in BLAMES:
            heights = np.array([_blamed(cell, blame).mean() for _, cell in cells])
            axes.bar(
                range(len(cells)),
                heights,
                bottom=tops,
                width=0.6,
                color=BLAME_COLOURS[blame],
                edgecolor="white",
                linewidth=0.5,
                label=blame,
            )
            tops += heights
        for i, (_, cell) in enumerate(cells):
            at_fault = cell["blame"].isin(AT_FAULT)
            _whisker(axes, i - 0.12, wilson(int(at_fault.sum()), len(cell)))
            _whisker(axes, i + 0.12, wilson(int(cell["crashed"].sum()), len(cell)))
        if many:  # their names are long and would cover each other
            names = [f"{train} / {test}, n = {len(cell)}" for (train, test), cell in cells]
            axes.set_xticks(range(len(cells)), names, rotation=40, ha="right", rotation_mode="anchor", size=7)
        else:
            names = [f"training: {train}\ntesting: {test}\nn = {len(cell)}" for (train, test), cell in cells]
            axes.set_xticks(range(len(cells)), names)
        axes.set_xlabel("Shield in training and in testing, test episodes")
        axes.set_ylabel("Test episodes with a crash")
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_ylim(bottom=0)
        figure.legend(title="Who broke their duty", loc="outside lower center", ncols=len(BLAMES))
        whiskers = "whiskers: 95 % Wilson intervals over episodes; left one: the ego's share, right one: all crashes"
        figure.suptitle(f"{title}: who is to blame\n({whiskers})", size=8)
        save(figure, folder / "blame")


def _blamed(cell: pd.DataFrame, blame: str) -> pd.Series:
    """0/1 per episode; a crash without a verdict counts as "none"."""
    if blame == "none":
        return cell["crashed"].astype(bool) & ~cell["blame"].isin([b for b in BLAMES if b != "none"])
    return cell["blame"] == blame


def joined_bins(episodes: pd.DataFrame, edges: np.ndarray) -> list[tuple[float, float, pd.DataFrame]]:
    """(from, to, its episodes with their weights) of every bin.

    Args:
      episodes: columns started, length, cut.
      edges: [B + 1]; an episode is in the bin that it began in. A bin of which too much is unknown is joined
        with the next one, the last one with that before.

    Returns:
      At most B bins; the episodes have a column weight.
    """
    bins: list[tuple[float, float, pd.DataFrame]] = []
    begin = edges[0]
    for end in edges[1:]:
        inside = _weighted(episodes, begin, end)
        if inside["weight"].sum() >= 1 - UNFINISHED:
            bins.append((begin, end, inside))
            begin = end
    if begin < edges[-1] and len(_weighted(episodes, begin, edges[-1])):
        begin = bins.pop()[0] if bins else begin
        bins.append((begin, edges[-1], _weighted(episodes, begin, edges[-1])))
    return bins


def _weighted(episodes: pd.DataFrame, begin: float, end: float) -> pd.DataFrame:
    inside = episodes[(episodes["started"] >= begin) & (episodes["started"] < end)]
    return inside.assign(weight=completion_weights(inside["length"], inside["cut"]))


def _point(statistic: Callable[..., Interval], values: pd.Series, inside: pd.DataFrame) -> Interval:
    """No value where too much is unknown; the interval of a rate says how much."""
    interval = statistic(values, inside["weight"])
    if inside["weight"].sum() >= 1 - UNFINISHED:
        return interval
    known = interval if statistic is weighted_rate else Interval(np.nan, np.nan, np.nan, interval.n)
    return known._replace(value=np.nan)


def _line(axes: Axes, points: list[tuple[float, Interval]], label: str, arm: str) -> None:
    x, style = [centre for centre, _ in points], style_of(arm)
    axes.plot(x, [p.value for _, p in points], markersize=3, label=label, **style)
    low, high = [p.low for _, p in points], [p.high for _, p in points]
    axes.fill_between(x, low, high, color=style["color"], alpha=0.2, linewidth=0)


def style_of(arm: str) -> dict[str, Any]:
    """Colour and marker of an arm: no two arms whose colours are alike have the same marker."""
    markers, row = "osD^v<>pPXh", arm_named(arm)
    return {"color": row.colour, "marker": "*" if row.own else markers[list(ARMS).index(arm) // 2 % len(markers)]}


def _whisker(axes: Axes, x: float, interval: Interval) -> None:
    below, above = interval.value - interval.low, interval.high - interval.value
    axes.errorbar(x, interval.value, [[below], [above]], color="black", capsize=2.5, linewidth=0.9, fmt="none")


def seeds_text(count: int) -> str:
    return f"{count} seed" if count == 1 else f"{count} seeds"


def save(figure: Figure, stem: Path) -> None:
    """As PNG and PDF beside each other; the same data give the same file.

    Args:
      stem: the path without an ending; what follows a dot in it, as in penalty-0.1, is part of the name.
    """
    for kind in ("png", "pdf"):
        with atomic(stem.with_name(f"{stem.name}.{kind}")) as temporary:
            # a fixed date: the same data give the same file
            metadata = {"CreationDate": None} if kind == "pdf" else None
            figure.savefig(temporary, format=kind, metadata=metadata)
