"""Distances and speeds behind every definition, against hand-worked numbers and a fine-grained drive."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.kinematics import (
    forward_reach,
    reach,
    response_distance,
    speed_after_response,
    speed_envelope,
    stopping_distance,
    time_to_cover,
    time_to_cover_accelerating,
    time_to_cover_braking,
    time_to_stop,
    travel,
)
from rss_shield.shield.sampling import frames_for

NO_CAP = math.inf


def drive(v, rho, a, b, v_cap=NO_CAP, dt=1e-4):
    """Positions over time of "accelerate for rho (not beyond v_cap), then brake to rest", summed frame by frame."""
    t = np.arange(0.0, rho + (abs(v) + a * rho) / b + 1.0, dt)
    speed = np.minimum(v + a * np.minimum(t, rho), max(v, v_cap))
    speed = np.where(t > rho, np.maximum(speed - b * (t - rho), 0.0), speed)
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt)))


def test_stopping_distance_by_hand():
    # 20 m/s at 4 m/s^2: 5 s at 10 m/s on average
    assert stopping_distance(20.0, 4.0) == 50.0
    assert stopping_distance(0.0, 4.0) == 0.0


def test_a_response_without_acceleration_covers_speed_times_time():
    assert response_distance(7.0, 2.0, 0.0, NO_CAP) == 14.0
    assert speed_after_response(7.0, 2.0, 0.0, NO_CAP) == 7.0


def test_acceleration_ends_at_the_speed_cap():
    # 4 m/s at 2 m/s^2 reaches 6 m/s after 1 s (5 m), then one more second at 6 m/s: 11 m
    assert speed_after_response(4.0, 2.0, 2.0, 6.0) == 6.0
    assert response_distance(4.0, 2.0, 2.0, 6.0) == 11.0


def test_a_car_above_the_speed_cap_keeps_its_speed():
    assert speed_after_response(6.0, 2.0, 2.0, 4.0) == 6.0
    assert response_distance(6.0, 2.0, 2.0, 4.0) == 12.0


def test_reach_by_hand():
    # 10 m/s, 1 s at 3.5 m/s^2: 11.75 m; then from 13.5 m/s at 4 m/s^2: 182.25 / 8 = 22.78125 m
    assert reach(10.0, 1.0, 3.5, 4.0, NO_CAP) == 34.53125
    # capped at 12 m/s: reached after 4/7 s (44/7 m), then 3/7 s at 12 m/s (36/7 m), then 144 / 8 = 18 m
    assert reach(10.0, 1.0, 3.5, 4.0, 12.0) == pytest.approx(80 / 7 + 18)


@pytest.mark.parametrize("v", [0.0, 3.0, 17.0, 31.0])
@pytest.mark.parametrize("v_cap", [5.0, 20.0, NO_CAP])
@pytest.mark.parametrize("a", [0.0, 0.7, 3.5])
def test_reach_is_where_the_drive_ends(v, v_cap, a):
    assert reach(v, 1.3, a, 4.5, v_cap) == pytest.approx(drive(v, 1.3, a, 4.5, v_cap)[-1], abs=1e-3)


def test_a_vanishing_acceleration_changes_nothing_even_with_a_cap():
    for a in (1e-300, 1e-16, 1e-12):
        assert reach(30.0, 1.0, a, 4.0, 30.0) == pytest.approx(30.0 + 112.5, abs=1e-9)
        assert reach(30.0, 1.0, a, 4.0, NO_CAP) == pytest.approx(30.0 + 112.5, abs=1e-9)


@pytest.mark.parametrize("v", [-9.0, -3.0, -1.5, -0.2, 0.0, 4.0, 25.0])
def test_forward_reach_is_the_farthest_point_of_the_drive(v):
    farthest = drive(v, 1.0, 3.5, 4.0).max()
    assert forward_reach(v, 1.0, 3.5, 4.0) == pytest.approx(farthest, abs=1e-3)


def test_forward_reach_never_credits_going_backwards():
    v = np.linspace(-30.0, 30.0, 601)
    d = forward_reach(v, 1.0, 3.5, 4.0)
    assert d.min() == 0.0
    assert np.all(np.diff(d) >= 0.0)


def test_forward_reach_equals_reach_for_cars_that_drive_forward():
    for v in (0.0, 8.0, 33.0):
        assert forward_reach(v, 1.0, 3.5, 4.0) == pytest.approx(reach(v, 1.0, 3.5, 4.0, NO_CAP), abs=1e-12)


def test_the_speed_envelope_rises_for_the_response_time_then_falls_to_rest():
    # 2 m/s, 1 s at 3 m/s^2 up to 5 m/s, then 5 m/s^2 down: at rest after 2 s
    tau = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 9.0])
    assert speed_envelope(tau, 2.0, 1.0, 3.0, 5.0) == pytest.approx([2.0, 3.5, 5.0, 2.5, 0.0, 0.0])


def test_the_speed_envelope_stays_below_the_cap_but_never_slows_a_faster_car():
    # 4 m/s at 2 m/s^2 to the cap of 6 m/s; a car at 8 m/s keeps its speed for the response time
    tau = np.array([0.5, 1.0, 2.0, 3.0])
    assert speed_envelope(tau, 4.0, 2.0, 2.0, 3.0, 6.0) == pytest.approx([5.0, 6.0, 6.0, 3.0])
    assert speed_envelope(tau, 8.0, 2.0, 2.0, 3.0, 6.0) == pytest.approx([8.0, 8.0, 8.0, 5.0])


@pytest.mark.parametrize("v_cap", [5.0, 10.0, NO_CAP])
def test_travel_is_the_area_under_the_speed_envelope_and_ends_at_the_reach(v_cap):
    tau = np.linspace(0.0, 6.0, 60_001)
    speed = speed_envelope(tau, 9.0, 0.8, 2.0, 3.0, v_cap)
    area = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-4)))
    assert travel(tau, 9.0, 0.8, 2.0, 3.0, v_cap) == pytest.approx(area, abs=1e-5)
    assert travel(6.0, 9.0, 0.8, 2.0, 3.0, v_cap) == pytest.approx(reach(9.0, 0.8, 2.0, 3.0, v_cap))


def test_times_by_hand():
    # from rest at 2 m/s^2: 9 m in 3 s; up to 4 m/s: 4 m in 2 s, then 5 m in 1.25 s
    assert time_to_cover_accelerating(9.0, 0.0, 2.0, NO_CAP) == pytest.approx(3.0)
    assert time_to_cover_accelerating(9.0, 0.0, 2.0, 4.0) == pytest.approx(3.25)
    # from 10 m/s at 4 m/s^2: 8 m in 1 s, 12.5 m to rest in 2.5 s
    assert time_to_cover_braking(8.0, 10.0, 4.0) == pytest.approx(1.0)
    assert time_to_cover_braking(12.5, 10.0, 4.0) == pytest.approx(2.5)
    assert time_to_cover_braking(12.6, 10.0, 4.0) == math.inf
    # 10 m/s, 1 s at 2 m/s^2: 11 m; then from 12 m/s at 4 m/s^2 10 m more in 1 s, at rest after 3 s
    assert time_to_cover(21.0, 10.0, 1.0, 2.0, 4.0) == pytest.approx(2.0)
    assert time_to_stop(10.0, 1.0, 2.0, 4.0) == 4.0


def test_times_at_the_ends_of_their_ranges():
    assert time_to_cover_accelerating(5.0, 0.0, 0.0, NO_CAP) == math.inf
    assert time_to_cover_accelerating(5.0, 0.0, 0.0, 3.0) == math.inf
    assert time_to_cover_accelerating(5.0, 2.0, 0.0, NO_CAP) == 2.5
    assert time_to_cover_accelerating(5.0, 2.0, 0.0, 1.0) == 2.5  # above the cap: keeps its speed
    assert time_to_cover_accelerating(8.0, 4.0, 3.0, 4.0) == 2.0
    assert time_to_cover(0.0, 0.0, 1.0, 0.0, 4.0) == time_to_cover(-3.0, 0.0, 1.0, 0.0, 4.0) == 0.0
    assert time_to_cover(1.0, 0.0, 1.0, 0.0, 4.0) == math.inf
    assert time_to_cover_braking(0.0, 0.0, 4.0) == 0.0


@pytest.mark.parametrize("v", [0.0, 3.0, 17.0])
@pytest.mark.parametrize("v_cap", [5.0, 20.0, NO_CAP])
@pytest.mark.parametrize("a", [0.0, 0.7, 3.5])
def test_the_time_to_cover_a_distance_is_when_the_drive_gets_there(v, v_cap, a):
    rho, b = 1.3, 4.5
    end = reach(v, rho, a, b, v_cap)
    for part in (0.1, 0.4, 0.9, 0.999):
        t = time_to_cover(part * end, v, rho, a, b, v_cap)
        assert end == 0.0 or travel(t, v, rho, a, b, v_cap) == pytest.approx(part * end)
        assert t <= time_to_stop(v, rho, a, b, v_cap)
    assert time_to_cover(end + 1e-6, v, rho, a, b, v_cap) == math.inf
    assert travel(time_to_stop(v, rho, a, b, v_cap), v, rho, a, b, v_cap) == pytest.approx(end)


@pytest.mark.parametrize(
    ("duration", "dt", "frames"),
    [
        (1.0, 1 / 15, 15),
        (2 / 15, 1 / 15, 2),
        (0.1, 1 / 15, 2),
        (1e-3, 1 / 15, 1),
        (0.6, 0.2, 3),
        (0.61, 0.2, 4),
        (23 / 15, 1 / 15, 23),  # 23.000000000000004 in floating point
    ],
)
def test_durations_are_rounded_up_to_whole_frames(duration, dt, frames):
    assert frames_for(duration, dt) == frames


def test_arrays_give_what_a_loop_over_floats_gives():
    v = np.linspace(0.0, 40.0, 9)
    assert reach(v, 1.0, 3.5, 4.0, 30.0).tolist() == [reach(x, 1.0, 3.5, 4.0, 30.0) for x in v]
    w = np.linspace(-8.0, 8.0, 9)
    assert forward_reach(w, 1.0, 0.2, 0.8).tolist() == [forward_reach(x, 1.0, 0.2, 0.8) for x in w]


@pytest.mark.parametrize("v_cap", [NO_CAP, 30.0])
def test_a_speed_that_is_not_known_gives_distances_that_are_not(v_cap):
    """A bound made of nan must never look like one that is kept."""
    assert math.isnan(speed_after_response(math.nan, 1.0, 2.0, v_cap))
    for distance in (response_distance(math.nan, 1.0, 2.0, v_cap), reach(math.nan, 1.0, 2.0, 4.0, v_cap)):
        assert math.isnan(distance)
    assert math.isnan(forward_reach(math.nan, 1.0, 2.0, 4.0, v_cap))
    assert math.isnan(speed_envelope(0.5, math.nan, 1.0, 2.0, 4.0, v_cap))
    assert math.isnan(travel(2.0, math.nan, 1.0, 2.0, 4.0, v_cap))
