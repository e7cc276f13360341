"""One network for every semantic action: rows of features in, values of actions out; drivers on the same rows."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces

from rss_shield.agents.baselines.semantic_dqn import MISSING, SemanticDQN
from rss_shield.eval.drivers import any_valid, best_value

ACTIONS, FEATURES = 6, 4


class Bandit(gym.Env):
    """One decision: the reward is the third number of the chosen row; about half of the actions are missing."""

    observation_space = spaces.Box(-np.inf, np.inf, (ACTIONS, FEATURES), np.float32)
    action_space = spaces.Discrete(ACTIONS)

    def _rows(self):
        rows = self.np_random.uniform(size=(ACTIONS, FEATURES)).astype(np.float32)
        rows[:, 0] = self.np_random.random(ACTIONS) < 0.5
        rows[self.np_random.integers(ACTIONS), 0] = 1.0
        self.rows = rows * rows[:, :1]
        return self.rows

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._rows(), {}

    def step(self, action):
        assert self.rows[action, 0] == 1.0, "an action that there is not"
        reward = float(self.rows[action, 2])
        return self._rows(), reward, True, False, {}


def model(**options):
    given = {"learning_starts": 32, "train_freq": 1, "learning_rate": 5e-3, "gamma": 0.0, "buffer_size": 2000}
    return SemanticDQN("MlpPolicy", Bandit(), policy_kwargs={"net_arch": [16]}, seed=0, **given | options)


def test_values_go_with_their_rows_and_what_is_missing_is_never_chosen():
    net = model().q_net
    rows = torch.rand(3, ACTIONS, FEATURES)
    rows[..., 0] = 1.0
    values = net(rows)
    assert values.shape == (3, ACTIONS)
    order = torch.tensor([4, 1, 0, 5, 3, 2])
    torch.testing.assert_close(net(rows[:, order]), values[:, order])
    # the same network for every row: 4 inputs, 16 hidden, 1 value
    assert sum(p.numel() for p in net.parameters()) == (4 * 16 + 16) + (16 + 1)
    rows[:, 2, 0] = 0.0
    assert (net(rows)[:, 2] == MISSING).all() and (net(rows).argmax(dim=1) != 2).all()


def test_it_learns_to_take_the_best_action_that_there_is():
    # a bandit by hand: the best row's third number; exploring never takes what is missing, or the bandit complains
    learnt = model().learn(1500)
    env = Bandit()
    rows, _ = env.reset(seed=1)
    earned, most = 0.0, 0.0
    for _ in range(200):
        most += float(rows[:, 2].max())
        action, _ = learnt.predict(rows, deterministic=True)
        rows, reward, *_ = env.step(int(action))
        earned += reward
    assert earned > 0.97 * most


def test_drivers_take_the_best_value_and_any_that_is_valid():
    rows = np.zeros((2, 3, 5))
    rows[0, :, 0], rows[0, :, 1] = [1, 1, 0], [0.2, 0.5, 9.0]
    rows[1, :, 0], rows[1, :, 1] = [1, 0, 1], [-0.5, 3.0, -0.5]
    assert best_value()(rows).tolist() == [1, 0]
    rows[1, :, 4] = [0.3, 0.9, 0.4]  # the same value, and farther
    assert best_value()(rows).tolist() == [1, 2]
    draw = any_valid(np.random.default_rng(0))
    drawn = np.array([draw(rows) for _ in range(400)])
    assert set(drawn[:, 0]) == {0, 1} and set(drawn[:, 1]) == {0, 2}
    assert np.mean(drawn[:, 0]) == pytest.approx(0.5, abs=0.1)
