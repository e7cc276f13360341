"""DQN over semantic actions: one small network rates every action by its own features.

What an action leads to is in its row of the observation `[A, D]` (`semantic_actions={"features": True}`), so the same
network serves all actions, however many there are, and whom a slot is about does not matter.
"""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork
from torch import nn

from rss_shield.agents import off_policy
from rss_shield.agents.baselines import dqn
from rss_shield.agents.learner import Learner

WIDTHS = (32, 32)
BUFFER = 20_000  # decisions; each has the features of all actions twice
MISSING = -1e6  # value of an action that there is none of


def learner() -> Learner:
    """DQN on semantic actions."""
    return dqn.learner_with(SemanticDQN, options)


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    given = dqn.options(n_envs, total_timesteps)
    return {**given, "policy_kwargs": {"net_arch": list(WIDTHS)}, "buffer_size": min(BUFFER, given["buffer_size"])}


class RowNetwork(QNetwork):
    """Values `[B, A]` of observations `[B, A, D]`: the same network on each row whose first number is 1."""

    def __init__(self, observation_space: spaces.Box, action_space: spaces.Discrete, *others: Any, **more: Any) -> None:
        super().__init__(observation_space, action_space, *others, **more)
        self.table = observation_space.shape  # of rows
        layers: list[nn.Module] = []
        width = observation_space.shape[1]
        for wide in self.net_arch:
            layers, width = [*layers, nn.Linear(width, wide), self.activation_fn()], wide
        self.q_net = nn.Sequential(*layers, nn.Linear(width, 1))

    def forward(self, obs: Any) -> torch.Tensor:
        rows = obs.reshape(len(obs), *self.table)
        return torch.where(rows[..., 0] > 0.0, self.q_net(rows).squeeze(-1), MISSING)


class RowPolicy(DQNPolicy):
    """A Q-network over rows, and its target."""

    def make_q_net(self) -> RowNetwork:
        return RowNetwork(**self._update_features_extractor(self.net_args, features_extractor=None)).to(self.device)


class SemanticDQN(dqn.SinglyDQN):
    """DQN that explores among the actions that there are."""

    policy_aliases = {"MlpPolicy": RowPolicy}  # noqa: RUF012

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        actions, state = super(off_policy.ExploresSingly, self).predict(observation, state, episode_start, True)
        valid = np.asarray(observation)[..., 0] > 0.0
        if deterministic or valid.ndim == 1:
            return actions, state
        explores = torch.rand(len(valid)).numpy() < self.exploration_rate  # torch's generator is seeded
        drawn = np.where(valid, torch.rand(valid.shape).numpy(), -1.0).argmax(axis=1)
        return np.where(explores, drawn, actions), state

    def _sample_action(self, learning_starts: int, action_noise: Any = None, n_envs: int = 1) -> Any:
        """Before learning starts all explore, among the actions that there are."""
        if self.num_timesteps < learning_starts:
            valid = np.asarray(self._last_obs)[..., 0] > 0.0
            drawn = np.where(valid, torch.rand(valid.shape).numpy(), -1.0).argmax(axis=1)
            return drawn, drawn
        return super()._sample_action(learning_starts, action_noise, n_envs)
