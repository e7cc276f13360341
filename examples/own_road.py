"""A road of one's own: a ring of two lanes with an exit, drawn by hand, behind the same shield.

python examples/own_road.py
"""

import gymnasium as gym
import numpy as np
from highway_env.envs.highway_env import HighwayEnv
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import make

LENGTH, RADIUS, WIDTH = 200.0, 60.0, 4.0  # [m]
FASTER = 3


class RingRoad(HighwayEnv):
    """Two straights and two bends that close on themselves; the outer lane has an exit.

    Lanes go on where they meet: the end of one and the start of the next share a node's name and a place.
    """

    def _create_road(self) -> None:
        net, top = RoadNetwork(), 2 * RADIUS
        for k in range(2):
            out, r = k * WIDTH, RADIUS + k * WIDTH
            net.add_lane("a", "b", StraightLane([0, out], [LENGTH, out], speed_limit=30))
            net.add_lane("b", "c", CircularLane([LENGTH, -RADIUS], r, np.pi / 2, -np.pi / 2, clockwise=False))
            net.add_lane("c", "d", StraightLane([LENGTH, -top - out], [0, -top - out], speed_limit=30))
            net.add_lane("d", "a", CircularLane([0, -RADIUS], r, -np.pi / 2, -3 * np.pi / 2, clockwise=False))
        net.add_lane("b", "exit", StraightLane([LENGTH, WIDTH], [LENGTH + 300, WIDTH], speed_limit=30))
        self.road = Road(network=net, np_random=self.np_random)

    def _create_vehicles(self) -> None:
        rng, network = self.np_random, self.road.network
        start = network.get_lane(("a", "b", 0))
        self.vehicle = self.action_type.vehicle_class(self.road, start.position(20.0, 0.0), start.heading_at(0.0), 20.0)
        self.road.vehicles.append(self.vehicle)
        for index in network.lanes_dict():
            if index != ("a", "b", 0):
                s = rng.uniform(0.1, 0.8) * network.get_lane(index).length
                self.road.vehicles.append(IDMVehicle.make_on_lane(self.road, index, s, speed=rng.uniform(8.0, 15.0)))


gym.register("ring-road-v0", entry_point=RingRoad)

for shield in ("monitor", "override"):
    env, blame = make("ring-road-v0", shield, config={"duration": 20}), []
    for seed in range(4):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(FASTER)
            done = terminated or truncated
        blame.append(info["blame"] or "nobody")
    print(f"{shield}: blame {', '.join(blame)}")
