"""What a learner is made of, and the learners by name.

A learner is one file: `agents/ppo.py`, or one of `agents/baselines/`. It has a function `learner(**settings)`.
"""

import importlib
import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

from gymnasium.vector import VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from rss_shield.agents.vec_env import VectorEnvAdapter

# name -> where it is
LEARNERS = {
    "ppo": "rss_shield.agents.ppo",
    "shaped-ppo": "rss_shield.agents.baselines.shaped_ppo",
    "adaptive-ppo": "rss_shield.agents.baselines.adaptive_ppo",
    "maskable-ppo": "rss_shield.agents.baselines.maskable_ppo",
    "sailr-ppo": "rss_shield.agents.baselines.sailr_ppo",
    "lagrangian-ppo": "rss_shield.agents.baselines.lagrangian_ppo",
    "executed-ppo": "rss_shield.agents.baselines.executed_ppo",
    "dqn": "rss_shield.agents.baselines.dqn",
    "executed-dqn": "rss_shield.agents.baselines.executed_dqn",
    "qr-dqn": "rss_shield.agents.baselines.qr_dqn",
    "sac": "rss_shield.agents.baselines.sac",
    "semantic-dqn": "rss_shield.agents.baselines.semantic_dqn",
}
_NO_HYPERPARAMETERS = ("seed", "device", "tensorboard_log", "verbose", "stats_window_size", "_init_setup_model")


def _nothing(model: Any, total_timesteps: int) -> None:
    pass


class Learner(NamedTuple):
    """An algorithm of stable-baselines3 or of its kind, and how it is trained in blocks."""

    algorithm: type[BaseAlgorithm]
    options: Callable[[int, int], dict[str, Any]]  # (n_envs, total_timesteps) -> arguments of the algorithm
    rollout: Callable[[int, int], int]  # (n_envs, total_timesteps) -> decisions that a training is a multiple of
    rollouts_per_block: Callable[[int], int]  # (n_envs) -> a kill loses at most this many
    adapt: Callable[[VectorEnv], VectorEnvAdapter] = VectorEnvAdapter
    begin_block: Callable[[Any, int], None] = _nothing  # sets rates that depend on the decisions done
    attributes: Callable[[], dict[str, Any]] = dict  # of a new model; saved with it
    callbacks: Callable[[], list[BaseCallback]] = list
    notes: dict[str, Any] = {}  # noqa: RUF012  what else belongs into the record

    def rounded(self, n_envs: int, total_timesteps: int) -> int:
        """The decisions that a training really makes: total_timesteps rounded up to whole rollouts."""
        rollout = self.rollout(n_envs, total_timesteps)
        return -(-total_timesteps // rollout) * rollout

    def hyperparameters(self, n_envs: int, total_timesteps: int) -> dict[str, Any]:
        """Everything that a training depends on, besides seed, device and environment."""
        defaults: dict[str, Any] = {}
        for kind in reversed(self.algorithm.__mro__):
            if not issubclass(kind, BaseAlgorithm):
                continue
            parameters = inspect.signature(kind).parameters.values()
            defaults = {p.name: p.default for p in parameters if p.default is not p.empty} or defaults
        return {
            "algorithm": f"{self.algorithm.__module__.split('.')[0]}.{self.algorithm.__name__}",
            "policy": "MlpPolicy",
            **{name: value for name, value in defaults.items() if name not in _NO_HYPERPARAMETERS},
            **self.options(n_envs, total_timesteps),
            **self.notes,
            "rollouts_per_block": self.rollouts_per_block(n_envs),
            "timesteps": self.rounded(n_envs, total_timesteps),
        }


def learner_of(name: str, **settings: Any) -> Learner:
    """A learner by name.

    Raises:
      ValueError: there is none of this name, or a setting is out of range.
    """
    if name not in LEARNERS:
        raise ValueError(f"learner = {name!r}: expected one of {', '.join(LEARNERS)}")
    return importlib.import_module(LEARNERS[name]).learner(**settings)
