"""Pedestrians off the crossings: what is theirs to reach."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.pedestrians import WALKS, Walk, distance_to_reach, leaped, reach_ahead, reach_disc

WALK = WALKS["paper"]


def end_points(v, walk, rng, n=20_000, dt=0.01):
    """Where random pedestrians that start along x stand in the end, and where they were on the way: `[K, N, 2]`."""
    velocity = np.tile([v, 0.0], (n, 1))
    place = np.zeros((n, 2))
    seen = [place]
    frames = round(walk.response_time / dt)
    for k in range(frames):
        if k % max(1, frames // 3) == 0:
            angle = rng.uniform(-np.pi, np.pi, n)
            push = walk.a_max_accel * rng.choice([0.0, 1.0], n, p=[0.1, 0.9])
            a = np.stack([push * np.cos(angle), push * np.sin(angle)], axis=1)
            if k == 0:
                a[: n // 2] = walk.a_max_accel * np.stack([np.cos(angle), np.sin(angle)], axis=1)[: n // 2]
                constant = a[: n // 2]
            a[: n // 2] = constant
        place = place + velocity * dt + 0.5 * a * dt**2
        velocity = velocity + a * dt
        seen.append(place)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    way = velocity * speed / (2 * walk.a_min_brake)  # straight on, braking
    return np.array([*seen, place + 0.5 * way, place + way])


@pytest.mark.parametrize("v", [0.0, 0.3, 1.5, 3.0])
@pytest.mark.parametrize("walk", [WALK, Walk(0.8, 2.0, 2.0), Walk(0.3, 1.0, 4.0)])
def test_no_pedestrian_leaves_its_reach_and_some_get_to_its_edge(v, walk):
    points = end_points(v, walk, np.random.default_rng(1))[:, ::7].reshape(-1, 2)
    away = np.array([distance_to_reach(x, y, 0.0, v, walk) for x, y in points])
    assert away.max() < 1e-9
    assert away.max() > -0.02


@pytest.mark.parametrize("change", ["response_time", "a_max_accel", "a_min_brake"])
def test_a_worse_pedestrian_leaves_the_reach_of_a_better_one(change):
    better = {"response_time": 0.4, "a_max_accel": 1.5, "a_min_brake": 2.5}[change]
    points = end_points(1.5, WALK, np.random.default_rng(2))[-1]
    assumed = WALK._replace(**{change: better})
    assert max(distance_to_reach(x, y, 0.0, 1.5, assumed) for x, y in points[::5]) > 0.05


def test_a_standing_one_owns_a_disc_of_half_a_metre():
    for angle in np.linspace(0.0, 6.0, 9):
        edge = distance_to_reach(0.5 * math.cos(angle), 0.5 * math.sin(angle), 1.0, 0.0, WALK)
        assert edge == pytest.approx(0.0, abs=1e-12)
    assert reach_disc(0.0, WALK) == (0.0, 0.5)


def test_ahead_it_is_the_reach_of_the_walking_speed():
    for v in (0.0, 0.7, 1.5, 4.0):
        centre, radius = reach_disc(v, WALK)
        assert centre + radius == pytest.approx(reach_ahead(v, WALK))
        along = reach_ahead(v, WALK)
        assert distance_to_reach(0.0, along, np.pi / 2, v, WALK) == pytest.approx(0.0, abs=1e-12)
        assert distance_to_reach(0.0, along + 0.3, np.pi / 2, v, WALK) == pytest.approx(0.3)
    np.testing.assert_allclose(reach_ahead(np.array([0.0, 1.5]), WALK), [0.5, 2.5625])


def test_to_the_side_a_walking_one_reaches_farther_than_a_standing_one():
    # braking along its way leaves more of the sideways speed than braking each axis for itself would
    sideways = end_points(1.5, WALK, np.random.default_rng(3))[-1][:, 1].max()
    assert 0.5 + 0.05 < sideways <= reach_disc(1.5, WALK)[1]


def test_the_distance_is_that_to_the_nearest_point_of_the_region():
    # against the hull of the origin and the disc, drawn with many points
    rng = np.random.default_rng(4)
    for v in (0.4, 1.5, 3.0):
        centre, radius = reach_disc(v, WALK)
        share = np.linspace(0.0, 1.0, 400)[:, None]
        angle = np.linspace(0.0, 2 * np.pi, 721)[None]
        x, y = share * (centre + radius * np.cos(angle)), share * radius * np.sin(angle)
        for px, py in rng.uniform(-2.0, 6.0, (40, 2)):
            drawn = np.hypot(x - px, y - py).min()
            distance = distance_to_reach(px, py, 0.0, v, WALK)
            if distance > 0.0:
                assert distance == pytest.approx(drawn, abs=0.02)
            else:
                assert drawn < 0.02


def test_who_gets_farther_has_leaped():
    assert not leaped(0.0, 0.5, 0.0, 0.0, WALK)
    assert leaped(0.0, 0.51, 0.0, 0.0, WALK)
    assert not leaped(2.5, 0.0, 0.0, 1.5, WALK)
    assert leaped(-0.2, 0.0, 0.0, 1.5, WALK)
    assert leaped(2.6, 0.0, 0.0, 1.5, WALK)
