"""Work that workers do in tests: some of it kills the worker once, or always, or fails."""

import os
import signal
from functools import partial
from pathlib import Path
from typing import Any


def double(config: dict[str, Any]) -> dict[str, bytes]:
    if config["value"] < 0:
        raise ArithmeticError(f"value = {config['value']}")
    return {"double.txt": str(2 * config["value"]).encode()}


def double_or_die(folder: str, deadly: int, times: int, config: dict[str, Any]) -> dict[str, bytes]:
    """The worker dies on one task, so many times."""
    if config["value"] == deadly:
        _die(Path(folder), times)
    return double(config)


def task_or_die(folder: str, policy: str, config: dict[str, Any]) -> dict[str, bytes]:
    """A real task; the worker dies on the first of a policy."""
    if config["policy"] == policy:
        _die(Path(folder), 1)
    from rss_shield.eval.suite.sweep import do_task  # here: what only doubles numbers starts at once

    return do_task(config)


def _die(folder: Path, times: int) -> None:
    for number in range(times):
        try:
            (folder / f"died-{number}").touch(exist_ok=False)
        except FileExistsError:
            continue
        os.kill(os.getpid(), signal.SIGKILL)


def dying(folder: Path, deadly: int, times: int):
    return partial(double_or_die, str(folder), deadly, times)
