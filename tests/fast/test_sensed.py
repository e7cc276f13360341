"""Sensing errors in the engine: those of highway-env, to the last frame."""

import numpy as np
import pytest

from rss_shield import make, make_vec

NOISE = dict(along=0.5, across=0.3, speed=1.0, heading=0.02, misses=0.2, ghosts=0.3, wrong_lane=0.1, latency=0.14)
CASES = {
    "errors": NOISE,
    "inflated": NOISE | {"inflate": True, "agent": True},
    "three": NOISE | {"subsystems": 3, "noise": "gaussian", "hold": 0.3, "excess": 1.5},
}


def both(env_id, steps, **options):
    """What both simulators say of the same episodes, as (observations, rewards, ends, infos) per step."""
    told = []
    for backend in ("fast", "highway-env"):
        envs = make_vec(env_id, 2, backend=backend, **options)
        rng, rows = np.random.default_rng(0), [(envs.reset(seed=11)[0],)]
        for _ in range(steps):
            actions = rng.choice([0, 1, 2, 3, 3, 3, 4], 2)
            observations, rewards, terminated, truncated, infos = envs.step(actions)
            shares = [infos["shield"][name] for name in ("override_fraction", "broken_duties", "partner")]
            rows.append((observations, rewards, terminated | truncated, infos["speed"], *shares, infos["blame"]))
        told.append(rows)
    return told


@pytest.mark.parametrize("name", CASES)
def test_both_simulators_have_the_same_errors(name):
    engine, original = both("highway-fast-v0", 40, sensing=CASES[name])
    for row, expected in zip(engine, original, strict=True):
        for value, other in zip(row, expected, strict=True):
            assert np.array_equal(value, other)


def test_the_judge_goes_by_what_is_there_in_both_simulators():
    """Once the engine's judge took what the shield had inflated for vague, and asked the ego for brakes."""
    options = {"params": {"ego": {"response_time": 0.8}}, "sensing": {"latency": 0.4, "inflate": True}}
    envs, env = make_vec("highway-fast-v0", 1, **options), make("highway-fast-v0", **options)
    envs.reset(seed=[930_365]), env.reset(seed=930_365)
    for _ in range(18):
        infos, info = envs.step(np.array([3]))[-1], env.step(3)[-1]
    assert info["episode_dangerous_pairs"] == infos["episode_dangerous_pairs"][0] == 86
    assert info["episode_broken_duties"] == infos["episode_broken_duties"][0] == 0


def test_sensing_without_errors_changes_nothing():
    plain, sensed = (make_vec("highway-fast-v0", 8, sensing=given) for given in (None, {}))
    plain.reset(seed=0), sensed.reset(seed=0)
    for _ in range(40):
        one, other = plain.step(np.full(8, 3)), sensed.step(np.full(8, 3))
        assert np.array_equal(one[0], other[0]) and np.array_equal(one[1], other[1])
        for name in ("dangerous_pairs", "override_fraction", "min_margin_lon", "partner"):
            assert np.array_equal(one[4]["shield"][name], other[4]["shield"][name]), name
        assert list(one[4]["blame"]) == list(other[4]["blame"])


def test_masks_are_of_what_is_seen_and_change_nothing():
    asked, silent = (make_vec("highway-fast-v0", 4, sensing=CASES["inflated"]) for _ in range(2))
    asked.reset(seed=3), silent.reset(seed=3)
    for _ in range(25):
        asked.action_masks()
        assert np.array_equal(asked.step(np.full(4, 3))[0], silent.step(np.full(4, 3))[0])


@pytest.mark.parametrize(
    ("env_id", "given", "message"),
    [
        ("intersection-v0", dict(along=1.0), "sensing where roads cross; expected backend = 'highway-env'"),
        ("highway-fast-v0", dict(wrong_light=0.1), "expected 0 where there are no lights"),
    ],
)
def test_what_the_engine_does_not_have_is_refused_by_name(env_id, given, message):
    with pytest.raises(ValueError, match=message):
        make_vec(env_id, 1, sensing=given)
