"""The engine of this checkout beside that of another one: what a change costs or saves, with the shield and without.

    python bench/checkouts.py --other ../before                    intersection-v0, highway-fast-v0
    python bench/checkouts.py --other ../before --write            and between the marks of docs/performance.md

Each runs in a process of its own, and they take turns: first one, then the other, without a shield and behind it. Only
the time of the processor counts, and every figure is a median over the turns, of ratios within a turn where it is one,
because a shared machine changes its speed all the time. Random actions, 1024 environments, one thread.
"""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from rss_shield.eval.pages import fill, markdown

PAGE, ROOT = Path("docs/performance.md"), Path(__file__).resolve().parents[1]
MODES = ("bare", "monitor", "override")
HEADINGS = ("environment", "turns", "shield", "before", "now", "now / before", "the shield alone, now / before")
# what runs in a checkout: one line of times per line that it is sent [s per decision]
PROGRAM = """
import sys
import time
import numpy as np
import rss_shield
env_id, seconds = sys.argv[1], float(sys.argv[2])
envs = [rss_shield.make_vec(env_id, 1024, shield=mode) for mode in (None, "monitor", "override")]
actions = np.random.default_rng(0).integers(envs[0].single_action_space.n, size=(64, 1024))
for env in envs:
    env.reset(seed=0)
    for one in actions[:3]:
        env.step(one)
print("ready", flush=True)
for _ in sys.stdin:
    times = []
    for env in envs:
        start, steps = time.process_time(), 0
        while time.process_time() - start < seconds:
            env.step(actions[steps % 64])
            steps += 1
        times.append((time.process_time() - start) / steps / 1024)
    print(*times, flush=True)
"""


@dataclasses.dataclass(frozen=True)
class Config:
    """Compare the engines of two checkouts."""

    other: Path  # the other checkout, as it was before
    envs: tuple[str, ...] = ("intersection-v0", "highway-fast-v0")  # which environments
    rounds: int = 7  # turns of each
    seconds: float = 0.5  # of the processor per turn, without a shield and in each mode
    write: bool = False  # put the table on its page


class Checkout:
    """The engine as some checkout has it, in a process of its own."""

    def __init__(self, root: Path, env_id: str, seconds: float) -> None:
        environment = os.environ | {"PYTHONPATH": str(root)}
        self._process: Any = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", PROGRAM, env_id, str(seconds)],
            cwd=root,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._line()

    def take_turn(self) -> list[float]:
        """Seconds per decision without a shield and in each mode."""
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return [float(x) for x in self._line().split()]

    def close(self) -> None:
        self._process.communicate()

    def _line(self) -> str:
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("a checkout's process has ended; it says why")
        return str(line)


def compare(env_id: str, config: Config) -> list[list[str]]:
    """The lines of one environment."""
    checkouts = [Checkout(root, env_id, config.seconds) for root in (config.other.resolve(), ROOT)]
    times = np.array([[one.take_turn() for one in checkouts] for _ in range(config.rounds)])  # [turn, checkout, mode]
    for one in checkouts:
        one.close()
    return rows(env_id, times)


def rows(env_id: str, times: np.ndarray) -> list[list[str]]:
    """Lines of the table. times: `[T, 2, 3]` seconds per decision, before and now, in each of `MODES`."""
    before, now = times[:, 0], times[:, 1]
    lines = []
    for m, mode in enumerate(MODES):
        alone = (now[:, m] - now[:, 0]) / (before[:, m] - before[:, 0]) if m else None
        lines.append(
            [
                f"`{env_id}`",
                str(len(times)),
                mode if m else "none",
                f"{1e6 * np.median(before[:, m]):.1f} us",
                f"{1e6 * np.median(now[:, m]):.1f} us",
                _spread(now[:, m] / before[:, m]),
                "" if alone is None else _spread(alone),
            ]
        )
    return lines


def _spread(ratios: np.ndarray) -> str:
    """Median, and the quartiles in brackets."""
    low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def main(config: Config) -> None:
    lines: list[Any] = [HEADINGS]
    for env_id in config.envs:
        lines += compare(env_id, config)
    text = markdown(lines)
    print(text)
    if config.write:
        fill(PAGE, "checkouts", text)


if __name__ == "__main__":
    main(tyro.cli(Config, description=__doc__))
