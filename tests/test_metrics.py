"""What a cell of the comparison reports."""

import numpy as np
import pandas as pd
import pytest

from eval.metrics import METRICS, differences, summarise, with_outcomes

# (blame, crashed, simulator's own meaning): the six things that can happen
OF_A_GOAL = ("success", "time_to_goal")
OUTCOMES = ["", "ego", "both", "other", "inherited", "none"]


def episodes_of(blames: list[str], train: str = "off", test: str = "off", crashed=None) -> pd.DataFrame:
    n = len(blames)
    return pd.DataFrame(
        {
            "seed": range(n),
            "train_seed": 0,
            "train": train,
            "test": test,
            "blame": blames,
            "crashed": [bool(b) for b in blames] if crashed is None else crashed,
            "return": np.arange(n, dtype=float),
            "speed": 25.0,
            "length": 10,
            "override_share": 0.25,
            "anticipation_share": 0.5,
            "mean_acceleration_change": 1.5,
            "rms_jerk": np.arange(n, dtype=float),
            "hard_braking_share": 0.125,
            "comfortable_share": 0.75,
            "min_time_gap": np.arange(n, dtype=float),
            "min_ttc": np.arange(n, dtype=float),
        }
    )


def test_every_crash_has_exactly_one_outcome():
    outcomes = with_outcomes(episodes_of(OUTCOMES))
    parts = outcomes[["at_fault", "other", "inherited", "none"]].astype(int)
    assert list(parts.sum(axis=1)) == [0, 1, 1, 1, 1, 1]
    assert list(outcomes["crash"]) == [False, True, True, True, True, True]
    assert list(outcomes["at_fault"]) == [False, True, True, False, False, False]


def test_a_crash_without_a_verdict_is_not_lost():
    outcomes = with_outcomes(episodes_of(["", ""], crashed=[True, False]))
    assert list(outcomes["none"]) == [True, False]


def test_a_cell_is_summarised_by_hand_computed_values():
    summary = summarise(episodes_of(["ego", "both", "other", ""])).set_index("metric")
    assert list(summary.index) == [metric.name for metric in METRICS if metric.name not in OF_A_GOAL]
    expected = {
        "crash": 3 / 4,
        "at_fault": 2 / 4,
        "other": 1 / 4,
        "inherited": 0.0,
        "none": 0.0,
        "return": 1.5,  # mean of 0, 1, 2, 3
        "speed": 25.0,
        "length": 10.0,
        "override_share": 0.25,
        "anticipation_share": 0.5,
        "mean_acceleration_change": 1.5,
        "rms_jerk": 1.5,
        "hard_braking_share": 0.125,
        "comfortable_share": 0.75,
        "min_time_gap": 1.5,  # median likewise
        "min_ttc": 1.5,  # median of 0, 1, 2, 3
    }
    assert summary["value"].to_dict() == pytest.approx(expected)
    assert (summary["n"] == 4).all()
    assert (summary["low"] <= summary["value"]).all()
    assert (summary["value"] <= summary["high"]).all()


def crossings_of(times: list[float], successes: list[bool], test: str = "off") -> pd.DataFrame:
    return episodes_of([""] * len(times), test=test).assign(time=times, success=successes)


def test_the_time_to_the_goal_is_that_of_the_episodes_that_reach_it():
    summary = summarise(crossings_of([6.0, 13.0, 8.0, 13.0], [True, False, True, False])).set_index("metric")
    assert list(summary.index) == [metric.name for metric in METRICS]
    assert summary.loc["success", ["value", "n"]].tolist() == [0.5, 4]
    assert summary.loc["time_to_goal", ["value", "n"]].tolist() == [7.0, 2]  # mean of 6 and 8


def test_where_nobody_reaches_the_goal_there_is_no_time_to_it():
    summary = summarise(crossings_of([13.0] * 3, [False] * 3)).set_index("metric")
    assert summary.loc["success", "value"] == 0
    assert summary.loc["time_to_goal", "n"] == 0
    assert summary.loc["time_to_goal", ["value", "low", "high"]].isna().all()


def test_times_to_the_goal_are_compared_where_both_reach_it():
    baseline = crossings_of([6.0, 13.0, 8.0, 7.0], [True, False, True, True])
    changed = crossings_of([8.0, 9.0, 13.0, 9.0], [True, True, False, True], test="on")
    result = differences(pd.concat([baseline, changed])).set_index("metric")
    assert result.loc["time_to_goal", ["value", "n"]].tolist() == [2.0, 2]  # 8 - 6 and 9 - 7
    assert result.loc["success", ["value", "n"]].tolist() == [0.0, 4]


def test_cells_keep_their_order_and_the_same_episodes_give_the_same_summary():
    episodes = pd.concat([episodes_of(["ego"] * 5, "on", "off"), episodes_of([""] * 5, "off", "on")])
    first, second = summarise(episodes), summarise(episodes)
    assert list(zip(first["train"], first["test"], strict=True))[:: len(METRICS) - len(OF_A_GOAL)] == [
        ("on", "off"),
        ("off", "on"),
    ]
    pd.testing.assert_frame_equal(first, second)


def test_differences_are_paired_by_seed_whatever_the_order_of_rows():
    baseline = episodes_of(["ego"] * 6)
    changed = episodes_of([""] * 6, test="on").assign(**{"return": baseline["return"] + 2})
    result = differences(pd.concat([baseline, changed.iloc[::-1]])).set_index("metric")
    assert result.loc["return", ["value", "low", "high"]].tolist() == [2.0, 2.0, 2.0]
    assert result.loc["crash", "value"] == -1.0
    assert result.loc["crash", "n"] == 6


def test_one_cell_alone_has_no_differences():
    assert differences(episodes_of(["ego"])).empty
