"""The arms: every row can be trained and tested, and the page has the table."""

import itertools
import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from places import ROOT

from rss_shield.agents.learner import LEARNERS
from rss_shield.envs.options import Options, split
from rss_shield.eval.arms import ARMS, FROM_OPTIONS, ROWS, SCRIPTED, arm_named, table
from rss_shield.eval.pages import arms_block
from rss_shield.eval.plots import style_of


def test_names_and_colours_are_told_apart():
    assert len(ARMS) == len(ROWS)
    assert len({arm.called for arm in ROWS}) == len(ROWS)
    assert len({tuple(style_of(arm.name).values()) for arm in ROWS}) == len(ROWS)
    assert all(re.fullmatch("#[0-9A-F]{6}", arm.colour) for arm in ROWS)
    assert all(re.fullmatch(r"[a-z0-9.-]+", arm.name) for arm in ROWS)


def oklab(colour):
    """Perceived lightness and hue (Ottosson, 2020): distances below 0.08 are hard to tell apart in thin lines."""
    channels = np.array(to_rgb(colour))
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    cones = np.cbrt(CONES @ linear)
    return OPPONENTS @ cones


CONES = np.array([[0.41222, 0.53633, 0.05145], [0.21190, 0.68070, 0.10740], [0.08830, 0.28172, 0.62998]])
OPPONENTS = np.array([[0.21045, 0.79362, -0.00407], [1.97800, -2.42859, 0.45059], [0.02590, 0.78277, -0.80868]])


def test_arms_whose_colours_are_alike_have_different_markers():
    pairs = [
        (one.name, other.name)
        for one, other in itertools.combinations(ROWS, 2)
        if np.linalg.norm(oklab(one.colour) - oklab(other.colour)) < 0.08
    ]
    assert ("penalty-0.5", "literal-def10") in pairs
    assert [pair for pair in pairs if style_of(pair[0])["marker"] == style_of(pair[1])["marker"]] == []


def test_the_two_of_always_are_called_by_the_shield_in_training():
    assert [(ARMS[name].called, ARMS[name].training["shield"]) for name in ("unshielded", "shielded")] == [
        ("off", "monitor"),
        ("on", "override"),
    ]


@pytest.mark.parametrize("arm", ROWS, ids=lambda arm: arm.name)
def test_a_row_names_a_learner_and_options_that_there_are(arm):
    assert arm.learner == SCRIPTED or arm.learner in LEARNERS
    for shield in (arm.training, *arm.tests.values()):
        given, rest = split(shield)
        Options.of(given)
        assert set(rest) == {"shield"}
    assert arm.tests["off"] == {"shield": "monitor"}
    assert arm.tests["on"]["shield"] == "override"
    assert "filter" not in arm.tests["on"]  # our shield, whatever the agent was trained behind
    if arm.learner == SCRIPTED:
        assert set(arm.settings) == {"driver"}
    else:
        assert set(arm.settings) <= {FROM_OPTIONS, "penalty_on"}


def test_an_unknown_arm_names_the_nearest():
    with pytest.raises(ValueError, match=r"'adaptive' is no arm; the nearest is adaptive-\w+, --list-arms shows all"):
        arm_named("adaptive")


def test_the_page_has_the_table():
    page = (ROOT / "docs" / "arms.md").read_text(encoding="utf-8")
    assert f"<!-- arms -->\n{arms_block()}\n<!-- /arms -->" in page
    assert len(table()) == len(ROWS) + 1
