"""Rows of `bench/junctions.py`, on episodes made up by hand."""

import json

import pandas as pd
import pytest

from bench.junctions import UNSHIELDED, Case, Config, delay, examined_row, intent_row, is_stuck, play, progress_row


def episodes(arrived, length, in_way=(False,) * 4, blame=("", "", "", "other")):
    duties = {"other_duty": "crashed before", "ego_duty": ""}
    return pd.DataFrame(
        {
            "seed": range(4),
            "return": 1.0,
            "length": length,
            "arrived": arrived,
            "in_way": in_way,
            "blame": blame,
            "crashed": [bool(verdict) for verdict in blame],
            "evidence": [json.dumps(duties) if verdict else "{}" for verdict in blame],
            "override_share": 0.5,
            "frames": 100,
            "trapped_frames": [0, 0, 3, 0],
            "pairs_examined": 200,
            "pairs_possible": 800,
        }
    )


FRAME = episodes([True, True, False, False], [10, 12, 13, 5], in_way=[True, False, True, True])


def test_whoever_arrives_or_crashes_is_not_stuck():
    assert is_stuck(FRAME).tolist() == [False, False, True, False]


def test_progress_counts_arrivals_contacts_and_those_that_are_stuck():
    row = progress_row(Case(), FRAME)
    assert row[:4] == ["faster", "13 s", "cautious", "line"]
    assert row[4].startswith("50.0 [") and row[5] == "11.0 s"
    assert row[6:9] == ["1", "0/0/1/0/0", "1 crashed before"] and row[9] == ""
    assert row[10].startswith("0 (<") and row[11:14] == ["50 %", "3 / 400", "1"]
    assert row[14].startswith("66.7 [")
    assert progress_row(UNSHIELDED, FRAME)[2:4] == ["no shield", ""]


def test_delays_are_between_the_same_seeds_where_both_arrive():
    later = episodes([True, False, True, False], [12, 13, 13, 5])
    assert delay(later, FRAME).startswith("+2.00 ") and delay(later, FRAME).endswith("(1)")
    assert intent_row(Case(intent="any"), later, FRAME, FRAME)[:2] == ["any", "50.0 [15.0, 85.0] %"]
    with pytest.raises(ValueError, match="seeds differ"):
        delay(FRAME.assign(seed=range(1, 5)), FRAME)


def test_what_is_examined_is_told_per_frame():
    changed = FRAME.assign(length=[10, 12, 13, 6])
    assert examined_row(Case(examine="walk"), changed, FRAME)[:5] == ["walk", "2.00", "8.00", "25.0 %", "1"]


def test_the_default_case_plays():
    frame = play(Case(), 4, Config().n_workers)
    assert frame["seed"].tolist() == [0, 1, 2, 3]
    assert 0 < frame["pairs_examined"].sum() < frame["pairs_possible"].sum()
    assert not (frame["arrived"] & frame["crashed"]).any()
