"""Episode logs, and engine states in real environments."""

import gymnasium as gym
import numpy as np
import pytest

import rss_shield
from rss_shield.envs.fast.replay import read, show
from rss_shield.envs.stock import drivers_unchanged

ENV = "highway-fast-v0"


@pytest.fixture(autouse=True)
def _drivers_unchanged():
    with drivers_unchanged():
        yield


def test_chosen_environments_are_recorded_frame_by_frame():
    env = rss_shield.make_vec(ENV, 3, shield=None)
    env.reset(seed=0)
    env.recording.choose([2])
    while not env.recording.finished:
        before = env.engine.batch.cars[2].copy()
        env.step(np.full(3, 3))
    log = env.recording.finished[0]
    assert log.env == 2 and log.complete
    assert (len(log.cars) - 1) % 5 == 0
    assert (log.present == 21).all()
    assert np.array_equal(log.cars[-6], before)
    assert log.cars["crashed"][-1].any()
    assert len(env.recording.running(2).cars) == 1


@pytest.mark.parametrize("env_id", [ENV, "merge-v0", "exit-v0", "roundabout-v0", "intersection-v0"])
def test_a_loaded_state_goes_on_like_the_engine(env_id):
    fast = rss_shield.make_vec(env_id, 1, shield=None)
    fast.reset(seed=4)
    fast.step(np.array([1]))
    stock = gym.make(env_id).unwrapped
    stock.reset(seed=0)
    show(stock, fast.engine.batch.cars[0], fast.scenario.network, fast.engine.batch.episodes[0])
    for action in (1, 0, stock.action_type.actions_indexes["FASTER"]):
        seen, reward, *_ = stock.step(action)
        observations, rewards, *_ = fast.step(np.array([action]))
        np.testing.assert_allclose(seen, observations[0], atol=1e-6)
        assert reward == pytest.approx(rewards[0], abs=1e-8)


@pytest.mark.parametrize("env_id", [ENV, "merge-v0", "exit-v0", "roundabout-v0", "intersection-v0"])
def test_a_state_of_highway_env_goes_on_in_the_engine(env_id):
    stock = gym.make(env_id).unwrapped
    stock.reset(seed=11)
    stock.step(1)
    fast = rss_shield.make_vec(env_id, 1, shield=None)
    fast.reset(seed=0)
    batch = fast.engine.batch
    read(stock, batch.cars[0], batch.episodes[0], batch.order[0], fast.scenario.network)
    for action in (2, 0, 1):
        seen, reward, terminated, truncated, _ = stock.step(action)
        observations, rewards, *_ = fast.step(np.array([action]))
        if terminated or truncated:
            break  # the engine has begun the next episode
        np.testing.assert_allclose(seen, observations[0], atol=1e-6)
        assert reward == pytest.approx(rewards[0], abs=1e-8)
