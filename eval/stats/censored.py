"""Episodes of training that were cut off: what each finished one stands for, and rates and means of such samples."""

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from rss_shield.eval.stats.interval import Interval
from rss_shield.eval.stats.rates import wilson


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
