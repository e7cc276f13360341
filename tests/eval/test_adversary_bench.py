"""What pays the adversary, and its page."""

import numpy as np
import pytest

from bench import adversary
from bench.evasion import counted, page_of, parts_at
from rss_shield import make_vec
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.params import Rules
from rss_shield.shield.trace import load

ROW = dict(road="merge-v0", policy="idle", traffic="stock", broken=0)


def test_it_is_paid_for_faults_only(tmp_path):
    paid = adversary.Paid(make_vec(adversary.ENV_ID, 8, "monitor", config=adversary.CONFIG), tmp_path / "found.npz")
    paid.seed(0)
    paid.reset()
    rewards = []
    for _ in range(12):  # full throttle, nobody holds it back
        paid.step_async(np.tile(np.float32([1.0, 0.0]), (8, 1)))
        rewards.append(paid.step_wait()[1])
    paid.close()
    assert paid.faults == int((np.array(rewards) > 0.5).sum()) >= 4
    assert paid.contacts >= paid.faults
    assert judge_trace(load(tmp_path / "found.npz")).verdict_of(load(tmp_path / "found.npz").ego_users[0]) in (
        "ego",
        "both",
    )


def test_the_page_says_what_was_found_and_after_how_long(tmp_path):
    results = [
        {"name": "whole", "changes": {}, "curve": [[0, 0, 0, 0], [8192, 300, 4, 0]]},
        {
            "name": "weak",
            "changes": {"lateral": False},
            "curve": [[0, 0, 0, 0], [8192, 300, 4, 0], [16384, 600, 90, 60]],
        },
    ]
    page = adversary.page_of(results)
    # 0 of 300: 1 - 0.025^(1/300) = 0.0122
    assert "| whole | 8 192 | 300 | 4 | **0** (95 % below 1.2e-02) | - |" in page
    assert "| weak | 16 384 | 600 | 90 | 60: 10.00%" in page and "| 16 384 |" in page
    adversary.draw(results, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 5000


def test_pairs_are_counted_by_what_became_of_them():
    pairs = [
        ["no contact", "no contact", 90],
        ["other", "no contact", 6],
        ["other", "other", 3],
        ["no contact", "other", 1],
    ]
    found = counted([ROW | {"pairs": pairs}])
    assert found == {"pairs": 100, "contacts": 9, "avoided": 6, "new": 1, "at_fault": 0}
    # of the 9 with a contact: in 5 another action made a difference, too; it avoided 2 of these, the manoeuvre 4
    chance = [
        ["other", "no contact", "other", 3],
        ["other", "no contact", "no contact", 1],
        ["other", "other", "no contact", 1],
        ["no contact", "other", "no contact", 1],
        ["no contact", "no contact", "other", 3],
    ]
    page = page_of([ROW | {"pairs": pairs, "chance": chance}], [])
    assert "| stock | 4 of 5 (80% [28%, 99%]) | 2 of 5 (40% [5%, 85%]) | 1 of 4 (25% [1%, 81%]) | 3 of 4 " in page
    assert "| merge-v0 | 100 | 9 | 6 (67% [30%, 93%]) | 1 (1.10% [0.03%, 5.97%])" in page
    assert counted([ROW | {"pairs": [["other", "both", 2]]}])["at_fault"] == 2


def test_paths_part_at_the_first_decision_that_differs():
    one = np.zeros((5, 3))
    other = one.copy()
    assert parts_at(one, other) == -1
    other[3, 1] = 1e-9
    assert parts_at(one, other) == 3
    assert parts_at(one, one[:4]) == 4  # one ended earlier


@pytest.mark.parametrize("name", adversary.SHIELDS)
def test_a_weakened_shield_lacks_one_thing_or_two(name):
    changes, whole = adversary.SHIELDS[name], Rules()._asdict()
    assert (len(changes) == 0) == (name == "whole") and len(changes) <= 2
    assert all(whole[rule] != value for rule, value in changes.items())
