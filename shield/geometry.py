"""Lane frames and oriented boxes (Section 3.2 of the paper, metric lateral coordinates).

A road is made of pieces of constant curvature, `[K, 11]` float64, one row per piece: start x, start y,
start heading, curvature (positive turns right), length, arc length at the start, cosine and sine of the
start heading, the rows before and after it, and the way round. y points to the right of the driving
direction.

Most roads are chains. Where a road forks several rows have the same one before them, where roads merge
several have the same one after them. At a `FREE` end the road goes on straight; at a `CUT` one it goes on
in a way that is too far off to matter. Where a road closes on itself each piece lies ahead as well as
behind: its arc length is the one ahead, and less by the way round (inf where there is none) behind.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, rare

PIECE_FIELDS = 11
X, Y, HEADING, CURVATURE, LENGTH, ARC_START, COS, SIN, BEFORE, AFTER, AROUND = range(PIECE_FIELDS)
FREE, CUT = -1, -2  # what ends of a road have instead of a row before or after them
_STRAIGHT = 1e-9  # curvature below which a piece is straight [1/m]


def make_road(pieces) -> np.ndarray:
    """A chain `[K, 11]` from the first six columns of its pieces, with free ends."""
    rows = np.asarray(pieces, dtype=float).reshape(-1, COS)
    order = np.arange(float(len(rows)))
    before = np.where(order > 0, order - 1, FREE)
    after = np.where(order < len(rows) - 1, order + 1, FREE)
    around = np.full(len(rows), np.inf)
    return np.column_stack([rows, np.cos(rows[:, HEADING]), np.sin(rows[:, HEADING]), before, after, around])


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
      road: `[K, 11]` pieces.
      x, y: position [m].

    Returns:
      (s, y, heading, curvature): arc length and signed lateral offset [m], heading of the lane
      [rad] and its curvature [1/m] there.
    """
    s, lateral, k, heading = nearest_piece(road, x, y)
    along = s - road[k, ARC_START]
    beyond = (along < 0.0 and road[k, BEFORE] == FREE) or (along > road[k, LENGTH] and road[k, AFTER] == FREE)
    return s, lateral, heading, 0.0 if beyond else road[k, CURVATURE]


@compiled
def is_straight(road):
    """Is a road `[K, 11]` one straight piece?"""
    return len(road) == 1 and abs(road[0, CURVATURE]) < _STRAIGHT


@compiled
def nearest_piece(road, x, y):
    """As `locate`, but with the row of the piece."""
    if is_straight(road):
        s, lateral, heading = _on_piece(road[0], x, y)
        return road[0, ARC_START] + s, lateral, 0, heading
    return _search(road, x, y)


@rare
def _search(road, x, y):
    """`nearest_piece` on any road. Motorways are straight; where roads wind, a call costs little beside the rest."""
    best = np.inf
    s_best, y_best, heading_best, k_best = 0.0, 0.0, 0.0, 0
    for k in range(len(road)):
        s, lateral, heading, outside = _beside(road[k], x, y)
        distance = abs(lateral) + outside
        if distance < best:
            best = distance
            s_best, y_best, heading_best, k_best = road[k, ARC_START] + s, lateral, heading, k
    return s_best, y_best, k_best, heading_best


@inner
def _beside(piece, x, y):
    """`_on_piece`, straight on beyond a free end, and how far beyond any other end the point is [m]."""
    s, lateral, heading = _on_piece(piece, x, y)
    before, after = s < 0.0, s > piece[LENGTH]
    if (before and piece[BEFORE] == FREE) or (after and piece[AFTER] == FREE):
        if abs(piece[CURVATURE]) >= _STRAIGHT:
            s, lateral, heading = _on_tangent(piece, x, y, after)
        return s, lateral, heading, 0.0
    return s, lateral, heading, -s if before else (s - piece[LENGTH] if after else 0.0)


@rare
def follow(road, k, x, y):
    """Lateral offset [m] and heading of the lane [rad] at a point a moment's drive from the piece `k`.

    Where other pieces are nearer to the point those do not count: the point is on the same way as the piece.
    """
    s, lateral, heading, outside = _beside(road[k], x, y)
    forward = s > 0.0
    for _ in range(len(road)):
        if outside == 0.0 or (s > 0.0) != forward:
            break
        following = _next_row(road, k, x, y, forward)
        if following < 0:
            break
        k = following
        s, lateral, heading, outside = _beside(road[k], x, y)
    return lateral, heading


@inner
def _next_row(road, k, x, y, forward):
    """The piece after (or before) piece `k` that is nearest to a point; -1 if there is none."""
    there, back = (AFTER, BEFORE) if forward else (BEFORE, AFTER)
    best, nearest = np.inf, -1
    for i in range(len(road)):
        if i == road[k, there] or road[i, back] == k:
            _, lateral, _, outside = _beside(road[i], x, y)
            if abs(lateral) + outside < best:
                best, nearest = abs(lateral) + outside, i
    return nearest


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


_MOST_TURNED = 0.9  # sine of the angle by which a bend may turn a car against its lane


def box_of(
    length: float, width: float, heading_bound: float, curvature: float, driven: bool = True
) -> tuple[float, float, float, float]:
    """Length and width, and the largest half extents that its driver may use along and across the lane [m].

    In a tight bend a car that keeps to its lane is at a larger angle to it than the bound.

    Args:
      heading_bound: as in `largest_half_extents`.
      curvature: of the tightest bend of the road, >= 0 [1/m].
      driven: obstacles have no driver, who would promise anything.
    """
    bound = max(heading_bound, min(curvature * length / 2, _MOST_TURNED)) if driven else 1.0
    return length, width, *largest_half_extents(length, width, bound)


@compiled
def signed_gap(distance, half_1, half_2):
    """Bumper-to-bumper gap along one axis [m]; negative where the boxes overlap on it."""
    return np.abs(distance) - half_1 - half_2
