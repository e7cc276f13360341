"""Lane frames and oriented boxes (Section 3.2 of the paper, metric lateral coordinates).

A road is a chain of pieces of constant curvature, `[K, 6]` float64, one row per piece:
start x, start y, start heading, curvature (positive turns right), length, arc length at the start.
y points to the right of the driving direction.
"""

import numpy as np

from shield.compiled import compiled

PIECE_FIELDS = 6
X, Y, HEADING, CURVATURE, LENGTH, ARC_START = range(PIECE_FIELDS)
_STRAIGHT = 1e-9  # curvature below which a piece is straight [1/m]


@compiled
def wrap_angle(angle):
    """The same angle in [-pi, pi) [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@compiled
def _on_piece(piece, x, y):
    """Arc length from the start of a piece, signed lateral offset [m] and heading of the lane there [rad]."""
    dx, dy = x - piece[X], y - piece[Y]
    cos, sin = np.cos(piece[HEADING]), np.sin(piece[HEADING])
    along, across = dx * cos + dy * sin, -dx * sin + dy * cos
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
      road: `[K, 6]` pieces.
      x, y: position [m].

    Returns:
      (s, y, heading, curvature): arc length and signed lateral offset [m], heading of the lane
      [rad] and its curvature [1/m] there.
    """
    best = np.inf
    s_best, y_best, heading_best, kappa_best = 0.0, 0.0, 0.0, 0.0
    last = len(road) - 1
    for k in range(last + 1):
        piece = road[k]
        s, lateral, heading = _on_piece(piece, x, y)
        kappa = piece[CURVATURE]
        before, after = s < 0.0, s > piece[LENGTH]
        outside = -s if before else (s - piece[LENGTH] if after else 0.0)
        if abs(kappa) >= _STRAIGHT and ((before and k == 0) or (after and k == last)):
            s, lateral, heading = _on_tangent(piece, x, y, after)
            kappa = 0.0
        free_end = (before and k == 0) or (after and k == last)
        distance = abs(lateral) + (0.0 if free_end else outside)
        if distance < best:
            best = distance
            s_best, y_best, heading_best, kappa_best = piece[ARC_START] + s, lateral, heading, kappa
    return s_best, y_best, heading_best, kappa_best


@compiled
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
    cos, sin = np.abs(np.cos(heading)), np.abs(np.sin(heading))
    return 0.5 * (length * cos + width * sin), 0.5 * (length * sin + width * cos)


@compiled
def extents_within(length, width, heading, heading_bound):
    """Half extents [m] that hold for every angle to the lane within the bound, and for `heading` beyond it.

    Args:
      heading_bound: sine of the largest angle a driver may have to the lane; 1 = no bound, the
        extents are those of the moment.
    """
    along, across = half_extents(length, width, heading)
    if heading_bound >= 1.0:
        return along, across
    # a box is longest along its diagonal, and widest too
    bound, diagonal = np.arcsin(heading_bound), np.arctan2(width, length)
    along_bound, _ = half_extents(length, width, np.minimum(bound, diagonal))
    _, across_bound = half_extents(length, width, np.minimum(bound, 0.5 * np.pi - diagonal))
    return np.maximum(along, along_bound), np.maximum(across, across_bound)


@compiled
def signed_gap(distance, half_1, half_2):
    """Bumper-to-bumper gap along one axis [m]; negative where the boxes overlap on it."""
    return np.abs(distance) - half_1 - half_2
