"""Continuous actions at an intersection: the ego keeps to the route that it has declared."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.free_ego import FreeEgo, _is_on_route, declared_route
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.roads.bicycle import lane_keeping

ALONE = {"initial_vehicle_count": 1, "spawn_probability": 0.0}
DYNAMICAL = ("intersection-v1", {})
KINEMATIC = ("intersection-v0", {"action": {"type": "ContinuousAction"}})
FULL_LEFT, AHEAD = np.array([1.0, -1.0]), np.array([1.0, 0.0])


def make_free(kind, shield="override", **config):
    env_id, more = kind
    return make(env_id, shield=shield, intent="known", config=more | config)


class Watch:
    """Every frame of an episode: was the ego on its route?"""

    def __init__(self, env):
        self.on_route = []
        ego = env._ego
        restrict = ego._restrict

        def watched(scene, *rest, **options):
            lanes, way, k = ego._way()
            self.on_route.append(_is_on_route(scene, lanes[way[k]], way[k], ego._state()))
            return restrict(scene, *rest, **options)

        ego._restrict = watched


def play(env, policy, seed, decisions):
    env.reset(seed=seed)
    watch = Watch(env)
    for _ in range(decisions):
        *_, terminated, truncated, info = env.step(policy(env))
        if terminated or truncated:
            break
    return watch, info


def driver(env):
    """An agent that can steer: it follows its route at 9 m/s."""
    ego, vehicle = env._ego, env.unwrapped.vehicle
    top = env.unwrapped.action_type.steering_range[1]
    if ego.path < 0:
        return np.zeros(2, np.float32)
    ego._declared(vehicle)
    lanes, way, k = ego._way()
    acceleration = np.clip((9.0 - vehicle.speed) / ego.settings.table.dt, -5.0, 5.0)
    steering = lane_keeping(lanes[way[k]], ego._state(), acceleration, ego.dynamical, ego.settings.table.dt)
    return np.clip([acceleration / 5.0, steering / top], -1.0, 1.0).astype(np.float32)


@pytest.mark.parametrize("kind", [DYNAMICAL, KINEMATIC], ids=["dynamical", "kinematic"])
@pytest.mark.parametrize("action", [FULL_LEFT, AHEAD], ids=["full left", "straight on"])
def test_the_ego_stays_on_its_route_whatever_the_agent_steers(kind, action):
    watch, info = play(make_free(kind), lambda _: action, 0, 13)
    assert len(watch.on_route) > 60
    assert all(watch.on_route)
    assert info["blame"] == ""
    assert info["episode_broken_duties"] == 0
    assert info["shield"]["steering_change"] > 0.0


@pytest.mark.parametrize("kind", [DYNAMICAL, KINEMATIC], ids=["dynamical", "kinematic"])
def test_who_leaves_the_route_unshielded_breaks_its_duty_and_is_to_blame(kind):
    env = make_free(kind, "monitor", **ALONE)
    watch, info = play(env, lambda _: FULL_LEFT, 0, 3)
    assert not watch.on_route[-1]
    assert env._ego.astray
    assert info["cost"] == 1.0
    assert info["episode_broken_duties"] > 0


def test_a_monitor_changes_nothing():
    monitored, bare = make_free(DYNAMICAL, "monitor"), make("intersection-v1", shield=None)
    for env in (monitored, bare):
        env.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(4):
        action = rng.uniform(-1.0, 1.0, 2)
        monitored.step(action)
        bare.step(action)
        poses = [(*v.position, v.heading, v.speed) for v in (monitored.unwrapped.vehicle, bare.unwrapped.vehicle)]
        assert poses[0] == poses[1]


def test_an_agent_that_can_steer_is_left_alone_and_arrives():
    env = make_free(DYNAMICAL, policy_frequency=15, duration=25, **ALONE)
    watch, info = play(env, driver, 3, 25 * 15)
    assert info["is_success"]
    assert all(watch.on_route)


@pytest.mark.parametrize("seed", range(3))
def test_an_ego_that_was_parked_by_a_bad_agent_can_start_again(seed):
    """It may not be brought to a stand across its lane, from where no steering leads back."""
    env = make_free(DYNAMICAL, policy_frequency=15, duration=30, **ALONE)
    rng = np.random.default_rng(seed)

    def parks_then_drives(env):
        if env.unwrapped.time < 6.0:
            creep = np.clip((2.0 - env.unwrapped.vehicle.speed) / 5.0, -1.0, 1.0)
            return np.array([creep, rng.uniform(-1.0, 1.0)], np.float32)
        return driver(env)

    watch, info = play(env, parks_then_drives, seed, 30 * 15)
    assert info["is_success"]
    assert all(watch.on_route)


def test_the_route_leads_from_the_lane_of_the_ego_to_the_destination():
    env = make_free(DYNAMICAL, destination="o3")
    env.reset(seed=0)
    assert isinstance(env._ego, FreeEgo)
    assert env._ego.route == [("o0", "ir0", 0), ("ir0", "il3", 0), ("il3", "o3", 0)]
    with pytest.raises(ValueError, match="destination = 'o0': expected a node that a car from 'o0' can drive to"):
        declared_route(env._ego.junction.walks, ("o0", "ir0", 0), "o0")
    meta = make("intersection-v0")
    meta.reset(seed=0)
    assert type(meta._ego) is JunctionEgo


@pytest.mark.parametrize(
    ("env_id", "config", "message"),
    [
        ("intersection-v1", {"destination": None}, r"destination = None: expected a node such as 'o1'"),
        (
            "intersection-v1",
            {"destination": "o9"},
            r"destination = 'o9': expected a node that a car from 'o0'",
        ),
        (
            "highway-v0",
            {"action": {"type": "ContinuousAction", "dynamical": True}},
            r"dynamical = True with config simulation_frequency = 15: expected >= 56 along lanes",
        ),
        (
            "highway-fast-v0",
            {"action": {"type": "ContinuousAction", "speed_range": [5, 30]}},
            r"speed_range starts at 5 m/s: expected <= 0",
        ),
    ],
)
def test_what_cannot_be_kept_safe_is_refused(env_id, config, message):
    with pytest.raises(ValueError, match=message):
        make(env_id, config=config)
