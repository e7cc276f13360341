"""The page about car parks: what its rows count, and that a run that was broken off goes on."""

import pandas as pd
import pytest

from bench import parking
from bench.parking import COLUMNS, Case, Config


def agents(seed, blames, parked, time=20.0):
    return [
        {
            **{"seed": seed, "agents": len(blames), "blame": blame, "crashed": blame != "", "parked": there},
            **{"time": time, "dangerous": 100, "broken": int(blame == "ego"), "overridden": 0.25},
        }
        for blame, there in zip(blames, parked, strict=True)
    ]


def test_rates_are_of_episodes_and_verdicts_of_agents():
    frame = pd.DataFrame(
        agents(0, ["", ""], [True, True], 30.0)
        + agents(1, ["ego", "other", ""], [False, False, True])
        + agents(2, ["", ""], [True, False])
        + agents(3, ["both", "both"], [False, False])
    )
    row = dict(zip(COLUMNS, parking.row(Case("shared", "parker", True), frame), strict=True))
    assert row["episodes"] == "4" and row["with a contact"] == "2"
    assert row["by verdict of the agents"] == "1 ego, 2 both, 1 other"
    # Wilson's ends for 2 of 4 (z^2 = 3.841): (2 + 1.921 +- 1.96 sqrt(1 + 0.960)) / 7.841 = 15.0 %, 85.0 %
    assert row["at fault"] == "2 (< 85 %)"
    assert row["empty"] == "0 (< 49 %)"
    assert row["broken / dangerous pair-frames"] == "1 / 900"
    assert row["all parked"] == "25.0 [4.6, 69.9] %"
    # of an episode's cars 1, 1/3, 1/2 and 0 are parked: 11/24 on average
    assert row["cars parked"].startswith("45.8 [")
    assert row["after"] == "30.0 s"


def test_a_verdict_that_charges_nobody_is_counted():
    frame = pd.DataFrame(agents(0, ["none"], [False]) + agents(1, [""], [False]))
    row = dict(zip(COLUMNS, parking.row(Case("parking", "random", False), frame), strict=True))
    assert row["empty"].startswith("1 (") and row["all parked"] == row["overridden"] == ""


def test_cases_grow_and_the_page_says_what_there_is(tmp_path, monkeypatch):
    seeds = []

    def play(case, seed):
        seeds.append((case.name, seed))
        return agents(seed, [""], [True])

    monkeypatch.setattr(parking, "play", play)
    monkeypatch.setattr(parking, "PARTS", 2)
    one = ("shared-parker-shield",)
    assert parking.main(Config(cases=one, episodes=4, out=tmp_path / "out")) == 0
    assert parking.main(Config(cases=one, episodes=6, out=tmp_path / "out")) == 0
    assert [seed for _, seed in seeds] == [0, 1, 2, 3, 4, 5]  # each once
    assert len(parking.found(Case("shared", "parker", True), 5, tmp_path / "out")) == 5
    parking.write(Config(episodes=6, out=tmp_path / "out"), tmp_path)
    text = (tmp_path / "docs/results/parking.md").read_text(encoding="utf-8")
    assert "| parker | yes | 6 | 0 | none | 0 (<" in text and "ten parked cars" not in text


def test_an_unknown_case_is_refused(capsys):
    assert parking.main(Config(cases=("shared-sleeping-shield",))) == 2
    assert "cases = 'shared-sleeping-shield': expected some of shared-random-shield" in capsys.readouterr().err


@pytest.mark.parametrize(("scene", "episodes"), [("shared", 300), ("walked", 100), ("parking", 100), ("parked", 60)])
def test_fewer_are_played_where_less_can_happen(scene, episodes):
    assert parking.share(Case(scene, "random", True), 300) == episodes
