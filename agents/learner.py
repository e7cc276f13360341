"""What a learner is made of, and the learners by name.

A learner is one file: `agents/ppo.py`, or one of `agents/baselines/`. It has a function `learner(**settings)`.
"""

import importlib
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from gymnasium.vector import VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from rss_shield.agents.networks import policy_arguments
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
# what a value lies between (itself excluded at the open end), and whether it is a whole number
_OPEN, _WHOLE = math.ulp(0.0), True
RANGES: dict[str, tuple[float, float, bool]] = {
    "learning_rate": (_OPEN, math.inf, not _WHOLE),
    "batch_size": (2, math.inf, _WHOLE),
    "n_epochs": (1, math.inf, _WHOLE),
    "gamma": (0, 1, not _WHOLE),
    "gae_lambda": (0, 1, not _WHOLE),
    "clip_range": (_OPEN, math.inf, not _WHOLE),
    "ent_coef": (0, math.inf, not _WHOLE),
    "vf_coef": (0, math.inf, not _WHOLE),
    "max_grad_norm": (_OPEN, math.inf, not _WHOLE),
    "buffer_size": (1, math.inf, _WHOLE),
    "learning_starts": (0, math.inf, _WHOLE),
    "gradient_steps": (1, math.inf, _WHOLE),
    "tau": (_OPEN, 1, not _WHOLE),
    "target_update_interval": (1, math.inf, _WHOLE),
    "exploration_fraction": (_OPEN, 1, not _WHOLE),
    "exploration_initial_eps": (0, 1, not _WHOLE),
    "exploration_final_eps": (0, 1, not _WHOLE),
}
KWARGS = "policy_kwargs"
# arguments that are not free -> what decides them
_ALWAYS = {
    "policy": "it is MlpPolicy, --network and hyperparameters.policy_kwargs choose the network",
    "seed": "--seeds says it",
    "device": "--device says it",
    "tensorboard_log": "the folder of the run is where it is written, see --tracker",
}
_WITH_ROLLOUTS = {
    "n_steps": "a rollout is a fixed number of decisions that --n-envs environments share, and blocks, after which a "
    "stopped training goes on, are whole rollouts; --n-envs and --total-timesteps decide it"
}
_WITH_BUFFER = {
    "train_freq": "it is one step of all --n-envs environments, and blocks, after which a stopped training goes on, "
    "are whole steps; gradient_steps says how much is learnt from each",
    "n_steps": "it is 1, because environments begin anew with every block, and longer returns would go across",
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

    def with_hyperparameters(self, changes: Mapping[str, Any]) -> "Learner":
        """This learner with other arguments of its algorithm. A learning rate that falls begins at the one given.

        Raises:
          ValueError: the algorithm has no such argument, something else decides it, or its value is out of range.
        """
        if not changes:
            return self
        arguments = {"policy", *self.defaults(), *self.options(1, 1)}
        decided = {**_ALWAYS, **(_WITH_BUFFER if "train_freq" in arguments else _WITH_ROLLOUTS)}
        known = arguments - {*decided, *_NO_HYPERPARAMETERS}
        for name, value in changes.items():
            if name in decided and name in arguments:
                raise ValueError(f"hyperparameters.{name} = {value!r}: not to be chosen here; {decided[name]}")
            if name not in known:
                expected = ", ".join(sorted(known))
                raise ValueError(f"hyperparameters.{name}: {self.algorithm.__name__} takes {expected}")
            check_hyperparameter(name, value)
        return self._replace(options=lambda n_envs, total: _changed(self.options(n_envs, total), changes))

    def with_network(self, name: str) -> "Learner":
        """This learner with a network of `agents.networks` in front of its own layers."""
        more = policy_arguments(name)
        if not more:
            return self

        return self._replace(options=lambda n_envs, total: _changed(self.options(n_envs, total), {KWARGS: more}))

    def defaults(self) -> dict[str, Any]:
        """The arguments of the algorithm that have a value of their own."""
        for kind in self.algorithm.__mro__:
            if not issubclass(kind, BaseAlgorithm):
                continue
            parameters = inspect.signature(kind).parameters.values()
            found = {p.name: p.default for p in parameters if p.default is not p.empty}
            if found:
                return found
        return {}

    def hyperparameters(self, n_envs: int, total_timesteps: int) -> dict[str, Any]:
        """Everything that a training depends on, besides seed, device and environment."""
        return {
            "algorithm": f"{self.algorithm.__module__.split('.')[0]}.{self.algorithm.__name__}",
            "policy": "MlpPolicy",
            **{name: value for name, value in self.defaults().items() if name not in _NO_HYPERPARAMETERS},
            **_as_words(self.options(n_envs, total_timesteps)),
            **self.notes,
            "rollouts_per_block": self.rollouts_per_block(n_envs),
            "timesteps": self.rounded(n_envs, total_timesteps),
        }


def _changed(options: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Options with other values; of the policy's arguments those that are not named stay."""
    merged = {KWARGS: {**(options.get(KWARGS) or {}), **(changes[KWARGS] or {})}} if KWARGS in changes else {}
    return {**options, **changes, **merged}


def _as_words(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as a file can say them: classes by their names."""
    return {
        name: _as_words(value) if isinstance(value, Mapping) else value.__name__ if isinstance(value, type) else value
        for name, value in options.items()
    }


def check_hyperparameter(name: str, value: Any) -> None:
    """Refuse a value that no algorithm takes.

    Raises:
      ValueError: names field, value and range.
    """
    if name not in RANGES or (name == "ent_coef" and isinstance(value, str) and value.startswith("auto")):
        return
    low, high, whole = RANGES[name]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not low <= value <= high or math.isinf(value) or (whole and value != int(value)):
        kind = "a whole number" if whole else "a number"
        bounds = "> 0" if low == _OPEN else f">= {low:g}"
        bounds += "" if high == math.inf else f" and <= {high:g}"
        raise ValueError(f"hyperparameters.{name} = {value!r}: expected {kind} {bounds}")


def learner_of(name: str, **settings: Any) -> Learner:
    """A learner by name.

    Raises:
      ValueError: there is none of this name, or a setting is out of range.
    """
    if name not in LEARNERS:
        raise ValueError(f"learner = {name!r}: expected one of {', '.join(LEARNERS)}")
    return importlib.import_module(LEARNERS[name]).learner(**settings)
