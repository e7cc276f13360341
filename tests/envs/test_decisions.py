"""What is known of a decision before it is carried out: the ego played ahead, masks, replacement, what was executed."""

import numpy as np
import pytest
from highway_env.envs.common.action import ContinuousAction, DiscreteAction, DiscreteMetaAction

from rss_shield.envs.decisions.executed import executed_actions
from rss_shield.envs.decisions.foresight import Aim, Seen, first_response, make_stage
from rss_shield.envs.decisions.masks import FASTER, IDLE, LANE_LEFT, LANE_RIGHT, SLOWER, allow
from rss_shield.envs.decisions.replacement import NEAREST, order_of, replace
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.params import PRESETS, Rules, Table

ALL = np.arange(5)
DT = 0.2
CAR = PRESETS["simulator"].ego._replace(response_time=0.2)
OTHER = PRESETS["simulator"].other
BODY = Body(2.5, 0.5, 0.0)


def test_the_numbers_of_the_actions_are_those_of_highway_env():
    names = [DiscreteMetaAction.ACTIONS_ALL[k] for k in (LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER)]
    assert names == ["LANE_LEFT", "IDLE", "LANE_RIGHT", "FASTER", "SLOWER"]


# ---------------------------------------------------------------- the ego played ahead


def user(**fields):
    record = np.zeros(1, ROAD_USER)
    record["half_length"], record["half_width"], record["cos"], record["in_own_lane"] = 2.5, 1.2, 1.0, True
    record["around"] = np.inf
    for name, value in fields.items():
        record[name] = value
    return record


def looked_ahead(ego, other, aim, frames=15, rules=Rules(anticipation=0.0)):
    seen = Seen(ego[0], other, ego[0], other.copy(), np.zeros(1, MEMORY))
    return first_response(seen, make_stage(1), aim, BODY, frames, Table(CAR, OTHER, rules, DT))


def frame_of_danger(gap, v, target, v_front, frames=15):
    """By hand: 3 m/s^2 at most toward the target speed, until the gap is less than Lemma 2 asks for."""
    for frame in range(frames):
        v_rho, slowed = v + 3.0 * 0.2, v_front * np.sqrt(0.99)  # it may turn within the heading bound
        needed = v * 0.2 + 0.5 * 3.0 * 0.04 + v_rho**2 / 10.0 - slowed**2 / 12.0
        needed = max(needed, 0.0) + 1.0 + max((v - slowed) * DT / 2 + 5.0 * DT**2 / 8, 0.0)
        a = np.clip((target - v) / 0.6, -6.0, 3.0)
        if gap < needed and a > -5.0:
            return frame
        gap, v = gap + (v_front - v) * DT, v + a * DT
    return frames


@pytest.mark.parametrize("gap", [14.0, 16.0, 18.0, 20.0, 25.0, 30.0, 60.0])
@pytest.mark.parametrize("target", [15.0, 20.0, 25.0, 30.0])
def test_the_frame_of_the_first_response_is_that_of_the_first_danger(gap, target):
    ego, other = user(speed=20.0), user(s=gap + 5.0, speed=20.0)
    assert looked_ahead(ego, other, Aim(target, 0.0, 0.0)) == frame_of_danger(gap, 20.0, target, 20.0)


def test_hard_braking_needs_no_response():
    # from 30 m/s toward 20 m/s: 6 m/s^2, more than the 5 that are owed, as long as v > 23
    ego, other = user(speed=30.0), user(s=25.0, speed=20.0)
    assert looked_ahead(ego, other, Aim(30.0, 0.0, 0.0)) == 0
    assert looked_ahead(ego, other, Aim(20.0, 0.0, 0.0), frames=5) == 5


@pytest.mark.parametrize(("beside", "passes"), [(12.0, True), (4.0, False)])
def test_a_change_into_an_occupied_lane_is_answered(beside, passes):
    ego, other = user(speed=25.0), user(y=beside, speed=25.0)
    # the lane aimed for is 4 m to the right
    assert (looked_ahead(ego, other, Aim(25.0, -4.0, 0.0)) == 15) == passes


def test_one_who_drifts_goes_on_drifting():
    drifting = user(s=8.0, y=4.0, speed=25.0, u=-1.0, sin=-0.04)
    staying = user(s=8.0, y=4.0, speed=25.0)
    aim = Aim(25.0, 0.0, 0.0)
    assert looked_ahead(user(speed=25.0), staying, aim) == 15
    assert looked_ahead(user(speed=25.0), drifting, aim) < 15


# ---------------------------------------------------------------- masks


@pytest.mark.parametrize(
    ("first", "allowed"),
    [
        ([5, 5, 5, 5, 5], [0, 1, 2, 3, 4]),
        ([0, 5, 1, 3, 5], [1, 4]),
        ([0, 2, 1, 3, 1], [FASTER]),  # none passes: the last to be answered
        ([2, 2, 2, 2, 2], [SLOWER]),  # ... and of several the calmest
        ([2, 2, 2, 2, 0], [IDLE]),
        ([2, 0, 2, 2, 0], [LANE_LEFT]),
        ([0, 0, 0, 0, 0], [SLOWER]),
    ],
)
def test_a_mask_allows_what_passes_and_else_what_is_answered_last(first, allowed):
    mask = np.zeros(5, bool)
    allow(np.array(first), 5, ALL, mask)
    assert np.flatnonzero(mask).tolist() == allowed


def test_masks_go_by_the_meaning_of_an_action_not_by_its_number():
    mask = np.zeros(3, bool)
    allow(np.array([1, 1, 1]), 5, np.array([SLOWER, IDLE, FASTER]), mask)
    assert mask.tolist() == [True, False, False]


# ---------------------------------------------------------------- replacement


def test_every_action_knows_all_others():
    for action, others in NEAREST.items():
        assert sorted((action, *others)) == ALL.tolist()


@pytest.mark.parametrize(
    ("action", "allowed", "executed"),
    [
        (FASTER, [FASTER, IDLE], FASTER),
        (FASTER, [IDLE, SLOWER], IDLE),
        (FASTER, [LANE_LEFT, SLOWER], SLOWER),
        (LANE_LEFT, [FASTER, IDLE, LANE_RIGHT], IDLE),
        (LANE_RIGHT, [LANE_LEFT, FASTER], FASTER),
        (IDLE, [SLOWER, FASTER], SLOWER),
        (SLOWER, [FASTER, LANE_RIGHT], LANE_RIGHT),
    ],
)
def test_the_nearest_permitted_action_takes_its_place(action, allowed, executed):
    masks = np.isin(ALL, allowed)[None]
    assert replace(np.array([action]), masks, order_of(ALL)).tolist() == [executed]


def test_actions_that_are_missing_are_left_out():
    order = order_of(np.array([SLOWER, IDLE, FASTER]))  # as at intersections
    assert order.tolist() == [[0, 1, 2], [1, 0, 2], [2, 1, 0]]
    masks = np.array([[True, False, True], [True, False, False]])
    assert replace(np.array([1, 2]), masks, order).tolist() == [0, 0]


# ---------------------------------------------------------------- what was executed


class _Kind(DiscreteMetaAction):
    def __init__(self):
        self.actions = self.ACTIONS_ALL
        self.actions_indexes = {name: number for number, name in self.actions.items()}


def test_a_lane_change_that_was_refused_counts_as_idle():
    handed, refused = np.array([LANE_LEFT, LANE_LEFT, FASTER]), np.array([True, False, True])
    assert executed_actions(_Kind(), handed, refused, np.zeros((3, 2))).tolist() == [IDLE, LANE_LEFT, FASTER]


def test_of_continuous_actions_the_mean_command_counts():
    kind = ContinuousAction(None, acceleration_range=(-5.0, 5.0), steering_range=(-0.5, 0.5))
    handed = np.array([[1.0, 0.0], [1.0, 0.5], [0.2, 0.3]], np.float32)
    commands = np.array([[-2.5, 0.1], [-8.0, 0.5], [np.nan, np.nan]])
    executed = executed_actions(kind, handed, np.zeros(3, bool), commands)
    np.testing.assert_allclose(executed, [[-0.5, 0.2], [-1.0, 1.0], [0.2, 0.3]], atol=1e-7)
    assert executed.dtype == np.float32


def test_of_discretised_actions_the_nearest_counts():
    kind = DiscreteAction(None, acceleration_range=(-5.0, 5.0), steering_range=(-0.5, 0.5))
    # a grid of three by three: 0 = (-1, -1), 1 = (-1, 0), ...
    executed = executed_actions(kind, np.array([8, 8]), np.zeros(2, bool), np.array([[-4.0, 0.1], [np.nan, np.nan]]))
    assert executed.tolist() == [1, 8]
