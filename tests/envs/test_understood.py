"""A road network of one's own works as highway-env's do, or is refused by the name of a lane."""

import gymnasium as gym
import numpy as np
import pytest
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import ShieldWrapper, make
from rss_shield.envs.roads.lanes import road_through, successors
from rss_shield.envs.roads.understood import check_roads
from rss_shield.envs.stock import make_stock
from rss_shield.envs.worlds.random_roads import KINDS, build, draw_plan
from rss_shield.shield.geometry import AROUND, BEFORE, CURVATURE, nearest_piece

RACETRACKS = ("racetrack-v0", "racetrack-large-v0", "racetrack-oval-v0")


def network_of(*lanes):
    network = RoadNetwork()
    for origin, end, lane in lanes:
        network.add_lane(origin, end, lane)
    return network


def straight(*ends):
    return StraightLane(*ends, speed_limit=30)


A = straight([0, 0], [100, 0])


@pytest.mark.parametrize(
    ("lanes", "message"),
    [
        (
            [("a", "b", A), ("b", "c", straight([108, 0], [200, 0]))],
            r"lane \('a', 'b', 0\) .* ends 8.0 m from where lane \('b', 'c', 0\) begins, and turned by 0 degrees",
        ),
        (
            [("a", "b", A), ("b", "c", straight([100, 0], [100, 80]))],
            r"lane \('a', 'b', 0\) .* turned by 90 degrees: expected less than 5 m along, 0.5 m across and 45 degrees",
        ),
        (
            [("a", "b", A), ("c", "d", straight([50, -60], [50, 60]))],
            r"lanes \('a', 'b', 0\) and \('c', 'd', 0\) .* cross at 90 degrees: .* derive .* from IntersectionEnv",
        ),
        ([("a", "b", CircularLane([0, 50], 50, 0.0, 0.0))], r"lane \('a', 'b', 0\) .* is 0.0 m long: expected"),
    ],
)
def test_a_road_that_cannot_be_understood_is_refused_by_name(lanes, message):
    network = network_of(*lanes)
    with pytest.raises(ValueError, match=message):
        check_roads(network, False)


@pytest.mark.parametrize(
    "lanes",
    [
        [("a", "b", A), ("b", "c", straight([102.5, 0.2], [200, 0.2]))],  # a gap that racetracks have, too
        [("a", "b", A), ("b", "c", straight([98.0, 0], [200, 0]))],  # lanes that overlap
        [("a", "b", A), ("b", "a", straight([100, 0], [0, 0]))],  # two ways
        [("a", "b", A), ("b", "a", straight([100, -4], [0, -4]))],
        [("a", "b", A), ("a", "b", straight([0, 4], [100, 4])), ("b", "c", straight([100, 0], [200, 0]))],  # one ends
        [("a", "b", A), ("b", "c", CircularLane([100, 50], 50, -np.pi / 2, 0.0))],
    ],
)
def test_gaps_overlaps_lanes_that_end_and_other_directions_are_understood(lanes):
    check_roads(network_of(*lanes), False)


def test_where_roads_cross_a_junction_of_its_own_is_understood_and_a_gap_is_not():
    arms = [("w", "m", straight([-100, 0], [-10, 0])), ("m", "e", straight([-10, 0], [100, 0]))]
    check_roads(network_of(*arms, ("s", "n", straight([0, 100], [0, -100]))), True)
    far = [("w", "m", straight([-100, 0], [-40, 0])), ("m", "e", straight([-10, 0], [100, 0]))]
    with pytest.raises(ValueError, match=r"ends 30.0 m from .*: expected less than 20 m along"):
        check_roads(network_of(*far), True)


@pytest.mark.parametrize("kind", KINDS)
def test_roads_drawn_at_random_are_understood(kind):
    for seed in range(12):
        check_roads(build(draw_plan(np.random.default_rng(seed), kind)), False)


# ---------------------------------------------------------------- highway-env's racetracks: lanes that do not meet


@pytest.mark.parametrize("env_id", RACETRACKS)
def test_a_racetrack_is_a_ring_from_every_lane_although_its_lanes_overlap(env_id):
    network = make_stock(env_id).unwrapped.road.network
    for index in network.lanes_dict():
        road = road_through(network, index, 1000.0)
        assert (road[:, BEFORE : AROUND - 1] >= 0).all(), index  # nowhere an end
        around = road[:, AROUND]
        assert around.max() - around.min() < 2.0  # ahead it may run up to 0.3 m beside the lanes, and be longer
        # walked along the lanes, the way round is as long as the road says: within the 5 m that all overlaps make up
        walk, at = 0.0, index
        while walk == 0.0 or at != index:
            walk += network.get_lane(at).length
            (at,) = successors(network, at)
        assert 0.0 <= walk - around.min() < 8.0


@pytest.mark.parametrize("env_id", RACETRACKS)
def test_around_a_racetrack_nobody_jumps_along_it_or_across(env_id):
    """Followed along the road that is measured by, arc length grows by what is driven, also where lanes overlap."""
    network = make_stock(env_id).unwrapped.road.network
    for index in list(network.lanes_dict())[:3]:
        road = road_through(network, index, 1000.0)
        for row in road:
            length, kappa, heading = row[4], row[CURVATURE], row[2]
            places = []
            for s in np.linspace(0.01, length - 0.01, 30):
                chord = s * np.sinc(kappa * s / 2 / np.pi)
                x, y = (
                    row[0] + chord * np.cos(heading + kappa * s / 2),
                    row[1] + chord * np.sin(heading + kappa * s / 2),
                )
                places.append((s, *nearest_piece(road, x, y)[:2]))
            s, along, lateral = np.array(places).T
            assert np.diff(along) == pytest.approx(np.diff(s), abs=1e-3)
            assert np.abs(lateral).max() < 0.2


# ---------------------------------------------------------------- environments of one's own


class Forked(HighwayEnv):
    """A road that forks, of short pieces."""

    def _create_road(self):
        network, x = RoadNetwork(), 0.0
        for i in range(10):
            for k in range(2):
                network.add_lane(str(i), str(i + 1), straight([x, 4.0 * k], [x + 20.0, 4.0 * k]))
            x += 20.0
        network.add_lane("10", "left", CircularLane([x, -80], 80, np.pi / 2, 0.0, clockwise=False, speed_limit=30))
        network.add_lane("10", "right", CircularLane([x, 84], 80, -np.pi / 2, 0.0, speed_limit=30))
        self.road = Road(network, np_random=self.np_random)

    def _create_vehicles(self):
        rng = self.np_random
        self.controlled_vehicles = []
        for index, s, kind in (
            (("0", "1", 0), 10.0, None),
            (("3", "4", 0), 5.0, IDMVehicle),
            (("2", "3", 1), 0.0, IDMVehicle),
        ):
            lane = self.road.network.get_lane(index)
            make = kind or self.action_type.vehicle_class
            car = make(self.road, lane.position(s, 0.0), lane.heading_at(s), rng.uniform(10.0, 25.0))
            self.road.vehicles.append(car)
            self.controlled_vehicles += [] if kind else [car]


class Gappy(Forked):
    def _create_road(self):
        super()._create_road()
        self.road.network.graph["4"]["5"][0] = straight([88.0, 0], [100, 0])
        self.road.network.graph["3"]["4"][0] = straight([60.0, 0], [75, 0])


class Crossing(IntersectionEnv):
    """highway-env's intersection with one arm less."""

    def _make_road(self):
        super()._make_road()
        lane = self.road.network.graph["o0"]["ir0"][0]
        self.road.network.graph["o0"]["ir0"][0] = StraightLane(
            lane.position(0.0, 0.0), lane.position(40.0, 0.0), speed_limit=10
        )


def test_a_fork_of_short_pieces_is_driven_without_blame():
    env = ShieldWrapper(Forked({"duration": 14}))
    rng = np.random.default_rng(0)
    for seed in range(6):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(int(rng.integers(5)))
            done = terminated or truncated
        assert info["blame"] in ("", "other", "inherited") and info["episode_broken_duties"] == 0


@pytest.mark.parametrize(("kind", "lane"), [(Gappy, "3"), (Crossing, "o0")])
def test_an_environment_with_a_road_that_cannot_be_understood_is_refused(kind, lane):
    with pytest.raises(ValueError, match=rf"lane \('{lane}', '\w+', 0\) of the road network ends [\d.]+ m from"):
        ShieldWrapper(kind())


def test_what_is_registered_is_made_by_its_name():
    gym.register("forked-v0", entry_point=Forked)
    try:
        assert isinstance(make("forked-v0").unwrapped, Forked)
    finally:
        gym.registry.pop("forked-v0")
