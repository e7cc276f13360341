"""A car on an empty road that hits something at a step fixed by the seed, unless it brakes."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics

BRAKE = 1


class FakeEnv(gym.Env):
    """Ten decisions at most. Step t gives reward t; braking (action 1) avoids the crash and is overridden.

    Seed s crashes at decision 3 + s % 5; the verdict is "ego" for even seeds and "inherited" for odd ones.
    """

    observation_space = gym.spaces.Box(-10.0, 10.0, (2,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        super().reset(seed=seed)
        self.seed_used = int(self.np_random.integers(1000)) if seed is None else seed
        self.t = 0
        self.braked = 0
        return self._observation(), self._info("")

    def step(self, action):
        self.t += 1
        self.braked += int(action == BRAKE)
        crash = self.t == 3 + self.seed_used % 5 and action != BRAKE
        blame = ("ego", "inherited")[self.seed_used % 2] if crash else ""
        return self._observation(), float(self.t), crash, self.t == 10, self._info(blame)

    def _observation(self):
        return np.array([float(self.t), float(self.seed_used % 5)])

    def _info(self, blame: str) -> dict[str, Any]:
        return {
            "speed": 20.0 + self.t,
            "crashed": blame == "ego",  # the simulator's flag misses the inherited ones
            "time": self.t / 2,
            "blame": blame,
            "blame_evidence": {"partner": np.int64(4), "excess": 0.5} if blame else {},
            "override_share": self.braked / max(self.t, 1),
            "episode_cost": float(bool(blame)),
            "episode_dangerous_pairs": self.t,
            "episode_broken_duties": int(bool(blame)),
            "min_ttc": 100.0 - self.t,
        }


class FakeEnvWithGoal(FakeEnv):
    """The same road with a goal at its end."""

    def _info(self, blame: str) -> dict[str, Any]:
        return super()._info(blame) | {"is_success": self.t >= 7}


def fake_vec(num_envs: int, autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP) -> SyncVectorEnv:
    """Several of them, as `rss_shield.make_vec` makes them."""
    return SyncVectorEnv([lambda: RecordEpisodeStatistics(FakeEnv())] * num_envs, autoreset_mode=autoreset_mode)


def untouched_vec(num_envs: int) -> SyncVectorEnv:
    """The same without autoreset, for testing."""
    return fake_vec(num_envs, AutoresetMode.DISABLED)


def go(observations):
    return 0 if observations.ndim == 1 else np.zeros(len(observations), int)


def brake(observations):
    return BRAKE if observations.ndim == 1 else np.full(len(observations), BRAKE)
