"""A scripted situation where roads cross: a few cars that drive along their routes at written accelerations."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.highway.recorder import Film
from rss_shield.envs.highway.step import attach, begin_step
from rss_shield.envs.options import Options, settings_for
from rss_shield.envs.stock import make_stock
from rss_shield.eval.suite.scenarios.stage import Stage
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.trace import Trace

FRAME = 1.0 / 15.0  # [s]
TABLE = "intersection"


class Rider(NamedTuple):
    """One car and its script."""

    name: str
    lane: tuple[str, str, int]  # that it starts on
    s: float  # along it [m]
    v: float  # [m/s]
    to: str  # node where it goes
    phases: tuple[tuple[float, float], ...] = ()  # (until [s], acceleration [m/s^2]); then it keeps its speed


@dataclass(frozen=True)
class Crossing:
    """A situation, and what is expected of it, worked out by hand in `why`. The first car is the ego."""

    name: str
    why: str
    env_id: str
    riders: tuple[Rider, ...]
    off: str  # verdict without the shield, from the ego's view
    on: str  # and with it
    touched: float | None  # when the cars touch without the shield [s]; None = they do not
    kind: str
    seconds: float = 12.0


class Crossed(NamedTuple):
    """What a crossing came to."""

    verdict: str
    touched: float | None  # [s]
    trace: Trace
    broken: int  # duties that the ego broke, in pair-frames
    lowest: float  # speed of the ego [m/s]


class OnRoute(ControlledVehicle):
    """A car that does what is written."""

    script: Rider
    clock = 0.0

    def act(self, action: Any = None) -> None:
        self.follow_road()
        t = self.clock + 1e-9
        acceleration = next((a for until, a in self.script.phases if t < until), 0.0)
        steering = float(np.clip(self.steering_control(self.target_lane_index), -np.pi / 3, np.pi / 3))
        Vehicle.act(self, {"steering": steering, "acceleration": max(acceleration, -max(self.speed, 0.0) / FRAME)})


def play_crossing(crossing: Crossing, shield: bool) -> Crossed:
    """Play a crossing.

    Args:
      crossing: `Crossing`.
      shield: does it act, or watch only?
    """
    env: Any = make_stock(crossing.env_id).unwrapped
    env.reset(seed=0)
    road = env.road
    cars = [_car(road, rider) for rider in crossing.riders]
    road.vehicles = list(cars)
    ego = cars[0]
    mode = "override" if shield else "monitor"
    guard = attach(ego, settings_for(env, PRESETS[TABLE], Rules(anticipation=0.0), mode, Options().conduct))
    guard.is_ego = True
    stage: Any = Stage(road, [ego], {**env.config, "simulation_frequency": 1.0 / FRAME})
    film = Film(stage)
    touched, lowest = None, np.inf
    for frame in range(round(crossing.seconds / FRAME)):
        for car in cars:
            car.clock = frame * FRAME
        begin_step(guard)
        road.act()
        road.step(FRAME)
        lowest = min(lowest, float(ego.speed))
        guard.check_contact()
        film.look_for_contacts()
        if guard.has_contact and touched is None:
            touched = (frame + 1) * FRAME
        if guard.has_contact and ego.crashed:
            break
    return Crossed(guard.blame, touched, film.develop(), int(guard.since["broken_duties"]), lowest)


def _car(road: Any, rider: Rider) -> OnRoute:
    lane = road.network.get_lane(rider.lane)
    car = OnRoute(road, lane.position(rider.s, 0.0), lane.heading_at(rider.s), rider.v)
    car.script = rider
    car.plan_route_to(rider.to)
    return car
