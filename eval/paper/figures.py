"""Figures of a report that a run does not draw itself."""

from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from rss_shield.eval.metrics import METRICS
from rss_shield.eval.plots import STYLE, save
from rss_shield.eval.stats import performance_profile

COMFORT = ("rms_jerk", "hard_braking_share", "comfortable_share", "mean_acceleration_change")
TESTS = {"off": "#D55E00", "on": "#0072B2"}
OTHER = "#009E73"


def plot_comfort(summary: pd.DataFrame, folder: Path, title: str) -> bool:
    """comfort.png and .pdf, a bar per cell; whiskers: thick over episodes, thin over seeds. False: nothing to draw."""
    metrics = [metric for metric in METRICS if metric.name in COMFORT and metric.name in set(summary["metric"])]
    if not metrics:
        return False
    cells = list(dict.fromkeys(zip(summary["train"], summary["test"], strict=True)))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.8, 1.6 + 0.24 * len(cells)))
        for axes, metric in zip(np.ravel(figure.subplots(1, len(metrics), sharey=True)), metrics, strict=True):
            rows = summary[summary["metric"] == metric.name].set_index(["train", "test"])
            for y, cell in enumerate(cells):
                if cell not in rows.index:
                    continue
                row = rows.loc[cell]
                axes.barh(y, metric.scale * row["value"], color=TESTS.get(cell[1], OTHER), height=0.7, alpha=0.75)
                for low, high, width in (("low", "high", 2.2), ("seed_low", "seed_high", 0.7)):
                    axes.plot(metric.scale * row[[low, high]].astype(float), [y, y], color="black", linewidth=width)
            axes.set_title(f"{metric.label} [{metric.unit}]", loc="left", size=8)
            axes.set_xlim(left=0)
        axes.set_yticks(range(len(cells)), [f"{train} / {test}" for train, test in cells], size=7)
        axes.invert_yaxis()
        figure.suptitle(f"{title}: the ride (train / test; 95 % intervals, thick: episodes, thin: seeds)", size=8)
        save(figure, folder / "comfort")
    return True


def plot_profiles(scores: dict[str, np.ndarray], folder: Path, title: str) -> None:
    """profiles.png and .pdf: share of runs above each normalised score, with the band of 95 %.

    Args:
      scores: name -> `[R, T]` of R seeds on T roads.
    """
    lowest = min(table.min() for table in scores.values())
    highest = max(table.max() for table in scores.values())
    thresholds = np.linspace(lowest - 0.02, highest + 0.02, 201)
    # Okabe & Ito's, without the yellow
    colours = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 3.6))
        axes = figure.subplots()
        for i, (name, table) in enumerate(scores.items()):
            profile = performance_profile(table, thresholds, np.random.default_rng(0))
            style = ("-", "--", ":", "-.")[i // len(colours) % 4]
            axes.plot(thresholds, profile.value, color=colours[i % len(colours)], linestyle=style, label=name)
            axes.fill_between(
                thresholds, profile.low, profile.high, color=colours[i % len(colours)], alpha=0.12, linewidth=0
            )
        axes.set_xlabel("Return, 0: worst cell of the road, 1: best")
        axes.set_ylabel("Share of runs above")
        figure.legend(loc="outside right center", fontsize=7)
        figure.suptitle(title, size=8)
        save(figure, folder / "profiles")
