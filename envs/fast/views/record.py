"""An observation as numbers."""

from typing import Any, NamedTuple

import numpy as np

KINEMATICS, TIME_TO_COLLISION, GRID, LIDAR, NONE = range(5)
PRESENCE, X, Y, VX, VY, HEADING, COS_H, SIN_H, COS_D, SIN_D, LONG_OFF, LAT_OFF, ANG_OFF, ON_ROAD = range(14)
FEATURES = (
    *("presence", "x", "y", "vx", "vy", "heading", "cos_h", "sin_h"),
    *("cos_d", "sin_d", "long_off", "lat_off", "ang_off"),
)
OF_VEHICLES = ("heading", "long_off", "lat_off", "ang_off")  # an obstacle has none

VIEW = np.dtype(
    [
        ("kind", "i8"),
        ("clips", "?"),
        ("normalize", "?"),
        # Kinematics
        ("rows", "i8"),  # observed vehicles, the ego included
        ("absolute", "?"),
        ("see_behind", "?"),
        ("obstacles", "?"),
        ("shuffled", "?"),
        ("intentions", "?"),  # of others: where they are bound for
        ("exit_lane", "i8"),  # the ego's x counts along it, -1 = along the world
        # TimeToCollision
        ("speeds", "i8"),  # size of the grid
        ("lanes", "i8"),
        ("times", "i8"),
        # OccupancyGrid
        ("low_x", "f8"),  # [m]
        ("low_y", "f8"),
        ("step_x", "f8"),
        ("step_y", "f8"),
        ("cells_x", "i8"),
        ("cells_y", "i8"),
        ("aligned", "?"),  # with the ego
        ("as_image", "?"),
        ("x_low", "f8"),  # range that x was mapped from, nan = none
        ("x_high", "f8"),
        ("y_low", "f8"),
        ("y_high", "f8"),
        # LidarObservation
        ("cells", "i8"),
        ("reach", "f8"),  # [m]
        ("angle", "f8"),  # of a cell [rad]
    ],
    align=True,
)


class View(NamedTuple):
    """An observation ready to be made by compiled code."""

    record: np.ndarray  # `[1]` VIEW
    features: np.ndarray  # `[F]` observed features
    ranges: np.ndarray  # `[F, 2]` their ranges, nan = not scaled, -inf..inf = by the number of lanes
    meets: np.ndarray  # `[Q, R, R]` may a car on one road meet one on another, by what is left of its route
    left: np.ndarray  # `[P, S]` which of the Q, by route and step


def empty_view(kind: int) -> View:
    """A view of some kind with nothing else entered."""
    record = np.zeros(1, VIEW)
    record["kind"], record["exit_lane"] = kind, -1
    for name in ("x_low", "x_high", "y_low", "y_high"):
        record[name] = np.nan
    return View(record, np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((1, 0, 0), bool), np.zeros((0, 0), np.int64))


def ranges_of(names: Any, asked: Any, defaults: dict[str, float]) -> np.ndarray:
    """Ranges of features, `[F, 2]`: those asked for, or else the defaults, -x..x; nan where there is none."""
    ranges = np.full((len(names), 2), np.nan)
    for k, name in enumerate(names):
        if asked and name in asked:
            ranges[k] = asked[name]
        elif not asked and name in defaults:
            ranges[k] = -defaults[name], defaults[name]
    return ranges
