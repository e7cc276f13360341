"""What a cell of the comparison reports."""

import numpy as np
import pandas as pd
import pytest
from result_tables import episodes_of

from rss_shield.eval.metrics import METRICS, differences, summarise, with_outcomes
from rss_shield.eval.rollout import RISK
from rss_shield.shield.verdicts import BLAMES, VERDICTS

# (blame, crashed, simulator's own meaning): the six things that can happen
OF_A_GOAL = ("success", "time_to_goal")
MEASURED = (
    *("frozen", "near_misses", "impact", "impact_delta_v", "min_thw_ahead", "max_drac_ahead", "min_pet"),
    *("violation_ego", "violation_other", "shield_time"),
)
OWN = ["own_return"]  # where there is a reward of one's own
ALWAYS = [metric.name for metric in METRICS if metric.name not in (*OF_A_GOAL, *RISK, *MEASURED, *OWN)]
OUTCOMES = ["", "ego", "both", "other", "inherited", "none"]


def test_tables_show_every_verdict_once():
    assert sorted(BLAMES) == sorted(VERDICTS)


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
    assert list(summary.index) == ALWAYS
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


def test_risk_is_summarised_where_it_was_measured():
    episodes = episodes_of([""] * 4).assign(max_rdsi=[0.5, 0.7, 0.9, 4.0], time_known_unsafe=[0.0, 0.0, 1.0, 3.0])
    summary = summarise(episodes).set_index("metric")
    assert list(summary.index) == [*ALWAYS, "max_rdsi", "time_known_unsafe"]
    assert summary.loc["max_rdsi", "value"] == pytest.approx(0.8)  # median
    assert summary.loc["time_known_unsafe", "value"] == 1.0  # mean


def crossings_of(times: list[float], successes: list[bool], test: str = "off") -> pd.DataFrame:
    return episodes_of([""] * len(times), test=test).assign(time=times, success=successes)


def test_the_time_to_the_goal_is_that_of_the_episodes_that_reach_it():
    summary = summarise(crossings_of([6.0, 13.0, 8.0, 13.0], [True, False, True, False])).set_index("metric")
    assert list(summary.index) == [metric.name for metric in METRICS if metric.name not in (*RISK, *MEASURED, *OWN)]
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
    assert list(zip(first["train"], first["test"], strict=True))[:: len(ALWAYS)] == [
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


def test_who_learns_nothing_is_paired_with_every_training_seed_whoever_comes_first():
    trained = pd.concat(
        [episodes_of([""] * 4, "on", "on").assign(train_seed=k, **{"return": 5.0 * k}) for k in range(3)]
    )
    scripted = episodes_of([""] * 4, "lazy", "on").assign(train_seed=0, **{"return": 1.0})
    for cells, sign in (([scripted, trained], 1), ([trained, scripted], -1)):
        row = differences(pd.concat(cells)).set_index("metric").loc["return"]
        assert row[["value", "n", "seeds"]].tolist() == [sign * 4.0, 12, 3]
        assert row["seed_low"] < sign * 4.0 < row["seed_high"]


def of_seeds(*returns: list[float], blames=None) -> pd.DataFrame:
    """Training seeds 0, 1, ... with the returns of their test episodes."""
    return pd.concat(
        [
            episodes_of(blames or [""] * len(values)).assign(**{"train_seed": seed, "return": values})
            for seed, values in enumerate(returns)
        ],
        ignore_index=True,
    )


def test_the_interval_over_seeds_is_students_of_the_seeds_means():
    summary = summarise(of_seeds([9.0, 11.0] * 50, [19.0, 21.0] * 50, [29.0, 31.0] * 50)).set_index("metric")
    # means 10, 20, 30: s = 10, t of 2 degrees of freedom is 4.303: 20 +- 4.303 * 10 / sqrt(3)
    assert summary.loc["return", ["seed_low", "seed_high", "seeds"]].tolist() == pytest.approx(
        [-4.84, 44.84, 3], abs=0.01
    )
    assert summary.loc["return", "high"] < 22


@pytest.mark.parametrize("seeds", [2, 3, 5])
def test_seeds_that_agree_know_no_more_than_their_episodes(seeds):
    summary = summarise(of_seeds(*[[1.0, 2.0, 3.0, 4.0]] * seeds)).set_index("metric")
    for metric in ("crash", "at_fault", "return"):
        row = summary.loc[metric]
        assert (row["seed_low"], row["seed_high"]) == (row["low"], row["high"])
        assert row["seed_high"] > 0


@pytest.mark.parametrize("crashes", [1, 2, 4])
def test_an_interval_of_a_rate_stays_a_rate(crashes):
    blames = ["ego"] * crashes + [""] * (5 - crashes)
    episodes = pd.concat([of_seeds([0.0] * 5, blames=blames), of_seeds([0.0] * 5).assign(train_seed=1)])
    row = summarise(episodes).set_index("metric").loc["crash"]
    assert 0 <= row["seed_low"] <= row["low"] <= row["value"] <= row["high"] <= row["seed_high"] <= 1


@pytest.mark.slow
def test_the_interval_over_seeds_covers_what_training_gives_on_average():
    rng, covered = np.random.default_rng(5), 0
    for _ in range(60):
        means = rng.normal(20, 3, 4)
        row = summarise(of_seeds(*rng.normal(means[:, None], 2, (4, 25)).tolist())).set_index("metric").loc["return"]
        covered += row["seed_low"] <= 20 <= row["seed_high"]
    assert covered >= 53


def test_one_seed_says_nothing_about_others():
    row = summarise(of_seeds([1.0, 2.0])).set_index("metric").loc["return"]
    assert np.isnan(row["seed_low"])
    assert np.isnan(row["seed_high"])
    assert row["seeds"] == 1


def test_differences_have_an_interval_over_seeds_too():
    baseline = of_seeds([1.0, 2.0], [1.0, 2.0], [1.0, 2.0])
    changed = of_seeds([2.0, 3.0], [3.0, 4.0], [4.0, 5.0]).assign(test="on")
    row = differences(pd.concat([baseline, changed])).set_index("metric").loc["return"]
    # 1, 2, 3: s = 1; 2 +- 4.303 / sqrt(3)
    assert row[["seed_low", "seed_high", "seeds"]].tolist() == pytest.approx([-0.484, 4.484, 3], abs=1e-3)


def test_equal_values_of_two_metrics_have_equal_intervals():
    baseline = episodes_of(["ego"] * 7 + [""] * 33)
    changed = episodes_of(["ego"] * 2 + [""] * 38, test="on").assign(**{"return": np.arange(40) ** 2.0})
    episodes = pd.concat([baseline, changed]).assign(rms_jerk=lambda rows: rows["return"])
    for table in (summarise(episodes), differences(episodes)):
        rows = table.drop(columns=["train"]).set_index(["test", "metric"]).loc["on"]
        assert rows.loc["return"].equals(rows.loc["rms_jerk"])
        assert rows.loc["crash"].equals(rows.loc["at_fault"])


def test_one_cell_alone_has_no_differences():
    assert differences(episodes_of(["ego"])).empty
