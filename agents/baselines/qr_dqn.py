"""QR-DQN (Dabney et al. 2018) of sb3-contrib: learns the distribution of returns, acts on its mean."""

from typing import Any

from sb3_contrib import QRDQN

from rss_shield.agents import off_policy
from rss_shield.agents.baselines import dqn
from rss_shield.agents.learner import Learner

QUANTILES = 32


def learner(explore_for: int = 1) -> Learner:
    """QR-DQN with the hyperparameters of DQN; arguments as DQN's."""
    return dqn.learner_with(SinglyQRDQN, options, explore_for)


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    kwargs = {"net_arch": [128, 128], "n_quantiles": QUANTILES}
    return {**dqn.options(n_envs, total_timesteps), "policy_kwargs": kwargs}


class SinglyQRDQN(off_policy.ExploresSingly, QRDQN):
    """QR-DQN of sb3-contrib whose environments explore one by one."""
