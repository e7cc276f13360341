"""A slim model acts as the whole one does, but for what half precision cannot tell apart."""

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
    write_slim(tmp_path / "whole.zip", tmp_path / "slim.zip")
    slim = algorithm.load(tmp_path / "slim.zip", env=gym.make(env_id), device="cpu")
    seen = np.stack([model.observation_space.sample() for _ in range(50)])
    before, after = (one.predict(seen, deterministic=True)[0] for one in (model, slim))
    np.testing.assert_allclose(before, after, atol=0 if model.action_space.dtype.kind == "i" else 0.01)
    assert (tmp_path / "slim.zip").stat().st_size < 0.35 * (tmp_path / "whole.zip").stat().st_size
    slim.learn(64)


def test_weights_are_rounded_and_nothing_else(tmp_path):
    model = PPO("MlpPolicy", "CartPole-v1", seed=0, device="cpu", n_steps=64).learn(64)
    model.save(tmp_path / "whole.zip")
    write_slim(tmp_path / "whole.zip", tmp_path / "slim.zip")
    slim = PPO.load(tmp_path / "slim.zip", device="cpu")
    for (name, whole), rounded in zip(
        model.policy.state_dict().items(), slim.policy.state_dict().values(), strict=True
    ):
        assert rounded.dtype == whole.dtype, name
        np.testing.assert_allclose(rounded, whole, rtol=2**-11, atol=2**-25, err_msg=name)
    assert slim.num_timesteps == model.num_timesteps
