"""A value, how well it is known, and over what."""

from typing import NamedTuple

EPISODES = "episodes"  # of these agents: what other test episodes would give
SEEDS = "seeds and episodes"  # what training with other seeds would give, on other test episodes
RUNS = "runs"  # of a table of runs x environments


class Interval(NamedTuple):
    """A value with its confidence interval, the sample size behind it, and what that is a sample of."""

    value: float  # NaN when n = 0
    low: float  # NaN where the sample says nothing about the spread (a mean of n < 2)
    high: float
    n: int
    over: str = EPISODES
