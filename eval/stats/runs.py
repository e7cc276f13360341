"""Scores of a few runs in several environments: interquartile mean, profile, probability of improvement.

After Agarwal et al., "Deep Reinforcement Learning at the Edge of the Statistical Precipice", NeurIPS 2021. Intervals
are percentiles of their stratified bootstrap, which draws runs of each environment by itself; with fewer than ten runs
they hold the truth less often than they say (tests/eval/test_stats_coverage.py). The authors' rliable has the same, but
draws from numpy's global generator, and what it needs does not go with pandas 3.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import trim_mean

from rss_shield.eval.stats.interval import RUNS, Interval

RESAMPLES = 2000


class Profile(NamedTuple):
    """Share of the runs above each threshold, environments weighing the same, with its band."""

    value: np.ndarray  # `[K]`
    low: np.ndarray
    high: np.ndarray
    n: int  # runs


def interquartile_mean(
    scores: ArrayLike, rng: np.random.Generator, confidence: float = 0.95, resamples: int = RESAMPLES
) -> Interval:
    """Mean of the middle half of all scores, runs and environments pooled: no outlier moves it.

    Args:
      scores: `[R, T]` of R runs in T environments, comparable with each other (normalised, say).
    """
    values = _table(scores)
    return _interval(_iqm, [values], rng, confidence, resamples)


def probability_of_improvement(
    scores: ArrayLike,
    baseline: ArrayLike,
    rng: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
) -> Interval:
    """Chance that a run scores higher than one of the baseline in an environment drawn at random; a tie is half a win.

    Args:
      scores, baseline: `[R, T]` and `[R', T]` runs in the same T environments.
    """
    first, second = _table(scores), _table(baseline)
    if first.shape[1] != second.shape[1]:
        raise ValueError(f"environments differ: {first.shape[1]} and {second.shape[1]}")
    interval = _interval(_improves, [first, second], rng, confidence, resamples)
    return interval._replace(n=min(len(first), len(second)))


def performance_profile(
    scores: ArrayLike,
    thresholds: ArrayLike,
    rng: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
) -> Profile:
    """Share of the runs that score above each threshold.

    Args:
      scores: `[R, T]`.
      thresholds: `[K]`.
    """
    values, thresholds = _table(scores), np.asarray(thresholds, float)

    def above(tables: np.ndarray) -> np.ndarray:
        return (tables[..., None] > thresholds).mean(axis=(-3, -2))

    drawn = above(_resampled(values, rng, resamples))
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
    return Profile(above(values), low, high, len(values))


def _table(scores: ArrayLike) -> np.ndarray:
    values = np.asarray(scores, float)
    if values.ndim != 2 or not values.size or np.isnan(values).any():
        raise ValueError(f"scores have shape {values.shape}: expected numbers [runs, environments], none missing")
    return values


def _iqm(tables: np.ndarray) -> np.ndarray:
    return trim_mean(tables.reshape(*tables.shape[:-2], -1), 0.25, axis=-1)


def _improves(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    a, b = first[..., :, None, :], second[..., None, :, :]
    return ((a > b) + 0.5 * (a == b)).mean(axis=(-3, -2, -1))


def _resampled(table: np.ndarray, rng: np.random.Generator, resamples: int) -> np.ndarray:
    """`[resamples, R, T]`: the runs of each environment drawn by themselves."""
    runs, environments = table.shape
    return table[rng.integers(runs, size=(resamples, runs, environments)), np.arange(environments)]


def _interval(
    statistic: Callable[..., np.ndarray],
    tables: list[np.ndarray],
    rng: np.random.Generator,
    confidence: float,
    resamples: int,
) -> Interval:
    drawn = statistic(*(_resampled(table, rng, resamples) for table in tables))
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(statistic(*tables)), float(low), float(high), len(tables[0]), RUNS)
