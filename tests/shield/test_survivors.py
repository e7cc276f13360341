"""Small things that altered sources (`make mutants`) have shown no other test to notice, by hand."""

import math

import pytest

from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.definitions.occlusion import REASONABLE
from rss_shield.shield.definitions.occupancy import VEHICLE, Mover, occupied
from rss_shield.shield.definitions.sensing import joint_failure_bound, joint_miss_bound
from rss_shield.shield.definitions.unstructured import headings_away
from rss_shield.shield.params import PRESETS


def test_a_gap_that_shrinks_slowly_is_gone_some_day():
    assert time_to_collision(5.0, 0.5) == 10.0  # 5 m at half a metre per second
    assert time_to_collision(5.0, 0.0) == math.inf


def test_corollary_3_by_hand():
    # three pairs of subsystems, each of dependence 2, miss once in a hundred each: 3 * 2 * 0.01^2
    assert joint_miss_bound(0.01, 2.0) == pytest.approx(6e-4)
    assert joint_failure_bound(0.01, 2.0) == pytest.approx(12e-4)


def test_everybody_who_is_hidden_may_stand():
    assert {speeds.v_low for speeds in REASONABLE.values()} == {0.0}


@pytest.mark.parametrize(
    ("x", "y", "away"), [(10.0, 0.0, 0.0), (0.0, 10.0, math.pi / 2), (-3.0, -3.0, -3 * math.pi / 4)]
)
def test_headings_that_lead_away_lie_about_the_line_from_the_other(x, y, away):
    assert headings_away(x, y, 0.0, 0.0, 0.5) == pytest.approx((away - 0.5, away + 0.5))


def test_one_long_step_may_hold_a_whole_occupancy():
    driver = PRESETS["ad-rss"].ego
    standing = Mover(x=0.0, y=0.0, heading=0.0, v=0.0, yaw_rate=0.0, half_length=2.5, half_width=1.0)
    assert occupied(standing, driver, VEHICLE, dt=20.0, steps=1).bounds.steps == 1
    with pytest.raises(ValueError, match="steps = 0 is out of range: expected 1 to"):
        occupied(standing, driver, VEHICLE, dt=20.0, steps=0)
