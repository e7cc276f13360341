"""Rewards and the ends of episodes."""

import numpy as np

from rss_shield.envs._numpy.floats import clip, lmap
from rss_shield.envs.compiled import merged
from rss_shield.envs.fast.config import EXIT, HIGHWAY, INTERSECTION, MERGE, TWO_WAY
from rss_shield.envs.fast.state import DIRECT
from rss_shield.envs.roads.network import is_on_lane

_EXIT_DISTANCE = 25.0  # beyond an intersection [m]


NO_ACTION = np.int64(-1)


@merged
def is_on_road(cars, i, lanes, sight):
    """Is a car on the lane that is nearest to it?"""
    k = cars[i].lane
    return is_on_lane(lanes[k], sight.s[k, i], sight.lateral[k, i], 0.0)


@merged
def has_arrived(cars, i, lanes, sight):
    """Has a car left the intersection?"""
    k = cars[i].lane
    return lanes[k].exits and sight.s[k, i] >= _EXIT_DISTANCE


@merged
def rate(cars, episode, action, lanes, sight, config, step):
    """Reward of the last decision; its components go to `step`.

    Args:
      cars: `[N]` CAR.
      episode: EPISODE.
      action: of the agent; NO_ACTION = continuous, or none yet.
      lanes: `[L]` LANE.
      sight: this frame's.
      config: CONFIG.
      step: STEP, changed.
    """
    ego = cars[episode.ego]
    crashed = 1.0 if ego.crashed else 0.0
    on_road = 1.0 if is_on_road(cars, episode.ego, lanes, sight) else 0.0
    changes_lane = 1.0 if action == 0 or action == 2 else 0.0
    lane = ego.lane if ego.kind == DIRECT else ego.target_lane
    step.reward_0 = crashed
    if config.scenario == HIGHWAY:
        step.reward_1 = lanes[lane].id / max(lanes[ego.lane].siblings - 1, 1)
        step.reward_2 = clip(_scaled(ego.speed * ego.cos, config), 0.0, 1.0)
        step.reward_3 = on_road
        return _normalized(_weigh(step, config), config) * on_road
    if config.scenario == MERGE:
        step.reward_1 = lanes[ego.lane].id / 1
        step.reward_2 = _scaled(ego.speed, config)
        step.reward_3 = changes_lane
        step.reward_4 = _slowness(cars, episode, config.other_lane)
        return _normalized(_weigh(step, config), config)
    if config.scenario == TWO_WAY:
        others = lanes[ego.lane].siblings - 1
        step.reward_0 = ego.speed_index / (config.speeds - 1)
        step.reward_1 = (others - lanes[lane].id) / others
        return _weigh(step, config)
    if config.scenario == EXIT:
        success = lane == config.goal_lane or lane == config.other_goal_lane
        step.success = success
        step.reward_1 = 1.0 if success else 0.0
        step.reward_2 = clip(_scaled(ego.speed, config), 0.0, 1.0)
        step.reward_3 = lanes[lane].id
        reward = _normalized(_weigh(step, config), config)
        return clip(reward, 0.0, 1.0) if config.normalize_reward else reward
    if config.scenario == INTERSECTION:
        arrived = has_arrived(cars, episode.ego, lanes, sight)
        step.success = arrived
        step.reward_1 = clip(_scaled(ego.speed, config), 0.0, 1.0)
        step.reward_2 = 1.0 if arrived else 0.0
        step.reward_3 = on_road
        reward = config.weight_2 if arrived else _weigh(step, config)
        return _normalized(reward * on_road, config)
    # ROUNDABOUT
    step.reward_1 = ego.speed_index / 2
    step.reward_2 = changes_lane
    step.reward_3 = on_road
    return _normalized(_weigh(step, config), config) * on_road


@merged
def _scaled(speed, config):
    """Speed on the scale of the rewarded range."""
    return lmap(speed, config.speed_low, config.speed_high, 0.0, 1.0)


@merged
def _normalized(reward, config):
    if config.normalize_reward:
        return lmap(reward, config.reward_low, config.reward_high, 0.0, 1.0)
    return reward


@merged
def _slowness(cars, episode, lane):
    """By what share of their target speeds the cars on a lane are too slow, added up."""
    total = 0.0
    for i in range(episode.vehicles):
        if cars[i].lane == lane and cars[i].kind != DIRECT:
            total += (cars[i].target_speed - cars[i].speed) / cars[i].target_speed
    return total


@merged
def _weigh(step, config):
    """Weighted sum of the components, added up in their order."""
    reward = config.weight_0 * step.reward_0
    reward += config.weight_1 * step.reward_1
    reward += config.weight_2 * step.reward_2
    reward += config.weight_3 * step.reward_3
    return reward + config.weight_4 * step.reward_4


@merged
def is_terminated(cars, episode, lanes, sight, config):
    """Is the state terminal?"""
    ego = cars[episode.ego]
    off_road = config.offroad_terminal and not is_on_road(cars, episode.ego, lanes, sight)
    arrived = config.scenario == INTERSECTION and has_arrived(cars, episode.ego, lanes, sight)
    return ego.crashed or ego.x > config.end_x or off_road or arrived


@merged
def is_truncated(episode, config):
    """Is the time over?"""
    return episode.time >= config.duration or (config.max_steps > 0 and episode.steps >= config.max_steps)
