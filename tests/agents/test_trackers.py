"""Trackers: what stable-baselines3 logs reaches them, and nothing leaves the machine."""

import importlib.util
import sqlite3

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from rss_shield.agents.trackers import TRACKERS, check_tracker, logger_of


def needs(package):
    missing = importlib.util.find_spec(package) is None
    return pytest.param(package, marks=pytest.mark.skipif(missing, reason=f"{package} is not installed"))


def log(tracker, folder):
    folder.mkdir()
    logger = logger_of(tracker, folder)
    for step in (10, 20):
        logger.record("decision/reward", step / 10)
        logger.record("text", "no number")
        logger.dump(step)
    logger.close()


@pytest.mark.parametrize("tracker", ["tensorboard", needs("wandb"), needs("mlflow")])
def test_numbers_reach_tensorboard_and_the_tracker(tracker, tmp_path, monkeypatch):
    monkeypatch.delenv("WANDB_MODE", raising=False)
    folder = tmp_path / "model"
    log(tracker, folder)
    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    assert [(event.step, event.value) for event in events.Scalars("decision/reward")] == [(10, 1.0), (20, 2.0)]
    if tracker == "wandb":
        assert list((folder / "wandb").glob("offline-run-*/*.wandb"))
    if tracker == "mlflow":
        rows = sqlite3.connect(folder / "mlflow.db").execute("select key, value, step from metrics order by step")
        assert rows.fetchall() == [("decision/reward", 1.0, 10), ("decision/reward", 2.0, 20)]


def test_unknown_trackers_are_refused(tmp_path):
    with pytest.raises(ValueError, match="tracker = 'paper': expected one of tensorboard, wandb, mlflow"):
        logger_of("paper", tmp_path)


@pytest.mark.parametrize("tracker", TRACKERS[1:])
def test_a_tracker_that_is_not_installed_is_named(tracker):
    if importlib.util.find_spec(tracker) is not None:
        pytest.skip("it is installed")
    with pytest.raises(ValueError, match=rf"pip install 'rss-shield\[{tracker}\]'"):
        check_tracker(tracker)
