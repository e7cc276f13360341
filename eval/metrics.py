"""What is measured per cell of the comparison: one table of metrics, one function that fills it in.

A cell is a (train, test) pair: shield off or on while training, off or on while testing.
"""

import math
from collections.abc import Container
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from rss_shield.eval.stats import Interval, bootstrap_mean, bootstrap_median, paired_difference, student, wilson
from rss_shield.shield.verdicts import AT_FAULT, BLAMES


class Metric(NamedTuple):
    """A column of the table."""

    name: str  # key in files, and column of `with_outcomes`
    label: str  # heading
    unit: str
    statistic: Literal["rate", "mean", "median"]
    scale: float  # shown value = scale * value
    digits: int
    less_is_better: bool
    limits: tuple[float, float] = (-math.inf, math.inf)  # what the value can be


LESS, MORE = True, False  # is better

# The success rate and the time of the episodes that succeed belong to environments with a goal only.
METRICS = (
    Metric("crash", "crash", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("at_fault", "ego at fault", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("other", "other at fault", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("inherited", "inherited", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("none", "none", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("success", "success", "%", "rate", 100, 0, MORE, (0, 1)),
    Metric("time_to_goal", "time to goal", "s", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("return", "return", "", "mean", 1, 1, MORE),
    Metric("own_return", "own return", "", "mean", 1, 1, MORE),  # where there is a reward of one's own
    Metric("speed", "speed", "m/s", "mean", 1, 1, MORE),
    Metric("length", "length", "steps", "mean", 1, 1, MORE, (0, math.inf)),
    Metric("override_share", "overridden", "%", "mean", 100, 0, LESS, (0, 1)),
    Metric("anticipation_share", "anticipated", "%", "mean", 100, 0, LESS, (0, 1)),
    Metric("mean_acceleration_change", "change", "m/s²", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("rms_jerk", "rms jerk", "m/s³", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("hard_braking_share", "hard braking", "%", "mean", 100, 0, LESS, (0, 1)),
    Metric("comfortable_share", "comfortable", "%", "mean", 100, 0, MORE, (0, 1)),
    Metric("min_time_gap", "min time gap", "s", "median", 1, 1, MORE, (0, math.inf)),
    Metric("frozen", "frozen", "%", "rate", 100, 0, LESS, (0, 1)),
    Metric("near_misses", "near misses", "", "mean", 1, 2, LESS, (0, math.inf)),
    Metric("impact", "impact speed", "m/s", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("impact_delta_v", "DeltaV", "m/s", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("min_thw_ahead", "min THW ahead", "s", "median", 1, 1, MORE, (0, math.inf)),
    Metric("max_drac_ahead", "max DRAC ahead", "m/s²", "median", 1, 1, LESS, (0, math.inf)),
    Metric("min_pet", "min PET", "s", "median", 1, 1, MORE, (0, math.inf)),
    Metric("violation_ego", "RSS violated by ego", "s", "mean", 1, 2, LESS, (0, math.inf)),
    Metric("violation_other", "RSS violated by other", "s", "mean", 1, 2, LESS, (0, math.inf)),
    Metric("shield_time", "shield per frame", "µs", "median", 1e6, 0, LESS, (0, math.inf)),
    Metric("min_ttc", "min TTC", "s", "median", 1, 1, MORE, (0, math.inf)),
    # where risk is measured
    Metric("min_thw", "min THW", "s", "median", 1, 1, MORE, (0, math.inf)),
    Metric("max_drac", "max DRAC", "m/s²", "median", 1, 1, LESS, (0, math.inf)),
    Metric("max_rdsi", "max RDSI", "", "median", 1, 2, LESS),
    Metric("time_known_safe", "known safe", "s", "mean", 1, 1, MORE, (0, math.inf)),
    Metric("time_unknown", "unknown", "s", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("time_known_unsafe", "known unsafe", "s", "mean", 1, 1, LESS, (0, math.inf)),
    Metric("band_risk", "band risk", "s", "mean", 1, 1, LESS, (0, math.inf)),
)


RATES = frozenset(metric.name for metric in METRICS if metric.statistic == "rate")


def with_outcomes(episodes: pd.DataFrame) -> pd.DataFrame:
    """Add one 0/1 column per outcome: crash = at_fault + other + inherited + none.

    With a goal also time_to_goal [s], NaN in the episodes that do not reach it.
    """
    if "success" in episodes:
        episodes = episodes.assign(time_to_goal=episodes["time"].where(episodes["success"].astype(bool)))
    if "impact_speed" in episodes:  # of the episodes with a contact
        touched = episodes["crashed"].astype(bool)
        impacts = {"impact": "impact_speed", "impact_delta_v": "delta_v"}
        episodes = episodes.assign(**{name: episodes[column].where(touched) for name, column in impacts.items()})
    blame, crash = episodes["blame"], episodes["crashed"].astype(bool)
    at_fault = blame.isin(AT_FAULT)
    return episodes.assign(
        crash=crash,
        at_fault=at_fault,
        other=blame == "other",
        inherited=blame == "inherited",
        none=crash & ~blame.isin(BLAMES[:-1]),
    )


def metrics_in(names: Container[str]) -> list[Metric]:
    """The metrics that some episodes, or a summary of them, have."""
    return [metric for metric in METRICS if metric.name in names]


def summarise(episodes: pd.DataFrame) -> pd.DataFrame:
    """Every metric of every cell with two 95 % intervals: over test episodes, and over training seeds.

    Args:
      episodes: one row per episode; columns of `eval.rollout.run_episode` and train, test, train_seed.

    Returns:
      Columns train, test, metric, value, low, high, n, seed_low, seed_high, seeds; cells in order of
      appearance. n, seeds: the episodes and the training seeds that have the metric; low, high: over
      episodes; seed_low, seed_high: see `over_seeds`. The bootstrap draws from a generator of its own for
      every metric of every cell, so the same values give the same intervals.
    """
    rows = []
    for (train, test), cell in with_outcomes(episodes).groupby(["train", "test"], sort=False):
        for metric in metrics_in(cell.columns):
            known = cell[["train_seed", metric.name]].astype(float).dropna()
            interval = _statistic(metric, known[metric.name].to_numpy(), np.random.default_rng(0))
            per_seed = known.groupby("train_seed")[metric.name]
            values = per_seed.median() if metric.statistic == "median" else per_seed.mean()
            seeds = over_seeds(values.to_numpy(), interval, metric.limits)
            rows.append({"train": train, "test": test, "metric": metric.name, **interval._asdict(), **seeds})
    return pd.DataFrame(rows)


def over_seeds(values: np.ndarray, over_episodes: Interval, limits: tuple[float, float]) -> dict[str, float]:
    """What training with other seeds may give: Student's t interval of the seeds' values.

    Never narrower than the interval over episodes: seeds that happen to agree, as in no crash at all,
    know no more than their episodes do.

    Args:
      values: [S], the metric of each training seed.
      over_episodes: of all episodes of these seeds.
      limits: what the metric can be.

    Returns:
      seed_low, seed_high (NaN for fewer than two seeds), seeds: S.
    """
    spread = student(values)
    if spread.n < 2:
        return {"seed_low": np.nan, "seed_high": np.nan, "seeds": spread.n}
    low, high = np.fmin(spread.low, over_episodes.low), np.fmax(spread.high, over_episodes.high)
    return {"seed_low": float(max(low, limits[0])), "seed_high": float(min(high, limits[1])), "seeds": spread.n}


def paired(cell: pd.DataFrame, first: pd.DataFrame, suffix: str) -> pd.DataFrame:
    """Two cells side by side, by training seed and episode seed; columns of the second end in `suffix`.

    Who learns nothing is tested once, and is beside every training seed of the other.
    """
    keys = ["train_seed", "seed"]
    seeds, others = set(cell["train_seed"]), set(first["train_seed"])
    if seeds != others and len(others) == 1:
        keys, first = ["seed"], first.drop(columns="train_seed")
    elif seeds != others and len(seeds) == 1:
        keys, cell = ["seed"], cell.drop(columns="train_seed")
    return cell.merge(first, on=keys, suffixes=("", suffix))


def differences(episodes: pd.DataFrame) -> pd.DataFrame:
    """Every cell minus the first one; see `paired`. Means of all metrics.

    A pair counts where both of its episodes have the metric: times to the goal only where both reach it.

    Returns:
      Columns train, test, metric, value, low, high, n, seed_low, seed_high, seeds, as in `summarise`.
    """
    cells = list(with_outcomes(episodes).groupby(["train", "test"], sort=False))
    rows = []
    for (train, test), cell in cells[1:]:
        pairs = paired(cell, cells[0][1], "_baseline")
        for metric in metrics_in(cell.columns):
            sample = pairs[metric.name].to_numpy(float)
            baseline = pairs[f"{metric.name}_baseline"].to_numpy(float)
            known = ~np.isnan(sample - baseline)
            interval = paired_difference(sample[known], baseline[known], np.random.default_rng(0))
            values = pd.Series(sample - baseline)[known].groupby(pairs["train_seed"][known]).mean()
            seeds = over_seeds(values.to_numpy(), interval, (-math.inf, math.inf))
            rows.append({"train": train, "test": test, "metric": metric.name, **interval._asdict(), **seeds})
    return pd.DataFrame(rows, columns=["train", "test", "metric", *Interval._fields, "seed_low", "seed_high", "seeds"])


def _statistic(metric: Metric, sample: np.ndarray, rng: np.random.Generator) -> Interval:
    if metric.statistic == "rate":
        return wilson(int(sample.sum()), sample.size)
    if metric.statistic == "median":
        return bootstrap_median(sample, rng)
    return bootstrap_mean(sample, rng)
