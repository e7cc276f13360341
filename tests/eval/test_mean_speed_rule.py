"""The older rule for contacts with pedestrians."""

import numpy as np
import pytest

from rss_shield.eval.mean_speed_rule import is_exonerated

DT = 0.001
WALKS = 10 / 3.6  # [m/s]


def braking(v: float, t: float, rho: float = 1.0, b: float = 4.0):
    """Speeds and accelerations of a car that keeps `v` for rho and then brakes, until `t`."""
    time = np.arange(0.0, t, DT)
    speed = np.maximum(v - b * np.maximum(time - rho, 0.0), 0.0)
    return speed, np.where(time < rho, 0.0, -b)


# worked numbers: mean speeds 4, 3 and 2.667 m/s against 2.778 m/s
@pytest.mark.parametrize(("v", "t", "expected"), [(5.0, 2.0, False), (3.0, 1.0, False), (3.0, 1.5, True)])
def test_worked_numbers(v, t, expected):
    assert is_exonerated(*braking(v, t), DT, 1.0, 4.0, WALKS) is expected


def test_who_accelerates_or_brakes_less_is_not_exonerated():
    speed, acceleration = braking(2.0, 1.3)
    assert is_exonerated(speed, acceleration, DT, 1.0, 4.0, WALKS)
    assert not is_exonerated(speed, np.where(acceleration == 0.0, 0.1, acceleration), DT, 1.0, 4.0, WALKS)
    assert not is_exonerated(speed, acceleration / 2, DT, 1.0, 4.0, WALKS)


def test_without_a_frame_there_is_nothing_to_say():
    with pytest.raises(ValueError, match=r"expected one, \[T\] with T >= 1"):
        is_exonerated([], [], DT, 1.0, 4.0, WALKS)
