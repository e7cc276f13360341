"""The page of arms: its numbers are those of the episodes, and its sentences follow from them."""

import json

import numpy as np
import pandas as pd
import pytest
from result_tables import episodes_of

from rss_shield.eval.paper import agents

EPISODES = 20


def leave_run(folder, arms, seeds, cells):
    """A finished run, as far as the page reads it.

    Args:
      cells: (train, test) -> blames and mean return of its episodes.
    """
    folder.mkdir(parents=True)
    config = {"env_id": "highway-fast-v0", "arms": arms, "seeds": seeds, "total_timesteps": 1000}
    config |= {"parameters": {}, "intervention_penalty": 0.0}
    (folder / "config.json").write_text(json.dumps({"config": config}))
    (folder / "results.json").write_text("{}")
    frames = []
    for seed in seeds:
        for (train, test), (blames, mean) in cells.items():
            frame = episodes_of(blames, train, test).assign(train_seed=seed, seed=np.arange(len(blames)))
            frames.append(
                frame.assign(**{"override_share": 0.05, "return": mean + 0.1 * seed + 0.01 * np.arange(len(blames))})
            )
    pd.concat(frames).to_csv(folder / "episodes.csv", index=False)
    return folder


@pytest.fixture
def runs(tmp_path):
    clean, crashing = [""] * EPISODES, ["ego"] * 5 + [""] * 15
    learnt = leave_run(
        tmp_path / "main",
        ["unshielded", "shielded"],
        [0, 1, 2],
        {
            ("off", "off"): (crashing, 18.0),
            ("off", "on"): (clean, 19.0),
            ("on", "off"): (crashing, 5.0),
            ("on", "on"): (clean, 22.0),
        },
    )
    for arm, late in (("unshielded", 20.0), ("shielded", 30.0)):
        folder = learnt / f"{arm}-seed0"
        folder.mkdir()
        started = np.arange(0, 1000, 20)
        curve = {"timesteps": started + 20, "started": started, "cut": 0, "length": 20, "override_share": 0.1}
        curve |= {"return": np.where(started < 800, 20.0, late), "crashed": 0, "blame": "no contact", "cost": 0.0}
        rows = pd.DataFrame(curve)
        rows.loc[:9, ["crashed", "blame"]] = 1, "ego"  # 10 of 50 episodes, 1000 decisions
        rows.to_csv(folder / "learning_curve.csv", index=False)
    scripted = leave_run(
        tmp_path / "scripted", ["lazy"], [0], {("lazy", "off"): (crashing, 6.0), ("lazy", "on"): (clean, 20.0)}
    )
    return [learnt, scripted, tmp_path / "not-begun"]


def test_who_beats_the_driver_that_learns_nothing_is_said_first(runs):
    (road,) = agents.roads_in(runs)
    text = agents.first_sentences(road, agents.cells_of(road))
    # 22.1 on average over seeds, 20 of lazy: 22.0, 22.1 and 22.2 less 20
    assert "`lazy` (always FASTER, return 20.1): `shielded` by +2.10 [" in text
    assert text.endswith("Worse than it: `unshielded`.")


def test_nobody_who_beats_it_is_said_as_plainly(runs):
    (road,) = agents.roads_in(runs[1:])
    assert agents.first_sentences(road, agents.cells_of(road)).startswith("**Behind the shield no trained agent beats")


def test_an_arms_line_has_its_rates_and_its_training(runs):
    (road,) = agents.roads_in(runs)
    line = dict(
        zip(agents.TABLE_HEADING, agents.row_of(agents.ARMS["shielded"], road, agents.cells_of(road)), strict=True)
    )
    assert line["seeds"] == "3"
    assert line["without: crashes [%]"].startswith("25.0 [")
    assert line["with: ego at fault [%]"] == "0.0 [0.0, 6.0]"  # 0 of 60: 1 - 0.025^(1/60)
    assert line["crashes per 1000 decisions of training"] == "10.0"
    assert line["flat"] == "no (+50 %)"
    flat = agents.row_of(agents.ARMS["unshielded"], road, agents.cells_of(road))
    assert flat[-1] == "yes (+0 %)"


def test_arms_that_agree_over_seeds_are_not_known_better_than_their_episodes_tell(runs):
    (road,) = agents.roads_in(runs)
    crash = agents.estimate(agents.cells_of(road)["unshielded", "off"], "crash")
    assert crash.value == 0.25 and crash.low <= 0.147 and crash.high >= 0.379  # Clopper-Pearson of 15 of 60


def test_thresholds_name_the_arms_that_pass(runs):
    (road,) = agents.roads_in(runs)
    asleep, harmless = agents.questions(road, agents.cells_of(road)).splitlines()[:2]
    assert "`shielded`" in asleep and "`unshielded`" not in asleep  # 19.1 is more than 2 % below 22.1
    assert harmless.endswith("nobody.")


@pytest.mark.slow
def test_the_page_and_its_figures_are_written(runs, tmp_path):
    page = agents.write(runs, tmp_path / "results")
    text = page.read_text()
    assert "agents-highway-fast-v0-frontier.png" in text and "| `shielded` | 3 |" in text
    assert sorted(path.name for path in (tmp_path / "results").iterdir()) == [
        "agents-highway-fast-v0-frontier.png",
        "agents.md",
    ]


def test_without_a_finished_run_there_is_no_page(tmp_path):
    with pytest.raises(ValueError, match="expected at least one finished run"):
        agents.write([tmp_path], tmp_path)


def test_what_is_counted_per_decision_is_a_ratio_of_sums():
    cell = pd.DataFrame({"train_seed": 0, "cost": [1.0, 3.0, 0.0, 2.0], "length": [10, 30, 20, 20]})
    found = agents.per_decision(cell, "cost")
    assert found.value == pytest.approx(6 / 80)
    # residuals 0.25, 0.75, -1.5, 0.5 of mean length 20: standard deviation of the shares, over two
    half = 1.96 * np.std([0.0125, 0.0375, -0.075, 0.025], ddof=1) / 2
    assert (found.low, found.high) == pytest.approx((6 / 80 - half, 6 / 80 + half))


def test_of_one_value_there_is_no_interval():
    cell = pd.DataFrame({"train_seed": [0], "time_to_goal": [13.0]})
    assert agents.number(agents.estimate(cell, "time_to_goal")) == "13.0 [–]"


def test_an_agent_that_pays_more_than_any_limit_is_said_not_to_meet_it():
    prices = pd.DataFrame({"timesteps": [100], "measured": 0.3, "target": 0.01, "multiplier": 2.0, "train_seed": 0})
    cells = {
        ("ppo-lagrangian", "off"): pd.DataFrame({"train_seed": 0, "cost": [3.0, 2.9, 3.1], "length": 10}),
        ("slower", "off"): pd.DataFrame({"train_seed": 0, "cost": [1.0, 0.9, 1.1], "length": 10}),
        ("lazy", "off"): pd.DataFrame({"train_seed": 0, "cost": [9.0, 8.9, 9.1], "length": 10}),
    }
    in_training, tested, least = agents.sentences_on_costs(prices, cells)
    assert in_training.endswith("0.3000; its limit is 0.01; multiplier 2.00.")
    assert "it costs 0.3000" in tested and tested.endswith("it does not meet it.")
    assert "`slower`" in least and "0.1000" in least


def test_a_multiplier_that_is_not_at_rest_is_said_to_rise():
    prices = pd.DataFrame({"timesteps": range(0, 100, 10), "measured": 0.3, "target": 0.01, "train_seed": 0})
    for multiplier, rises in ((np.full(10, 7.0), False), (0.5 * np.arange(10), True)):
        (said, *_) = agents.sentences_on_costs(prices.assign(multiplier=multiplier), {})
        assert said.endswith(", still rising when training ended.") == rises


def test_who_leaves_the_road_is_not_called_harmless_without_what_it_earns(runs):
    (road,) = agents.roads_in(runs)
    cells = agents.cells_of(road)
    safe = cells["unshielded", "off"].assign(crash=False, crashed=False)
    for earned, named in ((20.0, True), (2.0, False)):
        said = agents.questions(road, {**cells, ("unshielded", "off"): safe.assign(**{"return": earned})}).splitlines()[
            1
        ]
        assert ("nobody" not in said) == named and f"return {earned:.1f})" in said
        assert ("Crashes as seldom and earns less" in said) != named


def test_agents_behind_other_filters_have_a_table(runs):
    (road,) = agents.roads_in(runs)
    cells = agents.cells_of(road)
    cells["ttc", "ttc"] = cells["shielded", "on"].assign(train="ttc", test="ttc")
    (_, table) = agents.other_filters(road, [agents.ARMS["shielded"], agents.ARMS["ttc"]], cells)
    assert "| `ttc` | 0.0 [" in table and "`shielded`" not in table


def test_an_interval_over_few_seeds_stays_inside_what_can_be():
    rows = pd.DataFrame(
        {
            "train_seed": np.repeat([0, 1], 20),
            "mean_acceleration_change": np.repeat([0.1, 3.0], 20) + np.tile([0.0, 0.01], 20),
            "override_share": np.repeat([0.02, 0.9], 20) + np.tile([0.0, 0.01], 20),
            "return": np.repeat([1.0, 9.0], 20),
        }
    )
    change, share, earned = (agents.estimate(rows, name) for name in rows.columns[1:])
    assert change.low == 0.0 and change.high > 3.0
    assert (share.low, share.high) == (0.0, 1.0)
    assert earned.low < 1.0 < 9.0 < earned.high  # a return can be anything
