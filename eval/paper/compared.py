"""Every cell of a run against the first: differences over seeds, discordant episodes, corrected for their number."""

import numpy as np
import pandas as pd

from rss_shield.eval.metrics import RATES, paired, with_outcomes
from rss_shield.eval.stats import Interval, cluster_difference, holm, mcnemar, paired_difference

COMPARED = ("crash", "at_fault", "return")


def comparisons(episodes: pd.DataFrame) -> pd.DataFrame:
    """Paired by training seed and test episode; see `metrics.paired`.

    Args:
      episodes: one row per episode; columns train, test, train_seed, seed, crashed, blame, return.

    Returns:
      A row per cell but the first and per metric of COMPARED: train, test, metric, value, low, high, n, over (from two
      training seeds on: seeds and episodes), and for rates only_here, only_first and p: McNemar's exact test over the
      episodes of all seeds, of these trained models; p_holm corrects for all tests of the run.
    """
    cells = list(with_outcomes(episodes).groupby(["train", "test"], sort=False))
    rows = []
    for (train, test), cell in cells[1:]:
        pairs = paired(cell, cells[0][1], "_first")
        for metric in COMPARED:
            here, there = pairs[metric].astype(float), pairs[f"{metric}_first"].astype(float)
            is_rate = metric in RATES
            found = difference(pairs, here, there, np.random.default_rng(0), is_rate)  # equal values, equal intervals
            row = {"train": train, "test": test, "metric": metric, **found._asdict()}
            if is_rate:
                discordant = mcnemar(here, there)
                row |= {"only_here": discordant.only_first, "only_first": discordant.only_second, "p": discordant.p}
            rows.append(row)
    frame = pd.DataFrame(rows, columns=["train", "test", "metric", *Interval._fields, "only_here", "only_first", "p"])
    tested = frame["p"].notna().to_numpy(bool)
    corrected = np.full(len(frame), np.nan)
    corrected[tested] = holm(frame.loc[tested, "p"].to_numpy(float))
    return frame.assign(p_holm=corrected)


def difference(
    pairs: pd.DataFrame, here: pd.Series, there: pd.Series, rng: np.random.Generator, is_rate: bool
) -> Interval:
    """Mean of here - there, over seeds and episodes from two training seeds on, else over episodes.

    Args:
      pairs: a row per pair of episodes; column train_seed.
      here, there: of the same rows.
      is_rate: they are 0 or 1, so means of them differ by 1 at most.
    """
    seeds = [group.index for _, group in pairs.groupby("train_seed")]
    if len(seeds) < 2:
        return paired_difference(here, there, rng)
    interval = cluster_difference([here[rows] for rows in seeds], [there[rows] for rows in seeds], rng)
    if is_rate:
        return interval._replace(low=max(interval.low, -1.0), high=min(interval.high, 1.0))
    return interval


def as_texts(compared: pd.DataFrame) -> pd.DataFrame:
    """The same as it is printed."""
    labels = {"crash": "crash [% points]", "at_fault": "ego at fault [% points]", "return": "return"}
    rows = []
    for row in compared.to_dict("records"):
        scale, digits = (1.0, 1) if row["metric"] == "return" else (100.0, 1)
        value, low, high = (f"{scale * row[name]:+.{digits}f}" for name in ("value", "low", "high"))
        tested = not np.isnan(row["p_holm"])
        rows.append(
            {
                "train / test": f"{row['train']} / {row['test']}",
                "difference in": labels[row["metric"]],
                "value [low, high]": f"{value} [{low}, {high}]" if not np.isnan(row["low"]) else f"{value} [–]",
                "over": row["over"],
                "only here / only first": f"{row['only_here']:.0f} / {row['only_first']:.0f}" if tested else "–",
                "p (McNemar, Holm)": _p(row["p_holm"]) if tested else "–",
            }
        )
    return pd.DataFrame(rows)


def _p(value: float) -> str:
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}"
