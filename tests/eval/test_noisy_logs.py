"""Positions as a camera sees them: what noise does is not what drivers did."""

import numpy as np
import pandas as pd
import pytest

from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.judge.smoothing import EXACT, filled_in
from rss_shield.eval.suite.judge.trajectories import read_csv

DT = 0.1
CARS = {"left": (0.0, 3.5), "right": (0.0, 0.0), "behind": (-80.0, 0.0), "ahead": (60.0, 3.5)}  # where they begin [m]


def judged(tmp_path, sigma, seed, swerves):
    """Four cars at 20 m/s, positions with noise and nothing else; the left one may come over into the right one."""
    rng, time = np.random.default_rng(seed), np.arange(121) * DT
    logs = []
    for name, (x, y) in CARS.items():
        across = -0.9 * np.clip(time - 3.0, 0.0, None) * (swerves and name == "left")
        x, y = x + 20.0 * time + rng.normal(0.0, sigma, 121), y + across + rng.normal(0.0, sigma, 121)
        logs.append(pd.DataFrame({"id": name, "t": time, "x": x, "y": y, "length": 4.5, "width": 1.8}))
    path = tmp_path / "log.csv"
    pd.concat(logs).to_csv(path, index=False)
    return judge_trace(read_csv(path))


@pytest.mark.parametrize("sigma", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_who_drives_straight_is_not_charged_with_noise(tmp_path, sigma, seed):
    judgement = judged(tmp_path, sigma, seed, swerves=True)
    (blame,) = judgement.blames
    names = judgement.trace.users.ids
    assert [names[i] for i in blame.at_fault] == ["left"] and blame.is_sure


@pytest.mark.parametrize("sigma", [0.02, 0.05, 0.1])
def test_what_noise_explains_is_not_sure(tmp_path, sigma):
    dangers = [one for seed in range(3) for one in judged(tmp_path, sigma, seed, swerves=False).dangers]
    across = [one for one in dangers if "across" in one.duty]
    assert len(across) > 50  # all of them noise
    # beyond three standard deviations a sample in 400 is by chance, and more where a log begins and ends
    assert sum(one.is_sure for one in across) <= 0.02 * len(across)
    # who is 80 m or less behind a car and does not brake is so whatever the noise
    assert sum(one.is_sure and "braked less" in one.duty for one in dangers) >= 3


def test_positions_are_smoothed_where_they_are_noise_and_nowhere_else(tmp_path):
    noisy = judged(tmp_path, 0.1, 0, swerves=False).trace.users
    y = noisy.y[10:-10, noisy.ids.index("right")]
    assert np.std(y) < 0.06 and np.std(np.diff(y)) / DT < 0.3  # 0.1 m, and 1.4 m/s, before
    exact = judged(tmp_path, 0.0, 0, swerves=False).trace
    again, noise = filled_in(exact)  # whose accelerations are there by now
    assert noise == EXACT and again.users.x is exact.users.x
