"""A street with pedestrians: what `crosswalk-v0` and `parked-row-v0` have in common.

One straight lane each way; the ego drives along x and its goal is the end of the street. Sizes in metres, y to the
right of the ego's driving direction; the ego's lane is the right one.
"""

from typing import Any, NamedTuple

import numpy as np
from highway_env import utils
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.graphics import EnvViewer
from highway_env.road.graphics import WorldSurface
from highway_env.road.lane import LineType, StraightLane
from highway_env.road.road import RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield.envs.roads.visibility import Box
from rss_shield.envs.worlds.walkers import Errand, ParkedCar, Surroundings, Walker, WatchedRoad

START, GOAL = 0.0, 110.0  # where the ego begins and arrives [m]
WEST, EAST = -60.0, 260.0  # ends of the street [m]
LANE = 4.0  # width of a lane [m]
OWN, ONCOMING = LANE / 2, -LANE / 2  # middles of the lanes [m]
LIMIT = 10.0  # [m/s]
KERB = LANE + 1.2  # where people wait, from the middle of the street: too far away for IDM to stop [m]
STRIPE = 0.5  # of a crossing, and the gap to the next one [m]
MARK = 0.6  # half of a square that shows where somebody is [m]
WHITE, GREY, ORANGE = (240, 240, 240), (70, 70, 80), (250, 140, 0)


class Person(NamedTuple):
    """A pedestrian at the beginning of an episode."""

    x: float  # [m]
    y: float  # [m]; it walks to the other side
    errand: Errand
    place: tuple[str, str]  # class and place in the published table


class StreetSurface(WorldSurface):
    """Where highway-env draws; stripes, buildings and marks below pedestrians come before lanes and cars."""

    def __init__(self, env, plain: WorldSurface) -> None:
        super().__init__(plain.get_size(), 0, plain)
        self.env = env
        self.scaling, self.centering_position = plain.scaling, plain.centering_position

    def fill(self, colour, *rest):
        area = super().fill(colour, *rest)
        if not rest and self.env.road is not None:  # the background
            surroundings = self.env.road.surroundings
            for crossing in surroundings.crossings:
                for y in np.arange(-LANE + STRIPE / 2, LANE, 2 * STRIPE):
                    self._paint(WHITE, crossing.start, y, crossing.end, y + STRIPE)
            for box in surroundings.boxes:
                half = box.length / 2, box.width / 2
                self._paint(GREY, box.x - half[0], box.y - half[1], box.x + half[0], box.y + half[1])
            for walker in self.env.road.walkers:
                x, y = walker.position
                self._paint(ORANGE, x - MARK, y - MARK, x + MARK, y + MARK)
        return area

    def _paint(self, colour, left: float, top: float, right: float, bottom: float) -> None:
        (x, y), (x_end, y_end) = self.vec2pix((left, top)), self.vec2pix((right, bottom))
        super().fill(colour, (x, y, max(x_end - x, 1), max(y_end - y, 1)))


def painted(env, viewer: EnvViewer) -> EnvViewer:
    """A viewer that draws what stands around the road, too."""
    viewer.sim_surface = StreetSurface(env, viewer.sim_surface)
    return viewer


class StreetEnv(AbstractEnv):
    """A street with pedestrians. Configuration, besides highway-env's:

      occluders: False = nothing hides anybody, and nobody has to be expected who is not seen.
      unreasonable: probability that somebody behaves in a way that nobody need expect.
      pedestrians: how many reasonable ones there are.
      vehicles_count: other cars.
      ghosts: False = the shield is not shown who may be hidden, for comparison.
      duration: [s].

    Every info has `is_success`: has the ego come to the end of the street?

    Raises:
      ValueError: a bad configuration; the message names field, value and range.
    """

    road: Any
    viewer: Any

    @classmethod
    def default_config(cls) -> dict:
        config = super().default_config()
        config.update(
            {
                "observation": {
                    "type": "Kinematics",
                    "vehicles_count": 12,
                    "features": ["presence", "x", "y", "vx", "vy", "cos_h", "sin_h"],
                    "features_range": {"x": [-100, 100], "y": [-20, 20], "vx": [-20, 20], "vy": [-20, 20]},
                },
                "action": {
                    "type": "DiscreteMetaAction",
                    "longitudinal": True,
                    "lateral": False,
                    "target_speeds": [0, 4.5, 9],
                },
                "policy_frequency": 1,
                "duration": 40,
                "vehicles_count": 3,
                "pedestrians": 4,
                "unreasonable": 0.3,
                "occluders": True,
                "ghosts": True,
                "collision_reward": -5,
                "high_speed_reward": 1,
                "arrived_reward": 1,
                "reward_speed_range": [4.0, 9.0],
                "screen_width": 900,
                "screen_height": 200,
                "scaling": 7.0,
            }
        )
        return config

    # -- what differs between streets

    def _surround(self) -> tuple[Surroundings, list[ParkedCar]]:
        """What stands around the road, and the cars among it."""
        raise NotImplementedError

    def _people(self) -> list[Person]:
        """Who is there."""
        raise NotImplementedError

    # -- called by highway-env

    def _reset(self) -> None:
        _check(self.config)
        self._make_road()
        self._make_vehicles()
        surroundings, parked = self._surround()
        self.road.objects += [*parked, *(self._walker(person) for person in self._people())]
        self.road.ghosts_on = self.config["ghosts"]
        self.road.begin(self.vehicle, surroundings, 1 / self.config["simulation_frequency"])

    def _make_road(self) -> None:
        net, line, none = RoadNetwork(), LineType.CONTINUOUS, LineType.NONE
        striped = [LineType.STRIPED, line]
        own, oncoming = ([WEST, OWN], [EAST, OWN]), ([EAST, ONCOMING], [WEST, ONCOMING])
        net.add_lane("w", "e", StraightLane(*own, LANE, striped, speed_limit=LIMIT))
        net.add_lane("e1", "w1", StraightLane(*oncoming, LANE, [none, line], speed_limit=LIMIT))
        self.road = WatchedRoad(network=net, np_random=self.np_random, record_history=self.config["show_trajectories"])

    def _make_vehicles(self) -> None:
        rng, lane = self.np_random, self.road.network.get_lane(("w", "e", 0))
        ego = self.action_type.vehicle_class(self.road, lane.position(START - WEST, 0.0), 0.0, rng.uniform(6.0, 9.0))
        self.road.vehicles.append(ego)
        self.controlled_vehicles = [ego]
        places = [35.0, -30.0]  # a leader and a follower, the others come the other way
        for k in range(self.config["vehicles_count"]):
            if k < len(places):
                index, s = ("w", "e", 0), START + places[k] + rng.uniform(-5.0, 5.0) - WEST
            else:
                index, s = ("e1", "w1", 0), EAST - 60.0 * (k - 1) - rng.uniform(0.0, 30.0)
            if s <= 0.0:
                continue
            car = IDMVehicle.make_on_lane(self.road, index, s, rng.uniform(6.0, 9.0))
            car.target_speed = float(rng.uniform(7.0, LIMIT))
            car.randomize_behavior()
            self.road.vehicles.append(car)

    def _walker(self, person: Person) -> Walker:
        heading = -np.pi / 2 if person.y > 0.0 else np.pi / 2
        walker = Walker(self.road, (person.x, person.y), heading)
        walker.errand, walker.place = person.errand, person.place
        return walker

    def has_arrived(self, vehicle) -> bool:
        """Has a car come to the end of the street?"""
        return bool(vehicle.position[0] >= GOAL)

    def _rewards(self, action) -> dict[str, float]:
        speed = utils.lmap(self.vehicle.speed, self.config["reward_speed_range"], [0, 1])
        return {
            "collision_reward": float(self.vehicle.crashed),
            "high_speed_reward": float(np.clip(speed, 0, 1)),
            "arrived_reward": float(self.has_arrived(self.vehicle)),
        }

    def _reward(self, action) -> float:
        return sum(self.config[name] * reward for name, reward in self._rewards(action).items())

    def _is_terminated(self) -> bool:
        return bool(self.vehicle.crashed or self.has_arrived(self.vehicle))

    def _is_truncated(self) -> bool:
        return bool(self.time >= self.config["duration"])

    def _info(self, obs, action=None) -> dict:
        return super()._info(obs, action) | {"is_success": self.has_arrived(self.vehicle)}

    def render(self):
        if self.viewer is None and self.render_mode is not None:
            self.viewer = painted(self, EnvViewer(self))
        return super().render()


def parked_car(road, x: float, y: float) -> ParkedCar:
    """A car that stands along the street."""
    return ParkedCar(road, (x, y), 0.0 if y > 0.0 else np.pi)


def box_of_parked(car: ParkedCar) -> Box:
    return Box(float(car.position[0]), float(car.position[1]), car.LENGTH, car.WIDTH)


def _check(config: dict) -> None:
    for name in ("occluders", "ghosts"):
        if not isinstance(config[name], bool):
            raise ValueError(f"config {name} = {config[name]!r}: expected True or False")
    for name in ("pedestrians", "vehicles_count"):
        if not isinstance(config[name], int) or config[name] < 0:
            raise ValueError(f"config {name} = {config[name]!r}: expected a whole number >= 0")
    p = config["unreasonable"]
    if not isinstance(p, (int, float)) or not 0.0 <= p <= 1.0:
        raise ValueError(f"config unreasonable = {p!r}: expected a probability, 0 to 1")
