"""Def. 22: is the distance of two road users in open space safe, who brakes, and the proper response."""

import math

import numpy as np
import pytest
from open_space import drive, random_mover, separation

from rss_shield.shield.definitions.longitudinal import d_min_opposite_direction, d_min_same_direction
from rss_shield.shield.definitions.occupancy import CHANGES_GEAR, PEDESTRIAN, VEHICLE, Mover, occupied
from rss_shield.shield.definitions.separation import drives_away
from rss_shield.shield.definitions.unstructured import (
    BOTH_BRAKE,
    BRAKE,
    DANGEROUS,
    DRIVE_AWAY,
    FIRST_BRAKES,
    GO_ON,
    SECOND_BRAKES,
    STAY,
    headings_away,
    proper_response,
    turn_to_drive_away,
    who_brakes,
    who_stays,
)
from rss_shield.shield.params import PRESETS

CAR = PRESETS["ad-rss"].ego
QUICK = CAR._replace(response_time=0.4)
WALKER = CAR._replace(response_time=0.5, a_max_accel=2.0, a_min_brake=2.0, a_max_brake=4.0, v_cap=10.0)
STRAIGHT = VEHICLE._replace(yaw_acceleration=0.0)
THETA = 1.0


def verdict(one, two, driver_1=QUICK, driver_2=QUICK, steering=VEHICLE, eps=0.0, dt=0.1):
    return who_brakes(occupied(one, driver_1, steering, dt), occupied(two, driver_2, steering, dt), eps, THETA)


def smallest_safe_gap(pair_at):
    """Bisects the gap at which `pair_at(gap)` is no longer dangerous."""
    low, high = 0.0, 400.0
    assert pair_at(high) != DANGEROUS
    if pair_at(1e-9) != DANGEROUS:
        return 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pair_at(middle) == DANGEROUS else (low, middle)
    return high


def random_driver(rng):
    b = rng.uniform(2.0, 7.0)
    return CAR._replace(
        response_time=rng.uniform(0.1, 1.5),
        a_max_accel=rng.uniform(0.0, 4.0),
        a_min_brake=b,
        a_min_brake_correct=b,
        a_max_brake=rng.uniform(b, 9.0),
    )


# ---------------------------------------------------------------- on one line it is Defs. 1 to 4


def test_behind_one_another_the_safe_gap_is_that_of_def_1_and_the_rear_car_brakes():
    rng = np.random.default_rng(1)
    some_brake_harder, rear_brakes = 0, 0
    for _ in range(60):
        rear_driver, front_driver = random_driver(rng), random_driver(rng)
        some_brake_harder += rear_driver.a_min_brake > front_driver.a_max_brake
        v_rear, v_front = rng.uniform(0.0, 15.0, 2) * (rng.random(2) < 0.8)
        heading, dt = rng.uniform(-np.pi, np.pi), 0.2
        front = Mover(0.0, 0.0, heading, v_front, 0.0, 2.5, 1.0)

        def pair_at(gap, v=v_rear, front=front, drivers=(rear_driver, front_driver), heading=heading, dt=dt):
            x, y = -(gap + 4.5) * math.cos(heading), -(gap + 4.5) * math.sin(heading)
            return verdict(Mover(x, y, heading, v, 0.0, 2.0, 1.0), front, *drivers, STRAIGHT, dt=dt)

        needed = d_min_same_direction(v_rear, v_front, rear_driver, front_driver)
        found = smallest_safe_gap(pair_at)
        # what is ahead of the linear course within a step: b dt^2 / 8 of each, and never less than needed
        margin = (rear_driver.a_min_brake + front_driver.a_min_brake) * dt**2 / 8
        assert needed <= found <= needed + margin + 2e-3
        if found > 0.0:
            assert pair_at(found + 1e-6) == FIRST_BRAKES
            rear_brakes += 1
    assert rear_brakes > 20
    assert some_brake_harder > 5


def test_head_on_the_safe_gap_is_that_of_def_2_and_both_brake():
    rng = np.random.default_rng(2)
    for _ in range(40):
        drivers, dt = (random_driver(rng), random_driver(rng)), 0.15
        v_1, v_2 = rng.uniform(0.0, 12.0, 2) * (rng.random(2) < 0.8)
        heading = rng.uniform(-np.pi, np.pi)
        cos, sin = math.cos(heading), math.sin(heading)

        def pair_at(gap, v=(v_1, v_2), drivers=drivers, heading=heading, cos=cos, sin=sin, dt=dt):
            one = Mover(0.0, 0.0, heading, v[0], 0.0, 2.5, 1.0)
            two = Mover((gap + 5.0) * cos, (gap + 5.0) * sin, heading + np.pi, v[1], 0.0, 2.5, 1.0)
            return verdict(one, two, *drivers, STRAIGHT, dt=dt)

        needed = d_min_opposite_direction(v_1, v_2, *drivers)
        found = smallest_safe_gap(pair_at)
        margin = (drivers[0].a_min_brake + drivers[1].a_min_brake) * dt**2 / 8
        assert needed <= found <= needed + margin + 2e-3
        assert pair_at(found + 1e-6) == BOTH_BRAKE


# ---------------------------------------------------------------- what is called safe is safe


def pairs(rng, n, v_max=8.0):
    for _ in range(n):
        angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(4.0, 30.0)
        heading, turned = rng.uniform(-np.pi, np.pi, 2)
        if rng.random() < 0.5:  # one drives ahead of the other
            angle, turned = heading + rng.normal(0.0, 0.1), rng.normal(0.0, 0.1)
        one = random_mover(rng, heading=heading, v_max=v_max)
        place = distance * math.cos(angle), distance * math.sin(angle)
        yield one, random_mover(rng, *place, heading + turned, v_max=v_max)


def closest(one, two, drivers, steerings, answer, rng, n=60, dt=0.02):
    """Smallest separation of random motions of a pair that keep to an answer of `who_brakes` [m]."""
    occupancies = [occupied(*user, 0.1) for user in zip((one, two), drivers, steerings, strict=True)]
    steps = [occupancy.bounds.steps for occupancy in occupancies]
    # of a pair of which one goes on only the time until the other stands is promised; the driving away comes later
    until = {FIRST_BRAKES: steps[0], SECOND_BRAKES: steps[1], BOTH_BRAKE: max(steps)}[answer]
    tracks = [
        drive(mover, driver, steering, brakes, rng, n, until * 0.1, dt)
        for mover, driver, steering, brakes in zip(
            (one, two), drivers, steerings, (answer != SECOND_BRAKES, answer != FIRST_BRAKES), strict=True
        )
    ]
    return separation(tracks[0], one, tracks[1], two).min()


USERS = {
    "two cars": ((QUICK, QUICK), (VEHICLE, VEHICLE)),
    "two that change gear": ((QUICK, QUICK), (CHANGES_GEAR, CHANGES_GEAR)),
    "a car and a pedestrian": ((CAR, WALKER), (VEHICLE, PEDESTRIAN)),
}


@pytest.mark.parametrize("users", USERS)
def test_pairs_that_are_safe_do_not_touch_whatever_they_do(users):
    drivers, steerings = USERS[users]
    rng = np.random.default_rng(3)
    seen = []
    for one, two in pairs(rng, 150):
        if steerings[1] is PEDESTRIAN:
            two = two._replace(v=two.v / 4, yaw_rate=0.0, half_length=0.3, half_width=0.3)
        answer = who_brakes(
            occupied(one, drivers[0], steerings[0]), occupied(two, drivers[1], steerings[1]), 0.2, THETA
        )
        if answer != DANGEROUS:
            assert closest(one, two, drivers, steerings, answer, rng) > 0.19
            seen.append(answer)
    assert len(seen) > 20
    # a pedestrian may set out in any direction: it never surely drives away, and no car in front of it does either way
    assert BOTH_BRAKE in seen and (steerings[1] is PEDESTRIAN or {FIRST_BRAKES, SECOND_BRAKES} & set(seen))


@pytest.mark.parametrize("really", [QUICK._replace(response_time=0.8), QUICK._replace(a_min_brake=2.5)])
def test_pairs_of_worse_drivers_than_assumed_do_touch(really):
    rng = np.random.default_rng(4)
    smallest = np.inf
    for one, two in pairs(rng, 250):
        answer = verdict(one, two)
        if answer != DANGEROUS:
            smallest = min(smallest, closest(one, two, (really, really), (VEHICLE, VEHICLE), answer, rng))
    assert smallest < 0.0


def test_most_of_what_is_called_dangerous_can_be_made_to_happen():
    # the bounds are from outside; they must not be so wide that nothing is ever safe
    rng = np.random.default_rng(5)
    dangerous, touched = 0, 0
    for one, two in pairs(rng, 250):
        if verdict(one, two) == DANGEROUS:
            dangerous += 1
            touched += closest(one, two, (QUICK, QUICK), (VEHICLE, VEHICLE), BOTH_BRAKE, rng) < 0.3
    assert dangerous > 30 and touched > 0.5 * dangerous


def widest_angles(one, two, really, rng, n=100, dt=0.02):
    """(smallest theta with which the second surely drives away, widest angle of random motions [rad]) at any stop."""
    braker, goer = occupied(one, QUICK, VEHICLE), occupied(two, QUICK, VEHICLE)
    if not drives_away(braker, goer, 2.0):
        return None
    low, high = 0.0, 2.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if drives_away(braker, goer, middle) else (middle, high)
    until = braker.bounds.steps * 0.1
    first = drive(one, QUICK, VEHICLE, True, rng, n, until, dt)
    second = drive(two, QUICK, really, False, rng, n, until, dt)
    angle = np.abs(np.remainder(second.heading - np.arctan2(second.y - first.y, second.x - first.x) + np.pi, 2 * np.pi))
    return high, np.abs(angle - np.pi)[first.time >= one.v / QUICK.a_max_brake].max()


@pytest.mark.parametrize(("really", "holds"), [(VEHICLE, True), (VEHICLE._replace(yaw_acceleration=2.0), False)])
def test_who_surely_drives_away_does_so_whatever_both_do(really, holds):
    rng = np.random.default_rng(10)
    within, near = [], 0
    for one, two in pairs(rng, 250):
        angles = widest_angles(one, two, really, rng)
        if angles is not None:
            within.append(angles[1] <= angles[0] + 1e-3)
            near += angles[1] > 0.5 * angles[0]
    assert len(within) > 15 and all(within) == holds
    assert near > 0.5 * len(within)  # and the bound is no idle one


# ---------------------------------------------------------------- what the definition implies


def test_who_brakes_does_not_depend_on_who_is_named_first_nor_on_the_frame():
    rng = np.random.default_rng(6)
    swapped = {FIRST_BRAKES: SECOND_BRAKES, SECOND_BRAKES: FIRST_BRAKES, BOTH_BRAKE: BOTH_BRAKE, DANGEROUS: DANGEROUS}
    seen = set()
    for one, two in pairs(rng, 400):
        answer = verdict(one, two)
        assert verdict(two, one) == swapped[answer]
        turn, away = rng.uniform(-np.pi, np.pi), rng.uniform(-50.0, 50.0, 2)
        cos, sin = math.cos(turn), math.sin(turn)
        moved = [
            m._replace(x=cos * m.x - sin * m.y + away[0], y=sin * m.x + cos * m.y + away[1], heading=m.heading + turn)
            for m in (one, two)
        ]
        assert verdict(*moved) == answer
        mirrored = [m._replace(y=-m.y, heading=-m.heading, yaw_rate=-m.yaw_rate) for m in (one, two)]
        assert verdict(*mirrored) == answer
        seen.add(answer)
    assert len(seen) == 4


def test_safe_by_item_1_implies_safe_by_item_2():
    # C_b is part of C_f: where one may go on, it may brake as well (U1)
    rng = np.random.default_rng(7)
    by_item_1 = 0
    for one, two in pairs(rng, 300):
        answer = verdict(one, two)
        if answer in (FIRST_BRAKES, SECOND_BRAKES):
            by_item_1 += 1
            braker, goer = (one, two) if answer == FIRST_BRAKES else (two, one)
            assert drives_away(occupied(braker, QUICK, VEHICLE), occupied(goer, QUICK, VEHICLE), THETA)
            # theta 0: nobody drives away for sure, which leaves item 2
            assert who_brakes(occupied(one, QUICK, VEHICLE), occupied(two, QUICK, VEHICLE), 0.0, -1.0) in (
                BOTH_BRAKE,
                DANGEROUS,
            )
            assert closest(one, two, (QUICK, QUICK), (VEHICLE, VEHICLE), answer, rng) > 0.0
    assert by_item_1 > 10


def test_a_wider_clearance_or_a_longer_response_never_makes_it_safer():
    rng = np.random.default_rng(8)
    lost = 0
    for one, two in pairs(rng, 150):
        answer = verdict(one, two)
        for wider in (verdict(one, two, eps=3.0), verdict(one, two, QUICK._replace(response_time=0.7))):
            assert answer != DANGEROUS or wider == DANGEROUS
            lost += wider == DANGEROUS != answer
    assert lost > 5


def test_a_car_that_passes_well_ahead_of_another_is_safe_from_it():
    # it crosses 10 m/s fast, 12 m ahead of one that creeps and could never get there in time
    crossing = Mover(12.0, -1.0, np.pi / 2, 10.0, 0.0, 2.5, 1.0)
    creeping = Mover(0.0, 0.0, 0.0, 0.5, 0.0, 2.5, 1.0)
    slow = CAR._replace(response_time=0.2, a_max_accel=1.0)
    assert verdict(crossing, creeping, slow, slow) != DANGEROUS
    assert verdict(crossing._replace(y=-12.0), creeping._replace(v=9.0), slow, slow) == DANGEROUS


def test_who_has_not_looked_ahead_far_enough_is_in_danger():
    one, two = Mover(0.0, 0.0, 0.0, 5.0, 0.0, 2.5, 1.0), Mover(90.0, 0.0, 0.0, 5.0, 0.0, 2.5, 1.0)
    short = occupied(one, CAR, VEHICLE, 0.1, 40)
    assert who_brakes(short, occupied(two, CAR, VEHICLE, 0.1, 40), 0.0, THETA) == BOTH_BRAKE
    late = short._replace(bounds=short.bounds._replace(steps=41))
    assert who_brakes(late, occupied(two, CAR, VEHICLE, 0.1, 40), 0.0, THETA) == DANGEROUS


# ---------------------------------------------------------------- the proper response


def test_whoever_has_to_brake_brakes_and_the_other_one_may_go_on_until_that_stands():
    assert proper_response(FIRST_BRAKES, False, False) == (BRAKE, GO_ON)
    assert proper_response(FIRST_BRAKES, False, True) == (BRAKE, GO_ON)
    assert proper_response(FIRST_BRAKES, True, False) == (STAY, DRIVE_AWAY)
    assert proper_response(SECOND_BRAKES, False, False) == (GO_ON, BRAKE)
    assert proper_response(SECOND_BRAKES, True, True) == (DRIVE_AWAY, STAY)


@pytest.mark.parametrize("last", [BOTH_BRAKE, DANGEROUS])
def test_else_both_brake_and_once_they_stand_the_one_that_turns_less_may_drive_away(last):
    assert proper_response(last, False, False) == (BRAKE, BRAKE)
    assert proper_response(last, True, False) == (STAY, BRAKE)
    assert who_stays(last, True, False, 0.1, 0.2) == last
    assert who_stays(last, True, True, 0.1, 0.2) == SECOND_BRAKES
    assert who_stays(last, True, True, 0.2, 0.1) == FIRST_BRAKES
    assert who_stays(last, True, True, 0.1, 0.1) == SECOND_BRAKES  # of equals the first
    # that is settled then, also while it is on its way
    assert proper_response(who_stays(last, True, True, 0.1, 0.2), False, True) == (DRIVE_AWAY, STAY)
    assert who_stays(FIRST_BRAKES, True, True, 0.0, 0.5) == FIRST_BRAKES


def test_headings_away_point_away_and_the_turn_leads_to_them():
    rng = np.random.default_rng(9)
    for _ in range(200):
        x, y, x_other, y_other = rng.uniform(-9.0, 9.0, 4)
        heading, theta = rng.uniform(-np.pi, np.pi), rng.uniform(0.05, 2.5)
        begin, end = headings_away(x, y, x_other, y_other, theta)
        assert math.cos(end - begin) == pytest.approx(math.cos(2 * theta))
        turn = turn_to_drive_away(x, y, heading, x_other, y_other, theta)
        inside = (heading - begin) % (2 * np.pi) <= 2 * theta
        assert (turn == 0.0) == inside
        # at the edge it goes no nearer than theta says: less than a right angle is away at once
        distance = math.hypot(x - x_other, y - y_other)
        for edge in (begin, end):
            farther = math.hypot(x + 1e-4 * math.cos(edge) - x_other, y + 1e-4 * math.sin(edge) - y_other)
            assert (farther > distance) == (theta < np.pi / 2) or abs(theta - np.pi / 2) < 1e-3
        to_edge = min(abs((heading - edge + np.pi) % (2 * np.pi) - np.pi) for edge in (begin, end))
        assert turn == pytest.approx(0.0 if inside else to_edge)


def test_no_parked_pair_waits_forever():
    # nose to nose and side by side: one is told to drive away, and to where it can
    for x, y, heading in ((5.5, 0.0, np.pi), (0.0, 2.3, 0.0), (5.5, 0.0, 0.0)):
        one, two = Mover(0.0, 0.0, 0.0, 0.0, 0.0, 2.5, 1.0), Mover(x, y, heading, 0.0, 0.0, 2.5, 1.0)
        assert verdict(one, two, CAR, CAR) == DANGEROUS
        turns = (
            turn_to_drive_away(one.x, one.y, one.heading, x, y, THETA),
            turn_to_drive_away(x, y, heading, 0.0, 0.0, THETA),
        )
        last = who_stays(DANGEROUS, True, True, *turns)
        assert sorted(proper_response(last, True, True)) == [DRIVE_AWAY, STAY]
