"""What a cell of the comparison reports."""

import numpy as np
import pandas as pd
import pytest

from eval.metrics import METRICS, differences, summarise, with_outcomes

# (blame, crashed, simulator's own meaning): the six things that can happen
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
    assert list(summary.index) == [metric.name for metric in METRICS]
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
        "min_ttc": 1.5,  # median of 0, 1, 2, 3
    }
    assert summary["value"].to_dict() == pytest.approx(expected)
    assert (summary["n"] == 4).all()
    assert (summary["low"] <= summary["value"]).all()
    assert (summary["value"] <= summary["high"]).all()


def test_cells_keep_their_order_and_the_same_episodes_give_the_same_summary():
    episodes = pd.concat([episodes_of(["ego"] * 5, "on", "off"), episodes_of([""] * 5, "off", "on")])
    first, second = summarise(episodes), summarise(episodes)
    assert list(zip(first["train"], first["test"], strict=True))[:: len(METRICS)] == [("on", "off"), ("off", "on")]
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
