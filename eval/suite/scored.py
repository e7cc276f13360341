"""Environments whose episodes are also counted in a reward of one's own; what they pay stays as it is."""

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper

from rss_shield.agents.masks import action_masks
from rss_shield.agents.own_reward import Reward, rewards_by
from rss_shield.eval.own import blaming, function_named

COLUMN = "own_return"


class Scored(VectorWrapper):
    """Around environments without autoreset, as `eval.rollout.evaluate` plays them.

    Args:
      function: the reward, see `agents.own_reward.Decision`.
    """

    def __init__(self, env: VectorEnv, function: Reward) -> None:
        super().__init__(env)
        self.function = function
        self.sums = np.zeros(env.num_envs)

    def reset(self, *, seed: Any = None, options: dict | None = None) -> Any:
        begun = (options or {}).get("reset_mask")
        self.sums[slice(None) if begun is None else begun] = 0.0
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: Any) -> Any:
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        self.sums += rewards_by(self.function, rewards, actions, infos, terminated | truncated)
        return observations, rewards, terminated, truncated, infos

    def action_masks(self) -> np.ndarray:
        """What is permitted now, `[E, A]`: of environments that say so."""
        return action_masks(self.env)


def scored(make_vec: Callable[[int], Any], name: str) -> Callable[[int], Any]:
    """What builds environments, around each batch of which `Scored` is put if a reward is named.

    Args:
      name: "module:function", or "".
    """
    if not name:
        return make_vec
    function = blaming(function_named(name), name)
    return lambda n_envs: Scored(make_vec(n_envs), function)


def columns_of(env: Any, e: int) -> dict[str, float]:
    """What `Scored` knows of environment `e`, whose episode has just ended; nothing of other environments."""
    return {COLUMN: float(env.sums[e])} if isinstance(env, Scored) else {}
