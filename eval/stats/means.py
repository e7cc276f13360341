"""Intervals for means and medians of one fixed agent, over its episodes; and for the few values of training seeds."""

import warnings

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from rss_shield.eval.stats.interval import Interval

MANY = 5000
RESAMPLES = 9999


def bootstrap_mean(sample: ArrayLike, rng: np.random.Generator, confidence: float = 0.95) -> Interval:
    """Mean with the BCa bootstrap interval (Efron 1987).

    For more than `MANY` values with that of the central limit theorem, which it comes to: BCa leaves out each value in
    turn, so its time grows with the square of their number.

    Args:
      sample: [n].
      rng: draws the resamples.

    A sample whose values are all equal gets an interval of no width: the bootstrap knows only what it
    has seen.

    Raises:
      ValueError: a value is not known.
    """
    values = _known(sample)
    if values.size > MANY and np.ptp(values) > 0.0:
        low, high = stats.norm.interval(confidence, values.mean(), stats.sem(values))
        return Interval(float(values.mean()), float(low), float(high), values.size)
    return _bootstrap(values, np.mean, "BCa", rng, confidence)


def bootstrap_median(sample: ArrayLike, rng: np.random.Generator, confidence: float = 0.95) -> Interval:
    """Median with the percentile bootstrap interval, which suits capped samples. sample: [n], all of them known."""
    return _bootstrap(_known(sample), np.median, "percentile", rng, confidence)


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


def student(sample: ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean with Student's t interval, for the few values that training seeds give. sample: [n]."""
    sample = np.asarray(sample, float)
    n = sample.size
    if n < 2:
        return Interval(float(sample.mean()) if n else np.nan, np.nan, np.nan, n)
    mean = float(sample.mean())
    if np.ptp(sample) == 0:
        return Interval(mean, mean, mean, n)
    bounds = stats.ttest_1samp(sample, 0.0).confidence_interval(confidence)
    return Interval(mean, float(bounds.low), float(bounds.high), n)


def _known(sample: ArrayLike) -> np.ndarray:
    """`[n]` numbers, infinite ones among them: a minimum over nothing is infinite, but has been measured."""
    values = np.asarray(sample, float)
    unknown = np.flatnonzero(np.isnan(values))
    if unknown.size:
        raise ValueError(f"sample[{unknown[0]}] = nan: expected numbers; leave out what is not known")
    return values


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
    if method == "BCa" and (np.isnan(bounds.low) or np.isnan(bounds.high)):  # BCa fails on some near-constant samples
        return _bootstrap(sample, statistic, "percentile", rng, confidence)
    return Interval(value, float(bounds.low), float(bounds.high), n)
