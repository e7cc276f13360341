"""Speed of the compiled engine against highway-env, side by side in one run.

    python bench/engine.py                                highway-fast-v0, highway-v0, intersection-v0
    python bench/engine.py --growth                       and growth with vehicles, environments, threads
    python bench/engine.py --against envpool --write      beside EnvPool, and between the marks of docs/performance.md

Random actions; observations, infos and autoreset included; one thread, so figures are per core. All
candidates take turns for several rounds, and ratios are medians over the rounds: the speed of a
shared machine changes within seconds.
"""

import dataclasses
import resource
import sys
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from head_to_head import library, measure, table, with_rows_of

import rss_shield
from rss_shield.eval.pages import fill

PAGE = Path("docs/performance.md")
SIZES = (1, 64, 1024, 4096)
VEHICLES = (20, 50, 100, 200, 400)
ENVIRONMENTS = (64, 256, 1024, 4096, 16384)


@dataclasses.dataclass(frozen=True)
class Config:
    """Measure decisions per second."""

    envs: tuple[str, ...] = ("highway-fast-v0", "highway-v0", "intersection-v0")  # which environments
    rounds: int = 5  # turns of every candidate
    seconds: float = 1.0  # of the engine per turn; highway-env gets four times as long
    growth: bool = False  # also measure growth with vehicles, environments and threads
    against: Literal["", "envpool"] = ""  # beside this library instead of highway-env, if it is installed
    write: bool = False  # put that on its page


class Candidate:
    """One vector environment that takes random actions when it is its turn."""

    def __init__(self, env: Any) -> None:
        self.env = env
        self.times: list[float] = []  # seconds per decision, one entry per turn
        self._actions = np.random.default_rng(0).integers(env.single_action_space.n, size=(64, env.num_envs))
        self._steps = 0
        env.reset(seed=0)
        for _ in range(3):
            self._step()

    def _step(self) -> None:
        self.env.step(self._actions[self._steps % len(self._actions)])
        self._steps += 1

    def take_turn(self, seconds: float, clock: Any = time.process_time) -> None:
        """Step for some seconds and note the time that a decision took."""
        start, before = clock(), self._steps
        while clock() - start < seconds:
            self._step()
        self.times.append((clock() - start) / ((self._steps - before) * self.env.num_envs))

    @property
    def microseconds(self) -> float:
        """Time per decision, median over the turns."""
        return 1e6 * float(np.median(self.times))


def against_original(env_id: str, config: Config) -> None:
    """One environment: highway-env, the engine at several sizes, and the engine with the shield."""
    original = Candidate(rss_shield.make_vec(env_id, 1, shield=None, backend="highway-env"))
    engine = {n: Candidate(rss_shield.make_vec(env_id, n, shield=None)) for n in SIZES}
    shielded = {mode: Candidate(rss_shield.make_vec(env_id, 1024, shield=mode)) for mode in ("monitor", "override")}
    for _ in range(config.rounds):
        original.take_turn(4 * config.seconds)
        for candidate in (*engine.values(), *shielded.values()):
            candidate.take_turn(config.seconds)
    print(f"{env_id}: highway-env {1e6 / original.microseconds:.1f} decisions/s per core")
    for n, candidate in engine.items():
        gain = np.median(np.array(original.times) / np.array(candidate.times))
        print(f"  {n:5d} environments: {candidate.microseconds:7.1f} us per decision and core, {gain:6.0f} x")
    for mode, candidate in shielded.items():
        extra = np.median(np.array(candidate.times) / np.array(engine[1024].times)) - 1
        print(f"  1024 with the shield ({mode}): {candidate.microseconds:7.1f} us, {extra:+.0%}")
    sys.stdout.flush()


def growth_with_vehicles(config: Config) -> None:
    """Vehicles at constant density; the exponent is a fit of time against vehicles, both as logarithms."""
    candidates = {
        n: Candidate(rss_shield.make_vec("highway-fast-v0", 64, None, config={"vehicles_count": n})) for n in VEHICLES
    }
    for _ in range(config.rounds):
        for candidate in candidates.values():
            candidate.take_turn(config.seconds)
    times = [candidate.microseconds for candidate in candidates.values()]
    print("vehicles: " + ", ".join(f"{n} {t:.0f} us" for n, t in zip(VEHICLES, times, strict=True)))
    print(f"  exponent {np.polyfit(np.log(VEHICLES), np.log(times), 1)[0]:.2f}", flush=True)


def growth_with_environments(config: Config) -> None:
    """Environments in one batch."""
    candidates = {n: Candidate(rss_shield.make_vec("highway-fast-v0", n, None)) for n in ENVIRONMENTS}
    for _ in range(config.rounds):
        for candidate in candidates.values():
            candidate.take_turn(config.seconds)
    times = {n: candidate.microseconds for n, candidate in candidates.items()}
    print("environments: " + ", ".join(f"{n} {t:.1f} us" for n, t in times.items()), flush=True)


def growth_with_threads(config: Config) -> None:
    """A second thread, by the clock on the wall."""
    candidates = [Candidate(rss_shield.make_vec("highway-fast-v0", 1024, None, threads=threads)) for threads in (1, 2)]
    for _ in range(2 * config.rounds):
        for candidate in candidates:
            candidate.take_turn(config.seconds, time.perf_counter)
    gains = np.array(candidates[0].times) / np.array(candidates[1].times)
    print(f"two threads: {np.median(gains):.2f} x one thread", flush=True)


def beside(config: Config) -> None:
    """The same environments of another library."""
    other = library(config.against)
    if other is None:
        return
    rows = [measure(other, env_id, config.rounds, config.seconds) for env_id in config.envs]
    text = table(rows, "EnvPool", other.__version__)
    print(text)
    if config.write:
        block = PAGE.read_text(encoding="utf-8").split(f"<!-- {config.against} -->")[1].split("<!--")[0]
        fill(PAGE, config.against, with_rows_of(block, text))


def main(config: Config) -> None:
    if config.against:
        return beside(config)
    for env_id in config.envs:
        against_original(env_id, config)
    if config.growth:
        growth_with_vehicles(config)
        growth_with_environments(config)
        growth_with_threads(config)
    print(f"largest memory of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main(tyro.cli(Config, description=__doc__))
