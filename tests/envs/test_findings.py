"""What campaigns of stress have found, played again: episodes that once ended with the ego at fault, or nobody."""

import pytest

from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.stress import Block, keep_trace
from rss_shield.shield.trace import load

RING = "roundabout-v0"


@pytest.mark.parametrize(
    ("traffic", "seed", "actions"),
    [
        # J12: somebody drives on against the ring, or off all lanes, at the speed that it has
        ("wrongway", 0, "1 2 0 0"),
        ("wrongway", 2, "0 1 4 4 1"),
        ("mixed", 8, "2 0 4 2 4 4"),
        ("swerver", 394, "4 1 3 0 2 3 4 1"),
        ("bounded-rammer", 235, "4 4 4"),
        # H24: trapped by who accelerates too hard, it brakes with all it has, and so breaks its plan to go on
        ("companion", 126, "3 3 3 3 3 3"),
        ("swerver", 318, "1 2 1 1"),
    ],
)
def test_whoever_traps_or_rams_the_ego_is_to_blame(traffic, seed, actions, tmp_path):
    path = tmp_path / "found.npz"
    assert keep_trace(Block(RING, "random", "", "override", seed, 1, traffic), seed, actions, path) == "other"
    assert load(path).meta["broken_duties"] == 0


def test_the_judge_agrees_about_who_drives_on_against_the_ring(tmp_path):
    path = tmp_path / "found.npz"
    keep_trace(Block(RING, "random", "", "override", 0, 1, "wrongway"), 0, "1 2 0 0", path)
    assert judge_trace(load(path), users=list(load(path).ego_users)).verdict_of(load(path).ego_users[0]) == "other"
