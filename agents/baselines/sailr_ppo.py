"""PPO for which an intervention of the shield is the end of the episode, and costs.

The idea of SAILR (Wagener, Boots & Cheng, "Safe reinforcement learning using advantage-based intervention", ICML 2021):
who needs help has lost. So the agent learns to do without, and what the shield does afterwards never flatters its
returns. There the intervention is a rule of advantages, here it is the shield; hence "SAILR-like".

An intervention is a proper response on any frame, or a change of the acceleration by more than CHANGE on average: the
shield anticipates, so an agent that always asks for full speed hardly ever meets a proper response.
"""

import numpy as np
from gymnasium.vector import VectorEnv

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner
from rss_shield.agents.vec_env import VectorEnvAdapter

OF_EPISODE = ("blame", "crashed", "override_share", "episode_cost")  # what the learning curve asks for
CHANGE = 1.0  # [m/s^2]
PENALTY = 1.0  # rewards of highway-env are at most 1 per decision


def learner(penalty: float = PENALTY) -> Learner:
    """PPO whose training episodes end at an intervention.

    Args:
      penalty: taken off the reward of the last decision then.
    """
    return ppo.learner()._replace(
        adapt=lambda env: EndsAtIntervention(env, penalty),
        notes={**ppo.learner().notes, "penalty_at_end": penalty, "ends_at_change": CHANGE},
    )


class EndsAtIntervention(VectorEnvAdapter):
    """Ends an episode in the decision in which the shield intervenes.

    Args:
      env: a vector environment with autoreset in the same step; this class begins further episodes where it ends one.
      penalty: taken off the reward then.
    """

    def __init__(self, env: VectorEnv, penalty: float) -> None:
        super().__init__(env)
        self.penalty = penalty

    def reset(self):
        self.lengths = np.zeros(self.num_envs, int)
        return super().reset()

    def step_wait(self):
        observations, rewards, ended, list_of_infos = super().step_wait()
        intervened = np.asarray(self.told("shield", "override_fraction")) > 0.0
        intervened |= np.asarray(self.told("shield", "mean_acceleration_change")) > CHANGE
        rewards -= np.float32(self.penalty) * intervened
        self.lengths += 1
        for e in np.flatnonzero(intervened & ended).tolist():
            list_of_infos[e]["TimeLimit.truncated"] = False  # nothing is hoped for after an intervention
        stopped = intervened & ~ended
        if stopped.any():
            observations = observations.copy()
            for e in np.flatnonzero(stopped).tolist():
                # the dictionary of an episode that ends here, as where it ends by itself
                list_of_infos[e] = {
                    "terminal_observation": observations[e].copy(),
                    "TimeLimit.truncated": False,
                    "episode": {"r": self.returns[e], "l": self.lengths[e]},
                    **{name: self.last_infos[name][e] for name in OF_EPISODE if name in self.last_infos},
                }
            begun, _ = self.env.reset(options={"reset_mask": stopped})
            observations[stopped] = begun[stopped]
            self.returns[stopped] = 0.0
        over = ended | stopped
        self.truncated = self.truncated & ~intervened
        self.lengths[over] = 0
        return observations, rewards, over, list_of_infos
