"""Progress bars: alive in a terminal, a line now and then in a log."""

import sys

from tqdm import tqdm


def progress_bar(total: int, description: str, unit: str) -> tqdm:
    alive = sys.stderr.isatty()
    every = 0.1 if alive else 15.0  # [s]
    return tqdm(
        total=total,
        desc=description,
        unit=unit,
        dynamic_ncols=True,
        mininterval=every,
        maxinterval=every,
        position=None if alive else 0,  # in a log, no bar goes up to its own line
    )


def move_to(bar: tqdm, done: int) -> None:
    """Put the bar at `done`, whatever it showed before."""
    bar.update(done - bar.n)
