"""What sampling costs: the margins for explicit Euler, and drives that collide without them."""

import numpy as np
import pytest

from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.definitions.lateral import d_min_lateral
from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.params import PRESETS
from rss_shield.shield.sampling import euler_margin, lateral_euler_margin

DT = 1 / 15
# acceleration 3.5, braking 4 against 8 m/s^2, no speed cap
CAR = PRESETS["slides"].ego._replace(standstill_gap=0.0)


def euler_stop(v, b, rho_frames=0, a=0.0, dt=DT):
    """Distance of "accelerate so many frames, then brake to rest"; each frame runs at the speed at its start."""
    x, frame = 0.0, 0
    while v > 0.0 or frame < rho_frames:
        x += v * dt
        v = v + a * dt if frame < rho_frames else max(v - b * dt, 0.0)
        frame += 1
    return x


# ---------------------------------------------------------------- golden numbers


@pytest.mark.parametrize(
    ("v", "b", "rho_frames", "a", "expected"),
    [
        # braking takes 46.875 frames: v^2 / 2b + v dt/2 and the rest of the last frame, (b dt^2 / 2) f (1 - f), f = 7/8
        (25.0, 8.0, 0, 0.0, 39.0625 + 25 / 30 + 8 / 450 * 7 / 64),
        # 1 s at 3.5 m/s^2 first; then 33.5 m/s at 4 m/s^2 take 125.625 frames, f = 5/8
        (30.0, 4.0, 15, 3.5, 31.75 + 33.5**2 / 8 + 30 / 30 + 4 / 450 * 15 / 64),
        # two frames at 3.5 m/s^2, then 20.4666... m/s take 76.75 frames, f = 3/4
        (20.0, 4.0, 2, 3.5, 40 / 15 + 1.75 * 4 / 225 + (307 / 15) ** 2 / 8 + 20 / 30 + 4 / 450 * 3 / 16),
        # one frame at 3 m/s^2, then exactly 7.5 m/s take 22.5 frames, f = 1/2
        (7.3, 5.0, 1, 3.0, 7.3 / 15 + 1.5 / 225 + 7.5**2 / 10 + 7.3 / 30 + 5 / 450 * 1 / 4),
    ],
)
def test_explicit_euler_stops_late_by_half_a_frame_and_the_partial_last_step(v, b, rho_frames, a, expected):
    assert euler_stop(v, b, rho_frames, a) == pytest.approx(expected)
    continuous = reach(v, rho_frames * DT, a, b, np.inf)
    assert 0.0 <= euler_stop(v, b, rho_frames, a) - continuous - v * DT / 2 <= b * DT**2 / 8 + 1e-12
    assert euler_stop(v, b, rho_frames, a) <= continuous + euler_margin(v, b, DT) + 1e-12


def test_the_safe_distance_at_15_frames_a_second_by_hand():
    # 30 behind 20 m/s: 30 + 1.75 + 33.5^2 / 8 - 25 = 147.03125 m, and 10/30 + 1/450
    d = d_min_same_direction(30.0, 20.0, CAR, CAR) + euler_margin(10.0, CAR.a_min_brake, DT)
    assert d == pytest.approx(147.366805556)


def test_equal_speeds_cost_only_the_partial_last_step():
    # 4 * (1/15)^2 / 8 = 1/450 m
    assert euler_margin(0.0, 4.0, DT) == pytest.approx(1 / 450)


def test_a_faster_rear_car_costs_half_a_frame_of_the_difference():
    # 10 m/s * 1/30 s
    assert euler_margin(10.0, 4.0, DT) == pytest.approx(1 / 3 + 1 / 450)


def test_a_faster_front_car_gives_no_credit():
    assert euler_margin(-10.0, 4.0, DT) == euler_margin(0.0, 4.0, DT)


def test_the_margin_vanishes_with_the_frame():
    assert euler_margin(30.0, 8.0, 1e-9) == pytest.approx(0.0, abs=1e-7)
    assert lateral_euler_margin(2.0, CAR, 1e-9) == pytest.approx(0.0, abs=1e-7)


# ---------------------------------------------------------------- theorems


def test_the_margin_covers_every_euler_stop_and_barely():
    rng = np.random.default_rng(1)
    slack = []
    for _ in range(1500):
        dt = rng.choice([1 / 15, 1 / 10, 1 / 5])
        v, a, b, rho_frames = rng.uniform(0.0, 35.0), rng.uniform(0.0, 4.0), rng.uniform(2.0, 9.0), rng.integers(0, 16)
        covered = reach(v, rho_frames * dt, a, b, np.inf) + euler_margin(v, b, dt)
        slack.append((covered - euler_stop(v, b, rho_frames, a, dt)) / (b * dt**2 / 8))
    assert min(slack) >= -1e-6
    assert min(slack) < 0.01 and max(slack) <= 1.0 + 1e-6


def smallest_gap(period=1, rho=1, lag=0, margin=True, b_rear=4.0, b_front=8.0, mode="exact"):
    """Smallest gap of 500 adversarial pairs over 60 s at 15 Hz.

    The rear car accelerates whenever the last tick of its monitor was safe and brakes otherwise; the front car
    brakes and accelerates as it pleases. All times in frames: monitor period, response time, delay of the brake.
    """
    rng = np.random.default_rng(2)
    n = 500
    rear = CAR._replace(response_time=rho * DT, a_min_brake=b_rear, a_min_brake_correct=b_rear)
    front = CAR._replace(a_max_brake=b_front)
    v_rear, v_front = rng.uniform(0.0, 30.0, (2, n))
    gap = np.full(n, np.inf)
    pending = [np.zeros(n, bool)] * (lag + 1)
    a_front, hold = np.zeros(n), np.zeros(n)
    smallest = np.inf
    for frame in range(900):
        needed = d_min_same_direction(v_rear, v_front, rear, front, mode)
        if margin:
            needed += euler_margin(v_rear - v_front, b_rear, DT)
        if frame == 0:
            gap = needed + rng.exponential(5.0, n) + 1e-9
        if frame % period == 0:
            unsafe = (gap <= 0.0) | (gap < needed)
        pending = [*pending[1:], unsafe]
        brakes = pending[0]
        redraw = hold <= 0
        hold = np.where(redraw, rng.integers(1, 90, n), hold - 1)
        a_front = np.where(redraw, rng.choice([-b_front, -b_front, 3.5], n), a_front)
        gap = gap + (v_front - v_rear) * DT
        v_rear = np.maximum(v_rear + np.where(brakes, -b_rear, rear.a_max_accel) * DT, 0.0)
        v_front = np.clip(v_front + a_front * DT, 0.0, 35.0)
        smallest = min(smallest, gap.min())
    return smallest


@pytest.mark.parametrize(
    "drive",
    [
        {},
        {"period": 15, "rho": 15},
        {"rho": 4, "lag": 3},
        {"period": 15, "rho": 15, "b_rear": 8.0, "b_front": 4.0},
    ],
    ids=["every frame", "once a second", "three frames late", "brakes harder than the front car"],
)
def test_no_pair_touches_with_the_margin_and_a_long_enough_response_time(drive):
    assert smallest_gap(**drive) >= -1e-9


@pytest.mark.parametrize(
    "drive",
    [
        {"margin": False},
        {"period": 15, "rho": 15, "margin": False},
        {"period": 15, "rho": 14},
        {"rho": 3, "lag": 3},
        {"period": 15, "rho": 15, "b_rear": 8.0, "b_front": 4.0, "mode": "lemma2"},
    ],
    ids=[
        "no margin, every frame",
        "no margin, once a second",
        "rho below the monitor period",
        "rho below the delay",
        "printed closed form where the rear car brakes harder",
    ],
)
def test_pairs_touch_when_one_condition_is_missing(drive):
    assert smallest_gap(**drive) < -1e-3


def smallest_lateral_gap(margin, dt):
    """Smallest lateral gap of 1000 pairs over 30 s: both drift over while it is safe and brake laterally otherwise."""
    rng = np.random.default_rng(3)
    n = 1000
    car = CAR._replace(response_time=dt, a_lat_max_accel=1.0, a_lat_min_brake=1.5, mu=0.0)
    w_left, w_right, gap = np.zeros(n), np.zeros(n), rng.uniform(1.0, 6.0, n)  # speeds toward the other, never away
    smallest = np.inf
    for _ in range(450):
        needed = d_min_lateral(w_left, -w_right, car, car)
        if margin:
            needed += lateral_euler_margin(w_left, car, dt) + lateral_euler_margin(w_right, car, dt)
        change = np.where(gap >= needed, 1.0, -1.5) * dt
        # a frame runs at the speed chosen at its start
        w_left, w_right = np.maximum(w_left + change, 0.0), np.maximum(w_right + change, 0.0)
        w_left = np.where(rng.random(n) < 0.05, 0.0, w_left)  # anybody may stop at any time
        gap = gap - (w_left + w_right) * dt
        smallest = min(smallest, gap.min())
    return smallest


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
def test_no_two_cars_touch_sideways_with_the_margin_and_some_do_without(dt):
    assert smallest_lateral_gap(margin=True, dt=dt) >= -1e-9
    assert smallest_lateral_gap(margin=False, dt=dt) < -1e-3
