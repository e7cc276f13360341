"""Filters of the literature, with numbers by hand."""

import numpy as np
import pytest

from rss_shield.shield.command import Command
from rss_shield.shield.filters import control_barrier, fixed_distance, time_to_collision
from rss_shield.shield.filters.answer import (
    CBF,
    DISTANCE,
    FILTERS,
    LIMITS,
    PRINTED_DEF_10,
    THRESHOLDS,
    TTC,
    Filter,
    Traffic,
    answer,
)
from rss_shield.shield.filters.leader import Leader, leader_of
from rss_shield.shield.filters.once_per_decision import is_dangerous
from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.params import PRESETS, Rules, Table

DT = 0.2
CAR = PRESETS["simulator"].ego._replace(response_time=0.2)  # accelerates at 3, brakes at 5 to 6 m/s^2
OTHER = PRESETS["simulator"].other
RULES = Rules(take_back=False, anticipation=0.0)
TABLE = Table(CAR, OTHER, RULES, DT)
BODY = Body(2.5, 0.5, 0.0)


def cars(*fields):
    """Road users of 5 m x 2 m in the lane of the ego, which is at 0."""
    users = np.zeros(len(fields), ROAD_USER)
    users["half_length"], users["half_width"], users["cos"], users["in_own_lane"] = 2.5, 1.0, 1.0, True
    users["around"] = np.inf
    for user, values in zip(users, fields, strict=True):
        for name, value in values.items():
            user[name] = value
    return users


def filtered(kind, ego, users, wish, answers=False, begins=True, offset=0.0, threshold=None):
    memory = np.zeros(len(users), MEMORY)
    danger = find_danger(ego, users, ego, users, memory, TABLE)
    chosen = Filter(kind, THRESHOLDS.get(kind, 0.0) if threshold is None else threshold)
    traffic = Traffic(ego, users, memory, offset, None)
    return answer(chosen, wish, traffic, danger.free, answers, begins, BODY, TABLE)


# ---------------------------------------------------------------- the leader


def test_the_leader_is_the_nearest_ahead_in_the_own_lane_or_in_the_one_aimed_for():
    (ego,) = cars({"s": 100.0, "speed": 20.0})
    users = cars(
        {"s": 160.0, "speed": 21.0},  # ahead, 60 - 5 = 55 m
        {"s": 130.0, "y": -4.0, "speed": 22.0},  # on the left, 25 m
        {"s": 90.0, "speed": 23.0},  # behind
        {"s": 120.0, "y": 4.0, "speed": 24.0},  # on the right, 15 m
    )
    assert leader_of(ego, users, 0.0) == Leader(55.0, 21.0)
    # the middle of the left lane is 4 m to the left, so the ego is 4 m to the right of it
    assert leader_of(ego, users, 4.0) == Leader(25.0, 22.0)
    assert leader_of(ego, users, 0.0, np.array([2])) == Leader(np.inf, np.inf)


def test_a_leader_that_comes_the_other_way_drives_at_a_negative_speed():
    (ego,) = cars({"speed": 20.0})
    assert leader_of(ego, cars({"s": 50.0, "speed": 10.0, "cos": -1.0}), 0.0) == Leader(45.0, -10.0)


# ---------------------------------------------------------------- the rules


@pytest.mark.parametrize(
    ("gap", "speed", "cap"),
    [
        (14.0, 10.0, -5.0),  # 14 m / (20 - 10) m/s = 1.4 s
        (16.0, 10.0, np.inf),  # 1.6 s
        (1.0, 20.0, np.inf),  # does not close
        (59.0, -20.0, -5.0),  # 59 / 40 = 1.475 s
        (-1.0, 19.0, -5.0),  # alongside
        (np.inf, np.inf, np.inf),
    ],
)
def test_time_to_collision_brakes_below_one_and_a_half_seconds(gap, speed, cap):
    assert time_to_collision.acceleration_cap(20.0, Leader(gap, speed), 1.5, CAR) == cap


def test_the_fixed_distance_brakes_below_45_metres_whatever_the_speeds():
    assert fixed_distance.acceleration_cap(Leader(44.9, 40.0), 45.0, CAR) == -5.0
    assert fixed_distance.acceleration_cap(Leader(45.0, 0.0), 45.0, CAR) == np.inf


@pytest.mark.parametrize(
    ("gap", "speed", "cap"),
    [
        (40.0, 15.0, -1.0 / 1.8),  # h = 40 - 1.8 * 20 = 4; (15 - 20 + 4) / 1.8
        (36.0, 20.0, 0.0),  # on the barrier at equal speeds
        (54.0, 20.0, 10.0),  # h = 18
        (10.0, 10.0, -6.0),  # (10 - 20 - 26) / 1.8 = -20: as hard as it can
        (np.inf, np.inf, np.inf),
    ],
)
def test_the_barrier_caps_the_acceleration(gap, speed, cap):
    assert control_barrier.acceleration_cap(20.0, Leader(gap, speed), 1.8, CAR) == pytest.approx(cap)


def test_a_barrier_that_is_kept_shrinks_no_faster_than_its_rate():
    v, gap, dt = 25.0, 60.0, 0.01
    barrier = gap - 1.8 * v
    for _ in range(500):
        a = min(3.0, control_barrier.acceleration_cap(v, Leader(gap, 20.0), 1.8, CAR))
        gap, v = gap + (20.0 - v) * dt, v + a * dt
        after = gap - 1.8 * v
        assert after >= (1.0 - dt) * barrier - 1e-9
        barrier = after
    assert barrier > 0.0


# ---------------------------------------------------------------- what they make of a command


@pytest.mark.parametrize("kind", [TTC, DISTANCE, CBF])
def test_a_rule_changes_the_acceleration_only_and_only_downwards(kind):
    (ego,) = cars({"speed": 20.0})
    users = cars({"s": 15.0, "speed": 10.0})  # a gap of 10 m
    response, _ = filtered(kind, ego, users, Command(2.0, 0.03))
    assert response.command == Command(-6.0 if kind == CBF else -5.0, 0.03)
    assert response.overridden
    harder = Command(-8.0, 0.03)
    assert filtered(kind, ego, users, harder)[0] == (harder, False, False, False)
    assert not filtered(kind, ego, cars({"s": 200.0, "speed": 20.0}), Command(2.0, 0.03))[0].overridden


def test_nobody_is_braked_into_reverse():
    (ego,) = cars({"speed": 0.5})
    response, _ = filtered(DISTANCE, ego, cars({"s": 10.0}), Command(1.0, 0.0))
    assert response.command.acceleration == pytest.approx(-0.5 / DT)
    (ego,) = cars({"speed": 0.0})
    assert filtered(DISTANCE, ego, cars({"s": 10.0}), Command(1.0, 0.0))[0].command.acceleration == 0.0


def test_a_threshold_may_be_set():
    (ego,) = cars({"speed": 20.0})
    users = cars({"s": 35.0, "speed": 10.0})  # 30 m, 3 s
    assert not filtered(TTC, ego, users, Command(1.0, 0.0))[0].overridden
    assert filtered(TTC, ego, users, Command(1.0, 0.0), threshold=4.0)[0].overridden


def test_the_limits_alone_know_nobody():
    (ego,) = cars({"speed": 20.0})
    response, _ = filtered(LIMITS, ego, cars({"s": 6.0}), Command(16.0, 0.0))
    assert response.command == Command(always_on(ego, CAR, RULES, DT).a_upper, 0.0) == Command(3.0, 0.0)
    assert (response.overridden, response.limited) == (False, True)


# at 20 m/s behind 20 m/s: 20 * 0.2 + 3 * 0.2^2 / 2 + 20.6^2 / 10 - 20^2 / 12 + 1 m left when both stand
PRINTED = 4.0 + 0.06 + 42.436 - 400.0 / 12.0 + 1.0


@pytest.mark.parametrize(("more", "dangerous"), [(-0.01, True), (0.01, False)])
def test_printed_distances_have_no_margins(more, dangerous):
    (ego,) = cars({"speed": 20.0})
    users = cars({"s": PRINTED + 5.0 + more, "speed": 20.0})
    assert is_dangerous(ego, users, TABLE) == dangerous
    response, answers = filtered(PRINTED_DEF_10, ego, users, Command(2.0, 0.0))
    assert answers == response.overridden == dangerous
    assert response.command.acceleration == (-5.0 if dangerous else 2.0)


def test_def_10_once_per_decision_looks_at_the_first_frame_only():
    (ego,) = cars({"speed": 20.0})
    near, far = (cars({"s": PRINTED + 5.0 + more, "speed": 20.0}) for more in (-1.0, 30.0))
    # danger that begins later is not answered ...
    assert filtered(PRINTED_DEF_10, ego, near, Command(2.0, 0.0), answers=False, begins=False)[0].command == (2.0, 0.0)
    # ... and an answer ends as soon as nobody is in danger, as Def. 10 says
    response, answers = filtered(PRINTED_DEF_10, ego, far, Command(2.0, 0.0), answers=True, begins=False)
    assert (response.command.acceleration, answers) == (2.0, True)


def test_every_filter_has_a_name():
    assert [FILTERS[kind] for kind in (TTC, DISTANCE, CBF, LIMITS, PRINTED_DEF_10)] == [
        "ttc",
        "distance-45m",
        "cbf",
        "limits",
        "literal-def10",
    ]
