"""Anticipation for plans: the ego eases off before it has to brake, and every acceleration still leaves a plan."""

import numpy as np
import pytest
from junction_world import DT, EGO, Duel, crossing_pairs

from rss_shield import make
from rss_shield.shield.junctions.easing import approach_cap, caps
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import NEVER, SLACK, go_plan, plan_conflict, stop_conflict, throttle
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE
from rss_shield.shield.params import Rules

RATE = Rules().anticipation
WISHES = (-6.0, 0.0, 6.0)


def duels(count, rate):
    """Random duels on pairs of crossing paths, none of them a lost cause from the start."""
    pairs, rng = crossing_pairs(), np.random.default_rng(7)
    for _ in range(count):
        a, b = pairs[rng.integers(len(pairs))]
        duel = Duel(a, b, rng.uniform(60, 99), rng.uniform(0, 9), rng.uniform(40, 99), rng.uniform(0, 9))
        duel.rate = rate
        duel.frame(0.0, 0.0)
        if not duel.report.trapped and not duel.touch():
            yield duel, rng


def leaves_plan(scene, a):
    """Is there a plan after an acceleration, by the checks that everybody goes by?"""
    return stop_conflict(scene, a, -1, True, SLACK) == NEVER or go_plan(scene, a, -1, True, SLACK)[0] >= 0


def in_force(scene, go):
    """What the plan in force does on this frame; None if somebody has broken it [m/s^2]."""
    if go < 0 or plan_conflict(scene, go, -1, 0.0) != NEVER:
        return None
    return throttle(scene, scene.track.s, scene.track.v) if go > 0 else limit(-EGO.a_min_brake, scene.track.v, EGO, DT)


def frames(rate, count=60, length=120):
    """Frames of random duels: the scene, what was asked for, the plan in force before, and the report."""
    for duel, rng in duels(count, rate):
        wish = a_other = 0.0
        for t in range(length):
            if t % 8 == 0:
                wish, a_other = rng.choice(WISHES), rng.choice(WISHES)
            go = int(duel.plan["go"][0])
            duel.decide(wish)
            assert not duel.report.trapped
            yield duel.scene(), limit(wish, duel.v, EGO, DT), go, duel.report
            duel.move(duel.report.acceleration, a_other)
            assert not duel.touch()


def test_switched_off_the_ego_does_what_it_likes_until_only_the_plan_in_force_is_left():
    overridden = 0
    for scene, wish, go, report in frames(0.0):
        expected = wish if leaves_plan(scene, wish) else in_force(scene, go)
        assert report.acceleration == expected and not report.anticipated
        overridden += report.overridden
    assert overridden > 100


def test_every_acceleration_leaves_a_plan_or_is_that_of_the_plan_in_force():
    anticipated = between = 0
    for scene, wish, go, report in frames(RATE):
        a = report.acceleration
        assert leaves_plan(scene, a) or a == in_force(scene, go)
        assert report.anticipated <= leaves_plan(scene, wish), "it was no anticipation"
        assert report.overridden <= (not leaves_plan(scene, wish)), "it was no duty"
        assert not (report.anticipated and report.overridden)
        anticipated += report.anticipated
        between += report.overridden and -EGO.a_min_brake < a < min(wish, 0.0)
    assert anticipated > 100 and between > 10


def test_whoever_skips_the_check_leaves_no_plan():
    """Mutation: a plan to go on is believed, and the smooth acceleration carried out, unchecked."""
    without = contacts = 0
    for duel, _ in duels(60, RATE):
        for _ in range(120):
            duel.decide(6.0)
            scene = duel.scene()
            a = limit(min(6.0, caps(scene, duel.memory, True, RATE).behind), duel.v, EGO, DT)
            without += not leaves_plan(scene, a)
            duel.move(a, 6.0)
            contacts += duel.touch()
    assert without > 100 and contacts > 0


def approach(rate):
    """Accelerations of an ego that always wants more, toward a line where somebody waits that may set off."""
    a, b = crossing_pairs()[0]
    duel = Duel(a, b, 60.0, 8.0, 95.0, 0.0)
    duel.rate = rate
    found = []
    for _ in range(120):
        duel.frame(6.0, 0.0)
        found.append(duel.report.acceleration)
    return np.array(found), duel


def jerk(accelerations):
    return np.sqrt(np.mean((np.diff(accelerations) / DT) ** 2))


def test_the_approach_to_a_line_is_steady():
    """Full throttle, braking, rest: each begins once."""
    smooth, duel = approach(RATE)
    rough, before = approach(0.0)
    assert duel.v < 0.05 and duel.s > before.s - 0.3
    assert jerk(smooth) < min(12.0, jerk(rough) / 2)
    rises = np.diff(smooth)[(smooth[:-1] < -0.5) & (smooth[1:] > 0.5)]
    assert len(rises) == 0
    assert np.all(smooth >= -EGO.a_min_brake)


def test_an_ego_that_was_held_back_pulls_away_within_its_rise():
    _, duel = approach(RATE)
    assert duel.report.response in (0, RESPONSE_BRAKE)
    duel.threats["s"] = 140.0  # it has gone by
    changes = [duel.report.acceleration]
    for _ in range(4):
        duel.frame(6.0, 0.0)
        changes.append(duel.report.acceleration)
    assert np.all(np.diff(changes) <= 4.0 + 1e-9) and changes[-1] > 5.0


@pytest.mark.parametrize("v", [1.0, 5.0, 9.0])
def test_the_cap_never_lets_the_ego_come_too_far(v):
    """Braking at 5 m/s^2 from v takes v^2 / 10, and v dt / 2 more in steps of dt."""
    s, room = 0.0, v**2 / 10 + 0.08 * v + 1.0
    while v > 1e-3:
        a = approach_cap(room - s, room - s - v * DT, v, 5.0, 10.0, DT)
        assert a >= -5.0
        s, v = s + v * DT, max(v + min(a, 3.0) * DT, 0.0)
    assert room - 0.2 < s <= room


@pytest.mark.parametrize("rate", [0.0, RATE])
def test_infos_tell_duties_from_anticipation(rate):
    env = make("intersection-v0", shield="override", rules=Rules(anticipation=rate))
    anticipated = overridden = 0.0
    for seed in range(3):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(2)
            shield = info["shield"]
            shares = [shield[f"{name}_fraction"] for name in ("override", "anticipation", "limited")]
            assert sum(shares) <= 1.0 + 1e-9
            overridden, anticipated = overridden + shares[0], anticipated + shares[1]
            done = terminated or truncated
    assert overridden > 0.0 and (anticipated > 0.0) == (rate > 0.0)
