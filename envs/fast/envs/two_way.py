"""`two-way-v0`: overtaking on a road with oncoming traffic."""

from typing import Any

from rss_shield.envs.fast.draws import normal
from rss_shield.envs.fast.rating import lane_meant, weigh
from rss_shield.envs.fast.record import set_weights
from rss_shield.envs.fast.spawning import add_ego, add_on_lane
from rss_shield.envs.roads.network import position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("high_speed_reward", "left_lane_reward")


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["main_lane"], record["side_lane"] = number["a", "b", 0], number["b", "a", 0]
    set_weights(record, given, REWARDS)


@part
def make_scene(cars, episode, lanes, config, target_speeds):
    """Arguments as in `tasks.make_scene`."""
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


@inner
def rate(ego, lanes, config, step):
    """Arguments as in `tasks.rate`."""
    others = lanes[ego.lane].siblings - 1
    step.reward_0 = ego.speed_index / (config.speeds - 1)
    step.reward_1 = (others - lanes[lane_meant(ego)].id) / others
    return weigh(step, config)
