"""A scripted situation on a straight road: a few cars that do what is written, one of them with a shield."""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from highway_env.road.lane import LineType, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.recorder import Film
from rss_shield.envs.highway.step import begin_step
from rss_shield.envs.options import LANES, Settings
from rss_shield.envs.roads.slip import steering_of
from rss_shield.shield.definitions.response import AXES
from rss_shield.shield.lanes.responses import response_name
from rss_shield.shield.params import RSSParams, Rules, Table
from rss_shield.shield.trace import Trace

DT = 0.1  # length of a frame [s]
LANE_WIDTH = 4.0  # [m]
_ROAD = 2000.0  # to either side of the start [m]
_TURNS = 0.5  # largest angle of the wheels that a script turns to [rad]

# The table of all scenarios: round numbers, so that distances can be worked out by hand.
EGO = RSSParams.validated(
    response_time=0.5,
    a_max_accel=2.0,
    a_min_brake=4.0,
    a_max_brake=8.0,
    a_min_brake_correct=3.0,
    a_lat_max_accel=0.5,
    a_lat_min_brake=1.0,
    mu=0.2,
    standstill_gap=1.0,
    v_cap=np.inf,
)
OTHER = EGO._replace(response_time=1.0)
RULES = Rules(anticipation=0.0)  # what the proper response does, not what is done before it
LITERAL = RULES._replace(present_duties=False)  # Def. 10 to the letter (hole H6)


class Car(NamedTuple):
    """One car and its script."""

    name: str
    y: float  # of its centre across the road, positive to the right [m]
    s: float  # along the road [m]
    v: float  # speed [m/s]
    phases: tuple[tuple[float, float], ...] = ()  # (until [s], acceleration [m/s^2]); then it keeps its speed
    sideways: tuple[tuple[float, float, float], ...] = ()  # (from [s], until [s], speed to the right [m/s])
    length: float = 5.0  # [m]
    turned: bool = False  # drives the other way
    backs_up: bool = False  # its braking does not end at rest


@dataclass(frozen=True)
class Scenario:
    """A situation, and what is expected of it, worked out by hand in `why`. The first car is the ego.

    Verdicts are those from the ego's view: "" = no contact, "ego", "other", "both", "inherited".
    """

    name: str
    why: str
    cars: tuple[Car, ...]
    off: str  # verdict without the shield
    on: str  # and with it
    partner: str = ""  # with whom the ego comes into danger
    danger: float | None = None  # when [s]; None = never
    axis: str = ""  # that was safe last
    response: str = ""  # that is owed on the first dangerous sample
    evaded: str | None = None  # verdict with evasive effort besides, where that is another than with the shield
    literal: str | None = None  # verdict under Def. 10 as printed, where that is another
    seconds: float = 10.0  # that are played
    lanes: tuple[tuple[float, bool], ...] = ((0.0, False), (4.0, False), (8.0, False))  # middle [m], runs the other way
    kind: str = ""  # of situation, by the catalogues

    @property
    def evading(self) -> str:
        """Verdict with evasive effort."""
        return self.on if self.evaded is None else self.evaded


class Result(NamedTuple):
    """What a scenario came to."""

    verdict: str
    danger: float | None  # first dangerous sample with the partner [s]
    axis: str
    response: str  # owed on that sample
    trace: Trace
    broken: int  # duties that the ego broke, in pair-frames
    speed_lost: float  # of the ego, by what its shield did [m/s]


class Scripted(Vehicle):
    """A car that does what is written."""

    script: Car
    clock = 0.0

    def act(self, action: Any = None) -> None:
        self.action = self.commands() if action is None else dict(action)

    def commands(self) -> dict[str, float]:
        """What its script says for this frame."""
        car, t = self.script, self.clock + 1e-9
        acceleration = next((a for until, a in car.phases if t < until), 0.0)
        if not car.backs_up:
            acceleration = max(acceleration, -max(self.speed, 0.0) / DT)
        wanted = next((w for start, until, w in car.sideways if start <= t < until), 0.0)
        return {"acceleration": acceleration, "steering": self._steering(-wanted if car.turned else wanted)}

    def _steering(self, lateral_speed: float) -> float:
        """Angle of the wheels that leads to a speed across the road, to the right of the car [rad]."""
        if abs(self.speed) < 0.1:
            return 0.0
        course = np.arcsin(np.clip(lateral_speed / self.speed, -0.5, 0.5)) + (np.pi if self.script.turned else 0.0)
        slip = (course - self.heading + np.pi) % (2.0 * np.pi) - np.pi
        return float(np.clip(steering_of(np.clip(slip, -0.4, 0.4)), -_TURNS, _TURNS))


@dataclass
class Stage:
    """What `Film` asks of an environment."""

    road: Road
    controlled_vehicles: list[Any]
    config: dict[str, Any] = field(default_factory=lambda: {"simulation_frequency": 1.0 / DT})
    spec: Any = None

    @property
    def unwrapped(self) -> "Stage":
        return self


def play(scenario: Scenario, shield: bool, rules: Rules = RULES, evasion: bool = False) -> Result:
    """Play a scenario.

    Args:
      scenario: `Scenario`.
      shield: does it act, or watch only?
      rules: in force.
      evasion: does it make an evasive effort?
    """
    road = Road(network=_network(scenario), vehicles=[], np_random=np.random.RandomState(0))
    cars = [_car(road, car) for car in scenario.cars]
    road.vehicles = list(cars)
    ego = cars[0]
    guard = ShieldedEgo(ego, Settings(Table(EGO, OTHER, rules, DT), shield, LANES, evasion=evasion))
    guard.is_ego = True
    stage: Any = Stage(road, [ego])
    film = Film(stage)
    danger, axis, response, lost = None, "", "", 0.0
    for frame in range(round(scenario.seconds / DT)):
        for car in cars:
            car.clock = frame * DT
        begin_step(guard)
        ego.act(ego.commands())
        road.act()
        partner = next((k for k, other in enumerate(guard.others) if other.script.name == scenario.partner), None)
        if danger is None and partner is not None and not guard.has_contact and guard.memory["since"][partner] > 0:
            danger, axis = frame * DT, AXES[int(guard.memory["axes"][partner])]
        look = guard.look
        if look is not None and danger == frame * DT:
            response = _response(look.response)
        if look is not None and not guard.has_contact:
            lost += (look.wish.acceleration - look.command.acceleration) * DT
        road.step(DT)
        guard.check_contact()
        film.look_for_contacts()
        if guard.has_contact and any(car.crashed for car in cars):
            break
    trace = film.develop()
    named = replace(trace.users, ids=tuple(car.name for car in scenario.cars))
    trace = trace.replaced(users=named, meta=trace.meta | _meta(scenario, rules, shield))
    broken = int(guard.since["broken_duties"])
    return Result(guard.blame, danger, axis, response, trace, broken, lost)


def _response(bits: int) -> str:
    name = response_name(bits)
    return "" if name == "none" else name


def _meta(scenario: Scenario, rules: Rules, shield: bool) -> dict[str, Any]:
    params = {"ego": EGO._asdict(), "other": OTHER._asdict()}
    return {
        "env_id": f"scenario {scenario.name}",
        "mode": "override" if shield else "monitor",
        "scheme": "lanes",
        "params": params,
        "rules": rules._asdict(),
        "judge_params": params,
        "judge_rules": rules._asdict(),
    }


def _network(scenario: Scenario) -> RoadNetwork:
    network = RoadNetwork()
    for y, opposite in scenario.lanes:
        ends = [(_ROAD, y), (-_ROAD, y)] if opposite else [(-_ROAD, y), (_ROAD, y)]
        names = ("b", "a") if opposite else ("a", "b")
        lines = (LineType.STRIPED, LineType.STRIPED)
        network.add_lane(*names, StraightLane(*ends, width=LANE_WIDTH, line_types=lines, speed_limit=30.0))
    return network


def _car(road: Road, car: Car) -> Scripted:
    vehicle = Scripted(road, [car.s, car.y], np.pi if car.turned else 0.0, car.v)
    vehicle.script, vehicle.LENGTH = car, car.length
    vehicle.diagonal = float(np.hypot(vehicle.LENGTH, vehicle.WIDTH))
    return vehicle
