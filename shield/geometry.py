"""Lane frames and oriented boxes (Section 3.2 of the paper, metric lateral coordinates).

A road is a chain of pieces of constant curvature, `[K, 8]` float64, one row per piece:
start x, start y, start heading, curvature (positive turns right), length, arc length at the start,
cosine and sine of the start heading. y points to the right of the driving direction.
"""

import numpy as np

from shield.compiled import compiled, inner, rare

PIECE_FIELDS = 8
X, Y, HEADING, CURVATURE, LENGTH, ARC_START, COS, SIN = range(PIECE_FIELDS)
_STRAIGHT = 1e-9  # curvature below which a piece is straight [1/m]


def make_road(pieces) -> np.ndarray:
    """A road `[K, 8]` from the first six columns of its pieces."""
    rows = np.asarray(pieces, dtype=float).reshape(-1, COS)
    return np.column_stack([rows, np.cos(rows[:, HEADING]), np.sin(rows[:, HEADING])])


@compiled
def wrap_angle(angle):
    """The same angle in [-pi, pi) [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@inner
def _on_piece(piece, x, y):
    """Arc length from the start of a piece, signed lateral offset [m] and heading of the lane there [rad]."""
    dx, dy = x - piece[X], y - piece[Y]
    along, across = dx * piece[COS] + dy * piece[SIN], -dx * piece[SIN] + dy * piece[COS]
    kappa = piece[CURVATURE]
    if abs(kappa) < _STRAIGHT:
        return along, across, piece[HEADING]
    # the centre of the circle lies 1/kappa to the right of the start
    angle = np.arctan2(along * np.sign(kappa), (1.0 / kappa - across) * np.sign(kappa))
    middle = 0.5 * kappa * piece[LENGTH]  # half a circle either way from there
    angle = middle + wrap_angle(angle - middle)
    radius = np.hypot(along, 1.0 / kappa - across)
    return angle / kappa, (1.0 / abs(kappa) - radius) * np.sign(kappa), piece[HEADING] + angle


@compiled
def locate(road, x, y):
    """Lane coordinates of a point.

    The piece whose lane is nearest counts; beyond both ends of the chain the road goes on straight.

    Args:
      road: `[K, 8]` pieces.
      x, y: position [m].

    Returns:
      (s, y, heading, curvature): arc length and signed lateral offset [m], heading of the lane
      [rad] and its curvature [1/m] there.
    """
    s, lateral, k, heading = nearest_piece(road, x, y)
    return s, lateral, heading, road[k, CURVATURE] if k >= 0 else 0.0


@compiled
def is_straight(road):
    """Is a road `[K, 8]` one straight piece?"""
    return len(road) == 1 and abs(road[0, CURVATURE]) < _STRAIGHT


@compiled
def nearest_piece(road, x, y):
    """As `locate`, but with the index of the piece; -1 on the tangent beyond a curved end."""
    if is_straight(road):
        s, lateral, heading = _on_piece(road[0], x, y)
        return road[0, ARC_START] + s, lateral, 0, heading
    return _search(road, x, y)


@rare
def _search(road, x, y):
    """`nearest_piece` on any road. Motorways are straight; where roads wind, a call costs little beside the rest."""
    best = np.inf
    s_best, y_best, heading_best, k_best = 0.0, 0.0, 0.0, -1
    last = len(road) - 1
    for k in range(last + 1):
        piece, nearest = road[k], k
        s, lateral, heading = _on_piece(piece, x, y)
        before, after = s < 0.0, s > piece[LENGTH]
        outside = -s if before else (s - piece[LENGTH] if after else 0.0)
        free_end = (before and k == 0) or (after and k == last)
        if free_end and abs(piece[CURVATURE]) >= _STRAIGHT:
            s, lateral, heading = _on_tangent(piece, x, y, after)
            nearest = -1
        distance = abs(lateral) + (0.0 if free_end else outside)
        if distance < best:
            best = distance
            s_best, y_best, heading_best, k_best = piece[ARC_START] + s, lateral, heading, nearest
    return s_best, y_best, k_best, heading_best


@inner
def _on_tangent(piece, x, y, at_end):
    """Coordinates on the straight continuation of a curved piece."""
    length = piece[LENGTH] if at_end else 0.0
    kappa, heading = piece[CURVATURE], piece[HEADING]
    end_heading = heading + kappa * length
    x0 = piece[X] + (np.sin(end_heading) - np.sin(heading)) / kappa
    y0 = piece[Y] - (np.cos(end_heading) - np.cos(heading)) / kappa
    dx, dy = x - x0, y - y0
    cos, sin = np.cos(end_heading), np.sin(end_heading)
    return length + dx * cos + dy * sin, -dx * sin + dy * cos, end_heading


@compiled
def half_extents(length, width, heading):
    """Half extents (along, across) of an oriented box in a lane frame [m].

    Args:
      length, width: of the box [m].
      heading: relative to the lane [rad].
    """
    return turned_half_extents(length, width, np.cos(heading), np.sin(heading))


@compiled
def turned_half_extents(length, width, cos, sin):
    """`half_extents` by the cosine and sine of the heading."""
    cos, sin = np.abs(cos), np.abs(sin)
    return 0.5 * (length * cos + width * sin), 0.5 * (length * sin + width * cos)


@compiled
def largest_half_extents(length, width, heading_bound):
    """Largest half extents [m] of a box at any angle to the lane within a bound.

    Args:
      heading_bound: sine of the largest angle a driver may have to the lane; 1 = no bound, then
        nothing is promised and both are 0.
    """
    if heading_bound >= 1.0:
        return 0.0, 0.0
    # a box is longest along its diagonal, and widest too
    bound, diagonal = np.arcsin(heading_bound), np.arctan2(width, length)
    along, _ = half_extents(length, width, np.minimum(bound, diagonal))
    _, across = half_extents(length, width, np.minimum(bound, 0.5 * np.pi - diagonal))
    return along, across


@compiled
def signed_gap(distance, half_1, half_2):
    """Bumper-to-bumper gap along one axis [m]; negative where the boxes overlap on it."""
    return np.abs(distance) - half_1 - half_2
