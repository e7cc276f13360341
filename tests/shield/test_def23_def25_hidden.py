"""Defs. 23-25: when a road user is first seen, and which hidden ones nobody need expect."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.occlusion import (
    REASONABLE,
    exposure_time,
    is_hidden,
    is_unreasonable_behaviour,
    is_unreasonable_speed,
    visible_distance,
)

TIME = np.linspace(0.0, 2.0, 5)


def test_exposure_is_the_first_sight():
    assert exposure_time(TIME, np.array([False, False, True, False, True])) == 1.0
    assert exposure_time(TIME, np.array([True, False, False, False, False])) == 0.0
    assert exposure_time(TIME, np.zeros(5, bool)) == math.inf


def test_a_wall_hides_what_is_behind_it_and_nothing_else():
    wall = np.array([[5.0, -1.0, 5.0, 1.0]])
    assert is_hidden(0.0, 0.0, 10.0, 0.0, wall)
    assert is_hidden(0.0, 0.0, 10.0, 1.9, wall)
    assert is_hidden(0.0, 0.0, 10.0, 2.0, wall)  # just along its end
    assert not is_hidden(0.0, 0.0, 10.0, 2.1, wall)
    assert not is_hidden(0.0, 0.0, 4.9, 0.0, wall)  # before it
    assert not is_hidden(0.0, 0.0, -10.0, 0.0, wall)  # behind the eye
    assert not is_hidden(0.0, 0.0, 10.0, 0.0, wall[:0])


def test_hiding_is_what_points_along_the_line_of_sight_say():
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(300):
        eye, point, start, end = rng.uniform(-5.0, 5.0, (4, 2))
        # walk along the line of sight and ask on which side of the wall it is
        share = np.linspace(0.0, 1.0, 20_001)[:, None]
        sight = eye + share * (point - eye)
        along, across = end - start, sight - start
        side = along[0] * across[:, 1] - along[1] * across[:, 0]
        crossing = np.flatnonzero(side[:-1] * side[1:] < 0.0)
        hits = False
        if len(crossing):
            at = (across[crossing[0]] @ along) / (along @ along)
            if min(abs(at), abs(at - 1.0)) < 1e-3:
                continue
            hits = 0.0 < at < 1.0
        assert is_hidden(*eye, *point, np.array([[*start, *end]])) == hits
        seen.add(hits)
    assert seen == {True, False}


def test_one_sees_along_a_path_up_to_the_first_hidden_point():
    path = np.column_stack([np.arange(0.0, 30.0), np.zeros(30), np.arange(0.0, 30.0)])
    corner = np.array([[10.0, 0.0, 10.0, -9.0]])  # the path passes a corner that an eye on the right looks around
    assert visible_distance(0.0, 5.0, path, corner[:0]) == 29.0
    assert visible_distance(0.0, -5.0, path, corner) == 10.0
    assert visible_distance(0.0, 5.0, path, np.array([[5.0, 2.5, 25.0, 2.5]])) == 9.0


def test_speeds_outside_the_table_are_unreasonable():
    for low, high, _ in REASONABLE.values():
        assert 0.0 <= low < high
        assert not is_unreasonable_speed(low, low, high) and not is_unreasonable_speed(high, low, high)
        assert is_unreasonable_speed(high + 0.01, low, high)
    np.testing.assert_array_equal(is_unreasonable_speed(np.array([0.5, 2.0, 9.0]), 1.0, 8.0), [True, False, True])


def test_the_table_expects_more_speed_where_others_have_priority_and_less_where_cars_are_parked():
    high = {key: value.v_high for key, value in REASONABLE.items()}
    assert high["car", "priority road"] > high["car", "urban"] > high["car", "residential"] > high["car", "parking row"]
    assert high["pedestrian", "crossing"] == pytest.approx(10 / 3.6)
    assert all(value.source for value in REASONABLE.values())


def test_only_what_was_done_before_exposure_makes_behaviour_unreasonable():
    violates = np.array([False, True, False, False, True])  # at 0.5 and 2 s
    assert is_unreasonable_behaviour(TIME, violates, 1.0)
    assert not is_unreasonable_behaviour(TIME, violates, 0.5)
    assert is_unreasonable_behaviour(TIME, violates, math.inf)
    assert not is_unreasonable_behaviour(TIME, np.zeros(5, bool), math.inf)
