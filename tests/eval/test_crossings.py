"""Situations where roads cross come out as derived, and every pre-crash type is accounted for."""

import dataclasses

import pytest

from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.scenarios.catalogue import SCENARIOS
from rss_shield.eval.suite.scenarios.crossings import CROSSINGS
from rss_shield.eval.suite.scenarios.page import met, page_of
from rss_shield.eval.suite.scenarios.typology import TYPES


@pytest.mark.parametrize("crossing", CROSSINGS, ids=lambda crossing: crossing.name)
def test_a_crossing_comes_out_as_derived(crossing):
    one = met(crossing)
    assert one.differences == ()
    if one.off.verdict:
        assert judge_trace(one.off.trace).verdict_of(0) == one.off.verdict


def test_a_wrong_derivation_is_noticed():
    one = met(dataclasses.replace(CROSSINGS[0], touched=3.0, on="other"))
    assert [difference.split(":")[0] for difference in one.differences] == ["verdict with the shield", "contact"]
    assert "**differs**" in page_of([], [one])


def test_every_pre_crash_type_has_a_situation_or_a_reason():
    assert [one.number for one in TYPES] == list(range(1, 38))
    names = {scenario.name for scenario in SCENARIOS} | {crossing.name for crossing in CROSSINGS}
    for one in TYPES:
        assert one.scenarios or one.reason, one
        assert set(one.scenarios) <= names, one
    assert sum(bool(one.scenarios) for one in TYPES) >= 22
    assert len(names) == len(SCENARIOS) + len(CROSSINGS)
