"""A gymnasium vector environment as a stable-baselines3 `VecEnv`."""

from typing import Protocol

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv

from rss_shield.agents.masks import MASKS, action_masks
from rss_shield.agents.own_reward import Reward, rewards_by, told_by


class Charge(Protocol):
    """What is taken off the rewards of a training."""

    def begin(self) -> None:
        """All environments begin an episode."""

    def __call__(self, env: "VectorEnvAdapter") -> np.ndarray:
        """Of the last decision, `[E]`."""


class VectorEnvAdapter(VecEnv):
    """Lets stable-baselines3 train on a `gymnasium.vector.VectorEnv`.

    The list of infos holds a dictionary of its own only where an episode ended, with
    `terminal_observation`, `TimeLimit.truncated` and what the vector environment's `final_info` says
    (so `episode` reaches SB3's logger). Everything about a step is in `last_infos`, as arrays; `told` has single
    values of the decision that was made, also where an episode ended.

    Args:
      env: a vector environment with autoreset in the same step.
      charge: taken off the rewards; None = nothing.
    """

    autoreset_mode = AutoresetMode.SAME_STEP

    def __init__(self, env: VectorEnv, charge: Charge | None = None) -> None:
        mode = env.metadata.get("autoreset_mode")
        if mode != self.autoreset_mode:
            raise ValueError(f"autoreset_mode = {mode}: expected {self.autoreset_mode}")
        self.env = env
        self.charge = charge
        # takes the place of the environment's rewards, before anything is charged
        self.reward: Reward | None = None
        self.last_infos: dict = {}
        self.returns = np.zeros(env.num_envs)  # of the episodes so far, before anything is charged
        self.ended = np.zeros(env.num_envs, bool)  # by the last step
        self.truncated = np.zeros(env.num_envs, bool)
        self._seed: int | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self):
        observations, self.last_infos = self.env.reset(seed=self._seed)
        self._seed = None
        self.ended, self.truncated = np.zeros((2, self.num_envs), bool)
        self.returns = np.zeros(self.num_envs)
        if self.charge is not None:
            self.charge.begin()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observations

    def seed(self, seed: int | None = None):
        """Environment e starts with seed + e at the next reset."""
        self._seed = int(np.random.SeedSequence(seed).generate_state(1)[0]) if seed is None else seed
        return [self._seed + e for e in range(self.num_envs)]

    def step_async(self, actions) -> None:
        self._actions = actions

    def step_wait(self):
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        self.last_infos = infos
        self.ended, self.truncated = terminated | truncated, truncated & ~terminated
        charged = self._charged_by_environment(rewards)
        if self.reward is not None:
            rewards = rewards_by(self.reward, rewards, self._actions, infos, self.ended)
        self.returns += rewards + charged
        nothing: dict = {}
        list_of_infos = [nothing] * self.num_envs
        for e in np.flatnonzero(self.ended).tolist():
            info = one(infos["final_info"], e)
            info["terminal_observation"] = infos["final_obs"][e]
            info["TimeLimit.truncated"] = bool(self.truncated[e])
            info["episode"] = {**info["episode"], "r": self.returns[e]}
            self.returns[e] = 0.0
            list_of_infos[e] = info
        return observations, self._charged(rewards), self.ended, list_of_infos

    def _charged_by_environment(self, rewards: np.ndarray) -> np.ndarray | float:
        """The intervention penalty that the environment has taken off its rewards, `[E]`."""
        if "raw_reward" not in self.last_infos and "raw_reward" not in self.last_infos.get("final_info", {}):
            return 0.0  # nobody watches
        return np.asarray(self.told("raw_reward"), float) - rewards

    def _charged(self, rewards: np.ndarray) -> np.ndarray:
        rewards = np.array(rewards, np.float32)
        if self.charge is not None:
            rewards -= self.charge(self)
        return rewards

    def told(self, *keys: str) -> np.ndarray:
        """What infos say about the last decision of every environment, e.g. `told("shield", "override_fraction")`.

        Returns:
          `[E]`; where an episode ended, of its last decision and not of the episode that began.
        """
        return told_by(self.last_infos, self.ended)(*keys)

    def close(self) -> None:
        self.env.close()

    def has_attr(self, attr_name: str) -> bool:
        return attr_name == MASKS or hasattr(self.env, attr_name)  # whoever has no masks says so when asked

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None) -> None:
        raise NotImplementedError("the environments of a vector environment share their attributes")

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """The answers of single environments, as a list.

        `action_masks()` is asked for once, and answers for all: its rows `[A]` are returned.
        """
        if method_name == MASKS:
            masks = action_masks(self.env)
            return [masks[e] for e in self._get_indices(indices)]
        method = getattr(self.env, method_name)
        return [method(e, *method_args, **method_kwargs) for e in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))


def one(infos: dict, e: int) -> dict:
    """Infos of environment `e` out of dictionaries of arrays, without the "_name" marks."""
    return {
        name: one(values, e) if isinstance(values, dict) else values[e]
        for name, values in infos.items()
        if not name.startswith("_")
    }
