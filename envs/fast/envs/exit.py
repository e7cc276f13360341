"""`exit-v0/-v1`: a motorway with an exit that the ego is to take."""

from typing import Any

import numpy as np

from rss_shield.envs._numpy.floats import clip
from rss_shield.envs.fast.draws import random
from rss_shield.envs.fast.rating import lane_meant, normalized, scaled, weigh
from rss_shield.envs.fast.record import set_scale, set_weights
from rss_shield.envs.fast.spawning import add_ego, add_on_lane, ahead_of_all
from rss_shield.envs.roads.network import heading_at, position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("collision_reward", "goal_reward", "high_speed_reward", "right_lane_reward")
DESTINATIONS = ("3",)


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["traffic"] = given["vehicles_count"]
    record["ego_spacing"], record["traffic_spacing"] = given["ego_spacing"], 1 / given["vehicles_density"]
    record["main_lane"] = number["0", "1", 0]
    record["lanes_factor"] = np.exp(-5 / 40 * given["lanes_count"])
    record["goal_lane"] = number["1", "2", given["lanes_count"]]
    record["other_goal_lane"] = number["2", "exit", 0]
    set_scale(record, given, given["collision_reward"], given["goal_reward"])
    set_weights(record, given, REWARDS)


def lane_odds(given: dict) -> np.ndarray:
    """Cumulative odds of the lanes that traffic starts on, as `np.random.Generator.choice` makes thresholds of them."""
    lanes = np.arange(given["lanes_count"])
    odds = (lanes / lanes.sum()).cumsum()
    return odds / odds[-1]


@part
def make_scene(cars, episode, net, lanes, config, target_speeds, lane_odds):
    """Arguments as in `tasks.make_scene`."""
    lane = lanes[config.main_lane]
    s = ahead_of_all(cars, episode, lane, 25.0, config.ego_spacing, config)
    x, y = position(lane, s, 0.0)
    add_ego(cars, episode, x, y, heading_at(lane, s), 25.0, lanes, config, target_speeds)
    for _ in range(config.traffic):
        lane = lanes[config.main_lane + _choose(episode, lane_odds)]
        s = ahead_of_all(cars, episode, lane, lane.speed_limit, config.traffic_spacing, config)
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


@inner
def rate(ego, lanes, config, step):
    """Arguments as in `tasks.rate`."""
    lane = lane_meant(ego)
    success = lane == config.goal_lane or lane == config.other_goal_lane
    step.success = success
    step.reward_1 = 1.0 if success else 0.0
    step.reward_2 = clip(scaled(ego.speed, config), 0.0, 1.0)
    step.reward_3 = lanes[lane].id
    reward = normalized(weigh(step, config), config)
    return clip(reward, 0.0, 1.0) if config.normalize_reward else reward
