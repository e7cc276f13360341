"""`u-turn-v0/-v1`: two lanes around a bend of 180 degrees, with slow cars on them."""

from typing import Any

from rss_shield.envs._numpy.floats import clip
from rss_shield.envs.fast.draws import normal
from rss_shield.envs.fast.linear_drivers import randomize
from rss_shield.envs.fast.rating import normalized, scaled, weigh
from rss_shield.envs.fast.record import set_scale, set_weights
from rss_shield.envs.fast.spawning import add_ego, add_on_lane
from rss_shield.envs.roads.network import position
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("collision_reward", "left_lane_reward", "high_speed_reward", "on_road_reward")
DESTINATIONS = ("d",)


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    record["main_lane"], record["side_lane"] = number["a", "b", 0], number["b", "c", 0]
    record["other_lane"] = number["c", "d", 0]
    set_scale(record, given, given["collision_reward"], given["high_speed_reward"] + given["left_lane_reward"])
    set_weights(record, given, REWARDS)


@part
def make_scene(cars, episode, net, lanes, config, target_speeds, linear):
    """Arguments as in `tasks.make_scene`."""
    x, y = position(lanes[config.main_lane], 0.0, 0.0)
    i = add_ego(cars, episode, x, y, 0.0, 16.0, lanes, config, target_speeds)
    if config.meta_actions:
        cars[i].route = net.plans[cars[i].lane, 0]
    before, bend, after = config.main_lane, config.side_lane, config.other_lane
    i = _add_slow(cars, episode, before, 25.0, 13.5, net, lanes, config)
    randomize(cars, episode, i, config, linear)
    _add_slow(cars, episode, before + 1, 56.0, 14.5, net, lanes, config)
    _add_slow(cars, episode, bend + 1, 0.5, 4.5, net, lanes, config)
    _add_slow(cars, episode, bend, 17.5, 5.5, net, lanes, config)
    _add_slow(cars, episode, after, 1.0, 3.5, net, lanes, config)
    _add_slow(cars, episode, after + 1, 30.0, 5.5, net, lanes, config)


@part
def _add_slow(cars, episode, k, s, speed, net, lanes, config):
    """Put a car on lane `k`, near arc length `s` [m] and `speed` [m/s]; returns its index."""
    s += normal(episode) * 2.0
    i = add_on_lane(cars, episode, lanes[k], s, speed + normal(episode) * 2.0, lanes, config)
    cars[i].route = net.plans[cars[i].lane, 0]
    return i


@inner
def rate(ego, on_road, lanes, config, step):
    """Arguments as in `tasks.rate`."""
    step.reward_1 = lanes[ego.lane].id / max(lanes[ego.lane].siblings - 1, 1)
    step.reward_2 = clip(scaled(ego.speed, config), 0.0, 1.0)
    step.reward_3 = on_road
    return normalized(weigh(step, config), config) * on_road
