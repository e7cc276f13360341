"""Who yields at an intersection: `highway_env.road.regulation.RegulatedRoad`.

Every half second all cars are predicted along their routes at constant speed. Of two that would meet
within three seconds the one on the lane of lower priority stops, unless it is the ego.
"""

import numpy as np

from rss_shield.envs._numpy.floats import dot, norm
from rss_shield.envs.compiled import merged
from rss_shield.envs.fast.motion import move
from rss_shield.envs.fast.sight import MOMENTS
from rss_shield.envs.fast.state import DIRECT, TRAFFIC
from rss_shield.envs.roads.network import heading_at, position

_STEP = 0.25  # between the moments looked at [s]
_LOWEST, _HIGHEST = MOMENTS, MOMENTS + 1  # rows of `sight.futures` after those of the moments


@merged
def regulate(cars, episode, net, sight, config, flow):
    """Decide who yields, if it is time to.

    Args:
      cars: `[N]` CAR, changed.
      episode: EPISODE, its frames are counted.
      net: the network.
      sight: this frame's.
      config: CONFIG.
      flow: FLOW.
    """
    episode.road_frames += 1
    if episode.road_frames % flow.regulation_period != 0:
        return
    lanes, futures = net.lanes, sight.futures
    n = episode.cars
    for i in range(n):
        car = cars[i]
        if car.yields:
            car.target_speed, car.yields = lanes[car.lane].speed_limit, False
        if car.kind == DIRECT:
            _predict_steering(car, sight, futures[i], config)
        else:
            _predict_route(car, sight.s[car.lane, i], net, futures[i])
        _enclose(futures[i])
    for i in range(n - 1):
        for j in range(i + 1, n):
            if _never_meet(futures[i], futures[j], cars[i].length):
                continue
            # the decision is cheaper than the prediction that it needs
            loser = cars[i] if _first_yields(cars[i], cars[j], lanes) else cars[j]
            if loser.kind == TRAFFIC and not loser.yields and _will_meet(futures[i], futures[j], cars[i], cars[j]):
                loser.target_speed, loser.yields = 0.0, True


@merged
def _first_yields(first, second, lanes):
    """Does the first of two cars yield, by the priority of their lanes, else because it is behind?"""
    mine, theirs = lanes[first.lane].priority, lanes[second.lane].priority
    if mine != theirs:
        return mine < theirs
    x, y = second.x - first.x, second.y - first.y
    return dot(first.cos, first.sin, x, y) > dot(second.cos, second.sin, -x, -y)


# ---------------------------------------------------------------- predictions


@merged
def _predict_route(car, s, net, future):
    """Poses of a car on the middle of its route, as if its arc length counted from the start of that route.

    Args:
      car: CAR.
      s: its arc length on its lane [m].
      net: the network.
      future: `[MOMENTS + 2, 3]`, the moments are overwritten.
    """
    lanes, route = net.lanes, car.route
    last = -1
    if route >= 0:
        while last + 1 < net.route_roads.shape[1] and net.route_roads[route, last + 1] >= 0:
            last += 1
    for t in range(MOMENTS):
        along = s + car.speed * (_STEP * (t + 1))
        k, step = car.lane, car.route_step
        if step <= last:
            k = _route_lane(car, step, net)
            while step < last and along > lanes[k].length:
                along -= lanes[k].length
                step += 1
                k = _route_lane(car, step, net)
        future[t, 0], future[t, 1] = position(lanes[k], along, 0.0)
        future[t, 2] = heading_at(lanes[k], along)


@merged
def _route_lane(car, step, net):
    """Lane of a step of a car's route; where the route leaves it open, the one that it is on now."""
    lane_id = net.route_lanes[car.route, step]
    return net.roads[net.route_roads[car.route, step]].first + (lane_id if lane_id >= 0 else net.lanes[car.lane].id)


@merged
def _predict_steering(car, sight, future, config):
    """Poses of a directly driven car that keeps its steering and does not accelerate."""
    ghost = sight.ghost
    ghost[0] = car
    ghost[0].acceleration = 0.0
    for t in range(MOMENTS):
        move(ghost, len(ghost), sight, _STEP, config.max_speed, config.min_speed)
        future[t, 0], future[t, 1], future[t, 2] = ghost[0].x, ghost[0].y, ghost[0].heading


@merged
def _enclose(future):
    """Note the range of the predicted positions."""
    for a in range(2):
        low = high = future[0, a]
        for t in range(1, MOMENTS):
            low, high = min(low, future[t, a]), max(high, future[t, a])
        future[_LOWEST, a], future[_HIGHEST, a] = low, high


# ---------------------------------------------------------------- meetings


@merged
def _never_meet(one, other, near):
    """Are two cars surely farther than `near` apart at all moments?"""
    near += 1e-6
    for a in range(2):
        if one[_LOWEST, a] - other[_HIGHEST, a] > near or other[_LOWEST, a] - one[_HIGHEST, a] > near:
            return True
    return False


@merged
def _will_meet(one, other, first, second):
    """Do the boxes of two cars, half as long again, overlap at any of the moments?"""
    near = first.length + 1e-6
    for t in range(MOMENTS):
        x, y = other[t, 0] - one[t, 0], other[t, 1] - one[t, 1]
        if abs(x) > near or abs(y) > near or norm(x, y) > first.length:
            continue
        if _has_corner_inside(one[t], first, other[t], second) or _has_corner_inside(other[t], second, one[t], first):
            return True
    return False


@merged
def _has_corner_inside(pose, car, box, other):
    """Is a corner, the middle of an edge or the centre of one car's box inside another's?

    As in highway-env, the other box is turned the wrong way, and the arithmetic is that of its matrix
    products.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    box_cos, box_sin = np.cos(box[2]), np.sin(box[2])
    long, wide = 1.5 * car.length / 2, 0.9 * car.width / 2
    box_long, box_wide = 1.5 * other.length / 2, 0.9 * other.width / 2
    for a in range(-1, 2):
        for b in range(-1, 2):
            u, v = a * long, b * wide
            x = dot(cos, -sin, u, v) + pose[0] - box[0]
            y = dot(sin, cos, u, v) + pose[1] - box[1]
            along = dot(-box_sin, box_cos, y, x)
            across = dot(box_cos, box_sin, y, x)
            if -box_long <= along <= box_long and -box_wide <= across <= box_wide:
                return True
    return False
