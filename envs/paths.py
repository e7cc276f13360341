"""The paths of a highway-env road network, with the widths that its drivers sweep.

Cars do not stay on the middle of their lane: in a turn they are up to half a metre off, and leave it
with up to 0.4 rad. So every path is driven by the simulator's own steering law at several speeds, and
the conflict areas are made of the boxes that these cars cover.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from envs.fast.network import compile_network, heading_at, is_after_end, local_coordinates, position
from envs.fast.state import CAR_LENGTH, CAR_WIDTH
from envs.fast.steering import steering_angle
from shield.compiled import compiled_for_arrays
from shield.conflict_areas import CELL, FAR, HALF_LENGTH, HALF_WIDTH, Paths, find_conflicts, swept_boxes

MARGIN_LON, MARGIN_LAT = 0.25, 0.15  # of each of two cars, beyond the tracked boxes [m]
_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the top speed, at which a path is driven
_TRACK_DT = 1 / 15  # [s]
_JOIN = 3.9  # a lane goes on in another that begins this far to the side ...
_GAP = 10.0  # ... and this far away, at most [m]
_EXTENT = 20.0  # a path goes on beyond its last lane [m]


def walks(network) -> list[list[tuple]]:
    """All ways through a road network that drivers may follow without changing lanes.

    A way starts where no lane leads to, or anywhere on a ring, and ends where no lane goes on. It never
    takes a lane twice. What is the end of a longer way is left out.
    """
    indices = list(network.lanes_dict())
    entered = {following for index in indices for following in _successors(network, index)}
    starts = [index for index in indices if index not in entered]
    starts += [index for index in indices if index in entered and _is_on_ring(network, index)]
    found: list[list[tuple]] = []
    for start in starts:
        found += [walk for walk in _walks_from(network, [start]) if not _successors(network, walk[-1])]
    longest_first = sorted(found, key=len, reverse=True)
    kept: list[list[tuple]] = []
    for walk in longest_first:
        if not any(other[-len(walk) :] == walk for other in kept):
            kept.append(walk)
    return sorted(kept)


def _successors(network, index) -> list[tuple]:
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
    return bool(abs(lateral) < _JOIN and abs(s) < _GAP and np.cos(heading - following.heading_at(s)) > 0.0)


def _is_on_ring(network, index) -> bool:
    reached: set[tuple] = set()
    ahead = [index]
    while ahead:
        following = [lane for lane in _successors(network, ahead.pop()) if lane not in reached]
        reached.update(following)
        ahead += following
    return index in reached


def _walks_from(network, walk) -> Iterator[list[tuple]]:
    following = [index for index in _successors(network, walk[-1]) if index not in walk]
    if not _successors(network, walk[-1]) or not following:
        yield walk
    for index in following:
        yield from _walks_from(network, [*walk, index])


def compile_paths(network, top_speed: float, room: float = 0.0) -> Paths:
    """Paths, swept widths and conflict areas of a `highway_env.road.road.RoadNetwork`.

    Args:
      network: the road network.
      top_speed: drivers are expected up to this speed [m/s].
      room: the ego may be this much further to either side than these drivers [m].
    """
    indices = list(network.lanes_dict())
    number = {index: i for i, index in enumerate(indices)}
    lanes = compile_network(network, False).lanes
    ways = [[number[index] for index in walk] for walk in walks(network)]
    ring = np.array([_is_on_ring(network, index) for index in indices])
    starts = [_starts(lanes, way) for way in ways]
    cells = np.array([int(np.ceil((start[-1] + _EXTENT) / CELL)) for start in starts])

    count, size = len(ways), int(cells.max())
    boxes, lane = np.zeros((count, size, 6)), np.full((count, size), -1)
    offset = np.full((count, len(indices)), np.nan)
    for p, (way, start) in enumerate(zip(ways, starts, strict=True)):
        offset[p, way] = start[:-1]
        ends = start[:-2] + lanes["length"][way[:-1]] - CAR_LENGTH / 2  # where a driver heads for the next lane
        lane[p, : cells[p]] = np.array(way)[np.searchsorted(ends, np.arange(cells[p]) * CELL, side="right")]
        poses = _tracked(lanes, np.array(way), start, int(cells[p]), top_speed)
        swept_boxes(poses, CAR_LENGTH / 2, CAR_WIDTH / 2, MARGIN_LON, MARGIN_LAT, boxes[p, : cells[p]])
    swept = boxes.copy()
    swept[..., HALF_WIDTH] += room
    swept[..., HALF_LENGTH] += 0.5 * room  # who turns more than they do reaches further, too
    conflicts = np.full((count, count, size, 4), np.inf, np.float32)
    conflicts[..., 1::2] = -np.inf
    first = np.full((count, count, size), np.inf, np.float32)
    find_conflicts(swept, boxes, cells, conflicts, first)
    rank = np.where(ring | ~ring.any(), lanes["priority"], lanes["priority"] - 1)  # who is on a ring goes first
    return Paths(
        swept,
        cells,
        lane,
        _reached(lane),
        offset,
        conflicts,
        first,
        _priorities(lane, offset, conflicts, rank),
        _crossed(lane, offset, conflicts),
        np.where(lane >= 0, lanes["speed_limit"][lane], np.inf),
        boxes,
        _joins(lane, offset),
    )


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


def _tracked(lanes, way, start, cells: int, top_speed: float) -> np.ndarray:
    """Poses `[C, V, 3]` of cars that drive along a way, at the edges and the middle of each cell."""
    s = (np.arange(cells)[:, None] + np.array([0.0, 0.5, 1.0])) * CELL
    poses = [_centre(lanes, way, start, s)]
    for share in _SHARES:
        track = np.zeros((int((start[-1] + _EXTENT) / (share * top_speed * _TRACK_DT)) + 2, 4))
        track = track[: drive(lanes, way, start, share * top_speed, _TRACK_DT, track)]
        along = np.maximum.accumulate(track[:, 0])
        driven = [np.interp(s, along, np.unwrap(track[:, k]) if k == 3 else track[:, k]) for k in (1, 2, 3)]
        poses.append(np.where((s <= along[-1])[..., None], np.stack(driven, -1), np.nan))
    return np.concatenate(poses, 1)


def _centre(lanes, way, start, s) -> np.ndarray:
    """Poses on the middle of the lanes."""
    poses = np.zeros((*s.shape, 3))
    for c, along in np.ndenumerate(s):
        k = int(np.searchsorted(start[:-2] + lanes["length"][way[:-1]], along, side="right"))
        row = lanes[way[k]]
        poses[c] = (*position(row, along - start[k], 0.0), heading_at(row, along - start[k]))
    return poses


@compiled_for_arrays
def drive(lanes, way, start, speed, dt, track):
    """Drive along a way at constant speed with the simulator's steering law; returns the frames driven.

    Args:
      lanes: `[L]` LANE.
      way: lanes in order, start: arc lengths at which they begin.
      track: `[T, 4]` arc length, x, y and heading of each frame, overwritten.
    """
    k = 0
    x, y = position(lanes[way[0]], 0.0, 0.0)
    heading = heading_at(lanes[way[0]], 0.0)
    for t in range(len(track)):
        s, lateral = local_coordinates(lanes[way[k]], x, y)
        if k + 1 < len(way) and is_after_end(lanes[way[k]], s):
            k += 1
            s, lateral = local_coordinates(lanes[way[k]], x, y)
        track[t, 0], track[t, 1], track[t, 2], track[t, 3] = start[k] + s, x, y, heading
        steering = steering_angle(lanes[way[k]], s, lateral, heading, speed, CAR_LENGTH)
        slip = np.arctan(0.5 * np.tan(steering))
        x += speed * np.cos(heading + slip) * dt
        y += speed * np.sin(heading + slip) * dt
        heading += speed * np.sin(slip) / (CAR_LENGTH / 2) * dt
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
    lanes = [(index, *_successors(network, index)) for index in number]
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
        for following in _successors(network, index):
            s, _ = network.get_lane(following).local_coordinates(lane.position(lane.length - CAR_LENGTH / 2, 0.0))
            lead[following] = max(lead[following], float(-s))
    return np.array(list(lead.values()))
