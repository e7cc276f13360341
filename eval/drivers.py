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


# rows of semantic features begin with these two, see `envs.semantic.outlook`
_VALID, _VALUE = 0, 1


def best_value() -> Driver:
    """The semantic action that promises most, of features `[E, A, D]`; the first of several."""
    return lambda rows: np.where(rows[..., _VALID] > 0.0, rows[..., _VALUE], -np.inf).argmax(axis=1)


def any_valid(rng: np.random.Generator) -> Driver:
    """Draws one of the semantic actions that there are, each as likely, of features `[E, A, D]`."""

    def draw(rows: np.ndarray) -> np.ndarray:
        valid = rows[..., _VALID] > 0.0
        return np.where(valid, rng.random(valid.shape), -1.0).argmax(axis=1)

    return draw
