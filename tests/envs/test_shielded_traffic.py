"""A small share of `bench/evidence.py` on the original simulator: whatever the policy, never to blame."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.drivers import RECKLESS
from rss_shield.shield.params import Rules

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
TURNS = (Rules(anticipation=0.0, take_back=False), Rules())  # in turn: without anticipation there is more danger


def random_action(env, rng):
    return int(rng.integers(env.action_space.n))


def faster(env, rng):
    return 3


def change_lanes(env, rng):
    return int(rng.choice([0, 2]))


def random_controls(env, rng):
    return rng.uniform(-1.0, 1.0, 2)


def full_throttle(env, rng):
    return np.array([1.0, rng.uniform(-1.0, 1.0)])


CASES = [
    ("highway-fast-v0", random_action, {}, 8),
    ("highway-fast-v0", faster, {}, 5),
    ("highway-fast-v0", change_lanes, {}, 5),
    ("highway-fast-v0", random_controls, CONTINUOUS, 5),
    ("highway-fast-v0", full_throttle, CONTINUOUS | {"other_vehicles_type": RECKLESS}, 8),
    ("highway-fast-v0", random_action, {"other_vehicles_type": RECKLESS}, 5),
    ("merge-v0", random_action, {}, 8),
    ("merge-v1", faster, {}, 5),
    ("two-way-v0", random_action, {}, 10),
    ("two-way-v0", faster, {}, 10),
    ("exit-v0", random_action, {}, 4),
]


@pytest.mark.parametrize(
    ("env_id", "policy", "config", "episodes"),
    CASES,
    ids=[f"{case[0]}-{case[1].__name__}-{i}" for i, case in enumerate(CASES)],
)
def test_the_shielded_ego_keeps_every_duty_and_is_never_to_blame(env_id, policy, config, episodes):
    pairs = 0
    for seed in range(episodes):
        rng = np.random.default_rng(seed)
        env = make(env_id, config=config, rules=TURNS[seed % 2])
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(policy(env, rng))
            done = terminated or truncated
        assert info["blame"] in ("", "other", "inherited"), (seed, info["blame_evidence"])
        assert info["episode_broken_duties"] == 0, seed
        assert info["episode_cost"] == 0.0
        pairs += info["episode_dangerous_pairs"]
    assert pairs > 50, "too tame to show anything"


def test_the_shield_does_not_park_the_car():
    env = make("highway-fast-v0")
    returns = []
    for seed in range(5):
        env.reset(seed=seed)
        total, done = 0.0, False
        while not done:
            _, reward, terminated, truncated, _ = env.step(3)
            total += reward
            done = terminated or truncated
        returns.append(total)
    assert np.mean(returns) > 21.5  # always SLOWER, unshielded: 20.9


def test_without_the_shield_the_same_policy_is_to_blame():
    env = make("highway-fast-v0", shield="monitor")
    verdicts = []
    for seed in range(4):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(3)
            done = terminated or truncated
        verdicts.append(info["blame"])
    assert verdicts.count("ego") + verdicts.count("both") >= 3
