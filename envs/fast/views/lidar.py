"""`LidarObservation`: distance and relative speed of the nearest road user in each direction."""

import numpy as np
from highway_env.envs.common.observation import LidarObservation

from rss_shield.envs._numpy.floats import dot, norm
from rss_shield.envs._numpy.ufuncs import arctan2
from rss_shield.envs.compiled import kernel
from rss_shield.envs.fast.collisions import fill_corners
from rss_shield.envs.fast.views.record import LIDAR, View, empty_view
from rss_shield.shield._numba.compiled import inner, part


def describe(seen: LidarObservation) -> View:
    """The view that an observation of highway-env stands for."""
    view = empty_view(LIDAR)
    record = view.record
    record["cells"], record["reach"], record["angle"] = seen.cells, seen.maximum_range, seen.angle
    record["normalize"] = seen.normalize
    return view


@kernel
def look_lidar(first, last, cars, episodes, sight, view, which, start, out):
    """Arguments as in `views.grid.look_grid`; `sight` is working memory."""
    for e in range(first, last):
        if which[e]:
            _trace(cars[e], episodes[e], view.record[0], sight.corners[0], out[e, start:])


@part
def _trace(cars, episode, record, corners, out):
    ego = cars[episode.ego]
    for cell in range(record.cells):
        out[2 * cell] = out[2 * cell + 1] = record.reach
    for i in range(episode.cars):
        car = cars[i]
        if i == episode.ego:
            continue
        centre = norm(car.x - ego.x, car.y - ego.y)
        if centre > record.reach:
            continue
        cell = _cell_of(_angle_to(car.x, car.y, ego, record), record)
        _note(cell, centre - car.width / 2, car, ego, record, out)
        fill_corners(car, corners)
        low = high = _angle_to(corners[0, 0], corners[0, 1], ego, record)
        for p in range(1, 4):
            angle = _angle_to(corners[p, 0], corners[p, 1], ego, record)
            low, high = min(low, angle), max(high, angle)
        if low < -np.pi / 2 and np.pi / 2 < high:  # the corners lie on both sides of the direction backwards
            low, high = high, low + 2 * np.pi
        first, last = _cell_of(low, record), _cell_of(high, record)
        for cell in range(record.cells):
            between = first <= cell <= last if first < last else cell >= first or cell <= last
            if between:
                dx, dy = np.cos(cell * record.angle), np.sin(cell * record.angle)
                _note(cell, _distance(dx, dy, corners, ego, record), car, ego, record, out)
    if record.normalize:
        for k in range(2 * record.cells):
            out[k] = out[k] / np.float32(record.reach)


@inner
def _angle_to(x, y, ego, record):
    return arctan2(y - ego.y, x - ego.x) + record.angle / 2


@inner
def _cell_of(angle, record):
    return np.int64(np.floor(angle / record.angle)) % record.cells


@part
def _note(cell, distance, car, ego, record, out):
    """Enter a road user in a cell, unless somebody is nearer there."""
    if distance <= np.float64(out[2 * cell]):
        dx, dy = np.cos(cell * record.angle), np.sin(cell * record.angle)
        vx, vy = car.speed * car.cos - ego.speed * ego.cos, car.speed * car.sin - ego.speed * ego.sin
        out[2 * cell], out[2 * cell + 1] = distance, dot(vx, vy, dx, dy)


@part
def _distance(dx, dy, corners, ego, record):
    """Distance at which a ray from the ego meets a box, inf = it does not [m]; dx, dy: unit vector of the ray."""
    qx, qy = ego.x + record.reach * dx - ego.x, ego.y + record.reach * dy - ego.y
    u_low, u_high = _interval(0, 1, qx, qy, corners, ego)
    v_low, v_high = _interval(0, 3, qx, qy, corners, ego)
    meets = _apart(u_low, u_high, v_low, v_high) <= 0
    if meets and _apart(0.0, 1.0, u_low, u_high) <= 0 and _apart(0.0, 1.0, v_low, v_high) <= 0:
        return (v_low if v_low > u_low else u_low) * norm(qx, qy)
    return np.inf


@inner
def _interval(a, b, qx, qy, corners, ego):
    """Shares of the ray between which it is within two parallel sides, through corners `a` and `b`."""
    ux, uy = corners[b, 0] - corners[a, 0], corners[b, 1] - corners[a, 1]
    size = norm(ux, uy)
    ux, uy = ux / size, uy / size
    along = dot(qx, qy, ux, uy)
    low = dot(corners[a, 0] - ego.x, corners[a, 1] - ego.y, ux, uy) / along
    high = dot(corners[b, 0] - ego.x, corners[b, 1] - ego.y, ux, uy) / along
    if along >= 0:
        return low, high
    return high, low


@inner
def _apart(low_1, high_1, low_2, high_2):
    """Distance of two intervals, negative where they overlap."""
    return low_2 - high_1 if low_1 < low_2 else low_1 - high_2
