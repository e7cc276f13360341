"""Road networks drawn at random, with traffic: `random-roads-v0`. The seed of a reset is the network.

Rings, forks and winding roads of short pieces, curves of 40 to 200 m, one to four lanes, also with oncoming
traffic. The ego has a planned route or none. It meets IDM drivers, parked cars and faster tailgaters.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from highway_env.envs.highway_env import HighwayEnv
from highway_env.road.lane import AbstractLane, CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle

KINDS = ("ring", "fork", "chain")
RADII = (40.0, 200.0)  # of the innermost lane [m]
_WIDTH = 4.0  # of a lane [m]
_LANES = 60  # more would only be slow
_APPROACH = 150.0  # road behind the ego where it does not close on itself [m]
_ROOM = 14.0  # between the centres of cars at the start [m]
_CLEAR = 60.0, 100.0  # nobody starts so near behind or ahead of the ego in its lane [m]


class Pose(NamedTuple):
    """A point of a line and its direction: [m], [m], [rad]."""

    x: float
    y: float
    heading: float


class Element(NamedTuple):
    """A part of a line with constant curvature."""

    curvature: float  # to the right [1/m]
    length: float  # [m]


class Section(NamedTuple):
    """A road between two nodes: `lanes` side by side, the first one on the line, the others right of it."""

    origin: str
    end: str
    start: Pose
    element: Element
    lanes: int
    first: int = 0  # index of its first lane, counted from the line


class Tailgater(IDMVehicle):
    """Keeps its speed and its lane, whoever is ahead."""

    def act(self, action: Any = None) -> None:
        if not self.crashed:
            self.follow_road()
            self.action = {"steering": self.steering_control(self.target_lane_index), "acceleration": 0.0}


# ---------------------------------------------------------------- lines


def advance(start: Pose, element: Element) -> Pose:
    """Where a line is after an element."""
    (x, y, heading), (kappa, length) = start, element
    turned = heading + kappa * length
    if kappa == 0.0:
        return Pose(x + length * np.cos(heading), y + length * np.sin(heading), heading)
    x += (np.sin(turned) - np.sin(heading)) / kappa
    y -= (np.cos(turned) - np.cos(heading)) / kappa
    return Pose(x, y, turned)


def lane_beside(start: Pose, element: Element, offset: float, reverse: bool = False) -> AbstractLane:
    """A lane `offset` to the right of an element of a line, in its direction or against it."""
    (x, y, heading), (kappa, length) = start, element
    right = np.array([-np.sin(heading), np.cos(heading)])
    if kappa == 0.0:
        begin = np.array([x, y]) + offset * right
        ends = begin, begin + length * np.array([np.cos(heading), np.sin(heading)])
        return StraightLane(*(ends[::-1] if reverse else ends), speed_limit=30)
    centre, turn = np.array([x, y]) + right / kappa, np.sign(kappa)
    phase = heading - turn * np.pi / 2
    phases = phase, phase + kappa * length
    radius = 1.0 / abs(kappa) - turn * offset
    begin, end = phases[::-1] if reverse else phases
    return CircularLane(centre, radius, begin, end, bool(turn > 0) != reverse, speed_limit=30)


def draw_bend(rng: np.random.Generator, turn: int, lanes: int, oncoming: int, angle: float) -> Element:
    """An arc whose innermost lane has one of `RADII`, `turn` > 0 to the right."""
    inner = (lanes - 1) * _WIDTH if turn > 0 else oncoming * _WIDTH
    radius = rng.uniform(*RADII) + inner
    return Element(turn / radius, angle * radius)


def draw_ring(rng: np.random.Generator, lanes: int, oncoming: int) -> list[Element]:
    """A circle, or a rectangle with four different corners."""
    turn = int(rng.choice([-1, 1]))
    if rng.random() < 0.4:
        return [draw_bend(rng, turn, lanes, oncoming, 2 * np.pi)]
    corners = [draw_bend(rng, turn, lanes, oncoming, np.pi / 2) for _ in range(4)]
    radii = [1 / abs(corner.curvature) for corner in corners]
    long, wide = (max(radii[i] + radii[i + 1], radii[i - 2] + radii[i - 1]) + rng.uniform(5, 80) for i in (0, 1))
    elements = []
    for i in range(4):
        side = (long, wide, long, wide)[i] - radii[i] - radii[(i + 1) % 4]
        elements += [Element(0.0, side), corners[(i + 1) % 4]]
    return elements


def draw_line(rng: np.random.Generator, length: float, lanes: int, oncoming: int) -> list[Element]:
    """Straights and bends, never far from the direction at the start, so that the line does not cross itself."""
    elements: list[Element] = []
    heading = total = 0.0
    while total < length:
        turn = -1 if heading > 0.4 or (heading > -0.4 and rng.random() < 0.5) else 1
        straight, bend = rng.uniform(10, 60), draw_bend(rng, turn, lanes, oncoming, rng.uniform(0.2, 0.9))
        elements += [Element(0.0, straight), bend] if rng.random() < 0.6 else [bend]
        heading += bend.curvature * bend.length
        total = sum(element.length for element in elements)
    return elements


def cut(rng: np.random.Generator, elements: list[Element], longest: float) -> list[Element]:
    """The same line in shorter pieces."""
    pieces = []
    for curvature, length in elements:
        shares = rng.uniform(0.4, 1.0, max(1, int(np.ceil(length / longest))))
        pieces += [Element(curvature, float(length * share)) for share in shares / shares.sum()]
    return pieces


# ---------------------------------------------------------------- networks


class Plan(NamedTuple):
    """A network, and the roads along which its traffic starts."""

    kind: str
    sections: list[Section]
    way: list[Section]  # in the order in which they are driven
    oncoming: int  # lanes against them
    destination: str | None  # of the ego


def draw_plan(rng: np.random.Generator, kind: str) -> Plan:
    lanes, oncoming = int(rng.integers(1, 5)), 0
    if kind != "fork" and rng.random() < 0.4:
        oncoming = int(rng.integers(1, 3))
    longest = float(rng.choice([8.0, 25.0, 90.0]))
    if kind == "ring":
        elements = draw_ring(rng, lanes, oncoming)
        longest = max(longest, sum(element.length for element in elements) * (lanes + oncoming) / _LANES)
        pieces = cut(rng, elements, longest)
        if len(pieces) == 1:
            pieces = cut(rng, elements, elements[0].length / 2)
        way = _sections(pieces, Pose(0.0, 0.0, rng.uniform(-3, 3)), [lanes] * len(pieces), "")
        way[-1] = way[-1]._replace(end=way[0].origin)
        return Plan(kind, way, way, oncoming, None)
    start = Pose(0.0, 0.0, rng.uniform(-3, 3))
    if kind == "chain":
        longest = max(longest, 700.0 * (lanes + oncoming) / _LANES)
        pieces = cut(rng, draw_line(rng, 600.0, lanes, oncoming), longest)
        changes = rng.random() < 0.3 and not oncoming
        few = int(rng.integers(1, lanes + 1)) if changes else lanes
        counts = [lanes if i < len(pieces) / 2 else few for i in range(len(pieces))]
        way = _sections(pieces, start, counts, "")
        return Plan(kind, way, way, oncoming, way[-1].end if rng.random() < 0.7 else None)
    longest = max(longest, 1200.0 * lanes / _LANES)
    trunk = _sections(cut(rng, draw_line(rng, rng.uniform(160, 260), lanes, 0), longest), start, [lanes] * 1000, "")
    fork = advance(trunk[-1].start, trunk[-1].element)
    branches: list[list[Section]] = []
    for turn in rng.permutation([-1, 0, 1])[: int(rng.integers(2, 4))]:
        bend = draw_bend(rng, int(turn) or 1, lanes, 0, rng.uniform(0.5, 1.3))
        elements = [bend, Element(0.0, 250.0)] if turn else [Element(0.0, 350.0)]
        few = int(rng.integers(1, lanes + 1)) if rng.random() < 0.3 else lanes  # an exit from one side
        pieces = cut(rng, elements, longest)
        branch = _sections(pieces, fork, [few] * len(pieces), "abc"[len(branches)], lanes - few if turn > 0 else 0)
        branches.append([branch[0]._replace(origin=trunk[-1].end), *branch[1:]])
    chosen = branches[int(rng.integers(len(branches)))]
    sections = trunk + [section for branch in branches for section in branch]
    return Plan(kind, sections, trunk + chosen, 0, chosen[-1].end if rng.random() < 0.7 else None)


def _sections(pieces: list[Element], start: Pose, counts: list[int], name: str, first: int = 0) -> list[Section]:
    sections = []
    for i, element in enumerate(pieces):
        sections.append(Section(f"{name}{i}", f"{name}{i + 1}", start, element, counts[i], first))
        start = advance(start, element)
    return sections


def build(plan: Plan) -> RoadNetwork:
    network = RoadNetwork()
    for section in plan.sections:
        for i in range(section.lanes):
            lane = lane_beside(section.start, section.element, (section.first + i) * _WIDTH)
            network.add_lane(section.origin, section.end, lane)
    for section in plan.sections:
        for i in range(plan.oncoming):
            lane = lane_beside(section.start, section.element, -(i + 1) * _WIDTH, reverse=True)
            network.add_lane(f"{section.end}-", f"{section.origin}-", lane)
    return network


# ---------------------------------------------------------------- the environment


class RandomRoads(HighwayEnv):
    """See the module. Configuration: `kind`, one of `KINDS` or None for any."""

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        config = super().default_config()
        config.update(kind=None, duration=15, vehicles_count=5, neighbour_vehicles_connected_lanes=True)
        return config

    def _create_road(self) -> None:
        rng = self.np_random
        kind = self.config["kind"]
        if kind is not None and kind not in KINDS:
            raise ValueError(f"config.kind = {kind!r}: expected None or one of {', '.join(KINDS)}")
        self.plan = draw_plan(rng, kind or str(rng.choice(KINDS)))
        self.road = Road(network=build(self.plan), np_random=rng, neighbour_vehicles_connected_lanes=True)

    def _create_vehicles(self) -> None:
        rng, plan = self.np_random, self.plan
        total = sum(section.element.length for section in plan.way)
        here = rng.uniform(0.0, total) if plan.kind == "ring" else _APPROACH + rng.uniform(-20.0, 20.0)
        self.controlled_vehicles = []
        speed = rng.uniform(15.0, 28.0)
        ego = self._place(self.action_type.vehicle_class, here, speed)
        if plan.destination is not None and isinstance(ego, ControlledVehicle):
            ego.plan_route_to(plan.destination)
        self.controlled_vehicles.append(ego)
        for _ in range(self.config["vehicles_count"]):
            ahead = rng.uniform(-140.0, 250.0)
            lane = int(rng.integers(4))
            if lane == ego.lane_index[2] and -_CLEAR[0] < ahead < _CLEAR[1]:
                continue
            driver = self._place(IDMVehicle, here + ahead, rng.uniform(8.0, 28.0), lane)
            if driver is not None:
                driver.randomize_behavior()
        if rng.random() < 0.6:
            behind = rng.uniform(80.0, 160.0)
            self._place(Tailgater, here - behind, speed + rng.uniform(0.0, 10.0), ego.lane_index[2])
        for _ in range(int(rng.integers(3))):
            self._place(Vehicle, here + rng.uniform(_CLEAR[1], 300.0), 0.0)
        if plan.oncoming:
            for _ in range(2):
                self._place(IDMVehicle, here + rng.uniform(30.0, 400.0), rng.uniform(10.0, 25.0), oncoming=True)

    def _place(self, kind: Any, s: float, speed: float, lane: int | None = None, oncoming: bool = False) -> Any:
        """Put a car on the way, unless somebody is there or the way does not reach so far."""
        way = self.plan.way
        total = sum(section.element.length for section in way)
        if self.plan.kind == "ring":
            s %= total
        for section in way:
            if 0.0 <= s <= section.element.length:
                break
            s -= section.element.length
        else:
            return None
        lanes = self.plan.oncoming if oncoming else section.lanes
        index = int(self.np_random.integers(lanes)) if lane is None else lane
        if index >= lanes:
            return None
        origin, end = (f"{section.end}-", f"{section.origin}-") if oncoming else (section.origin, section.end)
        road = self.road.network.get_lane((origin, end, index))
        along = road.length * (1.0 - s / section.element.length if oncoming else s / section.element.length)
        position = road.position(along, 0.0)
        if any(np.hypot(*(other.position - position)) < _ROOM for other in self.road.vehicles):
            return None
        car = kind(self.road, position, road.heading_at(along), speed)
        self.road.vehicles.append(car)
        return car


gym.register("random-roads-v0", entry_point="rss_shield.envs.worlds.random_roads:RandomRoads")
