"""The measures of an episode, on scenes whose numbers are worked by hand."""

import math

import numpy as np
import pytest

from rss_shield.shield.risk.meter import LONGEST, EpisodeMeter, Measures

BOX = (5.0, 2.0)


def poses(*rows):
    return np.array(rows, float)


def boxes(n):
    return np.array([BOX] * n)


def measured(*rows, crossing=False):
    meter = EpisodeMeter(0.1, crossing)
    meter.look(poses(*rows), boxes(len(rows)))
    return meter.measures


def test_nobody_there_is_nothing_measured():
    assert measured((0, 0, 0, 20)) == Measures()


def test_a_leader_is_measured_bumper_to_bumper():
    # centres 45 m apart, boxes 5 m long: a gap of 40 m; 20 m/s behind 12 m/s
    # THW 40 / 20 = 2 s, TTC 40 / 8 = 5 s, DRAC 8^2 / (2 40) = 0.8 m/s^2
    now = measured((45, 0.5, 0, 12), (0, 0, 0, 20))
    assert now.min_thw_ahead == pytest.approx(2.0)
    assert now.min_ttc_ahead == pytest.approx(5.0)
    assert now.max_drac_ahead == pytest.approx(0.8)
    assert now.near_misses == 0


def test_the_heading_of_the_ego_is_ahead():
    # the same, turned by 90 degrees
    now = measured((0, 45, math.pi / 2, 12), (0, 0, math.pi / 2, 20))
    assert now.min_thw_ahead == pytest.approx(2.0) and now.min_ttc_ahead == pytest.approx(5.0)


@pytest.mark.parametrize("other", [(45, 2.1, 0, 12), (-45, 0, 0, 30), (45, -2.1, 0, 12)])
def test_who_is_beside_the_way_or_behind_is_not_ahead(other):
    assert measured(other, (0, 0, 0, 20)) == Measures()


def test_a_leader_that_drives_away_needs_no_braking():
    now = measured((45, 0, 0, 25), (0, 0, 0, 20))
    assert now.max_drac_ahead == 0.0 and now.min_ttc_ahead == LONGEST


def test_a_near_miss_is_counted_when_it_begins():
    meter = EpisodeMeter(0.1, crossing=False)
    # TTC = gap / 10: 2, 1.4, 1.0, 2, 1.2 s
    for gap in (20, 14, 10, 20, 12):
        meter.look(poses((gap + 5, 0, 0, 10), (0, 0, 0, 20)), boxes(2))
    assert meter.measures.near_misses == 2 and meter.measures.min_ttc_ahead == pytest.approx(1.0)


def test_standing_is_free_while_nobody_is_within_twenty_metres():
    meter = EpisodeMeter(0.1, crossing=False)
    # sideways, boxes 2 m wide: 22.1 m between centres leave 20.1 m
    for _ in range(30):
        meter.look(poses((0, 22.1, 0, 10), (0, 0, 0, 0.0)), boxes(2))
    assert meter.measures.standing_free == pytest.approx(3.0)
    meter.look(poses((0, 21.9, 0, 10), (0, 0, 0, 0.0)), boxes(2))
    assert meter.measures.standing_free == 0.0


def test_an_impact_is_the_difference_of_velocities():
    meter = EpisodeMeter(0.1, crossing=False)
    # 10 m/s to the right against 24 m/s ahead: hypot = 26
    meter.touch(poses((0, 0, 0, 5), (5, 0, math.pi / 2, 10), (0, 0, 0, 24)), 1)
    assert meter.measures.impact_speed == pytest.approx(26.0)
    assert meter.measures.delta_v == pytest.approx(13.0)


def drive(order):
    """The ego and another cross at right angles, one after the other, at 10 m/s and 10 frames a second."""
    meter = EpisodeMeter(0.1, crossing=True)
    for k in range(80):
        t = 0.1 * k
        ego, other = (-20.0, -50.0) if order == "ego first" else (-50.0, -20.0)
        meter.look(poses((0, other + 10 * t, math.pi / 2, 10), (ego + 10 * t, 0, 0, 10)), boxes(2))
    return meter.measures.min_pet


@pytest.mark.parametrize("order", ["ego first", "other first"])
def test_the_post_encroachment_time_is_from_leaving_to_coming(order):
    # Both centres are 30 m = 3 s apart at the crossing. The first one's rear leaves the strip of the second, 1 m beyond
    # the middle, with its centre at 1 + 2.5 m; the second's front comes to the strip of the first, 1 m before it,
    # with its centre at -3.5 m: 3 s less the 7 m in between are 2.3 s. Squares are 1 m, so 0.2 s on either side.
    assert drive(order) == pytest.approx(2.3, abs=0.25)


def test_who_follows_does_not_encroach():
    meter = EpisodeMeter(0.1, crossing=True)
    for k in range(40):
        meter.look(poses((k, 0, 0, 10), (k - 15.0, 0, 0.1, 10)), boxes(2))
    assert meter.measures.min_pet == LONGEST
