"""Scripted policies. What they do depends on the episode's seed alone, so settings are compared on the same actions."""

from difflib import get_close_matches
from typing import Any

import numpy as np
from gymnasium import spaces

from rss_shield.eval.own import function_named, is_own

POLICIES = ("random", "faster", "idle", "slower", "lanes", "continuous", "full-throttle")
_META = {  # number of meta-actions -> where each is
    5: {"LANE_LEFT": 0, "IDLE": 1, "LANE_RIGHT": 2, "FASTER": 3, "SLOWER": 4},
    3: {"SLOWER": 0, "IDLE": 1, "FASTER": 2},  # where nobody changes lanes
}


def check_policy(name: str) -> None:
    """Is it one of POLICIES, or a function of the user's own, `module:function`?

    Raises:
      ValueError: neither.
    """
    if is_own(name):
        function_named(name)
    elif name not in POLICIES:
        nearest = get_close_matches(name, POLICIES, n=1, cutoff=0.0)[0]
        raise ValueError(
            f"policy = {name!r}: the nearest is {nearest!r}; expected one of {', '.join(POLICIES)}, or module:function"
        )


class Scripted:
    """A policy on one episode.

    Args:
      name: one of POLICIES.
      space: of one agent's actions.
      seed: of the episode.

    Raises:
      ValueError: an unknown policy, or one that has no such actions.
    """

    def __init__(self, name: str, space: spaces.Space, seed: int) -> None:
        check_policy(name)
        continuous = name in ("continuous", "full-throttle")
        labels = _META.get(int(space.n)) if isinstance(space, spaces.Discrete) else None
        if continuous != isinstance(space, spaces.Box) or (not continuous and labels is None):
            raise ValueError(f"policy = {name!r}: not for the actions {space}")
        if name == "lanes" and labels is not None and "LANE_LEFT" not in labels:
            raise ValueError("policy = 'lanes': expected an environment where lanes are changed")
        self.name, self.space, self.labels = name, space, labels
        self.rng = np.random.default_rng(seed)

    def __call__(self, observation: Any = None) -> Any:
        """The next action."""
        if self.labels is None:
            action = self.rng.uniform(-1.0, 1.0, self.space.shape).astype(np.float32)
            if self.name == "full-throttle":
                action[0] = 1.0
            return action
        if self.name == "random":
            return int(self.rng.integers(len(self.labels)))
        if self.name == "lanes":
            return self.labels["LANE_LEFT" if self.rng.random() < 0.5 else "LANE_RIGHT"]
        return self.labels[self.name.upper()]
