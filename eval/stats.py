"""Intervals for rates, means, medians and paired differences. One function per statistic."""

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

MANY = 5000
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

    For more than `MANY` values with that of the central limit theorem, which it comes to: BCa leaves out each value in
    turn, so its time grows with the square of their number.

    Args:
      sample: [n].
      rng: draws the resamples.

    A sample whose values are all equal gets an interval of no width: the bootstrap knows only what it
    has seen.
    """
    values = np.asarray(sample, float)
    if values.size > MANY and np.ptp(values) > 0.0:
        low, high = stats.norm.interval(confidence, values.mean(), stats.sem(values))
        return Interval(float(values.mean()), float(low), float(high), values.size)
    return _bootstrap(values, np.mean, "BCa", rng, confidence)


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


def completion_weights(lengths: ArrayLike, cut: ArrayLike) -> np.ndarray:
    """What each finished episode stands for when others were cut off before their end.

    An episode that is cut off passes its weight on, in equal parts, to those that lasted longer
    (Efron 1967); these are the steps of Kaplan and Meier's estimator (1958). Cutting off must not depend
    on how an episode would have gone on.

    Args:
      lengths: [n], how long each was watched.
      cut: [n], was it cut off?

    Returns:
      [n], 0 for those cut off. The sum is 1, less what episodes stand for that were cut off later than
      any other ended.
    """
    lengths, cut = np.asarray(lengths, float), np.asarray(cut, bool)
    if not lengths.size:
        return np.zeros(0)
    lasting = stats.ecdf(stats.CensoredData.right_censored(lengths, cut)).sf
    steps = -np.diff(lasting.probabilities, prepend=1.0)
    step = np.searchsorted(lasting.quantiles, lengths)
    finished = np.bincount(step, weights=~cut, minlength=steps.size)
    return np.where(cut, 0.0, steps[step] / np.maximum(finished[step], 1.0))


def weighted_rate(sample: ArrayLike, weights: ArrayLike, confidence: float = 0.95) -> Interval:
    """Rate of a weighted 0/1 sample [n] with Wilson's interval for as many equally weighted values as it is worth.

    What the weights lack to 1 may be anything: the interval makes room for it.
    """
    sample, weights = np.asarray(sample, float), np.asarray(weights, float)
    total = float(weights.sum())
    if not total:
        return Interval(np.nan, 0.0, 1.0, sample.size)
    value = min(float(sample @ weights) / total, 1.0)
    worth = round(total**2 / float(weights @ weights))  # Kish's effective size; n if all weigh the same
    interval = wilson(round(value * worth), worth, confidence)
    low, high = min(interval.low, value), max(interval.high, value)
    return Interval(value, low * total, min(high * total + 1.0 - total, 1.0), sample.size)


def weighted_mean(sample: ArrayLike, weights: ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean of a weighted sample [n] with the normal interval of its linearised variance."""
    sample, weights = np.asarray(sample, float), np.asarray(weights, float)
    total = float(weights.sum())
    if not total:
        return Interval(np.nan, np.nan, np.nan, sample.size)
    value = float(sample @ weights) / total
    if np.count_nonzero(weights) < 2:
        return Interval(value, np.nan, np.nan, sample.size)
    error = float(np.sqrt(weights**2 @ (sample - value) ** 2)) / total
    low, high = value + error * np.array(stats.norm.interval(confidence))
    return Interval(value, float(low), float(high), sample.size)


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
