"""`roundabout-v0/-v1`: the ego drives straight on through a roundabout with traffic on it."""

from typing import Any

import numpy as np

from rss_shield.envs._numpy.floats import clip
from rss_shield.envs.fast.draws import integers, normal
from rss_shield.envs.fast.linear_drivers import randomize
from rss_shield.envs.fast.rating import normalized, weigh
from rss_shield.envs.fast.record import set_weights
from rss_shield.envs.fast.spawning import add_ego, add_on_lane
from rss_shield.envs.fast.state import DIRECT
from rss_shield.envs.roads.network import heading_at, position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("collision_reward", "high_speed_reward", "lane_change_reward", "on_road_reward")
DESTINATIONS = ("nxs", "exr", "sxr", "nxr")  # of the ego, then of the others


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["main_lane"] = number["ser", "ses", 0]
    record["side_lane"], record["other_lane"] = number["we", "sx", 0], number["eer", "ees", 0]
    asked = given["incoming_vehicle_destination"]
    record["destination"] = -1 if asked is None else range(3)[asked]
    record["normalize_reward"] = given["normalize_reward"]
    record["reward_low"], record["reward_high"] = given["collision_reward"], given["high_speed_reward"]
    set_weights(record, given, REWARDS)


@part
def make_scene(cars, episode, net, lanes, config, target_speeds, linear):
    """Arguments as in `tasks.make_scene`."""
    lane = lanes[config.main_lane]
    x, y = position(lane, 125.0, 0.0)
    i = add_ego(cars, episode, x, y, heading_at(lane, 140.0), 8.0, lanes, config, target_speeds)
    if config.meta_actions:
        cars[i].route = net.plans[cars[i].lane, 0]
    circle = config.side_lane
    _add_incoming(cars, episode, net, lanes, config, circle + 1, 5.0, config.destination, linear)
    _add_incoming(cars, episode, net, lanes, config, circle, 20.0, -1, linear)
    _add_incoming(cars, episode, net, lanes, config, circle, -20.0, -1, linear)
    _add_incoming(cars, episode, net, lanes, config, config.other_lane, 50.0, -1, linear)


@part
def _add_incoming(cars, episode, net, lanes, config, k, s, destination, linear):
    """Put a car on lane `k` near arc length `s`, bound for a destination, -1 = drawn."""
    s += normal(episode) * 2.0
    i = add_on_lane(cars, episode, lanes[k], s, 16.0 + normal(episode) * 2.0, lanes, config)
    if destination < 0:
        destination = integers(episode, 3)
    cars[i].route = net.plans[cars[i].lane, 1 + destination]
    randomize(cars, episode, i, config, linear)


@inner
def rate(ego, changes_lane, on_road, config, step):
    """Arguments as in `tasks.rate`."""
    index = ego.speed_index
    if ego.kind == DIRECT:  # the nearest of highway-env's default target speeds, 20, 25 and 30 m/s
        index = np.int64(clip(np.rint((ego.speed - 20.0) / 10.0 * 2.0), 0.0, 2.0))
    step.reward_1 = index / 2
    step.reward_2 = changes_lane
    step.reward_3 = on_road
    return normalized(weigh(step, config), config) * on_road
