"""Seeds x episodes: the bootstrap that draws training seeds, and then episodes of each."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from rss_shield.eval.stats.interval import SEEDS, Interval

RESAMPLES = 2000
MOST = 2_000_000  # numbers in memory at a time
Statistic = Callable[..., Any]  # of `[..., K]`, called with axis=-1


def cluster_bootstrap(
    seeds: Sequence[ArrayLike],
    rng: np.random.Generator,
    statistic: Statistic = np.mean,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
) -> Interval:
    """The mean over training seeds of a statistic of their episodes, with an interval over both.

    A resample draws S seeds, then of each drawn one as many episodes as it has (Davison & Hinkley 1997, sec. 3.8). They
    give the standard error, times sqrt(S / (S - 1)) for what drawing from S seeds lacks; the interval is Student's t
    with S - 1 degrees of freedom around the value. Percentiles of the resamples would be far too narrow for the three
    to ten seeds of a training campaign. The factor multiplies what the episodes scatter within a seed, too, which needs
    no correction: where seeds agree as well as their episodes permit, the variance is 1 + S / (S - 1) times too large,
    so the interval is sqrt(3) times too wide for two seeds, 1.58 times for three and sqrt(2) times for many; never one
    without width.

    Args:
      seeds: S samples, `[K_s]` episodes each.
      rng: draws the resamples.
      statistic: of the last axis; its mean over seeds is what is estimated.

    Returns:
      n is the number of seeds. Bounds are NaN for fewer than two.

    Raises:
      ValueError: a seed without episodes.
    """
    samples = _samples(seeds)
    count = len(samples)
    if count == 0:
        return Interval(np.nan, np.nan, np.nan, 0, SEEDS)
    value = float(np.mean([statistic(sample, axis=-1) for sample in samples]))
    if count == 1:
        return Interval(value, np.nan, np.nan, 1, SEEDS)
    drawn = rng.integers(count, size=(resamples, count))
    values = np.zeros((resamples, count))
    for s, sample in enumerate(samples):
        here = drawn == s
        episodes = rng.integers(sample.size, size=(int(here.sum()), sample.size))
        values[here] = statistic(sample[episodes], axis=-1)
    return _student(value, values.mean(axis=1), count, confidence)


def pooled_bootstrap(
    seeds: Sequence[ArrayLike],
    rng: np.random.Generator,
    statistic: Statistic = np.mean,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
) -> Interval:
    """A statistic of the episodes of all training seeds together, with an interval over seeds and episodes.

    As `cluster_bootstrap`, but an episode weighs the same whichever seed it is of. For means of equally many episodes
    per seed both are the same; the median of all episodes is not the mean of the seeds' medians.

    Args:
      seeds: S samples, `[K_s]` episodes each.
      rng: draws the resamples.
      statistic: of the last axis.

    Returns:
      n is the number of seeds. Bounds are NaN for fewer than two.

    Raises:
      ValueError: a seed without episodes.
    """
    samples = _samples(seeds)
    count = len(samples)
    if count < 2 or (statistic is np.mean and len({sample.size for sample in samples}) == 1):
        return cluster_bootstrap(samples, rng, statistic, confidence, resamples)
    value = float(statistic(np.concatenate(samples), axis=-1))
    drawn = rng.integers(count, size=(resamples, count))
    if len({sample.size for sample in samples}) == 1:
        table, size = np.stack(samples), samples[0].size
        together = max(MOST // table.size, 1)  # resamples at once
        parts = [drawn[first : first + together] for first in range(0, resamples, together)]
        picked = (
            np.take_along_axis(table[part], rng.integers(size, size=(*part.shape, size)), axis=2) for part in parts
        )
        values = np.concatenate([statistic(part.reshape(len(part), -1), axis=-1) for part in picked])
    else:
        rows = (np.concatenate([rng.choice(samples[s], samples[s].size) for s in row]) for row in drawn)
        values = np.array([statistic(row, axis=-1) for row in rows], float)
    return _student(value, values, count, confidence)


def _samples(seeds: Sequence[ArrayLike]) -> list[np.ndarray]:
    samples = [np.asarray(sample, float) for sample in seeds]
    if not all(sample.size for sample in samples):
        raise ValueError(f"episodes per seed = {[sample.size for sample in samples]}: expected at least 1 each")
    return samples


def _student(value: float, resampled: np.ndarray, count: int, confidence: float) -> Interval:
    """Student's t around a value, by the standard error that resamples of `count` seeds give."""
    error = float(resampled.std()) * np.sqrt(count / (count - 1))
    reach = float(stats.t.ppf(0.5 + confidence / 2, count - 1)) * error
    return Interval(value, value - reach, value + reach, count, SEEDS)


def cluster_difference(
    seeds: Sequence[ArrayLike],
    baseline: Sequence[ArrayLike],
    rng: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
) -> Interval:
    """Mean over seeds of the mean of sample - baseline, episode by episode, over seeds and episodes.

    Args:
      seeds, baseline: S samples each; entry i of both is of one test episode.

    Raises:
      ValueError: numbers of seeds or episodes that differ.
    """
    shapes = [np.shape(sample) for sample in seeds], [np.shape(sample) for sample in baseline]
    if shapes[0] != shapes[1]:
        raise ValueError(f"paired samples differ in shape: {shapes[0]} and {shapes[1]}")
    differences = [np.asarray(a, float) - np.asarray(b, float) for a, b in zip(seeds, baseline, strict=True)]
    return cluster_bootstrap(differences, rng, np.mean, confidence, resamples)
