"""What an episode looked like from outside: distances in time, near misses, encroachments, standing still, impacts.

Names are those of CommonRoad-CriMe where it has the measure: TTC, THW, PET (post-encroachment time), DeltaV; DRAC is
minus its ALongReq for a leader at constant speed. Everything is read off positions, headings, speeds and boxes in the
world, so highway-env, the engine's recordings and logs of anything else are measured alike. Nothing here filters.

Ahead is along the ego's heading, as if its lane went straight on.
"""

import math
from typing import NamedTuple

import numpy as np

from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.risk.surrogates import required_braking, time_headway

LONGEST = 100.0  # times are reported up to this [s]
NEAR_MISS = 1.5  # TTC below which a conflict is serious (van der Horst & Hogema 1993) [s]
STANDS = 0.5  # slower than this is standing [m/s]
ROOM = 20.0  # nobody is in the way of who has this much room around [m]
CELL = 1.0  # side of the squares that a conflict area consists of [m]
CROSSING = math.radians(30.0)  # courses that differ by less do not cross


class Measures(NamedTuple):
    """Of an episode so far."""

    min_thw_ahead: float = LONGEST  # THW toward the nearest one ahead in the ego's way, smallest [s]
    min_ttc_ahead: float = LONGEST  # TTC toward the same [s]
    max_drac_ahead: float = 0.0  # DRAC toward the same, largest [m/s^2]
    min_pet: float = LONGEST  # PET with anybody whose course crosses the ego's, smallest [s]
    near_misses: int = 0  # how often TTC fell below 1.5 s
    standing_free: float = 0.0  # how long the ego stands by now with nobody within 20 m [s]
    impact_speed: float = 0.0  # relative speed of both at the first contact [m/s]
    delta_v: float = 0.0  # DeltaV of the ego there, if both are of one mass and stick together: half of it [m/s]


class EpisodeMeter:
    """Takes in an episode frame by frame.

    Args:
      dt: length of a frame [s].
      crossing: roads cross, so post-encroachment times are measured.
    """

    def __init__(self, dt: float, crossing: bool) -> None:
        self.dt, self.crossing = dt, crossing
        self.now = 0.0
        self.measures = Measures()
        self.near = False
        # square -> when and on which course the ego was there last; somebody else, for each eighth of a full turn
        self.own: dict[tuple[int, int], tuple[float, float]] = {}
        self.others: dict[tuple[int, int], dict[int, tuple[float, float]]] = {}

    def look(self, poses: np.ndarray, boxes: np.ndarray) -> None:
        """Take in one frame before anybody has moved.

        Args:
          poses: `[N + 1, 4]` x, y, heading, speed, the ego last.
          boxes: `[N + 1, 2+]` length, width.
        """
        old = self.measures
        ttc, thw, drac, nearest = _ahead(poses, boxes)
        free = abs(poses[-1, 3]) < STANDS and nearest > ROOM
        near = ttc < NEAR_MISS
        self.measures = old._replace(
            min_thw_ahead=min(old.min_thw_ahead, thw),
            min_ttc_ahead=min(old.min_ttc_ahead, ttc),
            max_drac_ahead=max(old.max_drac_ahead, drac),
            near_misses=old.near_misses + (near and not self.near),
            standing_free=old.standing_free + self.dt if free else 0.0,
        )
        self.near = near
        if self.crossing:
            self._encroach(poses, boxes)
        self.now += self.dt

    def touch(self, poses: np.ndarray, partner: int) -> None:
        """The first contact, with row `partner` of the poses."""
        velocities = poses[:, 3:] * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        speed = float(np.hypot(*(velocities[-1] - velocities[partner])))
        self.measures = self.measures._replace(impact_speed=speed, delta_v=0.5 * speed)

    def _encroach(self, poses: np.ndarray, boxes: np.ndarray) -> None:
        """Who comes to a square that another has left, and how long after?"""
        least, now = self.measures.min_pet, self.now
        here = _squares(poses[-1], boxes[-1])
        for square in here:
            for then, course in self.others.get(square, {}).values():
                if then < now and _cross(course, poses[-1, 2]):
                    least = min(least, now - then)
        for i in range(len(poses) - 1):
            eighth = math.floor(4.0 * poses[i, 2] / math.pi) % 8
            for square in _squares(poses[i], boxes[i]):
                if square in self.own:
                    then, course = self.own[square]
                    if then < now and _cross(course, poses[i, 2]):
                        least = min(least, now - then)
                self.others.setdefault(square, {})[eighth] = now, poses[i, 2]
        for square in here:
            self.own[square] = now, poses[-1, 2]
        self.measures = self.measures._replace(min_pet=float(least))


def _ahead(poses: np.ndarray, boxes: np.ndarray) -> tuple[float, float, float, float]:
    """TTC, THW and DRAC toward the nearest one ahead in the way, and how near the nearest of all is [m]."""
    if len(poses) < 2:
        return math.inf, math.inf, 0.0, math.inf
    x, y, heading, speed = poses[-1]
    dx, dy = poses[:-1, 0] - x, poses[:-1, 1] - y
    along, across = dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)
    cos, sin = np.abs(np.cos(poses[:-1, 2] - heading)), np.abs(np.sin(poses[:-1, 2] - heading))
    lengths, widths = boxes[:-1, 0], boxes[:-1, 1]
    half_length, half_width = 0.5 * (cos * lengths + sin * widths), 0.5 * (sin * lengths + cos * widths)
    gaps = along - half_length - 0.5 * boxes[-1, 0]
    sideways = np.abs(across) - half_width - 0.5 * boxes[-1, 1]
    nearest = float(np.min(np.hypot(np.maximum(np.abs(along) - half_length - 0.5 * boxes[-1, 0], 0.0),
                                    np.maximum(sideways, 0.0))))  # fmt: skip
    gaps = np.where((along >= 0.0) & (sideways < 0.0), gaps, np.inf)
    lead = int(np.argmin(gaps))
    gap = float(gaps[lead])
    if gap == math.inf:
        return math.inf, math.inf, 0.0, nearest
    closing = float(speed - poses[lead, 3] * np.cos(poses[lead, 2] - heading))
    gap = max(gap, 0.0)
    return (
        float(time_to_collision(gap, closing)),
        float(time_headway(gap, speed)),
        float(min(required_braking(gap, closing), LONGEST)),
        nearest,
    )


def _squares(pose: np.ndarray, box: np.ndarray) -> set[tuple[int, int]]:
    """Squares of the ground under a box."""
    x, y, heading = pose[:3]
    along = np.linspace(-0.5, 0.5, max(2, math.ceil(2 * box[0] / CELL))) * box[0]
    across = np.linspace(-0.5, 0.5, max(2, math.ceil(2 * box[1] / CELL))) * box[1]
    cos, sin = math.cos(heading), math.sin(heading)
    px = x + along[:, None] * cos - across[None, :] * sin
    py = y + along[:, None] * sin + across[None, :] * cos
    return set(zip(np.floor(px / CELL).astype(int).flat, np.floor(py / CELL).astype(int).flat, strict=True))


def _cross(course: float, another: float) -> bool:
    """Do two courses cross? Those of oncoming cars do not."""
    return abs(math.sin(course - another)) > math.sin(CROSSING)
