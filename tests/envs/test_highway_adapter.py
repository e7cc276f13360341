"""The only reader of highway-env's internals, on roads built by hand."""

import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Obstacle

from rss_shield import PRESETS, Rules, make
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.lanes import road_through
from rss_shield.shield.definitions.response import LAT, LON
from rss_shield.shield.geometry import locate
from rss_shield.shield.params import Table

DT = 1 / 15
TABLE = PRESETS["simulator"]


def straight_road(lanes=2):
    return Road(RoadNetwork.straight_road_network(lanes, speed_limit=30), np_random=np.random.default_rng(0))


def shielded(road, x=0.0, lane=0, speed=25.0, overrides=True, rules=Rules(anticipation=0.0, take_back=False)):
    vehicle = MDPVehicle(road, [x, 4.0 * lane], heading=0.0, speed=speed)
    road.vehicles.append(vehicle)
    return ShieldedEgo(vehicle, Settings(Table(TABLE.ego, TABLE.other, rules, DT), overrides), record=True)


def drive(road, frames):
    for _ in range(frames):
        road.act()
        road.step(DT)


def test_an_ego_behind_a_slow_car_brakes_at_its_guaranteed_rate_and_stays_behind():
    road = straight_road(lanes=1)
    ego = shielded(road)
    leader = Vehicle(road, [80.0, 0.0], speed=5.0)  # d_min is about 60 m from centre to centre
    road.vehicles.append(leader)
    drive(road, 60)
    accelerations = np.array([frame.command.acceleration for frame in ego.record])
    assert (accelerations == -TABLE.ego.a_min_brake).any()
    assert accelerations.min() == -TABLE.ego.a_min_brake
    assert leader.position[0] - ego.vehicle.position[0] > 5.0
    assert not ego.has_contact


def test_a_car_in_the_next_lane_is_no_reason_to_brake_but_blocks_the_lane_change():
    road = straight_road()
    ego = shielded(road)
    road.vehicles.append(Vehicle(road, [1.0, 4.0], speed=25.0))
    ego.act("LANE_RIGHT")
    drive(road, 60)
    assert all(frame.command.acceleration > -1.0 for frame in ego.record)
    assert 0.0 < ego.vehicle.position[1] < 2.0
    assert not ego.has_contact
    assert ego.since["frames_overridden"] > 0


def test_a_free_lane_change_goes_through_at_the_lateral_limit():
    road = straight_road()
    ego = shielded(road)
    ego.act("LANE_RIGHT")
    drive(road, 75)  # 5 s
    assert ego.vehicle.position[1] == pytest.approx(4.0, abs=0.1)
    assert ego.since["frames_overridden"] == 0
    lateral = np.diff([frame.poses[-1, 1] for frame in ego.record]) / DT
    assert np.diff(np.abs(lateral)).max() <= TABLE.ego.a_lat_max_accel * DT + 1e-9


def test_an_obstacle_on_the_road_is_somebody_to_stop_for():
    road = straight_road(lanes=1)
    ego = shielded(road)
    road.objects.append(Obstacle(road, [90.0, 0.0]))
    drive(road, 150)
    assert ego.vehicle.speed == 0.0
    assert not ego.has_contact
    gap = 90.0 - 1.0 - (ego.vehicle.position[0] + 2.5)
    assert 1.0 <= gap < 2.0  # the standstill gap and a little


def test_a_predicted_contact_is_judged_before_the_impact_moves_anybody():
    road = straight_road(lanes=1)
    ego = shielded(road, overrides=False)
    wall = Obstacle(road, [30.0, 0.0])
    road.objects.append(wall)
    before = None
    while not ego.has_contact:
        before = ego.vehicle.position.copy()
        drive(road, 1)
        ego.check_contact()
    assert ego.blame in ("ego", "inherited")
    assert ego.vehicle.impact is not None or ego.vehicle.crashed
    assert np.allclose(ego.vehicle.position - before, [25.0 * DT, 0.0], atol=0.3)


def test_the_memory_of_a_pair_follows_the_vehicle_not_its_place_in_the_list():
    road = straight_road()
    ego = shielded(road)
    near, far = Vehicle(road, [40.0, 4.0], speed=25.0), Vehicle(road, [300.0, 0.0], speed=25.0)
    road.vehicles += [far, near]
    drive(road, 3)
    assert list(ego.keys) == [0, 1]
    of_near = ego.memory[1].copy()
    road.vehicles.remove(far)
    drive(road, 1)
    assert list(ego.keys) == [1]
    assert ego.memory[0]["age"] == of_near["age"] + 1
    road.vehicles.append(far)
    drive(road, 1)
    assert list(ego.keys) == [1, 2]  # a car that comes back is a new one
    assert ego.memory[1]["age"] == 1


def test_both_axes_are_remembered_for_a_car_far_ahead_in_the_next_lane():
    road = straight_road()
    ego = shielded(road)
    road.vehicles.append(Vehicle(road, [200.0, 4.0], speed=25.0))
    drive(road, 1)
    assert ego.memory[0]["axes"] == LON | LAT


def test_the_road_through_a_lane_joins_straights_and_arcs():
    env = make("exit-v0", shield=None)
    env.reset(seed=0)
    network = env.unwrapped.road.network
    exit_lane = network.get_lane(("2", "exit", 0))
    road = road_through(network, ("2", "exit", 0))
    for s in (-30.0, 1.0, 10.0, 100.0):
        if s >= 0:
            x, y = exit_lane.position(s, 1.5)
            expected_heading, expected_curvature = exit_lane.heading_at(s), 1 / 150
        else:  # the straight lane that leads to the exit
            lane = network.get_lane(("1", "2", 6))
            x, y = lane.position(lane.length + s, 1.5)
            expected_heading, expected_curvature = 0.0, 0.0
        arc_length, lateral, heading, curvature = locate(road, x, y)
        assert arc_length == pytest.approx(s, abs=1e-9)
        assert lateral == pytest.approx(1.5, abs=1e-9)
        assert np.cos(heading) == pytest.approx(np.cos(expected_heading), abs=1e-9)
        assert curvature == pytest.approx(expected_curvature, abs=1e-12)


def test_the_lane_frame_of_a_merge_runs_through_all_its_segments():
    env = make("merge-v1", shield=None)
    env.reset(seed=0)
    network = env.unwrapped.road.network
    assert [len(road_through(network, index)) for index in (("a", "b", 0), ("b", "c", 0), ("c", "d", 0))] == [3, 3, 3]
    ramp = road_through(network, ("k", "b", 0))  # a sine, cut into short straights between two straight lanes
    lane = network.get_lane(("k", "b", 0))
    x, y = lane.position(40.0, 0.0)
    assert abs(locate(ramp, x, y)[1]) < 0.05


def place_ghost(road, distance, speed, kind=MDPVehicle):
    """A road user ahead of the ego, on its lane, that nobody can touch."""
    ego = road.vehicles[-1] if road.vehicles[-1].lane_index[0][0] == "o" else road.vehicles[0]
    lane = ego.lane
    s = lane.local_coordinates(ego.position)[0] + distance
    ghost = kind(road, lane.position(s, 0.0), lane.heading_at(s), speed)
    ghost.collidable, ghost.route = False, []
    (road.objects if kind is Obstacle else road.vehicles).append(ghost)
    return ghost


@pytest.mark.parametrize("mode", ["override", "monitor"])
@pytest.mark.parametrize(
    ("env_id", "action", "distance", "speed", "kind", "config"),
    [
        ("highway-v0", 3, 60.0, 5.0, MDPVehicle, {"vehicles_count": 0, "lanes_count": 2}),
        ("highway-fast-v0", 1, 15.0, 0.0, Vehicle, {"vehicles_count": 0, "lanes_count": 1}),
        ("highway-fast-v0", 3, 40.0, 0.0, Obstacle, {"vehicles_count": 0, "lanes_count": 1}),
        ("intersection-v0", 2, 14.0, 0.0, Vehicle, {"initial_vehicle_count": 0, "spawn_probability": 0.0}),
    ],
)
def test_who_cannot_be_touched_does_not_count(env_id, action, distance, speed, kind, config, mode):
    keys = ("shield", "cost", "blame", "override_share", "min_ttc", "speed")

    def told(ghosts):
        env = make(env_id, shield=mode, config=config | {"duration": 8})
        env.reset(seed=0)
        if ghosts:
            place_ghost(env.unwrapped.road, distance, speed, kind)
        infos, done = [], False
        while not done:
            *_, terminated, truncated, info = env.step(action)
            infos.append({name: info[name] for name in keys})
            done = terminated or truncated
        assert info["blame"] == ""
        return infos

    assert told(ghosts=True) == told(ghosts=False)


def test_a_car_that_becomes_touchable_counts_from_then_on():
    road = straight_road(lanes=1)
    ego = shielded(road)
    ghost = place_ghost(road, 100.0, 5.0, Vehicle)
    drive(road, 5)
    assert ego.since["dangerous_pairs"] == 0
    assert len(ego.others) == 0
    ghost.collidable = True
    drive(road, 60)
    assert ego.since["dangerous_pairs"] > 0
    assert not ego.vehicle.crashed


def test_an_ego_that_nobody_can_touch_owes_nothing():
    road = straight_road(lanes=1)
    ego = shielded(road)
    ego.vehicle.collidable = False
    road.vehicles.append(Vehicle(road, [30.0, 0.0], speed=0.0))
    drive(road, 60)
    assert ego.since["dangerous_pairs"] == 0
    assert not ego.has_contact


def test_in_compliant_traffic_a_car_that_cannot_be_touched_has_no_shield():
    for env_id in ("highway-fast-v0", "intersection-v0"):
        env = make(env_id, traffic="compliant")
        env.reset(seed=0)
        base = env.unwrapped
        ghost = type(base.vehicle).create_from(base.vehicle)
        ghost.collidable = False
        base.road.vehicles.append(ghost)
        env.step(1)
        assert "act" not in vars(ghost)


def test_a_flag_without_anybody_there_is_no_contact():
    env = make("highway-v0", config={"vehicles_count": 0})
    env.reset(seed=0)
    env.unwrapped.vehicle.crashed = True
    assert env.step(1)[4]["blame"] == ""
