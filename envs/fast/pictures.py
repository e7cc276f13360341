"""What an environment of the engine looks like: highway-env's own drawing of the engine's state."""

import copy
from typing import Any

import numpy as np

from rss_shield.envs.fast.config import Scenario
from rss_shield.envs.fast.replay import show

MODES = ("rgb_array",)


class Painter:
    """Draws with a stock environment of its own.

    Args:
      scenario: what the engine runs.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._network = scenario.network
        self._env: Any = copy.deepcopy(scenario.stock)
        self._env.render_mode = MODES[0]

    def paint(self, cars: np.ndarray, episode: np.ndarray) -> np.ndarray:
        """Pixels `[H, W, 3]` uint8 of the state `cars` `[N]` CAR, `episode` EPISODE."""
        show(self._env, cars, self._network, episode)
        return self._env.render()

    def close(self) -> None:
        self._env.close()
