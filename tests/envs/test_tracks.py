"""Racetracks, lane keeping, and continuous actions on roundabouts and at lights, behind the shield."""

import numpy as np
import pytest

from bench.environments import AGENTS, BUSY, TRACK, Case, along_lane, play
from rss_shield import make
from rss_shield.envs.highway.free_ego import FreeEgo
from rss_shield.envs.stock import make_stock

GOOD = ("", "other", "inherited")
CONTINUOUS = {"action": {"type": "ContinuousAction"}}
SHORT = TRACK | BUSY | {"duration": 6}


@pytest.mark.parametrize("env_id", ["racetrack-v0", "racetrack-large-v1", "racetrack-oval-v0"])
@pytest.mark.parametrize("policy", ["random", "fast"])
def test_on_a_racetrack_the_ego_keeps_its_duties_and_is_never_to_blame(env_id, policy):
    for seed in (0, 1):
        episode = play(Case(env_id, SHORT), policy, "override", seed)
        assert episode["blame"] in GOOD and episode["broken_duties"] == 0


def test_without_the_shield_an_agent_that_only_steers_drives_into_who_is_ahead():
    blame = [play(Case("racetrack-v0", TRACK | {"duration": 30}), "fast", "monitor", seed)["blame"] for seed in (0, 1)]
    assert "ego" in blame or "both" in blame


def test_obstacles_on_a_track_are_stopped_for():
    blocked = SHORT | {"block_lane": True, "force_decision": True, "other_vehicles": 0, "duration": 12}
    env = make("racetrack-oval-v0", config=blocked)
    for seed in range(20):
        env.reset(seed=seed)
        kind, vehicle = env.unwrapped.action_type, env.unwrapped.vehicle
        if vehicle.lane_index[2] == 1 and vehicle.position[0] < 30.0:
            break
    for _ in range(60):
        *_, terminated, truncated, info = env.step([np.clip(along_lane(vehicle) / kind.steering_range[1], -1, 1)])
        if terminated or truncated:
            break
    assert info["blame"] == "" and info["episode_broken_duties"] == 0
    first = min(o.position[0] for o in env.unwrapped.road.objects if abs(o.position[1] - 5.0) < 2.0)
    assert vehicle.speed < 0.01 and 3.5 < first - vehicle.position[0] < 8.0


def test_the_shield_brakes_for_an_agent_that_only_steers_and_gives_its_speed_back():
    """The one ahead drives slowly, and then at 10 m/s again: so does the ego, whose agent asks for no acceleration."""
    env = make("racetrack-oval-v0", config=TRACK | {"other_vehicles": 0, "duration": 60}, record=True)
    env.reset(seed=0)
    base = env.unwrapped
    ego = base.vehicle
    assert ego.speed == 10.0
    leader = type(ego)(base.road, ego.lane.position(ego.lane.local_coordinates(ego.position)[0] + 30.0, 0.0), 0.0, 3.0)
    base.road.vehicles.append(leader)
    speeds = []
    for step in range(70):
        for car in (leader,):  # along its lane; slowly, later away
            car.action = {"steering": along_lane(car), "acceleration": 2.0 if step > 30 and car.speed < 12.0 else 0.0}
        steering = np.clip(along_lane(ego) / base.action_type.steering_range[1], -1, 1)
        *_, terminated, truncated, info = env.step([steering])
        speeds.append(ego.speed)
        if terminated or truncated:
            break
    assert info["blame"] == "" and info["episode_broken_duties"] == 0
    assert min(speeds) < 5.0, "the shield has braked"
    assert speeds[-1] > 9.0, "and given the speed back"
    assert max(speeds) <= 10.0 + 1e-9


def test_watched_only_an_agent_that_steers_drives_as_without_a_shield():
    bare, watched = make_stock("racetrack-v0", config=SHORT), make("racetrack-v0", "monitor", config=SHORT)
    first, _ = bare.reset(seed=4)
    second, _ = watched.reset(seed=4)
    for _ in range(20):
        assert np.array_equal(first, second)
        first, reward, *ended, _ = bare.step([0.02])
        second, watched_reward, *ended_too, _ = watched.step([0.02])
        assert reward == watched_reward and ended == ended_too
        if any(ended):
            break


def test_lane_keeping_is_left_as_it_is_because_nobody_else_is_there():
    bare, shielded = make_stock("lane-keeping-v0"), make("lane-keeping-v0")
    first, _ = bare.reset(seed=1)
    second, _ = shielded.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert all(np.array_equal(first[name], second[name]) for name in first)
        action = rng.uniform(-1.0, 1.0, 1)
        first, reward, *_ = bare.step(action)
        second, with_shield, *_, info = shielded.step(action)
        assert reward == with_shield and not info["shield"]["intervened"] and info["episode_dangerous_pairs"] == 0
    shielded.unwrapped.road.vehicles.append(type(shielded.unwrapped.vehicle)(shielded.unwrapped.road, [0.0, 0.0]))
    with pytest.raises(ValueError, match="dynamical = True with config simulation_frequency = 10: expected >= 56"):
        shielded.step(action)


@pytest.mark.parametrize("env_id", ["roundabout-v0", "signalised-intersection-v0"])
def test_with_continuous_actions_the_ego_keeps_to_its_route_there(env_id):
    for policy in ("random", "fast"):
        episode = play(Case(env_id, CONTINUOUS | {"duration": 8}), policy, "override", 0)
        assert episode["blame"] in GOOD and episode["broken_duties"] == 0
        assert episode["override_share"] < 1.0


def test_on_a_roundabout_the_route_is_declared():
    for config, end in ((CONTINUOUS, "nxs"), (CONTINUOUS | {"destination": "exr"}, "exr")):
        env = make("roundabout-v0", config=config)
        env.reset(seed=0)
        assert isinstance(env._ego, FreeEgo)
        assert end in {lane[1] for lane in env._ego.route}
    with pytest.raises(ValueError, match="destination = 'nowhere': expected a node that a car from"):
        make("roundabout-v0", config=CONTINUOUS | {"destination": "nowhere"})


@pytest.mark.parametrize("env_id", ["merge-v0", "roundabout-v0"])
def test_rewards_there_count_no_lane_change_of_throttle_and_steering(env_id):
    env = make_stock(env_id, config=CONTINUOUS)
    env.reset(seed=0)
    *_, info = env.step(np.zeros(2))
    assert info["rewards"]["lane_change_reward"] == 0.0
    meta = make_stock(env_id)
    meta.reset(seed=0)
    assert [meta.unwrapped._rewards(action)["lane_change_reward"] for action in range(3)] == [True, False, True]


@pytest.mark.parametrize("env_id", ["highway-v0", "merge-v0", "racetrack-v0"])
def test_several_agents_share_a_road_as_tuples(env_id):
    config = AGENTS | {"duration": 5, "vehicles_count": 10}
    if env_id == "racetrack-v0":
        config = SHORT | {"controlled_vehicles": 3, "observation": AGENTS["observation"]}
        config |= {"action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}}}
    env = make(env_id, config=config)
    observations, info = env.reset(seed=0)
    assert len(observations) == len(info["agents"]) == 3
    episode = play(Case(env_id, config), "random", "override", 0)
    assert episode["blame"] in GOOD and episode["broken_duties"] == 0
