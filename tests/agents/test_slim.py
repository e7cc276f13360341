"""A slim model acts as the whole one does."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import DQN, PPO, SAC

from rss_shield.agents.slim import write_slim


@pytest.mark.parametrize(
    "algorithm, env_id, settings",
    [
        (PPO, "CartPole-v1", {"n_steps": 64}),
        (DQN, "CartPole-v1", {"learning_starts": 16}),
        (SAC, "Pendulum-v1", {"learning_starts": 16}),
    ],
    ids=["PPO", "DQN", "SAC"],
)
def test_it_is_smaller_acts_the_same_and_can_learn_on(algorithm, env_id, settings, tmp_path):
    model = algorithm("MlpPolicy", env_id, seed=0, device="cpu", **settings).learn(128)
    model.save(tmp_path / "whole.zip")
    write_slim(tmp_path / "whole.zip", tmp_path / "slim" / "model.zip")
    slim = algorithm.load(tmp_path / "slim" / "model.zip", env=gym.make(env_id), device="cpu")
    seen = np.stack([model.observation_space.sample() for _ in range(50)])
    np.testing.assert_array_equal(model.predict(seen, deterministic=True)[0], slim.predict(seen, deterministic=True)[0])
    assert (tmp_path / "slim" / "model.zip").stat().st_size < 0.6 * (tmp_path / "whole.zip").stat().st_size
    slim.learn(64)
