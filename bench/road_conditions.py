"""What wet, snowy and icy roads and other kinds of vehicles cost: required gaps, speeds, returns, and who is at fault.

    python bench/road_conditions.py                     the tables (minutes)
    python bench/road_conditions.py --write             ... and docs/results/road_conditions.md

Always FASTER on `highway-fast-v0`. Stock traffic is played in the compiled engine; compliant traffic, where every other
car has a shield by the same table, on highway-env.
"""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode

from rss_shield import make_vec
from rss_shield.eval.pages import markdown, spaced, write_page
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.stats import bootstrap_mean, clopper_pearson
from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.ground import CLASSES, of_class
from rss_shield.shield.params import PRESETS, ROADS
from rss_shield.shield.verdicts import AT_FAULT

PAGE = Path("docs/results/road_conditions.md")
ENV, FASTER = "highway-fast-v0", 3
FIRST_SEED = 940_000
AT_ONCE = 250  # environments side by side
SPEEDS = (10.0, 20.0, 30.0)  # [m/s]
DT = 1 / 15
PATCH = {(300.0, 400.0): "ice"}  # where the episodes lead through
ROWS: dict[str, dict[str, Any]] = {
    **{name: {"conditions": name} for name in ROADS},
    "dry, ice from 300 to 400 m": {"conditions": PATCH},
    "dry, 30 % trucks, 10 % motorcycles": {"classes": {"truck": 0.3, "motorcycle": 0.1}},
    "snow, 30 % trucks, 10 % motorcycles": {"conditions": "snow", "classes": {"truck": 0.3, "motorcycle": 0.1}},
}
HEADER = """# Results: road conditions and vehicle classes

Written by `python bench/road_conditions.py --write`. What the options mean: [Parameters](../parameters.md).

Friction: dry 0.65 to 0.75, wet 0.50 to 0.60, snow 0.20 to 0.25, ice 0.10 to 0.15 (Noon, Engineering Analysis of
Vehicular Accidents, 1994). Tyres hold the mean of the two in these episodes; relied on is the lower, feared the higher.
Braking of trucks, buses and motorcycles: UN Regulations 13, 13-H and 78."""


@dataclasses.dataclass(frozen=True)
class Config:
    """Play every row."""

    episodes: int = 500  # per row, stock traffic
    compliant: int = 20  # per row, compliant traffic
    write: bool = False  # write the page


def play(options: dict[str, Any], episodes: int, backend: str = "fast") -> pd.DataFrame:
    """One row per episode, see `rss_shield.eval.rollout.run_episode`."""

    def build(count: int) -> Any:
        return make_vec(ENV, count, backend=backend, autoreset_mode=AutoresetMode.DISABLED, **options)

    def act(observations: np.ndarray) -> np.ndarray:
        return np.full(len(observations), FASTER)

    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    at_once = min(episodes, AT_ONCE if backend == "fast" else 1)
    return evaluate(build, act, seeds, n_envs=at_once, keep_actions=False)


def gaps_part() -> str:
    """Required gaps behind somebody as fast, of the ego and of each kind of vehicle behind it."""
    rows: list[Any] = [("road", *(f"{v:g} m/s" for v in SPEEDS), *(f"{name}, 20 m/s" for name in CLASSES))]
    for name in ROADS:
        ego, other = PRESETS[name].ego, PRESETS[name].other
        own = [f"{d_min_same_direction(v, v, ego, other):.1f} m" for v in SPEEDS]
        theirs = [
            f"{d_min_same_direction(20.0, 20.0, of_class(other, kind, DT), ego):.1f} m" for kind in CLASSES.values()
        ]
        rows.append((name, *own, *theirs))
    words = (
        "Def. 1, bumper to bumper: the ego behind somebody as fast (response time 2/15 s), and others behind the ego, "
        "by class (response time 1 s, trucks and buses 1.2 s)."
    )
    return "\n\n".join(["## Required gaps", words, markdown(rows)])


def row(name: str, traffic: str, played: pd.DataFrame) -> tuple[Any, ...]:
    n = len(played)
    rng = np.random.default_rng(0)
    earned, fast = (bootstrap_mean(played[column], rng) for column in ("return", "speed"))
    to_blame, crashed = int(played["blame"].isin(AT_FAULT).sum()), int(played["crashed"].sum())
    _, low, high, *_ = clopper_pearson(to_blame, n)
    inherited = int((played["blame"] == "inherited").sum())
    broken, pairs = int(played["broken_duties"].sum()), int(played["dangerous_pairs"].sum())
    return (
        name,
        traffic,
        n,
        f"{fast.value:.1f} [{fast.low:.1f}, {fast.high:.1f}]",
        f"{earned.value:.1f} [{earned.low:.1f}, {earned.high:.1f}]",
        f"{100 * played['override_share'].mean():.0f} %",
        f"{crashed} ({inherited})" if inherited else crashed,
        f"{to_blame} [{100 * low:.1f} %, {100 * high:.1f} %]",
        f"{spaced(broken)} / {spaced(pairs)}",
    )


def episodes_part(config: Config) -> str:
    measured = "speed [m/s]", "return", "overridden", "contacts (inherited)", "at fault", "broken / in danger"
    rows: list[Any] = [("road", "traffic", "episodes", *measured)]
    for name, options in ROWS.items():
        rows.append(row(name, "stock", play(options, config.episodes)))
        print(*rows[-1], sep=" | ", flush=True)
        if config.compliant:
            compliant = {"traffic": "compliant", **options}
            rows.append(row(name, "compliant", play(compliant, config.compliant, "highway-env")))
            print(*rows[-1], sep=" | ", flush=True)
    words = (
        "Stock drivers keep their distances whatever the road is like, but do no more than its grip admits; compliant "
        "ones, where they are played, go by the same table. *Broken / in danger*: pair-frames on which the ego broke a "
        "duty, of those in danger. In brackets those contacts that were inherited: episodes begin with gaps that would "
        "do on a dry road, from which nobody can brake in time on ice. Means with 95 % intervals of the bootstrap over "
        "episodes, shares at fault with those of Clopper and Pearson."
    )
    return "\n\n".join(["## Episodes", words, markdown(rows)])


def main(config: Config) -> int:
    parts = [gaps_part(), episodes_part(config)]
    if config.write:
        write_page(PAGE, [HEADER, *parts])
    else:
        print("\n\n".join(parts))
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config)))
