"""Anticipation for plans: of the accelerations that leave one, the smoothest."""

import numpy as np
import pytest
from junction_world import DT, Duel, crossing_pairs
from test_plans import STARTS, drive

from shield.conflict_areas import cell_of
from shield.easing import BRAKE, JERK, approach_cap

RATE = 2.0
WAITING = [0, 7, 19]  # pairs of crossing paths


@pytest.mark.parametrize(
    ("room", "cap"),
    [
        (16.8, -2.1880),  # on the curve: v^2 / 5 + v / 2 = 16.8
        (21.8, 0.5390),  # 5 m before it, of which 4 m are kept
        (8.0, -4.0),  # too late: at v^2 / (2 room) it just stops
        (15.0, -2.5),  # a little too late: not harder than comfortable
    ],
)
def test_a_cap_worked_by_hand(room, cap):
    v, dt = 8.0, 0.1
    assert approach_cap(room, room - v * dt, v, 2.5, 0.5, RATE, dt) == pytest.approx(cap, abs=1e-4)


def test_the_cap_is_the_largest_acceleration_that_keeps_the_share():
    rng = np.random.default_rng(0)
    bound = 0
    for _ in range(20000):
        v, v_other, b, settle = rng.uniform(0, 16), rng.uniform(0, 16), rng.uniform(1, 6), rng.uniform(0, 1)
        rate, dt, room = rng.uniform(0.5, 4.0), rng.uniform(1 / 30, 1 / 5), rng.uniform(0.1, 80.0)
        room_next = room + (v_other - v) * dt
        a = approach_cap(room, room_next, v, b, settle, rate, dt)
        if a <= -max(b, v**2 / (2 * room)) + 1e-9 or v + a * dt <= 1e-6:
            continue
        bound += 1
        kept = (1 - rate * dt) * (room - v**2 / (2 * b) - v * settle)
        for change, keeps in ((-1e-6, True), (1e-6, False)):
            speed = v + (a + change) * dt
            assert (room_next - speed**2 / (2 * b) - speed * settle >= kept) == keeps
    assert bound > 5000


def toward(speed, v):
    """What highway-env's drivers ask for."""
    return (speed - v) / 0.6


def approach(pair, rate, frames=110, speed=9.0):
    """Accelerations of an ego that throttles toward a car that may set off at any time; nothing is left but to stop."""
    a, b = pair
    duel = Duel(a, b, 60.0, speed, 93.0, 0.0, rate=rate)
    accelerations, reports = [], []
    for _ in range(frames):
        duel.frame(toward(9.0, duel.v), 0.0)
        accelerations.append(duel.report.acceleration)
        reports.append(duel.report)
    return duel, np.array(accelerations), reports


def stops():
    """Pairs of paths where it has to."""
    return [pair for pair in crossing_pairs() if approach(pair, 0.0)[0].v < 0.5]


def test_an_ego_that_throttles_is_brought_to_rest_comfortably_before_its_line():
    pairs = stops()
    assert len(pairs) >= 3
    for pair in pairs:
        duel, a, reports = approach(pair, RATE)
        jerk = np.abs(np.diff(a)) / DT
        assert a.min() >= -1.3 * BRAKE and np.sqrt(np.mean(jerk**2)) < 6.0
        assert np.percentile(jerk, 95) <= JERK + 1e-6
        paths = duel.roads.paths
        assert not paths.crossed[pair[0], cell_of(duel.s, paths.cells[pair[0]])] and duel.v < 0.2
        _, bare, _ = approach(pair, 0.0)
        assert bare.min() <= -5.0 + 1e-9 and np.sqrt(np.mean((np.diff(bare) / DT) ** 2)) > 12.0
        assert any(report.anticipated for report in reports)
        assert not any(report.overridden or report.broken or report.trapped for report in reports)


def test_without_it_nothing_counts_as_anticipated():
    for pair in crossing_pairs()[::9]:
        _, _, reports = approach(pair, 0.0)
        assert not any(report.anticipated for report in reports)


def test_behind_a_leader_that_goes_on_the_ego_settles_without_braking_hard():
    a = crossing_pairs()[0][0]
    for v_other, s_other in ((3.0, 40.0), (5.0, 30.0), (7.0, 25.0)):
        duel = Duel(a, a, 5.0, 9.0, s_other, v_other, rate=RATE)
        found = []
        for _ in range(90):
            duel.frame(toward(9.0, duel.v), 0.0)
            found.append(duel.report.acceleration)
        if duel.s < 90.0:
            assert min(found) >= -1.4 * BRAKE and abs(duel.v - v_other) < 1.5
            assert float(duel.threats["s"][0]) - duel.s > 5.0


@pytest.mark.parametrize("other", ["any", "throttle"])
def test_nobody_is_in_the_way_on_any_pair_of_crossing_paths(other):
    contacts = broken = trapped = starts = 0
    for n, (a, b) in enumerate(crossing_pairs()):
        rng = np.random.default_rng(1000 + n)
        for s, v in STARTS:
            duel = Duel(a, b, s, v, rng.uniform(50.0, 97.0), rng.uniform(0.0, 9.0), rate=RATE)
            duel.frame(0.0, 0.0)
            if duel.report.trapped or duel.touch():
                continue  # in danger from the start
            starts += 1
            found = drive(duel, rng, other)
            contacts += found[0] > 0
            broken += found[1]
            trapped += duel.report.trapped
    assert starts > 100
    assert (contacts, broken, trapped) == (0, 0, 0)


def test_whoever_is_smooth_without_a_plan_is_hit():
    """Mutation: the acceleration changes as slowly, but nobody asks whether a plan remains."""
    contacts = 0
    for n, (a, b) in enumerate(crossing_pairs()):
        duel, rng, wish, smooth = Duel(a, b, 88.0, 9.0, 80.0, 6.0, rate=RATE), np.random.default_rng(n), 0.0, 0.0
        for t in range(120):
            wish = rng.choice([-6.0, 6.0]) if t % 8 == 0 else wish
            smooth = min(max(wish, smooth - JERK * DT), smooth + JERK * DT)
            before = duel.v
            duel.frame(wish, 6.0)
            duel.v = max(before + smooth * DT, 0.0)
            contacts += duel.touch()
    assert contacts > 0
