"""highway-env's environments as they are, except that every episode ends."""

import warnings
from typing import Any

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
from gymnasium.wrappers import TimeLimit

LONGEST_EPISODE = 100  # decisions, where highway-env sets no limit


def make_stock(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with a `TimeLimit` where there is no limit.

    highway-env ends a merge when the ego is past it. An ego that has stopped behind a wreck never is.
    That there is a later version of an environment asked for by its version is not said, once for each of a batch.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*is out of date", DeprecationWarning)
        env = gym.make(env_id, **kwargs)
    limited = env.spec is not None and env.spec.max_episode_steps is not None
    if limited or "duration" in getattr(env.unwrapped, "config", {"duration": None}):
        return env
    return TimeLimit(env, LONGEST_EPISODE)
