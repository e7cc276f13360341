"""Who earns the safety: the agent on its way through training, tested with the shield and with the shield taken away.

Rows go to `removal_curve.csv` in the folder of a model, two after each check.
"""

import io
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy import stats

from rss_shield.eval.files import write_text
from rss_shield.eval.metrics import with_outcomes
from rss_shield.eval.plots import STYLE, label_over_training, save, seeds_text, style_of
from rss_shield.eval.stats import Interval, wilson

FILE = "removal_curve.csv"
COLUMNS = (
    "timesteps",  # decisions the agent has learnt from
    "test",  # off, on, ...: as in the table of the run
    "n",  # episodes
    "crash",  # share of the episodes with a contact of any kind
    "at_fault",  # ... with the ego at fault
    "return",  # mean of the raw rewards' sum
    "return_sd",  # standard deviation over the episodes
    "change",  # mean change of acceleration [m/s^2]
)


def read(path: Path) -> pd.DataFrame:
    """The rows so far; none if there is no file."""
    return pd.read_csv(path) if path.exists() else pd.DataFrame(columns=list(COLUMNS))


def is_due(rows: pd.DataFrame, timesteps: int, total: int, checks: int) -> bool:
    """Has the training passed another of its `checks` marks since the last row?"""
    last = int(rows["timesteps"].max()) if len(rows) else 0
    return timesteps * checks // total > last * checks // total


def record(path: Path, rows: pd.DataFrame, timesteps: int, tests: Mapping[str, pd.DataFrame]) -> None:
    """Add a row per test; the file is the old one or the new one whenever a kill comes.

    Args:
      rows: what was known before.
      timesteps: decisions the agent has learnt from.
      tests: name of the test -> its episodes, as `eval.rollout.evaluate` returns them.
    """
    new = [row_of(timesteps, test, with_outcomes(episodes)) for test, episodes in tests.items()]
    text = io.StringIO()
    pd.DataFrame([*rows.to_dict("records"), *new], columns=list(COLUMNS)).to_csv(text, index=False)
    write_text(path, text.getvalue())


def row_of(timesteps: int, test: str, episodes: pd.DataFrame) -> dict[str, object]:
    returns = episodes["return"].astype(float)
    return {
        "timesteps": timesteps,
        "test": test,
        "n": len(episodes),
        "crash": float(episodes["crash"].mean()),
        "at_fault": float(episodes["at_fault"].mean()),
        "return": float(returns.mean()),
        "return_sd": float(returns.std(ddof=1)) if len(returns) > 1 else 0.0,
        "change": float(episodes["mean_acceleration_change"].mean()),
    }


def plot_removal(rows: pd.DataFrame, folder: Path, title: str) -> None:
    """Crashes and return without the shield, and how much it changes when it is there, over training.

    Args:
      rows: COLUMNS, and arm, train_seed.
      folder: gets removal.png and removal.pdf.
    """
    panels = (
        ("Crashes without the shield", "off", "crash"),
        ("Ego at fault without the shield", "off", "at_fault"),
        ("Return without the shield", "off", "return"),
        ("Change by the shield [m/s²]", "on", "change"),
    )
    with matplotlib.rc_context(STYLE):
        arms = list(rows["arm"].unique())
        figure = Figure(figsize=(6.5, 4.6 + 0.1 * len(arms)))
        for axes, (name, test, value) in zip(figure.subplots(2, 2, sharex=True).flat, panels, strict=True):
            for arm in arms:
                chosen = rows[(rows["arm"] == arm) & (rows["test"] == test)]
                points = [(t, _pooled(at, value)) for t, at in chosen.groupby("timesteps")]
                look = style_of(arm)
                seeds = chosen["train_seed"].nunique()
                x = [t for t, _ in points]
                axes.plot(x, [p.value for _, p in points], label=f"{arm} ({seeds_text(seeds)})", markersize=3, **look)
                low, high = [p.low for _, p in points], [p.high for _, p in points]
                axes.fill_between(x, low, high, color=look["color"], alpha=0.15, linewidth=0)
            label_over_training(axes, name, share=value in ("crash", "at_fault"))
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        n = int(rows["n"].max())
        figure.suptitle(f"{title}: who earns the safety\n({n} test episodes per point and seed; bands: 95 %)", size=8)
        save(figure, folder / "removal")


def _pooled(at: pd.DataFrame, value: str) -> Interval:
    """All seeds together: a rate with Wilson's interval, a mean with the normal one over episodes."""
    n, values = at["n"].to_numpy(int), at[value].to_numpy(float)
    total = int(n.sum())
    mean = float(n @ values / total)
    if value in ("crash", "at_fault"):
        return wilson(round(mean * total), total)
    if value == "return":
        squares = float((n - 1) @ at["return_sd"].to_numpy(float) ** 2 + n @ (values - mean) ** 2)
        half = stats.norm.ppf(0.975) * np.sqrt(squares / max(total - 1, 1) / total)
        return Interval(mean, mean - half, mean + half, total)
    return Interval(mean, np.nan, np.nan, total)


def read_all(folder: Path, models: list[tuple[str, int]]) -> pd.DataFrame:
    """The rows of all models of a run, with arm and train_seed."""
    read_of = [read(folder / f"{arm}-seed{seed}" / FILE).assign(arm=arm, train_seed=seed) for arm, seed in models]
    found = [rows for rows in read_of if len(rows)]
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=[*COLUMNS, "arm", "train_seed"])
