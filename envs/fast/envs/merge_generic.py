"""`merge-generic-v0/-v1`: a merge with any number of lanes and cars, and sections of any length."""

from typing import Any

from rss_shield.envs.fast.draws import integers, uniform
from rss_shield.envs.fast.envs import merge
from rss_shield.envs.fast.spawning import add_ego, add_traffic
from rss_shield.envs.roads.network import position
from rss_shield.shield._numba.compiled import part

REWARDS = merge.REWARDS
RAMP_USERS = 3  # the ego, the car that merges and the obstacle are there in any case
_TRIES = 10  # to find room for a car
_CLEARANCE = 15.0  # between cars that start on one lane [m]


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    merge.describe(record, given, env, number)
    record["main_lanes"], record["traffic"] = given["lanes_count"], given["vehicles_count"]
    stretches = ("before_merge_length", "converge_merge_length", "parallel_merge_length")
    record["main_length"] = sum(given[name] for name in stretches)
    record["end_x"] = env.end_position


@part
def make_scene(cars, episode, lanes, config, target_speeds):
    """Arguments as in `tasks.make_scene`."""
    x, y = position(lanes[config.main_lane + config.main_lanes - 1], 30.0, 0.0)
    add_ego(cars, episode, x, y, 0.0, 30.0, lanes, config, target_speeds)
    for _ in range(config.traffic):
        for _ in range(_TRIES):
            lane = lanes[config.main_lane + integers(episode, config.main_lanes)]
            x, y = position(lane, uniform(episode, 0.0, config.main_length), 0.0)
            if _is_free(cars, episode, x, y):
                speed = 30.0 + uniform(episode, -2.0, 2.0)
                add_traffic(cars, episode, x, y, 0.0, speed, lanes, config)
                break
    merge.add_from_ramp(cars, episode, 60.0, lanes, config)


@part
def _is_free(cars, episode, x, y):
    """Is nobody too near on the same lane? Lanes run along the x-axis from 0 on."""
    free = True
    for i in range(episode.cars):
        free &= cars[i].y != y or abs(x - cars[i].x) > _CLEARANCE
    return free
