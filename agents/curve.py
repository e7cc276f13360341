"""The learning curve: one CSV row per training episode, written while training."""

import csv
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from stable_baselines3.common.callbacks import BaseCallback

COLUMNS = (
    "timesteps",  # decisions of all environments together when the episode ended
    "return",  # sum of rewards
    "length",  # decisions
    "crashed",  # 1: the car touched somebody
    "blame",  # who broke their duty: ego, both, other, inherited, none, or empty without contact
    "override_share",  # share of simulation frames in which the shield overrode the command
    "cost",  # sum of info["cost"]
)


class CurveRecorder(BaseCallback):
    """Appends a row to a CSV file whenever an episode ends, and tells TensorBoard the means.

    Args:
      path: CSV file; `truncate_curve` has written its header.
      progress: called after every step with the timesteps done so far.
    """

    def __init__(self, path: Path, progress: Callable[[int], None]):
        super().__init__()
        self.path = path
        self.progress = progress
        self.file: TextIO

    def _on_training_start(self) -> None:
        self.file = self.path.open("a", newline="", encoding="utf-8")

    def _on_step(self) -> bool:
        for done, info in zip(self.locals["dones"], self.locals["infos"], strict=True):
            if done:
                row = episode_row(self.num_timesteps, info)
                csv.writer(self.file).writerow(row[name] for name in COLUMNS)
                self.file.flush()
                for name in ("crashed", "override_share", "cost"):
                    self.logger.record_mean(f"episode/{name}", row[name])
                self.logger.record_mean("episode/ego_at_fault", row["blame"] in ("ego", "both"))
        self.progress(self.num_timesteps)
        return True

    def _on_training_end(self) -> None:
        self.file.close()


def episode_row(timesteps: int, info: dict[str, Any]) -> dict[str, Any]:
    """The learning-curve row of an episode from the info of its last step."""
    blame = info.get("blame", "")
    return {
        "timesteps": timesteps,
        "return": float(info["episode"]["r"]),
        "length": int(info["episode"]["l"]),
        "crashed": int(bool(blame) or bool(info.get("crashed", False))),
        "blame": blame,
        "override_share": float(info.get("override_share", 0.0)),
        "cost": float(info.get("episode_cost", 0.0)),
    }


def truncate_curve(path: Path, timesteps: int) -> None:
    """Keep the rows up to `timesteps`, the last checkpoint: what came later will happen again."""
    rows = []
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            # rows past the checkpoint go, and so does a last row that a kill cut short
            rows = [row for row in csv.DictReader(file) if row["cost"] and int(row["timesteps"]) <= timesteps]
    temporary = path.with_name(path.name + ".tmp")
    with open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    os.replace(temporary, path)
