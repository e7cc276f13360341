"""DQN whose replay buffer holds the action that was executed, not the one that was proposed.

Sound, because DQN learns off-policy: a transition says what follows from the action in it, whoever chose it. What the
shield changes on single frames is no meta-action; there the shield stays a part of the environment.
"""

from typing import Any

import numpy as np

from rss_shield.agents.baselines import dqn
from rss_shield.agents.baselines.executed_ppo import EXECUTED
from rss_shield.agents.learner import Learner


def learner(explore_for: int = 1) -> Learner:
    """DQN on executed actions; arguments as DQN's."""
    return dqn.learner_with(ExecutedDQN, dqn.options, explore_for)


class ExecutedDQN(dqn.SinglyDQN):
    """DQN that remembers what was done."""

    def _store_transition(self, replay_buffer: Any, buffer_action: np.ndarray, *others: Any) -> None:
        adapter: Any = self.env
        executed = np.asarray(adapter.told(*EXECUTED)).reshape(buffer_action.shape)
        super()._store_transition(replay_buffer, executed, *others)
