"""PPO whose rollouts hold the action that was executed, not the one that was proposed.

The "safe policy" reading of a shield: the agent is what it and the replacement do together; the other reading, with the
proposal in the rollout, takes the shield for a part of the environment. What is sound of it, and what is not:

- Advantages and values are sound: every transition follows from the action beside it.
- Where nothing was replaced, the update is PPO's.
- Where an action was replaced, it was not drawn from the policy but by policy and replacement together. The ratio
  starts at 1, because the old probability is that of the executed action, but the sample is off-policy without a
  weight: its gradient raises or lowers the probability of proposing the executed action by itself, and says nothing
  about the proposal. So this is imitation of the replacement weighted by advantages, no gradient of the return.
- What the shield changes on single frames is no meta-action. There the proposal stays, and the shield is environment.

DQN has no such trouble: `executed_dqn`.
"""

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner
from rss_shield.agents.vec_env import VectorEnvAdapter

EXECUTED = ("shield", "executed_action")


def learner() -> Learner:
    """PPO on executed actions."""
    return ppo.learner()._replace(
        algorithm=ExecutedPPO,
        options=lambda n_envs, total: {**ppo.options(n_envs, total), "rollout_buffer_class": ExecutedBuffer},
        notes={**ppo.learner().notes, "rollout_buffer_class": "ExecutedBuffer"},
    )


class ExecutedBuffer(RolloutBuffer):
    """A rollout of executed actions."""

    env: VectorEnvAdapter

    def reset(self) -> None:
        super().reset()
        self.replaced = np.zeros((self.buffer_size, self.n_envs), bool)

    def add(self, obs: Any, action: np.ndarray, *others: Any) -> None:
        executed = np.asarray(self.env.told(*EXECUTED)).reshape(action.shape)
        self.replaced[self.pos] = (executed != action).reshape(self.n_envs, -1).any(axis=1)
        super().add(obs, executed, *others)


class ExecutedPPO(PPO):
    """stable-baselines3's PPO with the probabilities of what was executed."""

    rollout_buffer: ExecutedBuffer

    def collect_rollouts(self, env, callback, rollout_buffer, n_rollout_steps) -> bool:
        rollout_buffer.env = env
        go_on = super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)
        where = rollout_buffer.replaced
        if where.any():
            seen = torch.as_tensor(rollout_buffer.observations[where], device=self.device)
            actions = torch.as_tensor(rollout_buffer.actions[where], device=self.device).long().flatten()
            with torch.no_grad():
                rollout_buffer.log_probs[where] = self.policy.evaluate_actions(seen, actions)[1].cpu().numpy()
        self.logger.record("decision/replaced", float(where.mean()))
        return go_on
