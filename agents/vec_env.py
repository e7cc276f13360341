"""A gymnasium vector environment as a stable-baselines3 `VecEnv`."""

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv


class VectorEnvAdapter(VecEnv):
    """Lets stable-baselines3 train on a `gymnasium.vector.VectorEnv`.

    The list of infos holds a dictionary of its own only where an episode ended, with
    `terminal_observation`, `TimeLimit.truncated` and what the vector environment's `final_info` says
    (so `episode` reaches SB3's logger). Everything about a step is in `last_infos`, as arrays.

    Args:
      env: a vector environment with autoreset in the same step.
    """

    def __init__(self, env: VectorEnv) -> None:
        mode = env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode = {mode}: expected {AutoresetMode.SAME_STEP}")
        self.env = env
        self.last_infos: dict = {}
        self._seed: int | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self):
        observations, self.last_infos = self.env.reset(seed=self._seed)
        self._seed = None
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
        ended = terminated | truncated
        nothing: dict = {}
        list_of_infos = [nothing] * self.num_envs
        for e in np.flatnonzero(ended).tolist():
            info = one(infos["final_info"], e)
            info["terminal_observation"] = infos["final_obs"][e]
            info["TimeLimit.truncated"] = bool(truncated[e] and not terminated[e])
            list_of_infos[e] = info
        return observations, rewards.astype(np.float32), ended, list_of_infos

    def close(self) -> None:
        self.env.close()

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None) -> None:
        raise NotImplementedError("the environments of a vector environment share their attributes")

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
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
