"""What learners from a replay buffer have in common: few gradient steps per decision, and blocks of decisions.

A block lasts about BLOCK decisions. Rates that fall while a training goes on are set at its beginning. The buffer is
saved with the model, so nothing is lost when a training is killed, and a resumed one gives the same result.
"""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.utils import FloatSchedule

BLOCK = 8192  # decisions
BUFFER = 100_000  # decisions
BATCH = 128
DECISIONS_PER_UPDATE = 8
GAMMA = 0.9
# of Q-learners: share of random decisions at first and in the end, and after which part of the training that is
EXPLORATION = {"exploration_initial_eps": 1.0, "exploration_final_eps": 0.05, "exploration_fraction": 0.3}


def rollout(n_envs: int, total_timesteps: int) -> int:
    """A training is a multiple of one step of all environments."""
    return n_envs


def rollouts_per_block(n_envs: int) -> int:
    return max(BLOCK // n_envs, 1)


def options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    """What differs from the defaults of stable-baselines3, for learners with a replay buffer."""
    return {
        "buffer_size": min(BUFFER, max(total_timesteps, n_envs)),
        "batch_size": BATCH,
        "learning_starts": max(min(1000, total_timesteps // 10), n_envs),
        "train_freq": 1,  # step of all environments
        "gradient_steps": max(n_envs // DECISIONS_PER_UPDATE, 1),
        "gamma": GAMMA,
    }


def explore_less(model: Any, total_timesteps: int) -> None:
    """The share of random actions in the next block."""
    done = min(model.num_timesteps / (model.exploration_fraction * total_timesteps), 1.0)
    first, last = model.exploration_initial_eps, model.exploration_final_eps
    model.exploration_schedule = FloatSchedule(first + done * (last - first))
    model.exploration_rate = model.exploration_schedule(1.0)
    model.forget_exploration()


class ExploresSingly:
    """Before a Q-learner of stable-baselines3: every environment draws for itself whether it explores.

    Theirs draws once for all. With `explore_for` N > 1 what was drawn is done 1 to N times in a row, each equally
    likely, and so seldom begun that as many decisions explore (temporally extended exploration; Dabney, Ostrovski &
    Barreto, 2021).
    """

    explore_for = 1
    exploration_rate: float
    action_space: Any
    env: Any
    _left: np.ndarray | None = None  # how often each environment repeats what it drew

    def forget_exploration(self) -> None:
        """What was begun is not gone on with: a block depends on the saved model alone."""
        self._left = None

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_left", "_drawn"]  # type: ignore[misc]

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        actions, state = super().predict(observation, state, episode_start, True)  # type: ignore[misc]
        if deterministic or np.ndim(actions) == 0:
            return actions, state
        count = len(actions)  # torch's generator is seeded by `set_random_seed`
        if self._left is None or len(self._left) != count:
            self._left, self._drawn = np.zeros((2, count), int)
        ended = getattr(self.env, "ended", None)
        if ended is not None and len(ended) == count:
            self._left[ended] = 0  # another episode has begun
        explores = torch.rand(count).numpy() < begin_rate(self.exploration_rate, self.explore_for)
        drawn = torch.randint(int(self.action_space.n), (count,)).numpy()
        begins = explores & (self._left == 0)
        self._drawn = np.where(begins, drawn, self._drawn)
        if self.explore_for > 1:
            lasts = torch.randint(1, self.explore_for + 1, (count,)).numpy()
            self._left = np.where(begins, lasts, self._left)
        else:
            self._left = begins.astype(int)
        exploring = self._left > 0
        self._left = self._left - exploring
        return np.where(exploring, self._drawn, actions), state


def begin_rate(share: float, longest: int) -> float:
    """How likely exploration must begin, on a decision that does not explore yet, for a share of all to explore.

    Exploring lasts (1 + longest) / 2 decisions on average: of begin * mean explored ones and 1 - begin others the
    former are to be `share`.
    """
    mean = (1 + longest) / 2
    return share / (mean * (1 - share) + share)
