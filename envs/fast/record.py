"""What the engine is told as numbers: of an environment, of traffic that comes and goes, and of an observation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rss_shield.envs.fast.state import REWARDS

CONFIG = np.dtype(
    [
        ("scenario", "i8"),
        ("dt", "f8"),  # length of a frame [s]
        ("frames", "i8"),  # per decision
        ("period", "f8"),  # length of a decision [s]
        ("agents", "i8"),  # egos
        ("duration", "f8"),  # of an episode [s], inf = unlimited
        ("max_steps", "i8"),  # decisions of an episode, 0 = unlimited
        ("offroad_terminal", "?"),
        ("meta_actions", "?"),  # else acceleration and steering
        ("speeds", "i8"),  # how many the ego's meta-actions choose from
        ("max_speed", "f8"),  # of a directly driven ego [m/s]
        ("min_speed", "f8"),
        # traffic
        ("acc_max", "f8"),  # [m/s^2]
        ("comfort_acc_max", "f8"),
        ("comfort_acc_min", "f8"),
        ("gap_braking", "f8"),  # what speeds are divided by in the desired gap
        ("distance_wanted", "f8"),  # [m]
        ("time_wanted", "f8"),  # [s]
        ("min_acc_gain", "f8"),  # [m/s^2]
        ("max_braking_imposed", "f8"),
        ("lane_change_delay", "f8"),  # [s]
        ("delta", "f8"),
        ("delta_low", "f8"),
        ("delta_high", "f8"),
        ("vice", "i8"),  # of everybody, see `envs.roads.hostile`
        ("bounded", "?"),  # in which they keep to the table's limits
        # scene
        ("traffic", "i8"),  # vehicles besides the ego
        ("traffic_checks", "?"),  # they look for collisions themselves
        ("ego_lane", "i8"),  # -1 = drawn
        ("ego_spacing", "f8"),
        ("traffic_spacing", "f8"),
        ("lanes_factor", "f8"),  # more lanes, denser traffic
        ("main_lane", "i8"),  # first lane of the road where the scene plays
        ("main_lanes", "i8"),  # lanes of that road
        ("main_length", "f8"),  # of the stretch where traffic starts [m]
        ("side_lane", "i8"),  # where others come from
        ("other_lane", "i8"),
        ("destination", "i8"),  # of the incoming car, -1 = drawn
        ("obstacle_x", "f8"),  # [m]
        ("obstacle_y", "f8"),
        ("end_x", "f8"),  # the episode ends beyond it [m]
        ("goal_lane", "i8"),  # reaching one of them is a success
        ("other_goal_lane", "i8"),
        # reward
        *[(f"weight_{k}", "f8") for k in range(REWARDS)],
        ("normalize_reward", "?"),
        ("reward_low", "f8"),
        ("reward_high", "f8"),
        ("speed_low", "f8"),  # [m/s]
        ("speed_high", "f8"),
    ],
    align=True,
)

# an intersection, where traffic comes, goes and yields
FLOW = np.dtype(
    [
        ("arm", "i8"),  # lanes from one entry to the next
        ("destination", "i8"),  # of the ego, -1 = drawn
        ("warm_up_frames", "i8"),  # before the ego appears
        ("regulation_period", "i8"),  # frames between decisions on who yields
        ("spawn_probability", "f8"),  # of a new car after each decision
    ],
    align=True,
)


class Unsupported(ValueError):
    """A feature of highway-env that the engine does not have."""

    def __init__(self, what: str, expected: str) -> None:
        super().__init__(f"the fast engine does not support {what}; expected {expected}")


def set_scale(record: Any, given: Mapping[str, Any], low: float, high: float) -> None:
    """Enter whether and from what range a reward is scaled, and the speeds that are worth nothing and all."""
    record["normalize_reward"], record["reward_low"], record["reward_high"] = given["normalize_reward"], low, high
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]


def set_weights(record: Any, given: Mapping[str, Any], names: tuple[str, ...]) -> None:
    """Enter what the components of a reward weigh; one that the configuration does not know weighs nothing."""
    for k, name in enumerate(names):
        record[f"weight_{k}"] = given.get(name, 0)
