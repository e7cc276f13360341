"""A task without training: a scripted policy, or one of the user's own, on a row of episodes."""

from collections.abc import Callable
from difflib import get_close_matches
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from gymnasium import Space
from gymnasium.envs.registration import registry
from gymnasium.vector import AutoresetMode

from rss_shield.envs.configuration import default_config
from rss_shield.envs.fast.measured import columns
from rss_shield.envs.make import make
from rss_shield.envs.make_vec import make_vec
from rss_shield.eval.own import driver_named, is_own
from rss_shield.eval.rollout import evaluate, run_episode
from rss_shield.eval.runs.store import Files
from rss_shield.eval.suite.policies import Scripted
from rss_shield.eval.suite.scored import columns_of, scored
from rss_shield.eval.suite.setup import setup_of

SIDE_BY_SIDE = 256  # episodes in the engine


def scripted_task(config: dict[str, Any]) -> Files:
    """The episodes of a task; see `eval.runs.tasks.tasks_of`."""
    frame = play(config["environment"], config["policy"], config["options"], seeds_of(config))
    return {"episodes.csv": frame.to_csv(index=False).encode()}


def check_environment(environment: str) -> None:
    """Is there such an environment?

    Raises:
      ValueError: there is none; the message says the nearest.
    """
    try:
        default_config(environment)
    except (ValueError, ImportError) as error:
        if environment in registry or ":" in environment:
            raise ValueError(str(error)) from None
        ours = [name for name, spec in registry.items() if "highway_env" in str(spec.entry_point)]
        nearest = get_close_matches(environment, ours, n=1, cutoff=0.0)[0]
        raise ValueError(f"there is no environment {environment!r}; the nearest is {nearest!r}") from None


def check_played(environment: str, policy: str, options: dict[str, Any]) -> None:
    """Refuse what `play` could not begin.

    Raises:
      ValueError: options that the environment or its backend has not, or a policy that has no such actions.
    """
    arguments = setup_of(environment, options)
    arguments.pop("reward", "")
    try:
        space = _space(environment, arguments.pop("backend"), arguments)
        if not is_own(policy):
            Scripted(policy, space, 0)
    except Exception as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        given = ", ".join(f"{name} = {value}" for name, value in options.items())
        raise ValueError(f"{kind}{error} ({environment}{', ' if given else ''}{given})") from error


def _space(environment: str, backend: str, arguments: dict[str, Any]) -> Space:
    """The actions of one agent in environments built like that."""
    if backend == "highway-env":
        env = make(environment, **arguments)
        env.close()
        return env.action_space
    arguments = {name: value for name, value in arguments.items() if name != "measures"}
    batch = make_vec(environment, 1, autoreset_mode=AutoresetMode.DISABLED, **arguments)
    batch.close()
    return batch.single_action_space


def seeds_of(config: dict[str, Any]) -> range:
    """Seeds of a task's episodes: the same for all tasks of an experiment with the same seed, none twice."""
    first = config["first_seed"] + config["seed"] * config["episodes"]
    return range(first, first + config["episodes"])


def play(environment: str, policy: str, options: dict[str, Any], seeds: range) -> pd.DataFrame:
    """One row per episode; columns as in `eval.rollout.run_episode`."""
    arguments = setup_of(environment, options)
    backend, reward = arguments.pop("backend"), arguments.pop("reward", "")
    space = _space(environment, backend, arguments)
    own = driver_named(policy, actions=space) if is_own(policy) else None
    if backend == "highway-env":

        def driver(seed: int) -> Callable[[Any], Any]:
            return Scripted(policy, space, seed) if own is None else lambda seen: own(np.asarray(seen)[None])[0]

        return pd.DataFrame([run_episode(lambda: make(environment, **arguments), driver(seed), seed) for seed in seeds])

    measured = arguments.pop("measures", False)

    def batch(n: int) -> Any:
        env: Any = make_vec(environment, n, autoreset_mode=AutoresetMode.DISABLED, **arguments)
        if measured:
            env.recording.choose(range(n))
        return env

    chunks = [seeds[i : i + SIDE_BY_SIDE] for i in range(0, len(seeds), SIDE_BY_SIDE)]
    frames = []
    for chunk in chunks:
        # as many environments as episodes, so each plays the one of its own policy
        drivers = own or partial(_act, [Scripted(policy, space, seed) for seed in chunk])
        frames.append(
            evaluate(
                scored(batch, reward),
                drivers,
                chunk,
                n_envs=len(chunk),
                keep_actions=False,
                more=(lambda env, e: columns(env, e) | columns_of(env, e)) if measured else columns_of,
            )
        )
    return pd.concat(frames, ignore_index=True).drop(columns="actions")


def _act(each: list[Scripted], observations: np.ndarray) -> np.ndarray:
    return np.array([act() for act in each])
