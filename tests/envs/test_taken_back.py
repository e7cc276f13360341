"""A lane change that somebody alongside blocks is taken back, and the agent is told."""

import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make
from rss_shield.shield.lanes.lane_changes import is_blocked, room_beside
from rss_shield.shield.params import PRESETS, Rules

LEFT, IDLE, RIGHT = 0, 1, 2


def beside(speed=25.0, ahead=0.0, lanes=3, rules=Rules(), config=None, arrives_at=None):
    """An ego in the middle lane and one car to its right."""
    env = make("highway-fast-v0", config={"vehicles_count": 1, "lanes_count": lanes, **(config or {})}, rules=rules)
    env.reset(seed=0)
    base = env.unwrapped
    ego = base.vehicle
    ego.position = np.array([200.0, 4.0])
    ego.lane_index = ego.target_lane_index = ("0", "1", 1)
    ego.lane = base.road.network.get_lane(ego.lane_index)
    ego.speed = ego.target_speed = 25.0
    base.road.vehicles[:] = [ego, Vehicle(base.road, [200.0 + ahead, 8.0], 0.0, speed)]
    return env, ego


def farthest(env, ego, actions):
    """Largest offset from the middle lane [m], and in which decisions a change was refused."""
    worst, refused = 0.0, []
    for action in actions:
        *_, info = env.step(action)
        worst = max(worst, abs(ego.position[1] - 4.0))
        refused.append(info["shield"]["lane_change_refused"])
    assert info["blame"] == "" and info["episode_broken_duties"] == 0
    return worst, refused


@pytest.mark.parametrize("ahead", [0.0, 3.0, -3.0])
def test_next_to_somebody_a_lane_change_does_not_begin(ahead):
    env, ego = beside(ahead=ahead)
    worst, refused = farthest(env, ego, [IDLE, RIGHT, IDLE, RIGHT, RIGHT, IDLE])
    assert worst < 0.5
    assert refused == [False, True, False, True, True, False]
    assert ego.target_lane_index[2] == 1


def test_the_other_side_is_free():
    env, ego = beside()
    _, refused = farthest(env, ego, [IDLE, LEFT, IDLE, IDLE])
    assert not any(refused) and ego.lane_index[2] == 0


def test_without_the_rule_it_goes_as_far_as_it_may():
    env, ego = beside(rules=Rules(take_back=False))
    worst, refused = farthest(env, ego, [IDLE, RIGHT, IDLE, IDLE, IDLE])
    assert worst > 0.25 and not any(refused)
    assert ego.target_lane_index[2] == 2


def test_a_change_that_was_begun_is_taken_back_when_somebody_comes_up():
    env, ego = beside(speed=38.0, ahead=-21.0)
    worst, refused = farthest(env, ego, [RIGHT, IDLE])
    assert any(refused) and worst < 2.0
    worst, _ = farthest(env, ego, [IDLE] * 4)
    assert abs(ego.position[1] - 4.0) < 0.6


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_steers_freely_between_two_lanes_is_led_back(side):
    config = {"action": {"type": "ContinuousAction"}}
    off = []
    for rules in (Rules(), Rules(take_back=False)):
        env, ego = beside(config=config, rules=rules)
        env.unwrapped.road.vehicles[1].position = np.array([200.0, 4.0 + side * 5.3])
        ego.position = np.array([200.0, 4.0 + side * 1.5])
        for _ in range(12):
            *_, info = env.step(np.array([0.0, 0.02 * side], np.float32))
        assert info["blame"] == ""
        off.append(abs(ego.position[1] - 4.0))
    assert off[0] < 1.2 < off[1]


@pytest.mark.parametrize("first", [LEFT, RIGHT])
def test_a_change_half_done_is_completed(first):
    env, ego = beside()
    env.unwrapped.road.vehicles[1].position = np.array([20.0, 4.0])  # out of the way
    refused, off = [], []
    for action in (first, IDLE, LEFT + RIGHT - first, IDLE, IDLE):
        *_, info = env.step(action)
        refused.append(info["shield"]["lane_change_refused"])
        off.append(abs(ego.position[1] - 4.0))
    assert 1.0 < off[1] < 3.0 and refused == [False, False, True, False, False]
    assert off[-1] > 3.5


def test_room_beside_by_hand():
    car = PRESETS["slides"].ego._replace(response_time=1.0, a_lat_max_accel=1.0, a_lat_min_brake=2.0)
    # 0.5 m/s: 0.5 * (1 + 0.1) + 1.5^2 / 4 - 1^2 / 4 m were set aside for it
    assert room_beside(0.3, 0.5, car, 0.2) == pytest.approx(0.3 + 0.55 + 0.3125)
    assert room_beside(0.3, 0.0, car, 0.2) == pytest.approx(0.3)


def test_blocked_by_hand():
    assert is_blocked(-4.0, np.inf, 3.0) and not is_blocked(-4.0, 3.0, np.inf)  # the lane is to the right
    assert is_blocked(4.0, 3.0, np.inf) and not is_blocked(4.0, np.inf, 3.0)
    assert not is_blocked(0.0, 0.0, 0.0) and not is_blocked(0.3, 0.25, 0.25)
