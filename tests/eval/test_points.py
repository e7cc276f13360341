"""Points of an experiment: which metrics are better small, and what a figure shows of them."""

import numpy as np
import pandas as pd
import pytest
from result_tables import episodes_of

from rss_shield.eval.metrics import METRICS, summarise
from rss_shield.eval.paper.words import of_sweep
from rss_shield.eval.runs.points import point_row, with_front
from rss_shield.eval.runs.tables import plot_front

MEASURED = ("max_rdsi", "max_drac", "band_risk", "time_known_unsafe", "time_unknown", "impact_delta_v")


@pytest.mark.parametrize("safety", ["at_fault", "max_drac_ahead", *MEASURED])
def test_of_two_equally_good_agents_the_one_in_less_danger_is_on_the_front(safety):
    front = with_front(pd.DataFrame({safety: [1.0, 2.0], "return": [5.0, 5.0]}), safety, "return")
    assert front["front"].tolist() == [True, False]


def test_what_is_called_a_largest_value_is_better_small_and_a_smallest_one_better_large():
    for metric in METRICS:
        if metric.name.startswith(("max_", "min_")):
            assert metric.less_is_better == metric.name.startswith("max_")


def test_where_no_point_has_both_metrics_that_is_said():
    table = pd.DataFrame({"policy": ["a", "b"], "crash": [0.0, 0.5], "time_to_goal": [np.nan, np.nan]})
    table = with_front(table, "crash", "time_to_goal")
    (said,) = of_sweep(table, ["policy"], [("", [0, 1])], "crash", "time_to_goal")
    assert said == "None of 2 points has both time to goal and crash."


def test_a_point_has_the_values_of_the_table_of_the_same_episodes():
    first, second = episodes_of(["ego"] * 2 + [""] * 3), episodes_of(["ego"] + [""] * 4).assign(train_seed=1)
    second["min_ttc"] = second["min_ttc"] ** 2
    # of one seed 0, 1, 2, 3, 4, of the other 0, 1, 4, 9, 16: the median of all is 2.5, the mean of medians 3
    episodes = {
        k: rows.assign(time=rows["min_ttc"], success=rows["min_ttc"] > k) for k, rows in ((0, first), (1, second))
    }
    point = {row["metric"]: row["value"] for row in point_row({}, episodes)}
    table = summarise(pd.concat(episodes.values(), ignore_index=True)).set_index("metric")["value"]
    assert point["min_ttc"] == table["min_ttc"] == 2.5
    assert point == pytest.approx(table.to_dict())


@pytest.mark.parametrize("pooled", [False, True])
def test_equal_outcomes_have_equal_intervals_in_a_point(pooled):
    episodes = {k: episodes_of(["ego"] * (4 + 2 * k) + [""] * (16 - 2 * k)) for k in range(5)}
    rows = {row.pop("metric"): row for row in point_row({}, episodes, pooled=pooled)}
    assert rows["crash"] == rows["at_fault"]


def of_points(table, axes, performance="return"):
    return of_sweep(
        with_front(table, "at_fault", performance), axes, [("", list(range(len(table))))], "at_fault", performance
    )


def test_a_sweep_is_told_in_the_units_of_its_table():
    table = pd.DataFrame({"ego.mu": [0.1 + 0.2, 1.0], "at_fault": [0.075, 0.0], "return": [21.04, 20.0]})
    (said,) = of_points(table, ["ego.mu"])
    assert said.endswith("The best return there is 21.0, with ego at fault 8 % (ego.mu = 0.3).")


def test_the_best_of_what_is_better_small_is_the_smallest():
    table = pd.DataFrame({"entry": ["a", "b"], "at_fault": [0.1, 0.0], "override_share": [0.25, 0.5]})
    (said,) = of_points(table, ["entry"], "override_share")
    assert "The best overridden there is 25 %, with ego at fault 10 % (entry = a)." in said


def test_a_single_point_is_told_without_a_front():
    table = pd.DataFrame({"at_fault": [0.0], "return": [20.0]})
    assert of_points(table, []) == ["One point: return 20.0, ego at fault 0 %."]


@pytest.mark.parametrize("groups", [1, 2, 3, 4, 5])
def test_a_panel_without_points_is_not_drawn(groups):
    names = [f"environment {k}" for k in range(groups)]
    columns = {f"{name}{end}": np.ones(groups) for name in ("at_fault", "return") for end in ("", "_low", "_high")}
    table = with_front(pd.DataFrame({"environment": names, **columns}), "at_fault", "return")
    figure = plot_front(table, ["environment"], "at_fault", "return", "title")
    assert sum(axes.axison for axes in figure.axes) == groups
