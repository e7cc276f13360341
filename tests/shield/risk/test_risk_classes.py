"""SOTIF classes of single frames."""

import numpy as np
import pytest

from rss_shield.shield.risk import KNOWN_SAFE, KNOWN_UNSAFE, UNKNOWN, classify, steady


@pytest.mark.parametrize(
    ("rdsi", "state"),
    [
        (-3.0, KNOWN_SAFE),
        (np.nextafter(0.5, 0), KNOWN_SAFE),
        (0.5, UNKNOWN),
        (0.8, UNKNOWN),
        (1.0, UNKNOWN),
        (np.nextafter(1.0, 2), KNOWN_UNSAFE),
        (7.0, KNOWN_UNSAFE),
    ],
)
def test_both_thresholds_belong_to_the_unknown(rdsi, state):
    assert classify(rdsi, 0.5, 1.0) == state


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ([0, 0, 0, 1, 0, 0, 0], [0] * 7),
        ([0, 0, 0, 1, 1, 0, 0], [0, 0, 0, 1, 1, 0, 0]),
        ([0, 0, 2, 1, 1, 2, 2], [0, 0, 0, 1, 1, 2, 2]),
        ([2, 0, 0, 1], [0, 0, 0, 0]),
        ([2], [2]),
        ([0, 1, 2, 1], [0, 1, 2, 1]),
        ([], []),
    ],
)
def test_short_stays_are_noise(states, expected):
    assert steady(np.array(states, int), 0.1).tolist() == expected


@pytest.mark.parametrize(("dt", "kept"), [(1 / 15, False), (0.1, False), (0.2, True), (0.5, True)])
def test_how_short_is_counted_in_seconds(dt, kept):
    assert (steady(np.array([0] * 9 + [1] + [0] * 9), dt).sum() == 1) == kept
