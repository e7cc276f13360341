"""How far the ego comes at an intersection: arrivals, delays and crashes, and what intent is worth.

    python bench/junctions.py                               every table, results in runs/junctions/
    python bench/junctions.py --tables progress --policies faster --durations 30
    python bench/junctions.py --episodes 100 --paired 200   a quick look
    python bench/junctions.py --write                       nothing is played: docs/results/junctions.md from all
                                                            that has been

*Progress*: every combination of entry, waiting and duration, beside the same traffic without a shield.
*Intent*: the same seeds with intent known, assumed straight, and unknown. *Examined*: the same seeds with
plans checked against fewer and fewer road users (`shield.junctions.examined`). An episode arrives if it ends
behind the intersection without a contact; "stuck" are the ones that ran out of time while a wreck or a
standing car was in the way of the ego's path ahead. Episodes run in the compiled engine; a case whose
file is there already is not played again.
"""

import dataclasses
import itertools
import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode
from rich.console import Console
from rich.table import Table

from rss_shield import make_vec
from rss_shield.envs.roads.network import local_coordinates
from rss_shield.eval.files import atomic
from rss_shield.eval.pages import markdown, write_page
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.stats import Interval, bootstrap_mean, paired_difference, wilson
from rss_shield.shield.junctions.examined import EXAMINED
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.obstacles import block
from rss_shield.shield.junctions.plans import INTENTS, NEVER, Track
from rss_shield.shield.junctions.reach import THREAT
from rss_shield.shield.verdicts import AT_FAULT, BLAMES

ENV_ID = "intersection-v0"
FASTER, ACTIONS = 2, 3  # SLOWER, IDLE, FASTER
STANDING = 0.5  # slower than this a car stands [m/s]
SIDE_BY_SIDE = 256  # environments in the engine
POLICIES, TABLES = ("faster", "random"), ("progress", "intent", "examined")


class Case(NamedTuple):
    """One policy under one shield."""

    shield: str = "override"  # or "monitor": not shielded, only watched
    policy: str = "faster"
    entry: str = "cautious"
    waiting: str = "line"
    intent: str = "known"
    duration: int = 13  # [s]
    examine: str = "table"

    @property
    def name(self) -> str:
        return "-".join(map(str, self[:-1])) + ("" if self.examine == "table" else f"-{self.examine}")


UNSHIELDED = Case("monitor")


@dataclasses.dataclass(frozen=True)
class Config:
    """Drive through intersections and count who arrives."""

    tables: tuple[str, ...] = ()  # "progress", "intent", "examined"; all, or none with --write
    policies: tuple[str, ...] = POLICIES  # of the table of progress: "faster", "random"
    durations: tuple[int, ...] = (13, 30)  # of an episode, likewise [s]
    episodes: int = 1000  # per row of the table of progress
    paired: int = 2000  # per row of the others
    paired_duration: int = 30  # of an episode there [s]
    n_workers: int = 2  # threads of the engine
    out: Path = Path("runs/junctions")  # one CSV per case
    write: bool = False  # the page of results, from the files in `out`


# ---------------------------------------------------------------- episodes


def played(case: Case, count: int, config: Config) -> pd.DataFrame:
    """All episodes of one case, from its file if that is there already."""
    there = found(case, count, config)
    if there is not None:
        return there
    frame = play(case, count, config.n_workers)
    config.out.mkdir(parents=True, exist_ok=True)
    with atomic(_path(case, count, config)) as temporary:
        frame.to_csv(temporary, index=False)
    return frame


def found(case: Case, count: int, config: Config) -> pd.DataFrame | None:
    """All episodes of one case, if they have been played."""
    path = _path(case, count, config)
    return pd.read_csv(path, keep_default_na=False) if path.exists() else None


def _path(case: Case, count: int, config: Config) -> Path:
    return config.out / f"{case.name}-{count}.csv"


def play(case: Case, count: int, threads: int) -> pd.DataFrame:
    """Seeds 0 to `count` - 1 of one case. Random actions come from one generator for all."""
    rng = np.random.default_rng(0)

    def make_batch(n: int) -> Any:
        conduct = {"entry": case.entry, "intent": case.intent, "waiting": case.waiting}
        options = {"config": {"duration": case.duration}, "threads": threads, "examine": case.examine} | conduct
        return make_vec(ENV_ID, n, case.shield, autoreset_mode=AutoresetMode.DISABLED, **options)

    def act(observations: np.ndarray) -> np.ndarray:
        n = len(observations)
        return np.full(n, FASTER) if case.policy == "faster" else rng.integers(ACTIONS, size=n)

    with progress_bar(count, case.name, "episode") as bar:
        return evaluate(
            make_batch,
            act,
            range(count),
            n_envs=min(SIDE_BY_SIDE, count),
            keep_actions=False,
            progress=lambda done: bar.update(done - bar.n),
            more=how_it_ended,
        ).drop(columns="actions")


def how_it_ended(env: Any, e: int) -> dict[str, Any]:
    """Columns of an episode that has just ended.

    arrived: behind the intersection without a contact; in_way: something stands on the path ahead;
    frames, trapped_frames: watched, and on which no plan stayed clear of everybody;
    pairs_examined, pairs_possible: pair-frames on which plans were checked against somebody, and all.
    """
    info, episode = env.info(e), env.engine.batch.episodes[e]
    contact = bool(info["crashed"] or info["blame"])
    return {
        "arrived": bool(info["rewards"]["arrived_reward"]) and not contact,
        "in_way": is_in_way(env.engine, e),
        "frames": int(episode["frames"]),
        "trapped_frames": int(episode["frames_trapped"]),
        "pairs_examined": int(episode["pairs_examined"]),
        "pairs_possible": int(episode["pairs_possible"]),
    }


def is_in_way(engine: Any, e: int) -> bool:
    """Does a wreck or a standing car overlap what the ego is going to sweep on its path?"""
    episode, cars, ways = engine.batch.episodes[e], engine.batch.cars[e], engine.world.ways
    ego, roads = cars[episode["ego"]], ways.roads
    lane = ego["target_lane"]
    path = roads.choices[ways.choice[ego["route"], lane], 0]
    s = roads.paths.offset[path, lane] + local_coordinates(roads.lanes[lane], ego["x"], ego["y"])[0]
    ahead = Track(path, s + 0.5 * ego["length"], 0.0, 0.5 * ego["length"], -1, 0.0)
    for k in range(episode["cars"]):
        car = cars[k]
        if k == episode["ego"] or not (car["crashed"] or abs(car["speed"]) < STANDING):
            continue
        box = (car["x"], car["y"], np.cos(car["heading"]), np.sin(car["heading"]), car["length"] / 2, car["width"] / 2)
        threat = np.zeros(1, THREAT)[0]
        block(roads.paths, ahead, np.array(box), threat)
        if threat["from_cell"] != NEVER:
            return True
    return False


# ---------------------------------------------------------------- rows


def contacts(frame: pd.DataFrame) -> list[str]:
    """Contacts, how many by each verdict, and what the others and the ego broke in them."""
    by_verdict = [int((frame["blame"] == verdict).sum()) for verdict in BLAMES]
    evidence = [grounds for grounds in map(json.loads, frame["evidence"]) if grounds]
    broken = [counted([grounds[duty] for grounds in evidence]) for duty in ("other_duty", "ego_duty")]
    return [str(int(frame["crashed"].sum())), "/".join(map(str, by_verdict)), *broken]


def counted(duties: list[str]) -> str:
    """How often each duty was broken, the most frequent first."""
    return ", ".join(f"{count} {duty.split(' [')[0]}" for duty, count in Counter(duties).most_common() if duty)


def at_fault(frame: pd.DataFrame) -> str:
    k = int(frame["blame"].isin(AT_FAULT).sum())
    return f"{k} (< {100 * wilson(k, len(frame)).high:.2g} %)"


def is_stuck(frame: pd.DataFrame) -> pd.Series:
    """Ran out of time with something in the way."""
    return frame["in_way"] & ~frame["arrived"] & ~frame["crashed"]


def progress_row(case: Case, frame: pd.DataFrame) -> list[str]:
    """One line of the table of progress."""
    arrived, n = frame["arrived"], len(frame)
    stuck = is_stuck(frame)
    free = wilson(int(arrived.sum()), int(n - stuck.sum()))
    shielded = case.shield == "override"
    return [
        case.policy,
        f"{case.duration} s",
        case.entry if shielded else "no shield",
        case.waiting if shielded else "",
        percent(wilson(int(arrived.sum()), n)),
        f"{frame.loc[arrived, 'length'].mean():.1f} s",
        *contacts(frame),
        at_fault(frame),
        f"{100 * frame['override_share'].mean():.0f} %" if shielded else "",
        f"{frame['trapped_frames'].sum()} / {frame['frames'].sum()}" if shielded else "",
        str(int(stuck.sum())),
        percent(free),
    ]


def intent_row(case: Case, frame: pd.DataFrame, known: pd.DataFrame, bare: pd.DataFrame) -> list[str]:
    """One line of the table of intents. known, bare: the same seeds with intent known, and without a shield."""
    arrived = frame["arrived"]
    return [
        case.intent,
        percent(wilson(int(arrived.sum()), len(frame))),
        percent(paired_difference(arrived, known["arrived"], np.random.default_rng(0)), signed=True),
        f"{frame.loc[arrived, 'length'].mean():.1f} s",
        delay(frame, bare),
        delay(frame, known),
        *contacts(frame),
        at_fault(frame),
        f"{100 * frame['override_share'].mean():.0f} %",
        str(int(is_stuck(frame).sum())),
    ]


def examined_row(case: Case, frame: pd.DataFrame, everybody: pd.DataFrame) -> list[str]:
    """One line of the table of who is examined. everybody: the same seeds with nobody left out."""
    arrived = frame["arrived"]
    examined, possible, frames = (int(frame[name].sum()) for name in ("pairs_examined", "pairs_possible", "frames"))
    changed = (frame[["return", "length", "blame"]] != everybody[["return", "length", "blame"]]).any(axis=1)
    return [
        case.examine,
        f"{examined / frames:.2f}",
        f"{possible / frames:.2f}",
        f"{100 * examined / possible:.1f} %",
        str(int(changed.sum())),
        percent(wilson(int(arrived.sum()), len(frame))),
        percent(paired_difference(arrived, everybody["arrived"], np.random.default_rng(0)), signed=True),
        *contacts(frame),
        at_fault(frame),
        f"{100 * frame['override_share'].mean():.0f} %",
    ]


def delay(frame: pd.DataFrame, baseline: pd.DataFrame) -> str:
    """How much later episodes arrive than the same seeds in `baseline`, where both do."""
    if (frame["seed"] != baseline["seed"]).any():
        raise ValueError("seeds differ: expected the same ones in the same order")
    both = frame["arrived"] & baseline["arrived"]
    later = bootstrap_mean(frame.loc[both, "length"] - baseline.loc[both, "length"], np.random.default_rng(0))
    return f"{later.value:+.2f} [{later.low:+.2f}, {later.high:+.2f}] s ({later.n})"


def percent(rate: Interval, signed: bool = False) -> str:
    form = "+.1f" if signed else ".1f"
    return f"{100 * rate.value:{form}} [{100 * rate.low:{form}}, {100 * rate.high:{form}}] %"


# ---------------------------------------------------------------- tables


CONTACTS = ("contacts", "ego/both/other/inherited/none", "what others broke", "what the ego broke", "at fault")


Look = Callable[[Case, int, Config], pd.DataFrame | None]  # `played`, or `found`: only what is there


def progress_table(config: Config, look: Look = played) -> Table:
    columns = ("policy", "time", "entry", "waiting", "arrived", "after", *CONTACTS, "overridden", "trapped frames")
    table = Table(*columns, "stuck", "arrived of the rest", title=f"Progress, intent known, n = {config.episodes}")
    for policy, duration in itertools.product(config.policies, config.durations):
        conduct = itertools.product(ENTRIES, ("line", "anywhere"))
        cases = [Case(policy=policy, entry=entry, waiting=waiting, duration=duration) for entry, waiting in conduct]
        for case in [*cases, UNSHIELDED._replace(policy=policy, duration=duration)]:
            frame = look(case, config.episodes, config)
            if frame is not None:
                table.add_row(*progress_row(case, frame))
        table.add_section()
    return table


def intent_table(config: Config, look: Look = played) -> Table:
    columns = ("intent", "arrived", "more than known", "after", "later than without a shield", "later than known")
    title = f"Intent, entry cautious, policy faster, {config.paired_duration} s, the same {config.paired} seeds"
    table = Table(*columns, *CONTACTS, "overridden", "stuck", title=title)
    cases = [Case(intent=intent, duration=config.paired_duration) for intent in INTENTS]
    frames = [look(case, config.paired, config) for case in cases]
    known, bare = frames[0], look(UNSHIELDED._replace(duration=config.paired_duration), config.paired, config)
    if known is None or bare is None:
        return table
    for case, frame in zip(cases, frames, strict=True):
        if frame is not None:
            table.add_row(*intent_row(case, frame, known, bare))
    return table


def examined_table(config: Config, look: Look = played) -> Table:
    columns = ("examined", "pairs per frame", "of", "share", "episodes changed", "arrived", "more than all", *CONTACTS)
    title = f"Who is examined, entry cautious, intent known, policy faster, the same {config.paired} seeds"
    table = Table(*columns, "overridden", title=title)
    everybody = look(Case(examine="all", duration=config.paired_duration), config.paired, config)
    if everybody is None:
        return table
    for name in EXAMINED:
        case = Case(examine=name, duration=config.paired_duration)
        frame = look(case, config.paired, config)
        if frame is not None:
            table.add_row(*examined_row(case, frame, everybody))
    return table


MAKERS = {"progress": progress_table, "intent": intent_table, "examined": examined_table}
LEGEND = """Rates: 95 % Wilson intervals; differences and delays: paired, 95 % bootstrap intervals, in brackets the
number of pairs; at fault: upper end of the interval; trapped frames: no plan stayed clear of everybody."""


# ---------------------------------------------------------------- page


PAGE = Path("docs/results/junctions.md")
HEADER = """# How far the ego comes at an intersection

Written by `python bench/junctions.py --write` from what its other calls have played.

`intersection-v0` in the compiled engine, the ego turns left with the lowest right of way. An episode arrives if it ends
behind the intersection without a contact. *Stuck* are those that ran out of time while a wreck or a standing car was in
the way. Contacts are listed by verdict: ego / both / other / inherited / none."""


def write(config: Config, root: Path = Path()) -> None:
    """Write the page of results below `root`; what has not been played is left out."""
    parts = [HEADER, LEGEND]
    for name, make_table in MAKERS.items():
        table = make_table(config, found)
        if table.row_count:
            rows = zip(*(column.cells for column in table.columns), strict=True)
            size = f"--episodes {config.episodes}" if name == "progress" else f"--paired {config.paired}"
            command = f"```sh\npython bench/junctions.py --tables {name} {size}\n```"
            parts += [f"## {table.title}", markdown([[column.header for column in table.columns], *rows]), command]
    write_page(root / PAGE, parts)


# ---------------------------------------------------------------- main


def main(config: Config) -> int:
    tables = config.tables or (() if config.write else TABLES)
    for name, given, known in (("tables", tables, MAKERS), ("policies", config.policies, POLICIES)):
        unknown = [value for value in given if value not in known]
        if unknown:
            print(f"{name} = {unknown[0]!r}: expected some of {', '.join(known)}", file=sys.stderr)
            return 2
    console = Console(width=240)
    for name in tables:
        console.print(MAKERS[name](config))
    if tables:
        print(LEGEND)
    if config.write:
        write(config)
        print(f"written: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
