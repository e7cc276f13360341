"""The paths of a highway-env road network, with the widths that its drivers sweep.

Cars do not stay on the middle of their lane: in a turn they are up to half a metre off, and leave it
with up to 0.4 rad. So every path is driven by the simulator's own steering law at several speeds, and
the conflict areas are made of the boxes that these cars cover.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rss_shield.envs.roads.network import (
    CAR_LENGTH,
    CAR_WIDTH,
    compile_network,
    heading_at,
    is_after_end,
    local_coordinates,
    position,
)
from rss_shield.envs.roads.slip import slip_of
from rss_shield.envs.roads.steering import steering_angle
from rss_shield.shield._numba.compiled import compiled_for_arrays
from rss_shield.shield.junctions.conflict_areas import (
    CELL,
    FAR,
    HALF_LENGTH,
    HALF_WIDTH,
    Paths,
    find_conflicts,
    swept_boxes,
)

MARGIN_LON, MARGIN_LAT = 0.25, 0.15  # of each of two cars, beyond the tracked boxes [m]
_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the top speed, at which a path is driven
_TRACK_DT = 1 / 15  # where frames are longer, a path is driven from several places as far apart as in this time [s]
_JOIN = 3.9  # a lane goes on in another that begins this far to the side ...
_GAP = 20.0  # ... and this far away, at most [m] ...
_TURNS_BACK = -0.5  # ... unless that leads back: cosine of the angle between them
_LENGTHS, _WIDTHS = 1.0, 0.5  # steps between the sizes that there are paths for [m]
_EXTENT = 20.0  # a path goes on beyond its last lane [m]


class Size(NamedTuple):
    """Cars that share their paths: what cars of both lengths sweep holds all that are in between."""

    shortest: float  # [m]
    longest: float
    width: float


def size_of(length: float, width: float) -> Size:
    """The size of a car, rounded up; stock cars and others on the grid have a size of their own."""
    steps = length / _LENGTHS
    shortest = max(float(np.floor(steps + 1e-9)), 1.0) * _LENGTHS
    longest = max(float(np.ceil(steps - 1e-9)), 1.0) * _LENGTHS
    return Size(shortest, longest, float(np.ceil(width / _WIDTHS - 1e-9)) * _WIDTHS)


STOCK = size_of(CAR_LENGTH, CAR_WIDTH)


def walks(network) -> list[list[tuple]]:
    """All ways through a road network that drivers may follow without changing lanes.

    A way starts where no lane leads to, or anywhere on a ring, and ends where no lane goes on. It never
    takes a lane twice. What is the end of a longer way is left out.
    """
    indices = list(network.lanes_dict())
    entered = {following for index in indices for following in successors(network, index)}
    starts = [index for index in indices if index not in entered]
    starts += [index for index in indices if index in entered and _is_on_ring(network, index)]
    found: list[list[tuple]] = []
    for start in starts:
        found += [walk for walk in _walks_from(network, [start]) if not successors(network, walk[-1])]
    longest_first = sorted(found, key=len, reverse=True)
    kept: list[list[tuple]] = []
    for walk in longest_first:
        if not any(other[-len(walk) :] == walk for other in kept):
            kept.append(walk)
    return sorted(kept)


def successors(network, index) -> list[tuple]:
    """Lanes that go on where a lane ends. Roads that only share a node, to turn back there, do not."""
    origin, end, i = index
    lane = network.get_lane(index)
    where = lane.position(lane.length, 0.0)
    following = [
        (end, node, network.next_lane_given_next_road(origin, end, i, node, None, where)[0])
        for node in network.graph.get(end, {})
    ]
    return [index for index in following if _goes_on(lane, network.get_lane(index))]


def _goes_on(lane, following) -> bool:
    """Does a lane lead to another? highway-env's roundabouts have gaps and corners where they meet their arms."""
    where, heading = lane.position(lane.length, 0.0), lane.heading_at(lane.length)
    s, lateral = following.local_coordinates(where)
    ahead = np.cos(heading - following.heading_at(s)) > _TURNS_BACK
    return bool(abs(lateral) < _JOIN and abs(s) < _GAP and ahead)


def _is_on_ring(network, index) -> bool:
    reached: set[tuple] = set()
    ahead = [index]
    while ahead:
        following = [lane for lane in successors(network, ahead.pop()) if lane not in reached]
        reached.update(following)
        ahead += following
    return index in reached


def _walks_from(network, walk) -> Iterator[list[tuple]]:
    following = [index for index in successors(network, walk[-1]) if index not in walk]
    if not successors(network, walk[-1]) or not following:
        yield walk
    for index in following:
        yield from _walks_from(network, [*walk, index])


class Layout(NamedTuple):
    """Paths without the widths that cars sweep. P paths of at most C cells, L lanes."""

    lanes: np.ndarray  # `[L]` LANE
    ways: list[list[int]]  # lanes of each path
    starts: list[np.ndarray]  # arc lengths at which they begin on it [m]
    cells: np.ndarray  # `[P]`
    lane: np.ndarray  # `[P, C]` lane that a car in the cell follows
    offset: np.ndarray  # `[P, L]` as in `Paths`
    rank: np.ndarray  # `[L]` who goes first


class Swept(NamedTuple):
    """What cars of one size sweep on each path, and where that is in the way of the ego."""

    boxes: np.ndarray  # `[P, C, 6]`
    conflicts: np.ndarray  # `[P, P, C, 4]` as in `Paths`
    first: np.ndarray  # `[P, P, C]` likewise


def lay_out(network) -> Layout:
    """The paths of a `highway_env.road.road.RoadNetwork`."""
    indices = list(network.lanes_dict())
    number = {index: i for i, index in enumerate(indices)}
    lanes = compile_network(network, False).lanes
    ways = [[number[index] for index in walk] for walk in walks(network)]
    ring = np.array([_is_on_ring(network, index) for index in indices])
    starts = [_starts(lanes, way) for way in ways]
    cells = np.array([int(np.ceil((start[-1] + _EXTENT) / CELL)) for start in starts])
    lane = np.full((len(ways), int(cells.max())), -1)
    offset = np.full((len(ways), len(indices)), np.nan)
    for p, (way, start) in enumerate(zip(ways, starts, strict=True)):
        offset[p, way] = start[:-1]
        ends = start[:-2] + lanes["length"][way[:-1]] - CAR_LENGTH / 2  # where a driver heads for the next lane
        lane[p, : cells[p]] = np.array(way)[np.searchsorted(ends, np.arange(cells[p]) * CELL, side="right")]
    rank = np.where(ring | ~ring.any(), lanes["priority"], lanes["priority"] - 1)  # who is on a ring goes first
    return Layout(lanes, ways, starts, cells, lane, offset, rank)


def sweep(layout: Layout, top_speed: float, dt: float, size: Size) -> np.ndarray:
    """Boxes `[P, C, 6]` around all cars of one size.

    Args:
      layout: `Layout`.
      top_speed: drivers are expected up to this speed [m/s].
      dt: length of a frame, in which drivers steer [s].
      size: `Size`.
    """
    boxes = np.zeros((*layout.lane.shape, 6))
    for p, (way, start) in enumerate(zip(layout.ways, layout.starts, strict=True)):
        cells = int(layout.cells[p])
        poses = _tracked(layout.lanes, np.array(way), start, cells, top_speed, dt, size)
        swept_boxes(poses, size.longest / 2, size.width / 2, MARGIN_LON, MARGIN_LAT, boxes[p, :cells])
    return boxes


def widened(boxes, room: float) -> np.ndarray:
    """The boxes of an ego that may be `room` further to either side [m]."""
    boxes = boxes.copy()
    boxes[..., HALF_WIDTH] += room
    boxes[..., HALF_LENGTH] += 0.5 * room  # who turns more than they do reaches further, too
    return boxes


def meet(layout: Layout, ego, boxes) -> Swept:
    """Conflict areas of what the ego sweeps `[P, C, 6]` with what cars of one size sweep."""
    conflicts = np.full((len(ego), *layout.lane.shape[:1], layout.lane.shape[1], 4), np.inf, np.float32)
    conflicts[..., 1::2] = -np.inf
    first = np.full(conflicts.shape[:3], np.inf, np.float32)
    find_conflicts(ego, boxes, layout.cells, conflicts, first)
    return Swept(boxes, conflicts, first)


def join(layout: Layout, ego, swept: list[Swept]) -> Paths:
    """`Paths` of an ego that sweeps boxes `[P, C, 6]`, among cars of several sizes; its own comes first."""
    times = len(swept)
    conflicts = np.concatenate([one.conflicts for one in swept], 1)
    lane, offset = np.tile(layout.lane, (times, 1)), np.tile(layout.offset, (times, 1))
    crossed = np.tile(_crossed(layout.lane, offset, conflicts), (times, 1))
    return Paths(
        ego,
        np.tile(layout.cells, times),
        lane,
        _reached(lane),
        offset,
        conflicts,
        np.concatenate([one.first for one in swept], 1),
        np.tile(_priorities(layout.lane, layout.offset, swept[0].conflicts, layout.rank), (1, times)),
        crossed,
        np.where(layout.lane >= 0, layout.lanes["speed_limit"][layout.lane], np.inf),
        np.concatenate([one.boxes for one in swept]),
        _next_true(crossed),
        np.tile(_joins(layout.lane, layout.offset), (1, times, 1)),
    )


def _next_true(flags) -> np.ndarray:
    """First column from each on in which a row of flags `[Q, C]` is True; C = none."""
    columns = np.where(flags, np.arange(flags.shape[1]), flags.shape[1])
    return np.minimum.accumulate(columns[:, ::-1], axis=1)[:, ::-1].astype(np.int32)


def _reached(lane) -> np.ndarray:
    """`Paths.reached`."""
    same = np.column_stack([np.zeros(len(lane), bool), lane[:, 1:] == lane[:, :-1]])
    return np.maximum.accumulate(np.where(same, 0, np.arange(lane.shape[1])), axis=1).astype(np.int32)


def _joins(lane, offset) -> np.ndarray:
    """`Paths.joins`."""
    shared = ~np.isnan(offset[:, lane]).swapaxes(0, 1) & (lane >= 0)[:, None]
    cell = np.where(shared, np.arange(lane.shape[1]), FAR).astype(np.int32)
    return np.ascontiguousarray(np.minimum.accumulate(cell[..., ::-1], axis=-1)[..., ::-1])


def _starts(lanes, way) -> np.ndarray:
    """Arc lengths at which the lanes of a way begin, and where the last one ends [m].

    They count on without a jump where a driver heads for the next lane, wherever that begins.
    """
    starts = [0.0]
    for k, following in pairwise(way):
        switch = lanes[k]["length"] - CAR_LENGTH / 2
        s, _ = local_coordinates(lanes[following], *position(lanes[k], switch, 0.0))
        starts.append(starts[-1] + switch - s)
    return np.array([*starts, starts[-1] + lanes[way[-1]]["length"]])


def _tracked(lanes, way, start, cells: int, top_speed: float, dt: float, size: Size) -> np.ndarray:
    """Poses `[C, V, 3]` of cars that drive along a way, at the edges and the middle of each cell."""
    s = (np.arange(cells)[:, None] + np.array([0.0, 0.5, 1.0])) * CELL
    poses = [_centre(lanes, way, start, s)]
    places = max(int(np.ceil(dt / _TRACK_DT - 1e-6)), 1)
    for share in _shares(2 * places - 1):
        speed = share * top_speed
        for length in sorted({size.shortest, size.longest}):
            for place in range(places):
                begin = speed * dt * place / places
                track = np.zeros((int((start[-1] + _EXTENT) / (speed * dt)) + 2, 4))
                track = track[: drive(lanes, way, start, speed, dt, track, length, begin)]
                poses.append(_interpolated(track, s, begin))
    return np.concatenate(poses, 1)


def _shares(times: int) -> list[float]:
    """Shares of the top speed at which a path is driven, `times` as many: the longer a frame, the more they differ."""
    between = np.arange(1, times) / times
    return [*_SHARES, *(a + (b - a) * part for a, b in pairwise(_SHARES) for part in between)]


def _interpolated(track, s, begin: float) -> np.ndarray:
    """Poses at arc lengths `s`, from a drive that began at `begin` [m]; nan where it did not come by."""
    along = np.maximum.accumulate(track[:, 0])
    driven = [np.interp(s, along, np.unwrap(track[:, k]) if k == 3 else track[:, k]) for k in (1, 2, 3)]
    return np.where(((s >= begin) & (s <= along[-1]))[..., None], np.stack(driven, -1), np.nan)


def _centre(lanes, way, start, s) -> np.ndarray:
    """Poses on the middle of the lanes."""
    poses = np.zeros((*s.shape, 3))
    for c, along in np.ndenumerate(s):
        k = int(np.searchsorted(start[:-2] + lanes["length"][way[:-1]], along, side="right"))
        row = lanes[way[k]]
        poses[c] = (*position(row, along - start[k], 0.0), heading_at(row, along - start[k]))
    return poses


@compiled_for_arrays
def drive(lanes, way, start, speed, dt, track, length=CAR_LENGTH, begin=0.0):
    """Drive along a way at constant speed with the simulator's steering law; returns the frames driven.

    Args:
      lanes: `[L]` LANE.
      way: lanes in order, start: arc lengths at which they begin.
      track: `[T, 4]` arc length, x, y and heading of each frame, overwritten.
      length: of the car [m].
      begin: arc length at which it starts [m].
    """
    k = 0
    x, y = position(lanes[way[0]], begin, 0.0)
    heading = heading_at(lanes[way[0]], begin)
    for t in range(len(track)):
        s, lateral = local_coordinates(lanes[way[k]], x, y)
        if k + 1 < len(way) and is_after_end(lanes[way[k]], s):
            k += 1
            s, lateral = local_coordinates(lanes[way[k]], x, y)
        track[t, 0], track[t, 1], track[t, 2], track[t, 3] = start[k] + s, x, y, heading
        steering = steering_angle(lanes[way[k]], s, lateral, heading, speed, length)
        slip = slip_of(steering)
        x += speed * np.cos(heading + slip) * dt
        y += speed * np.sin(heading + slip) * dt
        heading += speed * np.sin(slip) / (length / 2) * dt
    return len(track)


def _priorities(lane, offset, conflicts, rank) -> np.ndarray:
    """Who has the right of way, by the lanes on which two paths first come into conflict."""
    count, front = len(lane), int(CAR_LENGTH / 2 / CELL)
    under_front = np.concatenate([lane[:, front:], np.repeat(lane[:, -1:], front, 1)], 1)
    priority = np.zeros((count, count), np.int64)
    for a in range(count):
        for b in range(count):
            first = [_first_meeting(under_front[p], offset[q], conflicts[p, q]) for p, q in ((a, b), (b, a))]
            if min(first) >= 0:
                priority[a, b] = np.sign(rank[under_front[a, first[0]]] - rank[under_front[b, first[1]]])
    return priority


def _first_meeting(under_front, offset_of_other, conflicts) -> int:
    """First cell in conflict with another path on a lane that is not shared, -1 = none."""
    apart = (under_front >= 0) & np.isnan(offset_of_other[under_front])
    meeting = np.flatnonzero(apart & np.isfinite(conflicts[:, 0]))
    return int(meeting[0]) if len(meeting) else -1


def _crossed(lane, offset, conflicts) -> np.ndarray:
    """Cells of each path in which a car is in the way of others that come from elsewhere."""
    crossed = np.zeros(lane.shape, bool)
    for p in range(len(lane)):
        shared = ~np.isnan(offset[:, lane[p]]) & (lane[p] >= 0)  # [P, C]
        elsewhere = ~np.logical_or.accumulate(shared, axis=1)  # no lane in common so far
        crossed[p] = (elsewhere & np.isfinite(conflicts[p, :, :, 0])).any(0)
    return crossed


def successors_of(network) -> np.ndarray:
    """Each lane and those that go on where it ends, as sets of bits `[L]`."""
    number = {index: i for i, index in enumerate(network.lanes_dict())}
    lanes = [(index, *successors(network, index)) for index in number]
    return np.array([sum(1 << number[index] for index in {*group}) for group in lanes], np.int64)


def beside(network) -> np.ndarray:
    """Each lane and those beside it, as sets of bits `[L]`."""
    number = {index: i for i, index in enumerate(network.lanes_dict())}
    return np.array([sum(1 << number[side] for side in network.all_side_lanes(index)) for index in number], np.int64)


def lead_of(network) -> np.ndarray:
    """How far before its start cars head for each lane `[L]` [m]."""
    indices = list(network.lanes_dict())
    lead = dict.fromkeys(indices, 0.0)
    for index in indices:
        lane = network.get_lane(index)
        for following in successors(network, index):
            s, _ = network.get_lane(following).local_coordinates(lane.position(lane.length - CAR_LENGTH / 2, 0.0))
            lead[following] = max(lead[following], float(-s))
    return np.array(list(lead.values()))
