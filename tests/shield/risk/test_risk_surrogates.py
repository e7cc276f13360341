"""TTC, THW, DRAC."""

import numpy as np
import pytest
from examples import CASES

from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.risk import toward_leader
from rss_shield.shield.risk.surrogates import inverse_ttc, required_braking, time_headway


@pytest.mark.parametrize("name", CASES)
def test_times_of_every_case_have_the_digits_given(name):
    case = CASES[name]
    expected, ego = case["iso"], case["ego"]
    ttc = time_to_collision(expected["r_m"], -expected["r_dot"])
    assert (ttc == np.inf) == (expected["TTC_s"] is None)
    if expected["TTC_s"] is not None:
        assert ttc == pytest.approx(expected["TTC_s"], rel=1e-5)
    # the examples keep the sign of TTCi, the paper has 0 when not closing
    assert inverse_ttc(expected["r_m"], -expected["r_dot"]) == pytest.approx(max(expected["TTCi"], 0.0), rel=1e-5)
    headway = time_headway(expected["r_m"], float(np.hypot(ego["vx"], ego["vy"])))
    assert headway == pytest.approx(expected["THW_s"], rel=1e-5)


@pytest.mark.parametrize(
    ("gap", "closing", "expected"),
    [
        (20.0, 10.0, (2.0, 0.5, 2.5)),  # 100 / 40
        (45.0, 30.0, (1.5, 1 / 1.5, 10.0)),
        (20.0, 0.0, (np.inf, 0.0, 0.0)),
        (20.0, -5.0, (np.inf, 0.0, 0.0)),
        (0.0, 4.0, (0.0, np.inf, np.inf)),
        (-1.0, 4.0, (0.0, np.inf, np.inf)),
        (-1.0, -4.0, (np.inf, 0.0, 0.0)),
    ],
)
def test_by_hand(gap, closing, expected):
    found = (time_to_collision(gap, closing), inverse_ttc(gap, closing), required_braking(gap, closing))
    assert found == pytest.approx(expected)


@pytest.mark.parametrize(("gap", "closing"), [(20.0, 10.0), (7.0, 3.0), (60.0, 25.0)])
def test_braking_as_required_just_avoids_contact(gap, closing):
    dt, b, smallest = 1e-4, required_braking(gap, closing), gap
    while closing > 0.0:
        gap -= closing * dt - 0.5 * b * dt**2
        closing -= b * dt
        smallest = min(smallest, gap)
    assert smallest == pytest.approx(0.0, abs=1e-3)


def test_a_standing_ego_has_no_headway():
    assert time_headway(10.0, 0.0) == np.inf
    assert time_headway(-2.0, 10.0) == 0.0


def users(*rows):
    out = np.zeros(len(rows), ROAD_USER)
    for one, (s, y, speed, cos) in zip(out, rows, strict=True):
        one["s"], one["y"], one["speed"], one["cos"] = s, y, speed, cos
        one["half_length"], one["half_width"] = 2.5, 1.0
    return out


def test_the_leader_is_the_nearest_ahead_in_the_way():
    ego = users((0.0, 0.0, 20.0, 1.0))[0]
    found = toward_leader(
        ego, users((60.0, 0.0, 5.0, 1.0), (35.0, 1.9, 15.0, 1.0), (15.0, 2.1, 0.0, 1.0), (-9, 0, 9, 1))
    )
    assert found == pytest.approx((6.0, 1.5, 25 / 60, 1))  # 30 m between bumpers, 5 m/s closing
    oncoming = toward_leader(ego, users((45.0, 0.0, 20.0, -1.0)))
    assert oncoming == pytest.approx((1.0, 2.0, 20.0, 0))
    assert toward_leader(ego, users((15.0, 3.0, 0.0, 1.0))) == (np.inf, np.inf, 0.0, -1)
    assert toward_leader(ego, users()) == (np.inf, np.inf, 0.0, -1)
