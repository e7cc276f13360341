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


# columns of semantic features, see `envs.semantic.outlook`
_VALID, _VALUE, _MEAN_SPEED = 0, 1, 4
_PROGRESS = 1e-3  # what decides between equal values


def best_value() -> Driver:
    """The semantic action that promises most, of features `[E, A, D]`; of several, the one that gets farthest."""

    def choose(rows: np.ndarray) -> np.ndarray:
        promised = rows[..., _VALUE] + _PROGRESS * rows[..., _MEAN_SPEED]
        return np.where(rows[..., _VALID] > 0.0, promised, -np.inf).argmax(axis=1)

    return choose


def any_valid(rng: np.random.Generator) -> Driver:
    """Draws one of the semantic actions that there are, each as likely, of features `[E, A, D]`."""

    def draw(rows: np.ndarray) -> np.ndarray:
        valid = rows[..., _VALID] > 0.0
        return np.where(valid, rng.random(valid.shape), -1.0).argmax(axis=1)

    return draw
