"""Episodes on fixed seeds, against a fake environment whose every number is known."""

import json
from functools import partial

import numpy as np
import pandas as pd
import pytest
from gymnasium.vector import AutoresetMode

import rss_shield
from rss_shield.eval.rollout import MOST_DRAC, RISK, evaluate, run_episode
from tests.fake_env import BRAKE, FakeEnv, FakeEnvWithGoal, brake, go, untouched_vec


def test_a_crash_is_recorded_with_its_numbers():
    record = run_episode(FakeEnv, go, seed=6)  # crashes at decision 3 + 6 % 5 = 4, verdict ego
    assert json.loads(record.pop("evidence")) == {"partner": 4, "excess": 0.5}
    assert record == {
        "seed": 6,
        "return": 10.0,  # 1 + 2 + 3 + 4
        "length": 4,
        "time": 2.0,
        "speed": 22.5,  # mean of 21, 22, 23, 24
        "crashed": True,
        "env_crashed": True,
        "blame": "ego",
        "inherited": False,
        "cost": 1.0,
        "override_share": 0.0,
        "dangerous_pairs": 4,
        "broken_duties": 1,
        "min_ttc": 96.0,
    }


def test_risk_is_recorded_where_it_is_measured():
    env = rss_shield.make("highway-fast-v0", "monitor", risk=True, max_episode_steps=3)
    record = run_episode(lambda: env, lambda _: 3, seed=0)
    assert set(RISK) <= set(record)
    assert record["time_known_safe"] + record["time_unknown"] + record["time_known_unsafe"] == pytest.approx(3.0)
    assert record["max_rdsi"] > 0.0 and record["max_drac"] <= MOST_DRAC
    assert not set(RISK) & set(run_episode(FakeEnv, go, seed=6))


def test_a_contact_that_the_simulator_does_not_flag_is_a_crash():
    record = run_episode(FakeEnv, go, seed=7)
    assert (record["crashed"], record["env_crashed"]) == (True, False)
    assert record["inherited"]


def test_an_episode_without_a_crash_runs_to_its_end():
    record = run_episode(FakeEnv, brake, seed=6)
    assert (record["length"], record["crashed"], record["blame"]) == (10, False, "no contact")
    assert record["override_share"] == 1.0
    assert json.loads(record["evidence"]) == {}


@pytest.mark.parametrize(
    ("policy", "seed", "success"),
    [
        (brake, 4, True),  # ten decisions without a crash, and the goal lies at the seventh
        (go, 4, False),  # crashes at decision 3 + 4 = 7, at the goal: arrived, but not untouched
        (go, 3, False),  # crashes at decision 6, before it
    ],
)
def test_success_is_a_goal_reached_untouched(policy, seed, success):
    assert run_episode(FakeEnvWithGoal, policy, seed)["success"] is success


def test_without_a_goal_nobody_succeeds_or_fails():
    assert "success" not in run_episode(FakeEnv, brake, seed=4)
    assert "success" not in evaluate(untouched_vec, brake, [4])


def test_both_simulators_agree_on_who_gets_across_an_intersection_and_when():
    def full_speed(observations):
        return np.full(len(observations), 2)

    make_vec = partial(rss_shield.make_vec, "intersection-v0", shield="monitor", autoreset_mode=AutoresetMode.DISABLED)
    columns = ["seed", "length", "time", "success", "crashed"]
    engine, original = (
        evaluate(partial(make_vec, backend=backend), full_speed, range(6), n_envs=2)[columns]
        for backend in ("fast", "highway-env")
    )
    pd.testing.assert_frame_equal(engine, original)
    assert set(engine["success"]) == {True, False}
    assert engine["time"].equals(engine["length"] * 1.0)  # one decision a second


def brake_late(observations):
    """Brakes at the place of the crash of every third kind of road."""
    return np.where((observations[:, 1] % 3 == 0) & (observations[:, 0] > 1), BRAKE, 0)


def test_records_come_in_the_order_of_the_seeds():
    episodes = evaluate(untouched_vec, go, [5, 3, 8], n_envs=2)
    assert episodes["seed"].tolist() == [5, 3, 8]
    assert episodes["length"].tolist() == [3, 6, 6]
    assert episodes["actions"].tolist() == ["0 0 0", "0 0 0 0 0 0", "0 0 0 0 0 0"]


@pytest.mark.parametrize("policy", [go, brake])
def test_an_episode_side_by_side_with_others_has_the_record_of_one_alone(policy):
    seeds = range(100, 112)
    together = evaluate(untouched_vec, policy, seeds, n_envs=5).drop(columns="actions")
    alone = pd.DataFrame([run_episode(FakeEnv, policy, seed) for seed in seeds])
    pd.testing.assert_frame_equal(together, alone)


@pytest.mark.parametrize("n_envs", [2, 3, 7, 12, 100])
def test_the_number_of_environments_changes_nothing(n_envs):
    seeds = range(100, 112)
    one = evaluate(untouched_vec, brake_late, seeds, n_envs=1)
    assert one["length"].nunique() > 2
    pd.testing.assert_frame_equal(evaluate(untouched_vec, brake_late, seeds, n_envs=n_envs), one)


@pytest.mark.parametrize("n_envs", [1, 2, 6])
def test_nor_does_it_in_the_engine(n_envs):
    def faster_or_left(observations):
        return np.where(observations[:, 1, 1] < 0.15, 0, 3)  # where a car is close ahead, a lane to the left

    make_vec = partial(rss_shield.make_vec, "highway-fast-v0", shield="override", autoreset_mode=AutoresetMode.DISABLED)
    expected = evaluate(make_vec, faster_or_left, range(6), n_envs=4)
    pd.testing.assert_frame_equal(evaluate(make_vec, faster_or_left, range(6), n_envs=n_envs), expected)


def test_progress_counts_episodes_up_to_all_of_them():
    done = []
    evaluate(untouched_vec, go, range(9), n_envs=4, progress=done.append)
    assert done == sorted(done)
    assert done[-1] == 9
