"""Intervals for the rate of one fixed agent, over its episodes."""

import numpy as np
from scipy import stats

from rss_shield.eval.stats.interval import Interval


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
