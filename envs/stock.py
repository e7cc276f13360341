"""highway-env's environments as they are, except that every episode ends."""

import warnings
from typing import Any

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
from gymnasium.wrappers import TimeLimit

from envs.arguments import whole

LONGEST_EPISODE = 100  # decisions, where highway-env sets no limit


def make_stock(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with a `TimeLimit` where there is no limit.

    highway-env ends a merge when the ego is past it. An ego that has stopped behind a wreck never is.
    That there is a later version of an environment asked for by its version is not said, once for each of a batch.

    Raises:
      ValueError: an argument that the environment does not have, or a bad `max_episode_steps`.
    """
    if kwargs.get("max_episode_steps") is not None:
        kwargs["max_episode_steps"] = whole("max_episode_steps", kwargs["max_episode_steps"], 1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*is out of date", DeprecationWarning)
        try:
            env = gym.make(env_id, **kwargs)
        except TypeError as error:
            unknown = [name for name in kwargs if f"unexpected keyword argument '{name}'" in str(error)]
            if not unknown:
                raise
            given = ", ".join(f"{name} = {kwargs[name]!r}" for name in unknown)
            raise ValueError(f"{given}: unknown here; expected config, render_mode or max_episode_steps") from None
    limited = env.spec is not None and env.spec.max_episode_steps is not None
    if limited or "duration" in getattr(env.unwrapped, "config", {"duration": None}):
        return env
    return TimeLimit(env, LONGEST_EPISODE)
