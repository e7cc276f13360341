"""The learning curve: one CSV row per training episode, written while training.

An episode that the end of a block of training cuts off has a row as well: long episodes are cut off more
often than short ones, so rows of the finished ones alone would show too many early ends, that is, crashes.
"""

import csv
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from rss_shield.agents.vec_env import one

NO_CONTACT = "no contact"  # an empty text would come back from a CSV file as a missing value
COLUMNS = (
    "timesteps",  # decisions of all environments together when the episode ended or was cut off
    "started",  # ... and when it began
    "cut",  # 1: the block of training ended first; what the row says is how far the episode got
    "return",  # sum of the environment's rewards, or of one's own; what an agent is charged is not in it
    "length",  # decisions
    "crashed",  # 1: the car touched somebody
    "blame",  # who broke their duty: ego, both, other, inherited, none, or NO_CONTACT
    "override_share",  # share of simulation frames in which the shield overrode the command
    "cost",  # sum of info["cost"]
)


class CurveRecorder(BaseCallback):
    """Appends a row to a CSV file whenever an episode ends or is cut off, and tells TensorBoard the rates.

    TensorBoard gets rates per decision: means over the episodes that happen to end would depend on
    their lengths.

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
        self.lengths = np.zeros(self.training_env.num_envs, int)

    def _on_step(self) -> bool:
        n_envs, rewards, dones = self.training_env.num_envs, self.locals["rewards"], self.locals["dones"]
        self.lengths += 1
        infos = self.locals["infos"]
        ended = [episode_row(self.num_timesteps, n_envs, infos[e]) for e in np.flatnonzero(dones).tolist()]
        if ended:
            self._write(ended)
        self.lengths[dones] = 0
        at_fault = sum(row["blame"] in ("ego", "both") for row in ended)
        self.logger.record_mean("decision/reward", float(np.mean(rewards)))
        self.logger.record_mean("decision/crashes", sum(row["crashed"] for row in ended) / n_envs)
        self.logger.record_mean("decision/crashes_ego_at_fault", at_fault / n_envs)
        self.progress(self.num_timesteps)
        return True

    def _on_training_end(self) -> None:
        env: Any = self.training_env
        unfinished = np.flatnonzero(self.lengths).tolist()
        so_far = ({"episode": {"r": env.returns[e], "l": self.lengths[e]}} for e in unfinished)
        self._write(
            episode_row(self.num_timesteps, env.num_envs, one(env.last_infos, e) | episode, 1)
            for e, episode in zip(unfinished, so_far, strict=True)
        )
        self.file.close()

    def _write(self, rows: Iterable[dict[str, Any]]) -> None:
        csv.writer(self.file).writerows([row[name] for name in COLUMNS] for row in rows)
        self.file.flush()


def episode_row(timesteps: int, n_envs: int, info: dict[str, Any], cut: int = 0) -> dict[str, Any]:
    """The learning-curve row of an episode from the info of its last step, or of its latest if it is cut off."""
    blame = str(info.get("blame", ""))
    length = int(info["episode"]["l"])
    return {
        "timesteps": timesteps,
        "started": timesteps - n_envs * length,
        "cut": cut,
        "return": float(info["episode"]["r"]),
        "length": length,
        "crashed": int(bool(blame) or bool(info.get("crashed", False))),
        "blame": blame or NO_CONTACT,
        "override_share": float(info.get("override_share", 0.0)),
        "cost": float(info.get("episode_cost", 0.0)),
    }


def truncate_curve(path: Path, timesteps: int, columns: Sequence[str] = COLUMNS) -> None:
    """Keep the rows up to `timesteps`, the last checkpoint: what came later will happen again.

    Args:
      path: CSV file; one with a header only is made where there is none.
      timesteps: decisions.
      columns: of the file, "timesteps" among them.
    """
    rows = []
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            # rows past the checkpoint go, and so does a last row that a kill cut short
            whole = (row for row in csv.DictReader(file) if row[columns[-1]])
            rows = [row for row in whole if int(row["timesteps"]) <= timesteps]
    temporary = path.with_name(path.name + ".tmp")
    with open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    os.replace(temporary, path)
