"""A task with training: one arm, one seed, one set of options, as `rss-shield train` does it."""

import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

from rss_shield import train
from rss_shield.eval.runs.experiment import training_words
from rss_shield.eval.runs.store import Files
from rss_shield.eval.suite.comparison.options import COMMAND
from rss_shield.eval.suite.comparison.reading import resolve, started
from rss_shield.eval.suite.comparison.trying import tried

_KEPT = ("learning_curve.csv", "removal_curve.csv", "model.zip", "card.json", "README.md")


def trained_task(config: dict[str, Any]) -> Files:
    """The test episodes of a task, its curves, its model, and all options of its run.

    Raises:
      ValueError: options that training refuses.
    """
    with tempfile.TemporaryDirectory() as folder:
        arguments = [*arguments_of(config), "--runs-dir", folder, "--name", "run", "--workers", "1"]
        _quietly(train.main, arguments)
        run = Path(folder) / "run"
        model = run / f"{config['arm']}-seed{config['seed']}"
        paths = [run / "config.json", run / "episodes.csv", *(model / name for name in _KEPT)]
        return {path.name: path.read_bytes() for path in paths if path.exists()}


def check_trained(config: dict[str, Any]) -> None:
    """Refuse what training would refuse, before anything runs."""
    _quietly(_tried, arguments_of(config))


def _tried(arguments: list[str]) -> None:
    options, _ = started(arguments)
    try:
        tried(options, resolve(options))
    except ValueError:
        raise
    except Exception as error:
        raise ValueError(f"{type(error).__name__}: {error} ({options.env_id})") from error


def arguments_of(config: dict[str, Any]) -> list[str]:
    """The command line of a task."""
    tests, options = {name: config[name] for name in ("episodes", "first_seed")}, config["options"]
    words = training_words(config["environment"], [config["arm"]], [config["seed"]], tests, options)
    return [*words, "--replay-episodes", "0"]


def _quietly(call: Any, arguments: list[str]) -> None:
    """Call without its print-outs; a refusal is a ValueError with what it says."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            call(arguments)
    except SystemExit:
        raise ValueError(said.getvalue().strip().removeprefix(f"{COMMAND}: error: ")) from None
