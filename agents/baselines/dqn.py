"""DQN (Mnih et al. 2015), as highway-env's own examples use it."""

from typing import Any

from stable_baselines3 import DQN

from rss_shield.agents import off_policy
from rss_shield.agents.learner import Learner

LEARNING_RATE = 5e-4
TARGET_UPDATES = 1024  # decisions from one target network to the next


def learner(explore_for: int = 1) -> Learner:
    """DQN.

    Args:
      explore_for: see `off_policy.ExploresSingly`.
    """
    return learner_with(SinglyDQN, options, explore_for)


def learner_with(algorithm: type, given: Any, explore_for: int = 1) -> Learner:
    """A Q-learner with a replay buffer."""
    lasts = f", for 1 to {explore_for} decisions" if explore_for > 1 else ""
    return Learner(
        algorithm,
        given,
        off_policy.rollout,
        off_policy.rollouts_per_block,
        begin_block=off_policy.explore_less,
        attributes=lambda: {"explore_for": explore_for},
        notes={
            "exploration": f"its share falls block by block, and every environment draws for itself{lasts}",
        },
    )


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    return {
        **off_policy.options(n_envs, total_timesteps),
        **off_policy.EXPLORATION,
        "policy_kwargs": {"net_arch": [128, 128]},
        "learning_rate": LEARNING_RATE,
        "target_update_interval": max(TARGET_UPDATES, n_envs),
    }


class SinglyDQN(off_policy.ExploresSingly, DQN):
    """DQN of stable-baselines3 whose environments explore one by one."""
