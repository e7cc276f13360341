"""The configuration of an environment by its name: what it is, and a check that a given one is of that kind."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import gymnasium as gym

from rss_shield.envs.known import check_known
from rss_shield.envs.stock import make_stock, reward_names


def default_config(env_id: str) -> dict[str, Any]:
    """The configuration of an environment that is not told otherwise.

    Raises:
      ValueError: unknown environment, or one that has no configuration.
    """
    return _made(env_id).config


def check_config(env_id: str, config: Mapping[str, Any]) -> None:
    """Refuse what the environment would ignore, and values that it cannot run with.

    Args:
      config: what replaces the environment's defaults, as for `gymnasium.make`.

    Raises:
      ValueError: names the key and the nearest known one, or key, value and what is expected.
    """
    check_known(env_id, type(_made(env_id)), config, partial(reward_names, env_id))


def _made(env_id: str) -> Any:
    try:
        env = make_stock(env_id)
    except gym.error.Error as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    env.close()
    if not isinstance(getattr(env.unwrapped, "config", None), dict):
        raise ValueError(f"env_id = {env_id!r}: expected an environment of highway-env; this one has no configuration")
    return env.unwrapped
