"""New road users, with the random numbers drawn in highway-env's order."""

import numpy as np

from rss_shield.envs.fast.draws import uniform
from rss_shield.envs.fast.drivers import speed_to_index
from rss_shield.envs.fast.motion import set_heading
from rss_shield.envs.fast.state import DIRECT, META, OBSTACLE, OBSTACLE_SIZE, TRAFFIC
from rss_shield.envs.roads.hostile import NO_VICE, WRONG_WAY, vice_at
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, closest_lane, heading_at, local_coordinates, position
from rss_shield.shield._numba.compiled import part


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
    car.kind, car.group = TRAFFIC, 0
    car.lane = car.target_lane = closest_lane(lanes, x, y, heading)
    car.speed_index, car.route, car.route_step, car.vice = 0, -1, 0, NO_VICE
    car.crashed = car.hit = False
    car.checks = car.changes_lane = True
    car.yields = False
    episode.cars += 1
    episode.vehicles += 1
    return i


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
def add_obstacle(cars, episode, lanes, config):
    """Put the obstacle of the configuration on the road. It comes last: vehicles stand before obstacles."""
    i = add_vehicle(cars, episode, config.obstacle_x, config.obstacle_y, 0.0, 0.0, lanes, config)
    cars[i].kind = OBSTACLE
    cars[i].length = cars[i].width = OBSTACLE_SIZE
    episode.vehicles -= 1


@part
def ahead_of_all(cars, episode, lane, speed, spacing, config):
    """Arc length of the next car of a random queue: ahead of everybody by a random gap [m]."""
    offset = spacing * (12 + 1.0 * speed) * config.lanes_factor
    s = 3 * offset if episode.cars == 0 else -np.inf
    for i in range(episode.cars):
        s = max(s, local_coordinates(lane, cars[i].x, cars[i].y)[0])
    return s + offset * uniform(episode, 0.9, 1.1)
