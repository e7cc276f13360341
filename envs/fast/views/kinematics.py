"""`Kinematics` and `ExitObservation`: rows of numbers about the ego and the road users nearest to it."""

from typing import Any

import numpy as np
from highway_env.envs.common.observation import ExitObservation, KinematicObservation
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs._numpy.floats import clip, lmap, norm, wrap_to_pi
from rss_shield.envs.fast.draws import interval
from rss_shield.envs.fast.drivers import route_length
from rss_shield.envs.fast.record import Unsupported
from rss_shield.envs.fast.sight import locate
from rss_shield.envs.fast.state import OBSTACLE, UNSEEN
from rss_shield.envs.fast.views.record import (
    COS_D,
    COS_H,
    FEATURES,
    HEADING,
    KINEMATICS,
    LAT_OFF,
    LONG_OFF,
    OF_VEHICLES,
    PRESENCE,
    SIN_D,
    SIN_H,
    VX,
    VY,
    View,
    X,
    Y,
    empty_view,
    ranges_of,
)
from rss_shield.envs.roads.network import heading_at, local_coordinates, position
from rss_shield.shield._numba.compiled import inner, part

_PERCEPTION = 200.0  # `AbstractEnv.PERCEPTION_DISTANCE` [m]
_BEHIND = -10.0  # twice the length of a car [m]
_LANE_WIDTH = 4.0  # `AbstractLane.DEFAULT_WIDTH` [m]


def describe(seen: KinematicObservation, asked: dict[str, Any], env: Any) -> View:
    """The view that an observation of highway-env stands for; `asked` is its configuration.

    Raises:
      Unsupported: an option that the engine does not have.
    """
    if seen.order not in ("sorted", "shuffled"):
        raise Unsupported(f"observation option order = {seen.order!r}", "'sorted' or 'shuffled'")
    if seen.vehicles_count < 2:
        raise Unsupported(f"observation option vehicles_count = {seen.vehicles_count}", ">= 2")
    exits = type(seen) is ExitObservation
    for name in seen.features:
        if name not in FEATURES:
            raise Unsupported(f"observed feature {name!r}", f"one of {', '.join(FEATURES)}")
        if name in OF_VEHICLES and env.road.objects and seen.include_obstacles and not exits:
            raise Unsupported(f"observed feature {name!r} of obstacles", "include_obstacles = False")
    view = empty_view(KINEMATICS)
    record = view.record
    record["rows"], record["clips"], record["normalize"] = seen.vehicles_count, seen.clip, seen.normalize
    record["absolute"], record["see_behind"] = seen.absolute, seen.see_behind
    record["obstacles"], record["intentions"] = seen.include_obstacles and not exits, seen.observe_intentions
    # highway-env's exit sorts in any case, and shuffles the rows later; elsewhere the order of the road is shuffled
    record["shuffled"] = seen.order == "shuffled"
    if exits:
        road = [i for i, index in enumerate(env.road.network.lanes_dict()) if index[:2] == ("1", "2")]
        record["exit_lane"] = road[-1]
    # an observation fills in its default ranges when it is first made
    defaults = {"x": 5 * Vehicle.MAX_SPEED, "vx": 2 * Vehicle.MAX_SPEED, "vy": 2 * Vehicle.MAX_SPEED, "y": np.inf}
    features = np.array([FEATURES.index(name) for name in seen.features], np.int64)
    return view._replace(features=features, ranges=ranges_of(seen.features, asked.get("features_range"), defaults))


@inner
def observe_kinematics(cars, episode, net, sight, view, out):
    """Arguments as in `views.usual.observe`."""
    record = view.record[0]
    ego = cars[episode.ego]
    count = _find_nearest(cars, episode, net.lanes, sight, record)
    n_features = len(view.features)
    for row in range(record.rows):
        for k in range(n_features):
            value = 0.0
            if row <= count:
                i = episode.ego if row == 0 else sight.nearest[row - 1]
                kind = view.features[k]
                value = feature_of(kind, cars[i], net)
                if row == 0 and record.exit_lane >= 0 and kind == X:
                    value = sight.s[record.exit_lane, episode.ego]
                if row > 0 and not record.absolute and X <= kind <= VY:
                    value -= feature_of(kind, ego, net)
                if row > 0 and not record.intentions and COS_D <= kind <= SIN_D:
                    value = 0.0
                if record.normalize and not np.isnan(view.ranges[k, 0]):
                    low, high = view.ranges[k, 0], view.ranges[k, 1]
                    if np.isinf(high):
                        high = _LANE_WIDTH * episode.observed_lanes
                        low = -high
                    value = lmap(value, low, high, -1.0, 1.0)
                    if record.clips:
                        value = clip(value, -1.0, 1.0)
            out[row * n_features + k] = value
    if record.shuffled:
        _shuffle(episode, record.rows, n_features, out)


@inner
def _find_nearest(cars, episode, lanes, sight, record):
    """Fill `sight.nearest` with the observed road users, in the order of their rows; returns how many."""
    ego = cars[episode.ego]
    s = sight.s[ego.lane]
    here = s[episode.ego]
    in_order = not record.shuffled or record.exit_lane >= 0
    count = 0
    for j in range(episode.cars):
        obstacle = cars[j].kind == OBSTACLE
        if j == episode.ego or cars[j].kind == UNSEEN or (obstacle and not record.obstacles):
            continue
        locate(ego.lane, j, cars, lanes, sight)
        ahead = s[j] - here
        if not ahead > _BEHIND and (obstacle or not record.see_behind):
            continue
        if not norm(cars[j].x - ego.x, cars[j].y - ego.y) < _PERCEPTION:
            continue
        if count == record.rows - 1:
            if not in_order or abs(s[sight.nearest[count - 1]] - here) <= abs(ahead):
                continue
            count -= 1
        b = count - 1
        while in_order and b >= 0 and abs(s[sight.nearest[b]] - here) > abs(ahead):
            sight.nearest[b + 1] = sight.nearest[b]
            b -= 1
        sight.nearest[b + 1] = j
        count += 1
    return count


@part
def _shuffle(episode, rows, columns, out):
    """`Generator.shuffle` of all rows but the first."""
    for i in range(rows - 2, 0, -1):
        j = interval(episode, i)
        for k in range(columns):
            a, b = (1 + i) * columns + k, (1 + j) * columns + k
            out[a], out[b] = out[b], out[a]


@inner
def feature_of(feature, car, net):
    """A number about one road user, as its `to_dict` says it."""
    if feature == PRESENCE:
        return 1.0
    if feature == X:
        return car.x
    if feature == Y:
        return car.y
    if feature == VX:
        return car.speed * car.cos
    if feature == VY:
        return car.speed * car.sin
    if feature == HEADING:
        return car.heading
    if feature == COS_H:
        return car.cos
    if feature == SIN_H:
        return car.sin
    return _place_feature(feature, car, net)


@part
def _place_feature(feature, car, net):
    """Where a car is on its lane, or in which direction its destination lies."""
    if COS_D <= feature <= SIN_D:
        x, y = _to_destination(car, net)
        return x if feature == COS_D else y
    lane = net.lanes[car.lane]
    s, lateral = local_coordinates(lane, car.x, car.y)
    if feature == LONG_OFF:
        return s
    if feature == LAT_OFF:
        return lateral
    return wrap_to_pi(car.heading - heading_at(lane, s))


@part
def _to_destination(car, net):
    """Unit vector towards the end of a car's route, zero without one."""
    if car.route < 0 or car.kind == OBSTACLE:
        return 0.0, 0.0
    length = route_length(net, car.route)
    if car.route_step >= length:
        return 0.0, 0.0
    k = net.roads[net.route_roads[car.route, length - 1]].first + max(net.route_lanes[car.route, length - 1], 0)
    x, y = position(net.lanes[k], net.lanes[k].length, 0.0)
    x, y = x - car.x, y - car.y
    if x == 0.0 and y == 0.0:
        return 0.0, 0.0
    far = norm(x, y)
    return x / far, y / far
