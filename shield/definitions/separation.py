"""When what two road users in open space may occupy is apart.

How far the sum of sectors that `occupancy` describes extends in a direction is the sum of how far its parts do: no
polygon is ever built. Between two instants it extends no farther than linearly in time, but for what a braking car is
ahead of that. Two sets are apart during a step if there is a direction in which they are, at its start and at its end.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, larger, smaller
from rss_shield.shield.definitions.occupancy import (
    ANEW,
    COS_LEFT,
    COS_RIGHT,
    HI,
    LEFT,
    LO,
    RIGHT,
    SIN_LEFT,
    SIN_RIGHT,
    WIDER,
)


class _Side(NamedTuple):
    """A direction as one road user sees it: angles relative to its heading [rad], in [-pi, pi)."""

    angle: float  # of the direction
    back: float  # of the opposite one
    # to which it would have to turn for a corner to point there
    front_corners: tuple[float, float]
    rear_corners: tuple[float, float]
    cos: float  # of the angle
    sin: float


@inner
def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@inner
def _opposite(angle):
    return angle - np.pi if angle >= 0.0 else angle + np.pi


@inner
def _side(occupancy, nx, ny):
    x, y = occupancy.bounds.cos, occupancy.bounds.sin
    cos, sin = nx * x + ny * y, ny * x - nx * y
    angle = np.arctan2(sin, cos)
    front, rear = _both_sides(angle, occupancy.bounds.front_corner), _both_sides(angle, occupancy.bounds.rear_corner)
    return _Side(angle, _opposite(angle), front, rear, cos, sin)


@inner
def _both_sides(angle, corner):
    """`angle` less and plus `corner`, which is in [0, pi]."""
    right, left = angle - corner, angle + corner
    return right + 2 * np.pi if right < -np.pi else right, left - 2 * np.pi if left >= np.pi else left


@inner
def _may_point(row, angle):
    return -row[LEFT] <= angle <= row[RIGHT]


@inner
def _largest_cos(row, side):
    """Largest cosine of the angle between a direction and the headings of a step."""
    if _may_point(row, side.angle):
        return 1.0
    at_right = side.cos * row[COS_RIGHT] + side.sin * row[SIN_RIGHT]
    at_left = side.cos * row[COS_LEFT] - side.sin * row[SIN_LEFT]
    return larger(at_right, at_left)


@inner
def _smallest_cos(row, side):
    if _may_point(row, side.back):
        return -1.0
    at_right = side.cos * row[COS_RIGHT] + side.sin * row[SIN_RIGHT]
    at_left = side.cos * row[COS_LEFT] - side.sin * row[SIN_LEFT]
    return smaller(at_right, at_left)


@inner
def _advance(row, side, cos):
    """How much farther a position may extend in a direction after one step [m]; `cos` as of `_largest_cos`."""
    if row[LO] < 0.0:
        return larger(row[HI] * cos, row[LO] * _smallest_cos(row, side))
    return row[HI] * cos if cos > 0.0 else row[LO] * cos


@inner
def _half_box(row, side, occupancy):
    """How far a box extends from x, y in a direction, at any heading of a step [m]."""
    bounds, mover = occupancy.bounds, occupancy.mover
    if bounds.turns_around:
        return bounds.diagonal + row[WIDER]
    cos, sin = side.cos, side.sin
    c_right, s_right, c_left, s_left = row[COS_RIGHT], row[SIN_RIGHT], row[COS_LEFT], row[SIN_LEFT]
    at_right = _box_at(cos * c_right + sin * s_right, sin * c_right - cos * s_right, mover)
    at_left = _box_at(cos * c_left - sin * s_left, sin * c_left + cos * s_left, mover)
    most = larger(at_right, at_left)
    if _may_point(row, side.front_corners[0]) or _may_point(row, side.front_corners[1]):
        most = larger(most, bounds.front)
    if _may_point(row, side.rear_corners[0]) or _may_point(row, side.rear_corners[1]):
        most = larger(most, bounds.rear)
    return most + row[WIDER]


@inner
def _box_at(cos, sin, mover):
    """How far a box extends in a direction that is at an angle, of this cosine and sine, to its heading [m]."""
    return mover.offset * cos + mover.half_length * np.abs(cos) + mover.half_width * np.abs(sin)


@inner
def _or_anew(extent, row, cos, occupancy):
    """An extent, or that of one that stopped and set out anew in any direction."""
    if not occupancy.bounds.turns_around:
        return extent
    return larger(extent, occupancy.bounds.detour * larger(cos, 0.0) + row[ANEW])


@compiled
def extent(occupancy, rows, k, nx, ny):
    """How far an occupancy extends in a direction during step `k` [m], at its start and at its end, from the centre.

    In between it extends no farther than linearly from one to the other, plus `slack`.

    Args:
      rows: `occupancy.braking` or `occupancy.going_on`.
      nx, ny: the direction, a unit vector.
    """
    side = _side(occupancy, nx, ny)
    before = 0.0
    for j in range(k):
        before += _advance(rows[j], side, _largest_cos(rows[j], side))
    cos = _largest_cos(rows[k], side)
    after = before + _advance(rows[k], side, cos)
    box = _half_box(rows[k], side, occupancy)
    return _or_anew(before, rows[k], cos, occupancy) + box, _or_anew(after, rows[k], cos, occupancy) + box


@inner
def _steps_apart(one, rows_1, two, rows_2, nx, ny, steps, eps):
    """Bits of the steps in which two occupancies are more than `eps` apart in one direction, the second ahead."""
    first, second = one.mover, two.mover
    side_1, side_2 = _side(one, nx, ny), _side(two, -nx, -ny)
    distance = (second.x - first.x) * nx + (second.y - first.y) * ny - one.bounds.slack - two.bounds.slack - eps
    reached_1, reached_2 = 0.0, 0.0
    apart = np.int64(0)
    for k in range(steps):
        row_1, row_2 = rows_1[k], rows_2[k]
        cos_1, cos_2 = _largest_cos(row_1, side_1), _largest_cos(row_2, side_2)
        before = _or_anew(reached_1, row_1, cos_1, one) + _or_anew(reached_2, row_2, cos_2, two)
        reached_1 += _advance(row_1, side_1, cos_1)
        reached_2 += _advance(row_2, side_2, cos_2)
        after = _or_anew(reached_1, row_1, cos_1, one) + _or_anew(reached_2, row_2, cos_2, two)
        needed = larger(before, after) + _half_box(row_1, side_1, one) + _half_box(row_2, side_2, two)
        if needed < distance:
            apart |= np.int64(1) << np.int64(k)
    return apart


@inner
def _between_centres(one, two):
    """From the centre of one box to that of the other at the start [m]."""
    first, second = one.mover, two.mover
    dx = second.x + second.offset * two.bounds.cos - first.x - first.offset * one.bounds.cos
    return dx, second.y + second.offset * two.bounds.sin - first.y - first.offset * one.bounds.sin


@inner
def all_of(steps):
    return (np.int64(1) << np.int64(steps)) - np.int64(1)


@compiled
def steps_apart(one, rows_1, two, rows_2, steps, eps):
    """Bits of the steps, of the first `steps`, during which two occupancies are surely more than `eps` apart.

    Looks in the direction from one to the other, along and across both headings and halfway between, both ways: what
    it looks in is the same for both road users.
    """
    first, second = one.mover, two.mover
    dx, dy = _between_centres(one, two)
    centres = np.arctan2(dy, dx)
    found, wanted = np.int64(0), all_of(steps)
    for backwards in range(2):
        for j in range(12):
            start = centres if j < 4 else (first.heading if j < 8 else second.heading)
            angle = start + 0.25 * np.pi * (j % 4)
            nx, ny = np.cos(angle), np.sin(angle)
            along = dx * nx + dy * ny
            if backwards and np.abs(along) > one.bounds.least + two.bounds.least:
                continue  # nobody is sure to get past the other in this direction
            if (along < 0.0) != (backwards == 1):
                nx, ny = -nx, -ny
            found |= _steps_apart(one, rows_1, two, rows_2, nx, ny, steps, eps)
            if found == wanted:
                return found
    return found


@compiled
def drives_away(braker, goer, theta):
    """Does a road user that goes on drive away from one that brakes, whenever that comes to rest? Def. 20 (ii) on sets.

    Looks at the box, upright on the line between both at the start, that holds all differences of their positions.
    """
    first, second, steps = braker.mover, goer.mover, braker.bounds.steps
    dx, dy = second.x - first.x, second.y - first.y
    start = np.hypot(dx, dy)
    if start <= 0.0 or steps > len(goer.going_on) or goer.bounds.turns_around:
        return False
    nx, ny = dx / start, dy / start
    heading = wrapped(second.heading - np.arctan2(ny, nx))
    ahead, behind = _sides(braker, goer, nx, ny), _sides(braker, goer, -nx, -ny)
    right, left = _sides(braker, goer, -ny, nx), _sides(braker, goer, ny, -nx)
    near, far, low, high = start, start, 0.0, 0.0
    slack = braker.bounds.slack + goer.bounds.slack
    for k in range(steps):
        row_1, row_2 = braker.braking[k], goer.going_on[k]
        near_next, far_next = near - _closing(row_1, row_2, ahead), far + _closing(row_1, row_2, behind)
        low_next, high_next = low - _closing(row_1, row_2, right), high + _closing(row_1, row_2, left)
        if k >= braker.bounds.first_stop:
            more = slack + (braker.bounds.detour + row_1[ANEW] if braker.bounds.turns_around else 0.0)
            nearest, farthest = smaller(near, near_next) - more, larger(far, far_next) + more
            lowest, highest = smaller(low, low_next) - more, larger(high, high_next) + more
            if nearest <= 0.0:
                return False
            leftmost = np.arctan2(lowest, nearest if lowest < 0.0 else farthest)
            rightmost = np.arctan2(highest, nearest if highest > 0.0 else farthest)
            if larger(heading + row_2[RIGHT] - leftmost, rightmost - heading + row_2[LEFT]) > theta:
                return False
        near, far, low, high = near_next, far_next, low_next, high_next
    return True


@inner
def _sides(one, two, nx, ny):
    """A direction as one road user sees it, and the opposite one as another does."""
    return _side(one, nx, ny), _side(two, -nx, -ny)


@inner
def _closing(row_1, row_2, sides):
    """How much closer two positions may come in a direction in one step [m]."""
    closing = _advance(row_1, sides[0], _largest_cos(row_1, sides[0]))
    return closing + _advance(row_2, sides[1], _largest_cos(row_2, sides[1]))
