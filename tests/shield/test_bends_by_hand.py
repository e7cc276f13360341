"""What a bend does to the lane frame, worked by hand: an arc to the right of radius 150 m, from the origin along x."""

import numpy as np
import pytest

from rss_shield.shield.geometry import make_road
from rss_shield.shield.lanes.frame import beyond, look_ahead, outside, same_frame, to_lane_frame
from rss_shield.shield.lanes.pair import ROAD_USER

R, DT = 150.0, 0.2
ARC = make_road([(0.0, 0.0, 0.0, 1.0 / R, 300.0, 0.0)])
STRAIGHT = make_road([(0.0, 0.0, 0.0, 0.0, 300.0, 0.0)])
BOX = np.array([5.0, 2.0, 2.5, 1.0])


def on_arc(s, y=0.0):
    angle = s / R
    return (R - y) * np.sin(angle), R - (R - y) * np.cos(angle), angle


def seen(road, pose, before, speed, box=BOX):
    x, y, heading = pose
    user = np.zeros(1, ROAD_USER)[0]
    to_lane_frame(road, x, y, heading, speed, np.cos(heading), np.sin(heading), *before[:2], box, DT, user)
    return user


def test_who_keeps_to_the_arc_moves_along_it_only():
    user = seen(ARC, on_arc(50.0, 1.0), on_arc(46.0, 1.0), 20.0)
    assert user["s"] == pytest.approx(50.0) and user["y"] == pytest.approx(1.0)
    assert user["u"] == pytest.approx(0.0, abs=1e-9)
    # the chord of 4 m of the middle, 149 m from the centre
    assert user["along"] == pytest.approx(2.0 * 149.0 * np.sin(2.0 / R) / DT, rel=1e-6)
    assert user["heading"] == pytest.approx(0.0, abs=1e-12) and user["cos"] == pytest.approx(1.0)


def test_between_the_lane_at_its_centre_and_at_its_rear_axle_a_heading_moves_nobody():
    tilt = np.arctan(2.5 / R)  # 2.5 m behind, nearly
    x, y, along = on_arc(50.0)
    for turned, counts in ((0.0, 0.0), (-0.5 * tilt, 0.0), (-tilt - 0.05, -0.05), (0.03, 0.03)):
        user = seen(ARC, (x, y, along + turned), (np.nan, np.nan), 20.0)
        assert user["heading"] == pytest.approx(turned)
        assert user["sin"] == pytest.approx(np.sin(counts), abs=2e-4)
        assert user["u"] == pytest.approx(20.0 * user["sin"])
    backwards = seen(ARC, (x, y, along + np.pi + 0.05 + tilt), (np.nan, np.nan), 20.0)
    assert backwards["cos"] < 0.0 and backwards["sin"] == pytest.approx(-np.sin(0.05), abs=5e-4)


def test_a_car_that_is_turned_is_longer_and_wider_than_the_least_that_counts():
    user = seen(STRAIGHT, (10.0, 0.0, 0.3), (np.nan, np.nan), 20.0)
    assert user["half_length"] == pytest.approx(2.5 * np.cos(0.3) + np.sin(0.3))
    assert user["half_width"] == pytest.approx(2.5 * np.sin(0.3) + np.cos(0.3))
    assert seen(STRAIGHT, (10.0, 0.0, 0.0), (np.nan, np.nan), 20.0)["half_width"] == 1.0


def test_what_lies_ahead_on_an_arc():
    x, y, _ = on_arc(50.0)
    bend = look_ahead(ARC, x, y, 29.0, 2.5, DT)
    assert bend.curvature == pytest.approx(1 / R, rel=1e-3)
    assert bend.turned == pytest.approx(5.8 / R, rel=1e-3)
    assert bend.slack == pytest.approx(-2.5 / R, rel=1e-3)
    assert bend.idle == pytest.approx((2.9 - 2.5) / R, rel=2e-2)  # on the other side
    slow = look_ahead(ARC, x, y, 20.0, 2.5, DT)
    assert slow.idle == 0.0 and slow.turned == pytest.approx(4.0 / R, rel=1e-3)
    assert look_ahead(STRAIGHT, 50.0, 0.0, 29.0, 2.5, DT) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("speed", [-0.4, -0.1, 0.0, 0.1, 0.4])
def test_who_hardly_moves_sees_the_bend_and_not_the_millimetre_by_which_pieces_do_not_meet(speed):
    half = on_arc(50.0)
    step = np.array([-np.sin(half[2]), np.cos(half[2])]) * 1e-3  # to the right
    road = make_road([(0.0, 0.0, 0.0, 1.0 / R, 50.0, 0.0), (*(half[:2] + step), half[2], 1.0 / R, 250.0, 50.0)])
    for s in np.arange(49.99, 50.01, 1e-4):
        x, y, _ = on_arc(s)
        # over a metre a step of a millimetre is a bend of 500 m
        assert abs(look_ahead(road, x, y, speed, 2.5, DT).curvature) <= 1.0 / R + 1.0 / 500.0 + 1e-4
    x, y, _ = on_arc(40.0)
    assert look_ahead(road, x, y, speed, 2.5, DT).curvature == pytest.approx(1.0 / R, rel=1e-3)


def test_what_lies_behind_counts_for_who_backs_up():
    road = make_road([(0.0, 0.0, 0.0, 1.0 / R, 50.0, 0.0), (*on_arc(50.0), 0.0, 250.0, 50.0)])
    x, y, _ = on_arc(49.9)
    assert look_ahead(road, x, y, -2.0, 2.5, DT).curvature == pytest.approx(1.0 / R, rel=1e-3)
    assert look_ahead(road, x, y, -2.0, 2.5, DT).turned == pytest.approx(-0.4 / R, rel=1e-3)
    assert look_ahead(road, x, y, 2.0, 2.5, DT).curvature < 0.9 / R


def test_a_car_at_the_idle_heading_keeps_to_the_lane_and_turns_with_it():
    x, y, along = on_arc(50.0)
    bend, gain = look_ahead(ARC, x, y, 29.0, 2.5, DT), 29.0 * DT / 2.5
    slip = 0.5 * bend.curvature * 5.8 - bend.idle  # nothing across the lane
    heading = along + bend.idle + gain * slip
    assert heading - (along + bend.turned) == pytest.approx(bend.idle, abs=1e-4)


def test_what_is_outside_of_an_interval():
    assert outside(0.5, -0.1, 0.2) == pytest.approx(0.3)
    assert outside(-0.5, -0.1, 0.2) == pytest.approx(-0.4)
    assert outside(0.1, -0.1, 0.2) == 0.0
    assert beyond(-0.5, -0.1) == pytest.approx(-0.4) and beyond(0.5, -0.1) == pytest.approx(0.5)


def test_frames_are_the_same_where_nothing_turns():
    beside = make_road([(0.0, 4.0, 0.0, 0.0, 300.0, 0.0)])
    turned = make_road([(0.0, 0.0, 0.1, 0.0, 300.0, 0.0)])
    assert same_frame(STRAIGHT, beside)
    assert not same_frame(STRAIGHT, turned) and not same_frame(STRAIGHT, ARC)
