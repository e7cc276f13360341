"""`highway-v0`, `highway-fast-v0`: a straight motorway, and a queue of cars on random lanes."""

from typing import Any

import numpy as np

from rss_shield.envs._numpy.floats import clip
from rss_shield.envs.fast.draws import integers, uniform
from rss_shield.envs.fast.linear_drivers import randomize
from rss_shield.envs.fast.rating import lane_meant, normalized, scaled, weigh
from rss_shield.envs.fast.record import set_scale, set_weights
from rss_shield.envs.fast.spawning import add_ego, add_on_lane, ahead_of_all
from rss_shield.envs.roads.network import heading_at, position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("collision_reward", "right_lane_reward", "high_speed_reward", "on_road_reward")


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["offroad_terminal"] = given["offroad_terminal"]
    record["traffic"] = given["vehicles_count"]
    record["traffic_checks"] = env.road.vehicles[-1].check_collisions
    asked = given["initial_lane_id"]  # as Python indexes a list: -1 is the last lane
    record["ego_lane"] = -1 if asked is None else range(given["lanes_count"])[asked]
    record["ego_spacing"], record["traffic_spacing"] = given["ego_spacing"], 1 / given["vehicles_density"]
    record["lanes_factor"] = np.exp(-5 / 40 * given["lanes_count"])
    set_scale(record, given, given["collision_reward"], given["high_speed_reward"] + given["right_lane_reward"])
    set_weights(record, given, REWARDS)


@part
def make_scene(cars, episode, lanes, config, target_speeds, linear):
    """Arguments as in `tasks.make_scene`."""
    lane = lanes[config.ego_lane if config.ego_lane >= 0 else integers(episode, len(lanes))]
    s = ahead_of_all(cars, episode, lane, 25.0, config.ego_spacing, config)
    x, y = position(lane, s, 0.0)
    add_ego(cars, episode, x, y, heading_at(lane, s), 25.0, lanes, config, target_speeds)
    for _ in range(config.traffic):
        lane = lanes[integers(episode, len(lanes))]
        speed = uniform(episode, 0.7 * lane.speed_limit, 0.8 * lane.speed_limit)
        s = ahead_of_all(cars, episode, lane, speed, config.traffic_spacing, config)
        i = add_on_lane(cars, episode, lane, s, speed, lanes, config)
        randomize(cars, episode, i, config, linear)
        cars[i].checks = config.traffic_checks


@inner
def rate(ego, on_road, lanes, config, step):
    """Arguments as in `tasks.rate`."""
    step.reward_1 = lanes[lane_meant(ego)].id / max(lanes[ego.lane].siblings - 1, 1)
    step.reward_2 = clip(scaled(ego.speed * ego.cos, config), 0.0, 1.0)
    step.reward_3 = on_road
    return normalized(weigh(step, config), config) * on_road
