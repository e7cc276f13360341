"""What simulators do to road users that no driver does: nobody may become the ego's fault by it, and nothing may break.

Where a car appears out of nothing or jumps, no braking helps; a verdict is then the other's or nobody's (inherited):
never the ego's, and never missing.
"""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.shield.params import PRESETS, RSSParams, Rules, Table

CROWD = {"vehicles_count": 8, "vehicles_density": 1.5, "lanes_count": 3, "duration": 15}
GUILTY = ("ego", "both", "none")


def episode(fault=None, seed=0, config=None, env_id="highway-fast-v0", mode="override", **options):
    """Play one episode with random actions, a fault before each decision; returns the last info."""
    env = make(env_id, mode, config=CROWD | (config or {}), **options)
    env.reset(seed=seed)
    rng, done, info = np.random.default_rng(seed), False, {}
    while not done:
        if fault is not None:
            fault(env.unwrapped, rng)
        _, reward, terminated, truncated, info = env.step(int(rng.integers(env.action_space.n)))
        assert np.isfinite(reward)
        done = terminated or truncated
    return info


def somebody(env, rng):
    others = [vehicle for vehicle in env.road.vehicles if vehicle is not env.vehicle]
    return others[rng.integers(len(others))] if others else None


def vanish(env, rng):
    gone = somebody(env, rng)
    env.road.vehicles = [vehicle for vehicle in env.road.vehicles if vehicle is not gone]


def teleport(env, rng):
    jumper = somebody(env, rng)
    lane = env.road.network.get_lane(env.vehicle.lane_index)
    s = lane.local_coordinates(env.vehicle.position)[0] + rng.choice([-1.0, 1.0]) * rng.uniform(8.0, 60.0)
    jumper.position, jumper.heading = lane.position(s, 0.0), lane.heading_at(s)
    jumper.speed = rng.uniform(0.0, 35.0)


def spawn_too_near(env, rng):
    lane = env.road.network.get_lane(env.vehicle.lane_index)
    s = lane.local_coordinates(env.vehicle.position)[0] + rng.choice([-1.0, 1.0]) * rng.uniform(7.0, 15.0)
    env.road.vehicles.append(IDMVehicle(env.road, lane.position(s, 0.0), lane.heading_at(s), rng.uniform(0.0, 30.0)))


def replaced(env, rng):
    """Another object in the place of somebody, as simulators that rebuild their lists have it."""
    old = somebody(env, rng)
    new = IDMVehicle(env.road, old.position.copy(), old.heading, old.speed)
    env.road.vehicles = [new if vehicle is old else vehicle for vehicle in env.road.vehicles]


def reverses(env, rng):
    somebody(env, rng).speed = -rng.uniform(0.5, 8.0)


def stands(env, rng):
    somebody(env, rng).speed = 0.0


def shuffled(env, rng):
    env.road.vehicles = [env.road.vehicles[i] for i in rng.permutation(len(env.road.vehicles))]


FAULTS = [vanish, teleport, spawn_too_near, replaced, reverses, stands, shuffled]


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.__name__ for fault in FAULTS])
def test_whatever_befalls_the_others_the_ego_is_not_to_blame(fault):
    for seed in range(4):
        info = episode(fault, seed)
        assert info["blame"] not in GUILTY, (seed, info["blame_evidence"])
        assert info["episode_broken_duties"] == 0


def test_an_unshielded_ego_is_to_blame_among_the_same():
    assert "ego" in {episode(shuffled, seed, mode="monitor")["blame"] for seed in range(6)}


@pytest.mark.parametrize(
    "size", [(2.2, 0.8), (5.0, 2.0), (8.0, 2.5), (18.0, 2.6)], ids=["motorcycle", "car", "van", "truck"]
)
def test_others_may_have_any_size(size):
    def sized(env, rng):
        for vehicle in env.road.vehicles:
            if vehicle is not env.vehicle:
                vehicle.LENGTH, vehicle.WIDTH = size
                vehicle.diagonal = float(np.hypot(*size))

    for seed in range(3):
        info = episode(sized, seed)
        assert info["blame"] not in GUILTY and info["episode_broken_duties"] == 0


@pytest.mark.parametrize("lanes", [1, 8])
@pytest.mark.parametrize("count", [0, 1, 30])
def test_few_and_many_lanes_and_cars(lanes, count):
    for seed in range(2):
        info = episode(None, seed, {"lanes_count": lanes, "vehicles_count": count, "duration": 8})
        assert info["blame"] not in GUILTY and info["episode_broken_duties"] == 0


def test_two_hundred_cars():
    info = episode(None, 0, {"vehicles_count": 200, "lanes_count": 8, "duration": 1})
    assert info["blame"] not in GUILTY and info["episode_broken_duties"] == 0


@pytest.mark.parametrize("frequency", [5, 8, 12, 30])
def test_frames_from_a_fifth_to_a_thirtieth_of_a_second(frequency):
    for seed in range(3):
        info = episode(None, seed, {"simulation_frequency": frequency, "policy_frequency": 1})
        assert info["blame"] not in GUILTY and info["episode_broken_duties"] == 0


# ---------------------------------------------------------------- closed rings


def ring(pieces, radius):
    """A ring of one lane in so many arcs."""
    network, nodes = RoadNetwork(), [f"n{i}" for i in range(pieces)]
    for i in range(pieces):
        angles = 2 * np.pi * i / pieces, 2 * np.pi * (i + 1) / pieces
        network.add_lane(nodes[i], nodes[(i + 1) % pieces], CircularLane([0, 0], radius, *angles, speed_limit=30))
    return network


@pytest.mark.parametrize("pieces", [2, 3, 5, 8, 12])
@pytest.mark.parametrize("others", [1, 3])
def test_on_closed_rings_nobody_is_hit_that_is_ahead_and_behind_at_once(pieces, others):
    road, dt = Road(ring(pieces, 40.0), np_random=np.random.RandomState(0)), 1 / 15
    ego = MDPVehicle.make_on_lane(road, ("n0", f"n{1 % pieces}", 0), 5.0, speed=12.0)
    ego.target_speeds, road.vehicles = np.array([10.0, 15.0, 20.0]), [ego]
    ego.index_to_speed(2)
    lane_length = 2 * np.pi * 40.0
    for k in range(others):
        s = lane_length * (k + 1) / (others + 1)
        angle = s / 40.0
        position = 40.0 * np.array([np.cos(angle), np.sin(angle)])
        road.vehicles.append(IDMVehicle(road, position, angle + np.pi / 2, 8.0, target_speed=6.0))
    table = Table(PRESETS["simulator"].ego, PRESETS["simulator"].other, Rules(), dt)
    shield = ShieldedEgo(ego, Settings(table, True))
    overridden = 0
    for frame in range(150):
        if frame % 15 == 0:
            ego.act("FASTER")
        road.act()
        road.step(dt)
        overridden += shield.look.overridden or shield.look.anticipated
    assert not any(vehicle.crashed for vehicle in road.vehicles)
    assert shield.since["broken_duties"] == 0
    assert overridden > 0  # it did hold the ego back


# ---------------------------------------------------------------- commands and parameters


@pytest.mark.parametrize("command", [np.nan, np.inf, -np.inf])
def test_a_command_that_is_no_number_is_refused_before_anybody_moves(command):
    env = make("highway-fast-v0", config=CROWD | {"action": {"type": "ContinuousAction"}})
    env.reset(seed=0)
    before = [vehicle.position.copy() for vehicle in env.unwrapped.road.vehicles]
    with pytest.raises(ValueError, match="action"):
        env.step(np.array([command, 0.0]))
    assert all((a.position == b).all() for a, b in zip(env.unwrapped.road.vehicles, before, strict=True))


EDGES = {
    "nobody ever accelerates": dict(a_max_accel=0.0),
    "nor moves sideways": dict(a_lat_max_accel=0.0),
    "hardly any braking": dict(a_min_brake=0.1, a_min_brake_correct=0.1),
    "the same braking for all": dict(a_min_brake=6.0, a_min_brake_correct=6.0, a_max_brake=6.0),
    "braking like a wall": dict(a_min_brake=1000.0, a_max_brake=1000.0, a_min_brake_correct=1000.0),
    "no room at all": dict(mu=0.0, standstill_gap=0.0),
    "much room": dict(mu=3.0, standstill_gap=50.0),
    "ten seconds to respond": dict(response_time=10.0),
    "one frame": dict(response_time=0.2),
    "a crawl": dict(v_cap=0.01),
    "no cap": dict(v_cap=np.inf),
    "sideways hardly stoppable": dict(a_lat_min_brake=0.01),
}


@pytest.mark.parametrize("changes", EDGES.values(), ids=EDGES.keys())
def test_parameters_at_the_ends_of_their_ranges(changes):
    ego, other = PRESETS["simulator"][:2]
    sides = ego._replace(response_time=0.2), other  # a frame
    params = tuple(RSSParams.validated(**{**side._asdict(), **changes}) for side in sides)
    for seed in range(2):
        info = episode(None, seed, params=params)
        assert info["blame"] not in GUILTY
        assert info["episode_broken_duties"] == 0
        assert np.isfinite([info["min_ttc"], info["override_share"]]).all()


# ---------------------------------------------------------------- standing starts


@pytest.mark.parametrize("gap", [0.5, 2.0, 10.0])
def test_a_standing_start_nose_to_tail(gap):
    network, dt = RoadNetwork(), 1 / 15
    network.add_lane("a", "b", StraightLane([0, 0], [1000, 0]))
    road = Road(network, np_random=np.random.RandomState(0))
    ego = MDPVehicle.make_on_lane(road, ("a", "b", 0), 100.0, speed=0.0)
    leader = Vehicle.make_on_lane(road, ("a", "b", 0), 105.0 + gap, speed=0.0)
    follower = IDMVehicle.make_on_lane(road, ("a", "b", 0), 95.0 - gap, speed=0.0)
    road.vehicles = [ego, leader, follower]
    shield = ShieldedEgo(ego, Settings(Table(*PRESETS["simulator"][:2], Rules(), dt), True))
    for frame in range(120):
        if frame % 15 == 0:
            ego.act("FASTER")
        road.act()
        road.step(dt)
    assert not any(vehicle.crashed for vehicle in road.vehicles)
    assert shield.since["broken_duties"] == 0
    assert ego.position[0] < leader.position[0] - 5.0
