"""`OccupancyGrid`: layers of cells around the ego, filled with numbers about the cars in them, and with the road."""

from typing import Any

import numpy as np
from highway_env.envs.common.observation import OccupancyGridObservation
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs._numpy.floats import clip, lmap
from rss_shield.envs.compiled import kernel
from rss_shield.envs.fast.views.kinematics import feature_of
from rss_shield.envs.fast.views.record import FEATURES, GRID, ON_ROAD, VY, View, X, empty_view, ranges_of
from rss_shield.envs.roads.network import local_coordinates, position
from rss_shield.shield._numba.compiled import inner, part

_ROAD_AHEAD = 100.0  # and behind, that is drawn [m]
_UNKNOWN = -1  # a layer that highway-env leaves empty


def describe(seen: OccupancyGridObservation, asked: dict[str, Any]) -> View:
    """The view that an observation of highway-env stands for; `asked` is its configuration."""
    view = empty_view(GRID)
    record = view.record
    (record["low_x"], _), (record["low_y"], _) = seen.grid_size.tolist()
    record["step_x"], record["step_y"] = seen.grid_step.tolist()
    _, record["cells_x"], record["cells_y"] = seen.grid.shape
    record["aligned"], record["clips"], record["as_image"] = seen.align_to_vehicle_axes, seen.clip, seen.as_image
    asked_ranges = asked.get("features_range") or {}
    for name in ("x", "y"):
        if name in asked_ranges:
            record[f"{name}_low"], record[f"{name}_high"] = asked_ranges[name]
    known = {**{name: k for k, name in enumerate(FEATURES)}, "on_road": ON_ROAD}
    defaults = {"vx": 2 * Vehicle.MAX_SPEED, "vy": 2 * Vehicle.MAX_SPEED}
    features = np.array([known.get(name, _UNKNOWN) for name in seen.features], np.int64)
    return view._replace(features=features, ranges=ranges_of(seen.features, asked_ranges, defaults))


@kernel
def look_grid(first, last, cars, episodes, net, view, which, start, out):
    """Grids of the environments `first` to `last` - 1.

    Args:
      cars: `[E, N]` CAR.
      episodes: `[E]` EPISODE.
      net: the network.
      view: `View`.
      which: `[E]` bool, of whom.
      start: first column of theirs.
      out: `[E, size]` float32, changed.
    """
    for e in range(first, last):
        if which[e]:
            _fill_grid(cars[e], episodes[e], net, view, out[e, start:])


@part
def _fill_grid(cars, episode, net, view, out):
    record = view.record[0]
    cells = record.cells_x * record.cells_y
    for layer in range(len(view.features)):
        cell = out[layer * cells : (layer + 1) * cells]
        for c in range(cells):
            cell[c] = 0.0
        feature = view.features[layer]
        if feature == ON_ROAD:
            _draw_road(cars[episode.ego], net.lanes, record, cell)
        elif feature >= 0:
            _fill_layer(cars, episode, feature, net, view, layer, cell)


@part
def _fill_layer(cars, episode, feature, net, view, layer, cell):
    """Who is later on the road is overwritten by who is earlier."""
    record, ego = view.record[0], cars[episode.ego]
    for i in range(episode.vehicles - 1, -1, -1):
        car = cars[i]
        x = _there_and_back(car.x - ego.x, record.x_low, record.x_high)
        y = _there_and_back(car.y - ego.y, record.y_low, record.y_high)
        c = _cell_of(x, y, ego, record)
        if c < 0:
            continue
        value = feature_of(feature, car, net)
        if X <= feature <= VY:
            value -= feature_of(feature, ego, net)
        low, high = view.ranges[layer, 0], view.ranges[layer, 1]
        if not np.isnan(low):
            value = lmap(value, low, high, -1.0, 1.0)
        cell[c] = _shown(value, record)


@inner
def _there_and_back(value, low, high):
    """A coordinate that was put on a scale and taken back from it, which rounds; nan = it was not."""
    if np.isnan(low):
        return value
    return lmap(lmap(value, low, high, -1.0, 1.0), -1.0, 1.0, low, high)


@inner
def _cell_of(x, y, ego, record):
    """Number of the cell of a point relative to the ego, -1 = outside."""
    if record.aligned:
        x, y = ego.cos * x + ego.sin * y, -ego.sin * x + ego.cos * y
    i = np.floor((x - record.low_x) / record.step_x)
    j = np.floor((y - record.low_y) / record.step_y)
    if 0 <= i < record.cells_x and 0 <= j < record.cells_y:
        return np.int64(i) * record.cells_y + np.int64(j)
    return np.int64(-1)


@inner
def _shown(value, record):
    if record.as_image:
        return np.floor((clip(value, -1.0, 1.0) + 1) / 2 * 255)
    return clip(value, -1.0, 1.0) if record.clips else value


@part
def _draw_road(ego, lanes, record, cell):
    """Mark the cells with a point of the middle of a lane, one a cell's length after the other."""
    spacing, mark = min(record.step_x, record.step_y), _shown(1.0, record)
    for k in range(len(lanes)):
        here, _ = local_coordinates(lanes[k], ego.x, ego.y)
        begin = here - _ROAD_AHEAD
        step = (begin + spacing) - begin  # as `np.arange` goes on
        for n in range(np.int64(np.ceil((here + _ROAD_AHEAD - begin) / spacing))):
            x, y = position(lanes[k], clip(begin + n * step, 0.0, lanes[k].length), 0.0)
            c = _cell_of(x - ego.x, y - ego.y, ego, record)
            if c >= 0:
                cell[c] = mark
