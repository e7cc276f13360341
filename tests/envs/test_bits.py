"""Sets of small numbers as bits."""

import numpy as np
import pytest
from numba import njit

from rss_shield.envs.roads.bits import first_of, without_first


@njit
def _walk(numbers, out):
    count = 0
    while numbers != 0:
        out[count] = first_of(numbers)
        numbers = without_first(numbers)
        count += 1
    return count


@pytest.mark.parametrize("numbers", [[], [0], [63], [0, 1, 62, 63], [5, 17, 40], list(range(64))])
def test_all_are_walked_through_in_their_order(numbers):
    bits = np.array(sum(1 << n for n in numbers), np.uint64).astype(np.int64)
    out = np.full(64, -1)
    assert out[: _walk(bits[()], out)].tolist() == numbers
