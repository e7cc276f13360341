"""PPO-Lagrangian: as much reward as possible while the mean cost per decision stays within a limit.

The agent that readers of safe reinforcement learning expect beside a shield (Ray, Achiam & Amodei, "Benchmarking safe
exploration in deep reinforcement learning", 2019), with the multiplier moved by a PID controller (Stooke et al. 2020).
Cost is info["cost"]: 1 in a decision in which the ego breaks its proper response or a contact is its fault. So the
agent is to learn by itself what the shield would enforce; nothing overrides it.

A second critic learns the discounted cost. PPO then follows (A_reward - multiplier * A_cost) / (1 + multiplier).
"""

from typing import Any, cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from torch import nn

from rss_shield.agents import ppo
from rss_shield.agents.learner import Learner
from rss_shield.agents.multiplier import Meter, MultiplierRecorder, Pid
from rss_shield.agents.vec_env import VectorEnvAdapter

COST = ("cost",)
LEAST_SCALE = 0.005  # of errors
GAINS: dict[str, float] = dict(kp=0.5, ki=0.5, kd=0.5, largest=50.0)
HIDDEN = 128  # units in each of the two layers of the cost critic, as in the other networks


def learner(cost_limit: float = 0.01) -> Learner:
    """PPO-Lagrangian.

    Args:
      cost_limit: wanted mean of info["cost"] per decision.
    """
    gains = {"scale": max(cost_limit, LEAST_SCALE), **GAINS}
    return ppo.learner()._replace(
        algorithm=LagrangianPPO,
        options=lambda n_envs, total: {**ppo.options(n_envs, total), "rollout_buffer_class": CostBuffer},
        adapt=lambda env: VectorEnvAdapter(env, Meter(*COST, charges=False)),
        attributes=lambda: {"pid": Pid(cost_limit, **gains)},
        callbacks=lambda: [MultiplierRecorder("cost")],
        notes={**ppo.learner().notes, "rollout_buffer_class": "CostBuffer", "cost_limit": cost_limit, **gains},
    )


class CostBuffer(RolloutBuffer):
    """A rollout that keeps what infos say about costs, and what a cut-off episode would have gone on from."""

    env: VectorEnvAdapter

    def reset(self) -> None:
        super().reset()
        self.costs = np.zeros((self.buffer_size, self.n_envs), np.float32)
        self.cut: list[tuple[int, int, np.ndarray]] = []  # (step, environment, last observation)

    def add(self, *args: Any, **kwargs: Any) -> None:
        self.costs[self.pos] = self.env.told(*COST)
        for e in np.flatnonzero(self.env.truncated).tolist():
            self.cut.append((self.pos, e, self.env.last_infos["final_obs"][e]))
        super().add(*args, **kwargs)


class LagrangianPPO(PPO):
    """stable-baselines3's PPO with a critic of costs."""

    pid: Pid
    rollout_buffer: CostBuffer

    def _setup_model(self) -> None:
        super()._setup_model()
        inputs = int(np.prod(self.observation_space.shape or (1,)))
        layers = [nn.Linear(inputs, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, 1)]
        self.cost_critic = nn.Sequential(nn.Flatten(), *layers).to(self.device)
        self.cost_optimizer = torch.optim.Adam(
            self.cost_critic.parameters(), lr=cast(float, self.learning_rate), eps=1e-5
        )

    def collect_rollouts(self, env, callback, rollout_buffer, n_rollout_steps) -> bool:
        rollout_buffer.env = env
        go_on = super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)
        advantages, self.cost_returns = self._of_costs(rollout_buffer)
        price = self.pid.multiplier  # as the rollout that has just ended has moved it
        rollout_buffer.advantages = (rollout_buffer.advantages - price * advantages) / (1.0 + price)
        self.cost_observations = torch.as_tensor(np.array(rollout_buffer.observations), device=self.device).flatten(
            0, 1
        )
        return go_on

    def train(self) -> None:
        super().train()
        losses = []
        for group in self.cost_optimizer.param_groups:
            group["lr"] = self.policy.optimizer.param_groups[0]["lr"]
        targets = torch.as_tensor(self.cost_returns, device=self.device).flatten()
        for _ in range(self.n_epochs):
            for chosen in torch.randperm(len(targets)).split(self.batch_size):
                loss = nn.functional.mse_loss(self._cost_values(self.cost_observations[chosen]), targets[chosen])
                self.cost_optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.cost_critic.parameters(), self.max_grad_norm)
                self.cost_optimizer.step()
                losses.append(loss.item())
        self.logger.record("cost/value_loss", float(np.mean(losses)))

    def _cost_values(self, observations: torch.Tensor) -> torch.Tensor:
        return self.cost_critic(observations.float()).flatten()

    def _of_costs(self, buffer: CostBuffer) -> tuple[np.ndarray, np.ndarray]:
        """Advantages and returns of costs `[T, E]`, by generalised estimation as for rewards."""
        with torch.no_grad():
            seen = torch.as_tensor(np.array(buffer.observations), device=self.device).flatten(0, 1)
            values = self._cost_values(seen).cpu().numpy().reshape(buffer.costs.shape)
            last = self._cost_values(torch.as_tensor(self._last_obs, device=self.device)).cpu().numpy()
            costs = buffer.costs.copy()
            for step, e, observation in buffer.cut:
                after = torch.as_tensor(observation, device=self.device)[None]
                costs[step, e] += self.gamma * self._cost_values(after).item()
        going = 1.0 - np.vstack([buffer.episode_starts[1:], np.asarray(self._last_episode_starts)])
        following = np.vstack([values[1:], last])
        errors = costs + self.gamma * going * following - values
        advantages = np.zeros_like(errors)
        later = np.zeros(buffer.n_envs, np.float32)
        for step in reversed(range(len(errors))):
            later = advantages[step] = errors[step] + self.gamma * self.gae_lambda * going[step] * later
        return advantages, (advantages + values).astype(np.float32)

    def _excluded_save_params(self) -> list[str]:
        kept_apart = ["cost_critic", "cost_optimizer", "cost_returns", "cost_observations"]
        return [*super()._excluded_save_params(), *kept_apart]

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        parameters, others = super()._get_torch_save_params()
        return [*parameters, "cost_critic", "cost_optimizer"], others
