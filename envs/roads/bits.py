"""Sets of small numbers as the bits of an integer, walked through without looking at those that are not there."""

import numpy as np

from rss_shield.shield._numba.compiled import inner

_SEQUENCE = np.uint64(0x03F79D71B4CB0A89)  # of de Bruijn: its 64 windows of six bits all differ
_TOP_SIX = np.uint64(58)
_PLACES = np.zeros(64, np.int64)
for _place in range(64):
    _PLACES[((int(_SEQUENCE) << _place) & (2**64 - 1)) >> 58] = _place


@inner
def first_of(numbers):
    """The smallest number of a set that is not empty: the lowest bit of an int64 that is 1."""
    return _PLACES[(np.uint64(numbers & -numbers) * _SEQUENCE) >> _TOP_SIX]


@inner
def without_first(numbers):
    """The set without that."""
    return numbers & (numbers - 1)
