"""Where not everything can be seen: `parked-row-v0` and `occluded-intersection-v0`.

On the first, children run out between cars that are parked along a street; on the second, buildings stand at the
corners of highway-env's intersection. Importing this module registers the environments.
"""

from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.envs.common.graphics import EnvViewer
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.road.regulation import RegulatedRoad

from rss_shield.envs.roads.visibility import Box, Columns, HiddenLane
from rss_shield.envs.worlds.streets import KERB, LANE, Person, StreetEnv, box_of_parked, painted, parked_car
from rss_shield.envs.worlds.walkers import DASHES, RUNS_OUT, Errand, ParkedCar, Surroundings, Watched
from rss_shield.shield.definitions.occlusion import REASONABLE

PARKED_ROW, OCCLUDED = "parked-row-v0", "occluded-intersection-v0"
PLACE = ("pedestrian", "parked cars")
HIDDEN_CARS = ("car", "urban")
ROW = LANE + 1.0  # y of the side of parked cars that faces the road [m]
_FIRST, _LAST = 20.0, 90.0  # of the row, x [m]
_GAPS = (1.0, 2.5)  # between parked cars [m]
_BODY = 0.3  # of a child, from the bumpers to its middle [m]
_DEPTHS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0)  # behind the cars' sides [m]
_BACK = 2.2  # so far behind them children start to run [m]
_FAST = (3.5, 6.0)  # speeds that are unreasonable [m/s]
_CORNER, _BLOCK = 7.5, 30.0  # from the middle of the roads to buildings, and their length [m]


class ParkedRowEnv(StreetEnv):
    """A street with a row of parked cars on the right. See `StreetEnv` for the configuration."""

    @classmethod
    def default_config(cls) -> dict:
        return super().default_config() | {"pedestrians": 4, "unreasonable": 0.5, "duration": 60}

    def _reset(self) -> None:
        self.row: list[ParkedCar] = []
        super()._reset()

    def _make_vehicles(self) -> None:
        super()._make_vehicles()
        rng, x = self.np_random, _FIRST
        while x + ParkedCar.LENGTH < _LAST:
            self.row.append(parked_car(self.road, x + ParkedCar.LENGTH / 2, ROW + ParkedCar.WIDTH / 2))
            x += ParkedCar.LENGTH + float(rng.uniform(*_GAPS))

    def _gaps(self) -> list[tuple[float, float]]:
        """Where children may stand between the cars, x from and to."""
        ends = [(float(c.position[0]) - c.LENGTH / 2, float(c.position[0]) + c.LENGTH / 2) for c in self.row]
        return [(a[1] + _BODY, b[0] - _BODY) for a, b in pairwise(ends)]

    def _surround(self):
        if not self.config["occluders"]:
            return Surroundings(), []
        return Surroundings(tuple(box_of_parked(car) for car in self.row), (self._columns(),)), self.row

    def _columns(self) -> Columns:
        x = np.concatenate([np.linspace(a, b, max(int(np.ceil((b - a) / 0.25)) + 1, 2)) for a, b in self._gaps()])
        points = np.stack(np.meshgrid(x, [ROW + d for d in _DEPTHS], indexing="ij"), axis=-1)
        return Columns(points, np.full(len(x), -np.pi / 2), PLACE)

    def _people(self) -> list[Person]:
        rng = self.np_random
        gaps = self._gaps()
        many = min(self.config["pedestrians"], len(gaps))
        chosen = rng.choice(len(gaps), size=min(many + 1, len(gaps)), replace=False)
        people = [self._child(gaps[k], True) for k in chosen[:many]]
        if len(chosen) > many and rng.random() < self.config["unreasonable"]:
            people.append(self._child(gaps[chosen[-1]], False))
        return people

    def _child(self, gap: tuple[float, float], reasonable: bool) -> Person:
        rng = self.np_random
        x, near = float(rng.uniform(*gap)), float(rng.uniform(2.0, 30.0))
        v = float(rng.uniform(1.0, REASONABLE[PLACE].v_high)) if reasonable else float(rng.uniform(*_FAST))
        errand = Errand(RUNS_OUT if reasonable else DASHES, v, 0.0, near, -KERB)
        return Person(x, ROW + _BACK, errand, PLACE)


class OccludedRoad(Watched, RegulatedRoad):
    """highway-env's intersection, of which the ego does not see everything."""


class OccludedIntersectionEnv(IntersectionEnv):
    """highway-env's intersection with buildings at its corners.

    The configuration is that of `IntersectionEnv`, and `occluders` (False = no buildings), `ghosts` (False = the shield
    is not shown who may be hidden, for comparison); `duration` is 30 s, because who sees little has to wait longer, and
    fewer cars come.

    Raises:
      ValueError: a bad configuration; the message names field, value and range.
    """

    road: Any
    viewer: Any

    @classmethod
    def default_config(cls) -> dict:
        return super().default_config() | {
            "occluders": True,
            "ghosts": True,
            "duration": 30,
            "initial_vehicle_count": 6,
            "spawn_probability": 0.3,
        }

    def _make_road(self) -> None:
        for name in ("occluders", "ghosts"):
            if not isinstance(self.config[name], bool):
                raise ValueError(f"config {name} = {self.config[name]!r}: expected True or False")
        super()._make_road()
        stock = self.road
        self.road = OccludedRoad(
            network=stock.network,
            np_random=stock.np_random,
            record_history=stock.record_history,
            neighbour_vehicles_connected_lanes=stock.neighbour_vehicles_connected_lanes,
        )

    def _make_vehicles(self, n_vehicles: int = 10) -> None:
        super()._make_vehicles(n_vehicles)
        road, v_high = self.road, REASONABLE[HIDDEN_CARS].v_high
        boxes = buildings() if self.config["occluders"] else ()
        road.ghosts_on = self.config["ghosts"]
        own = self.vehicle.lane_index
        lanes = [(f"o{k}", f"ir{k}", 0) for k in range(4)]
        road.lanes_hidden = tuple(HiddenLane(road.network, index, v_high) for index in lanes if index != own)
        road.begin(self.vehicle, Surroundings(boxes), 1 / self.config["simulation_frequency"])

    def render(self):
        if self.viewer is None and self.render_mode is not None:
            self.viewer = painted(self, EnvViewer(self))
        return super().render()


def buildings() -> tuple[Box, ...]:
    """One at each corner."""
    middle = _CORNER + _BLOCK / 2
    return tuple(Box(sx * middle, sy * middle, _BLOCK, _BLOCK) for sx in (-1, 1) for sy in (-1, 1))


gym.register(id=PARKED_ROW, entry_point="rss_shield.envs.worlds.occluded:ParkedRowEnv")
gym.register(id=OCCLUDED, entry_point="rss_shield.envs.worlds.occluded:OccludedIntersectionEnv")
