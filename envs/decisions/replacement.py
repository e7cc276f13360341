"""What is done instead of an action that would be answered: the nearest one that would not."""

import numpy as np

from rss_shield.envs.decisions.masks import FASTER, IDLE, LANE_LEFT, LANE_RIGHT, SLOWER

# For each action the others, nearest first. An intent to keep the lane is kept: then the next slower one, the next
# faster one, and the lanes last. A change of lane that is not permitted is not made, and never made the other way
# before all else.
NEAREST = {
    FASTER: (IDLE, SLOWER, LANE_LEFT, LANE_RIGHT),
    IDLE: (SLOWER, FASTER, LANE_LEFT, LANE_RIGHT),
    SLOWER: (IDLE, LANE_LEFT, LANE_RIGHT, FASTER),
    LANE_LEFT: (IDLE, SLOWER, FASTER, LANE_RIGHT),
    LANE_RIGHT: (IDLE, SLOWER, FASTER, LANE_LEFT),
}


def order_of(labels: np.ndarray) -> np.ndarray:
    """`[A, A]`: for each action all actions, itself first, then the nearest.

    Args:
      labels: `[A]` meta-action of each.
    """
    number = {int(label): a for a, label in enumerate(labels)}
    order = [[a, *(number[other] for other in NEAREST[label] if other in number)] for label, a in number.items()]
    return np.array(order, np.int64)


def replace(actions: np.ndarray, masks: np.ndarray, order: np.ndarray) -> np.ndarray:
    """The nearest permitted actions `[E]`.

    Args:
      actions: `[E]` that are asked for.
      masks: `[E, A]`, at least one is True in each row.
      order: see `order_of`.
    """
    ranked = order[actions]
    return ranked[np.arange(len(actions)), np.take_along_axis(masks, ranked, axis=1).argmax(axis=1)]
