"""An ego that is restricted by one table and judged by another."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from rss_shield import Rules, make, make_vec
from rss_shield.envs.fast.config import Unsupported

JUDGED = ("cost", "blame", "blame_evidence", "episode_cost", "episode_dangerous_pairs", "episode_broken_duties")
JUDGED_IN_A_STEP = ("dangerous", "dangerous_pairs", "broken_duties")
QUICK = {"ego": {"response_time": 0.4}, "other": {"response_time": 0.4}}
SLOW = {"ego": {"response_time": 1.2}, "other": {"response_time": 1.6}}
CASES = [
    ("highway-fast-v0", {}),
    ("highway-fast-v0", {"action": {"type": "ContinuousAction"}}),
    ("merge-v0", {}),
    ("two-way-v0", {}),
    ("intersection-v0", {"duration": 10}),
    ("intersection-v1", {"duration": 8, "destination": "o1"}),
    ("roundabout-v0", {}),
    ("signalised-intersection-v0", {"duration": 10}),
]


def _play(env, seed, steps=12):
    """Infos of an episode of actions that depend on the seed alone, and where everybody was."""
    env.reset(seed=seed)
    env.action_space.seed(seed)
    trace = []
    for _ in range(steps):
        *_, reward, terminated, truncated, info = env.step(env.action_space.sample())
        cars = env.unwrapped.road.vehicles
        trace.append((info, reward, np.array([(*car.position, car.speed) for car in cars])))
        if terminated or truncated:
            break
    return trace


def _judged(info):
    return {key: info[key] for key in JUDGED} | {key: info["shield"][key] for key in JUDGED_IN_A_STEP}


def _rest(info):
    actions = ("proposed_action", "executed_action")
    kept = {key: value for key, value in info["shield"].items() if key not in (*JUDGED_IN_A_STEP, *actions)}
    return {key: info[key] for key in ("override_share", "min_ttc", "time", "raw_reward")} | kept


@pytest.mark.parametrize(("env_id", "config"), CASES)
@pytest.mark.parametrize("seed", [0, 3, 7])
def test_a_judge_sees_what_a_shield_with_its_table_would_have_seen(env_id, config, seed):
    """Nothing is overridden here, so that all three see the same episode."""
    options = {"shield": "monitor", "config": config}
    by_two = _play(make(env_id, params=SLOW, judge_params=QUICK, **options), seed)
    restricting, judging = (_play(make(env_id, params=params, **options), seed) for params in (SLOW, QUICK))
    for (info, *_), (own, *_), (other, *_) in zip(by_two, restricting, judging, strict=True):
        assert _rest(info) == _rest(own)
        assert _judged(info) == _judged(other)


@pytest.mark.parametrize(("env_id", "config"), CASES)
@pytest.mark.parametrize("seed", [1, 4])
def test_a_judge_changes_nothing_but_the_verdict(env_id, config, seed):
    alone, watched = (_play(make(env_id, config=config, judge_params=judge), seed) for judge in (None, SLOW))
    for (info, reward, places), (again, reward_again, places_again) in zip(alone, watched, strict=True):
        assert reward == reward_again
        np.testing.assert_array_equal(places, places_again)
        assert _rest(info) == _rest(again)


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v0", "intersection-v0", "roundabout-v0"])
@pytest.mark.parametrize("judge", [{"judge_params": "own"}, {"judge_rules": Rules()}, {"judge_rules": {}}])
def test_a_judge_with_the_shields_own_table_says_what_the_shield_says(env_id, judge):
    if "judge_params" in judge:
        judge = {"judge_params": "intersection" if env_id == "intersection-v0" else "simulator"}
    for seed in (2, 5):
        own, watched = _play(make(env_id), seed), _play(make(env_id, **judge), seed)
        assert [_judged(info) for info, *_ in own] == [_judged(info) for info, *_ in watched]


def test_a_sweep_over_response_times_has_one_judge():
    """The slower the shield is taken to be, the more distance it keeps: by one judge, in fewer dangers."""
    dangers = []
    for rho in (0.2, 0.6, 1.0):
        env = make(
            "highway-fast-v0", params={"ego": {"response_time": rho}}, judge_params={"ego": {"response_time": 1.0}}
        )
        dangers.append(sum(_play(env, seed, 30)[-1][0]["episode_dangerous_pairs"] for seed in range(4)))
    assert dangers[0] > dangers[-1]


def test_a_shield_without_a_duty_is_at_fault_by_the_full_table():
    env = make(
        "highway-fast-v0",
        rules={"longitudinal": False, "lateral": False, "present_duties": False, "anticipation": 0.0},
        judge_rules=Rules(),
    )
    verdicts = []
    for seed in range(4):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(3)
            done = terminated or truncated
        verdicts.append(info["blame"])
        assert info["episode_broken_duties"] > 0
    assert "ego" in verdicts


def test_the_audit_is_by_the_judges_table():
    env = make("highway-fast-v0", params=SLOW, judge_params=QUICK, record=True)
    infos = [info for info, *_ in _play(env, 1, 30)]
    assert env.audit().dangerous.sum() == infos[-1]["episode_dangerous_pairs"] > 0


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0"])
def test_copies_and_specifications_keep_the_judge(env_id):
    env = make(env_id, params=QUICK, judge_params=SLOW, judge_rules={"memory": False})
    env.reset(seed=6)
    env.step(1)
    twin = copy.deepcopy(env)
    expected = [_judged(env.step(1)[4]) for _ in range(3)]
    assert [_judged(twin.step(1)[4]) for _ in range(3)] == expected
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.judge[0][:2] == env.judge[0][:2] and again.judge[1] == env.judge[1] == Rules(memory=False)


def test_agents_have_a_judge_each():
    options = {"shield": "monitor", "config": {"duration": 8}}
    env_id = "intersection-multi-agent-v0"
    by_two, judging = (
        _play(make(env_id, **tables, **options), 9)
        for tables in ({"params": SLOW, "judge_params": QUICK}, {"params": QUICK})
    )
    for (info, *_), (other, *_) in zip(by_two, judging, strict=True):
        assert [_judged(one) for one in info["agents"]] == [_judged(one) for one in other["agents"]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"judge_params": "carlo"}, "judge_params = 'carlo': expected one of simulator"),
        ({"judge_rules": {"memory": 1.5}}, r"judge_rules\.memory = 1\.5: expected True or False"),
        ({"judge_params": {"ego": {"mu": -1}}}, r"judge_params\.ego: mu = -1 is out of range"),
    ],
)
def test_a_wrong_table_of_the_judge_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        make("highway-fast-v0", **arguments)


@pytest.mark.parametrize("arguments", [{"judge_params": "carla"}, {"judge_rules": Rules()}])
def test_the_engine_names_what_it_does_not_do(arguments):
    with pytest.raises(
        Unsupported, match=f"does not support {next(iter(arguments))} = .*; expected backend = 'highway-env'"
    ):
        make_vec("highway-fast-v0", 1, **arguments)
    env = make_vec("highway-fast-v0", 1, backend="highway-env", **arguments)
    env.reset(seed=1)
    env.step([3])
