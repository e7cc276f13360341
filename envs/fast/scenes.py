"""The scenes that episodes start from, with the random numbers drawn in highway-env's order."""

import numpy as np

from rss_shield.envs.fast.config import EXIT, HIGHWAY, MERGE, ROUNDABOUT, TWO_WAY
from rss_shield.envs.fast.draws import integers, normal, random, uniform
from rss_shield.envs.fast.drivers import speed_to_index
from rss_shield.envs.fast.motion import set_heading
from rss_shield.envs.fast.state import DIRECT, META, OBSTACLE, OBSTACLE_SIZE, TRAFFIC
from rss_shield.envs.roads.hostile import NO_VICE, WRONG_WAY, vice_at
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, closest_lane, heading_at, local_coordinates, position
from rss_shield.shield._numba.compiled import part


@part
def make_scene(cars, episode, order, net, lanes, config, target_speeds, lane_odds):
    """Populate the road.

    Args:
      cars: `[N]` CAR, overwritten.
      episode: EPISODE, its generator is advanced.
      order: `[N]` indices sorted by x, overwritten.
      net, lanes: the network and its LANE records.
      config: CONFIG.
      target_speeds: `[K]` of meta-actions [m/s].
      lane_odds: of the `Scenario`.
    """
    episode.ego = episode.cars = episode.vehicles = 0
    if config.scenario == HIGHWAY:
        _highway(cars, episode, lanes, config, target_speeds)
    elif config.scenario == MERGE:
        _merge(cars, episode, lanes, config, target_speeds)
    elif config.scenario == TWO_WAY:
        _two_way(cars, episode, lanes, config, target_speeds)
    elif config.scenario == EXIT:
        _exit(cars, episode, net, lanes, config, target_speeds, lane_odds)
    elif config.scenario == ROUNDABOUT:
        _roundabout(cars, episode, net, lanes, config, target_speeds)
    episode.observed_lanes = lanes[cars[episode.ego].lane].siblings
    for i in range(episode.cars):
        order[i] = i


@part
def add_vehicle(cars, episode, x, y, heading, speed, lanes, config):
    """Put a new vehicle on the road; returns its index."""
    i = episode.cars
    car = cars[i]
    car.x, car.y, car.speed = x, y, speed
    set_heading(car, heading)
    car.acceleration = car.steering = 0.0
    car.target_speed = speed
    car.timer = (x + y) * np.pi % config.lane_change_delay
    car.delta = config.delta
    car.impact_x = car.impact_y = 0.0
    car.length, car.width = CAR_LENGTH, CAR_WIDTH
    car.kind = TRAFFIC
    car.lane = car.target_lane = closest_lane(lanes, x, y, heading)
    car.speed_index, car.route, car.route_step, car.vice = 0, -1, 0, NO_VICE
    car.crashed = car.hit = False
    car.checks = car.changes_lane = True
    car.yields = False
    episode.cars += 1
    episode.vehicles += 1
    return i


@part
def add_ego(cars, episode, x, y, heading, speed, lanes, config, target_speeds):
    """Put the controlled vehicle on the road; returns its index."""
    i = add_vehicle(cars, episode, x, y, heading, speed, lanes, config)
    cars[i].kind = META if config.meta_actions else DIRECT
    if config.meta_actions:
        cars[i].speed_index = speed_to_index(speed, target_speeds)
        cars[i].target_speed = target_speeds[cars[i].speed_index]
    episode.ego = i
    return i


@part
def _ahead_of_all(cars, episode, lane, speed, spacing, config):
    """Arc length of the next car of a random queue: ahead of everybody by a random gap [m]."""
    offset = spacing * (12 + 1.0 * speed) * config.lanes_factor
    s = 3 * offset if episode.cars == 0 else -np.inf
    for i in range(episode.cars):
        s = max(s, local_coordinates(lane, cars[i].x, cars[i].y)[0])
    return s + offset * uniform(episode, 0.9, 1.1)


@part
def _highway(cars, episode, lanes, config, target_speeds):
    lane = lanes[config.ego_lane if config.ego_lane >= 0 else integers(episode, len(lanes))]
    s = _ahead_of_all(cars, episode, lane, 25.0, config.ego_spacing, config)
    x, y = position(lane, s, 0.0)
    add_ego(cars, episode, x, y, heading_at(lane, s), 25.0, lanes, config, target_speeds)
    for _ in range(config.traffic):
        lane = lanes[integers(episode, len(lanes))]
        speed = uniform(episode, 0.7 * lane.speed_limit, 0.8 * lane.speed_limit)
        s = _ahead_of_all(cars, episode, lane, speed, config.traffic_spacing, config)
        i = add_on_lane(cars, episode, lane, s, speed, lanes, config)
        cars[i].delta = uniform(episode, config.delta_low, config.delta_high)
        cars[i].checks = config.traffic_checks


@part
def add_on_lane(cars, episode, lane, s, speed, lanes, config):
    """Put a car of the traffic on a lane, along it; returns its index."""
    x, y = position(lane, s, 0.0)
    return add_traffic(cars, episode, x, y, heading_at(lane, s), speed, lanes, config)


@part
def add_traffic(cars, episode, x, y, heading, speed, lanes, config):
    """Put a car of the traffic on the road, hostile or not; returns its index."""
    vice = vice_at(config.vice, x, y)
    turned = np.pi if vice == WRONG_WAY else 0.0
    i = add_vehicle(cars, episode, x, y, heading + turned, speed, lanes, config)
    cars[i].vice = vice
    return i


@part
def _merge(cars, episode, lanes, config, target_speeds):
    x, y = position(lanes[config.main_lane + 1], 30.0, 0.0)
    add_ego(cars, episode, x, y, 0.0, 30.0, lanes, config, target_speeds)
    for s, speed in ((90.0, 29.0), (70.0, 31.0), (5.0, 31.5)):
        lane = lanes[config.main_lane + integers(episode, 2)]
        x, y = position(lane, s + uniform(episode, -5.0, 5.0), 0.0)
        speed += uniform(episode, -1.0, 1.0)
        add_traffic(cars, episode, x, y, 0.0, speed, lanes, config)
    x, y = position(lanes[config.side_lane], 110.0, 0.0)
    i = add_traffic(cars, episode, x, y, 0.0, 20.0, lanes, config)
    cars[i].target_speed = 30.0
    i = add_vehicle(cars, episode, config.obstacle_x, config.obstacle_y, 0.0, 0.0, lanes, config)
    cars[i].kind = OBSTACLE
    cars[i].length = cars[i].width = OBSTACLE_SIZE
    episode.vehicles -= 1


@part
def _two_way(cars, episode, lanes, config, target_speeds):
    lane = lanes[config.main_lane + 1]
    x, y = position(lane, 30.0, 0.0)
    add_ego(cars, episode, x, y, 0.0, 30.0, lanes, config, target_speeds)
    for k in range(3):
        s = 70.0 + 40.0 * k + 10.0 * normal(episode)
        i = add_on_lane(cars, episode, lane, s, 24.0 + 2.0 * normal(episode), lanes, config)
        cars[i].changes_lane = False
    for k in range(2):
        s = 200.0 + 100.0 * k + 10.0 * normal(episode)
        i = add_on_lane(cars, episode, lanes[config.side_lane], s, 20.0 + 5.0 * normal(episode), lanes, config)
        cars[i].changes_lane = False
        cars[i].target_lane = config.side_lane


@part
def _exit(cars, episode, net, lanes, config, target_speeds, lane_odds):
    lane = lanes[config.main_lane]
    s = _ahead_of_all(cars, episode, lane, 25.0, config.ego_spacing, config)
    x, y = position(lane, s, 0.0)
    add_ego(cars, episode, x, y, heading_at(lane, s), 25.0, lanes, config, target_speeds)
    for _ in range(config.traffic):
        lane = lanes[config.main_lane + _choose(episode, lane_odds)]
        s = _ahead_of_all(cars, episode, lane, lane.speed_limit, config.traffic_spacing, config)
        i = add_on_lane(cars, episode, lane, s, lane.speed_limit, lanes, config)
        cars[i].route = net.plans[cars[i].lane, 0]
        cars[i].changes_lane = False


@part
def _choose(episode, odds):
    """`Generator.choice` by cumulative odds."""
    drawn = random(episode)
    k = 0
    while odds[k] <= drawn:
        k += 1
    return k


@part
def _roundabout(cars, episode, net, lanes, config, target_speeds):
    lane = lanes[config.main_lane]
    x, y = position(lane, 125.0, 0.0)
    i = add_ego(cars, episode, x, y, heading_at(lane, 140.0), 8.0, lanes, config, target_speeds)
    cars[i].route = net.plans[cars[i].lane, 0]
    circle = config.side_lane
    _add_incoming(cars, episode, net, lanes, config, circle + 1, 5.0, config.destination)
    _add_incoming(cars, episode, net, lanes, config, circle, 20.0, -1)
    _add_incoming(cars, episode, net, lanes, config, circle, -20.0, -1)
    _add_incoming(cars, episode, net, lanes, config, config.other_lane, 50.0, -1)


@part
def _add_incoming(cars, episode, net, lanes, config, k, s, destination):
    """Put a car on lane `k` near arc length `s`, bound for a destination, -1 = drawn."""
    s += normal(episode) * 2.0
    i = add_on_lane(cars, episode, lanes[k], s, 16.0 + normal(episode) * 2.0, lanes, config)
    if destination < 0:
        destination = integers(episode, 3)
    cars[i].route = net.plans[cars[i].lane, 1 + destination]
    cars[i].delta = uniform(episode, config.delta_low, config.delta_high)
