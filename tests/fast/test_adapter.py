"""stable-baselines3 on the engine."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import rss_shield
from rss_shield.agents.vec_env import VectorEnvAdapter

ENV = "highway-fast-v0"


def test_ends_of_episodes_carry_what_sb3_asks_for():
    env = VectorEnvAdapter(rss_shield.make_vec(ENV, 4, shield=None))
    env.seed(0)
    env.reset()
    for _ in range(40):
        observations, rewards, ended, infos = env.step(np.full(4, 3))
        assert observations.dtype == np.float32 and rewards.shape == ended.shape == (4,)
        for e in range(4):
            if ended[e]:
                assert infos[e]["terminal_observation"].shape == (5, 5)
                assert infos[e]["TimeLimit.truncated"] is False
                assert infos[e]["episode"]["l"] > 0
                return
            assert infos[e] == {}
    pytest.fail("no episode ended")


def test_ppo_learns_on_it():
    from stable_baselines3 import PPO

    env = VectorEnvAdapter(rss_shield.make_vec(ENV, 8))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=1, seed=0)
    model.learn(256)
    assert model.num_timesteps == 256
    assert len(model.ep_info_buffer) > 0


def test_other_autoreset_modes_are_errors():
    with pytest.raises(ValueError, match="autoreset_mode"):
        VectorEnvAdapter(rss_shield.make_vec(ENV, 1, shield=None, autoreset_mode=AutoresetMode.NEXT_STEP))
