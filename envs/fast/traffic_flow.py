"""Traffic that comes and goes at an intersection, with the random numbers drawn in highway-env's order."""

import numpy as np

from rss_shield.envs._numpy.floats import norm
from rss_shield.envs.compiled import compiled
from rss_shield.envs.fast.draws import integers, normal, random, two_of, uniform
from rss_shield.envs.fast.frame import act, look_around, survey, think
from rss_shield.envs.fast.scenes import add_ego, add_on_lane
from rss_shield.envs.fast.sight import sort_along_x
from rss_shield.envs.roads.network import heading_at, local_coordinates, position

_CLEARANCE = 15.0  # of a new car to all others [m]
_EGO_CLEARANCE = 20.0  # others are removed within it [m]
_ANYWHERE, _STRAIGHT_ON = np.int64(0), np.int64(1)  # where cars are bound for
_LEAVING = 20.0  # cars vanish that far before the end of the world [m]


@compiled
def open_intersection(cars, episode, order, net, sight, config, flow, target_speeds):
    """Populate the roads, let the traffic run for three seconds, then add the ego.

    Args:
      cars: `[N]` CAR, overwritten.
      episode: EPISODE, its generator is advanced.
      order: `[N]` indices, overwritten.
      net: the network.
      sight: working memory.
      config: CONFIG.
      flow: `[1]` FLOW.
      target_speeds: `[K]` of meta-actions [m/s].
    """
    lanes = net.lanes
    episode.ego = episode.cars = episode.vehicles = episode.road_frames = 0
    for i in range(len(cars)):
        cars[i].length = 0.0
    n = config.traffic
    for t in range(n - 1):
        _arrive(cars, episode, t * (80.0 / (n - 1)), 1.0, 1.0, 0.6, _ANYWHERE, net, config, flow[0])
    _renumber(cars, episode, order)
    survey(cars, episode, net, sight, flow)
    for _ in range(flow[0].warm_up_frames):
        changing = look_around(cars, episode, order, net, sight, flow)
        think(cars, episode, 0, episode.vehicles, changing, net, sight, config)
        act(cars, episode, order, net, sight, config, flow)
    _arrive(cars, episode, 60.0, 0.1, 0.0, 1.0, _STRAIGHT_ON, net, config, flow[0])
    _add_ego_on_its_way(cars, episode, net, config, flow[0], target_speeds)
    _renumber(cars, episode, order)
    episode.observed_lanes = lanes[cars[episode.ego].lane].siblings


@compiled
def let_traffic_flow(cars, episode, order, net, config, flow):
    """After each decision: cars that leave are gone, and a new one may come."""
    for i in range(len(cars)):
        cars[i].was = i if i < episode.cars else -1
    i = 0
    while i < episode.cars:
        lane = net.lanes[cars[i].lane]
        if i != episode.ego and lane.exits and _arc_length(lane, cars[i]) >= lane.length - _LEAVING:
            _remove(cars, episode, i)
        else:
            i += 1
    _arrive(cars, episode, 0.0, 1.0, 1.0, flow.spawn_probability, _ANYWHERE, net, config, flow)
    _renumber(cars, episode, order)


@compiled
def _arc_length(lane, car):
    s, _ = local_coordinates(lane, car.x, car.y)
    return s


@compiled
def _arrive(cars, episode, s, deviation, speed_deviation, probability, bound, net, config, flow):
    """Perhaps put a new car on one of the entries, around arc length `s` [m], bound for another arm."""
    if random(episode) > probability:
        return
    origin, destination = two_of(episode, 4)
    if bound == _STRAIGHT_ON:
        destination = (origin + 2) % 4
    lane = net.lanes[config.main_lane + origin * flow.arm]
    s = s + 5.0 + normal(episode) * deviation
    speed = 8.0 + normal(episode) * speed_deviation
    x, y = position(lane, s, 0.0)
    for i in range(episode.cars):
        if norm(cars[i].x - x, cars[i].y - y) < _CLEARANCE:
            return
    if _is_full(cars, episode):
        return
    i = add_on_lane(cars, episode, lane, s, speed, net.lanes, config)
    cars[i].was = -1
    cars[i].route = net.plans[cars[i].lane, destination]
    cars[i].delta = uniform(episode, config.delta_low, config.delta_high)


@compiled
def _add_ego_on_its_way(cars, episode, net, config, flow, target_speeds):
    """Put the ego on the southern entry and clear its surroundings."""
    destination = flow.destination
    if destination < 0:
        destination = 1 + integers(episode, 3)
    lane = net.lanes[config.main_lane]
    x, y = position(lane, 60.0 + 5.0 * (1.0 + normal(episode)), 0.0)
    if _is_full(cars, episode):
        return
    ego = add_ego(cars, episode, x, y, heading_at(lane, 60.0), lane.speed_limit, net.lanes, config, target_speeds)
    if config.meta_actions:
        cars[ego].route = net.plans[cars[ego].lane, destination]
    i = 0
    while i < episode.ego:
        if norm(cars[i].x - x, cars[i].y - y) < _EGO_CLEARANCE:
            _remove(cars, episode, i)
        else:
            i += 1


@compiled
def _is_full(cars, episode):
    """Is there no room for another car? The engine tells the user."""
    episode.overflow = episode.overflow or episode.cars == len(cars)
    return episode.cars == len(cars)


@compiled
def _remove(cars, episode, i):
    """Take a car off the road; those after it move up."""
    for j in range(i, episode.cars - 1):
        cars[j] = cars[j + 1]
    episode.cars -= 1
    episode.vehicles -= 1
    if episode.ego > i:
        episode.ego -= 1
    cars[episode.cars].length = 0.0


@compiled
def _renumber(cars, episode, order):
    """Sort afresh after cars came or went."""
    for i in range(episode.cars):
        order[i] = i
    sort_along_x(cars, episode.cars, order)
