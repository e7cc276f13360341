"""Episodes on fixed seeds, against a fake environment whose every number is known."""

import json

import pandas as pd

from eval.rollout import evaluate, run_episode
from tests.fake_env import FakeEnv, brake, go, make_brake, make_go


def test_a_crash_is_recorded_with_its_numbers():
    record = run_episode(FakeEnv, go, seed=6)  # crashes at decision 3 + 6 % 5 = 4, verdict ego
    assert json.loads(record.pop("evidence")) == {"partner": 4, "excess": 0.5}
    assert record == {
        "seed": 6,
        "return": 10.0,  # 1 + 2 + 3 + 4
        "length": 4,
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


def test_a_contact_that_the_simulator_does_not_flag_is_a_crash():
    record = run_episode(FakeEnv, go, seed=7)
    assert (record["crashed"], record["env_crashed"]) == (True, False)
    assert record["inherited"]


def test_an_episode_without_a_crash_runs_to_its_end():
    record = run_episode(FakeEnv, brake, seed=6)
    assert (record["length"], record["crashed"], record["blame"]) == (10, False, "")
    assert record["override_share"] == 1.0
    assert record["evidence"] == ""


def test_records_come_in_the_order_of_the_seeds():
    episodes = evaluate(FakeEnv, make_go, [5, 3, 8])
    assert episodes["seed"].tolist() == [5, 3, 8]
    assert episodes["length"].tolist() == [3, 6, 6]


def test_the_number_of_processes_changes_nothing():
    seeds = range(100, 112)
    pd.testing.assert_frame_equal(
        evaluate(FakeEnv, make_brake, seeds, n_workers=1), evaluate(FakeEnv, make_brake, seeds, n_workers=2)
    )
