"""Where an ego is going, as points: the frame in which its semantic actions are planned."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

POINTS_APART = 0.5  # along a path [m]
PATH_FIELDS = 5
PX, PY, PHEADING, PCOS, PSIN = range(PATH_FIELDS)


class Path(NamedTuple):
    """A way along the road and the lanes beside it."""

    points: np.ndarray  # `[K, 5]` x, y [m], heading [rad], its cosine and sine, POINTS_APART from each other
    lanes: np.ndarray  # `[L]` centres of the lanes, to the right of the points [m]


def straight_path(lanes: list[Any]) -> Path:
    """Of straight lanes side by side; one point is enough.

    Args:
      lanes: highway-env's, from left to right.
    """
    first = lanes[0]
    x, y = first.position(0.0, 0.0)
    centres = [first.local_coordinates(lane.position(0.0, 0.0))[1] for lane in lanes]
    return Path(_points([(x, y, first.heading_at(0.0))]), np.array(centres, float))


def route_path(network: Any, index: tuple[str, str, int], end: str) -> Path:
    """Along the shortest way from a lane to a node.

    Args:
      network: a `highway_env.road.road.RoadNetwork`.
      index: of the lane, end: the node.
    """
    nodes = [index[1]] if index[1] == end else network.shortest_path(index[1], end)
    lanes = [network.get_lane(index), *(network.get_lane((a, b, 0)) for a, b in pairwise(nodes))]
    found, s = [], 0.0
    for lane in lanes:
        while s < lane.length:
            found.append((*lane.position(s, 0.0), lane.heading_at(s)))
            s += POINTS_APART
        s -= lane.length
    return Path(_points(found), np.zeros(1))


def _points(poses: list[tuple[Any, ...]]) -> np.ndarray:
    x, y, heading = np.array(poses, float).T
    return np.ascontiguousarray(np.stack([x, y, heading, np.cos(heading), np.sin(heading)], axis=1))
