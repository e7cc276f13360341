"""`merge-v0/-v1`: a ramp joins a motorway, and ends at an obstacle."""

from typing import Any

from rss_shield.envs.fast.draws import integers, uniform
from rss_shield.envs.fast.rating import normalized, scaled, weigh
from rss_shield.envs.fast.record import set_weights
from rss_shield.envs.fast.spawning import add_ego, add_obstacle, add_traffic
from rss_shield.envs.fast.state import DIRECT
from rss_shield.envs.roads.network import position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = (
    "collision_reward",
    "right_lane_reward",
    "high_speed_reward",
    "lane_change_reward",
    "merging_speed_reward",
)


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["main_lane"], record["side_lane"] = number["a", "b", 0], number["j", "k", 0]
    record["other_lane"] = number.get(("b", "c", 2), -1)
    record["obstacle_x"], record["obstacle_y"] = env.road.objects[0].position
    record["end_x"] = 370
    record["normalize_reward"] = True
    record["reward_low"] = given["collision_reward"] + given["merging_speed_reward"]
    record["reward_high"] = given["high_speed_reward"] + given["right_lane_reward"]
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]
    set_weights(record, given, REWARDS)


@part
def make_scene(cars, episode, lanes, config, target_speeds):
    """Arguments as in `tasks.make_scene`."""
    x, y = position(lanes[config.main_lane + 1], 30.0, 0.0)
    add_ego(cars, episode, x, y, 0.0, 30.0, lanes, config, target_speeds)
    for s, speed in ((90.0, 29.0), (70.0, 31.0), (5.0, 31.5)):
        lane = lanes[config.main_lane + integers(episode, 2)]
        x, y = position(lane, s + uniform(episode, -5.0, 5.0), 0.0)
        speed += uniform(episode, -1.0, 1.0)
        add_traffic(cars, episode, x, y, 0.0, speed, lanes, config)
    add_from_ramp(cars, episode, 110.0, lanes, config)


@part
def add_from_ramp(cars, episode, s, lanes, config):
    """Put the car that merges on the ramp, and the obstacle at its end."""
    x, y = position(lanes[config.side_lane], s, 0.0)
    i = add_traffic(cars, episode, x, y, 0.0, 20.0, lanes, config)
    cars[i].target_speed = 30.0
    add_obstacle(cars, episode, lanes, config)


@inner
def rate(cars, episode, ego, changes_lane, lanes, config, step):
    """Arguments as in `tasks.rate`."""
    step.reward_1 = lanes[ego.lane].id / 1
    step.reward_2 = scaled(ego.speed, config)
    step.reward_3 = changes_lane
    step.reward_4 = _slowness(cars, episode, config.other_lane)
    return normalized(weigh(step, config), config)


@inner
def _slowness(cars, episode, lane):
    """By what share of their target speeds the cars on a lane are too slow, added up."""
    total = 0.0
    for i in range(episode.vehicles):
        if cars[i].lane == lane and cars[i].kind != DIRECT:
            total += (cars[i].target_speed - cars[i].speed) / cars[i].target_speed
    return total
