"""How a ride feels, by hand, and against all its samples at once."""

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.eval.rollout import RIDE
from rss_shield.shield.comfort import RIDE as RECORD
from rss_shield.shield.comfort import WIDTHS, Comfort, comfort_of, gap_in_way, ride_on


def ride_of(speeds, headings=None, gaps=None, dt=0.2):
    ride, n = np.zeros(1, RECORD)[0], len(speeds)
    for speed, heading, gap in zip(speeds, headings or [0.0] * n, gaps or [np.inf] * n, strict=True):
        ride_on(ride, float(speed), float(heading), float(gap), dt)
    return comfort_of(ride)


def test_before_anything_is_measured_a_ride_is_comfortable():
    for speeds in ([], [20.0]):
        comfort = ride_of(speeds)
        assert comfort.rms_acceleration == comfort.rms_jerk == comfort.p99_jerk == comfort.hard_brakings_per_km == 0.0
        assert comfort.comfortable_share == 1.0
        assert comfort.min_time_gap == comfort.mean_time_gap == 100.0


def test_a_brake_by_hand():
    # 20, 20, 19, 18, 18 m/s at 5 Hz: a = 0, -5, -5, 0 m/s^2; jerk = -25, 0, 25 m/s^3; 4 + 4 + 3.8 + 3.6 m
    comfort = ride_of([20, 20, 19, 18, 18])
    assert comfort.rms_acceleration == pytest.approx(np.sqrt(50 / 4))
    assert comfort.rms_jerk == pytest.approx(np.sqrt(1250 / 3))
    assert comfort.hard_braking_share == pytest.approx(2 / 4)
    assert comfort.hard_brakings_per_km == pytest.approx(1000 / 15.4)  # it began once
    assert comfort.comfortable_share == pytest.approx(1 / 4)  # the first; then too hard, too hard, too jerky
    assert comfort.p99_acceleration == pytest.approx(5.0, abs=0.06)
    assert comfort.p99_jerk == pytest.approx(25.0, abs=0.26)
    assert comfort.rms_lateral_acceleration == comfort.rms_yaw_acceleration == 0.0


def test_a_turn_by_hand():
    # 10 m/s, the heading grows by 0.02, 0.04, 0.02 rad: yaw rates 0.1, 0.2, 0.1 rad/s; 1, 2, 1 m/s^2 to the side
    comfort = ride_of([10] * 4, headings=[3.12, 3.14, 3.18 - 2 * np.pi, 3.20 - 2 * np.pi])
    assert comfort.rms_lateral_acceleration == pytest.approx(np.sqrt(6 / 3))
    assert comfort.rms_lateral_jerk == pytest.approx(5.0)
    assert comfort.rms_yaw_acceleration == pytest.approx(0.5)
    assert comfort.comfortable_share == 1.0


def test_time_gaps_by_hand():
    comfort = ride_of([10, 10, 10, 0], gaps=[20.0, 8.0, 900.0, 3.0])
    assert comfort.min_time_gap == pytest.approx(0.8)
    assert comfort.mean_time_gap == pytest.approx((2.0 + 0.8) / 2)


@pytest.mark.parametrize(("across", "gap"), [(0.0, 5.0), (1.9, 5.0), (-1.9, 5.0), (2.1, np.inf)])
def test_whoever_overlaps_with_the_ego_is_in_its_way(across, gap):
    assert gap_in_way(10.0, across, 10.0, 4.0) == gap
    assert gap_in_way(-10.0, across, 10.0, 4.0) == np.inf


@pytest.mark.parametrize("n", [3, 40, 400, 5000])
def test_quantiles_are_those_of_all_samples_to_within_a_bin(n):
    rng = np.random.default_rng(n)
    speeds = 15.0 + np.cumsum(rng.normal(0.0, 0.1, n)) + rng.choice([0.0, 1.0], n, p=[0.98, 0.02])
    headings = list(rng.normal(0.0, 0.01, n))
    comfort, dt = ride_of(list(speeds), headings), 0.2
    a, yaw_rate = np.diff(speeds) / dt, np.diff(headings) / dt
    lateral = speeds[:-1] * yaw_rate
    measured = a, np.diff(a) / dt, lateral, np.diff(lateral) / dt, np.diff(yaw_rate) / dt
    for k, values in enumerate(measured):
        assert comfort[k] == pytest.approx(np.sqrt(np.mean(values**2)))
        sizes = np.sort(np.abs(values))
        smallest = sizes[len(sizes) - 1 - int(0.01 * len(sizes))]  # at most 1 % are larger
        assert smallest <= comfort[5 + k] + 1e-9
        assert comfort[5 + k] - WIDTHS[k] <= smallest + 1e-9


def test_records_of_episodes_name_what_is_measured():
    assert set(Comfort._fields) < set(RIDE)


@pytest.mark.parametrize("mode", ["override", "monitor"])
def test_infos_say_how_the_ride_has_felt_since_reset(mode):
    env = make("highway-fast-v0", shield=mode, record=True)
    _, info = env.reset(seed=5)
    assert info["rms_jerk"] == 0.0 and info["comfortable_share"] == 1.0
    for action in (3, 3, 4, 0, 2, 3):
        *_, info = env.step(action)
    speeds = np.array([frame.poses[-1, 3] for frame in env.frames])
    jerk = np.diff(speeds, 2) / 0.2**2
    assert info["rms_jerk"] == pytest.approx(np.sqrt(np.mean(jerk**2)))
    assert info["hard_braking_share"] == pytest.approx(np.mean(np.diff(speeds) / 0.2 < -3.0))
    if mode == "monitor":
        assert info["anticipation_share"] == info["mean_acceleration_change"] == 0.0
    else:
        assert 0.0 < info["anticipation_share"] <= 1.0 and info["mean_acceleration_change"] > 0.0


def test_a_new_episode_in_the_engine_starts_with_a_clean_sheet():
    envs = make_vec("highway-fast-v0", 2)
    for _ in range(2):
        _, infos = envs.reset(seed=3)
        assert (infos["rms_jerk"] == 0.0).all() and (infos["p99_jerk"] == 0.0).all()
        for _ in range(5):
            *_, infos = envs.step(np.array([3, 3]))
        first = infos["p99_jerk"][0]
    assert first > 0.0
