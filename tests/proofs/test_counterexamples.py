"""Without any one condition of the proof two cars touch; with it, and the same drivers, they do not."""

import pytest

pytest.importorskip("z3", reason="z3-solver is not installed: pip install 'rss-shield[proofs]'")

from counterexamples import all_dropped

CASES = all_dropped()


@pytest.mark.parametrize("dropped", CASES, ids=[f"{one.condition} {one.what}" for one in CASES])
def test_z3_finds_a_start_of_which_the_simulation_makes_a_contact(dropped):
    pair = dropped.found()
    assert pair is not None
    assert dropped.replay(pair, True) < -1e-6
    assert dropped.replay(pair, False) >= 0.0


def test_every_condition_is_dropped_once_at_least():
    assert {one.condition for one in CASES} == {"C1", "C1y", "C2", "C3", "C4", "C5", "C6", "C7", "C8"}
