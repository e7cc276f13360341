"""Crashes: boxes that overlap now, or will within the next frame at constant velocity."""

import numpy as np

from rss_shield.envs._numpy.floats import dot, norm
from rss_shield.envs.fast.state import OBSTACLE
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH
from rss_shield.shield._numba.compiled import inner, part

_LARGEST = np.hypot(CAR_LENGTH, CAR_WIDTH)  # diagonal of a road user [m]


@inner
def collide(cars, episode, order, sight, dt):
    """Find all collisions of this frame, in the order of (first, second) index, and mark the cars.

    Args:
      cars: `[N]` CAR.
      episode: EPISODE.
      order: `[N]` indices sorted by x.
      sight: working memory.
      dt: length of a frame [s].
    """
    n = episode.cars
    fastest, all_check = 0.0, True
    for i in range(n):
        fastest = max(fastest, cars[i].speed)
        all_check &= cars[i].checks
    reach = _LARGEST + fastest * dt + 1e-6
    found = 0
    for a in range(n):
        i = order[a]
        if not cars[i].checks:
            continue
        for b in range(a + 1, n):
            j = order[b]
            if cars[j].x - cars[i].x > reach:
                break
            found = _note_pair(cars, i, j, n, episode.vehicles, found, reach, sight.pairs, dt)
        if all_check:
            continue
        for b in range(a - 1, -1, -1):
            j = order[b]
            if cars[i].x - cars[j].x > reach:
                break
            if not cars[j].checks:
                found = _note_pair(cars, i, j, n, episode.vehicles, found, reach, sight.pairs, dt)
    for m in range(found):
        _collide_pair(cars, sight.pairs[m] // n, sight.pairs[m] % n, sight.corners, dt)


@inner
def _note_pair(cars, i, j, n, vehicles, found, reach, pairs, dt):
    """Add a pair to the `found` ones if the two are near each other; returns how many there are then."""
    if abs(cars[j].y - cars[i].y) > reach:
        return found
    first, second = min(i, j), max(i, j)
    if first < vehicles and is_near(cars[first], cars[second], dt):
        _insert(pairs, found, first * n + second)
        return found + 1
    return found


@inner
def _insert(values, count, value):
    """Add a value to `count` sorted ones."""
    while count > 0 and values[count - 1] > value:
        values[count] = values[count - 1]
        count -= 1
    values[count] = value


@part
def _collide_pair(cars, i, j, corners, dt):
    first, second = cars[i], cars[j]
    touches, will_touch, x, y = overlap(first, second, corners, dt)
    if will_touch:
        if second.kind == OBSTACLE:
            _hit(first, x, y)
        else:
            _hit(first, x / 2, y / 2)
            _hit(second, -x / 2, -y / 2)
    if touches:
        first.crashed = second.crashed = True


@part
def _hit(car, x, y):
    car.hit, car.impact_x, car.impact_y = True, x, y


@inner
def diagonal(car):
    """Length of the diagonal of the car's box [m]."""
    return np.sqrt(car.length**2 + car.width**2)


@inner
def is_near(first, second, dt):
    """The quick test before the exact one. Only the speed of the first car counts."""
    centres = norm(second.x - first.x, second.y - first.y)
    return not centres > (diagonal(first) + diagonal(second)) / 2 + first.speed * dt


@part
def overlap(first, second, corners, dt):
    """Separating-axis test of two boxes, now and during the next frame.

    Args:
      first, second: CAR records.
      corners: `[2, 4, 2]` working memory.
      dt: length of a frame [s].

    Returns:
      (touches, will_touch, x, y): do they overlap, will they, and the shortest displacement of the
      first that would part them [m].
    """
    away_x, away_y = 0.0, 0.0
    if _are_apart(first, second, dt):
        return False, False, away_x, away_y
    fill_corners(first, corners[0])
    fill_corners(second, corners[1])
    move_x = first.speed * first.cos * dt - second.speed * second.cos * dt
    move_y = first.speed * first.sin * dt - second.speed * second.sin * dt
    centre_x = _mean(corners[0, :, 0]) - _mean(corners[1, :, 0])
    centre_y = _mean(corners[0, :, 1]) - _mean(corners[1, :, 1])
    touches = will_touch = True
    shortest = np.inf
    for box in range(2):
        for p in range(4):
            q = (p + 1) % 4
            nx = -corners[box, q, 1] + corners[box, p, 1]
            ny = corners[box, q, 0] - corners[box, p, 0]
            size = norm(nx, ny)
            nx, ny = nx / size, ny / size
            low_1, high_1 = _span(corners[0], nx, ny)
            low_2, high_2 = _span(corners[1], nx, ny)
            if _between(low_1, high_1, low_2, high_2) > 0:
                touches = False
            step = dot(nx, ny, move_x, move_y)
            if step < 0:
                low_1 += step
            else:
                high_1 += step
            gap = _between(low_1, high_1, low_2, high_2)
            if gap > 0:
                will_touch = False
            if not touches and not will_touch:
                break
            if abs(gap) < shortest:
                shortest = abs(gap)
                sign = 1.0 if dot(centre_x, centre_y, nx, ny) > 0 else -1.0
                away_x, away_y = sign * nx, sign * ny
    return touches, will_touch, shortest * away_x, shortest * away_y


@inner
def _are_apart(first, second, dt):
    """Cheap and never wrong: does an axis of the first box part the two by a safe margin, moves included?

    Then the exact test finds the same, whatever its rounding.
    """
    x, y = second.x - first.x, second.y - first.y
    move_x = first.speed * first.cos * dt - second.speed * second.cos * dt
    move_y = first.speed * first.sin * dt - second.speed * second.sin * dt
    cos = abs(first.cos * second.cos + first.sin * second.sin)
    sin = abs(first.sin * second.cos - first.cos * second.sin)
    along = 0.5 * (first.length + second.length * cos + second.width * sin)
    across = 0.5 * (first.width + second.length * sin + second.width * cos)
    far_along = x * first.cos + y * first.sin
    far_across = y * first.cos - x * first.sin
    move_along = move_x * first.cos + move_y * first.sin
    move_across = move_y * first.cos - move_x * first.sin
    return _gap(far_along, move_along, along) > 1e-6 or _gap(far_across, move_across, across) > 1e-6


@inner
def _gap(far, step, half_sizes):
    """Gap on one axis between boxes `far` apart when the first one moves by `step` toward positive."""
    return max(far - max(step, 0.0), min(step, 0.0) - far) - half_sizes


@inner
def fill_corners(car, corners):
    """Corners of the car's box, counted around it, into `[4, 2]` [m]."""
    for p in range(4):
        along = -car.length / 2 if p < 2 else car.length / 2
        across = -car.width / 2 if p == 0 or p == 3 else car.width / 2
        corners[p, 0] = car.cos * along + -car.sin * across + car.x
        corners[p, 1] = car.sin * along + car.cos * across + car.y


@inner
def _mean(values):
    return (values[0] + values[1] + values[2] + values[3]) / 4


@inner
def _span(corners, nx, ny):
    """Interval that a box covers on an axis."""
    low = high = dot(corners[0, 0], corners[0, 1], nx, ny)
    for p in range(1, 4):
        along = dot(corners[p, 0], corners[p, 1], nx, ny)
        low, high = min(low, along), max(high, along)
    return low, high


@inner
def _between(low_1, high_1, low_2, high_2):
    """Distance of two intervals, negative where they overlap."""
    return low_2 - high_1 if low_1 < low_2 else low_1 - high_2
