"""The engine beside EnvPool, which has some of highway-env's environments in C++: speed, seeds, episodes, in one run.

`python bench/engine.py --against envpool` runs it; `--write` puts the table on its page.
"""

import importlib
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import rss_shield
from rss_shield.eval.pages import markdown
from rss_shield.eval.stats import clopper_pearson

BATCH = 1024  # environments side by side
FIRST_SEEDS = range(4)
EPISODES = 10  # compared with highway-env's
LONGEST = 60  # decisions of one of them


class Row(NamedTuple):
    """One environment, ours and theirs."""

    env_id: str
    ours: list[float]  # seconds of a core per decision, one entry a turn
    theirs: list[float]
    our_scenes: int  # different first observations of four seeds
    their_scenes: int
    our_equal: int  # episodes that are highway-env's
    their_equal: int


def library(name: str) -> Any:
    """The other library, or None where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        print(f"skipped: {error}; pip install 'rss-shield[{name}]'", file=sys.stderr)
        return None


def measure(envpool: Any, env_id: str, rounds: int, seconds: float) -> Row:
    """Both take turns."""
    ours = _Turns(rss_shield.make_vec(env_id, BATCH, shield=None))
    theirs = _Turns(envpool.make_gymnasium(env_id, num_envs=BATCH, num_threads=1, seed=0))
    for _ in range(rounds):
        ours.take_turn(seconds)
        theirs.take_turn(seconds)
    return Row(
        env_id,
        ours.times,
        theirs.times,
        *(_scenes(start) for start in (_ours(env_id), _theirs(envpool, env_id))),
        *(_equal(env_id, start) for start in (_ours(env_id), _theirs(envpool, env_id))),
    )


class _Turns:
    """A batch that takes random actions when it is its turn."""

    def __init__(self, env: Any) -> None:
        self.env, self.times = env, []  # type: Any, list[float]
        space = env.action_space if hasattr(env.action_space, "n") else env.single_action_space
        self._actions = np.random.default_rng(0).integers(space.n, size=(64, BATCH))
        self.env.reset()
        self._steps = 0
        self.take_turn(0.1)
        self.times.clear()

    def take_turn(self, seconds: float) -> None:
        start, before = time.process_time(), self._steps
        while time.process_time() - start < seconds:
            self.env.step(self._actions[self._steps % len(self._actions)])
            self._steps += 1
        self.times.append((time.process_time() - start) / ((self._steps - before) * BATCH))


# ---------------------------------------------------------------- seeds and episodes

Start = Callable[[int], tuple[np.ndarray, Callable[[int], tuple[np.ndarray, float, bool]]]]


def _ours(env_id: str) -> Start:
    env = rss_shield.make_vec(env_id, 1, shield=None, autoreset_mode="Disabled")

    def start(seed: int):
        seen, _ = env.reset(seed=seed)
        return seen[0], lambda action: _first(env.step(np.array([action])))

    return start


def _theirs(envpool: Any, env_id: str) -> Start:
    def start(seed: int):
        env = envpool.make_gymnasium(env_id, num_envs=1, num_threads=1, seed=seed)
        seen, _ = env.reset()
        return np.array(seen[0]), lambda action: _first(env.step(np.array([action])))

    return start


def _first(outcome: Any) -> tuple[np.ndarray, float, bool]:
    seen, rewards, terminated, truncated, _ = outcome
    return np.array(seen[0]), float(rewards[0]), bool(terminated[0] or truncated[0])


def _scenes(start: Start) -> int:
    return len({start(seed)[0].tobytes() for seed in FIRST_SEEDS})


def _equal(env_id: str, start: Start) -> int:
    """Episodes whose observations, rewards and ends are those of highway-env from the same seed, within 1e-6."""
    stock, equal = rss_shield.make(env_id, shield=None), 0
    for seed in range(EPISODES):
        rng = np.random.default_rng(seed)
        expected, _ = stock.reset(seed=seed)
        seen, step = start(seed)
        same, over, steps = _close(seen, expected), False, 0
        while same and not over and steps < LONGEST:
            action = int(rng.integers(stock.action_space.n))
            expected, reward, terminated, truncated, _ = stock.step(action)
            seen, rewarded, ended = step(action)
            over, steps = terminated or truncated, steps + 1
            # an environment that begins anew in the same step shows the next episode
            same = ended == over and abs(rewarded - reward) < 1e-6 and (over or _close(seen, expected))
        equal += same
    return equal


def _close(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=1e-6))


# ---------------------------------------------------------------- the table


def table(rows: list[Row], name: str, version: str) -> str:
    """The rows as Markdown."""
    lines = [
        [
            f"{BATCH} environments, random actions",
            "engine",
            f"{name} {version}",
            "ratio, median of the turns (all)",
            f"first scenes of {len(FIRST_SEEDS)} seeds",
            "episodes equal to highway-env's (95 %)",
        ]
    ]
    for row in rows:
        ours, theirs = np.array(row.ours), np.array(row.theirs)
        ratios = theirs / ours
        equal = "; ".join(
            f"{who} {count} of {EPISODES} ({_interval(count)})"
            for who, count in (("engine", row.our_equal), (name, row.their_equal))
        )
        lines.append(
            [
                f"`{row.env_id}`",
                f"{1e6 * np.median(ours):.1f} us",
                f"{1e6 * np.median(theirs):.1f} us",
                f"{np.median(ratios):.1f} ({ratios.min():.1f} to {ratios.max():.1f}, n = {len(ratios)})",
                f"engine {row.our_scenes}, {name} {row.their_scenes}",
                equal,
            ]
        )
    return markdown(lines)


def with_rows_of(before: str, table: str) -> str:
    """A table, and below it those rows of an earlier one that it does not measure again."""
    lines = table.splitlines()
    measured = {line.split("|")[1] for line in lines}
    kept = [line for line in before.splitlines() if line.startswith("| `") and line.split("|")[1] not in measured]
    return "\n".join(lines + kept)


def _interval(count: int) -> str:
    interval = clopper_pearson(count, EPISODES)
    return f"{100 * interval.low:.0f} to {100 * interval.high:.0f} %"
