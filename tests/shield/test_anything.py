"""Distances of whatever holds numbers."""

import numba
import numpy as np
import pandas as pd
import pytest

import rss_shield
from rss_shield import PRESETS

EGO, OTHER = PRESETS["slides"].ego, PRESETS["slides"].other
FAST, SLOW = [20.0, 3.5, 0.0], [15.0, 15.0, 7.0]
FUNCTIONS = [rss_shield.d_min_same_direction, rss_shield.d_min_opposite_direction, rss_shield.d_min_lateral]
FORMS = {
    "lists": list,
    "tuples": tuple,
    "columns": pd.Series,
    "columns of whole numbers": lambda row: (
        pd.Series(row).astype("Int64") if all(x == int(x) for x in row) else pd.Series(row)
    ),
    "single precision": lambda row: np.array(row, np.float32),
    "half precision": lambda row: np.array(row, np.float16),
    "another byte order": lambda row: np.array(row, ">f8"),
    "objects": lambda row: np.array(row, object),
    "a view": lambda row: np.repeat(row, 2)[::2],
}


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("form", FORMS)
def test_lists_and_columns_are_arrays(function, form):
    expected = [function(a, b, EGO, OTHER) for a, b in zip(FAST, SLOW, strict=True)]
    np.testing.assert_allclose(function(FORMS[form](FAST), FORMS[form](SLOW), EGO, OTHER), expected, rtol=1e-6)
    np.testing.assert_allclose(function(FORMS[form](FAST), 15, EGO, OTHER)[0], expected[0], rtol=1e-6)


@pytest.mark.parametrize("number", [20, np.int64(20), np.float32(20), np.array(20.0), np.float64(20)])
def test_single_numbers_of_any_kind_give_a_single_number(number):
    assert rss_shield.d_min_same_direction(number, number, rear=EGO, front=OTHER) == rss_shield.d_min_same_direction(
        20.0, 20.0, EGO, OTHER
    )
    assert np.ndim(rss_shield.d_min_lateral(number, 0, EGO, OTHER, mode="sup")) == 0


def test_a_table_of_columns_gives_a_table():
    frame = pd.DataFrame({"a": [20.0, 10.0], "b": [5.0, 0.0]})
    assert rss_shield.d_min_same_direction(frame, 3.0, EGO, OTHER).shape == (2, 2)
    assert rss_shield.mu_lateral_velocity([0, 1, 2, 3], pd.Series([0.0, 0.1, 0.3, 0.6]), 0, 0.2) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("20", 15.0, EGO, OTHER), "v_rear = '20': expected a number, or numbers in a list or an array"),
        (([20.0, None], 15.0, EGO, OTHER), r"v_rear = \[20.0, None\]: expected a number"),
        ((pd.Series(["fast"]), 15.0, EGO, OTHER), "v_rear = .*fast.*: expected a number"),
        ((20.0, 1j, EGO, OTHER), "v_front = 1j: expected a number"),
        ((20.0, None, EGO, OTHER), "v_front = None: expected a number"),
        ((20.0, 15.0, "slides", OTHER), "rear = 'slides': expected RSSParams"),
        ((20.0, 15.0, EGO, PRESETS["slides"]), r"front = Preset.*: expected RSSParams"),
        ((20.0, 15.0, EGO, OTHER, 3), "mode = 3: expected a text"),
        (([1.0, 2.0], [1.0, 2.0, 3.0], EGO, OTHER), r"v_rear \(2,\), v_front \(3,\): expected shapes that broadcast"),
        (([[1.0, 2.0], [3.0]], 1.0, EGO, OTHER), r"v_rear = \[\[1.0, 2.0\], \[3.0\]\]: expected a number"),
        ((EGO, 15.0, 20.0, OTHER), "d_min_same_direction: "),
    ],
)
def test_what_cannot_be_taken_is_one_line(arguments, message):
    with pytest.raises(ValueError, match=message) as error:
        rss_shield.d_min_same_direction(*arguments)
    assert "\n" not in str(error.value)


def test_one_pair_at_a_time_says_so():
    with pytest.raises(ValueError, match=r"d_min_longitudinal: v_rear = \[1.0, 2.0\]: expected a number$"):
        rss_shield.d_min_longitudinal([1.0, 2.0], 1.0, False, EGO, OTHER, 4.0, 4.0)


def test_compiled_functions_call_them_as_ever():
    table = numba.njit(lambda v, ego, other: shield_distance(v, v, ego, other))
    assert table(20.0, EGO, OTHER) == rss_shield.d_min_same_direction(20.0, 20.0, EGO, OTHER)


shield_distance = rss_shield.d_min_same_direction
