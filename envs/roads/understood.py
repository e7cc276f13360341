"""Can the shield keep distances, or make plans, on a road network? If not, the lane is named that it cannot follow.

Roads of highway-env's own environments pass. A network of one's own has to be drawn such that the shield can tell which
lane goes on in which: by nodes with the same name, and by lanes that meet there.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from highway_env.road.lane import CircularLane, SineLane, StraightLane

from rss_shield.envs.roads import paths
from rss_shield.envs.roads.lanes import LaneIndex, successors
from rss_shield.shield.geometry import wrap_angle

_TURNS_BACK = np.pi * 3 / 4  # a road that starts at the end of another one, but leads back, does not go on there [rad]
_CROSSING = np.pi / 4  # lanes that meet at a larger angle cross [rad]
_ARC = np.pi / 12  # of a circle, between two points of a line [rad]
_SAMPLE = 5.0  # spacing of points on a curve of changing curvature [m]
_AT_END = 1.0  # lanes that touch so near to an end of one of them do not cross [m]
_EXPECTED = {
    False: "less than 5 m along, 0.5 m across and 45 degrees",
    True: "less than 20 m along, 3.9 m across and 120 degrees",
}
_understood: set[tuple] = set()  # geometry of networks that have been looked at


def check_roads(network: Any, cross: bool) -> None:
    """Is every lane one that the shield can follow?

    Args:
      network: a `highway_env.road.road.RoadNetwork`.
      cross: do its lanes cross, so that plans keep cars safe? Else distances along lanes do.

    Raises:
      ValueError: a lane without length, one that meets no lane of the road that goes on at its end, or where distances
        along lanes keep cars safe, one that crosses another.
    """
    key = (cross, *_geometry(network))
    if key in _understood:
        return
    for index, lane in network.lanes_dict().items():
        if not 0.0 < lane.length < np.inf:
            raise ValueError(f"lane {index} of the road network is {lane.length} m long: expected a length > 0")
    _check_joints(network, paths.successors if cross else successors, cross)
    if not cross:
        _check_crossings(network)
    _understood.add(key)


def _geometry(network: Any) -> tuple:
    ends = [
        (index, *(float(x) for s in (0.0, 0.5 * lane.length, lane.length) for x in lane.position(s, 0.0).round(3)))
        for index, lane in network.lanes_dict().items()
    ]
    return tuple(ends)


def _check_joints(network: Any, follow: Callable[[Any, LaneIndex], list], cross: bool) -> None:
    """Does every lane go on in another, if a road does at the node where it ends?"""
    for index, lane in network.lanes_dict().items():
        if follow(network, index):
            continue
        end, heading = lane.position(lane.length, 0.0), lane.heading_at(lane.length)
        missed = []
        for node, lanes in network.graph.get(index[1], {}).items():
            for i, other in enumerate(lanes):
                turn = abs(wrap_angle(float(heading - other.heading_at(0.0))))
                if turn < _TURNS_BACK:
                    missed.append((float(np.hypot(*(end - other.position(0.0, 0.0)))), turn, (index[1], node, i)))
        if missed:
            gap, turn, other = min(missed)
            raise ValueError(
                f"lane {index} of the road network ends {gap:.1f} m from where lane {other} begins, and turned by "
                f"{np.degrees(turn):.0f} degrees: expected {_EXPECTED[cross]}, or the shield cannot tell how the "
                "road goes on"
            )


def _check_crossings(network: Any) -> None:
    """Where distances along lanes keep cars safe nobody may come from the side."""
    names, segments = [], []
    for index, lane in network.lanes_dict().items():
        points = _line(lane)
        names += [index] * (len(points) - 1)
        segments.append(np.concatenate([points[:-1], np.diff(points, axis=0)], axis=1))
    if not segments:
        return
    x, y, dx, dy = np.concatenate(segments).T
    across = dx[:, None] * dy - dy[:, None] * dx  # of both directions
    along = dx[:, None] * dx + dy[:, None] * dy
    angle = np.arctan2(np.abs(across), np.abs(along))
    apart_x, apart_y = x - x[:, None], y - y[:, None]
    steep = angle > _CROSSING
    safe = np.where(steep, across, 1.0)
    here = (apart_x * dy - apart_y * dx) / safe  # where on the first and on the second they meet
    there = (apart_x * dy[:, None] - apart_y * dx[:, None]) / safe
    length = np.hypot(dx, dy)
    slack = _AT_END / length
    inside = (here > slack[:, None]) & (here < 1.0 - slack[:, None]) & (there > slack) & (there < 1.0 - slack)
    for a, b in np.argwhere(steep & inside):
        if names[a][0] != names[b][0] and names[a][1] != names[b][1]:  # no fork, nor where roads become one
            raise ValueError(
                f"lanes {names[a]} and {names[b]} of the road network cross at {np.degrees(angle[a, b]):.0f} degrees: "
                "expected lanes that do not, because along lanes nobody comes from the side; derive an environment "
                "whose roads cross from IntersectionEnv or RoundaboutEnv"
            )


def _line(lane: Any) -> np.ndarray:
    """Points `[K, 2]` on the middle of a lane."""
    if isinstance(lane, CircularLane):
        count = int(np.ceil(lane.length / lane.radius / _ARC)) + 1
    elif isinstance(lane, StraightLane) and not isinstance(lane, SineLane):
        count = 2
    else:
        count = int(lane.length // _SAMPLE) + 2
    return np.array([lane.position(s, 0.0) for s in np.linspace(0.0, lane.length, count)])
