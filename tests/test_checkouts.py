"""The table of two checkouts says what was measured."""

import numpy as np

from bench.checkouts import HEADINGS, rows


def test_ratios_are_taken_turn_by_turn():
    turns = np.array([[[10.0, 20.0, 30.0], [10.0, 15.0, 20.0]], [[20.0, 40.0, 60.0], [20.0, 30.0, 60.0]]]) * 1e-6
    bare, monitor, override = rows("merge-v0", turns)
    assert len(bare) == len(HEADINGS)
    assert bare[2:] == ["none", "15.0 us", "15.0 us", "1.00 (1.00 to 1.00)", ""]
    # 15 / 20 and 30 / 40; without what the engine takes itself 5 / 10 and 10 / 20
    assert monitor[2:] == ["monitor", "30.0 us", "22.5 us", "0.75 (0.75 to 0.75)", "0.50 (0.50 to 0.50)"]
    # 20 / 30 and 60 / 60, so quartiles a quarter of the way in; alone 10 / 20 and 40 / 40
    assert override[5:] == ["0.83 (0.75 to 0.92)", "0.75 (0.62 to 0.88)"]
