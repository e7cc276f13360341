"""Where roads cross, an ego between two lanes is in the way of whoever comes on either, for as long as it is there."""

from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from highway_env.vehicle.controller import ControlledVehicle
from junction_world import DT, RULED, junction

import rss_shield
from rss_shield.envs.roads.ways import CAR_ON_ROAD, drift_of, track_of
from rss_shield.shield.junctions.conflict_areas import COS, HALF_LENGTH, HALF_WIDTH, SIN, X, Y
from rss_shield.shield.junctions.obstacles import block
from rss_shield.shield.junctions.plans import NEVER, SLACK, Scene, stop_conflict
from rss_shield.shield.junctions.reach import THREAT

ENV = "roundabout-v0"
OLD, NEW = ("ee", "nx", 1), ("ee", "nx", 0)  # the inner and the outer lane of a ring
REACH = 1.15  # half the width of a car and the margin of what cars sweep [m]


class Changing:
    """highway-env's driver on its way from one lane to the one beside it."""

    def __init__(self, old, new, speed: float) -> None:
        env = gym.make(ENV).unwrapped
        env.reset(seed=0)
        env.road.vehicles = []
        lane = env.road.network.get_lane(old)
        self.lane, self.junction = lane, junction(ENV)
        self.car = ControlledVehicle(env.road, lane.position(4.0, 0.0), lane.heading_at(4.0), speed, new)
        self.path = -1

    def track(self):
        car, record = self.car, np.zeros(1, CAR_ON_ROAD)[0]
        record["x"], record["y"] = car.position
        record["heading"], record["speed"], record["length"], record["width"] = car.heading, car.speed, 5.0, 2.0
        record["on"] = self.junction.number[car.lane_index]
        record["lane"] = self.junction.number[car.target_lane_index]
        record["choice"] = self.junction.choice(car.target_lane_index, None)
        self.record = record
        track = track_of(self.junction.roads, record, self.path)
        self.path = track.path
        return track

    def drive(self, acceleration: float) -> None:
        self.car.act(None)
        self.car.action["acceleration"] = max(acceleration, -self.car.speed / DT)
        self.car.step(DT)

    def reaches_old_lane(self) -> bool:
        """Is a corner where a car in the middle of the old lane might be?"""
        car = self.car
        turn = np.array([[np.cos(car.heading), -np.sin(car.heading)], [np.sin(car.heading), np.cos(car.heading)]])
        corners = [car.position + turn @ np.array([x, y]) for x in (-2.5, 2.5) for y in (-1.0, 1.0)]
        return bool(min(abs(self.lane.local_coordinates(corner)[1]) for corner in corners) < REACH)

    def scene(self, threats) -> Scene:
        return Scene(self.junction.roads.paths, self.track(), threats, RULED)


def half_way(old=OLD, new=NEW) -> Changing:
    """It rests in the middle of the lane change."""
    changing = Changing(old, new, 3.0)
    while changing.car.lane_index == old:
        changing.drive(0.0)
    changing.car.speed = 0.0
    return changing


@pytest.mark.parametrize(("old", "new"), [(OLD, NEW), (NEW, OLD)])
@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0, 6.0, 8.0, 12.0])
@pytest.mark.parametrize("acceleration", [-5.0, 0.0, 3.0])
def test_a_lane_is_left_when_plans_say_so(old, new, speed, acceleration):
    changing, seen, since = Changing(old, new, speed), [], 0
    for frame in range(60):
        track = changing.track()
        if changing.reaches_old_lane():
            since = frame
        seen.append(track)
        changing.drive(acceleration)
        if changing.car.lane_index[:2] != old[:2]:
            break
    assert seen[0].beside >= 0
    for frame, track in enumerate(seen[: since + 1]):
        assert track.beside >= 0, "it is not known to reach into the lane that it leaves"
        for later in range(frame, since + 1):
            assert (later - frame) * DT <= track.leaves_after or seen[later].s <= track.leaves_at


@pytest.mark.parametrize(("old", "new"), [(OLD, NEW), (NEW, OLD)])
@pytest.mark.parametrize("speed", [1.0, 2.0, 4.0, 6.0, 8.0, 11.0, 14.0, 16.0])
@pytest.mark.parametrize("acceleration", [-5.0, -2.0, 0.0, 3.0])
def test_the_ego_comes_as_far_as_plans_say_but_for_their_drift(old, new, speed, acceleration):
    changing, places, drifts = Changing(old, new, speed), [], []
    driven = 0.0
    while changing.car.lane_index[:2] == old[:2] and changing.car.speed > 0.01 and len(places) < 60:
        track = changing.track()
        places.append(track.s - driven)
        drifts.append(drift_of(changing.junction.roads, changing.record, track) if track.beside >= 0 else None)
        driven += changing.car.speed * DT
        changing.drive(acceleration)
    assert drifts[0] > 1.0
    for i, drift in enumerate(drifts):
        if drift is not None:
            assert np.abs(np.array(places[i:]) - places[i]).max() <= drift + SLACK


@pytest.mark.parametrize("env_id", ["roundabout-v0", "roundabout-v1", "roundabout-generic-v0"])
def test_a_lane_beside_is_looked_at_as_who_came_by_the_same_road(env_id):
    """Short of where it begins, the ego is on the ring, not on the entry that leads to it, too."""
    ways = junction(env_id)
    numbers, found = ways.number, 0
    for path, walk in enumerate(ways.walks):
        for before, lane in pairwise(walk):
            for other in numbers:
                if other[:2] != lane[:2] or other == lane or (*before[:2], 1 - before[2]) not in numbers:
                    continue
                beside = ways.walks[ways.roads.alongside[path, numbers[other]]]
                assert beside[beside.index(other) - 1][:2] == before[:2]
                found += 1
    assert found > 10


def test_a_plan_that_counts_on_the_throttle_holds_while_the_ego_moves_in_from_outside():
    """It came 1 m less far than planned, into the way of one who then had broken no duty."""
    env = rss_shield.make("roundabout-v1", shield="override", intent="known")
    env.reset(seed=8020)
    over, steps = False, iter([3, 1, 0, 4, 0, 1, 4, 1, 1, 1, 1])
    while not over:
        *_, terminated, truncated, info = env.step(next(steps))
        over = terminated or truncated
    assert not info["crashed"]
    assert info["episode_broken_duties"] == 0


def coming_on(lane, changing: Changing, distance: float, speed: float) -> np.ndarray:
    """A car on a lane, so far behind."""
    track, roads, number = changing.track(), changing.junction.roads, changing.junction.number
    threats = np.zeros(1, THREAT)
    path = roads.alongside[track.path, number[lane]]
    s = changing.car.road.network.get_lane(lane).local_coordinates(changing.car.position)[0]
    threats["path"], threats["s"], threats["v"] = path, roads.paths.offset[path, number[lane]] + s - distance, speed
    threats["cap"], threats["half_length"] = roads.limit, 2.5
    return threats


def test_nobody_rests_between_lanes_where_somebody_comes_on_the_old_one():
    changing = half_way()
    assert changing.car.lane_index == NEW
    assert changing.reaches_old_lane()
    scene = changing.scene(coming_on(OLD, changing, 40.0, 12.0))
    assert stop_conflict(scene, -5.0, -1, False, 0.0) != NEVER
    unaware = scene._replace(track=scene.track._replace(beside=-1))
    assert stop_conflict(unaware, -5.0, -1, False, 0.0) == NEVER


def test_it_may_where_nobody_comes():
    changing = half_way()
    passed = coming_on(OLD, changing, -12.0, 5.0)
    assert stop_conflict(changing.scene(passed), -5.0, -1, False, 0.0) == NEVER


def test_a_wreck_on_the_old_lane_is_in_the_way_until_it_is_left():
    changing = Changing(OLD, NEW, 4.0)
    scene = changing.scene(np.zeros(1, THREAT))

    def meets(ahead: float) -> bool:
        where = changing.lane.position(4.0 + ahead, 0.0)
        heading = changing.lane.heading_at(4.0 + ahead)
        box = np.zeros(6)
        box[X], box[Y], box[COS], box[SIN], box[HALF_LENGTH], box[HALF_WIDTH] = (
            *where,
            np.cos(heading),
            np.sin(heading),
            2.5,
            1.0,
        )
        wreck = scene.threats[0]
        wreck["path"], wreck["wreck"] = -1, True
        block(scene.paths, scene.track, box, wreck)
        return stop_conflict(scene, 0.0, -1, False, 0.0) != NEVER

    assert meets(6.5)  # it stops after 1.6 m and a frame
    assert not meets(14.0)


def test_a_contact_in_the_middle_of_a_lane_change_is_avoided():
    """The ego slowed down until it rested between two lanes of the ring, and was hit by who came on the old one."""
    batch = rss_shield.make_vec(ENV, 1, intent="known", autoreset_mode=AutoresetMode.DISABLED)
    batch.reset(seed=7678)
    for action in (1, 0, 4, 2, 0, 3, 2, 4, 0, 2, 2):
        *_, infos = batch.step(np.array([action]))
    assert infos["blame"][0] == ""
    assert infos["episode_broken_duties"][0] == 0
