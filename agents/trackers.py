"""Where the numbers of a training go, beside the learning curve: TensorBoard, Weights & Biases, MLflow.

Nothing leaves the machine: Weights & Biases is offline (`wandb sync` sends its folder), MLflow writes a database into
the folder of the model (`mlflow ui --backend-store-uri sqlite:///.../mlflow.db`).
"""

import os
from importlib import import_module
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat

TRACKERS = ("tensorboard", "wandb", "mlflow")
PROJECT = "rss-shield"


def logger_of(tracker: str, folder: Path) -> Logger:
    """A logger of stable-baselines3 that writes TensorBoard events, and what else is asked for.

    Args:
      tracker: one of TRACKERS.
      folder: of the model; its last two names are that of the run.

    Raises:
      ValueError: an unknown tracker, or one that is not installed.
    """
    if tracker not in TRACKERS:
        raise ValueError(f"tracker = {tracker!r}: expected one of {', '.join(TRACKERS)}")
    outputs: list[KVWriter] = [TensorBoardOutputFormat(str(folder / "tensorboard"))]
    if tracker != "tensorboard":
        outputs.append({"wandb": _Wandb, "mlflow": _Mlflow}[tracker](folder))
    return Logger(str(folder), outputs)


def check_tracker(tracker: str) -> None:
    """Is it installed?

    Raises:
      ValueError: no.
    """
    if tracker != "tensorboard":
        _package(tracker)


def _package(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise ValueError(f"tracker = {name!r} needs the package {name}: pip install 'rss-shield[{name}]'") from None


def _scalars(values: dict[str, Any], excluded: dict[str, tuple[str, ...]], output: str) -> dict[str, float]:
    return {
        name: float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and output not in (excluded.get(name) or ())
    }


class _Wandb(KVWriter):
    """An offline run of Weights & Biases in `wandb/`; a training that goes on goes on with it."""

    def __init__(self, folder: Path) -> None:
        os.environ.setdefault("WANDB_MODE", "offline")
        os.environ.setdefault("WANDB_SILENT", "true")
        name = "-".join(folder.parts[-2:])
        self.run = _package("wandb").init(project=PROJECT, name=name, id=name, dir=str(folder), resume="allow")

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        self.run.log({**_scalars(key_values, key_excluded, "wandb"), "timesteps": step})

    def close(self) -> None:
        self.run.finish()


class _Mlflow(KVWriter):
    """A run in `mlflow.db`."""

    def __init__(self, folder: Path) -> None:
        mlflow = _package("mlflow")
        self.client = mlflow.MlflowClient(tracking_uri=f"sqlite:///{folder.resolve() / 'mlflow.db'}")
        found = self.client.get_experiment_by_name(PROJECT)
        where = (folder / "mlflow").resolve().as_uri()
        experiment = found.experiment_id if found else self.client.create_experiment(PROJECT, artifact_location=where)
        self.run = self.client.create_run(experiment, run_name="-".join(folder.parts[-2:])).info.run_id

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        for name, value in _scalars(key_values, key_excluded, "mlflow").items():
            self.client.log_metric(self.run, name, value, step=step)

    def close(self) -> None:
        self.client.set_terminated(self.run)
