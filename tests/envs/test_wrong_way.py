"""Hole H25: who drives against the only lane under it is in the wrong; it owes braking, and blame falls on it."""

import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Obstacle

from rss_shield import PRESETS, Rules
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.lanes import road_through, roads_along, turned_round
from rss_shield.envs.worlds.random_roads import Element, Pose, advance, lane_beside
from rss_shield.shield.definitions.response import CORRECT, REAR, WRONG
from rss_shield.shield.geometry import HEADING, PIECE_FIELDS, locate
from rss_shield.shield.lanes.memory import role_of_ego
from rss_shield.shield.params import Table

DT = 1 / 15
TABLE = Table(PRESETS["simulator"].ego, PRESETS["simulator"].other, Rules(anticipation=0.0, take_back=False), DT)
BENDS = [Element(0.0, 150.0), Element(1 / 80, 90.0), Element(-1 / 60, 60.0), Element(0.0, 150.0)]


def one_way(elements=(Element(0.0, 400.0),), lanes=1):
    """A road without a lane of the other direction."""
    network, start = RoadNetwork(), Pose(0.0, 0.0, 0.0)
    for i, element in enumerate(elements):
        for k in range(lanes):
            network.add_lane(str(i), str(i + 1), lane_beside(start, element, 4.0 * k))
        start = advance(start, element)
    return Road(network, np_random=np.random.default_rng(0))


def put(road, index, s, speed, wrong=False):
    lane = road.network.get_lane(index)
    car = Vehicle(road, lane.position(s, 0.0), lane.heading_at(s) + np.pi * wrong, speed)
    road.vehicles.append(car)
    return car


def shielded(car, overrides=True):
    return ShieldedEgo(car, Settings(TABLE, overrides), record=True)


def keep_to_lanes(road, cars):
    """Steer cars along their lanes, whichever way they drive these."""
    for car in cars:
        lane = car.lane
        s, lateral = lane.local_coordinates(car.position)
        against = np.cos(car.heading - lane.heading_at(s)) < 0.0
        sign = -1.0 if against else 1.0
        target = lane.heading_at(s + 2.0 * sign) + np.pi * against - sign * np.clip(0.1 * lateral, -0.3, 0.3)
        turn = (target - car.heading + np.pi) % (2 * np.pi) - np.pi
        slip = np.arcsin(np.clip(2.0 * turn * 2.5 / max(car.speed, 1.0), -0.9, 0.9))
        acceleration = 0.0 if "act" in vars(car) else car.action["acceleration"]  # a shielded agent asks for none
        car.act({"steering": float(np.arctan(2 * np.tan(slip))), "acceleration": acceleration})


def drive(road, frames, cars):
    for _ in range(frames):
        keep_to_lanes(road, cars)
        road.act()
        road.step(DT)


@pytest.mark.parametrize("elements", [(Element(0.0, 450.0),), BENDS])
def test_an_ego_that_drives_against_its_lane_brakes_for_who_comes(elements):
    road = one_way(elements)
    ego = shielded(put(road, (str(len(elements) - 1), str(len(elements)), 0), 100.0, 15.0, wrong=True))
    other = put(road, ("0", "1", 0), 10.0, 1.0)
    for _ in range(450):
        drive(road, 1, [ego.vehicle, other])
        if ego.vehicle.speed == 0.0:
            break
    assert ego.vehicle.speed == 0.0, "it owes braking as who is in the wrong does"
    assert not ego.has_contact
    assert ego.since["broken_duties"] == 0 and ego.since["dangerous_pairs"] > 0
    assert ego.memory["opposite"][0] and ego.memory["in_own_lane"][0]
    assert role_of_ego(ego.memory[0]) == WRONG


def test_the_other_is_in_its_own_lane_and_not_to_blame_for_what_it_may_expect():
    road = one_way()
    wrong = put(road, ("0", "1", 0), 250.0, 15.0, wrong=True)
    ego = shielded(put(road, ("0", "1", 0), 10.0, 15.0))
    ego._meet()
    users, me, _ = ego._sense()
    assert me["cos"] > 0.0 and users[0]["cos"] < 0.0 and not users[0]["in_own_lane"]
    there = shielded(wrong)
    there._meet()
    users, me, _ = there._sense()
    assert me["cos"] > 0.0 and users[0]["cos"] < 0.0 and users[0]["in_own_lane"]
    assert users[0]["s"] - me["s"] == pytest.approx(240.0)
    ego.act()
    there.act()
    assert role_of_ego(ego.memory[0]) == CORRECT and role_of_ego(there.memory[0]) == WRONG


def test_without_braking_the_blame_falls_on_it():
    """Before this was read so, the ego was 'in front' of whoever it drove into, and owed nothing."""
    road = one_way()
    ego = shielded(put(road, ("0", "1", 0), 350.0, 15.0, wrong=True), overrides=False)
    other = put(road, ("0", "1", 0), 10.0, 10.0)
    for _ in range(400):
        # the one in its own lane does what Def. 10 asks of it: it brakes at a_min_brake_correct, to rest
        near = np.hypot(*(ego.vehicle.position - other.position)) < 190.0
        other.action["acceleration"] = -min(3.0, other.speed / DT) if near else 0.0
        drive(road, 1, [ego.vehicle, other])
        if ego.check_contact():
            break
    assert ego.blame == "ego"
    assert ego.contact["ego_duty"]


def test_a_wall_ahead_on_the_wrong_lane_is_stopped_for_and_one_behind_is_not():
    road = one_way()
    ego = shielded(put(road, ("0", "1", 0), 300.0, 15.0, wrong=True))
    road.objects.append(Obstacle(road, [150.0, 0.0]))
    drive(road, 200, [ego.vehicle])
    assert ego.vehicle.speed == 0.0 and ego.vehicle.position[0] > 153.5
    road = one_way()
    ego = shielded(put(road, ("0", "1", 0), 300.0, 15.0, wrong=True))
    road.objects.append(Obstacle(road, [350.0, 0.0]))
    drive(road, 60, [ego.vehicle])
    assert ego.vehicle.speed == 15.0


def test_who_follows_the_same_wrong_way_is_followed():
    road = one_way()
    ego = shielded(put(road, ("0", "1", 0), 300.0, 20.0, wrong=True))
    leader = put(road, ("0", "1", 0), 220.0, 5.0, wrong=True)
    drive(road, 150, [ego.vehicle, leader])
    assert role_of_ego(ego.memory[0]) == REAR
    assert not ego.has_contact and ego.since["broken_duties"] == 0
    assert ego.vehicle.position[0] - leader.position[0] > 5.0


def test_a_road_turned_round_is_the_same_road():
    road = one_way(BENDS, lanes=2)
    here = road_through(road.network, ("1", "2", 0), 500.0)
    there = turned_round(here)
    rng = np.random.default_rng(0)
    for lane in road.network.lanes_list():
        for s in rng.uniform(0.0, lane.length, 20):
            point = lane.position(s, rng.uniform(-2.0, 2.0))
            a, b = locate(here, *point), locate(there, *point)
            assert b[0] == pytest.approx(-a[0]) and b[1] == pytest.approx(-a[1])
            assert np.cos(a[2] - b[2]) == pytest.approx(-1.0) and b[3] == pytest.approx(-a[3])
    again = turned_round(there)
    assert np.cos(again[:, HEADING] - here[:, HEADING]) == pytest.approx(1.0)
    others = [k for k in range(PIECE_FIELDS) if k != HEADING]
    assert again[:, others] == pytest.approx(here[:, others], abs=1e-9)


def test_on_its_own_lane_nothing_is_turned_round():
    road = one_way(BENDS)
    car = put(road, ("1", "2", 0), 20.0, 10.0)
    ego = shielded(car)
    ego._meet()
    ego._sense()
    assert not ego.heading.against
    assert np.array_equal(ego.road, roads_along(road.network, ego.heading, 1e4)[0])
