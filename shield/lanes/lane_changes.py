"""A lane change that is blocked is taken back, and one half done is completed: nobody stays between two lanes.

Lateral speeds grow slowly (C1y), so an agent that changes its mind on every decision would never get off the line.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import stopping_distance

OFF_CENTRE = 1.0  # farther than this from the centre of every lane, a car is between two lanes [m]
_BLOCKED_BY = 0.1  # so much of the way has to be missing [m]
_RATE = 1.0  # lateral speed back to the centre per distance from it [1/s]
_CREEP = 0.1  # below this speed there is no steering [m/s]


@compiled
def room_beside(margin, w, car, dt):
    """How far the ego may go toward a neighbour alongside before it has to be at rest laterally [m].

    Args:
      margin: of Def. 6 [m].
      w: speed of the ego toward the other, >= 0 [m/s].
      car: `RSSParams` of the ego.
      dt: length of a frame [s].
    """
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    return margin + w * (rho + dt / 2) + stopping_distance(w + a * rho, b) - stopping_distance(a * rho, b)


class Rooms(NamedTuple):
    """How far the ego may go to either side beside who is alongside [m]; inf where nobody is."""

    left: float
    right: float


@inner
def beside(rooms, pair, ego, user, car, dt):
    """`Rooms` after one more pair; `car`: `RSSParams` of the ego."""
    if pair.safe_lon or pair.gap_lat <= -min(ego.half_width, user.half_width):
        return rooms
    room = room_beside(pair.margin_lat, pair.w_ego, car, dt)
    if pair.side > 0.0:
        return Rooms(rooms.left, min(rooms.right, room))
    return Rooms(min(rooms.left, room), rooms.right)


@compiled
def is_blocked(offset, room_left, room_right):
    """Is the way to the centre of a lane blocked by somebody alongside?

    Args:
      offset: of the ego from that centre, positive to the right [m].
      room_left, room_right: see `room_beside`; inf where nobody is.
    """
    return (room_left if offset > 0.0 else room_right) < abs(offset) - _BLOCKED_BY


@compiled
def turns_back(offset, offset_before, step):
    """Does an agent between two lanes ask for the opposite of the lane change that is under way?

    Args:
      offset: of the ego from the centre of the lane it is on, positive to the right [m].
      offset_before: from that of the lane it heads for [m].
      step: to the lane that is asked for from that one, positive to the right.
    """
    return abs(offset) > OFF_CENTRE and step * offset_before > 0.0


@compiled
def lead_back(slip, ego, width, room_left, room_right, half_wheelbase, curvature, dt):
    """The slip angle that an agent asks for; between two lanes, if it cannot get to the other one, one that leads back.

    Args:
      slip: asked for [rad].
      ego: `ROAD_USER`, along the lane it is on.
      width: of the lane [m].
      room_left, room_right: see `room_beside`.
      half_wheelbase, curvature: as in `Body`.
      dt: length of a frame [s].
    """
    offset = ego.y
    other = offset - width if offset > 0.0 else offset + width  # from the centre of the lane beyond
    if abs(offset) <= OFF_CENTRE or ego.speed < _CREEP or not is_blocked(other, room_left, room_right):
        return slip
    v = ego.speed
    turn = np.arcsin(min(max(-_RATE * offset / v, -1.0), 1.0)) - ego.heading + curvature * v * dt
    back = np.arcsin(min(max(turn * half_wheelbase / (v * dt), -1.0), 1.0))
    return min(slip, back) if offset > 0.0 else max(slip, back)
