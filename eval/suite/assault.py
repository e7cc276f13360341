"""Policies that look for a fault of the shield, for many environments of the engine at once."""

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces

POLICIES = ("random", "faster", "slower", "switching", "greedy")  # of meta-actions
FREE = ("bang-bang", "wild")  # steering and acceleration
CONTINUOUS = {"action": {"type": "ContinuousAction"}}
STEERED = ("highway-v0", "highway-fast-v0", "exit-v0", "exit-v1")  # where the engine has these
_CHANGES = 0.2  # chance per decision that a switching policy takes another action

Act = Callable[[np.ndarray], np.ndarray]


def policy_of(name: str, env: Callable[[], Any], rng: np.random.Generator) -> Act:
    """A policy by name.

    random: any action. faster, slower: always that. switching: an action for a while, then another. greedy: the action
    after which somebody is nearest to danger, tried out on a copy of the state; one in ten is random. bang-bang: full
    throttle or full brakes and the wheels turned all the way to either side, each for a while. wild: any command.

    Args:
      name: one of `POLICIES` and `FREE`.
      env: gives the `FastVectorEnv` that is played, which has meta-actions for the first and commands for the others.
      rng: for everything drawn.

    Raises:
      ValueError: an unknown name.
    """
    if name not in _POLICIES:
        raise ValueError(f"policy = {name!r}: expected one of {', '.join(_POLICIES)}")
    return _POLICIES[name](env, rng)


def _count(env: Callable[[], Any]) -> int:
    space = env().single_action_space
    assert isinstance(space, spaces.Discrete)
    return int(space.n)


def _random(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return lambda seen: rng.integers(_count(env), size=len(seen))


def _faster(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return lambda seen: np.full(len(seen), 3 if _count(env) == 5 else 2)


def _slower(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return lambda seen: np.full(len(seen), 4 if _count(env) == 5 else 0)


def _switching(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return _held(rng, lambda count: rng.integers(_count(env), size=count))


def _bang_bang(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return _held(rng, lambda count: rng.choice([-1.0, 1.0], size=(count, 2)).astype(np.float32))


def _wild(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    return lambda seen: rng.uniform(-1.0, 1.0, (len(seen), 2)).astype(np.float32)


def _held(rng: np.random.Generator, draw: Callable[[int], np.ndarray]) -> Act:
    """Each drawn action stays for a while."""
    last: dict[int, np.ndarray] = {}

    def act(seen: np.ndarray) -> np.ndarray:
        drawn = draw(len(seen))
        kept = last.get(len(seen), drawn)
        changes = rng.random(len(seen)) < _CHANGES
        last[len(seen)] = np.where(changes.reshape(-1, *[1] * (drawn.ndim - 1)), drawn, kept)
        return last[len(seen)]

    return act


def _greedy(env: Callable[[], Any], rng: np.random.Generator) -> Act:
    def act(seen: np.ndarray) -> np.ndarray:
        engine, count = env().engine, _count(env)
        before, last = [array.copy() for array in _arrays(engine)], engine._seen
        nearest = np.empty((count, len(seen)))
        for action in range(count):
            steps = engine.step(np.full(len(seen), action, np.int64)).steps
            nearest[action] = np.maximum(steps["margin_lon"], steps["margin_lat"])
            nearest[action] = np.where(np.isfinite(nearest[action]), nearest[action], 1e3 + _separation(engine))
            for array, value in zip(_arrays(engine), before, strict=True):
                array[...] = value
        engine._seen = last
        drawn = rng.integers(count, size=len(seen))
        return np.where(rng.random(len(seen)) < 0.1, drawn, nearest.argmin(axis=0))

    return act


def _arrays(engine: Any) -> list[np.ndarray]:
    """All that a decision changes."""
    batch = engine.batch
    held = [batch.cars, batch.episodes, batch.order, batch.rides, batch.crossings]
    return [array for array in [*held, *(batch.past or ())] if array is not None]


def _separation(engine: Any) -> np.ndarray:
    """Distance of each ego to the nearest other, centre to centre, `[E]` [m]."""
    cars, egos = engine.batch.cars, engine.batch.episodes["ego"]
    row = np.arange(len(cars))
    far = np.hypot(cars["x"] - cars["x"][row, egos][:, None], cars["y"] - cars["y"][row, egos][:, None])
    absent = np.arange(cars.shape[1]) >= engine.batch.episodes["cars"][:, None]
    far[absent | (np.arange(cars.shape[1]) == egos[:, None])] = 1e3
    return far.min(axis=1)


_POLICIES: dict[str, Callable[[Callable[[], Any], np.random.Generator], Act]] = {
    "random": _random,
    "faster": _faster,
    "slower": _slower,
    "switching": _switching,
    "greedy": _greedy,
    "bang-bang": _bang_bang,
    "wild": _wild,
}
