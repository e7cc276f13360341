"""Traffic lights: signals over time, the right to pass, and hole H8."""

import numpy as np
import pytest

from rss_shield.shield.definitions.right_of_way import CAN_STOP, Approach, must_brake, non_priority_can_stop
from rss_shield.shield.definitions.signals import (
    GREEN,
    RED,
    YELLOW,
    SignalPlan,
    clearance_time,
    cycle_time,
    keep_right,
    may_pass,
    priority_at,
    signal_at,
)
from rss_shield.shield.params import PRESETS

CAR = PRESETS["slides"].ego  # rho 1 s, braking 4 m/s^2
LIMIT, AREA = 10.0, 20.0
GOES = [[True, False, True], [False, True, True]]
DURATIONS = [[10.0, 3.0, 2.0], [5.0, 2.5, 2.0]]


def plan(goes=GOES, durations=DURATIONS, speed_limit=LIMIT, area_length=AREA, params=CAR):
    return SignalPlan.validated(goes, durations, speed_limit, area_length, params)


@pytest.mark.parametrize(
    ("time", "signals"),
    [
        (0.0, (GREEN, RED, GREEN)),
        (9.99, (GREEN, RED, GREEN)),
        (10.0, (YELLOW, RED, YELLOW)),
        (13.0, (RED, RED, RED)),
        (15.0, (RED, GREEN, GREEN)),
        (20.0, (RED, YELLOW, YELLOW)),
        (24.4, (RED, RED, RED)),
        (24.5, (GREEN, RED, GREEN)),
        (24.5 * 400 + 15.0, (RED, GREEN, GREEN)),
    ],
)
def test_the_cycle_shows_each_group_its_signal(time, signals):
    assert tuple(signal_at(plan(), group, time) for group in range(3)) == signals
    assert tuple(priority_at(plan(), group, time) for group in range(3)) == tuple(float(s == GREEN) for s in signals)


def test_a_cycle_is_the_sum_of_its_parts():
    assert cycle_time(plan()) == 24.5


def test_clearance_by_hand():
    # 10 m/s: 10 m in the response time and 100 / 8 = 12.5 m of braking; 42.5 m in all, at 10 m/s
    assert clearance_time(LIMIT, AREA, CAR) == 4.25
    plan(durations=[[10.0, 2.25, 2.0], [5.0, 4.25, 0.0]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            dict(durations=[[10.0, 2.0, 2.2], [5.0, 3.0, 2.0]]),
            r"yellow \+ all-red of phase 0 = 4.2 s .* at least 4.25 s",
        ),
        (
            dict(durations=[[10.0, 3.0, 2.0], [0.0, 3.0, 2.0]]),
            "green of phase 1 = 0.0 is out of range: expected a finite number > 0",
        ),
        (
            dict(durations=[[10.0, 3.0, 2.0], [5.0, -1.0, 9.0]]),
            "yellow of phase 1 = -1.0 is out of range: expected a finite number >= 0",
        ),
        (dict(durations=[[10.0, 3.0, float("nan")], [5.0, 3.0, 2.0]]), "all-red of phase 0 = nan is out of range"),
        (dict(durations=[[10.0, 3.0, 2.0]]), r"durations has shape \(1, 3\); expected \(2, 3\)"),
        (dict(goes=[True, False]), r"goes has shape \(2,\); expected \[phases, groups\]"),
        (dict(goes=[[True, False], [True, False]]), r"goes\[:, 1\] is never true"),
        (dict(speed_limit=0.0), "speed_limit = 0.0 is out of range: expected a finite number > 0"),
        (dict(area_length=-2.0), "area_length = -2.0 is out of range: expected a finite number >= 0"),
    ],
)
def test_a_bad_plan_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        plan(**change)


def test_after_green_only_a_car_that_cannot_stop_may_pass():
    # 10 m/s needs 22.5 m
    assert may_pass(GREEN, 30.0, 10.0, CAR)
    for signal in (YELLOW, RED):
        assert may_pass(signal, 22.4, 10.0, CAR)
        assert not may_pass(signal, 22.5, 10.0, CAR)
        assert not may_pass(signal, 0.0, 0.0, CAR)


def test_a_right_that_was_lost_comes_back_only_with_green():
    assert keep_right(True, YELLOW, 20.0, 10.0, CAR)
    assert not keep_right(True, YELLOW, 25.0, 10.0, CAR)
    assert not keep_right(False, RED, 5.0, 10.0, CAR)  # drove on, and can no longer stop
    assert keep_right(False, GREEN, 5.0, 10.0, CAR)


def drive_through_yellow(distance, v, dt=1 / 15):
    """A car at constant speed meets yellow `distance` before the line; one without the right to pass brakes.

    Returns: (where its front comes to rest or None, when its rear has left the area or None).
    """
    right, tau = True, 0.0
    while True:
        right = keep_right(right, YELLOW, distance, v, CAR)
        if right and distance <= -AREA:
            return None, tau
        distance -= v * dt
        tau += dt
        if not right and tau > CAR.response_time:
            v = max(v - CAR.a_min_brake * dt, 0.0)
        if v == 0.0:
            return distance, None


@pytest.mark.parametrize("distance", np.linspace(0.5, 40.0, 80))
def test_at_the_limit_every_car_stops_at_the_line_or_has_cleared_before_the_next_green(distance):
    rest, cleared = drive_through_yellow(distance, LIMIT)
    if rest is None:
        assert cleared <= clearance_time(LIMIT, AREA, CAR) + 1 / 15
    else:
        assert rest >= -(LIMIT + CAR.a_min_brake / 15) / 15  # what a frame adds


def test_a_crawling_car_outlasts_the_clearance_time_so_the_right_must_be_remembered():
    # 2 m/s: 2.5 m to stop, and 22 m take 11 s; the plan is made for the limit
    _, cleared = drive_through_yellow(2.0, 2.0)
    assert cleared > 2 * clearance_time(LIMIT, AREA, CAR)
    assert keep_right(True, RED, -10.0, 2.0, CAR)


def test_between_a_car_that_keeps_its_right_and_a_newcomer_on_green_nobody_has_priority():
    kept = float(keep_right(True, RED, -10.0, 2.0, CAR))
    inside, newcomer = Approach(-5.0, 20.0, 5.0, 2.0, kept), Approach(60.0, 85.0, 5.0, 10.0, 1.0)
    # the one inside cannot stop before the area any more: item 1 does not hold, and if it had, both would owe braking
    assert not non_priority_can_stop(inside, newcomer, CAR, CAR)
    assert must_brake(CAN_STOP, newcomer.priority > inside.priority, -1.0)
    # by the light alone the newcomer would have priority and need not brake
    assert not must_brake(CAN_STOP, newcomer.priority > 0.0, -1.0)
