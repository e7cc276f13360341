"""The last observations of every environment together: what moves between two of them is seen."""

from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from rss_shield.agents.masks import action_masks

LONGEST = 64  # whatever is more is a mistake


class History(VectorWrapper):
    """Observations `[E, H, ...]`: the last H, the newest at the end.

    Where an episode begins, its first observation stands for those before it. On every kind of autoreset; with
    `reset(options={"reset_mask": mask})` as well.

    Args:
      env: any vector environment whose observations are arrays.
      length: H >= 1.

    Raises:
      ValueError: observations are no arrays.
    """

    def __init__(self, env: VectorEnv, length: int) -> None:
        super().__init__(env)
        if not isinstance(env.single_observation_space, Box):
            space = type(env.single_observation_space).__name__
            raise ValueError(f"history = {length}: observations are a {space}; expected arrays")
        self.length = length
        self.single_observation_space = batch_space(env.single_observation_space, length)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self._kept = np.zeros(self.observation_space.shape or (), self.observation_space.dtype)
        self._over = np.zeros(env.num_envs, bool)  # episodes whose next step is a reset

    def reset(self, *, seed: Any = None, options: dict | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes everywhere, or where `options["reset_mask"]` says so."""
        mask = (options or {}).get("reset_mask")
        begun = np.ones(self.num_envs, bool) if mask is None else np.array(mask, bool)
        observations, infos = self.env.reset(seed=seed, options=options)
        self._begin(begun, observations)
        return self._kept.copy(), infos

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """As the environment, `infos["final_obs"]` with its history as well."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        ended, mode = terminated | truncated, self.env.metadata.get("autoreset_mode")
        if mode == AutoresetMode.SAME_STEP and ended.any():
            infos = {**infos, "final_obs": self._final(infos["final_obs"], ended)}
        self._kept[:, :-1] = self._kept[:, 1:]
        self._kept[:, -1] = observations
        self._begin(ended if mode == AutoresetMode.SAME_STEP else self._over, observations)
        if mode == AutoresetMode.NEXT_STEP:
            self._over = ended
        return self._kept.copy(), rewards, terminated, truncated, infos

    def action_masks(self) -> np.ndarray:
        """What is permitted now, `[E, A]`: of environments that say so."""
        return action_masks(self.env)

    def _begin(self, begun: np.ndarray, observations: np.ndarray) -> None:
        self._kept[begun] = observations[begun][:, None]
        self._over = self._over & ~begun

    def _final(self, last: np.ndarray, ended: np.ndarray) -> np.ndarray:
        apart = last.dtype == object  # gymnasium's are, an array each; the engine's are one
        final = last.copy() if apart else np.repeat(last[:, None], self.length, axis=1)
        for e in np.flatnonzero(ended):
            final[e] = np.concatenate([self._kept[e, 1:], last[e][None]])
        return final


def with_history(env: VectorEnv, length: int) -> VectorEnv:
    """Environments whose observations are their last `length`; themselves where that is one."""
    return env if length == 1 else History(env, length)
