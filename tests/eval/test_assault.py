"""Policies that look for faults, and what a campaign keeps of what they find."""

import numpy as np
import pandas as pd
import pytest
from gymnasium.vector import AutoresetMode

from rss_shield import make_vec
from rss_shield.eval.suite import stress, stress_page
from rss_shield.eval.suite.assault import CONTINUOUS, FREE, POLICIES, _arrays, policy_of
from rss_shield.eval.suite.stress import Block, blocks_of, counted, keep_trace, play
from rss_shield.eval.suite.watched import Watched
from rss_shield.shield.trace import load


def batch(n=4, **options):
    return make_vec("highway-fast-v0", n, autoreset_mode=AutoresetMode.DISABLED, **options)


def test_the_greedy_policy_comes_nearest_and_leaves_no_trace_of_its_trials():
    env = batch(8)
    seen, _ = env.reset(seed=3)
    before = [array.copy() for array in _arrays(env.engine)]
    chosen = policy_of("greedy", lambda: env, np.random.default_rng(0))(seen)
    for old, new in zip(before, _arrays(env.engine), strict=True):
        assert repr(old.tolist()) == repr(new.tolist())  # what lies between the fields of records is anything
    # what every action would lead to, tried out on environments of their own
    margins = np.empty((5, 8))
    for action in range(5):
        other = batch(8)
        other.reset(seed=3)
        told = other.step(np.full(8, action))[-1]["shield"]
        margins[action] = np.maximum(told["min_margin_lon"], told["min_margin_lat"])
    assert (margins[chosen, np.arange(8)] <= margins.min(axis=0) + 1e-9).sum() >= 6  # one in ten is random


@pytest.mark.parametrize("name", [*POLICIES, *FREE])
def test_every_policy_chooses_actions_of_the_space(name):
    env = batch(config=CONTINUOUS if name in FREE else None)
    act, (seen, _) = policy_of(name, lambda: env, np.random.default_rng(0)), env.reset(seed=0)
    for _ in range(3):
        action = act(seen)
        assert env.action_space.contains(np.asarray(action, env.action_space.dtype))
        seen = env.step(action)[0]


def test_the_worst_margin_is_that_of_the_whole_episode():
    env = Watched(batch(2))
    env.reset(seed=0)
    worst = np.full(2, np.inf)
    for action in (3, 3, 4, 3):
        told = env.step(np.array([action, 1]))[-1]["shield"]
        worst = np.minimum(worst, np.maximum(told["min_margin_lon"], told["min_margin_lat"]))
    assert [env.columns(e)["worst_margin"] for e in (0, 1)] == worst.tolist()
    assert env.columns(0)["actions"] == "3 3 4 3"


def test_cars_are_steered_freely_only_where_the_engine_can():
    blocks = blocks_of(["highway-fast-v0", "merge-v0"], ["random", "wild"], [""], "override", 0, 4, 4, ["stock"])
    assert [(one.env_id, one.policy) for one in blocks] == [
        ("highway-fast-v0", "random"),
        ("highway-fast-v0", "wild"),
        ("merge-v0", "random"),
    ]
    with pytest.raises(ValueError, match="traffic = 'polite': expected one of stock, tailgater"):
        _ = Block("merge-v0", "random", "", "override", 0, 1, "polite").config


@pytest.mark.parametrize(("env_id", "traffic"), [("highway-fast-v0", "mixed"), ("intersection-v0", "runner")])
def test_the_judge_says_of_every_contact_what_the_shield_says(env_id, traffic):
    result = play(Block(env_id, "random", "", "override", 0, 24, traffic, judged=True))
    assert result["judged"]["contacts"] >= 3
    assert result["judged"]["different"] == []
    assert result["bad"] == [] and result["broken_duties"] == 0


def test_what_steers_freely_is_played_again_on_highway_env_to_the_same_contact(tmp_path):
    block = Block("highway-fast-v0", "wild", "", "monitor", 0, 12, "mixed")
    worst = min(play(block)["bad"], key=lambda one: len(one["actions"]))
    assert keep_trace(block, worst["seed"], worst["actions"], tmp_path / "bad.npz") == worst["blame"]
    assert load(tmp_path / "bad.npz").meta["config"]["action"]["type"] == "ContinuousAction"


def test_the_page_adds_up_what_blocks_have_left(tmp_path):
    for seed, mode in ((0, "override"), (8, "override"), (0, "monitor")):
        block = Block("highway-fast-v0", "faster", "", mode, seed, 8)
        stress.write_json(tmp_path / block.name, play(block))
    page = stress_page.page_of(stress_page.found_in(tmp_path), "command")
    assert "**16 episodes" in page and ": 0 with the ego at fault, 0 contacts that are nobody's fault.**" in page
    assert "| `highway-fast-v0` | 16 |" in page
    assert "| `highway-fast-v0` | stock | 8 |" in page  # beside the one without the shield
    with pytest.raises(ValueError, match="expected at least one"):
        stress_page.page_of([], "command")


def test_counts_are_those_of_the_table():
    table = pd.DataFrame(
        {
            "seed": [1, 2, 3],
            "blame": ["no contact", "other", "ego"],
            "judged": ["", "both", "ego"],
            "actions": ["1", "2", "3 4"],
            "time": [10.0, 5.0, 1.0],
            "speed": [20.0, 10.0, 30.0],
            "override_share": [0.5, 0.0, 1.0],
            "broken_duties": [0, 0, 2],
            "dangerous_pairs": [3, 4, 5],
            "min_ttc": [5.0, 0.5, 1.0],
            "worst_margin": [1.0, -3.0, -2.0],
        }
    )
    found = counted(table)
    assert (found["episodes"], found["seconds"], found["metres"], found["overridden"]) == (3, 16.0, 280.0, 6.0)
    assert (found["min_ttc"], found["worst_margin"], found["dangerous_pairs"]) == (0.5, -3.0, 12)
    assert found["bad"] == [{"seed": 3, "blame": "ego", "actions": "3 4"}]
    assert found["judged"]["contacts"] == 2
    assert [one["seed"] for one in found["judged"]["different"]] == [2]
