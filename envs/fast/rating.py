"""What rewards are made of, and the ends of episodes that all environments share."""

from rss_shield.envs._numpy.floats import lmap
from rss_shield.envs.fast.state import DIRECT
from rss_shield.envs.roads.network import is_on_lane
from rss_shield.shield._numba.compiled import inner


@inner
def is_on_road(cars, i, lanes, sight):
    """Is a car on the lane that is nearest to it?"""
    k = cars[i].lane
    return is_on_lane(lanes[k], sight.s[k, i], sight.lateral[k, i], 0.0)


@inner
def lane_meant(ego):
    """The lane that the ego heads for, or is on if it is steered directly."""
    return ego.lane if ego.kind == DIRECT else ego.target_lane


@inner
def scaled(speed, config):
    """Speed on the scale of the rewarded range."""
    return lmap(speed, config.speed_low, config.speed_high, 0.0, 1.0)


@inner
def normalized(reward, config):
    """A reward on the scale from its smallest to its largest value, where that is asked for."""
    if config.normalize_reward:
        return lmap(reward, config.reward_low, config.reward_high, 0.0, 1.0)
    return reward


@inner
def weigh(step, config):
    """Weighted sum of the components, added up in their order."""
    reward = config.weight_0 * step.reward_0
    reward += config.weight_1 * step.reward_1
    reward += config.weight_2 * step.reward_2
    reward += config.weight_3 * step.reward_3
    return reward + config.weight_4 * step.reward_4


@inner
def is_truncated(episode, config):
    """Is the time over?"""
    return episode.time >= config.duration or (config.max_steps > 0 and episode.steps >= config.max_steps)
