"""SAC (Haarnoja et al. 2018) on acceleration and steering: needs an environment with `ContinuousAction`."""

from typing import Any

from stable_baselines3 import SAC

from rss_shield.agents import off_policy
from rss_shield.agents.learner import Learner

LEARNING_RATE = 5e-4


def learner() -> Learner:
    """SAC."""
    return Learner(SAC, options, off_policy.rollout, off_policy.rollouts_per_block)


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    return {
        **off_policy.options(n_envs, total_timesteps),
        "policy_kwargs": {"net_arch": [128, 128]},
        "learning_rate": LEARNING_RATE,
    }
