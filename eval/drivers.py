"""Drivers that learn nothing, as policies: observations `[E, ...]` -> discrete actions `[E]`."""

from collections.abc import Callable

import numpy as np

Driver = Callable[[np.ndarray], np.ndarray]


def always(action: int) -> Driver:
    """Takes one action for ever."""
    return lambda observations: np.full(len(observations), action)


def uniform(actions: int, rng: np.random.Generator) -> Driver:
    """Draws one of `actions` actions, each as likely."""
    return lambda observations: rng.integers(actions, size=len(observations))
