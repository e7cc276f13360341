"""What is painted on both sides of a lane."""

from typing import Any

from highway_env.road.lane import LineType

from rss_shield.envs.roads.lanes import LaneIndex


def line_beside(network: Any, index: LaneIndex, side: int) -> str:
    """Kind of the line on the left (-1) or right (1) of a lane, one of `shield.risk.markings.MARKINGS`.

    It may be drawn as that of the lane beside it.
    """
    start, end, number = index
    lanes = network.graph[start][end]
    drawn = [lanes[number].line_types[(side + 1) // 2]]
    beside = 0 <= number + side < len(lanes)
    if beside:
        drawn.append(lanes[number + side].line_types[(1 - side) // 2])
    if max(drawn) == LineType.NONE:
        return "none"
    if max(drawn) == LineType.STRIPED:
        return "striped"
    return "solid" if beside else "edge"
