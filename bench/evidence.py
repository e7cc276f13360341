"""The claim, tested: whatever the policy, the ego is never to blame.

    python bench/evidence.py                     every case on the original simulator, results in runs/evidence/
    python bench/evidence.py --cases fast-random fast-faster --episodes 50
    python bench/evidence.py --modes monitor     the same policies without the shield
    python bench/evidence.py --backend fast --cases fast-random fast-faster fast-continuous --episodes 100000
                                                 in the compiled engine
    python bench/evidence.py --write             nothing is played: docs/results/evidence.md and the README's table
                                                 from all that has been

Each case plays scripted policies on seeds 0, 1, ... and prints one row: contacts by verdict, the
upper end of the 95 % interval for "ego at fault", the audit of every dangerous pair-frame, return
and speed. A case whose file is there already is not played again.
"""

import dataclasses
import itertools
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode
from rich.console import Console
from rich.table import Table

import rss_shield.envs.worlds.random_roads
from rss_shield import make, make_vec
from rss_shield.envs.highway.drivers import RECKLESS
from rss_shield.eval.files import atomic
from rss_shield.eval.pages import fill, markdown, spaced, write_page
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.rollout import evaluate, run_episode
from rss_shield.eval.stats import bootstrap_mean, wilson
from rss_shield.shield.verdicts import AT_FAULT, BLAMES

LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER = range(5)
AT_INTERSECTIONS = {SLOWER: 0, IDLE: 1, FASTER: 2}  # where nobody changes lanes
CONTINUOUS = {"action": {"type": "ContinuousAction"}}
SIDE_BY_SIDE = 1024  # environments in the engine


class Case(NamedTuple):
    """One scripted policy in one environment."""

    env_id: str
    policy: str
    episodes: int
    config: dict[str, Any]
    options: dict[str, str] = {}  # noqa: RUF012  of `rss_shield.make`, never changed


def act(policy: str, rng: np.random.Generator, actions: int = 5) -> Any:
    """The next action of a scripted policy.

    Args:
      actions: how many meta-actions there are.
    """
    if actions == 3 and policy in ("faster", "idle", "slower"):
        return AT_INTERSECTIONS[act(policy, rng)]
    match policy:
        case "random":
            return int(rng.integers(actions))
        case "faster":
            return FASTER
        case "idle":
            return IDLE
        case "slower":
            return SLOWER
        case "lanes":
            return LANE_LEFT if rng.random() < 0.5 else LANE_RIGHT
        case "continuous":
            return rng.uniform(-1.0, 1.0, 2)
        case "full-throttle":
            return np.array([1.0, rng.uniform(-1.0, 1.0)])
    raise ValueError(f"policy = {policy!r} is unknown")


def act_batch(policy: str, rng: np.random.Generator, n: int, actions: int = 5) -> Any:
    """The next actions of a scripted policy in n environments."""
    match policy:
        case "random":
            return rng.integers(actions, size=n)
        case "lanes":
            return np.where(rng.random(n) < 0.5, LANE_LEFT, LANE_RIGHT)
        case "continuous":
            return rng.uniform(-1.0, 1.0, (n, 2)).astype(np.float32)
        case "full-throttle":
            return np.column_stack([np.ones(n), rng.uniform(-1.0, 1.0, n)]).astype(np.float32)
    return np.full(n, act(policy, rng, actions))


def actions(case: Case) -> int:
    """How many meta-actions there are."""
    return 3 if "intersection" in case.env_id else 5


def _cases() -> dict[str, Case]:
    cases = {}
    for name, env_id, episodes in (
        ("fast", "highway-fast-v0", 300),
        ("highway", "highway-v0", 100),
        ("merge", "merge-v0", 100),
        ("two-way", "two-way-v0", 100),
        ("exit", "exit-v0", 100),
    ):
        for policy in ("random", "faster", "idle"):
            cases[f"{name}-{policy}"] = Case(env_id, policy, episodes, {})
    cases["fast-slower"] = Case("highway-fast-v0", "slower", 100, {})
    cases["fast-lanes"] = Case("highway-fast-v0", "lanes", 100, {})
    cases["fast-continuous"] = Case("highway-fast-v0", "continuous", 100, CONTINUOUS)
    cases["fast-full-throttle"] = Case("highway-fast-v0", "full-throttle", 100, CONTINUOUS)
    for name, env_id in (
        ("intersection", "intersection-v0"),
        ("intersection-v2", "intersection-v2"),
        ("roundabout", "roundabout-v0"),
        ("roundabout-v1", "roundabout-v1"),
        ("merge-v1", "merge-v1"),
        ("u-turn", "u-turn-v0"),
    ):
        for policy in ("random", "faster"):
            cases[f"{name}-{policy}"] = Case(env_id, policy, 300, {})
            if "intersection" in name or "roundabout" in name:
                cases[f"{name}-{policy}-known"] = Case(env_id, policy, 300, {}, {"intent": "known"})
    for policy in ("continuous", "full-throttle"):
        cases[f"intersection-v1-{policy}"] = Case("intersection-v1", policy, 300, {})
        cases[f"intersection-v1-{policy}-known"] = Case("intersection-v1", policy, 300, {}, {"intent": "known"})
    for kind in rss_shield.envs.worlds.random_roads.KINDS:
        for policy in ("random", "faster"):
            cases[f"{kind}-{policy}"] = Case("random-roads-v0", policy, 100, {"kind": kind})
    reckless = {"other_vehicles_type": RECKLESS}
    cases["reckless-random"] = Case("highway-fast-v0", "random", 200, reckless)
    cases["reckless-full-throttle"] = Case("highway-fast-v0", "full-throttle", 200, reckless | CONTINUOUS)
    return cases


CASES = _cases()


@dataclasses.dataclass(frozen=True)
class Config:
    """Play scripted policies under the shield and count who is to blame."""

    cases: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()  # to play; all, or none with --write
    episodes: int = 0  # episodes per case; 0: as many as the case asks for
    modes: tuple[str, ...] = ("override",)  # "override" and/or "monitor"
    backend: Literal["highway-env", "fast"] = "highway-env"  # the original simulator or the compiled engine
    n_workers: int = 2  # processes, or threads of the engine
    out: Path = Path("runs/evidence")  # one CSV per case and mode
    write: bool = False  # the page of results and the README's table, from every file in `out`


def play(name: str, mode: str, seed: int) -> dict[str, Any]:
    """One episode of one case."""
    case = CASES[name]
    rng = np.random.default_rng(seed)
    record = run_episode(
        lambda: make(case.env_id, shield=mode, config=dict(case.config), **case.options),
        lambda _: act(case.policy, rng, actions(case)),
        seed,
    )
    return {"case": name, "mode": mode, **record}


def played(name: str, mode: str, config: Config) -> pd.DataFrame:
    """All episodes of one case, from its file if that is there already."""
    count = config.episodes or CASES[name].episodes
    path = config.out / (f"{name}-{mode}.csv" if config.backend == "highway-env" else f"{name}-{mode}-{count}.csv")
    if path.exists():
        frame = pd.read_csv(path, keep_default_na=False)
        if len(frame) == count:
            return frame
    frame = in_engine(name, mode, count, config) if config.backend == "fast" else on_original(name, mode, count, config)
    with atomic(path) as temporary:
        frame.to_csv(temporary, index=False)
    return frame


def on_original(name: str, mode: str, count: int, config: Config) -> pd.DataFrame:
    """Episodes of one case, one at a time in each of several processes."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(config.n_workers, context) as pool, progress_bar(count, name, "episode") as bar:
        rows = []
        for row in pool.map(play, [name] * count, [mode] * count, range(count)):
            rows.append(row)
            bar.update()
    return pd.DataFrame(rows)


def in_engine(name: str, mode: str, count: int, config: Config) -> pd.DataFrame:
    """Episodes of one case, a thousand side by side. Random actions come from one generator for all."""
    case, rng = CASES[name], np.random.default_rng(0)

    def make_batch(n: int) -> Any:
        options = {"config": dict(case.config), "threads": config.n_workers, **case.options}
        return make_vec(case.env_id, n, mode, autoreset_mode=AutoresetMode.DISABLED, **options)

    with progress_bar(count, name, "episode") as bar:
        frame = evaluate(
            make_batch,
            lambda observations: act_batch(case.policy, rng, len(observations), actions(case)),
            range(count),
            n_envs=SIDE_BY_SIDE,
            keep_actions=False,
            progress=lambda done: bar.update(done - bar.n),
        )
    return frame.drop(columns="actions").assign(case=name, mode=mode)


def row(frame: pd.DataFrame) -> list[str]:
    """One line of the table."""
    n = len(frame)
    count = {verdict: int((frame["blame"] == verdict).sum()) for verdict in BLAMES}
    at_fault = count["ego"] + count["both"]
    returns = bootstrap_mean(frame["return"], np.random.default_rng(0))
    return [
        str(frame["case"].iloc[0]),
        str(frame["mode"].iloc[0]),
        str(n),
        str(int(frame["crashed"].sum())),
        f"{at_fault} (< {100 * wilson(at_fault, n).high:.2g} %)",
        str(count["other"]),
        str(count["inherited"]),
        str(count["none"]),
        f"{frame['broken_duties'].sum()} / {frame['dangerous_pairs'].sum()}",
        f"{returns.value:.2f} [{returns.low:.2f}, {returns.high:.2f}]",
        f"{frame['speed'].mean():.1f}",
        f"{100 * frame['override_share'].mean():.0f} %",
        f"{frame['rms_jerk'].mean():.1f}",
        f"{100 * frame['hard_braking_share'].mean():.1f} %",
        f"{100 * frame['comfortable_share'].mean():.0f} %",
    ]


COLUMNS = (
    "case",
    "mode",
    "n",
    "contacts",
    "ego at fault",
    "other",
    "inherited",
    "none",
    "duties broken / pair-frames",
    "return",
    "speed",
    "overridden",
    "rms jerk",
    "a < -3",
    "comfortable",
)


# ---------------------------------------------------------------- pages


PAGE, README = Path("docs/results/evidence.md"), Path("README.md")
HEADER = """# Never to blame, whatever the policy

Written by `python bench/evidence.py --write` from what its other calls have played.

Scripted policies, seeds 0, 1, ... *Contacts* are those of the ego, with whose doing they were. *None* counts contacts
that nobody's duty explains, which would be a bug. *Pair-frames* are all frames on which some car and the ego were in
danger; *broken* counts those on which the ego's command broke its duty. In brackets: the upper end of the 95 % Wilson
interval; for the return the 95 % interval of the mean: the bootstrap's, for more than 5000 episodes that of the central
limit theorem."""
HEADINGS = (
    *("case", "episodes", "contacts", "ego at fault (95 % below)", "none", "broken / pair-frames"),
    *("frames overridden", "return"),
)
SECTIONS = {"Motorways": False, "Where roads cross": True}
ROADS_CROSS = ("intersection", "roundabout", "u-turn")
BACKENDS = {"fast": "in the engine", "highway-env": "on highway-env"}
MODES = {"override": "", "monitor": ", without the shield"}
POLICIES = {
    "random": "random",
    "faster": "always FASTER",
    "idle": "always IDLE",
    "slower": "always SLOWER",
    "lanes": "random lane changes",
    "continuous": "random throttle and steering",
    "full-throttle": "full throttle, random steering",
}
# rows of the README's table, where they have been played
HEADLINES = ("fast-random", "fast-faster", "merge-random", "roundabout-random", "intersection-random")


COUNTED = ["blame", "crashed", "return", "override_share", "broken_duties", "dangerous_pairs"]


class Played(NamedTuple):
    """All episodes of one file in the folder of results."""

    name: str
    mode: str
    backend: str
    frame: pd.DataFrame


def found(out: Path) -> list[Played]:
    """What has been played, in the order of `CASES`; of several files of the engine the one with most episodes."""
    largest: dict[tuple[str, str, str], Path] = {}
    for path in sorted(out.glob("*.csv"), key=lambda path: (_size(path), path.name)):
        stem = path.stem if _size(path) == 0 else path.stem.rsplit("-", 1)[0]
        name, _, mode = stem.rpartition("-")
        if name in CASES and mode in MODES:
            largest[name, mode, "fast" if _size(path) else "highway-env"] = path
    keys = sorted(largest, key=lambda key: list(CASES).index(key[0]))
    return [Played(*key, pd.read_csv(largest[key], usecols=COUNTED, keep_default_na=False)) for key in keys]


def _size(path: Path) -> int:
    """Episodes by the name of a file of the engine; 0 for one of highway-env."""
    last = path.stem.rsplit("-", 1)[-1]
    return int(last) if last.isdigit() else 0


def label(case: Case) -> str:
    """What a case is called on pages."""
    words = [f"`{case.env_id}`", POLICIES[case.policy]]
    words += [case.config["kind"]] if "kind" in case.config else []
    words += ["reckless drivers"] if "other_vehicles_type" in case.config else []
    if case.env_id.startswith(ROADS_CROSS):
        words += ["routes known" if case.options.get("intent") == "known" else "routes unknown"]
    return ", ".join(words)


def page_row(played: Played) -> list[str]:
    """One line of the page."""
    frame, n = played.frame, len(played.frame)
    at_fault = faults(frame)
    count = {verdict: int((frame["blame"] == verdict).sum()) for verdict in ("other", "inherited", "none")}
    whose = {"the ego's": at_fault, "others'": count["other"], "inherited": count["inherited"]}
    whose |= {"unexplained": count["none"]}
    returns = bootstrap_mean(frame["return"], np.random.default_rng(0))
    return [
        label(CASES[played.name]),
        spaced(n),
        contacts_of(int(frame["crashed"].sum()), {name: number for name, number in whose.items() if number}),
        f"{spaced(at_fault)} ({percent(wilson(at_fault, n).high)})",
        spaced(count["none"]),
        f"{spaced(int(frame['broken_duties'].sum()))} / {spaced(int(frame['dangerous_pairs'].sum()))}",
        f"{100 * frame['override_share'].mean():.0f} %",
        f"{returns.value:.2f} [{returns.low:.2f}, {returns.high:.2f}]",
    ]


def contacts_of(count: int, whose: dict[str, int]) -> str:
    """A number of contacts, and with whose doing they were: "438: 437 the ego's, 1 others'"."""
    if len(whose) < 2:
        return ", ".join([spaced(count), *whose])
    return f"{spaced(count)}: {', '.join(f'{spaced(number)} {name}' for name, number in whose.items())}"


def percent(share: float) -> str:
    """Two digits at least: 0.38 %, 47 %, 100 %."""
    return f"{100 * share:.0f} %" if share >= 0.095 else f"{100 * share:.2g} %"


def faults(frame: pd.DataFrame) -> int:
    """Episodes that ended in a contact by the ego's fault."""
    return int(frame["blame"].isin(AT_FAULT).sum())


def commands(played: list[Played]) -> str:
    """The commands that played these, one for each number of episodes."""
    sizes: dict[int, list[str]] = {}
    for one in played:
        sizes.setdefault(len(one.frame), []).append(one.name)
    lines = []
    for size, names in sizes.items():
        words = ["python bench/evidence.py"]
        words += ["--backend fast"] if played[0].backend == "fast" else []
        words += [f"--modes {played[0].mode}"] if played[0].mode != "override" else []
        lines.append(" ".join([*words, f"--episodes {size}", "--cases", *names]))
    return "```sh\n" + "\n".join(lines) + "\n```"


def page(everything: list[Played]) -> list[str]:
    """The parts of the page: a table for each kind of road, simulator and mode that something was played of."""
    parts = [HEADER]
    for section, roads_cross in SECTIONS.items():
        there = [one for one in everything if CASES[one.name].env_id.startswith(ROADS_CROSS) == roads_cross]
        parts += [f"## {section}"] if there else []
        for backend, mode in itertools.product(BACKENDS, MODES):
            some = [one for one in there if (one.backend, one.mode) == (backend, mode)]
            if some:
                parts += [f"### {section} {BACKENDS[backend]}{MODES[mode]}"]
                parts += [markdown([HEADINGS, *map(page_row, some)]), commands(some)]
    return parts


def headlines(everything: list[Played]) -> str:
    """The README's table: the same policies without the shield and with it, in the engine."""
    frames = {(one.name, one.mode): one.frame for one in everything if one.backend == "fast"}
    rows: list[Any] = [
        ("road and driver", "ego at fault without the shield", "with it (95 % below)", "episodes", "frames overridden")
    ]
    for name in HEADLINES:
        frame, bare = frames.get((name, "override")), frames.get((name, "monitor"))
        if frame is None:
            continue
        at_fault, n = faults(frame), len(frame)
        rows.append(
            (
                label(CASES[name]),
                "–" if bare is None else f"{100 * faults(bare) / len(bare):.0f} % of {spaced(len(bare))}",
                f"**{at_fault}** ({percent(wilson(at_fault, n).high)})",
                spaced(n),
                f"{100 * frame['override_share'].mean():.0f} %",
            )
        )
    return markdown(rows)


def write(out: Path, root: Path = Path()) -> None:
    """Write the page of results and fill the README's table, below `root`."""
    everything = found(out)
    write_page(root / PAGE, page(everything))
    fill(root / README, "results", headlines(everything))


# ---------------------------------------------------------------- main


def main(config: Config) -> int:
    unknown = [name for name in config.cases if name not in CASES]
    if unknown:
        print(f"cases = {unknown[0]!r}: expected some of {', '.join(CASES)}", file=sys.stderr)
        return 2
    config.out.mkdir(parents=True, exist_ok=True)
    table = Table(*COLUMNS)
    bad = 0
    cases = config.cases or (() if config.write else tuple(CASES))
    for mode in config.modes:
        for name in cases:
            frame = played(name, mode, config)
            table.add_row(*row(frame))
            bad += int((frame["blame"] == "none").sum())
            if mode == "override":
                bad += int(frame["blame"].isin(AT_FAULT).sum() + (frame["broken_duties"] > 0).sum())
    if cases:
        Console(width=170).print(table)
        print("at fault: upper end of the 95 % Wilson interval; return: mean with its 95 % interval")
    if config.write:
        write(config.out)
        print(f"written: {PAGE}, {README}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
