"""The study of field risk: its situations and its statistics."""

import numpy as np
import pandas as pd
import pytest

from bench import risk_study as study


def frames(state, dangerous):
    state = np.array(state)
    return study.Frames(state, state, np.array(dangerous, bool), 0.1, 0.0)


@pytest.mark.parametrize("situation", study.SITUATIONS, ids=lambda situation: situation.name)
def test_a_situation_ends_in_a_contact_that_hard_braking_would_have_avoided(situation):
    rows = study.play_to_contact(situation, 50 * study.KMH)
    last = rows.iloc[-1]
    assert last["t"] == pytest.approx(0.0, abs=1e-9)
    assert last["rdsi"] > last["upper"] == 1.0
    assert (last[[f"{table} margin" for table in study.TABLES]] < 0.0).all()
    assert 0.0 < study.last_moment(situation, 50 * study.KMH) < 2.0


def test_risk_is_that_of_the_worked_case_of_a_standing_obstacle():
    # F4: 20 m/s towards a car that stands 60 m ahead is RDSI 0.679; between bumpers that is 55 m, or 2.75 s
    standing = study.Situation("standing", "car", 1500.0, 5.0, 2.0, 0.0, False)
    rows = study.play_to_contact(standing, 20.0)
    at = rows.iloc[(rows["t"] + 55.0 / 20.0).abs().argmin()]
    assert at["rdsi"] == pytest.approx(0.679, abs=0.004)
    assert at["ttc"] == pytest.approx(2.75, abs=0.02)


def test_a_measure_reacts_where_it_begins_to_hold_for_good():
    rows = pd.DataFrame({"t": [-0.4, -0.3, -0.2, -0.1, 0.0]})
    assert study.reaction_time(rows, [True, False, True, True, True]) == pytest.approx(0.2)
    assert study.reaction_time(rows, [True] * 5) == pytest.approx(0.4)
    assert study.reaction_time(rows, [True, True, True, False, True]) == 0.0  # the contact itself is no warning
    assert study.reaction_time(rows, [False] * 5) == 0.0


def test_shares_are_of_frames_and_their_intervals_of_episodes():
    rng = np.random.default_rng(0)
    share = study.ratio([1, 0, 3], [10, 10, 10], rng)
    assert share.value == pytest.approx(4 / 30)
    assert share.n == 3 and 0.0 <= share.low < share.value < share.high <= 0.3
    assert study.percent(study.ratio([0], [0], rng)) == "–"


def test_the_confusion_table_counts_frames():
    played = [frames([0, 0, 1, 2], [0, 0, 1, 1]), frames([0, 2, 2, 1], [0, 1, 0, 0])]
    found = [study.Case("merge-v0", "random", shield, played) for shield in study.SHIELDS]
    text = study.confusion_part(found, np.random.default_rng(0))
    lines = [line for line in text.splitlines() if line.startswith("| `merge-v0` | off")]
    # dangerous: unknown once and known unsafe twice; safe: thrice known safe, once unknown, once known unsafe
    assert lines[0].startswith("| `merge-v0` | off | dangerous | 3 | 0.0 % [0.0, 0.0] | 33.3 %")
    assert lines[1].startswith("| `merge-v0` | off | safe | 5 | 60.0 %")
    assert "the field calls 0 known safe" in text and "62 % of all frames" in text
