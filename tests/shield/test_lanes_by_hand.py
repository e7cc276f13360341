"""One pair of cars on a lane: distances, duties, bounds and shares, worked by hand.

At 5 Hz with the table "simulator": the ego responds within 0.2 s, others within 1 s; everybody accelerates at 3 m/s^2,
brakes at 5 to 6, and across at 1 and 1.5 m/s^2; 1 m is kept at standstill, mu is 0.1 m.
"""

import numpy as np
import pytest

from rss_shield.shield.command import Command
from rss_shield.shield.definitions.longitudinal import d_min_following
from rss_shield.shield.definitions.response import LAT, LON, NEITHER
from rss_shield.shield.lanes.anticipation import acceleration_cap, lateral_cap, share_kept
from rss_shield.shield.lanes.controller import find_danger, respond
from rss_shield.shield.lanes.judge import audit_command, judge_contact, judge_frame, judge_motion
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import MEMORY, may_back_up, owes, remember, role_of_ego, role_of_other
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE, RESPONSE_STEER
from rss_shield.shield.lanes.restriction import Body, restrict
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.sampling import lateral_euler_margin
from rss_shield.shield.table import table_for
from rss_shield.shield.verdicts import (
    EGO,
    KEPT,
    OTHER,
    REVERSED,
    TOO_CLOSE,
    TOO_FAR,
    TOO_HARD,
    TOO_SHORT,
    TOO_WEAK,
    TOWARD,
)

DT = 0.2
TABLE = table_for(PRESETS["simulator"], Rules(), DT)
BODY = Body(2.5, 0.7, 0.0)
REAR, FRONT, CORRECT, WRONG = range(4)


def car(s, v=20.0, y=0.0, **fields):
    one = np.zeros(1, ROAD_USER)[0]
    one["s"], one["y"], one["speed"], one["along"] = s, y, v, v
    one["cos"], one["around"], one["half_length"], one["half_width"] = 1.0, np.inf, 2.5, 1.0
    one["in_own_lane"] = True
    for name, value in fields.items():
        one[name] = value
    return one


def remembered(**fields):
    one = np.zeros(1, MEMORY)[0]
    one["age"], one["role_now"] = 5, FRONT
    one["half_length_ego"] = one["half_length_other"] = 2.5
    one["half_width_ego"] = one["half_width_other"] = 1.0
    for name, value in fields.items():
        one[name] = value
    return one


def scene(*others):
    return np.array(list(others), ROAD_USER)


def look(ego, others, memory, table=TABLE, before=None):
    """`find_danger` on one frame, everybody as on the frame before."""
    then = (ego, others) if before is None else before
    return find_danger(ego, others, *then, memory, table)


# ---------------------------------------------------------------- distances


def test_what_a_follower_needs_at_equal_speeds():
    # 20 * 0.2 + 3 * 0.04 / 2 = 4.06, then 20.6^2 / 10 = 42.436; the leader may turn within the heading bound of 0.1:
    # 400 * 0.99 / 12 = 33. With 1 m at standstill 14.496, and of whole frames (20 - 19.8997) 0.1 + 5 * 0.04 / 8
    needed = 14.496 + (20.0 - 20.0 * np.sqrt(0.99)) * 0.1 + 0.025
    pair = assess(car(0.0), car(25.0), TABLE)
    assert pair.gap_lon == pytest.approx(20.0)
    assert pair.margin_lon == pytest.approx(20.0 - needed)
    assert pair.safe_lon and pair.ego_is_rear and not pair.opposite and not pair.safe_lat
    # from behind: 20 + 1.5 = 21.5 and 23^2 / 10 = 52.9, the ego brakes within 33 m
    behind = assess(car(0.0), car(-25.0), TABLE)
    needed = 21.5 + 52.9 - 33.0 + 1.0 + (20.0 - 20.0 * np.sqrt(0.99)) * 0.1 + 0.025
    assert behind.margin_lon == pytest.approx(20.0 - needed)
    assert not behind.safe_lon and not behind.ego_is_rear


def test_what_two_need_beside_each_other():
    # the ego may come 0.02 + 0.04 / 3, the other 0.5 + 1 / 3; mu 0.1, room for slip 0.1; of whole frames
    # 1.5 * 0.04 / 8 each, and the ego's first frame 0.2 * 0.2
    needed = 0.1 + 0.02 + 0.04 / 3 + 0.5 + 1 / 3 + 0.1 + 0.015 + 0.04
    pair = assess(car(0.0), car(0.0, y=4.0), TABLE)
    assert pair.gap_lat == pytest.approx(2.0) and pair.side == 1.0
    assert pair.margin_lat == pytest.approx(2.0 - needed) and pair.safe_lat
    # the other comes at 0.6 m/s: 0.6 + 0.5 + 1.6^2 / 3, and 0.06 of whole frames
    nearer = assess(car(0.0), car(0.0, y=-4.0, u=0.6), TABLE)
    assert nearer.side == -1.0 and nearer.w_other == pytest.approx(0.6)
    assert nearer.margin_lat == pytest.approx(2.0 - needed - 0.6 - (1.6**2 - 1.0) / 3 - 0.06)
    # who moves away gets no credit
    assert assess(car(0.0), car(0.0, y=-4.0, u=-0.6), TABLE).margin_lat == pytest.approx(pair.margin_lat)


# ---------------------------------------------------------------- duties


def test_who_comes_too_close_to_its_leader_brakes_and_is_judged():
    memory = np.zeros(1, MEMORY)
    ego, others = car(0.0), scene(car(25.0))
    first = look(ego, others, memory)
    assert not first.dangerous and first.partner == 0 and first.response == 0
    assert first.margin_lon == pytest.approx(20.0 - 14.531025, abs=1e-5)
    # the leader has braked harder than it may: 12 m are too little
    ego, others = car(4.0), scene(car(21.0, 10.0, along=-20.0))
    danger = look(ego, others, memory)
    assert danger.dangerous and danger.bounds.a_upper == -5.0 and danger.bounds.a_lower == -6.0
    assert danger.response & RESPONSE_BRAKE and memory[0]["since"] == 1 and memory[0]["axes"] == LON
    assert danger.ttc == pytest.approx(12.0 / (20.0 - 10.0 * np.sqrt(0.99)))
    answer = respond(Command(1.0, 0.0), danger, ego, BODY, TABLE.rules, DT)
    assert answer.overridden and answer.command.acceleration == -5.0
    assert judge_frame(ego, others, memory, answer.command, 0.0, TABLE) == (1, 0)
    assert judge_frame(ego, others, memory, Command(-4.0, 0.0), 0.0, TABLE) == (1, 1)
    assert memory[0]["ego_broke"] == TOO_WEAK and memory[0]["ego_excess"] == pytest.approx(1.0)


def test_danger_from_the_start_is_answered_with_all_there_is_and_on_both_axes():
    memory = np.zeros(1, MEMORY)
    danger = look(car(0.0), scene(car(10.0, 10.0)), memory)
    assert danger.bounds.a_upper == -6.0
    assert danger.response == RESPONSE_BRAKE | RESPONSE_STEER
    assert memory[0]["axes"] == NEITHER and owes(memory[0], LON) and owes(memory[0], LAT)


def test_who_is_beside_is_not_approached_any_more():
    memory = np.zeros(1, MEMORY)
    ego = car(0.0, u=0.4)
    assert not look(ego, scene(car(-1.0, y=4.0)), memory).dangerous
    others = scene(car(-1.0, y=2.6, u=-1.5))
    danger = look(ego, others, memory)
    assert memory[0]["axes"] == LAT and danger.response == RESPONSE_STEER
    # 0.4 m/s at the threshold: 0.6 once, which the response time of one frame allows, then 1.5 m/s^2 less
    assert (danger.bounds.right, danger.bounds.right_next) == pytest.approx((0.6, 0.3))
    assert danger.bounds.left == pytest.approx(0.2)
    assert danger.bounds.a_upper == 3.0  # nobody is in the way


def test_roles_at_the_threshold():
    assert role_of_ego(remembered(ego_is_rear=True)) == REAR
    assert role_of_other(remembered(ego_is_rear=True)) == FRONT
    assert role_of_ego(remembered(ego_is_rear=False)) == FRONT
    assert role_of_other(remembered(ego_is_rear=False)) == REAR
    head_on = remembered(ego_is_rear=True, opposite=True, in_own_lane=True)
    assert (role_of_ego(head_on), role_of_other(head_on)) == (WRONG, CORRECT)
    head_on["in_own_lane"] = False
    assert (role_of_ego(head_on), role_of_other(head_on)) == (CORRECT, WRONG)
    passed = remembered(ego_is_rear=False, opposite=True)
    assert (role_of_ego(passed), role_of_other(passed)) == (FRONT, FRONT)


@pytest.mark.parametrize(
    ("fields", "v", "a", "duty", "excess"),
    [
        ({"ego_is_rear": True}, 20.0, -5.0, KEPT, 0.0),
        ({"ego_is_rear": True}, 20.0, -3.0, TOO_WEAK, 2.0),
        ({"ego_is_rear": True}, 0.6, -3.0, KEPT, 0.0),  # the last step is partial
        ({"ego_is_rear": True}, 0.0, 0.5, TOO_WEAK, 0.5),
        ({"ego_is_rear": False}, 20.0, -6.0, KEPT, 0.0),
        ({"ego_is_rear": False}, 20.0, -6.5, TOO_HARD, 0.5),
        ({"ego_is_rear": False}, 0.0, -1.0, REVERSED, 0.2),
        ({"ego_is_rear": True}, -0.1, 0.4, KEPT, 0.0),  # in reverse the last step is partial, too
        ({"ego_is_rear": True, "opposite": True, "in_own_lane": False}, 20.0, -2.0, TOO_WEAK, 1.0),  # in its own lane
    ],
)
def test_accelerations_are_held_to_def_4(fields, v, a, duty, excess):
    memory = remembered(since=3, axes=LON, **fields)
    found = audit_command(memory, car(0.0, v), Command(a, 0.0), 0.0, TABLE.ego, DT)
    assert found == (duty, pytest.approx(excess))


def test_within_the_response_time_full_throttle_is_kept_to():
    memory = remembered(since=0, axes=LON, ego_is_rear=True)
    memory["since"] = 1
    slow = TABLE.ego._replace(response_time=0.6)
    assert audit_command(memory, car(0.0), Command(3.0, 0.0), 0.0, slow, DT) == (KEPT, 0.0)
    assert audit_command(memory, car(0.0), Command(3.5, 0.0), 0.0, slow, DT) == (TOO_WEAK, pytest.approx(0.5))
    memory["since"] = 3
    assert audit_command(memory, car(0.0), Command(3.0, 0.0), 0.0, slow, DT) == (TOO_WEAK, pytest.approx(8.0))


@pytest.mark.parametrize(("side", "slip"), [(1.0, 0.02), (-1.0, -0.02)])
def test_lateral_speed_is_held_to_def_8_and_the_drift_of_a_bend_does_not_count(side, slip):
    # 0.1 m/s at the threshold: 0.3 once, then 1.5 * 0.2 less each frame: nothing on the second frame
    memory = remembered(since=2, axes=LAT, side=side, w_ego=0.1)
    u = 20.0 * np.sin(0.02)
    found = audit_command(memory, car(0.0), Command(0.0, slip), 0.0, TABLE.ego, DT)
    assert found == (TOWARD, pytest.approx(u))
    assert audit_command(memory, car(0.0), Command(0.0, -slip), 0.0, TABLE.ego, DT) == (KEPT, 0.0)
    assert audit_command(memory, car(0.0), Command(0.0, slip), side * u, TABLE.ego, DT)[0] == KEPT
    # so it is toward whoever has come up beside it since
    now = remembered(since=2, axes=LON, ego_is_rear=False, side_now=side, side_for=2, w_side=0.1)
    assert audit_command(now, car(0.0), Command(0.0, slip), 0.0, TABLE.ego, DT) == (TOWARD, pytest.approx(u))


def test_the_motion_since_the_threshold_is_kept_and_boxes_grow():
    memory = remembered(since=1, axes=LAT, side=1.0, ego_is_rear=True, speed_other=21.0)
    ego, other = car(0.0, u=0.5, half_width=1.1), car(1.0, 20.0, y=2.2, u=-0.25)
    remember(memory, assess(ego, other, TABLE), ego, other, DT)
    assert (memory["since"], memory["age"]) == (2, 6)
    assert memory["travel_ego"] == pytest.approx(4.0) and memory["travel_other"] == pytest.approx(4.0)
    assert memory["approach_ego"] == pytest.approx(0.1 + 0.1) and memory["approach_other"] == pytest.approx(0.05)
    assert memory["acceleration_other"] == pytest.approx(-5.0)


# ---------------------------------------------------------------- shares


def test_a_follower_may_use_up_its_share_along_the_lane():
    # 0.4 s after the threshold: 4.06 m in 0.2 s, 20.6 * 0.2 - 5 * 0.04 / 2 after that; whole frames add
    # (20 - 19.6) * 0.1 + 5 * 0.04 / 8. The leader: 8 - 6 * 0.16 / 2, and (20 - 17.6) * 0.1
    rear, front = 4.06 + 4.02 + 0.04 + 0.025, 7.52 + 0.24
    kept = remembered(since=2, axes=LON, ego_is_rear=True, v_ego=20.0, v_other=20.0, speed_other=20.0)
    kept["travel_ego"], kept["travel_other"] = rear, front
    judge_motion(kept, car(0.0), car(20.0), TABLE, 0, 0.0)
    assert kept["ego_broke"] == KEPT and kept["other_broke"] == KEPT
    broken = remembered(since=2, axes=LON, ego_is_rear=True, v_ego=20.0, v_other=20.0, speed_other=20.0)
    broken["travel_ego"], broken["travel_other"] = rear + 0.3, front - 0.2
    judge_motion(broken, car(0.0), car(20.0), TABLE, 0, 0.0)
    assert broken["ego_broke"] == TOO_FAR and broken["ego_excess"] == pytest.approx(0.3)
    assert broken["other_broke"] == TOO_SHORT and broken["other_excess"] == pytest.approx(0.2)


def test_a_leader_has_a_share_too_less_what_it_may_back_up():
    # the ego ahead: least 7.52 + 0.24; the other behind, within its response time of 1 s: 20 * 0.4 + 3 * 0.16 / 2, and
    # it gets faster: (20 - 21.2) * 0.1 + 0.025
    front, rear = 7.76, 8.24 - 0.12 + 0.025
    memory = remembered(since=2, axes=LON, v_ego=20.0, v_other=20.0, speed_other=20.0, way_back=0.5)
    memory["travel_ego"], memory["travel_other"] = front - 0.6, rear + 0.1
    judge_motion(memory, car(20.0), car(0.0), TABLE, 0, 0.0)
    assert memory["ego_broke"] == TOO_SHORT and memory["ego_excess"] == pytest.approx(0.1)
    assert memory["other_broke"] == TOO_FAR and memory["other_excess"] == pytest.approx(0.1)


def test_each_may_come_as_far_across_as_its_share():
    # the ego at 0.5 m/s: 0.1 + 0.02 + 0.49 / 3, of whole frames 0.05 + 0.0075 + 0.04
    share = 0.12 + 0.49 / 3 + 0.0975
    assert lateral_euler_margin(0.5, TABLE.ego, DT) == pytest.approx(0.0975)
    memory = remembered(since=2, axes=LAT, side=1.0, w_ego=0.5, approach_ego=share + 0.02)
    judge_motion(memory, car(0.0), car(0.0, y=2.0), TABLE, 0, 0.0)
    assert memory["ego_broke"] == TOO_CLOSE and memory["ego_excess"] == pytest.approx(0.02)
    # with some slack for a heading that lags it would not have
    memory = remembered(since=2, axes=LAT, side=1.0, w_ego=0.5, approach_ego=share + 0.02)
    judge_motion(memory, car(0.0), car(0.0, y=2.0), TABLE, 0, 0.03)
    assert memory["ego_broke"] == KEPT
    # the other at 0: 0.5 + 1 / 3, of whole frames 0.0075 and 0.04
    memory = remembered(since=2, axes=LAT, side=1.0, approach_other=0.5 + 1 / 3 + 0.0475 + 0.3)
    judge_motion(memory, car(0.0), car(0.0, y=2.0), TABLE, 0, 0.0)
    assert memory["other_broke"] == TOO_CLOSE and memory["other_excess"] == pytest.approx(0.3)


def test_a_contact_is_judged_with_the_frame_that_is_about_to_come():
    # 8.1 m in 0.4 s are less than its share of 8.145 m; another 4 m are more than what is left of 8.08 m and
    # 19.6 * 0.2 - 5 * 0.04 / 2 = 3.82, and of whole frames (20 - 18.6) * 0.1 + 0.025
    memory = remembered(since=1, axes=LON, ego_is_rear=True, v_ego=20.0, v_other=20.0, speed_other=20.0)
    memory["travel_ego"], memory["travel_other"] = 4.1, 4.0
    verdict = judge_contact(car(0.0), car(5.2), memory, TABLE)
    assert verdict.verdict == EGO and verdict.ego_duty == TOO_FAR and verdict.kind == LON and verdict.frames == 2
    assert verdict.ego_excess == pytest.approx(12.1 - (8.08 + 3.82 + 0.14 + 0.025))


def test_who_is_hit_from_the_side_while_it_keeps_its_duty_is_not_to_blame():
    memory = remembered(since=9, axes=LAT, side=1.0, approach_other=1.5)
    verdict = judge_contact(car(0.0), car(0.0, y=1.9, u=-1.0), memory, TABLE)
    assert verdict.verdict == OTHER and verdict.other_duty == TOO_CLOSE and verdict.ego_duty == KEPT


# ---------------------------------------------------------------- commands


def test_commands_are_limited_and_no_braking_goes_on_behind_standstill():
    free = always_on(car(0.0), TABLE.ego, TABLE.rules, DT)
    assert restrict(Command(9.0, 0.0), free, car(0.0), BODY, TABLE.rules, DT).acceleration == 3.0
    assert restrict(Command(-9.0, 0.0), free, car(0.0), BODY, TABLE.rules, DT).acceleration == -6.0
    slow = car(0.0, 0.5)
    bounds = always_on(slow, TABLE.ego, TABLE.rules, DT)._replace(a_upper=-5.0)
    assert restrict(Command(1.0, 0.0), bounds, slow, BODY, TABLE.rules, DT).acceleration == pytest.approx(-2.5)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_steering_is_limited_by_the_lateral_speed_and_by_the_heading_it_leads_to(side):
    ego = car(0.0, 10.0)  # G = 0.8: the heading turns by 0.8 of the slip
    bounds = always_on(ego, TABLE.ego, TABLE.rules, DT)
    slip = restrict(Command(0.0, 0.3 * side), bounds, ego, BODY, TABLE.rules, DT).slip
    assert 10.0 * np.sin(slip) == pytest.approx(0.2 * side)  # 1 m/s^2 for one frame
    assert restrict(Command(0.0, 0.01 * side), bounds, ego, BODY, TABLE.rules, DT).slip == 0.01 * side
    none = bounds._replace(left=0.0, right=0.0, left_next=0.0, right_next=0.0)
    assert restrict(Command(0.0, 0.3 * side), none, ego, BODY, TABLE.rules, DT).slip == pytest.approx(0.0)
    # a car that drives at an angle straightens: the course is along the lane at once
    for speed in (10.0, 12.5):  # up to G = 1
        turned = car(0.0, speed, heading=0.05 * side, sin=np.sin(0.05 * side))
        assert restrict(Command(0.0, 0.0), none, turned, BODY, TABLE.rules, DT).slip == pytest.approx(-0.05 * side)
    # fast enough (G = 2.4), the heading is set right first, and the lateral speed shrinks by 1 - 1 / G
    fast = car(0.0, 30.0, heading=0.01 * side, sin=np.sin(0.01 * side))
    wide = none._replace(left=0.3, right=0.3)
    slip = restrict(Command(0.0, 0.0), wide, fast, BODY, TABLE.rules, DT).slip
    assert 2.4 * np.sin(slip) == pytest.approx(-0.01 * side)


def test_in_a_bend_a_heading_up_to_that_at_the_rear_axle_commits_to_nothing():
    # a bend of 50 m at 10 m/s: it turns by 0.04 and drifts by 0.2 m/s; slip 0.05 keeps a car at -0.03 to the lane, and
    # its heading to -0.03 + 0.8 * 0.05 - 0.04
    body, ego = Body(2.5, 0.7, 1 / 50, -0.05, 0.04, 0.0), car(0.0, 10.0, heading=-0.03)
    free = always_on(ego, TABLE.ego, TABLE.rules, DT)
    none = free._replace(left=0.001, right=0.001, left_next=0.0, right_next=0.0)
    assert restrict(Command(0.0, 0.05), none, ego, body, TABLE.rules, DT).slip == 0.05


def test_where_frames_are_long_the_heading_is_set_for_the_speed_to_come():
    # 29 m/s in a bend of 150 m, G = 2.32: the lane turns by 5.8 / 150; idle at 29.6 m/s is (2.96 - 2.5) / 150
    body, ego = Body(2.5, 0.7, 1 / 150, -2.5 / 150, 5.8 / 150, 0.4 / 150), car(0.0, 29.0, heading=-0.005)
    none = always_on(ego, TABLE.ego, TABLE.rules, DT)._replace(left=9.0, right=9.0, left_next=0.0, right_next=0.0)
    for wish in (-0.1, 0.1):
        for a, idle in ((3.0, 0.46 / 150), (-5.0, 0.3 / 150)):  # and (2.8 - 2.5) / 150 at 28 m/s
            slip = restrict(Command(a, wish), none, ego, body, TABLE.rules, DT).slip
            assert -0.005 + 2.32 * np.sin(slip) - 5.8 / 150 == pytest.approx(idle, abs=1e-6)


def test_in_reverse_the_lateral_speed_and_the_heading_are_limited_too():
    ego = car(0.0, -1.0)
    bounds = always_on(ego, TABLE.ego, TABLE.rules, DT)
    for side in (-1.0, 1.0):  # 0.2 m/s more than none
        slip = restrict(Command(0.0, 0.5 * side), bounds, ego, BODY, TABLE.rules, DT).slip
        assert np.sin(slip) == pytest.approx(0.2 * side)
    # it keeps to the heading at which, moving straight, it comes to rest inside the bound: 1 m/s takes it 0.2 m back
    # in a frame in which it stops, and 0.1 + 0.125 + 0.02 m with a brake of 4 m/s^2. It turns by -0.08 of the slip
    wide = bounds._replace(left=9.0, right=9.0)
    for a_stop, way in ((np.inf, 0.2), (4.0, 0.245)):
        largest = np.arcsin(0.1) * np.exp(-way / 2.5)
        turned, body = car(0.0, -1.0, heading=largest), BODY._replace(a_stop=a_stop)
        assert restrict(Command(0.0, -0.5), wide, turned, body, TABLE.rules, DT).slip == pytest.approx(0.0)
        assert restrict(Command(0.0, 0.05), wide, turned, body, TABLE.rules, DT).slip == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("sine", "slowest"), [(0.0, -0.6), (0.09, -0.6), (0.097, -0.3655), (0.0999, -0.012), (0.1001, 0.0)]
)
def test_who_backs_up_is_straight_enough_to_come_to_rest_inside_the_heading_bound(sine, slowest):
    """H12. A frame of 0.2 s at 3 m/s^2 begins it. At sine 0.097 there is room for 2.4 ln(0.1 / 0.097) = 73 mm, which
    0.3655 m/s take in the frame in which it stops."""
    ego = car(0.0, 0.0, heading=np.arcsin(sine), sin=sine)
    found = always_on(ego, TABLE.ego, TABLE.rules, DT).v_lower
    assert found == pytest.approx(slowest, abs=1e-3)


def test_nobody_gets_so_fast_that_a_heading_could_not_calm_down_before_it_has():
    """C9. With 2 half wheelbases per frame, 25 m/s at 5 Hz. Where it may not move sideways, a slower car turns back."""
    body, dt = Body(2.5, 0.7, 0.0, a_stop=4.0), 0.2
    for heading, fast in ((0.0, True), (0.02, False), (-0.02, False)):
        ego = car(0.0, 24.9, heading=heading)
        bounds = always_on(ego, TABLE.ego, TABLE.rules, dt)._replace(left=0.0, right=0.0, left_next=0.1, right_next=0.1)
        command = restrict(Command(3.0, 0.0), bounds, ego, body, TABLE.rules, dt)
        assert (24.9 + command.acceleration * dt >= 25.0) == fast
        assert 24.9 * np.sin(heading + command.slip) == pytest.approx(0.0, abs=1e-9)
        if not fast:
            assert command.acceleration == pytest.approx(0.5)


def test_nobody_backs_up_toward_who_is_near_behind():
    memory = remembered()
    near, far = (assess(car(0.0, 0.0), car(-s, 0.0), TABLE) for s in (6.5, 60.0))
    assert near.hems_in and not may_back_up(memory, near)
    # it may go back what starting at 3 m/s^2 for 0.2 s and stopping with 5 takes: 0.06 + 0.36 / 10, frames 0.025
    assert not far.hems_in and far.way_back == pytest.approx(0.06 + 0.036 + 0.025) and may_back_up(memory, far)


# ---------------------------------------------------------------- anticipation


@pytest.mark.parametrize("v", [17.0, 20.0, 24.0])
@pytest.mark.parametrize("a_front", [0.0, -4.0])
@pytest.mark.parametrize("front_brakes", [6.0, 4.5])  # less than the ego itself does: hole H1
def test_the_cap_keeps_the_share_of_the_margin_at_the_next_sample(v, a_front, front_brakes):
    ego, other, v_front = TABLE.ego, TABLE.other._replace(a_max_brake=front_brakes), 18.0

    def margin(gap, v, v_front):
        return gap - d_min_following(v, v_front, ego, other) - max(v - v_front, 0.0) * DT / 2 - 0.025

    now = 1.5
    gap = now - margin(0.0, v, v_front)
    a = acceleration_cap(gap, now, v, v_front, a_front, ego, other, 2.0, DT)
    assert -5.0 < a < 3.0
    later = margin(gap + (v_front - v) * DT, v + a * DT, v_front + a_front * DT)
    assert later == pytest.approx(share_kept(now, 2.0, DT), abs=1e-6)
    assert share_kept(1.1, 2.0, DT) == pytest.approx(0.6 * 1.0 + 0.1)


def test_far_behind_full_throttle_is_left_and_close_behind_the_brakes_suffice():
    def cap(gap, v):
        return acceleration_cap(gap, 0.0, v, 18.0, 0.0, TABLE.ego, TABLE.other, 2.0, DT)

    assert cap(200.0, 20.0) == np.inf
    assert cap(1.0, 20.0) == -5.0


@pytest.mark.parametrize("w", [0.0, 0.3])
def test_the_lateral_cap_keeps_the_share_of_the_margin_too(w):
    # margin 0.8 at w; no-credit distance of one car E(w) = 0.2 w + 0.02 + (w + 0.2)^2 / 3, frames 0.1 w
    margin = 0.8
    u = lateral_cap(margin, w, 0.2, TABLE.ego, 2.0, DT)

    def needed(w):
        return 0.2 * w + 0.02 + (w + 0.2) ** 2 / 3 + 0.1 * w

    later = margin - u * DT - 0.2 * DT + needed(w) - needed(u)
    assert later == pytest.approx(share_kept(margin, 2.0, DT))
    assert lateral_cap(0.0, 0.0, 1.0, TABLE.ego, 2.0, DT) == 0.0
