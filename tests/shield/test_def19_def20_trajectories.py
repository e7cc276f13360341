"""Defs. 19, 20: when a trajectory has stopped, and when one does not collide with another."""

import math

import numpy as np
import pytest

from rss_shield.shield.definitions.trajectories import angle_away, do_not_collide, first_contact, stopping_sample

TIME = np.linspace(0.0, 10.0, 101)
NEVER = len(TIME)


def straight(x, y, heading, v, b=0.0):
    """`[T, 3]` from a point on in a direction, braking at `b` to rest; and the sample at which it stands."""
    t = TIME if b == 0.0 else np.minimum(TIME, v / b)
    s = v * t - 0.5 * b * t**2
    speed = np.maximum(v - b * TIME, 0.0)
    path = np.column_stack([x + s * np.cos(heading), y + s * np.sin(heading), np.full(len(t), heading)])
    return path, stopping_sample(speed)


def test_a_trajectory_has_stopped_once_it_stands_for_good():
    assert stopping_sample(np.array([3.0, 1.0, 0.0, 0.0])) == 2
    assert stopping_sample(np.array([3.0, 0.0, 1.0, 0.0])) == 3  # a halt in between is none
    assert stopping_sample(np.array([0.0, 0.0])) == 0
    assert stopping_sample(np.array([0.0, 1.0])) == 2


def test_contact_is_found_between_samples_too():
    # head-on at 10 and 5 m/s from 40 m apart, closer than 1 m after 39 / 15 s
    one, _ = straight(0.0, 0.0, 0.0, 10.0)
    two, _ = straight(40.0, 0.0, np.pi, 5.0)
    assert first_contact(TIME, one, two, 1.0) == pytest.approx(39 / 15, abs=0.1)
    # beside each other at 3 m: closest when level after 40 / 15 s, between two samples
    two[:, 1] += 3.0
    assert first_contact(TIME, one, two, 2.99) == math.inf
    assert first_contact(TIME, one, two, 3.0 + 1e-9) == pytest.approx(40 / 15, abs=1e-3)
    assert first_contact(TIME, one, one, 0.0) == 0.0


def test_the_angle_is_none_straight_away_and_pi_straight_at_the_other():
    assert angle_away(0.0, 0.0, 5.0, 0.0, 0.0) == pytest.approx(0.0)
    assert angle_away(0.0, 0.0, 5.0, 0.0, np.pi) == pytest.approx(np.pi)
    assert angle_away(1.0, 1.0, 1.0, -2.0, 0.0) == pytest.approx(np.pi / 2)
    assert angle_away(0.0, 0.0, 3.0, 3.0, 2 * np.pi) == pytest.approx(np.pi / 4)


def test_not_to_collide_is_not_commutative():
    # the rear car brakes 20 m behind one that goes on: it does not collide with it; asked the other way round, the
    # front car would have to keep clear of one that drives at it
    rear, stops = straight(0.0, 0.0, 0.0, 8.0, 4.0)
    front, _ = straight(20.0, 0.0, 0.0, 8.0)
    assert do_not_collide(TIME, rear, front, stops, NEVER, 0.5, 0.3)
    rear_on, _ = straight(0.0, 0.0, 0.0, 8.0)
    front_stops, stops = straight(20.0, 0.0, 0.0, 8.0, 4.0)
    assert not do_not_collide(TIME, front_stops, rear_on, stops, NEVER, 0.5, 0.3)


@pytest.mark.parametrize(("heading", "away"), [(0.0, True), (0.29, True), (0.31, False), (np.pi / 2, False)])
def test_after_the_first_has_stopped_the_second_must_drive_away_within_theta(heading, away):
    # the second starts where the first one's way leads; at the stop it is still on the same line
    one, stops = straight(0.0, 0.0, 0.0, 4.0, 4.0)
    two, _ = straight(20.0, 0.0, heading, 1e-9)
    assert do_not_collide(TIME, one, two, stops, NEVER, 0.5, 0.3)  # apart for as long as the samples go
    # a car that comes back later collides unless driving away at the stop is what counts
    two = np.column_stack([20.0 - 4.0 * np.maximum(TIME - 2.0, 0.0), 0.0 * TIME, np.full(len(TIME), heading)])
    assert do_not_collide(TIME, one, two, stops, NEVER, 0.5, 0.3) == away


def test_theta_decides_and_eps_decides():
    one, stops = straight(0.0, 0.0, 0.0, 4.0, 4.0)
    two, _ = straight(2.5 + 1.0, 0.0, 1.0, 3.0)
    two[50:, 0] = one[50:, 0]  # it comes back
    two[50:, 1] = 0.0
    x = (one[stops, 0], one[stops, 1], two[stops, 0], two[stops, 1], two[stops, 2])
    angle = angle_away(*x)
    assert do_not_collide(TIME, one, two, stops, NEVER, 0.5, angle + 0.01)
    assert not do_not_collide(TIME, one, two, stops, NEVER, 0.5, angle - 0.01)
    assert not do_not_collide(TIME, one, two, stops, NEVER, 10.0, np.pi)
