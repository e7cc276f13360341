"""A log without lanes does not say which way its road runs: who drives straight decides, and doubt shows."""

import numpy as np
import pytest

from rss_shield.eval.suite.judge.directions import directions
from rss_shield.eval.suite.judge.findings import text_of
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.trace import Trace, straight_lane, users_of

DT = 0.1
STRAIGHT = (0.0, 0.0)  # (speed across the road [m/s], from when on [s])


def log(cars, seconds):
    """Cars of 4.5 m by 1.8 m: (x, y, speed along the road, (speed across it, from when on)), motions exact."""
    time = np.arange(round(seconds / DT) + 1) * DT
    x, y, heading, speed = (np.zeros((len(time), len(cars))) for _ in range(4))
    for i, (x0, y0, along, (across, start)) in enumerate(cars):
        sideways = np.where(time >= start - 1e-9, across, 0.0)
        x[:, i] = x0 + along * time
        y[:, i] = y0 + across * np.clip(time - start, 0.0, None)
        heading[:, i] = np.arctan2(sideways, along)
        speed[:, i] = np.hypot(along, sideways)
    return Trace(DT, time, users_of(map(str, range(len(cars))), ["car"] * len(cars), 4.5, 1.8, x, y, heading, speed))


def looked_at(trace, angle=0.0, mirror=False, order=None, shift=(0.0, 0.0), later=0.0):
    """The same log from elsewhere."""
    u, side = trace.users, -1.0 if mirror else 1.0
    order = list(range(len(u.ids))) if order is None else order
    cos, sin, y = np.cos(angle), np.sin(angle), side * u.y
    poses = u.x * cos - y * sin + shift[0], u.x * sin + y * cos + shift[1], side * u.heading + angle, u.speed
    users = users_of([u.ids[i] for i in order], ["car"] * len(order), 4.5, 1.8, *(one[:, order] for one in poses))
    return trace.replaced(users=users, time=trace.time + later)


def blames(trace):
    """By names: who touched, whose fault it was, and whether that is sure."""
    ids, found = trace.users.ids, judge_trace(trace).blames
    return {(frozenset(ids[i] for i in b.users), frozenset(ids[i] for i in b.at_fault), b.is_sure) for b in found}


SWERVE = [(0.0, 0.0, 10.0, STRAIGHT), (-1.0, 3.5, 10.0, (-0.9, 1.0))]  # touches after 2.9 s
LONG_SWERVE = [(0.0, 0.0, 10.0, STRAIGHT), (-1.0, 7.0, 10.0, (-0.9, 1.0))]  # touches after 6.8 s
OTHERS = [(200.0 + 100.0 * k, 0.0, 10.0, STRAIGHT) for k in range(4)]


@pytest.mark.parametrize(
    ("cars", "seconds", "sure"),
    [
        (SWERVE, 3.7, True),
        (SWERVE + OTHERS, 3.7, True),
        (LONG_SWERVE, 8.7, False),  # it swerves for 77 of 88 samples, which is 44 % of all
        (LONG_SWERVE + OTHERS, 8.7, True),
    ],
    ids=["two cars", "and others", "one swerves nearly all the time", "and others who drive straight"],
)
@pytest.mark.parametrize("v", [1.0, 2.0])
def test_who_drives_straight_is_not_charged_with_the_swerve_of_another(cars, seconds, sure, v):
    cars = [(x, y, along * v, across) for x, y, along, across in cars]
    ((_, at_fault, is_sure),) = blames(log(cars, seconds))
    assert (at_fault, is_sure) == ({"1"}, sure)


ASLANT = [(0.0, 0.0, 10.0, STRAIGHT), (-1.0, 6.0, 10.0, (-0.9, 0.0))]  # touches after 4.7 s


def test_which_of_two_drives_aslant_all_the_time_is_not_sure():
    """Turned, the log is the same with the cars in each other's places."""
    trace = log(ASLANT, 6.0)
    _, *others = directions(trace)
    assert len(others) == 2
    ((_, _, is_sure),) = blames(trace)
    assert not is_sure
    known = trace.replaced(lanes=(straight_lane("road", (-500.0, 0.0), (500.0, 0.0), 12.0),))
    assert blames(known) == {(frozenset("01"), frozenset("1"), True)}


def test_what_does_not_depend_on_the_direction_stays_sure():
    """A car runs into one that stands ahead of it; a third drives aslant beside them, as far as the first."""
    trace = log([(0.0, 0.0, 20.0, STRAIGHT), (60.0, 0.0, 0.0, STRAIGHT), (0.0, 40.0, 20.0, (1.0, 0.0))], 4.0)
    assert len(directions(trace)) > 1
    assert blames(trace) == {(frozenset("01"), frozenset("0"), True)}


def test_opposite_traffic_is_on_the_same_road():
    cars = [(0.0, 0.0, 10.0, STRAIGHT), (100.0, -4.0, -10.0, STRAIGHT), (200.0, -4.0, -12.0, (0.6, 1.0))]
    (only,) = directions(log(cars, 4.0))
    assert np.sin(only) == pytest.approx(0.0, abs=1e-9) and np.cos(only) < 0.0  # most drive along it the other way


def test_a_crowd_in_which_everybody_changes_lanes_once_drives_along_the_road():
    time = np.arange(0.0, 12.0, DT)
    start = np.linspace(1.0, 8.0, 15)
    across = np.where((time[:, None] >= start) & (time[:, None] < start + 4.0), 0.9, 0.0)
    along = np.full_like(across, 20.0)
    x, y = np.cumsum(along * DT, axis=0) + 40.0 * np.arange(15), np.cumsum(across * DT, axis=0)
    users = users_of(range(15), ["car"] * 15, 4.5, 1.8, x, y, np.arctan2(across, along), np.hypot(across, along))
    assert directions(Trace(DT, time, users)) == pytest.approx((0.0,), abs=1e-9)


def test_whoever_stands_has_no_say_wherever_it_points():
    trace = log([(0.0, 0.0, 10.0, STRAIGHT), (30.0, 5.0, 0.0, STRAIGHT), (40.0, 5.0, 0.0, STRAIGHT)], 3.0)
    trace.users.heading[:, 1:] = 1.0
    assert directions(trace) == pytest.approx((0.0,), abs=1e-9)


def test_a_fast_car_has_no_more_say_than_a_slow_one():
    slow, fast = (0.0, 0.0, 8.0, STRAIGHT), (-40.0, 5.0, 24.0, (-1.0, 0.0))
    assert len(directions(log([slow, fast], 4.0))) == 3


@pytest.mark.parametrize(
    "change",
    [
        {"mirror": True},
        {"angle": 0.65},
        {"angle": np.pi / 2},
        {"angle": np.pi, "mirror": True},
        {"shift": (5e4, -3e4), "later": 1e4},
        {"order": "reversed"},
    ],
    ids=str,
)
@pytest.mark.parametrize(
    ("cars", "seconds"),
    [
        (SWERVE, 3.7),
        (LONG_SWERVE + OTHERS, 8.7),
        (ASLANT, 6.0),
        ([(0.0, 0.0, 10.0, (0.45, 0.0)), (0.0, 4.0, 10.0, (-0.45, 0.0))], 4.0),
        ([(0.0, 0.0, 10.0, STRAIGHT), (30.0, 0.0, 0.0, STRAIGHT)], 4.0),
    ],
    ids=["swerve", "among others", "aslant", "toward each other", "one stands"],
)
def test_it_does_not_matter_from_where_a_log_without_lanes_is_looked_at(cars, seconds, change):
    trace = log(cars, seconds)
    change = dict(change)
    if "order" in change:
        change["order"] = list(range(len(cars)))[::-1]
    assert blames(looked_at(trace, **change)) == blames(trace) != set()


def test_a_note_says_that_the_direction_is_estimated_and_how_to_give_lanes():
    said = text_of(judge_trace(log(LONG_SWERVE, 8.7)))
    assert "direction is estimated from headings, within 5.1 degrees" in said and "--lanes" in said
    assert "at fault: 1; 1 moved toward" in said and said.rstrip().endswith("(not sure)")
    assert "estimated from headings;" in text_of(judge_trace(log(LONG_SWERVE + OTHERS, 8.7)))
