"""Agents that see their last observations: what is kept, where it begins anew, on every kind of autoreset."""

import gymnasium as gym
import numpy as np
import pytest
from fake_env import FakeEnv
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from rss_shield import make_vec
from rss_shield.agents.history import History, with_history

ALL = [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED]


def recorded(mode, steps=40):
    """Observations, last observations, and episodes begun, by hand: [(what was seen, what the wrapper showed)]."""
    rng, pairs = np.random.default_rng(0), []
    env = History(SyncVectorEnv([FakeEnv] * 3, autoreset_mode=mode), 3)
    shown, _ = env.reset(seed=[0, 1, 2])
    seen = [[row] for row in shown[:, -1].tolist()]  # of the episode that goes on
    pairs += [(seen[e][:], shown[e]) for e in range(3)]
    over = np.zeros(3, bool)
    for _ in range(steps):
        shown, _, terminated, truncated, infos = env.step(rng.integers(2, size=3))
        ended = terminated | truncated
        for e in range(3):
            if mode == AutoresetMode.SAME_STEP and ended[e]:
                final = infos["final_obs"][e]
                pairs.append(([*seen[e], final[-1].tolist()], final))
                seen[e] = []
            if mode == AutoresetMode.NEXT_STEP and over[e]:
                seen[e] = []
            seen[e].append(shown[e, -1].tolist())
            pairs.append((seen[e][:], shown[e]))
        over = ended
        if mode == AutoresetMode.DISABLED and ended.any():
            shown, _ = env.reset(options={"reset_mask": ended})
            for e in np.flatnonzero(ended):
                seen[e] = [shown[e, -1].tolist()]
            pairs += [(seen[e][:], shown[e]) for e in range(3)]
    return pairs


@pytest.mark.parametrize("mode", ALL, ids=lambda mode: mode.value)
def test_the_last_three_are_shown_the_newest_at_the_end(mode):
    pairs = recorded(mode)
    lengths = {len(seen) for seen, _ in pairs}
    assert {1, 2, 3, 4} <= lengths
    for seen, shown in pairs:
        padded = [seen[0]] * 2 + seen
        np.testing.assert_array_equal(shown, padded[-3:])


def test_spaces_say_what_is_shown_and_nothing_changes_afterwards():
    env = with_history(make_vec("highway-fast-v0", 2), 4)
    first, _ = env.reset(seed=0)
    kept = first.copy()
    assert first.shape == env.observation_space.shape == (2, 4, 5, 5)
    assert env.single_observation_space.shape == (4, 5, 5)
    assert env.observation_space.dtype == first.dtype
    second = env.step(np.array([3, 3]))[0]
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(second[:, :-1], first[:, 1:])
    assert env.action_masks().shape == (2, 5)  # what the engine can do besides
    env.close()


def test_the_engine_says_how_an_episode_ended_with_its_history():
    bare, env = (make_vec("highway-fast-v0", 3, config={"duration": 5}) for _ in range(2))
    env = with_history(env, 2)
    bare.reset(seed=0)
    before, _ = env.reset(seed=0)
    for _ in range(12):
        alone = bare.step(np.full(3, 3))
        shown, _, terminated, truncated, infos = env.step(np.full(3, 3))
        for e in np.flatnonzero(terminated | truncated):
            np.testing.assert_array_equal(infos["final_obs"][e], [before[e, -1], alone[4]["final_obs"][e]])
            np.testing.assert_array_equal(shown[e], [alone[0][e]] * 2)
        before = shown
    bare.close()
    env.close()


def test_one_observation_is_no_history():
    env = make_vec("highway-fast-v0", 1)
    assert with_history(env, 1) is env
    env.close()


def test_what_is_no_array_is_refused():
    class Pair(gym.Env):
        observation_space = gym.spaces.Tuple([gym.spaces.Box(0, 1, (2,))] * 2)
        action_space = gym.spaces.Discrete(2)

    with pytest.raises(ValueError, match="history = 2: observations are a Tuple; expected arrays"):
        History(SyncVectorEnv([Pair]), 2)
