"""Two fixed agents on the same episodes: do they fail on the same ones?"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from statsmodels.stats.contingency_tables import mcnemar as contingency


class Discordant(NamedTuple):
    """Episodes on which exactly one of two agents had the outcome, and McNemar's test of whether that is chance."""

    only_first: int
    only_second: int
    n: int  # episodes
    p: float  # two-sided, exact: of so uneven a split if both were equally likely to be the one


def mcnemar(first: ArrayLike, second: ArrayLike) -> Discordant:
    """McNemar's exact test (1947) of two agents' outcomes.

    Args:
      first, second: `[n]` 0 or 1, entry i of both from the same episode.

    Raises:
      ValueError: samples of different lengths.
    """
    first, second = np.asarray(first, bool), np.asarray(second, bool)
    if first.shape != second.shape:
        raise ValueError(f"paired samples differ in length: {first.size} and {second.size}")
    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    only_first, only_second = int((first & ~second).sum()), int((~first & second).sum())
    p = float(contingency([[both, only_first], [only_second, neither]], exact=True).pvalue)
    return Discordant(only_first, only_second, first.size, p)
