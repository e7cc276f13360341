"""Defs. 29-31, Lemma 7: errors in semantic units, and what accuracy in them guarantees."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.sensing import (
    accuracy_for,
    lateral_error,
    lipschitz_constant,
    longitudinal_error,
    policy_losses,
    semantic_error,
    semantic_position,
    semantic_velocity,
)
from rss_shield.shield.geometry import locate, make_road


def test_semantic_velocity_is_the_derivative_of_the_position():
    # along a circle of 50 m radius whose lane widens by 2 cm a metre, 0.4 m/s outward
    road = make_road([[0.0, 0.0, 0.0, 1 / 50, 100.0, 0.0]])

    def at(t):
        s, offset = 5.0 + 12.0 * t, 0.3 - 0.4 * t
        angle = s / 50.0
        x, y = (50.0 - offset) * math.sin(angle), 50.0 - (50.0 - offset) * math.cos(angle)
        found_s, found_offset, _, _ = locate(road, x, y)
        assert (found_s, found_offset) == pytest.approx((s, offset), abs=1e-9)
        return np.array(semantic_position(found_s, found_offset, 4.0 + 0.02 * found_s))

    h, t = 1e-5, 1.3
    slope = (at(t + h) - at(t - h)) / (2 * h)
    s, offset = 5.0 + 12.0 * t, 0.3 - 0.4 * t
    assert semantic_velocity(12.0, -0.4, offset, 4.0 + 0.02 * s, 0.02) == pytest.approx(tuple(slope), abs=1e-6)


def test_errors_along_are_relative_beyond_one_metre_and_across_in_lanes():
    assert longitudinal_error(100.0, 103.0) == pytest.approx(0.03)
    assert longitudinal_error(-100.0, -103.0) == pytest.approx(0.03)
    assert longitudinal_error(0.5, 0.8) == pytest.approx(0.3)
    assert lateral_error(-0.5, 0.25) == 0.75
    np.testing.assert_allclose(longitudinal_error(np.array([0.5, 10.0]), np.array([0.8, 11.0])), [0.3, 0.1])


def test_the_largest_error_of_all_objects_counts():
    lon, lat = np.array([50.0, 0.2, 9.0]), np.array([0.0, 1.0, -1.0])
    assert semantic_error(lon, lat, lon, lat) == 0.0
    assert semantic_error(lon, lat, lon + np.array([5.0, 0.0, 0.0]), lat) == pytest.approx(0.1)
    assert semantic_error(lon, lat, lon + np.array([5.0, 0.3, 0.0]), lat) == pytest.approx(0.3)
    assert semantic_error(lon, lat, lon, lat + np.array([0.0, 0.0, 0.6])) == pytest.approx(0.6)
    assert semantic_error(lon[:0], lat[:0], lon[:0], lat[:0]) == 0.0


def test_the_lipschitz_constant_is_the_steepest_change_seen():
    q_true = np.array([[1.0, 2.0], [0.0, 0.0], [5.0, 5.0]])
    q_sensed = np.array([[1.0, 3.0], [0.5, 0.0], [5.0, 5.0]])
    assert lipschitz_constant(q_true, q_sensed, np.array([0.5, 0.1, 0.0])) == pytest.approx(5.0)
    assert lipschitz_constant(q_true, q_sensed, np.array([0.5, 0.0, 0.0])) == math.inf


@pytest.mark.parametrize(("factor", "within"), [(1.0, True), (3.0, False)])
def test_lemma_7_measurements_of_that_accuracy_lose_no_more_than_eps(factor, within):
    # a value per action that changes by at most `steep` per unit of error, seen at random errors up to the accuracy
    rng = np.random.default_rng(1)
    steep, eps, n = 4.0, 0.5, 20_000
    accuracy = accuracy_for(eps, steep)
    assert accuracy == eps / (2 * steep)
    errors = factor * accuracy * rng.uniform(0.0, 1.0, n)
    q_true = rng.normal(size=(n, 2)) * 0.3
    q_sensed = q_true + steep * errors[:, None] * rng.choice([-1.0, 1.0], (n, 2))
    assert lipschitz_constant(q_true, q_sensed, errors) == pytest.approx(steep)
    losses = policy_losses(q_true, q_sensed)
    assert (losses.max() <= eps) == within
    assert losses.max() > 0.5 * eps
