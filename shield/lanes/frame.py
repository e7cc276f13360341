"""Road users from world coordinates to the lane frame of the ego."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, rare
from rss_shield.shield.geometry import (
    AROUND,
    COS,
    CURVATURE,
    HEADING,
    SIN,
    follow,
    is_straight,
    nearest_piece,
    turned_half_extents,
    wrap_angle,
)


class Bend(NamedTuple):
    """How the lane turns under the ego during the coming frame."""

    curvature: float  # of an arc that leaves its tangent as far, at the ego's lateral offset, right > 0 [1/m]
    slack: float  # heading, relative to the lane, of a car that kept to the lane, at the end of the frame [rad]
    turned: float = 0.0  # how far the lane turns [rad]
    idle: float = 0.0  # heading at the end of the frame from which a fast car keeps to the lane on the next one [rad]


def same_frame(road: np.ndarray, other: np.ndarray) -> bool:
    """Do two roads `[K, 11]` differ by a lateral shift at most? Then no gap jumps between them."""
    straight = not (road[:, CURVATURE].any() or other[:, CURVATURE].any())
    return straight and bool(np.ptp(np.concatenate([road[:, HEADING], other[:, HEADING]])) < 1e-9)


@compiled
def to_lane_frame(road, x, y, heading, speed, cos, sin, x_before, y_before, box, dt, user):
    """Fill in what one `ROAD_USER` record says about motion and size.

    Args:
      road: `[K, 11]` pieces.
      x, y, heading, speed: in the world [m], [m], [rad], [m/s].
      cos, sin: of the heading.
      x_before, y_before: one frame ago [m], nan at first sight.
      box: length, width, and `largest_half_extents` of the user [m].
      dt: length of a frame [s].
      user: `ROAD_USER` record, overwritten but for `wreck` and `in_own_lane`.
    """
    s, lateral, k, lane_heading = nearest_piece(road, x, y)
    if road[k, CURVATURE] == 0.0:
        lane_cos, lane_sin = road[k, COS], road[k, SIN]
    else:
        lane_cos, lane_sin = np.cos(lane_heading), np.sin(lane_heading)
    user.s, user.y, user.speed = s, lateral, speed
    user.around = road[k, AROUND]
    psi = heading - lane_heading
    user.heading = psi if abs(psi) < np.pi else wrap_angle(psi)
    user.cos, user.sin = cos * lane_cos + sin * lane_sin, sin * lane_cos - cos * lane_sin
    along, across = turned_half_extents(box[0], box[1], user.cos, user.sin)
    user.half_length, user.half_width = max(along, box[2]), max(across, box[3])
    dx, dy = x - x_before, y - y_before
    if np.isnan(dx):
        user.along, user.u = speed * user.cos, speed * user.sin
    else:
        per_second = 1.0 / dt
        user.along, user.u = (dx * lane_cos + dy * lane_sin) * per_second, (dy * lane_cos - dx * lane_sin) * per_second
    if not is_straight(road):
        _account_for_bend(road, k, x, y, lane_heading, cos, sin, dx, dy, box[0] / 2, dt, user)


@rare
def _account_for_bend(road, k, x, y, lane_heading, cos, sin, dx, dy, half_length, dt, user):
    """Take out of lateral motion and heading what is the lane's doing and not the driver's.

    The lateral speed is what the lateral offset changed by, because a car that keeps to a bend leaves every
    tangent of it. And such a car is not parallel to the lane at its centre: it turns about its rear axle, whose
    lane has another heading there. Between the two headings nothing moves it across the lane.
    """
    _, rear = follow(road, k, x - half_length * cos, y - half_length * sin)
    if rear != lane_heading:
        tilt = wrap_angle(rear - lane_heading)
        folded = user.heading - np.pi * np.round(user.heading / np.pi)  # of a car that drives the other way, too
        user.sin = np.sin(beyond(folded, tilt)) * (1.0 if user.cos >= 0.0 else -1.0)
    if np.isnan(dx):
        user.u = user.speed * user.sin
        return
    lateral, before = follow(road, k, x - dx, y - dy)
    if before != lane_heading:
        halfway = lane_heading + 0.5 * wrap_angle(before - lane_heading)
        user.along = (dx * np.cos(halfway) + dy * np.sin(halfway)) / dt
        user.u = (user.y - lateral) / dt


@compiled
def beyond(heading, slack):
    """What of a heading relative to the lane is neither between 0 and a slack nor at either [rad]."""
    return outside(heading, min(slack, 0.0), max(slack, 0.0))


@compiled
def outside(heading, low, high):
    """How far a heading is above `high`, or below `low` (then negative) [rad]."""
    if heading > high:
        return heading - high
    return heading - low if heading < low else 0.0


@compiled
def look_ahead(road, x, y, speed, half_length, dt):
    """`Bend` under a car that keeps to its lane for a frame.

    Args:
      road: `[K, 11]` pieces.
      x, y, speed: of the car in the world [m], [m/s].
      half_length: from its centre to its rear axle [m].
      dt: length of the frame [s].
    """
    if is_straight(road):
        return Bend(0.0, 0.0, 0.0, 0.0)
    return _look_ahead(road, x, y, speed, half_length, dt)


_AHEAD = 6  # frames
_LEAST = 1e-3  # chord of a car that stands [m]
_SHORT, _LONG = 0.1, 1.0  # one that is too short to tell a bend by, and one that is not [m]
_FAST = 1.8  # half wheelbases per frame; from 2 on `idle` counts, and a car may become faster during the frame


@rare
def _look_ahead(road, x, y, speed, half_length, dt):
    way = speed * dt
    distance = way if abs(way) > _LEAST else np.copysign(_LEAST, way)
    x_next, y_next, heading, drift, turned = _chord(road, x, y, distance)
    idle = _idle(road, x_next, y_next, distance, half_length) if distance >= _FAST * half_length else 0.0
    if turned == 0.0:
        return Bend(0.0, 0.0, 0.0, idle)
    after = heading + turned
    _, _, k, _ = nearest_piece(road, x, y)
    _, rear = follow(road, k, x_next - half_length * np.cos(after), y_next - half_length * np.sin(after))
    return Bend(_curvature(road, x, y, distance, drift, half_length), wrap_angle(rear - after), turned, idle)


@inner
def _curvature(road, x, y, distance, drift, half_length):
    """Of the lane along a chord, whose drift is known [1/m].

    Where pieces do not quite meet, a car that hardly moves sees a step of a millimetre as a bend that no car can take:
    it looks farther, and no bend is tighter than its wheelbase.
    """
    if abs(distance) >= _SHORT:
        return 2.0 * drift / distance
    farther = np.copysign(_LONG, distance)
    drift = _chord(road, x, y, farther)[3]
    return min(max(2.0 * drift / farther, -0.5 / half_length), 0.5 / half_length)


@inner
def _chord(road, x, y, distance):
    """Along the chord of the lane's arc at a place: (x, y at its end, lane heading at its start, drift, turn).

    Drift is by how much the lane leaves the chord, per metre; turn is that of the lane's heading [rad].
    """
    _, lateral, k, heading = nearest_piece(road, x, y)
    kappa = road[k, CURVATURE] / (1.0 - road[k, CURVATURE] * lateral)
    # where the arc ends the car leaves the lane on the chord
    angle = 0.5 * kappa * distance
    course = heading + angle
    x_next, y_next = x + distance * np.cos(course), y + distance * np.sin(course)
    lateral_next, heading_next = follow(road, k, x_next, y_next)
    drift = np.sin(angle) - (lateral_next - lateral) / distance
    return x_next, y_next, heading, drift, wrap_angle(heading_next - heading)


@rare
def _idle(road, x, y, distance, half_length):
    """`Bend.idle` at a place: the slip that keeps a car there to the lane also gives it the next such heading.

    With G half wheelbases per frame, slip beta moves it across the lane by psi + beta - drift, and its heading psi
    becomes psi + G beta - turn. So psi = (G drift - turn - next psi) / (G - 1). In a steady bend that repeats itself
    for psi = curvature (distance / 2 - half_length), which is taken to hold after a few frames: what that is wrong by
    shrinks by G - 1 with each of them.
    """
    gain = distance / half_length
    idle, weight = 0.0, 1.0
    for _ in range(_AHEAD):
        x, y, _, drift, turned = _chord(road, x, y, distance)
        weight /= gain - 1.0
        idle += weight * (gain * drift - turned)
        weight = -weight
    _, lateral, k, _ = nearest_piece(road, x, y)
    kappa = road[k, CURVATURE] / (1.0 - road[k, CURVATURE] * lateral)
    return idle + weight * kappa * (0.5 * distance - half_length)


@compiled
def to_lane_frame_all(road, poses, before, boxes, dt, users):
    """`to_lane_frame` for N users.

    Args:
      road: `[K, 11]` pieces.
      poses: `[N, 4]` x, y, heading, speed in the world.
      before: `[N, 2]` positions one frame ago, nan at first sight.
      boxes: `[N, 4]`, see `to_lane_frame`.
      dt: length of a frame [s].
      users: `[N]` `ROAD_USER` records, changed.
    """
    for i in range(len(users)):
        x, y, heading, speed = poses[i, 0], poses[i, 1], poses[i, 2], poses[i, 3]
        cos, sin = np.cos(heading), np.sin(heading)
        to_lane_frame(road, x, y, heading, speed, cos, sin, before[i, 0], before[i, 1], boxes[i], dt, users[i])
