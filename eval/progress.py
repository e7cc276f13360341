"""Progress bars: alive in a terminal, a line now and then in a log."""

import sys

from tqdm import tqdm


def progress_bar(total: int, description: str, unit: str) -> tqdm:
    every = 0.1 if sys.stderr.isatty() else 15.0  # [s]
    return tqdm(total=total, desc=description, unit=unit, dynamic_ncols=True, mininterval=every, maxinterval=every)


def move_to(bar: tqdm, done: int) -> None:
    """Put the bar at `done`, whatever it showed before."""
    bar.update(done - bar.n)
