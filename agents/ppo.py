"""PPO on any vector environment, for many environments side by side and a few hundred thousand decisions."""

import math
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.utils import FloatSchedule

from rss_shield.agents.learner import Learner

ROLLOUT_STEPS = 8192  # decisions of all environments together between two updates, at most
UPDATES = 10  # at least
BATCHES = 8  # in one pass over a rollout
LEARNING_RATE = 1e-3  # at the start; falls to nothing, block by block
HYPERPARAMETERS: dict[str, Any] = dict(
    policy_kwargs={"net_arch": {"pi": [128, 128], "vf": [128, 128]}},
    n_epochs=10,
    learning_rate=LEARNING_RATE,
    gamma=0.9,
)
ROLLOUTS_PER_BLOCK = 3  # a kill loses at most this many rollouts


def learner() -> Learner:
    """PPO of stable-baselines3."""
    return Learner(
        PPO,
        options,
        lambda n_envs, total: n_envs * rollout_steps(n_envs, total),
        lambda n_envs: ROLLOUTS_PER_BLOCK,
        begin_block=lower_learning_rate,
        notes={"learning_rate_schedule": "falls linearly to 0, from block to block"},
    )


def lower_learning_rate(model: Any, total_timesteps: int) -> None:
    model.lr_schedule = FloatSchedule(model.learning_rate * (1 - model.num_timesteps / total_timesteps))


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    """What differs from the defaults of stable-baselines3."""
    n_steps = rollout_steps(n_envs, total_timesteps)
    return {"n_steps": n_steps, "batch_size": n_steps * n_envs // BATCHES, **HYPERPARAMETERS}


def rollout_steps(n_envs: int, total_timesteps: int) -> int:
    """Decisions per environment between two updates.

    A multiple of BATCHES, so that all batches have one size, and so many that rollouts are as large as
    ROLLOUT_STEPS and UPDATES permit.
    """
    largest = ROLLOUT_STEPS // n_envs // BATCHES
    enough = math.ceil(total_timesteps / UPDATES / (n_envs * BATCHES))
    return max(min(largest, enough), 1) * BATCHES
