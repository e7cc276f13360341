"""Semantic actions beside meta-actions: what drivers and learners earn with either, and what they cost in time.

    python bench/semantic.py                        trains, tests and prints; results in runs/semantic/
    python bench/semantic.py --write                ... and writes docs/results/semantic.md
    python bench/semantic.py --timesteps 2048 --episodes 20 --out runs/semantic-quick     a quick look

Runs are those of `train.py`, one per road, and what is finished is not repeated. Everybody is tested on the same seeds
with the shield and without; learners train behind it. Speeds are measured anew, in this process, one thread.
"""

import dataclasses
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro

from rss_shield import make_vec, train
from rss_shield.eval import drivers
from rss_shield.eval.arms import ARMS, SEMANTIC, Arm
from rss_shield.eval.pages import markdown, write_page
from rss_shield.eval.report import cell_path, read_cell
from rss_shield.eval.rollout import NO_CONTACT
from rss_shield.eval.stats import bootstrap_mean, cluster_bootstrap, wilson
from rss_shield.shield.verdicts import AT_FAULT

PAGE = Path("docs/results/semantic.md")
RAW = ("random", "lazy", "slower", "dqn-shielded")
ON_SEMANTIC = ("semantic-random", "semantic-planner", "semantic-dqn")
LEARNERS = "Learners: {timesteps} decisions behind the shield, seeds {seeds}, tested on {episodes} episodes each. "
HEADING = [
    *("driver", "shield", "n", "return", "success", "the ego's fault", "frames overridden", "change m/s²", "speed m/s"),
]
ABOUT = """\
Written by `{command}`. {learners}Drivers that learn nothing: {episodes} episodes. The same test
seeds for all. Intervals: 95 %; returns of learners over seeds and episodes, all other over episodes. Success: no
contact on the motorway, arrived without contact at the intersection. *Frames overridden*: by a proper response;
*change*: what the shield changed an acceleration by, anticipation included. How they work: [semantic
actions](../semantic.md)."""


@dataclasses.dataclass(frozen=True)
class Config:
    """Compare semantic actions with meta-actions."""

    envs: tuple[str, ...] = ("highway-fast-v0", "intersection-v0")
    arms: tuple[str, ...] = (*RAW, *ON_SEMANTIC)  # who drives
    timesteps: int = 20_000  # decisions per training
    seeds: tuple[int, ...] = (0, 1, 2)
    episodes: int = 300  # per test of a model, or of a driver that learns nothing
    n_envs: int = 32  # side by side in training
    side_by_side: int = 64  # where speed is measured
    decisions: int = 40  # of each of them, likewise
    out: Path = Path("runs/semantic")
    write: bool = False


def run(env_id: str, config: Config) -> Path:
    """Train and test every arm on one road, or go on with it; returns the folder."""
    numbers = {"--total-timesteps": config.timesteps, "--eval-episodes": config.episodes, "--n-envs": config.n_envs}
    fixed = ["--replay-episodes", "0", "--removal-checks", "0", "--workers", "1", "--no-pages"]
    words = ["--env-id", env_id, "--arms", *config.arms, "--seeds", *map(str, config.seeds)]
    words += [word for name, value in numbers.items() for word in (name, str(value))]
    train.main([*words, *fixed, "--runs-dir", str(config.out), "--name", env_id, "--resume-or-start"])
    return config.out / env_id


def rows_of(folder: Path, config: Config) -> list[list[str]]:
    """A row per arm and test."""
    rows = []
    for name in config.arms:
        arm = ARMS[name]
        seeds = config.seeds[:1] if arm.scripted else config.seeds
        for test in arm.tests:
            rows.append(row(arm, test, [read_cell(cell_path(folder, name, seed, test)) for seed in seeds]))
    return rows


def row(arm: Arm, test: str, seeds: list[pd.DataFrame]) -> list[str]:
    """One line of a table; rates and means with 95 % intervals."""
    rng, played = np.random.default_rng(0), pd.concat(seeds)
    success = played["success"] if "success" in played else played["blame"] == NO_CONTACT
    done, count = int(success.sum()), len(played)
    faults = int(played["blame"].isin(AT_FAULT).sum())
    if len(seeds) > 1:
        value, low, high, *_ = cluster_bootstrap([seed["return"] for seed in seeds], rng)
    else:
        value, low, high, *_ = bootstrap_mean(played["return"], rng)
    return [
        arm.label,
        test,
        f"{len(seeds)} x {len(seeds[0])}" if len(seeds) > 1 else str(count),
        f"{value:.2f} [{low:.2f}, {high:.2f}]",
        _rate(done, count),
        _rate(faults, count),
        f"{played['override_share'].mean():.1%}",
        f"{played['mean_acceleration_change'].mean():.2f}",
        f"{played['speed'].mean():.1f}",
    ]


def _rate(k: int, n: int) -> str:
    _, low, high, *_ = wilson(k, n)
    return f"{k / n:.1%} [{low:.1%}, {high:.1%}]"


def speed(env_id: str, semantic: bool, driver: Callable[[int], drivers.Driver], config: Config) -> float:
    """Decisions per second of processor time, the choice included, behind the shield.

    Args:
      driver: number of actions -> policy.
    """
    options: dict[str, Any] = dict(SEMANTIC) if semantic else {}
    env = make_vec(env_id, config.side_by_side, **options)
    policy = driver(int(env.single_action_space.n))
    seen, _ = env.reset(seed=0)
    seen, *_ = env.step(policy(seen))
    begun = time.process_time()
    for _ in range(config.decisions):
        seen, *_ = env.step(policy(seen))
    spent = time.process_time() - begun
    env.close()
    return config.side_by_side * config.decisions / spent


def speeds(env_id: str, config: Config) -> list[list[str]]:
    rng = np.random.default_rng(0)
    measured: tuple[tuple[str, bool, Callable[[int], drivers.Driver]], ...] = (
        ("random meta-actions", False, lambda count: drivers.uniform(count, rng)),
        ("random semantic actions", True, lambda count: drivers.any_valid(rng)),
        ("the best semantic action", True, lambda count: drivers.best_value()),
    )
    return [[env_id, name, f"{speed(env_id, *how, config):,.0f}".replace(",", " ")] for name, *how in measured]


def command_of(config: Config) -> str:
    """The command line that measures the same."""
    words, default = ["python bench/semantic.py --write"], Config()
    for name in ("envs", "arms", "timesteps", "seeds", "episodes", "n_envs", "side_by_side", "decisions"):
        value = getattr(config, name)
        if value != getattr(default, name):
            words += [f"--{name.replace('_', '-')}", *map(str, value if isinstance(value, tuple) else [value])]
    return " ".join(words)


def main(config: Config) -> None:
    folders = {env_id: run(env_id, config) for env_id in config.envs}
    told = {"timesteps": config.timesteps, "seeds": ", ".join(map(str, config.seeds)), "episodes": config.episodes}
    learners = "" if all(ARMS[name].scripted for name in config.arms) else LEARNERS.format(**told)
    about = ABOUT.format(command=command_of(config), learners=learners, episodes=config.episodes)
    parts = ["# Semantic actions beside meta-actions", about]
    for env_id, folder in folders.items():
        parts += [f"## {env_id}", markdown([HEADING, *rows_of(folder, config)])]
    timed = [line for env_id in config.envs for line in speeds(env_id, config)]
    about = f"In the engine, {config.side_by_side} side by side, one thread, behind the shield, processor time."
    parts += ["## Decisions per second", about, markdown([["road", "driver", "decisions/s"], *timed])]
    print("\n\n".join(parts))
    if config.write:
        write_page(PAGE, parts)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config)))
