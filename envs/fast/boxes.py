"""How far the engine's road users reach in the lane frame."""

import numpy as np

from rss_shield.envs.fast.state import OBSTACLE_SIZE
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH
from rss_shield.shield.geometry import box_of


def boxes_of(heading_bound: float, curvature: float) -> np.ndarray:
    """`[2, 4]` length, width, largest half extents of a car and of an obstacle [m].

    Args:
      heading_bound: as in `Rules` [rad].
      curvature: the tightest bend of the roads [1/m].
    """
    bounds = heading_bound, curvature
    car = box_of(CAR_LENGTH, CAR_WIDTH, *bounds)
    return np.array([car, box_of(OBSTACLE_SIZE, OBSTACLE_SIZE, *bounds, driven=False)])
