"""What is remembered of a pair while danger lasts, and the merge of what is owed to all neighbours (Def. 10).

The memory of one pair is a record that is passed in and returned changed; `[N]` of them, one per
road user, make up the memory of a scene. A new record is all zeros.
"""

from typing import NamedTuple

from rss_shield.shield._numba.compiled import compiled, inner, rare, records
from rss_shield.shield.definitions.response import (
    CORRECT,
    FRONT,
    LAT,
    LON,
    NEITHER,
    REAR,
    WRONG,
    lateral_speed_limit,
    step_threshold,
)
from rss_shield.shield.lanes.pair import assess
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE, RESPONSE_PRESENT, RESPONSE_STEER

MEMORY = records(
    [
        ("age", "i8"),  # samples taken in since first sight, 0 = not seen yet
        ("skipped", "?"),  # the last sample was safe beyond doubt and is not taken in yet
        ("since", "i8"),  # frames since the last safe sample; 0 = safe now
        ("axes", "i8"),  # axes safe at that sample; NEITHER = danger from the start
        # roles and state at the threshold t_b (at first sight where danger was there from the start)
        ("ego_is_rear", "?"),
        ("opposite", "?"),
        ("in_own_lane", "?"),  # the other, in a head-on pair
        ("side", "f8"),
        ("v_ego", "f8"),
        ("v_other", "f8"),
        ("w_ego", "f8"),
        ("w_other", "f8"),
        # motion since t_b: along the lane, and of the sides toward each other across it [m]
        ("travel_ego", "f8"),
        ("travel_other", "f8"),
        ("approach_ego", "f8"),
        ("approach_other", "f8"),
        ("way_back", "f8"),  # that an ego which stood there, ahead of the other, may back up in all [m]
        # speed of the other at the last sample and its acceleration over the frame before [m/s], [m/s^2]
        ("speed_other", "f8"),
        ("acceleration_other", "f8"),
        # half lengths at t_b and half widths at the last sample: a car that turns grows [m]
        ("half_length_ego", "f8"),
        ("half_length_other", "f8"),
        ("half_width_ego", "f8"),
        ("half_width_other", "f8"),
        # the situation as it is now (hole H23): role of the ego, FRONT = nobody in its way, and side of the other;
        # and for how many frames either has been owed an answer: since it came about, or since t_b
        ("role_now", "i8"),
        ("role_for", "i8"),
        ("side_now", "f8"),  # 0 = squarely ahead or behind
        ("side_for", "i8"),
        ("w_side", "f8"),  # speed of the ego toward that side when this came about [m/s]
        # first duty that each broke since t_b (`verdicts.DUTIES`) and the most it was broken by
        ("ego_broke", "i8"),
        ("ego_excess", "f8"),
        ("other_broke", "i8"),
        ("other_excess", "f8"),
    ]
)


@compiled
def remember(memory, pair, ego, user, dt):
    """Carry one pair's memory over to this sample, in place."""
    memory.axes, memory.since = step_threshold(memory.axes, memory.since, pair.safe_lon, pair.safe_lat)
    if memory.since == 0 or memory.age == 0:
        memory.ego_is_rear, memory.opposite = pair.ego_is_rear, pair.opposite
        memory.in_own_lane = user.in_own_lane
        memory.side = pair.side
        memory.v_ego, memory.v_other = pair.v_ego, pair.v_other
        memory.w_ego, memory.w_other = pair.w_ego, pair.w_other
        memory.travel_ego = memory.travel_other = 0.0
        memory.approach_ego = memory.approach_other = 0.0
        memory.way_back = pair.way_back
        memory.half_length_ego, memory.half_length_other = ego.half_length, user.half_length
        memory.ego_broke = memory.other_broke = 0
        memory.ego_excess = memory.other_excess = 0.0
    else:
        memory.travel_ego += ego.along * dt
        memory.travel_other += user.along * dt
        memory.approach_ego += memory.side * ego.u * dt + ego.half_width - memory.half_width_ego
        memory.approach_other += -memory.side * user.u * dt + user.half_width - memory.half_width_other
    _note_situation(memory, pair, min(ego.half_width, user.half_width), user)
    if user.vague and memory.since > 0:
        _expect_everything(memory, pair)
    memory.half_width_ego, memory.half_width_other = ego.half_width, user.half_width
    memory.acceleration_other = (user.speed - memory.speed_other) / dt if memory.age > 0 else 0.0
    memory.speed_other = user.speed
    memory.age += 1
    memory.skipped = False


@inner
def _expect_everything(memory, pair):
    """Danger with somebody who is known within bounds only: when it truly began, and on which axis, is not known.

    It is answered on both axes, toward whoever is ahead by now, and no lateral speed is granted that the ego has not
    had since: so the answer is one for every danger that may have begun meanwhile.
    """
    if memory.axes != NEITHER:
        memory.axes = LON | LAT
    memory.ego_is_rear = memory.ego_is_rear or pair.ego_is_rear
    if pair.side == memory.side:
        memory.w_ego = min(memory.w_ego, pair.w_ego)
    if pair.side == memory.side_now:
        memory.w_side = min(memory.w_side, pair.w_ego)


CUT_IN_SPEED = 0.1  # a car ahead is in the ego's way when it comes closer across the lane at this speed [m/s] ...
CUT_IN_GAP = 0.3  # ... or is nearer than this across the lane [m]


@inner
def _note_situation(memory, pair, narrower, user):
    """Who is in the way and who is beside now, and since when; `narrower`: the smaller half width of the two [m].

    Of somebody who is known within bounds only it is not known that he is neither.

    While danger lasts, a clock starts anew when the other gets into the ego's way, or comes up on a side.
    """
    in_the_way = pair.ego_is_rear and (user.vague or pair.w_other > CUT_IN_SPEED or pair.gap_lat < CUT_IN_GAP)
    role = _role(in_the_way, pair.opposite, user.in_own_lane)
    # who is within the other's width and apart along the lane is no neighbour: going round it is no approach
    squarely = not user.vague and pair.gap_lon > 0.0 and pair.gap_lat < -narrower
    side = 0.0 if squarely else pair.side
    begins = memory.since == 0 or memory.age == 0
    if begins or (role == FRONT) != (memory.role_now == FRONT):
        memory.role_for = memory.since if begins else 0
    else:
        memory.role_for += 1
    if begins or side != memory.side_now:
        memory.side_for, memory.w_side = (memory.since if begins else 0), pair.w_ego
    else:
        memory.side_for += 1
    memory.role_now, memory.side_now = role, side


@compiled
def catch_up(memory, ego_before, user_before, table):
    """Take in the last sample, if it was skipped, in place. It is the threshold of a danger that begins now."""
    if memory.skipped:
        _take_in(memory, ego_before, user_before, table)


@rare
def _take_in(memory, ego, user, table):
    remember(memory, assess(ego, user, table), ego, user, table.dt)


@compiled
def forget_safe(memory):
    """Drop a memory of safety that a jump of the lane frame made worthless, in place (hole H5).

    The last sample is to be taken in again, as it is in the new frame. If the pair was unsafe by that,
    the danger is inherited: nobody's doing, answered on both axes.
    """
    if memory.since == 0:
        memory.skipped = memory.skipped or memory.age > 0
        memory.age, memory.axes = 0, NEITHER


@compiled
def start_over(memory):
    """Other parameters count for a pair from here on, in place: what distances these require is nobody's doing.

    Safety is found out again by them (`forget_safe`), and a danger that lasts is inherited.
    """
    forget_safe(memory)
    if memory.since > 0:
        memory.axes = NEITHER


@compiled
def owes(memory, axis):
    """Does this pair owe a response on `axis` now? Danger from the start is answered on both."""
    return memory.since > 0 and (memory.axes == NEITHER or (memory.axes & axis) != 0)


# ---------------------------------------------------------------- roles at the threshold


@compiled
def role_of_ego(memory):
    """Longitudinal role of the ego at the threshold: REAR, FRONT, CORRECT or WRONG."""
    return _role(memory.ego_is_rear, memory.opposite, memory.in_own_lane)


@inner
def _role(ego_is_rear, opposite, other_in_own_lane):
    """Longitudinal role of the ego. Cars that have passed each other owe nothing more than not to reverse."""
    if not ego_is_rear:
        return FRONT
    if opposite:
        return WRONG if other_in_own_lane else CORRECT
    return REAR


@compiled
def role_of_other(memory):
    """Longitudinal role of the other at the threshold."""
    role = role_of_ego(memory)
    if memory.opposite and role != FRONT:
        return CORRECT if role == WRONG else WRONG
    return REAR if role == FRONT and not memory.opposite else FRONT


# ---------------------------------------------------------------- backing up: hole H12


@compiled
def may_back_up(memory, pair):
    """May the ego begin to back up, or go on with it, for all that it owes one road user?

    Def. 4 as printed lets a car that has stopped reverse, whoever is behind it. Here it may while there is no danger
    with anybody behind, and begins only where both have room in the way of each other:

      gap >= what the other needs to stop behind a standing ego (Lemma 2)
             + what the ego needs if it starts backwards now and then stops (`way_back`; Def. 2 with the ego turned
               round and standing)

    From the next frame on it has a speed toward the other, and its distance is that of Def. 2 anyhow (`assess`). So
    every sample that is safe grants the ego the way back that it takes, if it stops as soon as one is not: speeding up
    backwards for its response time and then braking at `a_min_brake`, C5 included, is the most that it can do with it
    (`_share_toward` and `way_back` in the judge). The other has its own share, as ever: if each keeps to its own,
    they do not touch. Who is safe to the side only has to stay there (Def. 8); in danger with somebody beside or behind
    the ego stops, whatever kind of danger it is.
    """
    if memory.since > 0:
        return pair.ego_is_rear and memory.ego_is_rear
    return not pair.hems_in or (pair.safe_lat and not pair.safe_lon)


# ---------------------------------------------------------------- merge over all neighbours: Def. 10


class Bounds(NamedTuple):
    """What the ego may command this frame. Signed; lateral speeds are limits toward each side."""

    a_lower: float  # [m/s^2]
    a_upper: float
    left: float  # largest lateral speed to the left during this frame, >= 0 [m/s]
    right: float
    left_next: float  # the same for the speed the new heading commits to
    right_next: float
    v_lower: float  # speed after this frame, negative in reverse [m/s]


@inner
def hold(bounds, v_lower):
    """Bounds with another lowest speed [m/s]."""
    return Bounds(
        bounds.a_lower, bounds.a_upper, bounds.left, bounds.right, bounds.left_next, bounds.right_next, v_lower
    )


@compiled
def owes_braking(memory, rules):
    """Must the ego brake for this pair? Returns why: 0 no, 1 by Def. 4, 2 by the situation as it is now (hole H23)."""
    if memory.since == 0:
        return 0
    if rules.longitudinal and (owes(memory, LON) or not rules.memory) and memory.ego_is_rear:
        return 1
    return 2 if rules.present_duties and memory.role_now != FRONT else 0


@compiled
def owes_lateral_stop(memory, rules):
    """Must the ego stop moving toward this neighbour (Def. 8)?"""
    return rules.lateral and rules.memory and owes(memory, LAT)


@compiled
def owes_no_approach(memory, rules):
    """Must the ego stop moving toward whoever is beside it now (hole H23)?"""
    return rules.present_duties and memory.since > 0 and memory.side_now != 0.0


@inner
def response_to(memory, rules):
    """What the ego owes to one pair: a sum of RESPONSE_* bits, 0 outside danger."""
    if memory.since == 0:
        return 0
    braking = owes_braking(memory, rules)
    response = RESPONSE_BRAKE if braking == 1 else (RESPONSE_PRESENT if braking == 2 else 0)
    if owes_lateral_stop(memory, rules) or owes_no_approach(memory, rules):
        response |= RESPONSE_STEER
    return response


@compiled
def merge(bounds, memory, params, rules, dt):
    """Tighten the bounds by what is owed to one pair: the duties of the threshold, and those of the situation now.

    Longitudinal duties are lower bounds of -a_max_brake and upper bounds of -a_min_brake, so they
    never contradict while a_min_brake <= a_max_brake; lateral ones are limits >= 0 on the two
    speeds toward the sides. So any number of duties can be kept at once, however long they have been owed.
    """
    a_upper = bounds.a_upper
    braking = owes_braking(memory, rules)
    if braking != 0:
        inherited = braking == 1 and memory.axes == NEITHER and rules.brake_if_inherited
        a_upper = min(a_upper, -params.a_max_brake if inherited else -params.a_min_brake)
    bounds = Bounds(
        bounds.a_lower, a_upper, bounds.left, bounds.right, bounds.left_next, bounds.right_next, bounds.v_lower
    )
    if owes_lateral_stop(memory, rules):
        bounds = _slow_down(bounds, memory.side, memory.since, memory.w_ego, params, dt)
    if owes_no_approach(memory, rules):
        bounds = _slow_down(bounds, memory.side_now, memory.side_for, memory.w_side, params, dt)
    return bounds


@inner
def _slow_down(bounds, side, frame, w, params, dt):
    """Bounds with the lateral speed limit toward one side, as in `lateral_speed_limit`."""
    now = lateral_speed_limit(frame, w, params, dt)
    soon = lateral_speed_limit(frame + 1, w, params, dt)
    left, right, left_next, right_next = bounds.left, bounds.right, bounds.left_next, bounds.right_next
    if side > 0.0:
        right, right_next = min(right, now), min(right_next, soon)
    else:
        left, left_next = min(left, now), min(left_next, soon)
    return Bounds(bounds.a_lower, bounds.a_upper, left, right, left_next, right_next, bounds.v_lower)
