"""A car park that several cars share: each looks for its own place, at once, and people walk between them.

`highway-env`'s parking has one car that moves. Here two to four do, each with an agent of its own (`MultiAgentAction`,
throttle and steering), and each with a shield of its own where there is one. Other places are taken by parked cars.
"""

import math
from collections import OrderedDict
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import action_factory
from highway_env.envs.common.observation import KinematicsGoalObservation, MultiAgentObservation
from highway_env.envs.parking_env import ParkingEnv
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.worlds.parker import Parker, is_parked

ENV_ID = "shared-parking-v0"
_COUNTS = {"controlled_vehicles": (1, 4), "vehicles_count": (0, 20), "pedestrians": (0, 20)}
_FAR = 4.0  # from everybody that a pedestrian appears [m]
_ACCELERATES = 2.0  # [m/s^2]
_LOOKS = 1.0  # ahead for somebody in the way [m]


class Pedestrian(Vehicle):
    """Somebody who walks to one place after another, and stops for what is in the way."""

    position: Any
    speed: Any
    impact: Any
    LENGTH = WIDTH = 0.6
    WALKS = True
    MAX_SPEED = 2.0

    def __init__(self, road: Any, position: Any, heading: float = 0.0, speed: float = 0.0) -> None:
        super().__init__(road, position, heading, speed)
        self.check_collisions = True
        self.pace = road.np_random.uniform(0.8, 1.5)  # [m/s]
        self.waits = 0
        self._choose()

    def _choose(self) -> None:
        self.target = np.array([self.road.np_random.uniform(-28.0, 28.0), self.road.np_random.uniform(-8.0, 8.0)])
        self.waits = 0

    def act(self, action: Any = None) -> None:
        way = self.target - self.position
        if np.hypot(*way) < 1.0:
            self._choose()
            way = self.target - self.position
        self.heading = float(np.arctan2(way[1], way[0]))
        blocked = self._is_blocked()
        self.waits = self.waits + 1 if blocked else 0
        if self.waits > 15:
            self._choose()
        self.action = {"steering": 0.0, "acceleration": 0.0, "wanted": 0.0 if blocked else self.pace}

    def _is_blocked(self) -> bool:
        ahead = self.position + _LOOKS * self.direction
        for other in [*self.road.vehicles, *self.road.objects]:
            if other is self or not other.collidable or not other.solid:
                continue
            c, s = np.cos(other.heading), np.sin(other.heading)
            for x, y in (ahead - other.position, 0.5 * (ahead + self.position) - other.position):
                if abs(x * c + y * s) < other.LENGTH / 2 + 0.8 and abs(y * c - x * s) < other.WIDTH / 2 + 0.8:
                    return True
        return False

    def step(self, dt: float) -> None:
        if self.impact is not None:
            self.crashed, self.impact = True, None
        wanted = 0.0 if self.crashed else self.action.get("wanted", 0.0)
        self.position = self.position + self.speed * self.direction * dt
        if self.speed > wanted:
            self.speed = max(wanted, self.speed - 2 * _ACCELERATES * dt)
        else:
            self.speed = min(wanted, self.speed + _ACCELERATES * dt)


class ParkedCar(Vehicle):
    """A car that nobody drives."""

    impact: Any
    DRIVEN = False

    def act(self, action: Any = None) -> None:
        """Nobody does."""

    def step(self, dt: float) -> None:
        if self.impact is not None:
            self.crashed, self.impact = True, None


class LotNetwork(RoadNetwork):
    """Places, all straight, among which the closest is found at once."""

    @classmethod
    def of(cls, network: RoadNetwork) -> "LotNetwork":
        self = cls()
        self.graph = network.graph
        lanes = network.lanes_dict()
        self.indices = list(lanes)
        self.starts = np.array([lane.start for lane in lanes.values()], float)
        self.along = np.array([lane.direction for lane in lanes.values()], float)
        self.headings = np.array([lane.heading for lane in lanes.values()], float)
        self.lengths = np.array([lane.length for lane in lanes.values()], float)
        return self

    def get_closest_lane_index(self, position: np.ndarray, heading: float | None = None) -> tuple:
        x, y = (position - self.starts).T
        s, lateral = x * self.along[:, 0] + y * self.along[:, 1], y * self.along[:, 0] - x * self.along[:, 1]
        distance = np.abs(lateral) + np.maximum(s - self.lengths, 0.0) + np.maximum(-s, 0.0)
        if heading is not None:
            distance += np.abs((heading - self.headings + np.pi) % (2 * np.pi) - np.pi)
        return self.indices[int(distance.argmin())]


class LotRoad(Road):
    """A road on which only those are tested for contact who could touch: walls are long and would always be."""

    def step(self, dt: float) -> None:
        for vehicle in self.vehicles:
            vehicle.step(dt)
        for i, vehicle in enumerate(self.vehicles):
            x, y = vehicle.position
            reach = 0.5 * vehicle.diagonal + 3.0 * abs(vehicle.speed) * dt + 1.0
            for other in [*self.vehicles[i + 1 :], *self.objects]:
                dx, dy = x - other.position[0], y - other.position[1]
                cos, sin = math.cos(other.heading), math.sin(other.heading)
                along = abs(dx * cos + dy * sin) - 0.5 * other.LENGTH
                across = abs(dy * cos - dx * sin) - 0.5 * other.WIDTH
                if max(along, across) <= reach + 3.0 * abs(other.speed) * dt:
                    vehicle.handle_collisions(other, dt)


class GoalAmongOthers(KinematicsGoalObservation):
    """`KinematicsGoal` whose `observation` goes on with the nearest others: the same features, relative to the car.

    Args:
      others_count: how many; zeros where there are fewer.
    """

    def __init__(self, env: Any, scales: list[float], others_count: int = 4, **config: Any) -> None:
        super().__init__(env, scales, **config)
        self.others_count = others_count

    def observe(self) -> dict[str, np.ndarray]:
        car = self.observer_vehicle
        rows = np.zeros((self.others_count + 2, len(self.features)))  # itself, its goal, the others
        if car is not None:
            x, y = car.position
            others = [v for v in self.env.road.vehicles if v is not car]
            others.sort(key=lambda v: float((v.position[0] - x) ** 2 + (v.position[1] - y) ** 2))
            found = [car.to_dict(), car.goal.to_dict(), *(v.to_dict(car) for v in others[: self.others_count])]
            for row, one in zip(rows, found, strict=False):
                row[:] = [one[name] for name in self.features] / self.scales
        return OrderedDict(
            observation=np.concatenate([rows[0], rows[2:].ravel()]), achieved_goal=rows[0], desired_goal=rows[1]
        )


class AgentsAmongOthers(MultiAgentObservation):
    """`MultiAgentObservation` of `GoalAmongOthers`."""

    def __init__(self, env: Any, observation_config: dict, **config: Any) -> None:
        self.env, self.observation_config = env, observation_config
        self.agents_observation_types = []
        for vehicle in env.controlled_vehicles:
            kind = GoalAmongOthers(env, **{k: v for k, v in observation_config.items() if k != "type"})
            kind.observer_vehicle = vehicle
            self.agents_observation_types.append(kind)


class SharedParkingEnv(ParkingEnv):
    """highway-env's car park with several agents, see the module.

    The configuration is that of `ParkingEnv`, and

      controlled_vehicles: cars that move, 1 to 4.
      vehicles_count: cars that are parked.
      pedestrians: people who walk about.
      observation: `MultiAgentObservation`; of the type "GoalAmongOthers" an agent's observation also holds the nearest
        others.

    The reward is the mean of what `ParkingEnv` gives each agent. An episode ends when a car of an agent crashes or all
    of them are parked. Every info has `is_success`: for each agent, is it parked?

    Raises:
      ValueError: a bad configuration; the message names field, value and range.
    """

    observation_type: Any
    action_type: Any
    road: Any

    @classmethod
    def default_config(cls) -> dict:
        config = super().default_config()
        goal = {**config["observation"], "type": "GoalAmongOthers", "others_count": 4}
        config.update(
            observation={"type": "MultiAgentObservation", "observation_config": goal},
            action={"type": "MultiAgentAction", "action_config": config["action"]},
            controlled_vehicles=3,
            vehicles_count=6,
            pedestrians=0,
            duration=60,
        )
        return config

    def define_spaces(self) -> None:
        wanted = self.config["observation"]
        if wanted.get("observation_config", {}).get("type") != "GoalAmongOthers":
            super().define_spaces()
            return
        self.observation_type = AgentsAmongOthers(self, **wanted)
        self.action_type = action_factory(self, self.config["action"])
        self.observation_space, self.action_space = self.observation_type.space(), self.action_type.space()

    def _create_road(self, spots: int = 14) -> None:
        super()._create_road(spots)
        stock = self.road
        self.road = LotRoad(
            network=LotNetwork.of(stock.network),
            np_random=stock.np_random,
            record_history=stock.record_history,
            neighbour_vehicles_connected_lanes=stock.neighbour_vehicles_connected_lanes,
        )

    def _create_vehicles(self) -> None:
        self._check()
        super()._create_vehicles()
        agents = self.controlled_vehicles
        self.road.vehicles[len(agents) :] = [ParkedCar.create_from(car) for car in self.road.vehicles[len(agents) :]]
        for still in [*self.road.vehicles[len(agents) :], *self.road.objects]:
            still.check_collisions = False  # toward each other; whoever moves does it
        for _ in range(self.config["pedestrians"]):
            self.road.vehicles.append(Pedestrian(self.road, self._free_place()))

    def _check(self) -> None:
        for name, (low, high) in _COUNTS.items():
            value = self.config[name]
            if not isinstance(value, int) or not low <= value <= high:
                raise ValueError(f"config {name} = {value!r}: expected a whole number from {low} to {high}")

    def _free_place(self) -> np.ndarray:
        while True:
            place = np.array([self.np_random.uniform(-28.0, 28.0), self.np_random.uniform(-8.0, 8.0)])
            if all(np.hypot(*(place - v.position)) > _FAR for v in self.road.vehicles):
                return place

    def _reward(self, action: Any) -> float:
        scales = np.array([100, 100, 5, 5, 1, 1])
        rewards = []
        for vehicle in self.controlled_vehicles:
            there, goal = (
                np.array([seen[name] for name in ("x", "y", "vx", "vy", "cos_h", "sin_h")]) / scales
                for seen in (vehicle.to_dict(), vehicle.goal.to_dict())
            )
            rewards.append(self.compute_reward(there, goal, {}) + self.config["collision_reward"] * vehicle.crashed)
        return float(np.mean(rewards))

    def _info(self, obs: Any, action: Any = None) -> dict:
        info = super(ParkingEnv, self)._info(obs, action)
        info["is_success"] = tuple(is_parked(vehicle) for vehicle in self.controlled_vehicles)
        return info

    def _is_terminated(self) -> bool:
        agents = self.controlled_vehicles
        return any(vehicle.crashed for vehicle in agents) or all(is_parked(vehicle) for vehicle in agents)


class ParkerPolicy:
    """The scripted driver as a policy of a parking environment, one agent's or several agents'.

    Args:
      env: any of highway-env's parking, or `SharedParkingEnv`, with or without a shield.
      seed: of what the drivers draw.
    """

    def __init__(self, env: Any, seed: int) -> None:
        self.env = env.unwrapped
        streams = np.random.SeedSequence(seed).spawn(len(self.env.controlled_vehicles))
        self.drivers = [Parker(np.random.default_rng(stream)) for stream in streams]

    def __call__(self, observation: Any = None) -> Any:
        """Throttle and steering in [-1, 1]; a tuple of them for several agents."""
        env = self.env
        several = hasattr(env.action_type, "agents_action_types")
        kinds = env.action_type.agents_action_types if several else [env.action_type]
        everybody = [*env.road.vehicles, *(o for o in env.road.objects if o.solid)]
        actions = []
        for driver, vehicle, kind in zip(self.drivers, env.controlled_vehicles, kinds, strict=True):
            others = [one for one in everybody if one is not vehicle]
            command = driver.command(vehicle, others, 1 / env.config["policy_frequency"])
            ranges = kind.acceleration_range, kind.steering_range
            actions.append(
                np.array([2 * (c - low) / (high - low) - 1 for c, (low, high) in zip(command, ranges, strict=True)])
                .clip(-1.0, 1.0)
                .astype(np.float32)
            )
        return tuple(actions) if several else actions[0]


gym.register(id=ENV_ID, entry_point="rss_shield.envs.worlds.parking:SharedParkingEnv")
