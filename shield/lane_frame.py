"""Road users from world coordinates to the lane frame of the ego."""

import numpy as np

from shield.compiled import compiled
from shield.geometry import COS, CURVATURE, HEADING, SIN, nearest_piece, turned_half_extents, wrap_angle


def same_frame(road: np.ndarray, other: np.ndarray) -> bool:
    """Do two roads `[K, 8]` differ by a lateral shift at most? Then no gap jumps between them."""
    straight = not (road[:, CURVATURE].any() or other[:, CURVATURE].any())
    return straight and bool(np.ptp(np.concatenate([road[:, HEADING], other[:, HEADING]])) < 1e-9)


@compiled
def to_lane_frame(road, x, y, heading, speed, cos, sin, x_before, y_before, box, dt, user):
    """Fill in what one `ROAD_USER` record says about motion and size.

    Args:
      road: `[K, 8]` pieces.
      x, y, heading, speed: in the world [m], [m], [rad], [m/s].
      cos, sin: of the heading.
      x_before, y_before: one frame ago [m], nan at first sight.
      box: length, width, and `largest_half_extents` of the user [m].
      dt: length of a frame [s].
      user: `ROAD_USER` record, overwritten but for `wreck` and `in_own_lane`.

    Returns:
      Curvature of the lane beside the user [1/m].
    """
    s, lateral, k, lane_heading = nearest_piece(road, x, y)
    curvature = road[k, CURVATURE] if k >= 0 else 0.0
    if k >= 0 and curvature == 0.0:
        lane_cos, lane_sin = road[k, COS], road[k, SIN]
    else:
        lane_cos, lane_sin = np.cos(lane_heading), np.sin(lane_heading)
    user.s, user.y, user.speed = s, lateral, speed
    psi = heading - lane_heading
    user.heading = psi if abs(psi) < np.pi else wrap_angle(psi)
    user.cos, user.sin = cos * lane_cos + sin * lane_sin, sin * lane_cos - cos * lane_sin
    dx, dy = x - x_before, y - y_before
    if np.isnan(dx):
        user.along, user.u = speed * user.cos, speed * user.sin
    else:
        per_second = 1.0 / dt
        user.along, user.u = (dx * lane_cos + dy * lane_sin) * per_second, (dy * lane_cos - dx * lane_sin) * per_second
    along, across = turned_half_extents(box[0], box[1], user.cos, user.sin)
    user.half_length, user.half_width = max(along, box[2]), max(across, box[3])
    return curvature


@compiled
def to_lane_frame_all(road, poses, before, boxes, dt, users):
    """`to_lane_frame` for N users.

    Args:
      road: `[K, 8]` pieces.
      poses: `[N, 4]` x, y, heading, speed in the world.
      before: `[N, 2]` positions one frame ago, nan at first sight.
      boxes: `[N, 4]`, see `to_lane_frame`.
      dt: length of a frame [s].
      users: `[N]` `ROAD_USER` records, changed.

    Returns:
      Curvature of the lane beside the last user [1/m].
    """
    curvature = 0.0
    for i in range(len(users)):
        x, y, heading, speed = poses[i, 0], poses[i, 1], poses[i, 2], poses[i, 3]
        cos, sin = np.cos(heading), np.sin(heading)
        curvature = to_lane_frame(
            road, x, y, heading, speed, cos, sin, before[i, 0], before[i, 1], boxes[i], dt, users[i]
        )
    return curvature
