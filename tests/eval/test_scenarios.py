"""Every scripted situation comes out as its author has derived it, on the spot and judged afterwards."""

import dataclasses

import pytest

from rss_shield.cli import main
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.scenarios.catalogue import SCENARIOS
from rss_shield.eval.suite.scenarios.page import outcome_of, page_of
from rss_shield.eval.suite.scenarios.stage import EGO, OTHER
from rss_shield.shield import d_min_same_direction
from rss_shield.shield.trace import load


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_a_scenario_comes_out_as_derived(scenario):
    outcome = outcome_of(scenario)
    assert outcome.differences == ()
    for result in (outcome.off, outcome.on):
        assert judge_trace(result.trace, users=[0]).verdict_of(0) == result.verdict


def test_there_are_many_of_all_kinds_and_each_says_why():
    assert len(SCENARIOS) >= 40
    assert len({scenario.name for scenario in SCENARIOS}) == len(SCENARIOS)
    assert all(len(scenario.why) > 40 for scenario in SCENARIOS)
    assert {scenario.off for scenario in SCENARIOS} == {"", "ego", "other", "both"}


def test_the_distances_at_the_head_of_the_catalogue():
    """Worked with fractions: D(20, 20) = 10.25 + 441/8 - 25 + 1, D'(20, 20) = 21 + 484/8 - 25 + 1."""
    assert d_min_same_direction(20.0, 20.0, EGO, OTHER) == pytest.approx(41.375)
    assert d_min_same_direction(20.0, 0.0, EGO, OTHER) == pytest.approx(66.375)
    assert d_min_same_direction(20.0, 20.0, OTHER, EGO) == pytest.approx(57.5)


def test_a_wrong_derivation_is_noticed():
    wrong = dataclasses.replace(SCENARIOS[2], on="other", danger=2.5)
    outcome = outcome_of(wrong)
    named = ["verdict with the shield", "verdict with evasion", "danger"]
    assert [difference.split(":")[0] for difference in outcome.differences] == named
    assert "**differs**" in page_of([outcome])


def test_the_command_keeps_traces_and_pictures(tmp_path, capsys):
    main(["scenarios", "creeping up", "--traces", str(tmp_path)])
    assert "creeping up: off ego, on -: as derived" in capsys.readouterr().out
    assert load(tmp_path / "creeping_up_off.npz").meta["env_id"] == "scenario creeping up"
    assert (tmp_path / "creeping_up_on.png").stat().st_size > 10_000
    taken = tmp_path / "creeping_up_on.png"
    for arguments, message in (
        (["parachutes"], "no name contains parachutes"),
        (["creeping up", "--traces", str(taken)], f"--traces {taken}: expected a folder"),
    ):
        with pytest.raises(SystemExit) as end:
            main(["scenarios", *arguments])
        said = capsys.readouterr()
        assert end.value.code == 2 and message in said.err and not said.out
