"""`signalised-intersection-v0`: highway-env's intersection with traffic lights.

Two groups of approaches take turns: vertical (o0, o2) and horizontal (o1, o3). Who has green has the right of way over
who has red; of two cars on green the one that turns left gives way to the one that comes towards it. A car that can no
longer stop when its green ends keeps its right to pass (`shield.definitions.signals.keep_right`); yellow and all-red
leave it time to clear the area. Importing this module registers the environment.
"""

import math
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import action_factory
from highway_env.envs.common.graphics import EnvViewer
from highway_env.envs.common.observation import GrayscaleObservation, KinematicObservation
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.road.graphics import WorldSurface
from highway_env.road.regulation import RegulatedRoad
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle

from rss_shield.shield.definitions.signals import (
    GREEN,
    RED,
    YELLOW,
    SignalPlan,
    cycle_time,
    keep_right,
    may_pass,
    signal_at,
    time_to_change,
    time_to_green,
)
from rss_shield.shield.params import PRESETS, RSSParams

ENV_ID = "signalised-intersection-v0"
GROUPS = ("vertical", "horizontal")  # approaches o0 and o2, o1 and o3
SIGNAL_NAMES = {GREEN: "green", YELLOW: "yellow", RED: "red"}
COLOURS = {GREEN: (0, 210, 0), YELLOW: (250, 210, 0), RED: (230, 0, 0)}
LINE = 98.0  # where the stop line is on every approach [m]; nobody who waits there is in the way of others
SPEED_LIMIT = 10.0  # [m/s]
AREA_LENGTH = 29.0  # from the line straight across, until the rear of a car has left [m]
DRIVER = PRESETS["intersection"].other  # who can still stop, in the eyes of the law
_TIMES = ("green", "yellow", "all_red")
_WARM_UP = 3.0  # highway-env lets traffic flow for this long before the episode [s]
_BAR = 0.8  # thickness of a stop line when drawn [m]
_STAND_OFF = 1.0  # from the line at which traffic stops [m]
_COMFORTABLE, _HARDEST = 3.0, 6.0  # braking of traffic at a line [m/s^2]
_GAP = 5.0  # time that a car that turns left leaves to those that come towards it, at the limit [s]
_LIGHTS_RANGE = 100.0  # distances to the line are observed up to this [m]


def compile_signal(config: Any, params: RSSParams = DRIVER) -> SignalPlan:
    """The `SignalPlan` that the configuration "signal" asks for: vertical first, then horizontal.

    Args:
      config: dict with "green", "yellow" and "all_red", each a number [s] or a pair (vertical, horizontal). What is
        missing has its default.
      params: `RSSParams` of the drivers.

    Raises:
      ValueError: an unknown key, not a number, a duration out of range, or yellow and all-red too short to clear the
        area; the message names field, value and range.
    """
    if not isinstance(config, dict):
        raise ValueError(f"signal = {config!r}: expected a dict with {', '.join((*_TIMES, 'offset'))}")
    defaults = SignalisedIntersectionEnv.default_config()["signal"]
    for key in config:
        if key not in defaults:
            raise ValueError(f"signal has an unknown key {key!r}: expected {', '.join(defaults)}")
    times = [_pair(name, config.get(name, defaults[name])) for name in _TIMES]
    return SignalPlan.validated(np.eye(2, dtype=bool), np.transpose(times), SPEED_LIMIT, AREA_LENGTH, params)


def _pair(name: str, value: Any) -> tuple[float, float]:
    values = tuple(value) if isinstance(value, (tuple, list, np.ndarray)) else (value, value)
    if len(values) != 2 or not all(_is_number(v) for v in values):
        raise ValueError(f"signal.{name} = {value!r}: expected a number of seconds, or two (vertical, horizontal)")
    return float(values[0]), float(values[1])


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def _check_offset(offset: Any, cycle: float) -> None:
    if offset is not None and not (_is_number(offset) and math.isfinite(offset) and 0.0 <= offset < cycle):
        raise ValueError(f"signal.offset = {offset!r}: expected None (random), or 0 <= offset < {cycle:g} s (a cycle)")


# ---------------------------------------------------------------- traffic


class SignalisedRoad(RegulatedRoad):
    """A road with traffic lights that every vehicle of traffic obeys.

    Each vehicle carries `approach` (0 to 3, -1 = none), `has_right` (may it pass the line?) and `ran_red_light` (did
    it, although it had to stop?).

    Args:
      plan: the lights.
      clock: time in the plan at which the road starts [s].
      dt: length of a simulation frame [s].
      options: as for `RegulatedRoad`.
    """

    def __init__(self, plan: SignalPlan, clock: float, dt: float, **options) -> None:
        super().__init__(**options)
        self.plan, self.start, self.dt = plan, clock, dt

    # -- lights

    @property
    def clock(self) -> float:
        """Time in the plan [s]; counted in frames, so that a light never changes a frame late."""
        return round(self.start + self.steps * self.dt, 9)

    def signal(self, approach: int) -> int:
        """GREEN, YELLOW or RED."""
        return int(signal_at(self.plan, approach % 2, self.clock))

    def time_to_change(self, approach: int) -> float:
        """Until the light of an approach shows something else [s]."""
        return float(time_to_change(self.plan, approach % 2, self.clock))

    def time_to_green(self, approach: int) -> float:
        """Until an approach has green [s]; 0 if it has."""
        return float(time_to_green(self.plan, approach % 2, self.clock))

    def approach_of(self, vehicle) -> int:
        """Approach on which a vehicle came or comes, -1 = none."""
        start, end, _ = vehicle.lane_index
        return int(start[1:]) if start[0] == "o" and end[:2] == "ir" else getattr(vehicle, "approach", -1)

    def distance_to_line(self, vehicle) -> float:
        """From the front of a vehicle to the stop line ahead [m]; 0 or less behind it, -inf if there is none."""
        start, end, _ = vehicle.lane_index
        if start[0] != "o" or end[:2] != "ir":
            return -math.inf
        return LINE - float(vehicle.lane.local_coordinates(vehicle.position)[0]) - vehicle.LENGTH / 2

    def has_left(self, vehicle) -> bool:
        """Is a vehicle on its way out of the junction?"""
        return vehicle.lane_index[0][:2] == "il"

    def same_group(self, first, second) -> bool:
        """Do two vehicles have green together?"""
        return self.approach_of(first) >= 0 and (self.approach_of(first) - self.approach_of(second)) % 2 == 0

    def has_right(self, vehicle) -> bool:
        """May a vehicle pass its line, or did it when it passed?"""
        if not hasattr(vehicle, "has_right"):
            self._see(vehicle)
        return vehicle.has_right

    # -- called by highway-env

    def act(self) -> None:
        for vehicle in self.vehicles:
            self._see(vehicle)
        super().act()
        for vehicle in self.vehicles:
            if _is_traffic(vehicle) and not vehicle.crashed:
                if self._must_wait(vehicle):
                    self._stop_at_line(vehicle)
                action = vehicle.action  # the car-following model alone would roll back
                action["acceleration"] = max(action["acceleration"], -max(vehicle.speed, 0.0) / self.dt)

    def step(self, dt: float) -> None:
        super().step(dt)
        for vehicle in self.vehicles:
            self._see(vehicle)

    def neighbour_vehicles(self, vehicle, lane_index=None):
        """Who drives ahead and behind; ahead also on the next lane of the route.

        highway-env's own search across lanes takes what comes the other way for a leader where a road ends.
        """
        front, rear = super().neighbour_vehicles(vehicle, lane_index)
        if front is None and (following := self._next_lane(vehicle, lane_index or vehicle.lane_index)) is not None:
            along = [(following.local_coordinates(v.position)[0], v) for v in self._on_lane(following, vehicle)]
            front = min(along, key=lambda found: found[0])[1] if along else None
        return front, rear

    def _next_lane(self, vehicle, lane_index):
        end = lane_index[1]
        if end[:2] == "il":
            return self.network.get_lane((end, "o" + end[2:], 0))
        connector = self._connector(vehicle)
        return self.network.get_lane((*connector, 0)) if connector and connector[0] == end else None

    def _on_lane(self, lane, observer) -> list:
        return [v for v in self.vehicles if v is not observer and lane.on_lane(v.position, margin=1)]

    def is_conflict_possible(self, first, second, *args) -> bool:
        """A car that waits at a line is in nobody's way, and its leader's business only."""
        if self._must_wait(first) or self._must_wait(second):
            return False
        return bool(RegulatedRoad.is_conflict_possible(first, second, *args))

    def respect_priorities(self, first, second):
        """Who gives way: the follower; who has not passed the line; who has no right; who turns left."""
        if first.lane_index == second.lane_index:
            return RegulatedRoad.respect_priorities(first, second)
        for front, rear in ((first, second), (second, first)):
            if rear.lane_index[1] == front.lane_index[0]:
                return rear
        passed = [self.distance_to_line(v) <= 0.0 for v in (first, second)]
        if passed[0] != passed[1]:
            return second if passed[0] else first
        ranks = [(self.has_right(v), self._rank(v) if self.same_group(first, second) else 0) for v in (first, second)]
        if ranks[0] != ranks[1]:
            return second if ranks[0] > ranks[1] else first
        return first if first.front_distance_to(second) > second.front_distance_to(first) else second

    # -- who has the right of way

    def _see(self, vehicle) -> None:
        """Take in where a vehicle is: it keeps its right to pass, loses it or gains it."""
        vehicle.approach = approach = self.approach_of(vehicle)
        distance, v = self.distance_to_line(vehicle), max(vehicle.speed, 0.0)
        if approach < 0:
            vehicle.has_right, vehicle.ran_red_light = True, False
            return
        signal = self.signal(approach)
        if not hasattr(vehicle, "has_right"):
            vehicle.has_right, vehicle.ran_red_light = bool(may_pass(signal, distance, v, DRIVER)), False
        elif distance > 0.0:
            vehicle.has_right = bool(keep_right(vehicle.has_right, signal, distance, v, DRIVER))
        elif not vehicle.has_right:
            vehicle.ran_red_light = True

    def _must_wait(self, vehicle) -> bool:
        """Must a vehicle stay behind the line ahead of it?"""
        return self.distance_to_line(vehicle) > 0.0 and (not self.has_right(vehicle) or self._gives_way(vehicle))

    def _gives_way(self, vehicle) -> bool:
        """Does somebody come towards a vehicle that turns left and can still stop?"""
        if not self._turns_left(vehicle):
            return False
        v = max(vehicle.speed, 0.0)
        if self.distance_to_line(vehicle) < v * self.dt + v**2 / (2 * _HARDEST):
            return False
        return any(self._comes_towards(vehicle, other) for other in self.vehicles)

    def _comes_towards(self, vehicle, other) -> bool:
        if (self.approach_of(other) - self.approach_of(vehicle)) % 4 != 2 or self._turns_left(other):
            return False
        distance = self.distance_to_line(other)
        if distance > 0.0:
            return self.has_right(other) and distance < _GAP * SPEED_LIMIT
        return not self.has_left(other)

    def _turns_left(self, vehicle) -> bool:
        connector = self._connector(vehicle)
        return connector is not None and (int(connector[1][2:]) - int(connector[0][2:])) % 4 == 1

    def _rank(self, vehicle) -> int:
        """Priority of the lane across the area; the lane before it says nothing about who turns."""
        connector = self._connector(vehicle)
        return self.network.get_lane((*connector, 0)).priority if connector else vehicle.lane.priority

    def _connector(self, vehicle) -> tuple[str, str] | None:
        lanes = [getattr(vehicle, "target_lane_index", None), *(getattr(vehicle, "route", None) or [])]
        return next((lane[:2] for lane in lanes if lane is not None and lane[0][:2] == "ir"), None)

    def _stop_at_line(self, vehicle) -> None:
        """Brake comfortably where that is enough."""
        v, dt = vehicle.speed, self.dt
        left = max(self.distance_to_line(vehicle) - _STAND_OFF - max(v, 0.0) * dt, 0.0)
        # from this speed on the next frame, braking in steps of dt covers no more than what is left
        allowed = _COMFORTABLE * (math.sqrt(dt**2 + 2 * left / _COMFORTABLE) - dt)
        vehicle.action["acceleration"] = min(vehicle.action["acceleration"], max((allowed - v) / dt, -_HARDEST))


def _is_traffic(vehicle) -> bool:
    """Is it driven by the simulator? The rule is highway-env's, for who may be told to yield."""
    return isinstance(vehicle, ControlledVehicle) and not isinstance(vehicle, MDPVehicle)


# ---------------------------------------------------------------- what is seen


class KinematicsWithSignal(KinematicObservation):
    """`Kinematics` with one more row at the end, about the light ahead of the observer.

    Its columns: is it green, is it yellow, is it red (0 or 1), time until it changes (in cycles), distance from the
    front of the car to the line (in 100 m, at most 1), then zeros. All zeros once the line is passed. There must be
    at least five features.
    """

    COLUMNS = 5

    def __init__(self, env, **config) -> None:
        super().__init__(env, **config)
        if len(self.features) < self.COLUMNS:
            raise ValueError(
                f"observation.features = {self.features!r}: expected at least {self.COLUMNS}, as many as there are "
                "columns about the light"
            )

    def space(self) -> gym.spaces.Space:
        return gym.spaces.Box(-np.inf, np.inf, (self.vehicles_count + 1, len(self.features)), np.float32)

    def observe(self) -> np.ndarray:
        row = np.zeros((1, len(self.features)), np.float32)
        if not self.env.road:
            return np.zeros((self.vehicles_count + 1, len(self.features)), np.float32)
        road, car = self.env.road, self.observer_vehicle
        distance = road.distance_to_line(car)
        if distance > 0.0:
            row[0, road.signal(car.approach)] = 1.0
            row[0, 3] = road.time_to_change(car.approach) / cycle_time(road.plan)
            row[0, 4] = min(distance / _LIGHTS_RANGE, 1.0)
        return np.concatenate([super().observe(), row]).astype(np.float32)


class LitSurface(WorldSurface):
    """Where highway-env draws; a coloured bar across each stop line comes before lanes and cars."""

    def __init__(self, env, plain: WorldSurface) -> None:
        super().__init__(plain.get_size(), 0, plain)
        self.env = env
        self.scaling, self.centering_position = plain.scaling, plain.centering_position

    def fill(self, colour, *rest):
        area = super().fill(colour, *rest)
        if not rest and self.env.road is not None:  # the background
            for approach in range(4):
                lane = self.env.road.network.get_lane((f"o{approach}", f"ir{approach}", 0))
                across = lane.width_at(LINE) / 2
                corners = [self.vec2pix(lane.position(s, y)) for s, y in ((LINE, -across), (LINE + _BAR, across))]
                (left, right), (top, bottom) = (sorted(axis) for axis in zip(*corners, strict=True))
                size = max(right - left, 1), max(bottom - top, 1)
                super().fill(COLOURS[self.env.road.signal(approach)], (left, top, *size))
        return area


def _light_up(env, viewer: EnvViewer) -> EnvViewer:
    viewer.sim_surface = LitSurface(env, viewer.sim_surface)
    return viewer


# ---------------------------------------------------------------- the environment


class SignalisedIntersectionEnv(IntersectionEnv):
    """highway-env's intersection with traffic lights, see the module.

    The configuration is that of `IntersectionEnv`, and

      signal: dict of "green", "yellow", "all_red" [s], each a number or a pair (vertical, horizontal), and "offset",
        where in the cycle an episode starts [s]; None = random. The vertical approaches have green first.
      observation: type "KinematicsWithSignal" adds a row about the ego's light, see there.
      duration: 30 s, because a cycle takes longer than the 13 s of `IntersectionEnv`.

    Every info has `signal`, what the ego's light shows, "" once the line is passed, and `ran_red_light`: has the ego
    passed the line on yellow or red, although it was able to stop when its green ended?

    Raises:
      ValueError: a bad configuration; the message names field, value and range.
    """

    observation_type: Any
    road: Any
    viewer: Any

    @classmethod
    def default_config(cls) -> dict:
        config = super().default_config()
        config["observation"]["type"] = "KinematicsWithSignal"
        config["signal"] = {"green": 8.0, "yellow": 3.0, "all_red": 2.0, "offset": None}
        config["duration"] = 30
        return config

    def define_spaces(self) -> None:
        if self.config["observation"]["type"] != "KinematicsWithSignal":
            super().define_spaces()
            if isinstance(self.observation_type, GrayscaleObservation):
                _light_up(self, self.observation_type.viewer)
            return
        self.observation_type = KinematicsWithSignal(self, **self.config["observation"])
        self.action_type = action_factory(self, self.config["action"])
        self.observation_space = self.observation_type.space()
        self.action_space = self.action_type.space()

    def render(self):
        if self.viewer is None and self.render_mode is not None:
            self.viewer = _light_up(self, EnvViewer(self))
        return super().render()

    def _make_road(self) -> None:
        super()._make_road()
        plan = compile_signal(self.config["signal"])
        offset = self.config["signal"].get("offset")
        _check_offset(offset, cycle_time(plan))
        if offset is None:
            offset = self.np_random.uniform(0.0, cycle_time(plan))
        stock = self.road
        self.road = SignalisedRoad(
            plan,
            float(offset) - _WARM_UP,
            1 / self.config["simulation_frequency"],
            network=stock.network,
            np_random=stock.np_random,
            record_history=stock.record_history,
            neighbour_vehicles_connected_lanes=stock.neighbour_vehicles_connected_lanes,
        )

    def _make_vehicles(self, n_vehicles: int = 10) -> None:
        super()._make_vehicles(n_vehicles)
        for vehicle in self.road.vehicles:
            self.road.has_right(vehicle)  # the ego and its challenger come last

    def _info(self, obs, action=None) -> dict:
        info = super()._info(obs, action)
        waits = self.road.distance_to_line(self.vehicle) > 0.0
        info["signal"] = SIGNAL_NAMES[self.road.signal(self.vehicle.approach)] if waits else ""
        info["ran_red_light"] = self.vehicle.ran_red_light
        return info


gym.register(id=ENV_ID, entry_point="rss_shield.envs.worlds.signalised:SignalisedIntersectionEnv")
