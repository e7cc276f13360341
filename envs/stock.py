"""highway-env's environments as they are, except that every episode ends."""

from typing import Any

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
from gymnasium.wrappers import TimeLimit

LONGEST_EPISODE = 100  # decisions, where highway-env sets no limit


def make_stock(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with a `TimeLimit` where there is no limit.

    highway-env ends a merge when the ego is past it. An ego that has stopped behind a wreck never is.
    """
    env = gym.make(env_id, **kwargs)
    limited = env.spec is not None and env.spec.max_episode_steps is not None
    if limited or "duration" in getattr(env.unwrapped, "config", {"duration": None}):
        return env
    return TimeLimit(env, LONGEST_EPISODE)
