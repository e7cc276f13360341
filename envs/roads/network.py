"""A highway-env road network as arrays, and the coordinates along its lanes.

Lanes stand in the order in which highway-env walks through its dictionary: ties in its searches are
decided by that order.
"""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from highway_env.road.lane import CircularLane, SineLane, StraightLane
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs._numpy.floats import dot, norm, wrap_to_pi
from rss_shield.envs._numpy.ufuncs import arctan, arctan2
from rss_shield.shield._numba.compiled import compiled, inner, part, records

CAR_LENGTH, CAR_WIDTH = 5.0, 2.0  # of every vehicle of highway-env [m]
STRAIGHT, SINE, CIRCULAR = range(3)

LANE = records(
    [
        ("kind", "i8"),  # STRAIGHT, SINE or CIRCULAR
        ("road", "i8"),  # index of the road it belongs to
        ("id", "i8"),  # index within that road, counted to the right
        ("siblings", "i8"),  # lanes of that road, itself included
        ("priority", "i8"),
        ("forbidden", "?"),  # nobody changes to it
        ("exits", "?"),  # leads out of an intersection
        ("x", "f8"),  # start, or centre of the circle [m]
        ("y", "f8"),
        ("dx", "f8"),  # unit vector along it
        ("dy", "f8"),
        ("lx", "f8"),  # unit vector to its right
        ("ly", "f8"),
        ("heading", "f8"),  # [rad]
        ("length", "f8"),  # [m]
        ("width", "f8"),  # [m]
        ("speed_limit", "f8"),  # [m/s], inf = none
        ("amplitude", "f8"),  # of a sine [m]
        ("pulsation", "f8"),  # [rad/m]
        ("phase", "f8"),  # [rad]
        ("radius", "f8"),  # of a circle [m]
        ("start_phase", "f8"),  # [rad]
        ("turn", "f8"),  # +1 clockwise, -1 counter-clockwise
        ("left", "f8"),  # range of its middle in x [m]
        ("right", "f8"),
        ("low", "f8"),  # and in y [m]
        ("high", "f8"),
    ]
)

ROAD = records(
    [
        ("first", "i8"),  # its leftmost lane
        ("lanes", "i8"),
        ("origin", "i8"),  # node where it starts
        ("end", "i8"),  # node where it ends
    ]
)


class Network(NamedTuple):
    """Everything about the roads that compiled code asks for. R roads, L lanes; -1 pads rows."""

    lanes: np.ndarray  # `[L]` LANE
    roads: np.ndarray  # `[R]` ROAD
    next_roads: np.ndarray  # `[R, *]` roads that start where this one ends
    links: np.ndarray  # `[L, *]` lanes searched for neighbours of a car on this lane, itself first
    link_offsets: np.ndarray  # `[L, *]` what their arc lengths count from on this lane [m]
    link_bits: np.ndarray  # `[L]` the same lanes as a set of bits, -1 = any lane
    route_roads: np.ndarray  # `[P, *]` roads of each planned route
    route_lanes: np.ndarray  # `[P, *]` lane id on each, -1 = any
    plans: np.ndarray  # `[L, D]` route from a lane to each of the destinations
    spacing: float  # of lanes that all run side by side along the x-axis, from 0 on [m]; 0 = other roads


def compile_network(network, connected: bool, destinations: tuple[str, ...] = (), lined_up: bool = True) -> Network:
    """Arrays of a `highway_env.road.road.RoadNetwork`.

    Args:
      network: the road network.
      connected: neighbours are searched on connected lanes too.
      destinations: nodes that cars plan their routes to.
      lined_up: cars are sorted along each lane; else neighbours are searched among all of them, as
        on connected lanes.

    Raises:
      ValueError: a kind of lane that is not supported.
    """
    ways = [(origin, end) for origin, ends in network.graph.items() for end in ends]
    nodes: dict[str, int] = {}
    for way in ways:
        for node in way:
            nodes.setdefault(node, len(nodes))
    roads = np.zeros(len(ways), ROAD)
    indices = list(network.lanes_dict())
    number = {index: i for i, index in enumerate(indices)}
    for r, (origin, end) in enumerate(ways):
        lanes = network.graph[origin][end]
        roads[r] = (number[origin, end, 0], len(lanes), nodes[origin], nodes[end])
    lanes = np.concatenate([_lane(network.get_lane(index), ways.index(index[:2]), index) for index in indices])
    lanes["siblings"] = roads["lanes"][lanes["road"]]

    next_roads = [[r for r, way in enumerate(ways) if way[0] == end] for _, end in ways]
    links, offsets = zip(*(_links(network, index, number, connected) for index in indices), strict=True)
    route_roads: list[list[int]] = []
    route_lanes: list[list[int]] = []
    plans = np.zeros((len(indices), len(destinations)), np.int64)
    for i, index in enumerate(indices):
        for d, destination in enumerate(destinations):
            plans[i, d] = len(route_roads)
            route = _plan(network, index, destination)
            route_roads.append([ways.index(step[:2]) for step in route])
            route_lanes.append([-1 if step[2] is None else step[2] for step in route])
    return Network(
        lanes,
        roads,
        _padded(next_roads, np.int64, -1),
        _padded(links, np.int64, -1, 1 if lined_up else 2),
        _padded(offsets, np.float64, 0.0, 1 if lined_up else 2),
        np.array([sum(1 << link for link in set(row)) if len(indices) < 63 else -1 for row in links], np.int64),
        _padded(route_roads, np.int64, -1),
        _padded(route_lanes, np.int64, -1),
        plans,
        _spacing(lanes),
    )


def _spacing(lanes: np.ndarray) -> float:
    """`Network.spacing`. On such roads arc lengths are x and lateral offsets differences of y, to the last bit."""
    along_x = (lanes["kind"] == STRAIGHT) & (lanes["x"] == 0) & (lanes["dx"] == 1) & (lanes["dy"] == 0)
    if not along_x.all() or np.ptp(lanes["road"]) > 0 or np.ptp(lanes["length"]) > 0:
        return 0.0
    return float(min(np.diff(np.sort(lanes["y"])), default=np.inf))


def _lane(lane, road: int, index) -> np.ndarray:
    row = np.zeros(1, LANE)
    row["road"], row["id"] = road, index[2]
    row["forbidden"], row["priority"] = lane.forbidden, lane.priority
    row["exits"] = "il" in index[0] and "o" in index[1]
    row["length"], row["width"] = lane.length, lane.width_at(0.0)
    row["speed_limit"] = np.inf if lane.speed_limit is None else lane.speed_limit
    if isinstance(lane, StraightLane):
        row["kind"] = STRAIGHT
        (row["x"], row["y"]), (row["dx"], row["dy"]) = lane.start, lane.direction
        (row["lx"], row["ly"]), row["heading"] = lane.direction_lateral, lane.heading
        if isinstance(lane, SineLane):
            row["kind"] = SINE
            row["amplitude"], row["pulsation"], row["phase"] = lane.amplitude, lane.pulsation, lane.phase
    elif isinstance(lane, CircularLane):
        row["kind"] = CIRCULAR
        (row["x"], row["y"]), row["radius"] = lane.center, lane.radius
        row["start_phase"], row["turn"] = lane.start_phase, lane.direction
    else:
        raise ValueError(f"lane {index} is a {type(lane).__name__}; expected StraightLane, SineLane or CircularLane")
    (row["left"], row["low"]), (row["right"], row["high"]) = _range(lane, row)
    return row


def _range(lane, row) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest x and y of the middle of a lane [m]."""
    s = np.array([0.0, lane.length])
    if isinstance(lane, CircularLane):  # there, and where it runs along an axis
        crests = lane.direction * (np.arange(-8, 9) * np.pi / 2 - lane.start_phase) * lane.radius
        s = np.append(s, crests[(crests > 0.0) & (crests < lane.length)])
    points = np.array([lane.position(along, 0.0) for along in s])
    # the crests of a sine lie within its amplitude of the line between its ends
    return points.min(0) - row["amplitude"], points.max(0) + row["amplitude"]


def _links(network, index, number, connected: bool):
    """Lanes on which `Road.neighbour_vehicles` looks around a lane, in its order, with their offsets."""
    lane = network.get_lane(index)
    found, offsets = [number[index]], [0.0]
    if connected:
        origin, end, i = index
        for following, lanes in network.graph.get(end, {}).items():
            found.append(number[end, following, i if i < len(lanes) else 0])
            offsets.append(lane.length)
        for before, ends in network.graph.items():
            if origin in ends:
                previous = (before, origin, i if i < len(ends[origin]) else 0)
                found.append(number[previous])
                offsets.append(-network.get_lane(previous).length)
    return found, offsets


def _plan(network, index, destination: str):
    """The route that a car on lane `index` plans."""
    car = SimpleNamespace(road=SimpleNamespace(network=network), lane_index=index, route=None)
    return ControlledVehicle.plan_route_to(car, destination).route


def _padded(rows, dtype, filler, width: int = 1) -> np.ndarray:
    table = np.full((len(rows), max([width, *map(len, rows)])), filler, dtype)
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    return table


# ---------------------------------------------------------------- coordinates


@compiled
def local_coordinates(lane, x, y):
    """Arc length and signed lateral offset of a point on a lane [m]."""
    dx, dy = x - lane.x, y - lane.y
    if lane.kind == CIRCULAR:
        return around(lane, dx, dy, arctan2(dy, dx))
    return beside(lane, dx, dy)


@compiled
def around(lane, dx, dy, angle):
    """`local_coordinates` on a circular lane, of a point given by its offset from the centre [m, rad]."""
    phi = wrap_to_pi(angle - lane.start_phase) + lane.start_phase
    return lane.turn * (phi - lane.start_phase) * lane.radius, lane.turn * (lane.radius - norm(dx, dy))


@compiled
def beside(lane, dx, dy):
    """`local_coordinates` on any other lane, of a point given by its offset from the start [m]."""
    s = dot(dx, dy, lane.dx, lane.dy)
    lateral = dot(dx, dy, lane.lx, lane.ly)
    if lane.kind == SINE:
        lateral -= lane.amplitude * np.sin(lane.pulsation * s + lane.phase)
    return s, lateral


@compiled
def position(lane, s, lateral):
    """World position of a point given in lane coordinates [m]."""
    if lane.kind == CIRCULAR:
        phi = lane.turn * s / lane.radius + lane.start_phase
        radius = lane.radius - lateral * lane.turn
        return lane.x + radius * np.cos(phi), lane.y + radius * np.sin(phi)
    if lane.kind == SINE:
        lateral += lane.amplitude * np.sin(lane.pulsation * s + lane.phase)
    return lane.x + s * lane.dx + lateral * lane.lx, lane.y + s * lane.dy + lateral * lane.ly


@compiled
def heading_at(lane, s):
    """Heading of a lane at arc length `s` [rad]."""
    if lane.kind == STRAIGHT:
        return lane.heading
    if lane.kind == SINE:
        slope = lane.amplitude * lane.pulsation * np.cos(lane.pulsation * s + lane.phase)
        return lane.heading + arctan(slope)
    return lane.turn * s / lane.radius + lane.start_phase + np.pi / 2 * lane.turn


@inner
def is_far(lane, x, y, across, along):
    """Is a point more than `across` to the side of a lane, or more than `along` beyond its ends [m]? In doubt no.

    Cheaper than `local_coordinates`. With `along` = 0 that also says that `distance` is more than `across`.
    """
    across += 1e-6
    far = across + along  # who is nearer than that in lane coordinates is so on the plane
    if (x < lane.left - far) | (x > lane.right + far) | (y < lane.low - far) | (y > lane.high + far):
        return True
    dx, dy = x - lane.x, y - lane.y
    if lane.kind == STRAIGHT:
        return abs(dx * lane.lx + dy * lane.ly) > across
    if lane.kind == SINE:
        return False
    outer, inner = lane.radius + across, max(lane.radius - across, 0.0)
    square = dx * dx + dy * dy
    return (square > outer * outer) | (square < inner * inner)


@inner
def distance(lane, s, lateral):
    """L1 distance of a point in lane coordinates to the lane [m]."""
    return abs(lateral) + max(s - lane.length, 0.0) + max(0.0 - s, 0.0)


@inner
def is_on_lane(lane, s, lateral, margin):
    """Is a point in lane coordinates on the lane, or nearer to it than `margin` [m]?"""
    # without branches: which of several lanes a car is on cannot be foretold
    return (abs(lateral) <= lane.width / 2 + margin) & (s >= -CAR_LENGTH) & (s < lane.length + CAR_LENGTH)


@inner
def is_reachable(lane, s, lateral):
    """May a car at this point in lane coordinates change to the lane?"""
    return not lane.forbidden and abs(lateral) <= 2 * lane.width and 0.0 <= s < lane.length + CAR_LENGTH


@inner
def is_after_end(lane, s):
    """Has a car at arc length `s` come to the end of the lane?"""
    return s > lane.length - CAR_LENGTH / 2


@part
def closest_lane(lanes, x, y, heading):
    """Index of the lane nearest to a pose in position and heading."""
    best, nearest = np.inf, 0
    for k in range(len(lanes)):
        lane = lanes[k]
        s, lateral = local_coordinates(lane, x, y)
        far = distance(lane, s, lateral) + abs(wrap_to_pi(heading - heading_at(lane, s)))
        if far < best:
            best, nearest = far, k
    return nearest
