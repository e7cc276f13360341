"""Compiled code calls numpy's own functions."""

import numba
import numpy as np
import pytest

from rss_shield.envs._numpy import ufuncs

ONE = {np.tan: ufuncs.tan, np.arctan: ufuncs.arctan, np.arcsin: ufuncs.arcsin}
ONE_OF_TWO = {np.arctan2: ufuncs.arctan2, np.power: ufuncs.power}
EACH = {np.tan: ufuncs.tan_each, np.arctan: ufuncs.arctan_each, np.arcsin: ufuncs.arcsin_each}
EACH_OF_TWO = {np.arctan2: ufuncs.arctan2_each, np.power: ufuncs.power_each}
SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, 2.0, 1e-310, np.inf, -np.inf, np.nan, 1e300])


def _numbers(count, seed):
    """Random floats, and now and then a special one."""
    rng = np.random.default_rng(seed)
    return np.where(rng.random(count) < 0.1, rng.choice(SPECIAL, count), rng.uniform(-1.2, 5.0, count))


@pytest.mark.parametrize("ufunc", [*ONE, *ONE_OF_TWO], ids=lambda ufunc: ufunc.__name__)
def test_of_one_number(ufunc):
    x, y = _numbers(400, 0), _numbers(400, 1)
    if ufunc in ONE:
        function, arguments = ONE[ufunc], (x,)
        call = numba.njit(lambda x: function(x))
    else:
        function, arguments = ONE_OF_TWO[ufunc], (x, y)
        call = numba.njit(lambda x, y: function(x, y))
    with np.errstate(all="ignore"):
        expected = [ufunc(*numbers) for numbers in zip(*arguments, strict=True)]
    np.testing.assert_array_equal([call(*numbers) for numbers in zip(*arguments, strict=True)], expected)


@pytest.mark.parametrize("ufunc", [*EACH, *EACH_OF_TWO], ids=lambda ufunc: ufunc.__name__)
def test_of_many_numbers_each_is_that_of_one(ufunc):
    """Vector functions take eight at a time; how many there are must make no difference."""
    if ufunc in EACH:
        function = EACH[ufunc]
        call = numba.njit(lambda x, y, out, n: function(x, out, n))
    else:
        function = EACH_OF_TWO[ufunc]
        call = numba.njit(lambda x, y, out, n: function(x, y, out, n))
    for n in range(35):
        x, y, out = _numbers(n + 3, n), _numbers(n + 3, 99 + n), np.full(n + 3, 7.0)
        call(x, y, out, n)
        with np.errstate(all="ignore"):
            expected = [ufunc(*numbers[: ufunc.nin]) for numbers in zip(x[:n], y[:n], strict=True)]
        np.testing.assert_array_equal(out, [*expected, 7.0, 7.0, 7.0])


def test_other_arrays_are_refused():
    call = numba.njit(lambda x, out: ufuncs.tan_each(x, out, 3))
    with pytest.raises(TypeError, match=r"tan got .*float32.*; expected a contiguous array of float64"):
        call(np.zeros(3, np.float32), np.zeros(3))
    with pytest.raises(TypeError, match=r"expected a contiguous array of float64"):
        call(np.zeros(6)[::2], np.zeros(3))
