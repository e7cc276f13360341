"""Defs. 12, 13: evasive manoeuvres, and when one is owed."""

import itertools

import numpy as np
import pytest

from rss_shield.shield.definitions.evasion import (
    Motion,
    Plan,
    ends_safely,
    evades,
    follow,
    is_within_limits,
    keeps_clear,
    must_evade,
    plan_family,
    smallest_separation,
)
from rss_shield.shield.definitions.kinematics import speed_envelope
from rss_shield.shield.params import PRESETS

CAR = PRESETS["ad-rss"].ego
EGO = Motion(0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 2.5, 1.0)
STRAIGHT = Plan(0.0, 0.0, 0.0)
GRIP = 8.0


def beside(x, v, y, u=0.0, a=0.0):
    return Motion(x, v, a, y, u, 0.0, 2.5, 1.0)


def test_a_swerve_moves_over_and_straightens_up_again():
    x, v, y, u = follow(EGO, Plan(-2.0, 3.0, 1.0), 4.0)
    assert (x, v, y, u) == pytest.approx((20 * 4 - 16, 12.0, 3.0, 0.0))
    x, v, y, u = follow(EGO, Plan(-6.0, -3.0, 1.0), 9.0)
    assert (x, v, y, u) == pytest.approx((400 / 12, 0.0, -3.0, 0.0))
    # one that drifts already brakes that as well
    assert follow(EGO._replace(u=1.0), Plan(0.0, -2.0, 0.5), 5.0)[2:] == pytest.approx((0.25, 0.0))


@pytest.mark.parametrize(
    ("plan", "within"),
    [
        (Plan(-8.0, 0.0, 0.0), True),
        (Plan(-8.1, 0.0, 0.0), False),
        (Plan(3.5, 0.0, 0.0), True),
        (Plan(3.6, 0.0, 0.0), False),
        (Plan(0.0, -3.0, 1.0), True),
        (Plan(0.0, 3.1, 1.0), False),
        (Plan(-7.0, 3.0, 1.0), True),  # 7.62 m/s^2
        (Plan(-7.8, 3.0, 1.0), False),  # 8.36 m/s^2: the tyres
    ],
)
def test_a_plan_stays_within_what_car_and_tyres_can_do(plan, within):
    assert is_within_limits(plan, CAR, 3.0, GRIP) == within


def test_harder_braking_never_comes_closer_to_a_car_ahead():
    rng = np.random.default_rng(1)
    differs = 0
    for _ in range(100):
        other = beside(rng.uniform(8.0, 60.0), rng.uniform(0.0, 20.0), 0.0, a=rng.uniform(-8.0, 2.0))
        seen = [smallest_separation(EGO, Plan(-b, 0.0, 0.0), other, 5.0, 0.05) for b in (2.0, 4.0, 6.0, 8.0)]
        assert np.all(np.diff(seen) >= -1e-9)
        differs += seen[0] < seen[-1]
    assert differs > 50


def test_a_plan_that_misses_but_ends_in_danger_is_no_evasion():
    # 20 m behind a car of the same speed nothing happens within 3 s, but 65.8 m would be safe
    other = beside(25.0, 20.0, 0.0)
    assert smallest_separation(EGO, STRAIGHT, other, 3.0, 0.05) > 0.0
    assert not ends_safely(EGO, STRAIGHT, other, CAR, CAR, 3.0)
    assert not evades(EGO, STRAIGHT, other, CAR, CAR, 3.0, GRIP, 3.0, 0.05)
    # at rest without contact, or beside it, it is over
    standing = beside(45.0, 0.0, 0.0)
    assert evades(EGO, Plan(-6.0, 0.0, 0.0), standing, CAR, CAR, 3.0, GRIP, 4.0, 0.05)
    assert not evades(EGO, Plan(-4.0, 0.0, 0.0), standing, CAR, CAR, 3.0, GRIP, 6.0, 0.05)
    assert evades(EGO, Plan(0.0, 3.0, 1.1), standing, CAR, CAR, 3.0, GRIP, 4.0, 0.05)
    assert not evades(EGO, Plan(0.0, 3.0, 1.1), standing, CAR, CAR, 2.9, GRIP, 4.0, 0.05)


def test_a_swerve_that_is_fine_alone_but_squeezes_somebody_else_is_rejected():
    swerve, horizon, step = Plan(-4.0, 3.0, 1.1), 4.0, 0.05
    assert evades(EGO, swerve, beside(40.0, 0.0, 0.0), CAR, CAR, 3.0, GRIP, horizon, step)
    for third, clear in (
        (beside(0.0, 20.0, 4.0), False),  # beside it, in the lane it swerves to
        (beside(-15.0, 25.0, 4.0), False),  # comes up there from behind
        (beside(10.0, 15.0, 4.0), False),  # too close ahead
        (beside(-200.0, 20.0, 4.0), True),  # far behind
        (beside(90.0, 20.0, 4.0), True),  # far ahead
        (beside(0.0, 20.0, -4.0), True),  # on the other side
        (beside(0.0, 20.0, 16.0), True),  # four lanes away
        (beside(0.0, 20.0, 16.0, u=-3.0), False),  # and coming over
    ):
        assert keeps_clear(EGO, swerve, third, CAR, CAR, horizon, step) == clear, third


def test_whoever_a_plan_keeps_clear_of_is_not_touched_while_it_keeps_its_own_response():
    # the third may accelerate and come over for its response time, then brakes; ahead it may also brake at once
    rng = np.random.default_rng(2)
    clear, squeezed = 0, 0
    for _ in range(1500):
        plan = Plan(rng.uniform(-8.0, 2.0), rng.choice([-3.0, 0.0, 3.0]), rng.uniform(0.5, 1.5))
        third = beside(rng.uniform(-60.0, 60.0), rng.uniform(0.0, 25.0), rng.uniform(-9.0, 9.0), rng.uniform(-1.0, 1.0))
        kept = keeps_clear(EGO, plan, third, CAR, CAR, 4.0, 0.02)
        smallest = np.inf
        for hard, over in itertools.product((True, False), (-1.0, 1.0)):
            x, y, v = third.x, third.y, third.v
            toward = max(over * third.u, 0.0)
            for k in range(200):
                t = 0.02 * k
                ego = follow(EGO, plan, t)
                along = abs(x - ego[0]) - 5.0
                smallest = min(smallest, max(along, abs(y - ego[2]) - 2.0))
                v_next = max(v - 8.0 * 0.02, 0.0) if hard else speed_envelope(t + 0.02, third.v, 1.0, 3.5, 4.0)
                x += 0.5 * (v + v_next) * 0.02
                y += over * speed_envelope(t + 0.01, toward, 1.0, 0.2, 0.8) * 0.02
                v = v_next
        if kept:
            assert smallest > -1e-3, (plan, third)
            clear += 1
        else:
            squeezed += smallest < 0.0
    assert clear > 200 and squeezed > 100


def test_the_family_of_manoeuvres_is_finite_and_within_the_limits():
    plans = plan_family(CAR, 3.0)
    assert len(plans) == len(set(plans)) == 15
    assert all(is_within_limits(plan, CAR, 3.0, 9.0) for plan in plans)
    assert {plan.a for plan in plans} == {-4.0, -6.0, -8.0}
    assert sum(plan.a_lat == 0.0 for plan in plans) == 3
    mirrored = {plan._replace(a_lat=-plan.a_lat) for plan in plans}
    assert mirrored == set(plans)


@pytest.mark.parametrize("dangerous", [False, True])
@pytest.mark.parametrize("complies", [False, True])
@pytest.mark.parametrize("collides", [False, True])
@pytest.mark.parametrize("way_out", [False, True])
def test_an_evasion_is_owed_in_danger_if_others_fail_or_braking_is_too_little(dangerous, complies, collides, way_out):
    owed = must_evade(dangerous, complies, collides, way_out)
    if not dangerous or not way_out or (complies and not collides):
        assert not owed
    else:
        assert owed
