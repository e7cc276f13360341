"""Def. 6 and Lemma 4: the safe lateral distance, in four readings."""

import itertools

import numpy as np
import pytest

from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.definitions.lateral import approach_no_credit, d_min_lateral
from rss_shield.shield.params import PRESETS

# rho 1 s, lateral acceleration 0.2, lateral braking 0.8 m/s^2, mu 0.1 m
CAR = PRESETS["slides"].ego
BARE = CAR._replace(mu=0.0)
READINGS = ("no_credit", "sup", "pair", "paper")


def random_car(rng, rho=None):
    return CAR._replace(
        response_time=rng.uniform(0.05, 2.5) if rho is None else rho,
        a_lat_max_accel=rng.uniform(0.0, 2.0),
        a_lat_min_brake=rng.uniform(0.3, 3.0),
        mu=rng.uniform(0.0, 0.5),
    )


def approach(w, car, t):
    """Distance toward the neighbour at times `t`, frame by frame; a car that still recedes at rho halts there."""
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    at_rho = max(w + a * rho, 0.0)
    speed = np.where(t < rho, w + a * t, np.maximum(at_rho - b * (t - rho), 0.0))
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))))


# ---------------------------------------------------------------- golden numbers


@pytest.mark.parametrize("mode", READINGS)
def test_two_cars_without_lateral_speed_by_hand(mode):
    # each 0.1 m in the response time and 0.2^2 / 1.6 = 0.025 m of braking, and mu
    assert d_min_lateral(0.0, 0.0, CAR, CAR, mode) == pytest.approx(0.35)


@pytest.mark.parametrize("mode", READINGS)
def test_a_car_that_drifts_over_at_1_metre_per_second_by_hand(mode):
    # 1.1 m, then 1.2^2 / 1.6 = 0.9 m; the other 0.125 m; mu
    assert d_min_lateral(1.0, 0.0, CAR, CAR, mode) == pytest.approx(2.225)
    assert d_min_lateral(0.0, -1.0, CAR, CAR, mode) == pytest.approx(2.225)


def test_two_cars_that_drift_the_same_way_tell_the_readings_apart():
    # left car: 1.1 + 0.9 m toward; right car: 0.9 m away during its response time, then braking at
    # 0.8^2 / 1.6 = 0.4 m further away (paper: 0.4 m back; no credit: 0.125 m toward)
    expected = {"pair": 0.1 + 2.0 - 0.9, "sup": 0.1 + 2.0 - 0.9, "paper": 0.1 + 2.0 - 0.9 + 0.4, "no_credit": 2.225}
    for mode, d in expected.items():
        assert d_min_lateral(1.0, 1.0, CAR, CAR, mode) == pytest.approx(d)


def test_a_car_that_races_away_needs_more_room_only_as_printed():
    # -5 m/s: -4.9 m in the response time, but 4.8^2 / 1.6 = 14.4 m of "braking" are added as printed
    assert d_min_lateral(-5.0, 0.0, CAR, CAR, "paper") == pytest.approx(0.1 - 4.9 + 14.4 + 0.125)
    assert d_min_lateral(-5.0, 0.0, CAR, CAR, "pair") == pytest.approx(0.1)
    assert d_min_lateral(-5.0, 0.0, CAR, CAR, "sup") == pytest.approx(0.1)
    assert d_min_lateral(-5.0, 0.0, CAR, CAR, "no_credit") == pytest.approx(0.1 + 0.25)


def test_with_unequal_response_times_the_end_of_the_manoeuvre_is_not_the_closest():
    # rho 1 and 2 s, 0.6 and 0.74 m/s to the right. After 2 s the left car has come 0.7 + 0.4 = 1.1 m and the right one
    # has receded 1.48 - 0.4 = 1.08 m; in between they were closer (hole H3)
    slow = BARE._replace(response_time=2.0)
    assert d_min_lateral(0.6, 0.74, BARE, slow, "pair") == pytest.approx(0.02)
    assert d_min_lateral(0.6, 0.74, BARE, slow, "sup") == pytest.approx(0.116333333)
    assert d_min_lateral(0.6, 0.74, BARE, slow, "paper") == pytest.approx(0.09225)
    assert d_min_lateral(0.6, 0.74, BARE, slow, "no_credit") == pytest.approx(1.6)


def test_mu_is_the_mean_of_the_two_wobbles():
    assert d_min_lateral(0.0, 0.0, CAR._replace(mu=0.2), CAR._replace(mu=0.6)) == pytest.approx(0.25 + 0.4)


def test_reading_def_6_word_for_word_is_too_short_for_two_cars():
    # both drift right at 1 m/s. Word for word the right car goes on receding while it brakes: 1.1 + 0.9 - 0.9 - 0.4
    # = 0.7 m. But it may halt right after its response time: 1.1 + 0.9 - 0.9 = 1.1 m are closed
    t = np.arange(0.0, 4.0, 1e-4)
    closed = np.max(approach(1.0, BARE, t) + approach(-1.0, BARE, t))
    assert closed == pytest.approx(1.1, abs=1e-3)
    word_for_word = 0.7
    assert word_for_word < closed
    for mode in READINGS:
        assert d_min_lateral(1.0, 1.0, BARE, BARE, mode) >= closed - 1e-3


@pytest.mark.parametrize(
    ("u_left", "u_ego", "granted_as_printed", "closed"),
    [(0.5, 0.5, 0.5625, 0.75), (0.2, 0.6, 0.0, 0.175), (0.0, 0.4, 0.0, 0.025)],
)
def test_a_car_between_two_closes_more_than_lemma_4_grants(u_left, u_ego, granted_as_printed, closed):
    # hole H22: the ego has drifted right, away from the left car, and must brake at once for a third car on its
    # right, whose response time is over. The left car uses all its rights: rho u + 0.1 + (u + 0.2)^2 / 1.6
    assert d_min_lateral(u_left, u_ego, BARE, BARE, "paper") == pytest.approx(granted_as_printed)
    really = approach_no_credit(u_left, BARE) - stopping_distance(u_ego, BARE.a_lat_min_brake)
    assert really == pytest.approx(closed)
    for mode in ("paper", "pair", "sup"):
        assert d_min_lateral(u_left, u_ego, BARE, BARE, mode) < really
    assert d_min_lateral(u_left, u_ego, BARE, BARE, "no_credit") >= really


# ---------------------------------------------------------------- theorems


def test_the_sup_reading_is_exactly_the_largest_approach_of_two_cars():
    rng = np.random.default_rng(1)
    for _ in range(300):
        left, right = random_car(rng), random_car(rng)
        u_left, u_right = rng.uniform(-2.0, 2.0, 2)
        t = np.arange(0.0, 30.0, 2e-3)
        closed = max(np.max(approach(u_left, left, t) + approach(-u_right, right, t)), 0.0)
        mu = 0.5 * (left.mu + right.mu)
        assert d_min_lateral(u_left, u_right, left, right, "sup") == pytest.approx(mu + closed, abs=5e-3)


def test_with_equal_response_times_the_end_of_the_manoeuvre_is_the_closest():
    rng = np.random.default_rng(2)
    for _ in range(300):
        rho = rng.uniform(0.05, 2.5)
        left, right = random_car(rng, rho), random_car(rng, rho)
        u_left, u_right = rng.uniform(-3.0, 3.0, (2, 20))
        pair = d_min_lateral(u_left, u_right, left, right, "pair")
        assert pair == pytest.approx(d_min_lateral(u_left, u_right, left, right, "sup"), abs=1e-9)


def test_the_readings_are_ordered():
    rng = np.random.default_rng(3)
    u_left, u_right = rng.uniform(-3.0, 3.0, (2, 50))
    for _ in range(200):
        left, right = random_car(rng), random_car(rng)
        d = {mode: d_min_lateral(u_left, u_right, left, right, mode) for mode in READINGS}
        assert np.all(d["pair"] <= d["sup"] + 1e-12)
        assert np.all(d["sup"] <= d["no_credit"] + 1e-12)
        assert np.all(d["pair"] <= d["paper"] + 1e-12)
        assert np.all(d["pair"] >= 0.5 * (left.mu + right.mu))


@pytest.mark.parametrize("mode", READINGS)
def test_the_mirror_image_needs_the_same_distance(mode):
    rng = np.random.default_rng(4)
    u_left, u_right = rng.uniform(-3.0, 3.0, (2, 200))
    left, right = random_car(rng), random_car(rng)
    mirrored = d_min_lateral(-u_right, -u_left, right, left, mode)
    assert d_min_lateral(u_left, u_right, left, right, mode) == pytest.approx(mirrored, abs=1e-12)


@pytest.mark.parametrize("mode", ["no_credit", "sup", "pair"])
def test_the_distance_never_falls_as_a_car_comes_over_faster(mode):
    u, steady = np.linspace(-4.0, 4.0, 401), np.full(401, 0.3)
    slow = CAR._replace(response_time=2.0)
    assert np.all(np.diff(d_min_lateral(u, steady, CAR, slow, mode)) >= -1e-12)
    assert np.all(np.diff(d_min_lateral(steady, u, CAR, slow, mode)) <= 1e-12)


def test_as_printed_the_distance_falls_as_a_car_comes_over_faster():
    u, steady = np.linspace(-4.0, 4.0, 401), np.full(401, 0.3)
    assert np.any(np.diff(d_min_lateral(u, steady, CAR, CAR, "paper")) < 0.0)


def test_two_cars_that_start_nearer_than_the_sup_distance_touch_in_the_worst_case():
    slow = BARE._replace(response_time=2.0)
    t = np.arange(0.0, 6.0, 1e-4)
    gap = d_min_lateral(0.6, 0.74, BARE, slow, "sup") - approach(0.6, BARE, t) - approach(-0.74, slow, t)
    assert np.min(gap) == pytest.approx(0.0, abs=1e-3)
    # the closed form grants almost 0.1 m less
    gap += d_min_lateral(0.6, 0.74, BARE, slow, "pair") - d_min_lateral(0.6, 0.74, BARE, slow, "sup")
    assert np.min(gap) < -0.09


@pytest.mark.parametrize(("mode", "touches"), [("no_credit", False), ("pair", True), ("paper", True)])
def test_three_cars_abreast_stay_apart_only_without_credit_for_receding(mode, touches):
    # Left and right car drift toward and away from the ego in the middle, which brakes at once for the right car.
    # Everybody starts at the distance under test; the left car uses all its rights. Scan of speeds, mu = 0.
    smallest = np.inf
    t = np.arange(0.0, 8.0, 1e-3)
    for u_left, u_ego in itertools.product(np.arange(0.0, 1.01, 0.1), repeat=2):
        speed = np.maximum(u_ego - BARE.a_lat_min_brake * t, 0.0)
        receded = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-3)))
        granted = d_min_lateral(u_left, u_ego, BARE, BARE, mode)
        smallest = min(smallest, np.min(granted - approach(u_left, BARE, t) + receded))
    assert (smallest < -1e-3) == touches


# ---------------------------------------------------------------- feasibility, shapes, input


def test_centred_cars_fit_beside_each_other_only_with_fitting_parameters():
    # on 3 m lanes two 2 m wide cars have 1 m between them. rho 2 s: 0.4 + 0.1 m each, and mu: too much
    slow = CAR._replace(response_time=2.0)
    assert d_min_lateral(0.0, 0.0, slow, slow) == pytest.approx(1.1)
    assert d_min_lateral(0.0, 0.0, CAR, slow) == pytest.approx(0.725)


@pytest.mark.parametrize("mode", READINGS)
def test_arrays_give_what_a_loop_over_floats_gives(mode):
    rng = np.random.default_rng(5)
    left, right = random_car(rng), random_car(rng)
    u_left, u_right = rng.uniform(-3.0, 3.0, (2, 200))
    d = d_min_lateral(u_left, u_right, left, right, mode)
    assert d.tolist() == [d_min_lateral(a, b, left, right, mode) for a, b in zip(u_left, u_right, strict=True)]


@pytest.mark.parametrize(
    ("u_left", "u_right"),
    [
        (np.array([0.0, 1.0]), 0.0),
        (0.0, np.array([0.0, -1.0])),
    ],
    ids=["array and float", "float and array"],
)
def test_an_array_and_a_float_broadcast(u_left, u_right):
    assert d_min_lateral(u_left, u_right, CAR, CAR).tolist() == pytest.approx([0.35, 2.225])


def test_an_unknown_reading_is_refused():
    with pytest.raises(ValueError, match="'no_credit', 'pair', 'sup' or 'paper'"):
        d_min_lateral(0.0, 0.0, CAR, CAR, "literal")
