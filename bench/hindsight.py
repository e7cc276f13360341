"""What is there to be earned where roads cross? The best of many plans, chosen for every seed after the event.

    python bench/hindsight.py                     prints; a minute or two
    python bench/hindsight.py --write             ... and writes docs/results/hindsight.md
    python bench/hindsight.py --seeds 20 --envs roundabout-v0

A plan is fixed beforehand: FASTER for so many decisions, then SLOWER or IDLE for so many, then FASTER to the end. The
best plan of a seed is what somebody earns who knows the future and changes their mind once; no learner has to reach
it. *Always FASTER* is what learners find who find nothing.
"""

import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tyro
from gymnasium.vector import AutoresetMode, VectorEnv

from rss_shield import make_vec
from rss_shield.eval.files import refuse
from rss_shield.eval.pages import markdown, write_page
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.stats import Interval, bootstrap_mean, wilson

PAGE = Path("docs/results/hindsight.md")
SLOWER, IDLE, FASTER = 0, 1, 2
NUMBERS = {"intersection-v0": (0, 1, 2), "roundabout-v0": (4, 1, 3)}  # of these three actions
FIRST_SEED = 3 * 10**9 // 2  # apart from those of trainings and tests
MOST_BEFORE, LONGEST = 5, 8  # decisions before the change, and until FASTER again
HEADING = ["road", "shield", "plan", "n", "return", "contacts"]
ABOUT = """# With hindsight

Written by `{command}`. Plans fixed beforehand: FASTER, then SLOWER or IDLE for up to {longest} decisions, then FASTER
to the end, {plans} in all. *The best for each seed* is chosen after the event: what somebody would earn who knew the
future and changed their mind once. No agent has to reach it; what lies between it and *always FASTER* is what there is
to learn. Returns: means with 95 % bootstrap intervals over episodes; contacts: Wilson's."""


@dataclasses.dataclass(frozen=True)
class Config:
    """Look for the best plans after the event."""

    envs: tuple[str, ...] = tuple(NUMBERS)
    seeds: int = 500
    write: bool = False  # docs/results/hindsight.md


def plans() -> Iterator[tuple[int, int, int]]:
    """(decisions before, action, decisions it lasts); always FASTER first."""
    yield 0, FASTER, 0
    for before in range(MOST_BEFORE + 1):
        for action in (SLOWER, IDLE):
            for lasts in range(1, LONGEST + 1):
                yield before, action, lasts


def follow(env: VectorEnv, numbers: tuple[int, ...], plan: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """One episode for each environment.

    Args:
      env: without autoreset, one environment a seed, seeds `FIRST_SEED` and up.
      numbers: of SLOWER, IDLE and FASTER.
      plan: as `plans` says them.

    Returns:
      Returns `[E]`, and whether there was a contact, `[E]`.
    """
    before, action, lasts = plan
    count = env.num_envs
    env.reset(seed=list(range(FIRST_SEED, FIRST_SEED + count)))
    returns, hit, over = np.zeros(count), np.zeros(count, bool), np.zeros(count, bool)
    step = 0
    while not over.all():
        now = action if before <= step < before + lasts else FASTER
        _, rewards, terminated, truncated, infos = env.step(np.full(count, numbers[now]))
        returns += np.where(over, 0.0, rewards)
        hit |= ~over & (np.asarray(infos["blame"]) != "")
        over |= terminated | truncated
        step += 1
    return returns, hit


def rows_of(env_id: str, shield: str, count: int) -> list[list[str]]:
    """Always FASTER, the best plan for all seeds alike, and the best for each."""
    env = make_vec(env_id, count, shield=shield, autoreset_mode=AutoresetMode.DISABLED)
    every = list(plans())
    with progress_bar(len(every), f"{env_id}, {shield}", "plan") as bar:
        played = []
        for plan in every:
            played.append(follow(env, NUMBERS[env_id], plan))
            bar.update()
    env.close()
    returns, hits = (np.array(columns) for columns in zip(*played, strict=True))  # [plans, seeds]
    alike = np.full(count, returns.mean(axis=1).argmax())
    chosen = {"always FASTER": 0 * alike, "the best for all": alike, "the best for each seed": returns.argmax(axis=0)}
    seeds = np.arange(count)
    return [
        row([env_id, "on" if shield == "override" else "off", name], returns[plan, seeds], hits[plan, seeds])
        for name, plan in chosen.items()
    ]


def row(what: list[str], returns: np.ndarray, hits: np.ndarray) -> list[str]:
    mean: Interval = bootstrap_mean(returns, np.random.default_rng(0))
    rate = wilson(int(hits.sum()), hits.size)
    percent = f"{100 * rate.value:.1f} % [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"
    return [*what, str(returns.size), f"{mean.value:.2f} [{mean.low:.2f}, {mean.high:.2f}]", percent]


def main(config: Config) -> None:
    unknown = [env_id for env_id in config.envs if env_id not in NUMBERS]
    if unknown or not config.envs:
        raise ValueError(f"--envs {' '.join(unknown)}: expected some of {', '.join(NUMBERS)}")
    if config.seeds < 2:
        raise ValueError(f"--seeds {config.seeds} is out of range: expected at least 2")
    table = [HEADING]
    for env_id in config.envs:
        for shield in ("monitor", "override"):
            table += rows_of(env_id, shield, config.seeds)
    text = markdown(table)
    print(text)
    if config.write:
        words = {"command": " ".join(["python", "bench/hindsight.py", *sys.argv[1:]]), "longest": LONGEST}
        write_page(PAGE, [ABOUT.format(**words, plans=len(list(plans()))), text])


if __name__ == "__main__":
    try:
        main(tyro.cli(Config, prog="bench/hindsight.py", description=__doc__))
    except ValueError as error:
        refuse("bench/hindsight.py", error)
