"""Prices that find themselves: what something costs per decision rises until it happens as often as wanted.

A controller with a proportional, an integral and a differential part (Stooke, Achiam & Abbeel, "Responsive safety in
reinforcement learning by PID Lagrangian methods", ICML 2020), once per rollout.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from rss_shield.agents.curve import truncate_curve
from rss_shield.agents.vec_env import VectorEnvAdapter

COLUMNS = (
    "timesteps",  # decisions of all environments together at the end of a rollout
    "measured",  # mean per decision in that rollout
    "target",
    "multiplier",  # from here on: what one unit costs
)


@dataclass
class Pid:
    """multiplier = kp error + integral + kd rise of what is measured, between 0 and `largest`.

    Errors count in units of `scale`, and at most as one: at first, before anything is learnt, what is measured is often
    many times its target, which says nothing about the price that will be needed.
    """

    target: float  # wanted mean per decision
    scale: float  # of the same kind
    kp: float
    ki: float  # the integral moves by at most this much per rollout
    kd: float
    largest: float  # value of the multiplier
    integral: float = 0.0
    measured: float = float("nan")
    multiplier: float = 0.0

    def update(self, measured: float) -> float:
        """The multiplier after a rollout with this mean per decision."""
        error = min(max((measured - self.target) / self.scale, -1.0), 1.0)
        # no windup: what the multiplier cannot become is not remembered
        self.integral = min(max(self.integral + self.ki * error, 0.0), self.largest)
        rise = 0.0 if math.isnan(self.measured) else min(max((measured - self.measured) / self.scale, 0.0), 1.0)
        self.measured = measured
        self.multiplier = min(max(self.kp * error + self.integral + self.kd * rise, 0.0), self.largest)
        return self.multiplier


class Meter:
    """Adds up what infos say, and charges for it.

    Args:
      keys: where the value is, as in `VectorEnvAdapter.told`.
      charges: take multiplier * value off the rewards; else only measure.
    """

    def __init__(self, *keys: str, charges: bool = True) -> None:
        self.keys = keys
        self.charges = charges
        self.multiplier = 0.0
        self.clear()

    def __call__(self, env: VectorEnvAdapter) -> np.ndarray:
        values = np.asarray(env.told(*self.keys), np.float32)
        self.total += float(values.sum())
        self.decisions += len(values)
        return self.multiplier * values if self.charges else np.zeros(len(values), np.float32)

    def read(self) -> float:
        """Mean per decision since the last reading."""
        mean = self.total / self.decisions
        self.clear()
        return mean

    def begin(self) -> None:
        pass

    def clear(self) -> None:
        self.total, self.decisions = 0.0, 0


class MultiplierRecorder(BaseCallback):
    """Moves `model.pid` after every rollout by what the environment's meter has measured.

    It writes a row to `multiplier.csv` beside the learning curve, and tells TensorBoard.

    Args:
      name: of the group in TensorBoard.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.file: TextIO

    def _on_training_start(self) -> None:
        folder = Path(self.model.logger.dir or ".")  # of the model, see `agents.trackers.logger_of`
        path = folder / "multiplier.csv"
        truncate_curve(path, self.num_timesteps, COLUMNS)
        self.file = path.open("a", newline="", encoding="utf-8")
        self._meter.clear()
        self._meter.multiplier = self.model.pid.multiplier  # type: ignore[attr-defined]

    @property
    def _meter(self) -> Meter:
        return self.training_env.charge  # type: ignore[attr-defined]

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        pid: Pid = self.model.pid  # type: ignore[attr-defined]
        self._meter.multiplier = pid.update(self._meter.read())
        csv.writer(self.file).writerow([self.num_timesteps, pid.measured, pid.target, pid.multiplier])
        self.file.flush()
        for key in ("measured", "target", "multiplier"):
            self.logger.record(f"{self.name}/{key}", getattr(pid, key))

    def _on_training_end(self) -> None:
        self.file.close()
