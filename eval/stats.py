"""Intervals for rates, means, medians and paired differences. One function per statistic."""

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

RESAMPLES = 9999


class Interval(NamedTuple):
    """A value with its confidence interval and the sample size behind it."""

    value: float  # NaN when n = 0
    low: float  # NaN where the sample says nothing about the spread (a mean of n < 2)
    high: float
    n: int


def wilson(k: int, n: int, confidence: float = 0.95) -> Interval:
    """Rate k / n with Wilson's score interval (Wilson 1927; Brown, Cai & DasGupta 2001).

    No successes and no failures need no special case, and n = 0 gives [0, 1].
    """
    if not 0 <= k <= n:
        raise ValueError(f"k = {k} is out of range: expected 0 <= k <= n = {n}")
    if n == 0:
        return Interval(np.nan, 0.0, 1.0, 0)
    bounds = stats.binomtest(k, n).proportion_ci(confidence, method="wilson")
    return Interval(k / n, float(bounds.low), float(bounds.high), n)


def clopper_pearson(k: int, n: int, confidence: float = 0.95) -> Interval:
    """Rate k / n with the exact interval of Clopper and Pearson (1934): it covers at least as often as it says.

    No trials give [0, 1].
    """
    if not 0 <= k <= n:
        raise ValueError(f"k = {k} is out of range: expected 0 <= k <= n = {n}")
    if n == 0:
        return Interval(np.nan, 0.0, 1.0, 0)
    bounds = stats.binomtest(k, n).proportion_ci(confidence, method="exact")
    return Interval(k / n, float(bounds.low), float(bounds.high), n)


def bootstrap_mean(sample: ArrayLike, rng: np.random.Generator, confidence: float = 0.95) -> Interval:
    """Mean with the BCa bootstrap interval (Efron 1987).

    Args:
      sample: [n].
      rng: draws the resamples.

    A sample whose values are all equal gets an interval of no width: the bootstrap knows only what it
    has seen.
    """
    return _bootstrap(np.asarray(sample, float), np.mean, "BCa", rng, confidence)


def bootstrap_median(sample: ArrayLike, rng: np.random.Generator, confidence: float = 0.95) -> Interval:
    """Median with the percentile bootstrap interval, which suits capped samples. sample: [n]."""
    return _bootstrap(np.asarray(sample, float), np.median, "percentile", rng, confidence)


def paired_difference(
    sample: ArrayLike, baseline: ArrayLike, rng: np.random.Generator, confidence: float = 0.95
) -> Interval:
    """Mean of sample - baseline, episode by episode, with the BCa interval; rates as 0 and 1.

    Args:
      sample, baseline: [n], entry i of both from the same seed.
    """
    sample, baseline = np.asarray(sample, float), np.asarray(baseline, float)
    if sample.shape != baseline.shape:
        raise ValueError(f"paired samples differ in length: {sample.size} and {baseline.size}")
    return bootstrap_mean(sample - baseline, rng, confidence)


def _bootstrap(sample: np.ndarray, statistic, method: str, rng: np.random.Generator, confidence: float) -> Interval:
    n = sample.size
    if n == 0:
        return Interval(np.nan, np.nan, np.nan, 0)
    value = float(statistic(sample))
    if n == 1:
        return Interval(value, np.nan, np.nan, 1)
    if np.ptp(sample) == 0:
        return Interval(value, value, value, n)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        bounds = stats.bootstrap(
            (sample,),
            statistic,
            n_resamples=RESAMPLES,
            batch=500,
            vectorized=True,
            confidence_level=confidence,
            method=method,
            rng=rng,
        ).confidence_interval
    if np.isnan(bounds.low) or np.isnan(bounds.high):  # BCa fails on some near-constant samples
        return _bootstrap(sample, statistic, "percentile", rng, confidence)
    return Interval(value, float(bounds.low), float(bounds.high), n)
