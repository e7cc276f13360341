"""Def. 5: the mu-lateral velocity of a recorded lateral path, straight between its samples."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.lateral import mu_lateral_velocity

MU = 0.1  # the path has to move 0.05 m away to count


def velocity(path, k=0, mu=MU, dt=0.1):
    path = np.asarray(path, dtype=float)
    return mu_lateral_velocity(np.arange(len(path)) * dt, path, k, mu)


def by_definition(path, k, mu, dt, fine=500):
    """Def. 5 read word by word off a finely interpolated path: first exit, then any return before it."""
    t = np.arange(k * dt, (len(path) - 1) * dt + 1e-12, dt / fine)
    away = np.interp(t, np.arange(len(path)) * dt, path) - path[k]
    outside = np.flatnonzero(np.abs(away) >= mu / 2 - 1e-9)
    if len(outside) == 0:
        return 0.0
    out = outside[0]
    inside = away[1:out]
    if np.any(inside * np.sign(away[out]) <= 1e-9):
        return 0.0
    return away[out] / (t[out] - t[0])


def test_a_car_that_keeps_its_place_has_none():
    assert velocity([2.0, 2.0, 2.0, 2.0]) == 0.0


def test_a_steady_drift_has_its_own_slope():
    assert velocity([0.0, 0.05, 0.10, 0.15]) == pytest.approx(0.5)
    assert velocity([3.0, 2.95, 2.90, 2.85]) == pytest.approx(-0.5)
    assert velocity([0.0, 0.06, 0.12, 0.18], k=2) == pytest.approx(0.6)


def test_a_drift_that_has_not_left_the_band_yet_is_none():
    assert velocity([0.0, 0.02, 0.04, 0.049]) == 0.0
    assert velocity([0.0, 0.5], k=1) == 0.0


def test_a_wobble_inside_the_band_is_none():
    assert velocity([0.0, 0.03, 0.0, -0.03, 0.0, 0.03]) == 0.0


def test_a_wobble_beyond_the_band_counts_at_its_steepest():
    # 0.8 m/s out of the start; from the peak at 0.08 m down to 0.03 m in 1/16 s
    wobble = [0.0, 0.08, 0.0, -0.08, 0.0]
    assert velocity(wobble) == pytest.approx(0.8)
    assert velocity(wobble, k=1) == pytest.approx(-0.8)


def test_a_start_from_rest_counts_as_the_mean_speed_to_the_edge_of_the_band():
    # 0.1 t^2 = 0.05 at t = sqrt(1/2)
    t = np.arange(0.0, 1.0, 1e-4)
    assert mu_lateral_velocity(t, 0.1 * t**2, 0, MU) == pytest.approx(0.05 * math.sqrt(2.0), abs=1e-6)


def test_a_path_that_comes_back_before_it_leaves_is_none():
    assert velocity([0.0, -0.02, 0.0, 0.08]) == 0.0
    assert velocity([0.0, -0.02, 0.08]) == 0.0
    assert velocity([0.0, 0.02, -0.08]) == 0.0


def test_a_path_that_stays_before_it_leaves_is_none():
    assert velocity([0.0, 0.0, 0.08]) == 0.0


def test_a_path_that_pauses_elsewhere_counts():
    # 0.02 m, a pause, then out: 0.05 m are reached after 0.25 s
    assert velocity([0.0, 0.02, 0.02, 0.08]) == pytest.approx(0.05 / 0.25)


def test_only_the_way_out_counts_not_what_comes_after():
    assert velocity([0.0, 0.08, -9.0, 9.0]) == pytest.approx(0.8)


def test_a_wider_band_forgives_a_larger_wobble():
    wobble = [0.0, 0.08, 0.0, -0.08, 0.0]
    assert velocity(wobble, mu=0.15) == pytest.approx(0.8)
    assert velocity(wobble, mu=0.17) == 0.0


def test_samples_need_not_be_evenly_spaced():
    time = np.array([0.0, 0.3, 0.4, 1.4])
    assert mu_lateral_velocity(time, np.array([0.0, 0.03, 0.04, 0.14]), 0, MU) == pytest.approx(0.1)


def test_random_walks_obey_the_definition_word_by_word():
    rng = np.random.default_rng(1)
    kinds = set()
    for _ in range(400):
        path = np.cumsum(rng.choice([-3, -1, 0, 1, 2, 4], 8)) / 64  # exact, so that returns are
        k = int(rng.integers(0, 6))
        expected = by_definition(path, k, MU, 0.1)
        # the finely sampled exit is at most one fine step late: 1/500 of a sample
        assert velocity(path, k) == pytest.approx(expected, rel=0.01)
        kinds.add(np.sign(expected))
    assert kinds == {-1.0, 0.0, 1.0}


def test_mirrored_paths_have_mirrored_velocities():
    rng = np.random.default_rng(2)
    for _ in range(100):
        path = np.cumsum(rng.normal(0.0, 0.04, 10))
        assert velocity(-path) == -velocity(path)
