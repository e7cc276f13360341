"""Tests on the way through training, the frontier, and the cards of models: by hand, from episodes made up."""

import json

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from result_tables import episodes_of

from rss_shield.eval import frontier, multipliers, removal
from rss_shield.eval.cards import write_card
from rss_shield.eval.metrics import summarise

CRASHES = ["ego", "", "other", "", ""]


@pytest.mark.parametrize(
    ("last", "now", "due"),
    [(0, 99, False), (0, 100, True), (100, 199, False), (130, 200, True), (400, 999, True), (999, 1000, True)],
)
def test_a_test_is_due_when_another_mark_is_passed(last, now, due):
    rows = pd.DataFrame({"timesteps": [last] if last else []})
    assert removal.is_due(rows, now, total=1000, checks=10) is due


def test_rows_are_added_and_read_back(tmp_path):
    path = tmp_path / removal.FILE
    tests = {"off": episodes_of(CRASHES), "on": episodes_of([""] * 5, test="on")}
    removal.record(path, removal.read(path), 64, tests)
    removal.record(path, removal.read(path), 128, tests)
    rows = removal.read(path)
    assert tuple(rows.columns) == removal.COLUMNS
    assert list(zip(rows["timesteps"], rows["test"], strict=True)) == [
        (64, "off"),
        (64, "on"),
        (128, "off"),
        (128, "on"),
    ]
    first = rows.iloc[0]
    # two contacts of five, one of them the ego's; returns 0 to 4
    assert [first[name] for name in ("n", "crash", "at_fault", "return")] == [5, 0.4, 0.2, 2.0]
    assert first["return_sd"] == pytest.approx(np.sqrt(2.5))
    assert first["change"] == 1.5


def test_seeds_are_pooled():
    at = pd.DataFrame({"n": [4, 4], "crash": [0.25, 0.5], "return": [1.0, 3.0], "return_sd": [0.0, 0.0], "change": 1.0})
    pooled = removal._pooled(at, "crash")
    assert (pooled.value, pooled.n) == (0.375, 8)
    assert pooled.low < 0.375 < pooled.high
    pooled = removal._pooled(at, "return")
    # eight values, four of 1 and four of 3: variance 8 / 7
    assert pooled.value == 2.0
    assert pooled.high - pooled.value == pytest.approx(1.959964 * np.sqrt(8 / 7 / 8))


@pytest.mark.slow
def test_the_figure_has_every_arm(tmp_path):
    for arm in ("unshielded", "shielded"):
        folder = tmp_path / f"{arm}-seed0"
        folder.mkdir()
        tests = {"off": episodes_of(CRASHES), "on": episodes_of([""] * 5)}
        removal.record(folder / removal.FILE, removal.read(folder / removal.FILE), 64, tests)
    rows = removal.read_all(tmp_path, [("unshielded", 0), ("shielded", 0), ("lazy", 0)])
    assert set(rows["arm"]) == {"unshielded", "shielded"}
    removal.plot_removal(rows, tmp_path, "a road")
    with Image.open(tmp_path / "removal.png") as image:
        image.load()
    assert (tmp_path / "removal.pdf").exists()


def test_the_figure_of_multipliers_has_the_arms_that_have_one(tmp_path):
    (tmp_path / "adaptive-penalty-seed1").mkdir()
    text = "timesteps,measured,target,multiplier\n64,3.0,0.5,0.02\n128,1.0,0.5,0.04\n"
    (tmp_path / "adaptive-penalty-seed1" / "multiplier.csv").write_text(text)
    rows = multipliers.read_all(tmp_path, [("shielded", 1), ("adaptive-penalty", 1)])
    assert list(rows["arm"]) == ["adaptive-penalty"] * 2
    assert list(rows["multiplier"]) == [0.02, 0.04]
    multipliers.plot_multipliers(rows, tmp_path, "a road")
    with Image.open(tmp_path / "multiplier.png") as image:
        image.load()
    assert len(multipliers.read_all(tmp_path, [("shielded", 1)])) == 0


def summary():
    cells = [("off", "off", CRASHES), ("off", "on", [""] * 5), ("on", "off", ["ego"] * 5), ("on", "on", [""] * 5)]
    return summarise(pd.concat([episodes_of(blames, *cell) for *cell, blames in cells], ignore_index=True))


@pytest.mark.slow
def test_a_point_of_the_frontier_is_an_arm(tmp_path):
    points = frontier.points_of(summary())
    assert set(points.index.get_level_values("arm")) == {"unshielded", "shielded"}
    assert points.loc[("shielded", "off", "crash"), "value"] == 1.0
    assert points.loc[("unshielded", "off", "crash"), "value"] == 0.4
    assert points.loc[("unshielded", "on", "mean_acceleration_change"), "value"] == 1.5
    frontier.plot_frontier(summary(), tmp_path, "a road")
    with Image.open(tmp_path / "frontier.png") as image:
        image.load()


def test_of_an_arm_in_two_runs_the_last_counts():
    later = summary().assign(value=0.125)
    points = frontier.points_of(pd.concat([summary(), later], ignore_index=True))
    assert (points["value"] == 0.125).all()


def test_a_run_without_results_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="expected the folder of a finished run"):
        frontier.summary_of(tmp_path)


def test_a_card_says_what_a_model_is_and_does(tmp_path):
    config = {
        "env_id": "highway-fast-v0",
        "config": {"lanes_count": 4},
        "preset": "simulator",
        "parameters": {},
        **{"entry": "cautious", "intent": "any", "waiting": "line", "backend": "fast", "total_timesteps": 64},
        **{"n_envs": 2, "intervention_penalty": 0.0, "penalty_on": "response"},
        "maskable-ppo": {"gamma": 0.9},
        "test_seeds": {"first": 7, "last": 11},
    }
    episodes = pd.concat([episodes_of(CRASHES), episodes_of([""] * 5, test="on")], ignore_index=True)
    write_card(tmp_path, "maskable", 3, {"config": config, "python": "3"}, episodes)
    card = json.loads((tmp_path / "card.json").read_text())
    assert (card["arm"], card["train_seed"], card["masked"]) == ("maskable", 3, True)
    assert card["training"]["hyperparameters"] == {"gamma": 0.9}
    crash = card["results"]["off"]["crash"]
    # Wilson's interval of 2 of 5
    assert (crash["value"], crash["n"]) == (0.4, 5)
    assert (crash["low"], crash["high"]) == pytest.approx((0.1176, 0.7693), abs=1e-4)
    text = (tmp_path / "card.md").read_text()
    assert text.startswith("# maskable, seed 3, on highway-fast-v0\n")
    assert "| crash [%] | 40.0 [11.8, 76.9] | 0.0 [0.0, 43.4] |" in text
    assert "rss-shield test model.zip" in text
    assert card["options"] == {} and "Options of the shield" not in text
    config["shield_options"] = {"filter": "ttc", "filter_at": 2.0, "rules": {"memory": False}}
    write_card(tmp_path, "maskable", 3, {"config": config, "python": "3"}, episodes)
    assert json.loads((tmp_path / "card.json").read_text())["options"] == config["shield_options"]
    assert "Options of the shield that are not its defaults: {'filter': 'ttc'" in (tmp_path / "card.md").read_text()
