"""The frontier: how much an arm needs the shield, what it earns behind it, and how it fares without it.

`python -m rss_shield.eval.frontier runs/A runs/B --out docs/results` draws several runs of one
road together.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from rss_shield.eval.arms import OFF, ON, arm_called
from rss_shield.eval.plots import STYLE, save, style_of

# (heading, test, metric) across and up
ACROSS = (
    ("Frames overridden with the shield", ON, "override_share"),
    ("Mean change of acceleration [m/s²]", ON, "mean_acceleration_change"),
)
UP = (
    ("Return with the shield", ON, "return"),
    ("Return without the shield", OFF, "return"),
    ("Crashes without the shield", OFF, "crash"),
)
SHARES = ("override_share", "crash")
WHISKERS = (
    "whiskers: 95 % intervals, thick over test episodes, thin over training seeds; those that reach the frame go on"
)


def points_of(summary: pd.DataFrame) -> pd.DataFrame:
    """One row per arm and (test, metric) of the figure: value, and its intervals over episodes and over seeds.

    Args:
      summary: as `eval.metrics.summarise` returns it, of one run or several; of an arm in several runs the last counts.
    """
    arm_of = {train: arm.name for train in summary["train"].unique() if (arm := arm_called(str(train)))}
    rows = summary.assign(arm=summary["train"].map(arm_of)).dropna(subset=["arm"])
    wanted = {(test, metric) for _, test, metric in (*ACROSS, *UP)}
    chosen = [pair in wanted for pair in zip(rows["test"], rows["metric"], strict=True)]
    return rows[chosen].drop_duplicates(["arm", "test", "metric"], keep="last").set_index(["arm", "test", "metric"])


def plot_frontier(summary: pd.DataFrame, folder: Path, title: str) -> None:
    """frontier.png and .pdf in `folder`: an arm is a point, thick whiskers are over episodes, thin ones over seeds."""
    points = points_of(summary)
    arms = list(dict.fromkeys(points.index.get_level_values("arm")))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 7.6 + 0.07 * len(arms)))
        grid = figure.subplots(len(UP), len(ACROSS), sharex="col", sharey="row")
        for row, up in zip(grid, UP, strict=True):
            for axes, across in zip(row, ACROSS, strict=True):
                for arm in arms:
                    _point(axes, points, arm, across, up)
                for axis, (_, _, metric) in ((axes.xaxis, across), (axes.yaxis, up)):
                    if metric in SHARES:
                        axis.set_major_formatter(PercentFormatter(1.0))
            row[0].set_ylabel(up[0])
            row[0].set_ylim(limits_of(_drawn(points, up, ACROSS), up[2]))
        for axes, across in zip(grid[-1], ACROSS, strict=True):
            axes.set_xlabel(across[0])
            axes.set_xlim(limits_of(_drawn(points, across, UP), across[2]))
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        figure.suptitle(f"{title}: who needs the shield\n{WHISKERS}", size=8)
        save(figure, folder / "frontier")


def _point(axes: Axes, points: pd.DataFrame, arm: str, across: tuple[str, str, str], up: tuple[str, str, str]) -> None:
    keys = [(arm, *across[1:]), (arm, *up[1:])]
    if not all(key in points.index for key in keys):
        return
    x, y = (points.loc[key] for key in keys)
    look = style_of(arm)
    for low, high, width in (("low", "high", 1.6), ("seed_low", "seed_high", 0.5)):
        spread: dict[str, Any] = {name: _whisker(value, low, high) for name, value in (("xerr", x), ("yerr", y))}
        axes.errorbar(x["value"], y["value"], **spread, color=look["color"], linewidth=width, fmt="none", alpha=0.35)
    axes.plot(x["value"], y["value"], linestyle="none", markersize=6, markeredgecolor="white", label=arm, **look)


def _whisker(value: Any, low: str, high: str) -> list[list[float]]:
    """Lengths below and above; none where the interval is not known."""
    ends = np.nan_to_num([[value["value"] - value[low]], [value[high] - value["value"]]])
    return np.maximum(ends, 0.0).tolist()


def _drawn(points: pd.DataFrame, axis: tuple[str, str, str], others: Sequence[tuple[str, str, str]]) -> pd.DataFrame:
    """Rows of an axis: of the arms that have a place on any of the others, too."""
    there = points.index
    arms = [arm for arm in there.unique("arm") if any((arm, *other[1:]) in there for other in others)]
    return points.loc[[key for arm in arms if (key := (arm, *axis[1:])) in there]]


def limits_of(rows: pd.DataFrame, metric: str) -> tuple[float, float]:
    """The ends of an axis: around all intervals over episodes, and over seeds unless these are so wide as to hide them.

    Args:
      rows: an arm each; value, low, high, seed_low, seed_high.

    Returns:
      The intervals over episodes have at least a third of the axis.
    """
    near = rows[["value", "low", "high"]].to_numpy(float)
    known = near[np.isfinite(near)]
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    span = max(high - low, 1e-3 if metric in SHARES else 0.1)
    far = rows[["seed_low", "seed_high"]].to_numpy(float)
    ends = np.clip(far[np.isfinite(far)], low - span, high + span)
    low, high = float(min([low, *ends])), float(max([high, *ends]))
    margin = 0.06 * max(high - low, span)
    return low - margin, high + margin


def summary_of(run: Path) -> tuple[str, pd.DataFrame]:
    """Environment and summary of a finished run.

    Raises:
      ValueError: there is no results.json.
    """
    path = run / "results.json"
    if not path.exists():
        raise ValueError(f"{path}: no such file; expected the folder of a finished run")
    results = json.loads(path.read_text(encoding="utf-8"))
    cells = pd.DataFrame(results["cells"])
    numbers = ["value", "low", "high", "seed_low", "seed_high"]
    return results["config"]["env_id"], cells.assign(**{name: cells[name].astype(float) for name in numbers})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path, help="folders of finished runs on one road")
    parser.add_argument("--out", type=Path, default=None, help="folder for the figure (default: the first run)")
    arguments = parser.parse_args()
    try:
        found = [summary_of(run) for run in arguments.runs]
    except ValueError as error:
        parser.error(str(error))
    roads = sorted({road for road, _ in found})
    if len(roads) > 1:
        parser.error(f"runs of {', '.join(roads)}: expected runs of one road")
    out = arguments.out or arguments.runs[0]
    plot_frontier(pd.concat([summary for _, summary in found], ignore_index=True), out, roads[0])
    print(f"written: {out / 'frontier.png'}, {out / 'frontier.pdf'}")


if __name__ == "__main__":
    main()
