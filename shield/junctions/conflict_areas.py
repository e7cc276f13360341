"""Conflict areas of paths: where on one path a car is in the way of a car on another (Defs. 14, 16, 17).

A path is a chain of lanes that a driver may follow through a junction. It is cut into cells of `CELL`
metres of arc length; each cell has a box that holds every car whose centre is in it, whatever its speed
(the swept width). Two cells are in conflict iff their boxes overlap. Seen from a cell of one path, the
conflicting stretch of another path is at most two intervals of arc length: a ring road may be met twice.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, compiled_for_arrays, inner

CELL = 0.5  # length of a cell [m]
X, Y, COS, SIN, HALF_LENGTH, HALF_WIDTH = range(6)  # columns of a box
FAR = 1 << 30
_NOTHING = np.inf


class Paths(NamedTuple):
    """All paths of a road network. P paths of at most C cells, L lanes.

    Others come in several sizes, and a path that a car of another size takes is one of its own: Q of them, those of
    the ego's size first. Row k P + p is path p of the ego as cars of the k-th size drive it.
    """

    boxes: np.ndarray  # `[P, C, 6]` what the ego sweeps in each cell
    cells: np.ndarray  # `[Q]` cells of each path
    lane: np.ndarray  # `[Q, C]` lane that a car in the cell follows
    reached: np.ndarray  # `[Q, C]` int32: cell in which a path reaches the lane of a cell
    offset: np.ndarray  # `[Q, L]` arc length at which a lane begins on a path, nan = not part of it [m]
    conflicts: np.ndarray  # `[P, Q, C, 4]` float32: from, to, from, to on the second path [m]; inf, -inf = none
    first: np.ndarray  # `[P, Q, C]` float32: where the second path first conflicts with the first from a cell on [m]
    priority: np.ndarray  # `[P, Q]` +1: the first has the right of way over the second, -1: the other way round
    crossed: np.ndarray  # `[Q, C]` an ego standing there is in the way of a path that it is not on
    speed_limit: np.ndarray  # `[P, C]` [m/s], inf = none
    swept: np.ndarray  # `[Q, C, 6]` what others sweep in each cell
    line: np.ndarray  # `[Q, C]` int32: first cell from each on that is `crossed`; C = none
    joins: np.ndarray  # `[P, Q, C]` int32: next cell of the first path on a lane of the second; `FAR` = none


@compiled
def cell_of(s, cells):
    """Index of the cell at arc length `s`; the first and the last one reach to infinity."""
    return min(max(int(np.floor(s / CELL)), 0), cells - 1)


@compiled
def boxes_overlap(a, b, margin):
    """Do two oriented boxes come nearer to each other than `margin` [m] (separating axes)?"""
    dx, dy = b[X] - a[X], b[Y] - a[Y]
    cos, sin = abs(a[COS] * b[COS] + a[SIN] * b[SIN]), abs(a[COS] * b[SIN] - a[SIN] * b[COS])
    return not (
        abs(dx * a[COS] + dy * a[SIN]) > a[HALF_LENGTH] + margin + b[HALF_LENGTH] * cos + b[HALF_WIDTH] * sin
        or abs(dy * a[COS] - dx * a[SIN]) > a[HALF_WIDTH] + margin + b[HALF_LENGTH] * sin + b[HALF_WIDTH] * cos
        or abs(dx * b[COS] + dy * b[SIN]) > b[HALF_LENGTH] + margin + a[HALF_LENGTH] * cos + a[HALF_WIDTH] * sin
        or abs(dy * b[COS] - dx * b[SIN]) > b[HALF_WIDTH] + margin + a[HALF_LENGTH] * sin + a[HALF_WIDTH] * cos
    )


@compiled
def reach_beyond(box, x, y, heading, half_length, half_width):
    """How far a car reaches beyond a box: along and across it, negative = not at all [m]."""
    along, across, half_along, half_across = _seen_from(box, x, y, heading, half_length, half_width)
    return along + half_along - box[HALF_LENGTH], across + half_across - box[HALF_WIDTH]


@compiled
def reaches_into(box, x, y, heading, half_length, half_width):
    """Does the smallest rectangle around a car that is aligned with a box overlap it?"""
    along, across, half_along, half_across = _seen_from(box, x, y, heading, half_length, half_width)
    return along - half_along < box[HALF_LENGTH] and across - half_across < box[HALF_WIDTH]


@compiled
def _seen_from(box, x, y, heading, half_length, half_width):
    """Distance of a car's centre from that of a box, along and across it, and the car's half extents likewise [m]."""
    dx, dy, cos, sin = x - box[X], y - box[Y], np.cos(heading), np.sin(heading)
    turn_cos, turn_sin = abs(cos * box[COS] + sin * box[SIN]), abs(sin * box[COS] - cos * box[SIN])
    half_along = half_length * turn_cos + half_width * turn_sin
    half_across = half_length * turn_sin + half_width * turn_cos
    return abs(dx * box[COS] + dy * box[SIN]), abs(dy * box[COS] - dx * box[SIN]), half_along, half_across


@compiled_for_arrays
def swept_boxes(poses, half_length, half_width, margin_lon, margin_lat, out):
    """Smallest box around all cars of a cell, for each cell of one path.

    Args:
      poses: `[C, V, 3]` x, y [m] and heading [rad] of tracked cars in each cell, nan = no such car.
      half_length, half_width: of a car [m].
      margin_lon, margin_lat: added on every side [m].
      out: `[C, 6]` boxes, overwritten.
    """
    for c in range(len(poses)):
        cos = sin = 0.0
        for v in range(poses.shape[1]):
            if not np.isnan(poses[c, v, 0]):
                cos += np.cos(poses[c, v, 2])
                sin += np.sin(poses[c, v, 2])
        norm = np.hypot(cos, sin)
        cos, sin = cos / norm, sin / norm
        low_a = low_b = np.inf
        high_a = high_b = -np.inf
        for v in range(poses.shape[1]):
            if np.isnan(poses[c, v, 0]):
                continue
            a = poses[c, v, 0] * cos + poses[c, v, 1] * sin
            b = poses[c, v, 1] * cos - poses[c, v, 0] * sin
            turn_cos = abs(np.cos(poses[c, v, 2]) * cos + np.sin(poses[c, v, 2]) * sin)
            turn_sin = abs(np.sin(poses[c, v, 2]) * cos - np.cos(poses[c, v, 2]) * sin)
            along = half_length * turn_cos + half_width * turn_sin
            across = half_length * turn_sin + half_width * turn_cos
            low_a, high_a = min(low_a, a - along), max(high_a, a + along)
            low_b, high_b = min(low_b, b - across), max(high_b, b + across)
        a, b = 0.5 * (low_a + high_a), 0.5 * (low_b + high_b)
        out[c, X], out[c, Y] = a * cos - b * sin, a * sin + b * cos
        out[c, COS], out[c, SIN] = cos, sin
        out[c, HALF_LENGTH] = 0.5 * (high_a - low_a) + margin_lon
        out[c, HALF_WIDTH] = 0.5 * (high_b - low_b) + margin_lat


@compiled_for_arrays
def find_conflicts(boxes, others, cells, conflicts, first):
    """Fill in `Paths.conflicts` and `Paths.first`.

    Args:
      boxes: `[P, C, 6]` swept by the ego on each path, others: likewise by cars of one size.
      cells: `[P]` cells of each path.
      conflicts: `[P, P, C, 4]`, first: `[P, P, C]`, overwritten.
    """
    paths = len(cells)
    for a in range(paths):
        for b in range(paths):
            nearest = _NOTHING
            for i in range(cells[a] - 1, -1, -1):
                interval = conflicts[a, b, i]
                interval[0] = interval[2] = _NOTHING
                interval[1] = interval[3] = -_NOTHING
                _conflicts_of_cell(boxes[a, i], others[b], cells[b], interval)
                nearest = min(nearest, interval[0])
                first[a, b, i] = nearest


@inner
def _conflicts_of_cell(box, others, count, interval):
    reach = np.hypot(box[HALF_LENGTH], box[HALF_WIDTH])
    k, inside = 0, False
    while k < count:
        other = others[k]
        far = np.hypot(other[X] - box[X], other[Y] - box[Y]) - reach - np.hypot(other[HALF_LENGTH], other[HALF_WIDTH])
        if far > 0.0:
            # neighbouring cells lie at most two cells apart, so the next few cannot touch either
            inside = False
            k += max(int((far - 1.0) / (2 * CELL)), 1)
            continue
        touches = boxes_overlap(box, other, 0.0)
        if touches:
            start, end = k * CELL, (k + 1) * CELL
            if interval[0] == _NOTHING:
                interval[0], interval[1] = start, end
            elif interval[2] == _NOTHING and (inside or start - interval[1] < 4 * CELL):
                interval[1] = end
            elif interval[2] == _NOTHING:
                interval[2], interval[3] = start, end
            else:
                interval[3] = end
        inside = touches
        k += 1


@compiled
def in_conflict(paths, a, i, b, low, high):
    """Is a car in cell `i` of path `a` in the way of one that is somewhere in [low, high] on path `b` [m]?"""
    interval = paths.conflicts[a, b, i]
    return (interval[0] <= high and low <= interval[1]) or (interval[2] <= high and low <= interval[3])
