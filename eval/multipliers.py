"""Prices that found themselves: `multiplier.csv` of every model that has one, and their figure."""

from pathlib import Path

import matplotlib
import pandas as pd
from matplotlib.figure import Figure

from rss_shield.eval.plots import STYLE, save, style_of

FILE = "multiplier.csv"


def read_all(folder: Path, models: list[tuple[str, int]]) -> pd.DataFrame:
    """Rows timesteps, measured, target, multiplier of all models of a run, with arm and train_seed."""
    paths = {(arm, seed): folder / f"{arm}-seed{seed}" / FILE for arm, seed in models}
    found = [pd.read_csv(path).assign(arm=arm, train_seed=seed) for (arm, seed), path in paths.items() if path.exists()]
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=["arm"])


def plot_multipliers(rows: pd.DataFrame, folder: Path, title: str) -> None:
    """What was measured, its target, and the multiplier over training: one row per arm, one line per seed.

    Args:
      rows: as `read_all` returns them.
      folder: gets multiplier.png and multiplier.pdf.
    """
    arms = list(rows["arm"].unique())
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 0.8 + 2.0 * len(arms)))
        grid = figure.subplots(len(arms), 2, sharex=True, squeeze=False)
        for (measured, price), arm in zip(grid, arms, strict=True):
            colour = style_of(arm)["color"]
            for _, of_seed in rows[rows["arm"] == arm].groupby("train_seed"):
                measured.plot(of_seed["timesteps"], of_seed["measured"], color=colour, linewidth=0.9)
                measured.plot(of_seed["timesteps"], of_seed["target"], color="black", linewidth=0.8, linestyle="--")
                price.plot(of_seed["timesteps"], of_seed["multiplier"], color=colour, linewidth=0.9)
            measured.set_title(f"{arm}: measured, and target (dashed)", loc="left")
            price.set_title(f"{arm}: multiplier", loc="left")
            measured.set_ylim(bottom=0)
            price.set_ylim(bottom=0)
        for axes in grid[-1]:
            axes.set_xlabel("Training timesteps [decisions]")
        figure.suptitle(f"{title}: means per decision of each rollout, a line per training seed", size=8)
        save(figure, folder / "multiplier")
