"""Other filters beside the shield, with drivers that do not care: who crashes, who is to blame, what they earn.

    python bench/filters.py                       the table, on `highway-fast-v0`
    python bench/filters.py --write               ... and between the marks of docs/filters.md
    python bench/filters.py --speed               what a mask costs, in turns with a decision

The same episodes for every row, in the compiled engine; the judge is the same, too.
"""

import dataclasses
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode

from rss_shield import make_vec
from rss_shield.eval.pages import fill, markdown
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.stats import bootstrap_mean, clopper_pearson
from rss_shield.shield.filters.answer import FILTERS

PAGE = Path("docs/filters.md")
FIRST_SEED = 900_000
FASTER, ACTIONS = 3, 5
POLICIES = ("faster", "random")
ROADS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0", "intersection-v0", "roundabout-v0")
WITHOUT: dict[str, Any] = {"shield": "monitor"}
ROWS: dict[str, dict[str, Any]] = {
    "no filter": WITHOUT,
    **{f'`filter="{name}"`': {"filter": name} for name in FILTERS},
    '`filter="ttc", filter_at=4`': {"filter": "ttc", "filter_at": 4.0},
    '`replace="decision"`': {"replace": "decision"},
}


@dataclasses.dataclass(frozen=True)
class Config:
    """Play every filter against every policy."""

    episodes: int = 300  # per row
    write: bool = False  # put the table on its page
    speed: bool = False  # measure masks instead
    rounds: int = 5  # turns, for the speed


def play(policy: str, options: dict[str, Any], episodes: int) -> pd.DataFrame:
    """One row per episode, see `rss_shield.eval.rollout.run_episode`."""
    rng = np.random.default_rng(0)

    def act(observations: np.ndarray) -> np.ndarray:
        count = len(observations)
        return np.full(count, FASTER) if policy == "faster" else rng.integers(ACTIONS, size=count)

    def build(count: int) -> Any:
        return make_vec("highway-fast-v0", count, autoreset_mode=AutoresetMode.DISABLED, **options)

    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    return evaluate(build, act, seeds, n_envs=episodes, keep_actions=False)


def row(name: str, policy: str, played: pd.DataFrame) -> list[str]:
    """One row of the table."""
    rng, count = np.random.default_rng(0), len(played)
    crashed, to_blame = int(played["crashed"].sum()), int(played["blame"].isin(["ego", "both"]).sum())
    _, low, high, *_ = clopper_pearson(crashed, count)
    earned, least, most, *_ = bootstrap_mean(played["return"], rng)
    return [
        policy,
        name,
        f"{crashed / count:.1%} [{low:.1%}, {high:.1%}]",
        f"{to_blame / count:.1%}",
        f"{earned:.1f} [{least:.1f}, {most:.1f}]",
        f"{played['override_share'].mean():.0%}",
    ]


def table(episodes: int) -> str:
    """All rows, as Markdown."""
    heading = ["driver", "filter", "contacts [95 %]", "ego to blame", "return [95 %]", "frames overridden"]
    rows = [row(name, policy, play(policy, options, episodes)) for policy in POLICIES for name, options in ROWS.items()]
    return markdown([heading, *rows]) + f"\n\nn = {episodes} episodes per row, seeds {FIRST_SEED} ff."


def speed(rounds: int) -> None:
    """Microseconds of a mask and of a decision, per environment, with random actions; medians of processor times."""
    for env_id in ROADS:
        env = make_vec(env_id, 512)
        env.reset(seed=0)
        env.action_masks()
        rng, times = np.random.default_rng(0), np.zeros((rounds, 2))
        for turn in range(rounds):
            for _ in range(20):
                start = time.process_time()
                env.action_masks()
                middle = time.process_time()
                env.step(rng.integers(env.single_action_space.n, size=512))
                times[turn] += middle - start, time.process_time() - middle
        mask, decision = np.median(times, axis=0) / (20 * 512) * 1e6
        print(f"{env_id}: mask {mask:.1f} us, decision {decision:.1f} us")


def main(config: Config) -> None:
    if config.speed:
        speed(config.rounds)
        return
    text = table(config.episodes)
    print(text)
    if config.write:
        fill(PAGE, "filters", text)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config)))
