"""PPO without a shield whose training reward is shaped: crashes and short times to collision cost.

What most papers do instead of a shield. Each new smallest time to collision of the episode costs, so that an episode
pays once for its closest approach: SHORT * (1 - ttc / HORIZON), and CRASH for a contact of any kind.
"""

import numpy as np

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner
from rss_shield.agents.vec_env import VectorEnvAdapter

CRASH = 5.0  # rewards of highway-env are at most 1 per decision
SHORT = 2.0
HORIZON = 3.0  # [s]


def learner(crash: float = CRASH, short: float = SHORT, horizon: float = HORIZON) -> Learner:
    """PPO with a shaped reward.

    Args:
      crash: what a contact costs.
      short: what a time to collision of 0 costs.
      horizon: time to collision from which on nothing is paid [s].
    """
    shaping = {"crash": crash, "short": short, "horizon": horizon}
    return ppo.learner()._replace(
        adapt=lambda env: VectorEnvAdapter(env, Shaping(env.num_envs, **shaping)),
        notes={**ppo.learner().notes, "shaping": shaping},
    )


class Shaping:
    """What is taken off the rewards; one per training, as it remembers how close each episode came."""

    def __init__(self, num_envs: int, crash: float, short: float, horizon: float) -> None:
        self.crash, self.short, self.horizon = crash, short, horizon
        self.paid = np.zeros(num_envs)

    def begin(self) -> None:
        self.paid[:] = 0.0

    def __call__(self, env: VectorEnvAdapter) -> np.ndarray:
        closeness = self.short * np.clip(1.0 - np.asarray(env.told("min_ttc"), float) / self.horizon, 0.0, 1.0)
        contact = env.ended & (np.asarray(env.told("blame"), object) != "")
        new = closeness - self.paid
        self.paid = np.where(env.ended, 0.0, closeness)
        return new + self.crash * contact
