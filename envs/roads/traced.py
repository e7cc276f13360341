"""highway-env's road networks as the lanes of a trace."""

from typing import Any

import numpy as np
from highway_env.road.lane import CircularLane, LineType, SineLane, StraightLane

from rss_shield.envs.roads.lanes import LaneIndex, successors
from rss_shield.shield.trace import Lane

_ARC = np.pi / 8  # of a circle, between two points of a centre line [rad]
_SAMPLE = 2.0  # spacing of points on a curve of changing curvature [m]
_LINES = {LineType.NONE: "none", LineType.STRIPED: "striped"}
_BESIDE = 0.5  # an oncoming lane runs beside another if their edges are this near [m]


def lanes_of(network: Any) -> tuple[Lane, ...]:
    """All lanes of a `highway_env.road.road.RoadNetwork`, in its own order."""
    return tuple(_lane(network, index) for index in network.lanes_dict())


def lane_id(index: LaneIndex) -> str:
    """ "a>b:0" of the first lane of the road from node a to node b."""
    return f"{index[0]}>{index[1]}:{index[2]}"


def configuration(network: Any) -> list[list[Any]]:
    """All lanes as JSON, from which the same network can be built again: start, end, lanes of each road."""
    return [
        [start, end, [lane.to_config() for lane in lanes]]
        for start, ends in network.graph.items()
        for end, lanes in ends.items()
    ]


def _lane(network: Any, index: LaneIndex) -> Lane:
    lane = network.get_lane(index)
    along = np.linspace(0.0, lane.length, _points(lane))
    (left, left_opposite), (right, right_opposite) = (_beside(network, index, step) for step in (-1, 1))
    left_line, right_line = (_LINES.get(kind, "continuous") for kind in lane.line_types)
    return Lane(
        lane_id(index),
        np.array([(*lane.position(s, 0.0), lane.heading_at(s)) for s in along], float),
        np.array([lane.width_at(s) for s in along], float),
        tuple(dict.fromkeys(lane_id(link) for link in successors(network, index))),
        left,
        right,
        left_opposite,
        right_opposite,
        left_line,
        right_line,
        float(lane.speed_limit if lane.speed_limit is not None else np.inf),
        int(lane.priority),
    )


def _points(lane: Any) -> int:
    if isinstance(lane, StraightLane) and not isinstance(lane, SineLane):
        return 2
    if isinstance(lane, CircularLane):
        return int(np.ceil(lane.length / lane.radius / _ARC)) + 1
    return int(lane.length // _SAMPLE) + 2


def _beside(network: Any, index: LaneIndex, step: int) -> tuple[str, bool]:
    """The lane to the left (step -1) or right of a lane, and does it run the other way?"""
    start, end, i = index
    if 0 <= i + step < len(network.graph[start][end]):
        return lane_id((start, end, i + step)), False
    lane = network.get_lane(index)
    s = 0.5 * lane.length
    heading = lane.heading_at(s)
    for k in range(len(network.graph.get(end, {}).get(start, []))):
        other_index = (end, start, k)
        other = network.get_lane(other_index)
        place, _ = other.local_coordinates(lane.position(s, 0.0))
        offset = lane.local_coordinates(other.position(place, 0.0))[1]
        gap = abs(offset) - 0.5 * (lane.width_at(s) + other.width_at(place))
        if step * offset > 0.0 and gap < _BESIDE and np.cos(other.heading_at(place) - heading) < 0.0:
            return lane_id(other_index), True
    return "", False
