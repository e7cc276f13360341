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
    trace = load(path)
    assert trace.meta["broken_duties"] == 0
    assert judge_trace(trace, users=list(trace.ego_users)).verdict_of(trace.ego_users[0]) == "other"


def test_whoever_speeds_up_beyond_the_limit_is_to_blame(tmp_path):
    """J13: plans expect nobody to get faster than the roads allow, so once it was nobody's fault when somebody did."""
    path, actions = tmp_path / "found.npz", "2 2 2 0 1 1 2 0 1"
    block = Block("intersection-v0", "random", "", "override", 2_300_000, 1, "stopper")
    assert keep_trace(block, 2_300_000, actions, path) == "other"
    trace = load(path)
    judgement = judge_trace(trace, users=list(trace.ego_users))
    assert judgement.verdict_of(trace.ego_users[0]) == "other"


def test_who_only_watches_sees_that_somebody_has_trapped_the_ego(tmp_path):
    """H24: once the judge said "none", because only a shield that acts knew that no plan was left."""
    path, kind = tmp_path / "found.npz", "bounded-mixed"
    actions = "2 2 1 0 1 1 1 0 2 0 0 1 0"
    block = Block("intersection-v0", "random", "", "override", 2_100_006, 1, kind)
    assert keep_trace(block, 2_100_006, actions, path) == "other"
    trace = load(path)
    judgement = judge_trace(trace, users=list(trace.ego_users))
    assert judgement.verdict_of(trace.ego_users[0]) == "other"
