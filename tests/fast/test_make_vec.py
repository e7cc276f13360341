"""`make_vec` takes what `make` takes, and gymnasium finds the engine under names of its own."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics, TransformReward

import rss_shield
from rss_shield.envs.fast.config import Unsupported
from rss_shield.envs.fast.tasks import SCENARIOS
from rss_shield.envs.fast.vector import FastVectorEnv
from rss_shield.envs.registration import ELSEWHERE, IN_ENGINE

ENV = "highway-fast-v0"


def test_gymnasium_finds_every_environment_of_the_engine():
    assert set(IN_ENGINE) == set(SCENARIOS)
    for env_id in IN_ENGINE:
        spec = gym.spec(f"rss_shield/{env_id}")
        assert spec.vector_entry_point is not None
        assert gym.spec(env_id).vector_entry_point is None  # highway-env's own are left alone
    assert all(gym.spec(f"rss_shield/{env_id}").vector_entry_point is None for env_id in ELSEWHERE)


@pytest.mark.parametrize("name", [f"rss_shield/{ENV}", f"rss_shield.envs:rss_shield/{ENV}"])
def test_gymnasiums_make_vec_makes_the_engine(name):
    env = gym.make_vec(name, num_envs=3, vectorization_mode="vector_entry_point", shield="monitor", threads=2)
    ours = rss_shield.make_vec(ENV, 3, shield="monitor")
    assert isinstance(env, FastVectorEnv)
    assert env.num_envs == 3
    assert env.spec.id == f"rss_shield/{ENV}"
    np.testing.assert_array_equal(env.reset(seed=4)[0], ours.reset(seed=4)[0])
    assert "shield" in env.step(np.ones(3, int))[4]


def test_gymnasiums_make_makes_a_shielded_environment():
    env = gym.make(f"rss_shield/{ENV}", shield="override", config={"vehicles_count": 5})
    env.reset(seed=0)
    assert "shield" in env.step(1)[4]
    assert len(env.unwrapped.road.vehicles) == 6


def test_a_batch_of_what_the_engine_lacks_is_made_side_by_side():
    env = gym.make_vec("rss_shield/intersection-v1", num_envs=1)
    assert isinstance(env, gym.vector.SyncVectorEnv)


def test_wrappers_of_batches_go_around_either_backend():
    for backend in rss_shield.envs.make_vec.BACKENDS:
        env = rss_shield.make_vec(ENV, 2, backend=backend, wrappers=[RecordEpisodeStatistics])
        assert isinstance(env, RecordEpisodeStatistics)
        assert env.unwrapped.num_envs == 2


def test_wrappers_of_one_environment_go_around_each_of_highway_envs():
    halved = [lambda env: gym.wrappers.TransformReward(env, lambda reward: reward / 2)]
    plain, wrapped = (
        rss_shield.make_vec(ENV, 2, backend="highway-env", shield=None, wrappers=wrappers) for wrappers in ((), halved)
    )
    rewards = []
    for env in (plain, wrapped):
        env.reset(seed=0)
        rewards.append(env.step(np.ones(2, int))[1])
    np.testing.assert_array_equal(rewards[0] / 2, rewards[1])
    with pytest.raises(Unsupported, match=r"wrappers = \[TimeLimit\].*backend = 'highway-env'"):
        rss_shield.make_vec(ENV, 2, wrappers=[gym.wrappers.TimeLimit])
    assert TransformReward  # its namesake for batches goes around the engine


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"traffic": "compliant"}, "traffic = 'compliant'.*highway-env"),
        ({"render_mode": "human"}, "render_mode = 'human'.*'rgb_array'"),
    ],
)
def test_what_the_engine_lacks_is_named(options, named):
    with pytest.raises(Unsupported, match=named):
        rss_shield.make_vec(ENV, 2, **options)


@pytest.mark.parametrize("env_id", [ENV, "intersection-v0"])
def test_a_picture_is_the_one_that_highway_env_draws(env_id):
    fast = rss_shield.make_vec(env_id, 2, shield=None, render_mode="rgb_array")
    stock = rss_shield.make(env_id, shield=None, render_mode="rgb_array")
    fast.reset(seed=6)
    stock.reset(seed=7)
    for action in (1, 0, 2):
        *_, terminated, truncated, _ = fast.step(np.array([1, action]))
        stock.step(action)
        if (terminated | truncated).any():
            break
        picture = fast.picture(1)
        assert picture.dtype == np.uint8
        np.testing.assert_array_equal(picture, stock.render())
    both = fast.render()
    assert len(both) == 2
    np.testing.assert_array_equal(both[1], fast.picture(1))
    assert rss_shield.make_vec(env_id, 1, shield=None).render() is None
    with pytest.raises(ValueError, match="e = 2: expected a whole number from 0 to 1"):
        fast.picture(2)
