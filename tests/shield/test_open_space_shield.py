"""The shield in open space against the worst that others may do, and the judge."""

import math

import numpy as np
import pytest
from open_space_duel import DT, TABLE, Shielded, Worst, duel, start

from rss_shield.shield.definitions.unstructured import BOTH_BRAKE, DANGEROUS, FIRST_BRAKES, SECOND_BRAKES
from rss_shield.shield.open_space.controller import WORK, Intended, open_space_frame
from rss_shield.shield.open_space.frames import CAR, FIXED, LOT, PEDESTRIAN, USER
from rss_shield.shield.open_space.judge import judge_motion, judge_touch
from rss_shield.shield.open_space.pair import GIVES_WAY, HAS_WAY, NEITHER, PAIR, remember, role_of
from rss_shield.shield.verdicts import (
    AT_FAULT,
    EGO,
    INHERITED,
    KEPT,
    NOBODY,
    OTHER,
    STEERED,
    TOO_WEAK,
    VERDICTS,
    WALKED_IN,
)

EPISODES = 24


def compliant(rng):
    return Worst(TABLE.other, rng)


def test_against_the_worst_that_def_22_permits_nobody_is_touched():
    rng = np.random.default_rng(1)
    ended = [duel(rng, compliant) for _ in range(EPISODES)]
    assert not any(one.touched for one in ended)
    assert sum(one.broken for one in ended) == 0
    # they do meet, and the shielded car is no coward
    assert np.mean([one.dangerous for one in ended]) > 20
    assert np.mean([one.moved for one in ended]) > 4.0


def test_two_shielded_cars_that_are_out_for_a_collision_have_none():
    rng = np.random.default_rng(2)
    ended = [duel(rng, Shielded) for _ in range(EPISODES)]
    assert not any(one.touched for one in ended)
    assert sum(one.broken for one in ended) == 0
    assert np.mean([one.moved for one in ended]) > 4.0


WORSE = {
    "responds later": TABLE.other._replace(response_time=1.2),
    "brakes less": TABLE.other._replace(a_min_brake=0.8),
    "accelerates harder": TABLE.other._replace(a_max_accel=10.0, v_cap=12.0),
}


@pytest.mark.parametrize("name", WORSE)
def test_who_does_what_nobody_may_is_to_blame_for_what_happens(name):
    rng = np.random.default_rng(3)
    ended = [duel(rng, lambda rng: Worst(WORSE[name], rng)) for _ in range(EPISODES)]
    verdicts = [VERDICTS[one.verdict] for one in ended if one.touched]
    assert len(verdicts) > 2  # else the margins would be so wide that nothing can happen
    assert set(verdicts) == {"other"}


def test_without_the_shield_the_car_itself_is_to_blame():
    rng = np.random.default_rng(4)
    ended = [duel(rng, compliant, overrides=False) for _ in range(EPISODES)]
    touched = [one for one in ended if one.touched]
    assert len(touched) > EPISODES // 3
    at_fault = [VERDICTS[one.verdict] in AT_FAULT for one in touched]
    assert np.mean(at_fault) == 1.0


MUTANTS = {
    "believes that others respond at once": TABLE._replace(other=TABLE.other._replace(response_time=DT)),
    "believes that it brakes harder": TABLE._replace(other=TABLE.other._replace(a_min_brake=4.9)),
}


def test_a_shield_with_a_wrong_table_fails():
    # judged by the wrong table it is nobody's fault; what counts is that cars touch that else never do
    rng = np.random.default_rng(5)
    table = MUTANTS["believes that others respond at once"]
    ended = [duel(rng, lambda rng: Worst(WORSE["responds later"], rng), table=table) for _ in range(EPISODES)]
    right = np.random.default_rng(5)
    kept = [duel(right, compliant) for _ in range(EPISODES)]
    assert sum(one.touched for one in ended) > 5 > sum(one.touched for one in kept)


# ---------------------------------------------------------------- the way out


def alone(ego, *others, wish=(2.5, 0.0), frames=120):
    """`[T, 4]` where the ego gets to, on and on with one wish, among others that stay as they are."""
    now = np.array([*others, ego], USER)
    memory, work, slip, track = np.zeros(len(others), PAIR), np.zeros(WORK), 0.0, []
    before = now.copy()
    for _ in range(frames):
        report = open_space_frame(now.copy(), before, memory, Intended(*wish, slip), TABLE, LOT, True, work)
        before, slip = now.copy(), report.slip
        me = now[-1]
        v = me["speed"]
        me["x"] += v * math.cos(me["heading"] + slip) * DT
        me["y"] += v * math.sin(me["heading"] + slip) * DT
        me["heading"] += v * math.sin(slip) / me["half_length"] * DT
        me["speed"] = 0.0 if abs(v + report.acceleration * DT) < 1e-9 else v + report.acceleration * DT
        track.append((float(me["x"]), float(me["y"]), float(me["heading"]), float(me["speed"])))
    return np.array(track)


def user(x, y=0.0, heading=0.0, speed=0.0, kind=CAR, length=5.0, width=2.0):
    record = np.zeros(1, USER)
    record["x"], record["y"], record["heading"], record["speed"] = x, y, heading, speed
    record["half_length"], record["half_width"], record["kind"] = length / 2, width / 2, kind
    return record[0]


@pytest.mark.parametrize("gear", [1.0, -1.0])
def test_it_drives_up_to_a_wall_and_stops_at_the_clearance(gear):
    track = alone(user(0.0), user(gear * 20.0, kind=FIXED, length=1.0, width=30.0), wish=(gear * 5.0, 0.0))
    gap = 20.0 - 0.5 - 2.5 - abs(track[:, 0])
    assert np.abs(track[:, 3]).max() == pytest.approx(5.0)
    assert LOT.clearance <= gap[-1] < LOT.clearance + 0.1
    assert track[-1, 3] == 0.0


def test_it_passes_parked_cars_close_by_and_does_not_turn_into_them():
    row = [user(x, 2.5, kind=FIXED) for x in (6.0, 12.0, 18.0)]
    assert alone(user(0.0), *row)[-1, 0] > 25.0  # 0.5 m to the side
    turning = alone(user(0.0), *row, wish=(2.5, 0.3))
    assert turning[:, 1].max() < 2.0 and turning[-1, 3] == 0.0


def test_it_stops_before_a_pedestrian_could_be_in_its_way_and_stands_until_it_is_gone():
    walker = user(9.0, 1.5, kind=PEDESTRIAN, length=0.6, width=0.6)
    track = alone(user(0.0), walker)
    assert track[-1, 3] == 0.0 and track[-1, 0] + 2.5 < 9.0


# ---------------------------------------------------------------- memory


def test_both_of_two_shields_remember_the_same_of_who_goes_first():
    rng = np.random.default_rng(6)
    seen = set()
    for _ in range(300):
        one, two = start(rng, rng.uniform(5.5, 9.0))
        one["speed"], two["speed"] = rng.choice([0.0, 2.0], 2)
        mine, yours = np.zeros(1, PAIR)[0], np.zeros(1, PAIR)[0]
        one["first"] = two["first"] = False
        for distance in (rng.choice([FIRST_BRAKES, SECOND_BRAKES, BOTH_BRAKE]), DANGEROUS, DANGEROUS):
            you, me = one.copy(), two.copy()
            you["first"] = True
            remember(mine, distance, me, you, LOT, DT)  # the second one's
            you, me = two.copy(), one.copy()
            remember(yours, distance, me, you, LOT, DT)  # the first one's
        assert mine["last"] == yours["last"]
        roles = role_of(mine["last"], False), role_of(yours["last"], True)
        assert roles in ((GIVES_WAY, HAS_WAY), (HAS_WAY, GIVES_WAY), (NEITHER, NEITHER))
        seen.add(roles)
    assert len(seen) == 3


def test_who_may_drive_away_and_does_not_lets_the_other_one():
    one, two, memory = user(0.0), user(5.5), np.zeros(1, PAIR)[0]
    two["first"] = True
    turns = []
    for _ in range(100):
        remember(memory, DANGEROUS, one, two, LOT, DT)
        turns.append(int(memory["last"]))
    changes = np.flatnonzero(np.diff(turns))
    assert len(changes) == 3  # every 2 s and a frame
    assert set(np.diff(changes)) == {31}


def test_a_safe_distance_wipes_out_what_was():
    one, two, memory = user(0.0), user(5.5), np.zeros(1, PAIR)[0]
    remember(memory, DANGEROUS, one, two, LOT, DT)
    assert memory["never"] and memory["since"] == 1
    memory["ego_broke"] = TOO_WEAK
    remember(memory, BOTH_BRAKE, one, two, LOT, DT)
    assert not memory["never"] and memory["since"] == 0 and memory["ego_broke"] == KEPT


# ---------------------------------------------------------------- the judge


def judge(ego_before, ego, other_before, other, since=30, last=BOTH_BRAKE, slip=0.0, never=False):
    memory = np.zeros(1, PAIR)[0]
    memory["age"], memory["since"], memory["last"], memory["never"] = since + 1, since, last, never
    memory["ego_slip"] = memory["other_slip"] = slip
    judge_motion(ego_before, other_before, ego, other, memory, TABLE, LOT, np.zeros(WORK))
    return memory


def after(before, acceleration, slip=0.0):
    moved = before.copy()
    v = before["speed"]
    moved["x"] += v * math.cos(before["heading"] + slip) * DT
    moved["y"] += v * math.sin(before["heading"] + slip) * DT
    moved["heading"] += v * math.sin(slip) / 2.5 * DT
    moved["speed"] = v + acceleration * DT
    return moved


def test_in_danger_who_does_not_brake_after_its_response_time_breaks_its_duty():
    ego, wall = user(0.0, speed=4.0), user(5.0, kind=FIXED, length=1.0, width=9.0)
    memory = judge(ego, after(ego, 0.0), wall, wall)
    assert memory["ego_broke"] == TOO_WEAK and memory["ego_excess"] == pytest.approx(4.0)
    assert judge(ego, after(ego, -1.0), wall, wall)["ego_excess"] == pytest.approx(3.0)
    assert judge(ego, after(ego, -4.0), wall, wall)["ego_broke"] == KEPT
    assert judge(ego, after(ego, 0.0), wall, wall, since=3)["ego_broke"] == KEPT  # response time: 6 frames


def test_who_has_to_brake_keeps_its_wheels_where_they_are():
    ego, wall = user(0.0, speed=4.0), user(5.0, kind=FIXED, length=1.0, width=9.0)
    assert judge(ego, after(ego, -4.0, 0.2), wall, wall, slip=0.2)["ego_broke"] == KEPT
    memory = judge(ego, after(ego, -4.0, 0.2), wall, wall, slip=0.0)
    assert memory["ego_broke"] == STEERED and memory["ego_excess"] == pytest.approx(0.2)


def test_who_can_still_stop_clear_of_all_that_the_other_may_do_need_not_brake():
    ego, wall = user(0.0, speed=1.0), user(7.0, kind=FIXED, length=1.0, width=9.0)
    assert judge(ego, after(ego, 2.5), wall, wall)["ego_broke"] == KEPT


def test_the_other_is_judged_by_the_same_rule():
    # it drives toward a standing ego and does not brake
    ego, other = user(0.0), user(7.0, heading=np.pi, speed=4.0)
    memory = judge(ego, ego, other, after(other, 0.0))
    assert memory["other_broke"] == TOO_WEAK and memory["ego_broke"] == KEPT
    assert judge_touch(ego, other, memory).verdict == OTHER
    assert judge(ego, ego, other, after(other, -4.0))["other_broke"] == KEPT
    # the ego may go on where the other has to brake
    moving = user(0.0, speed=1.0)
    both = judge(moving, after(moving, 0.0), other, after(other, 0.0), last=SECOND_BRAKES)
    assert both["other_broke"] == TOO_WEAK and both["ego_broke"] == KEPT


def test_a_pedestrian_who_walks_into_a_car_that_stands_has_done_so():
    ego, walker = user(0.0), user(3.2, kind=PEDESTRIAN, speed=1.2, length=0.6, width=0.6)
    memory = judge(ego, ego, walker, walker)
    assert judge_touch(ego, walker, memory).verdict == OTHER and memory["other_broke"] == WALKED_IN
    rolling = user(0.0, speed=2.0)
    memory = judge(rolling, after(rolling, 0.0), walker, walker)
    assert judge_touch(after(rolling, 0.0), walker, memory).verdict == EGO


def test_who_was_in_danger_from_first_sight_on_inherits_it_unless_it_breaks_a_duty():
    ego, wall = user(0.0, speed=4.0), user(4.0, kind=FIXED, length=1.0, width=9.0)
    kept = judge(ego, after(ego, -4.0), wall, wall, never=True)
    assert judge_touch(ego, wall, kept).verdict == INHERITED
    broke = judge(ego, after(ego, 0.0), wall, wall, never=True)
    assert judge_touch(ego, wall, broke).verdict == EGO
    explained = judge(ego, after(ego, -4.0), wall, wall)
    assert judge_touch(ego, wall, explained).verdict == NOBODY  # a bug, were it to happen
