"""Car parks: highway-env's own and the one that several cars share, behind the shield of open space."""

import copy
import math

import gymnasium as gym
import numpy as np
import pytest
from highway_env.road.road import RoadNetwork

from rss_shield import make
from rss_shield.envs.highway.open_ego import OpenSpaceEgo
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.highway.step import shield_on
from rss_shield.envs.worlds.parker import is_parked
from rss_shield.envs.worlds.parking import ENV_ID, ParkerPolicy, Pedestrian
from rss_shield.shield.open_space.frames import CAR, FIXED, PEDESTRIAN
from rss_shield.shield.verdicts import AT_FAULT

STOCK = ("parking-v0", "parking-parked-v0", "parking-ActionRepeat-v0")


def drive(env, act, seed=0, steps=1000):
    """Play an episode; infos of every step."""
    observation, info = env.reset(seed=seed)
    infos, ended = [info], False
    while not ended and len(infos) <= steps:
        observation, _, terminated, truncated, info = env.step(act(observation))
        infos.append(info)
        ended = terminated or truncated
    return infos


def wild(rng, agents):
    """Full throttle, forward or back, with random steering."""
    gears = rng.choice([-1.0, 1.0], agents)

    def act(_):
        gears[rng.random(agents) < 0.05] *= -1.0
        actions = tuple(np.array([gear, rng.uniform(-1.0, 1.0)], np.float32) for gear in gears)
        return actions if agents > 1 else actions[0]

    return act


def shared(shield="override", seconds=15, **config):
    return make(ENV_ID, shield, config={"duration": seconds, "controlled_vehicles": 3, **config})


# ---------------------------------------------------------------- highway-env's own


@pytest.mark.parametrize("env_id", STOCK)
def test_highway_envs_car_parks_get_the_shield(env_id):
    env = make(env_id)
    assert set(env.observation_space.spaces) == {"observation", "achieved_goal", "desired_goal"}
    infos = drive(env, wild(np.random.default_rng(0), 1), steps=12)
    assert isinstance(shield_on(env.unwrapped.vehicle), OpenSpaceEgo)
    assert infos[-1]["blame"] == "" and not env.unwrapped.vehicle.crashed
    assert {"cost", "is_success", "episode_dangerous_pairs", "rms_jerk", "min_ttc", "raw_reward"} <= set(infos[-1])
    executed = infos[-1]["shield"]["executed_action"]
    assert executed.shape == (2,) and env.action_space.contains(executed)
    env.close()


def test_without_the_shield_the_wall_is_hit_and_with_it_it_is_not():
    contacts = {}
    for shield in ("override", "monitor"):
        env = make("parking-v0", shield, config={"duration": 20})
        contacts[shield] = [drive(env, wild(np.random.default_rng(seed), 1), seed)[-1] for seed in range(3)]
        env.close()
    assert all(info["blame"] == "" for info in contacts["override"])
    assert any(info["blame"] in AT_FAULT for info in contacts["monitor"])
    struck = next(info for info in contacts["monitor"] if info["blame"])
    assert struck["blame_evidence"]["danger"] == "both brake"
    assert struck["blame_evidence"]["ego_duty"].startswith(("accelerated harder", "braked less", "turned"))
    assert struck["episode_cost"] >= 1.0


def test_watching_changes_nothing():
    bare, watched = make("parking-v0", None), make("parking-v0", "monitor")
    rng = np.random.default_rng(3)
    bare.reset(seed=5)
    watched.reset(seed=5)
    for _ in range(30):
        action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        one, two = bare.step(action), watched.step(action)
        np.testing.assert_array_equal(one[0]["observation"], two[0]["observation"])
        assert one[1:4] == two[1:4]


def test_limits_hold_whatever_is_asked_for():
    env = make("parking-v0", config={"add_walls": False})
    env.reset(seed=0)
    speeds = []
    for _ in range(30):
        env.step(np.array([1.0, 0.0], np.float32))
        speeds.append(env.unwrapped.vehicle.speed)
    # 2.5 m/s^2 up to 5 m/s, where throttle would be 5 m/s^2
    assert speeds[0] == pytest.approx(0.5) and max(speeds) == pytest.approx(5.0)


# ---------------------------------------------------------------- shared


@pytest.mark.parametrize("agents", [2, 4])
def test_cars_at_full_throttle_never_touch_and_each_has_a_shield_of_its_own(agents):
    env = shared(controlled_vehicles=agents, vehicles_count=4)
    for seed in range(2):
        infos = drive(env, wild(np.random.default_rng(seed), agents), seed)
        shields = [shield_on(vehicle) for vehicle in env.unwrapped.controlled_vehicles]
        assert len({id(shield) for shield in shields}) == agents
        assert all(agent["blame"] == "" for agent in infos[-1]["agents"])
        assert sum(agent["episode_broken_duties"] for agent in infos[-1]["agents"]) == 0
        assert any(agent["shield"]["intervened"] for info in infos[1:] for agent in info["agents"])
    env.close()


def test_without_shields_they_do_and_somebody_is_to_blame():
    verdicts = []
    for seed in range(4):
        env = shared("monitor", add_walls=False)
        infos = drive(env, wild(np.random.default_rng(seed), 3), seed)
        verdicts += [agent["blame"] for agent in infos[-1]["agents"] if agent["blame"]]
        env.close()
    assert verdicts and "none" not in verdicts
    assert any(verdict in AT_FAULT for verdict in verdicts)


@pytest.mark.parametrize("shield", ["override", None])
def test_the_scripted_driver_parks(shield):
    env = shared(shield, seconds=60, controlled_vehicles=2)
    infos = drive(env, ParkerPolicy(env, 1), 1)
    assert infos[-1]["is_success"] == (True, True)
    assert all(is_parked(vehicle) for vehicle in env.unwrapped.controlled_vehicles)
    assert not any(vehicle.crashed for vehicle in env.unwrapped.road.vehicles)
    # what it does not say about its reward: near the goal it is better than far from it
    assert infos[-1].get("raw_reward", 0.0) > -0.2
    env.close()


def test_the_scripted_driver_parks_between_parked_cars():
    env = make("parking-v0", config={"vehicles_count": 10, "duration": 60})
    infos = drive(env, ParkerPolicy(env, 2), 2)
    assert infos[-1]["is_success"] and infos[-1]["blame"] == ""


def test_cars_wait_for_people_and_people_for_cars():
    env = shared(controlled_vehicles=2, pedestrians=8, vehicles_count=0, seconds=12)
    infos = drive(env, wild(np.random.default_rng(4), 2), 4)
    people = [vehicle for vehicle in env.unwrapped.road.vehicles if isinstance(vehicle, Pedestrian)]
    assert len(people) == 8 and max(person.speed for person in people) > 0.5
    assert all(agent["blame"] == "" for agent in infos[-1]["agents"])
    kinds = shield_on(env.unwrapped.vehicle).users["kind"][:-1]
    assert list(kinds) == [CAR] + [PEDESTRIAN] * 8 + [FIXED] * 4  # the other agent; walls


def test_the_same_seed_gives_the_same_episode():
    ends = []
    for _ in range(2):
        env = shared(pedestrians=3, seconds=4)
        drive(env, wild(np.random.default_rng(7), 3), 7)
        ends.append([tuple(vehicle.position) for vehicle in env.unwrapped.road.vehicles])
    assert ends[0] == ends[1]


def test_an_agent_sees_itself_its_place_and_the_nearest_others():
    env = shared(None, pedestrians=2)
    observations, _ = env.reset(seed=3)
    assert env.observation_space.contains(observations)
    me, *others = env.unwrapped.road.vehicles
    seen = observations[0]["observation"].reshape(-1, 6)
    assert len(seen) == 5
    np.testing.assert_allclose(seen[0, :2], me.position / 100)
    np.testing.assert_allclose(observations[0]["desired_goal"][:2], me.goal.position / 100)
    nearest = min(others, key=lambda v: np.hypot(*(v.position - me.position)))
    np.testing.assert_allclose(seen[1, :2], (nearest.position - me.position) / 100)


def test_a_copy_goes_on_alike():
    env = shared(seconds=10)
    env.reset(seed=2)
    act = wild(np.random.default_rng(2), 3)
    for _ in range(10):
        env.step(act(None))
    twin = copy.deepcopy(env)
    actions = [act(None) for _ in range(15)]
    ends = [[one.step(action)[4]["agents"] for action in actions][-1] for one in (env, twin)]
    assert [agent["override_share"] for agent in ends[0]] == [agent["override_share"] for agent in ends[1]]
    assert all(np.array_equal(a.position, b.position) for a, b in zip(
        env.unwrapped.road.vehicles, twin.unwrapped.road.vehicles, strict=True))  # fmt: skip


def test_places_are_found_as_highway_env_finds_them():
    env = shared(None)
    env.reset(seed=0)
    network, rng = env.unwrapped.road.network, np.random.default_rng(0)
    for _ in range(200):
        place, heading = rng.uniform(-30.0, 30.0, 2), rng.uniform(-7.0, 7.0)
        for given in (heading, None):
            expected = RoadNetwork.get_closest_lane_index(network, place, given)
            assert network.get_closest_lane_index(place, given) == expected


def test_contacts_are_found_as_highway_env_finds_them():
    rng = np.random.default_rng(8)
    env = shared(None, controlled_vehicles=4, vehicles_count=10)
    kind, found = None, 0
    for seed in range(40):
        env.reset(seed=seed)
        road = env.unwrapped.road
        kind = kind or type(road).__mro__[1]
        for vehicle in road.vehicles[:4]:
            vehicle.position = rng.uniform([-33.0, -19.0], [33.0, 19.0])
            vehicle.heading, vehicle.speed = rng.uniform(-3.0, 3.0), rng.uniform(-5.0, 5.0)
        twin = copy.deepcopy(road)
        road.step(1 / 15)
        kind.step(twin, 1 / 15)
        flags = [[(v.crashed, v.impact is None) for v in one.vehicles] for one in (road, twin)]
        assert flags[0] == flags[1]
        found += any(crashed or not free for crashed, free in flags[0])
    assert found > 10


# ---------------------------------------------------------------- around it


def test_an_episode_can_be_recorded():
    env = shared(seconds=4, pedestrians=1)
    trace = record_trace(env, wild(np.random.default_rng(1), 3), seed=1)
    assert len(trace.egos) == 3 and trace.meta["scheme"] == "open space"
    assert len(trace.time) == 61 and math.isfinite(trace.users.x[:, 0].sum())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"filter": "ttc"}, "filter = 'ttc': expected 'rss' where cars are parked"),
        ({"correction": "response"}, "correction = 'response': expected 'nearest' where cars are parked"),
        ({"traffic": "compliant"}, "traffic = 'compliant': expected 'stock' where cars are parked"),
        ({"params": {"ego": {"a_max_accel": 9.0}}}, "a_max_accel = 9 of the ego is not within"),
        ({"config": {"action": {"type": "DiscreteMetaAction"}}}, "DiscreteMetaAction is not supported"),
        ({"config": {"action": {"type": "ContinuousAction", "steering_range": [-1.0, 1.0]}}}, "steering_range"),
        ({"config": {"action": {"type": "ContinuousAction", "dynamical": True}}}, "dynamical = True"),
    ],
)
def test_what_makes_no_sense_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        make("parking-v0", **options)


@pytest.mark.parametrize(("name", "value"), [("controlled_vehicles", 7), ("pedestrians", -1), ("vehicles_count", 2.5)])
def test_a_bad_configuration_is_refused(name, value):
    with pytest.raises(ValueError, match=f"config {name} = {value}: expected a whole number"):
        gym.make(ENV_ID, config={name: value})


def test_an_audit_says_where_there_is_none():
    env = make("parking-v0", record=True)
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    with pytest.raises(ValueError, match="cars are parked"):
        env.audit()
