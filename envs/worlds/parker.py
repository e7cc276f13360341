"""A scripted driver who parks: it looks for a way that leads into its place, and follows it.

A way is up to two stretches of constant curvature, in either gear, and then a law that follows the line through the
place. Ways are played ahead, and the shortest that ends in the place and touches nobody, as everybody stands now, is
taken. It does not foresee where others drive, and knows nothing of a shield.
"""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.geometry import wrap_angle

SPEED = 2.0  # [m/s]
SHARPEST = 0.18  # curvature of the way of the rear end [1/m]; the wheels turn as far as 0.2
_STEP = 0.4  # in which ways are played ahead [m]
_LENGTHS = (0.0, 3.0, 6.0, 9.0, 12.0)  # of a stretch [m]
_LONGEST = 90.0  # way [m]
_NEAR, _STRAIGHT = 0.4, 0.12  # how exactly a way has to end [m], [rad]
_GAP = 0.35  # that is kept to everybody [m]
_BRAKE, _GAIN = 1.5, 3.0  # [m/s^2], of the speed [1/s]
_PATIENCE = 1.5  # blocked for so long it looks for another way [s]


class Stretch(NamedTuple):
    """A part of a way: `curvature` to the right [1/m], `length` [m], negative in reverse."""

    curvature: float
    length: float


@compiled
def curvature_to(x, y, heading, goal_x, goal_y, goal_heading):
    """Curvature that leads the rear end of a car onto the line through its goal [1/m]."""
    cos, sin = np.cos(goal_heading), np.sin(goal_heading)
    aside = (y - goal_y) * cos - (x - goal_x) * sin
    wanted = -min(max(1.3 * np.arctan(aside / 2.5), -1.4), 1.4)
    kappa = 0.9 * wrap_angle(wanted - wrap_angle(heading - goal_heading))
    return min(max(kappa, -SHARPEST), SHARPEST)


@compiled
def _touches(x, y, heading, lag, half_width, boxes):
    """Does a car come nearer to a box than is kept? Its three discs against boxes `[M, 5]`."""
    cos, sin = np.cos(heading), np.sin(heading)
    radius = np.hypot(half_width, lag / 3.0) * 0.92 + _GAP
    for k in range(3):
        ahead = lag * (1.0 + 2.0 * (k - 1) / 3.0)
        px, py = x + ahead * cos, y + ahead * sin
        for box in range(len(boxes)):
            c, s = np.cos(boxes[box, 2]), np.sin(boxes[box, 2])
            dx, dy = px - boxes[box, 0], py - boxes[box, 1]
            along = max(np.abs(dx * c + dy * s) - boxes[box, 3], 0.0)
            across = max(np.abs(dy * c - dx * s) - boxes[box, 4], 0.0)
            if along * along + across * across < radius * radius:
                return True
    return False


@compiled
def length_of_way(pose, goal, first, second, boxes):
    """Length of a way into a place, with 4 m for each change of gear; inf if it does not lead there [m].

    Args:
      pose: (x, y, heading, half length, half width) of the rear end of a car.
      goal: (x, y, heading) of its rear end when it is parked.
      first, second: `Stretch`, then the law takes over.
      boxes: `[M, 5]` x, y, heading, half length, half width of everybody.
    """
    x, y, heading, lag, half_width = pose
    cost, gear = 0.0, 1.0
    for stage in range(2):
        stretch = first if stage == 0 else second
        forward = 1.0 if stretch.length >= 0.0 else -1.0
        steps = int(np.abs(stretch.length) / _STEP + 0.5)
        if steps > 0 and forward != gear:
            cost, gear = cost + 4.0, forward
        for _ in range(steps):
            x, y = x + forward * _STEP * np.cos(heading), y + forward * _STEP * np.sin(heading)
            heading += forward * _STEP * stretch.curvature
            cost += _STEP
            if _touches(x, y, heading, lag, half_width, boxes):
                return np.inf
    cost += 4.0 * (gear < 0.0)
    cos, sin = np.cos(goal[2]), np.sin(goal[2])
    while cost < _LONGEST:
        left = (goal[0] - x) * cos + (goal[1] - y) * sin
        if left <= 0.5 * _STEP:
            aside = (y - goal[1]) * cos - (x - goal[0]) * sin
            ends_well = np.abs(aside) < _NEAR and np.abs(wrap_angle(heading - goal[2])) < _STRAIGHT
            return cost if ends_well and left > -2.0 * _STEP else np.inf
        kappa = curvature_to(x, y, heading, goal[0], goal[1], goal[2])
        x, y = x + _STEP * np.cos(heading), y + _STEP * np.sin(heading)
        heading += _STEP * kappa
        cost += _STEP
        if _touches(x, y, heading, lag, half_width, boxes):
            return np.inf
    return np.inf


@compiled
def best_way(pose, goal, boxes, noise):
    """The shortest way into a place: (length, first, second); inf if none is known. noise: `[N]` >= 0 added in turn."""
    best, first, second, n = np.inf, Stretch(0.0, 0.0), Stretch(0.0, 0.0), 0
    for level in range(3):  # the law alone, then one stretch before it, then two
        for i in range(_choices(level >= 1)):
            for j in range(_choices(level >= 2)):
                one, two = _stretch(i), _stretch(j)
                if (level >= 1 and one.length == 0.0) or (level >= 2 and two.length == 0.0):
                    continue
                length = length_of_way(pose, goal, one, two, boxes) + noise[n % len(noise)]
                n += 1
                if length < best:
                    best, first, second = length, one, two
        if best < np.inf:
            break
    return best, first, second


@compiled
def _choices(several):
    return 6 * len(_LENGTHS) if several else 1


@compiled
def _stretch(i):
    """All stretches by number: lengths, gears, curvatures."""
    length = _LENGTHS[i % len(_LENGTHS)]
    way = i // len(_LENGTHS)
    return Stretch(SHARPEST * (way % 3 - 1.0), length if way < 3 else -length)


class Parker:
    """Parks one car. `command` is asked once per decision.

    Args:
      rng: draws how long it waits and where it backs out when it is in somebody's way.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.way: list[Stretch] | None = None  # what is left of it before the law takes over
        self.blocked = 0.0  # for how long it has stood though it wants to drive [s]
        self.patience = 0.0
        self.last: np.ndarray | None = None

    def command(self, vehicle: Any, others: list[Any], dt: float) -> tuple[float, float]:
        """Acceleration [m/s^2] and steering angle [rad] until the next decision.

        Args:
          vehicle: highway-env's, with a `goal`. others: everybody else that has a box.
          dt: length of a decision [s].
        """
        lag = vehicle.LENGTH / 2
        u = vehicle.direction
        rear, heading, v = vehicle.position - lag * u, vehicle.heading, vehicle.speed
        goal_u = np.array([np.cos(vehicle.goal.heading), np.sin(vehicle.goal.heading)])
        goal = (*(vehicle.goal.position - lag * goal_u), vehicle.goal.heading)
        if is_parked(vehicle, 0.5):
            return -v / max(dt, 0.2), 0.0
        self._advance(rear, dt, v)
        if self.way is None:
            self._look_for_a_way((*rear, heading, lag, vehicle.WIDTH / 2), goal, others)
        if self.way is None:
            return -_GAIN * v, 0.0
        if self.way:
            kappa, left = self.way[0].curvature, self.way[0].length
        else:
            kappa = float(curvature_to(*rear, heading, *goal))
            left = float((goal[0] - rear[0]) * goal_u[0] + (goal[1] - rear[1]) * goal_u[1])
            if left < -0.5:
                self.way = None  # too far: another try
                return -_GAIN * v, 0.0
        wanted = np.sign(left) * min(SPEED, np.sqrt(2 * _BRAKE * abs(left)))
        return float(np.clip(_GAIN * (wanted - v), -4.0, 2.5)), float(np.arctan(2 * lag * kappa))

    def _advance(self, rear: np.ndarray, dt: float, v: float) -> None:
        """Take off the way what has been covered; give it up if somebody is in it."""
        covered = 0.0 if self.last is None else float(np.hypot(*(rear - self.last)))
        self.last = rear.copy()
        if self.way is None:
            return
        self.blocked = self.blocked + dt if abs(v) < 0.1 else 0.0
        if self.blocked > self.patience:
            self.way, self.blocked = None, 0.0
            return
        if self.way:
            first = self.way[0]
            left = abs(first.length) - covered
            self.way = [first._replace(length=float(np.copysign(left, first.length))), *self.way[1:]]
            if left < 0.1:
                self.way = self.way[1:]

    def _look_for_a_way(self, pose: tuple, goal: tuple, others: list[Any]) -> None:
        boxes = np.array([(*o.position, o.heading, o.LENGTH / 2, o.WIDTH / 2) for o in others], float).reshape(-1, 5)
        noise = self.rng.uniform(0.0, 3.0, 64)
        length, first, second = best_way(tuple(map(float, pose)), tuple(map(float, goal)), boxes, noise)
        self.patience = _PATIENCE * self.rng.uniform(0.7, 2.5)
        if np.isfinite(length):
            self.way = [one for one in (first, second) if one.length != 0.0]
        elif self.rng.random() < 0.1:  # out of the way of whoever may be waiting
            gear, side = self.rng.choice([-1.0, 1.0]), self.rng.choice([-1.0, 0.0, 1.0])
            self.way = [Stretch(SHARPEST * side, gear * 3.0)]


def is_parked(vehicle: Any, speed: float = 0.2) -> bool:
    """Is a car in its place, within 0.6 m along it, 0.5 m across and 0.15 rad, and slower than `speed` [m/s]?"""
    offset = vehicle.goal.position - vehicle.position
    cos, sin = np.cos(vehicle.goal.heading), np.sin(vehicle.goal.heading)
    along, across = offset[0] * cos + offset[1] * sin, offset[1] * cos - offset[0] * sin
    turn = (vehicle.heading - vehicle.goal.heading + np.pi) % (2 * np.pi) - np.pi
    return bool(abs(along) < 0.6 and abs(across) < 0.5 and abs(turn) < 0.15 and abs(vehicle.speed) < speed)
