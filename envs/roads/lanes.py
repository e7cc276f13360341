"""highway-env's road networks as roads that the shield measures along.

The road of a car is what leads to its lane and what it may drive next: its planned route as far as there is
one, and every branch beyond that. Arc length counts from the start of its lane.
"""

from collections.abc import Iterable
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from highway_env.road.lane import CircularLane, SineLane, StraightLane
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.roads.traced_lane import TracedLane
from rss_shield.shield.definitions.longitudinal import d_min_longitudinal
from rss_shield.shield.geometry import (
    AFTER,
    ARC_START,
    AROUND,
    BEFORE,
    COS,
    CURVATURE,
    CUT,
    FREE,
    HEADING,
    LENGTH,
    SIN,
    X,
    Y,
    make_road,
    wrap_angle,
)
from rss_shield.shield.ground import MOST, STATES, Ground, params_at
from rss_shield.shield.params import RSSParams, Table
from rss_shield.shield.sampling import euler_margin

LaneIndex = tuple[str, str, int]
Way = tuple[tuple[str, str], ...]  # roads one after the other: node where each starts, node where it ends

_JOIN = 0.5  # lane ends closer than this belong together [m]
_TURN = np.pi / 4  # ... if the angle between them is smaller than this [rad]
_OVERLAP = 5.0  # where none does, lanes in line may overlap, or leave a gap, of less than this [m]
_EXACT = 1e-3  # joints that are better than this are as they should be [m]
_SAMPLE = 2.0  # spacing of the pieces that stand in for a curve of changing curvature [m]
_ALIGNED = 1e-9  # straight pieces with headings as close as this are one line [rad]
_LONGEST = 20.0  # of two road users, added up [m]


class _Link(NamedTuple):
    """What comes after a lane, or before it."""

    lane: LaneIndex
    shift: float  # of the road from the middle of that lane, positive to the right [m]
    overlap: float  # of the two lanes, along the earlier one; negative where there is a gap [m]
    way: Way  # after it


class _Stretch(NamedTuple):
    """A lane on the road through another one, the origin."""

    lane: LaneIndex
    shift: float  # of the road from the middle of the lane, positive to the right [m]
    nearer: LaneIndex | None  # lane between it and the origin
    start: float  # arc length of its start, from the start of the origin [m]
    pieces: list[tuple[float, ...]]
    links: list[_Link]  # what comes next


# ---------------------------------------------------------------- roads


def road_through(
    network: Any, index: LaneIndex, reach: float = np.inf, way: Way = (), beside: Iterable[LaneIndex] = ()
) -> np.ndarray:
    """The road through a lane as `[K, 11]` pieces.

    Args:
      network: a `highway_env.road.road.RoadNetwork`.
      index: of the lane.
      reach: how far the road is followed beyond either end of the lane [m].
      way: roads that are driven after it; every branch counts after those.
      beside: lanes that start where it starts and may still be driven instead.
    """
    behind, _ = _explore(network, index, reach, False, ())
    ahead, around = _explore(network, index, reach, True, way)
    order = {lane: stretch for lane, stretch in reversed(behind.items()) if lane not in ahead} | ahead
    for other in beside:
        order = order | _explore(network, other, reach, True, ())[0] | order  # in this order, as they are known so far
    road = make_road([row for stretch in order.values() for row in _rows(stretch)])
    ends = np.cumsum([len(stretch.pieces) for stretch in order.values()])
    last = dict(zip(order, ends - 1, strict=True))
    first = {lane: last[lane] + 1 - len(stretch.pieces) for lane, stretch in order.items()}
    for lane, stretch in order.items():
        road[first[lane], BEFORE] = FREE if stretch.nearer is None else last[stretch.nearer]
        road[last[lane], AFTER] = _next(stretch, first)
    for lane, stretch in behind.items():
        if stretch.nearer is not None:
            road[last[lane], AFTER] = first[stretch.nearer]
        if lane not in ahead or lane == index:
            road[first[lane], BEFORE] = _next(stretch, last)
        elif lane in ahead:
            road[first[lane] : last[lane] + 1, AROUND] = ahead[lane].start - stretch.start
    for lane in beside:
        road[first[lane], BEFORE] = road[first[index], BEFORE]
    road[first[index] : last[index] + 1, AROUND] = around
    return road


def _rows(stretch: _Stretch) -> list[tuple[float, ...]]:
    starts = stretch.start + np.cumsum([0.0, *(piece[LENGTH] for piece in stretch.pieces)])
    return [(*piece, start) for piece, start in zip(stretch.pieces, starts, strict=False)]


def _next(stretch: _Stretch, row: dict[LaneIndex, int]) -> int:
    """Row of what comes next after a stretch."""
    if not stretch.links:
        return FREE
    return next((row[link.lane] for link in stretch.links if link.lane in row), CUT)


def _explore(
    network: Any, index: LaneIndex, reach: float, forward: bool, way: Way
) -> tuple[dict[LaneIndex, _Stretch], float]:
    """Lanes that come after (or before) a lane, nearest first, each by the shortest way; and the shortest way round."""
    found: dict[LaneIndex, _Stretch] = {}
    waiting: list[tuple[float, int, Any]] = [(0.0, 0, (index, 0.0, None, way, 0.0))]
    count, around, middle = 0, np.inf, 0.0
    while waiting:
        distance, _, (lane, shift, nearer, rest, overlap) = heappop(waiting)
        if lane in found:
            if lane == index:
                around = min(around, distance)
            continue
        links = _links(network, lane, shift, forward, rest)
        if forward and links:
            overlap = max(min(link.overlap for link in links), 0.0)
        pieces = _shortened(_pieces_of(network.get_lane(lane), shift), overlap)
        length = sum(piece[LENGTH] for piece in pieces)
        middle = middle or length  # the length of the lane that all started from
        start = distance if forward else middle - distance - length
        found[lane] = _Stretch(lane, shift, nearer, start, pieces, links)
        if distance + length - middle < reach:
            for link in links:
                count += 1
                lost = max(link.overlap, 0.0)  # of the one before, which ends where this one begins
                gap = overlap - link.overlap if forward else lost - link.overlap
                following = link.lane, link.shift, lane, link.way, lost
                heappush(waiting, (distance + length + gap, count, following))
    return _without_ends(found), around


def _shortened(pieces: list[tuple[float, ...]], overlap: float) -> list[tuple[float, ...]]:
    """Pieces without the end of the last ones, so long as one is left."""
    while overlap > 0.0:
        *rest, (x, y, heading, curvature, length) = pieces
        if length <= overlap and rest:
            pieces, overlap = rest, overlap - length
            continue
        pieces, overlap = [*rest, (x, y, heading, curvature, max(length - overlap, _EXACT))], 0.0
    return pieces


def _without_ends(found: dict[LaneIndex, _Stretch]) -> dict[LaneIndex, _Stretch]:
    """Leave out where a lane ends and its neighbour goes on straight ahead: so does the road at any free end."""
    for lane, stretch in reversed(list(found.items())):
        if stretch.shift != 0.0 and not stretch.links and stretch.nearer is not None:
            bordering = found[stretch.nearer]
            pieces = bordering.pieces + stretch.pieces
            headings = [abs(wrap_angle(piece[HEADING] - pieces[0][HEADING])) for piece in pieces]
            bent = any(piece[CURVATURE] for piece in pieces)
            if not bent and max(headings) < _ALIGNED and len(bordering.links) == 1:
                found = {other: found[other] for other in found if other != lane}
                found[stretch.nearer] = bordering._replace(links=[])
    return found


def _links(network: Any, index: LaneIndex, shift: float, forward: bool, way: Way) -> list[_Link]:
    """Lanes that continue a lane (or lead to it).

    Those that continue it without a jump, on the planned road if there are any; or else those in line with it that
    overlap it, or begin after a gap, as on highway-env's racetracks; or else the nearest: the lane ends, and the road
    goes on beside it. Where lanes do not meet exactly the road goes on without a jump beside the middle of the next.
    """
    lane = network.get_lane(index)
    s = lane.length if forward else 0.0
    end, heading = lane.position(s, shift), lane.heading_at(s)
    joined, in_line, aside = [], [], []
    for road in _roads_at(network, index, forward):
        planned = bool(way) and way[0] == road
        for i, other in enumerate(network.graph[road[0]][road[1]]):
            at = 0.0 if forward else other.length
            if abs(wrap_angle(heading - other.heading_at(at))) >= _TURN:
                continue
            gap, normal = end - other.position(at, 0.0), other.position(at, 1.0) - other.position(at, 0.0)
            across, along = float(gap @ normal), float(gap[0] * normal[1] - gap[1] * normal[0])
            link, rest = (*road, i), way[1:] if planned else ()
            if np.hypot(*gap) < _JOIN:
                joined.append((planned, _Link(link, *_meeting(lane, other, shift, forward), rest)))
            elif abs(across) < _JOIN and abs(along) < _OVERLAP:
                in_line.append((planned, _Link(link, *_meeting(lane, other, shift, forward), rest)))
            elif np.hypot(*(gap - across * normal)) < _JOIN:
                aside.append((not planned, abs(across), _Link(link, across, 0.0, rest)))
    joined = joined or in_line
    if joined or not aside:
        chosen = any(planned for planned, _ in joined)
        return [link for planned, link in joined if planned or not chosen]
    return [min(aside, key=lambda one: one[:2])[2]]


def _meeting(lane: Any, other: Any, shift: float, forward: bool) -> tuple[float, float]:
    """Where two lanes in line meet: shift of the road on the other one, and by how much they overlap [m].

    Where they overlap the earlier one ends where the later one begins.
    """
    earlier, later = (lane, other) if forward else (other, lane)
    moved = (shift, 0.0) if forward else (0.0, shift)  # the road, from the middle of either
    start = later.position(0.0, moved[1])
    tangent = later.position(_EXACT, moved[1]) - start
    tangent, overlap = tangent / np.hypot(*tangent), 0.0
    for _ in range(3):  # a curved lane is longer than its way along the tangent
        along = float((earlier.position(earlier.length - overlap, moved[0]) - start) @ tangent)
        overlap += along
        if overlap < 0.0:
            break
    if abs(overlap) <= _EXACT:
        overlap = 0.0
    s = earlier.length - max(overlap, 0.0)
    if forward:
        across = (earlier.position(s, shift) - later.position(0.0, 0.0)) @ (
            later.position(0.0, 1.0) - later.position(0.0, 0.0)
        )
    else:
        across = (start - earlier.position(s, 0.0)) @ (earlier.position(s, 1.0) - earlier.position(s, 0.0))
    return float(across) if abs(across) > _EXACT else 0.0, overlap


def successors(network: Any, index: LaneIndex) -> list[LaneIndex]:
    """Lanes that go on where a lane ends; where it just ends, the nearest one beside it."""
    return [link.lane for link in _links(network, index, 0.0, True, ())]


def _roads_at(network: Any, index: LaneIndex, forward: bool) -> list[tuple[str, str]]:
    """Roads that start where a lane ends, or that end where it starts."""
    if forward:
        return [(index[1], end) for end in network.graph.get(index[1], {})]
    return [(origin, index[0]) for origin, ends in network.graph.items() if index[0] in ends]


def _pieces_of(lane: Any, shift: float = 0.0) -> list[tuple[float, ...]]:
    """Pieces of constant curvature of one lane, or beside it: start x, y, heading, curvature, length."""
    if isinstance(lane, TracedLane):
        return lane.pieces(shift)
    if isinstance(lane, StraightLane) and not isinstance(lane, SineLane):
        (x, y), heading = lane.position(0.0, shift), lane.heading_at(0.0)
        return [(x, y, heading, 0.0, lane.length)]
    if isinstance(lane, CircularLane):
        (x, y), heading = lane.position(0.0, shift), lane.heading_at(0.0)
        curvature = (1.0 if lane.clockwise else -1.0) / lane.radius
        scale = max(1.0 - curvature * shift, 1e-3)
        return [(x, y, heading, curvature / scale, lane.length * scale)]
    corners = np.array(
        [lane.position(s, shift) for s in np.linspace(0.0, lane.length, int(lane.length // _SAMPLE) + 2)]
    )
    steps = np.diff(corners, axis=0)
    return [
        (x, y, np.arctan2(dy, dx), 0.0, np.hypot(dx, dy)) for (x, y), (dx, dy) in zip(corners[:-1], steps, strict=True)
    ]


def turned_round(road: np.ndarray) -> np.ndarray:
    """The same road for who drives it the other way: `[K, 11]` pieces, with arc lengths that grow in that direction."""
    turned = road.copy()
    heading, kappa, length = road[:, HEADING], road[:, CURVATURE], road[:, LENGTH]
    half = 0.5 * kappa * length
    chord = length * np.sinc(half / np.pi)
    turned[:, X] += chord * np.cos(heading + half)
    turned[:, Y] += chord * np.sin(heading + half)
    turned[:, HEADING] = (heading + 2.0 * half) % (2.0 * np.pi) - np.pi
    turned[:, CURVATURE] = -kappa
    turned[:, ARC_START] = -(road[:, ARC_START] + length)
    turned[:, COS], turned[:, SIN] = np.cos(turned[:, HEADING]), np.sin(turned[:, HEADING])
    turned[:, BEFORE], turned[:, AFTER] = road[:, AFTER], road[:, BEFORE]
    return turned


def tightest(network: Any) -> float:
    """Largest curvature of any arc of a network [1/m]."""
    lanes = network.lanes_list()
    arcs = [1.0 / lane.radius for lane in lanes if isinstance(lane, CircularLane)]
    return max([*arcs, *(lane.tightest for lane in lanes if isinstance(lane, TracedLane))], default=0.0)


def reach_of(ego: RSSParams, other: RSSParams, dt: float) -> float:
    """Farthest that anybody can matter along a road: both come toward each other as fast as highway-env allows [m]."""
    v = Vehicle.MAX_SPEED
    margins = euler_margin(v, ego.a_min_brake, dt) + euler_margin(v, other.a_min_brake, dt) + _LONGEST
    head_on = d_min_longitudinal(v, -v, True, ego, other, ego.a_min_brake_correct, other.a_min_brake_correct)
    return float(head_on + margins)


def reach_on(table: Table, ground: Ground | None) -> float:
    """`reach_of` of the pair that needs most: on any piece of a ground, of any kind of vehicle [m]."""
    if ground is None:
        return reach_of(table.ego, table.other, table.dt)
    ego = params_at(ground.ego, MOST)
    classes = range(len(ground.shares))
    return max(reach_of(ego, params_at(ground.other, STATES * k + MOST), table.dt) for k in classes)


# ---------------------------------------------------------------- which road a car drives


class Heading(NamedTuple):
    """Where a car is and which way it takes from there."""

    lane: LaneIndex
    way: Way = ()  # planned roads after it
    beside: tuple[LaneIndex, ...] = ()  # lanes that it may still take instead
    against: bool = False  # it drives that lane in the wrong direction (hole H25)


def heading_of(vehicle: Any) -> Heading:
    """The lane that a car drives on and its planned way.

    Where lanes lie on top of each other, as where roads fork or merge, the nearest one says little: a car that
    heads for one of them is on that. A car that is steered freely is on each of those that it has not left yet.
    """
    network, index = vehicle.road.network, vehicle.lane_index
    if not isinstance(vehicle, ControlledVehicle):
        heading = heading_anywhere(network, index, vehicle.position, vehicle.WIDTH)
    else:
        heading = heading_toward(network, index, vehicle.target_lane_index, vehicle.route or [])
    return heading._replace(against=is_against(network, heading.lane, vehicle.position, vehicle.heading))


def is_against(network: Any, index: LaneIndex, position: Any, heading: float) -> bool:
    """Does a car drive a lane in the wrong direction? Then there is none of its own direction that is nearer."""
    lane = network.get_lane(index)
    return bool(np.cos(heading - lane.heading_at(lane.local_coordinates(position)[0])) < 0.0)


def roads_along(network: Any, heading: Heading, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """The road that a car is measured along, and the one with the branches that it may still take.

    Who drives a lane in the wrong direction is measured along the same road turned round: then those who come along it
    drive towards it, in a lane of their own.
    """
    road = road_through(network, heading.lane, reach, heading.way)
    branches = road_through(network, heading.lane, reach, heading.way, heading.beside) if heading.beside else road
    if not heading.against:
        return road, branches
    turned = turned_round(road)
    return turned, turned if branches is road else turned_round(branches)


def heading_anywhere(network: Any, index: LaneIndex, position: Any, width: float) -> Heading:
    """`Heading` of a car on a lane that is steered freely."""
    return Heading(
        index, (), tuple(lane for lane in _forks(network, index) if _overlaps(network, lane, position, width))
    )


def heading_toward(network: Any, index: LaneIndex, target: LaneIndex, route: list[LaneIndex]) -> Heading:
    """`Heading` of a car on a lane that heads for another one and has a route."""
    if target[:2] != index[:2]:
        twins = [lane for lane in _forks(network, index) + _merges(network, index) if lane[:2] == target[:2]]
        index = twins[0] if twins else index
    return Heading(index, _way_after(index, [target, *route]))


def _way_after(index: LaneIndex, route: list[LaneIndex]) -> Way:
    """The roads of a route after a lane, as far as they follow one another."""
    roads = [(road[0], road[1]) for road in route]
    way: list[tuple[str, str]] = []
    for road in roads[roads.index(index[:2]) + 1 :] if index[:2] in roads else roads:
        at = way[-1] if way else index
        if road[0] == at[1]:
            way.append(road)
        elif road != at[:2]:
            break
    return tuple(way)


def _forks(network: Any, index: LaneIndex) -> list[LaneIndex]:
    """Other lanes that start where a lane starts."""
    lane = network.get_lane(index)
    return [
        (index[0], end, i)
        for end, lanes in network.graph[index[0]].items()
        for i, other in enumerate(lanes)
        if other is not lane and _meet(lane, 0.0, other, 0.0)
    ]


def _merges(network: Any, index: LaneIndex) -> list[LaneIndex]:
    """Other lanes that end where a lane ends."""
    lane = network.get_lane(index)
    return [
        (origin, index[1], i)
        for origin, ends in network.graph.items()
        for i, other in enumerate(ends.get(index[1], []))
        if other is not lane and _meet(lane, lane.length, other, other.length)
    ]


def _meet(lane: Any, s: float, other: Any, at: float) -> bool:
    turn = wrap_angle(lane.heading_at(s) - other.heading_at(at))
    return bool(np.hypot(*(lane.position(s, 0.0) - other.position(at, 0.0))) < _JOIN and abs(turn) < _TURN)


def _overlaps(network: Any, index: LaneIndex, position: Any, width: float) -> bool:
    """Is any part of a car on a lane?"""
    lane = network.get_lane(index)
    s, lateral = lane.local_coordinates(position)
    return bool(abs(lateral) < (lane.width_at(s) + width) / 2)
