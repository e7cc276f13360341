"""What can be seen from a car, and who must be expected where nothing can be: ghosts (Defs. 23-26).

Occluders are boxes: parked cars, other cars, buildings. A road user is seen when its middle or a corner of it is in
sight of the eye; who has been seen once is known from then on (exposure, Def. 23). Where somebody may stand who is not
seen there is a ghost with the worst reasonable speed of the published table (`definitions.occlusion.REASONABLE`). It is
input for the shield, a record like any other.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled_for_arrays
from rss_shield.shield.definitions.occlusion import REASONABLE, is_hidden
from rss_shield.shield.people.reach import PERSON

EYE = 2.0  # ahead of the middle of a car: behind the windscreen is too far back for cameras in front [m]
AROUND = 3.0  # whoever is nearer than this is felt, seen or not [m]
AHEAD = 45.0  # ghosts farther ahead than this are too far to matter at the speeds of towns [m]
NOBODY = np.zeros(0, PERSON)


class Box(NamedTuple):
    """An occluder: a rectangle that nobody looks through."""

    x: float  # of its middle [m]
    y: float
    length: float  # along its heading [m]
    width: float
    heading: float = 0.0  # [rad]


class Columns(NamedTuple):
    """Places where people may stand unseen. K columns of D places each, the nearest to the road first."""

    points: np.ndarray  # `[K, D, 2]` [m]
    heading: np.ndarray  # `[K]` toward the road [rad]
    place: tuple[str, str]  # class and place in the published table
    crossing: int = -1  # index of the crossing that they lead to, -1 = none

    @property
    def v_high(self) -> float:
        """Largest speed that is reasonable there [m/s]."""
        return REASONABLE[self.place].v_high


def walls_of(boxes: list[Box]) -> np.ndarray:
    """Sides of boxes, `[4 B, 4]` from (x, y) to (x, y) [m]."""
    walls = [np.zeros((0, 4))]
    for box in boxes:
        corners = corners_of(box)
        walls.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    return np.concatenate(walls)


def corners_of(box: Box) -> np.ndarray:
    """`[4, 2]` [m], in order around it."""
    cos, sin = np.cos(box.heading), np.sin(box.heading)
    along, across = np.array([cos, sin]) * box.length / 2, np.array([-sin, cos]) * box.width / 2
    return np.array([box.x, box.y]) + np.array([along + across, along - across, -along - across, -along + across])


def box_of(user) -> Box:
    """The box of one of highway-env's vehicles or objects."""
    x, y = user.position
    return Box(float(x), float(y), user.LENGTH, user.WIDTH, float(user.heading))


def eye_of(vehicle) -> np.ndarray:
    """Where a car looks from [m]."""
    return vehicle.position + EYE * vehicle.direction


@compiled_for_arrays
def are_hidden(x, y, points, walls):
    """`[K]` bool: does a wall stand between the eye and each point? See `definitions.occlusion.is_hidden`.

    Args:
      x, y: of the eye [m].
      points: `[K, 2]` [m].
      walls: `[M, 4]` [m].
    """
    hidden = np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        hidden[k] = is_hidden(x, y, points[k, 0], points[k, 1], walls)
    return hidden


def sees(vehicle, user, walls: np.ndarray) -> bool:
    """Does a car see any of the middle and the corners of a road user?

    Args:
      vehicle: the car.
      user: not one of the occluders.
      walls: `[M, 4]` [m].
    """
    if np.hypot(*(user.position - vehicle.position)) < AROUND + vehicle.LENGTH / 2:
        return True
    if not len(walls):
        return True
    points = np.concatenate([[user.position], corners_of(box_of(user))])
    return not are_hidden(*eye_of(vehicle), points, walls).all()


def hidden_people(vehicle, columns: Columns, walls: np.ndarray, radius: float, crossings: np.ndarray) -> np.ndarray:
    """A ghost in each column: at the place nearest to the road that is not seen, as fast as is reasonable.

    Args:
      vehicle: the car that looks.
      columns: `Columns`.
      walls: `[M, 4]` [m].
      radius: of a body [m].
      crossings: `[Z, 2]` from and to, along the way of the car [m].

    Returns:
      `[G]` PERSON, of nobody who is known (`user` = -1).
    """
    if not len(walls) or not len(columns.points):
        return NOBODY
    ahead = (columns.points[:, 0] - vehicle.position) @ vehicle.direction
    near = np.flatnonzero((ahead > 0.0) & (ahead < AHEAD))
    points = columns.points[near]
    hidden = are_hidden(*eye_of(vehicle), points.reshape(-1, 2), walls).reshape(points.shape[:2])
    found = np.flatnonzero(hidden.any(axis=1))
    people = np.zeros(len(found), PERSON)
    where = points[found, hidden[found].argmax(axis=1)]
    people["user"], people["radius"], people["v"], people["v_high"] = -1, radius, columns.v_high, columns.v_high
    people["x"], people["y"], people["heading"] = where[:, 0], where[:, 1], columns.heading[near[found]]
    people["route_from"] = people["route_to"] = np.nan
    if columns.crossing >= 0:
        people["route_from"], people["route_to"] = crossings[columns.crossing]
    return people


class HiddenLane:
    """How far away a car may be that comes up a lane unseen: consistent with what has been seen free before.

    Args:
      network: highway-env's.
      index: of the lane; cars come along it to its end.
      v_high: as fast as they may reasonably be [m/s].
    """

    def __init__(self, network, index, v_high: float) -> None:
        lane = network.get_lane(index)
        self.index, self.v_high = index, v_high
        self.s = np.arange(0.0, lane.length + 0.5, 1.0)
        self.points = np.array([lane.position(s, 0.0) for s in self.s])
        self.front, self.frame = np.inf, -1  # arc length [m] that was looked up on a frame; inf = none yet

    def look(self, vehicle, walls: np.ndarray, frame: int, dt: float) -> float:
        """Arc length that the front of a hidden car may have come to on a frame [m].

        That is the hidden place nearest to the end, but nobody comes there sooner than from where they were before.
        """
        if frame != self.frame:
            hidden = are_hidden(*eye_of(vehicle), self.points, walls)
            now = float(self.s[hidden].max(initial=0.0))
            self.front = min(now, self.front + self.v_high * dt * (frame - self.frame))
            self.frame = frame
        return self.front
