"""The points of an experiment as tables and as a figure."""

import textwrap
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rss_shield.eval.files import atomic, write_text
from rss_shield.eval.metrics import Metric
from rss_shield.eval.plots import STYLE
from rss_shield.eval.runs.points import APART, groups_of, metric_named, with_front
from rss_shield.eval.runs.store import missing_in
from rss_shield.eval.table import markdown, rounded

SHOWN = ("crash", "at_fault", "success", "return", "own_return", "speed", "override_share", "rms_jerk", "min_ttc")
FRONT, BEATEN = "#0072B2", "#999999"
BOUNDS = ("low", "high")


def wide(points: pd.DataFrame, axes: list[str]) -> pd.DataFrame:
    """A row per point: its axes, and a column per metric with its value, METRIC_low and METRIC_high.

    Args:
      points: long, as of `eval.runs.points.point_row`.
      axes: columns that tell points apart.
    """
    # points are numbered: values of axes may be lists or missing
    keys = points[axes].apply(lambda row: tuple(map(str, row)), axis=1) if axes else pd.Series([()] * len(points))
    number = pd.factorize(keys)[0]
    first = points.assign(_point=number).groupby("_point").first()[axes]
    table = points.assign(_point=number).pivot(index="_point", columns="metric", values=["value", *BOUNDS])
    for metric in table.columns.levels[1]:
        first[metric] = table["value", metric]
        for bound in BOUNDS:
            first[f"{metric}_{bound}"] = table[bound, metric]
    return first.reset_index(drop=True)


def shown_metrics(table: pd.DataFrame, safety: str, performance: str) -> list[Metric]:
    names = dict.fromkeys((safety, performance, *SHOWN))
    return [metric_named(name) for name in names if name in table]


def texts(table: pd.DataFrame, axes: list[str], metrics: list[Metric]) -> pd.DataFrame:
    """The same as it is printed: "3.1 [2.8, 3.4]"; a star where nothing beats a point in both metrics."""
    frame = pd.DataFrame({name: table[name].map(plain) for name in axes})
    for metric in metrics:
        heading = f"{metric.label} [{metric.unit}]" if metric.unit else metric.label
        limits = tuple(metric.scale * limit for limit in metric.limits)
        cells = []
        for numbers in table[[metric.name, *(f"{metric.name}_{bound}" for bound in BOUNDS)]].to_numpy(float):
            value, low, high = (rounded(metric.scale * number, metric.digits, limits) for number in numbers)
            cells.append(f"{value} [{low}, {high}]")
        frame[heading] = cells
    if "front" in table:
        frame["front"] = np.where(table["front"], "★", "")
    return frame


def plain(value: Any) -> str:
    """A value of an axis, a number in at most four digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def markdown_of(frame: pd.DataFrame) -> str:
    return markdown([list(frame.columns), *frame.to_numpy().tolist()])


def write_points(folder: Path, points: pd.DataFrame, axes: list[str], safety: str, performance: str, title: str) -> str:
    """Write points.csv, table.md, pareto.png and pareto.pdf; returns the table.

    Args:
      folder: of the sweep, whose tasks that failed table.md names.
    """
    table = with_front(wide(points, axes), safety, performance)
    with atomic(folder / "points.csv") as temporary:
        points.to_csv(temporary, index=False)
    text = markdown_of(texts(table, axes, shown_metrics(table, safety, performance)))
    note = (
        f"{intervals_of(points)}; ★: no other point of its panel is as good in both "
        f"{metric_named(safety).label} and {metric_named(performance).label} and better in one."
    )
    missing = missing_in(folder)
    write_text(folder / "table.md", "\n\n".join([title, text, note, *([missing] if missing else [])]) + "\n")
    figure = plot_front(table, axes, safety, performance, title)
    for kind in ("png", "pdf"):
        with atomic(folder / f"pareto.{kind}") as temporary:
            figure.savefig(temporary, format=kind, metadata={"CreationDate": None} if kind == "pdf" else None)
    return text


def intervals_of(points: pd.DataFrame) -> str:
    """What values and their intervals are about."""
    over = ", ".join(sorted(set(points["over"])))
    return f"Means (min TTC and the like: medians) of episodes of all seeds; [low, high]: 95 % intervals over {over}"


def plot_front(table: pd.DataFrame, axes: list[str], safety: str, performance: str, title: str) -> Figure:
    """Performance to the right, what safety lacks upward; the front is joined by a line and numbered.

    Args:
      table: as of `with_front`; a panel for each group of points that compete.
    """
    groups = groups_of(table)
    columns = min(2, len(groups))
    rows = -(-len(groups) // columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.8, 0.8 + 3.4 * rows))
        panels = iter(figure.subplots(rows, columns, squeeze=False).flat)
        for (label, numbers), plot in zip(groups, panels, strict=False):  # groups first: a panel drawn is a panel used
            _panel(plot, table.iloc[numbers], [name for name in axes if name not in APART], safety, performance)
            plot.set_title(label, loc="left")
        for plot in panels:
            plot.set_axis_off()
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        figure.suptitle("\n".join(textwrap.wrap(title, 110)), size=8)
    return figure


def _panel(plot: Axes, table: pd.DataFrame, axes: list[str], safety: str, performance: str) -> None:
    x, y = metric_named(performance), metric_named(safety)
    for on, colour, marker, label in (
        (False, BEATEN, "o", "beaten by another"),
        (True, FRONT, "s", "on the Pareto front"),
    ):
        rows = table[table["front"] == on]
        style: Any = {"fmt": marker, "color": colour, "markersize": 4, "elinewidth": 0.6, "label": label}
        style |= {"xerr": _reach(rows, x), "yerr": _reach(rows, y)}
        plot.errorbar(x.scale * rows[x.name], y.scale * rows[y.name], **style)
    front = table[table["front"]].sort_values([x.name, y.name])
    plot.plot(x.scale * front[x.name], y.scale * front[y.name], color=FRONT, linewidth=0.8)
    middle = sum(plot.get_xlim()) / 2
    for place, text in labels_of(front, axes, x, y):
        left = place[0] > middle  # toward the middle: there is room
        beside: Any = {"xytext": (-4 if left else 4, 4), "ha": "right" if left else "left", "fontsize": 6}
        lines = "\n".join(line for one in text.split("\n") for line in textwrap.wrap(one, WIDTH))
        plot.annotate(lines, place, textcoords="offset points", **beside).set_in_layout(False)
    plot.set_xlabel(f"{x.label} [{x.unit}]" if x.unit else x.label)
    plot.set_ylabel(f"{y.label} [{y.unit}]" if y.unit else y.label)


WIDTH = 32  # letters of a line of a label
NEAR = 0.04  # of the front's extent: points that are nearer than this in both directions share a label


def labels_of(front: pd.DataFrame, axes: list[str], x: Metric, y: Metric) -> list[tuple[tuple[float, float], str]]:
    """Where to write what on a panel; points that nearly coincide share a place, one line for each.

    Args:
      front: a row per point.
      axes: columns that tell points apart.
    """
    ends = [(front[metric.name].min(), front[metric.name].max()) for metric in (x, y)]
    span = [max(high - low, 1e-12) for low, high in ends]
    places: list[tuple[tuple[float, float], list[str]]] = []
    for _, row in front.iterrows():
        here, text = (float(row[x.name]), float(row[y.name])), "\n".join(plain(row[name]) for name in axes)
        near = [
            texts
            for there, texts in places
            if all(abs(a - b) <= NEAR * s for a, b, s in zip(here, there, span, strict=True))
        ]
        if near:
            near[0].append(text)
        else:
            places.append((here, [text]))
    joint = ", " if len(axes) == 1 else "\n"
    return [((x.scale * a, y.scale * b), joint.join(dict.fromkeys(texts))) for (a, b), texts in places]


def _reach(rows: pd.DataFrame, metric: Metric) -> np.ndarray:
    """`[2, N]` below and above; nothing where it is not known."""
    value = rows[metric.name].to_numpy(float)
    below, above = (
        value - rows[f"{metric.name}_low"].to_numpy(float),
        rows[f"{metric.name}_high"].to_numpy(float) - value,
    )
    return metric.scale * np.nan_to_num(np.maximum([below, above], 0.0))
