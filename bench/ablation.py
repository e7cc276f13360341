"""What each rule and each condition of the proof buys, and what it costs.

    python bench/ablation.py --write                  plays the adversaries, reads runs/ of the sweeps, writes the page
    python bench/ablation.py --episodes 100000

The adversaries are those of tests/adversary.py, who use every right that RSS leaves them. The hostile drivers and the
rules are sweeps: run `rss-shield sweep experiments/NAME.yaml` for ablation and rules first; what has not been run is
left out of the page.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "shield")]

from adversary import play, world  # noqa: E402
from test_mutations import FAST, MUTATIONS, SLOW  # noqa: E402

from rss_shield.eval.metrics import with_outcomes  # noqa: E402
from rss_shield.eval.pages import markdown, spaced, write_page  # noqa: E402
from rss_shield.eval.provenance import provenance, records_of  # noqa: E402
from rss_shield.eval.run_folder import versions  # noqa: E402
from rss_shield.eval.runs.experiment import read_experiment  # noqa: E402
from rss_shield.eval.runs.points import with_front  # noqa: E402
from rss_shield.eval.runs.store import Store  # noqa: E402
from rss_shield.eval.runs.tables import markdown_of, shown_metrics, texts, wide  # noqa: E402
from rss_shield.eval.runs.tasks import tasks_of  # noqa: E402
from rss_shield.eval.stats import bootstrap_mean, clopper_pearson  # noqa: E402
from rss_shield.shield.verdicts import BOTH, EGO  # noqa: E402

OUTCOMES = ("contacts [%]", "ego at fault [%]", "a duty broken [%]")
FRAMES = 150  # of an episode, at most
PAGE = ROOT / "docs" / "results" / "ablation.md"
HEADER = """# What each rule buys, and what it costs

Written by `python bench/ablation.py --write`. Each row is the whole shield but for one piece. [low, high]: 95 %
intervals over episodes; rates Clopper-Pearson, means bootstrap."""
SWEEPS = {"rules": "Each rule, in stock traffic. Blame is by the rules in force, so look at crashes."}


def adversaries(episodes: int) -> str:
    """The compiled adversaries against the shield without one condition."""
    rows: list[list[Any]] = [["without", "frame [s]", "others", "episodes", *OUTCOMES, "frames overridden [%]"]]
    wholes = {
        (dt, others): ("nothing: the whole shield", {}, dt, others)
        for _, dt, others, _ in MUTATIONS.values()
        if (dt, others) != (SLOW, 2)
    }
    broken = [(name, change, dt, others) for name, (change, dt, others, _) in MUTATIONS.items()]
    for name, change, dt, others in [*wholes.values(), *broken]:
        w = world(dt=dt, frames=FRAMES, bare=dt == FAST, others=others, **change)  # type: ignore[arg-type]
        played = play(episodes, w, seed=1)
        contact = played["contact"] >= 0
        outcomes = contact, contact & np.isin(played["verdict"], (EGO, BOTH)), played["broken"] > 0
        shares = [percent(*clopper_pearson(int(seen.sum()), episodes)[:3]) for seen in outcomes]
        frames = np.where(contact, played["contact"] + 1, FRAMES)
        overridden = bootstrap_mean(played["overridden"] / frames, np.random.default_rng(0))
        rows.append([name, f"{dt:.3g}", others, spaced(episodes), *shares, percent(*overridden[:3])])
        print(" | ".join(map(str, rows[-1])), flush=True)
    return markdown(rows)


def hostile(folder: Path) -> str | None:
    """The sweep of hostile drivers: what a rule buys among all of them, and what it costs in stock traffic."""
    records, store = records_of([folder]), Store(folder / "tasks")
    if not records:
        return None
    experiment = read_experiment(ROOT / "experiments" / "ablation.yaml")
    experiment = replace(experiment, tests=records[0]["experiment"]["tests"])  # it may have been tried with few
    found = [task for task in tasks_of(experiment) if store.has(task)]
    if not found:
        return None
    frames = [
        pd.read_csv(store.path(task) / "episodes.csv").assign(
            setting=task.point["setting"], stock=task.point["others"] == "stock"
        )
        for task in found
    ]
    episodes = with_outcomes(pd.concat(frames, ignore_index=True))
    rows: list[list[Any]] = [
        [
            "",
            "episodes",
            "ego at fault [%]",
            "contacts [%]",
            "frames overridden [%]",
            "return, stock traffic",
            "rms jerk, stock",
        ]
    ]
    for setting, frame in episodes.groupby("setting", sort=False):
        wild, stock, rng = frame[~frame["stock"]], frame[frame["stock"]], np.random.default_rng(0)
        if not (len(wild) and len(stock)):  # the sweep is still under way
            continue
        rates = [percent(*clopper_pearson(int(wild[name].sum()), len(wild))[:3]) for name in ("at_fault", "crash")]
        override = percent(*bootstrap_mean(wild["override_share"], rng)[:3])
        means = [bootstrap_mean(stock[name], rng) for name in ("return", "rms_jerk")]
        costs = [f"{mean.value:.1f} [{mean.low:.1f}, {mean.high:.1f}]" for mean in means]
        rows.append([setting, f"{len(wild)} + {len(stock)}", *rates, override, *costs])
    return markdown(rows)


def percent(value: float, low: float, high: float) -> str:
    return f"{100 * value:.2g} [{100 * low:.2g}, {100 * high:.2g}]"


def swept(folder: Path, safety: str, performance: str) -> str:
    """The table of a sweep."""
    points = pd.read_csv(folder / "points.csv")
    axes = [name for name in points.columns if name not in ("metric", "value", "low", "high", "n", "over")]
    table = with_front(wide(points, axes), safety, performance)
    count = int(points["n"].max())
    text = markdown_of(texts(table, axes, shown_metrics(table, safety, performance)))
    said = provenance(records_of([folder]))
    return f"{count} episodes a row; ★: on the Pareto front of its environment and policy.\n\n{text}\n\n{said}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--episodes", type=int, default=2000, help="of the adversaries, per row")
    parser.add_argument("--runs", type=Path, default=ROOT / "runs", help="folder of the sweeps")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name} into --out")
    parser.add_argument("--out", type=Path, default=PAGE.parent, help="folder of the page (default: %(default)s)")
    arguments = parser.parse_args()
    parts = [HEADER, "## Against adversaries who use every right", ADVERSARIES, adversaries(arguments.episodes)]
    parts += [f"{provenance([versions()])} Seed 1."]
    table = hostile(arguments.runs / "ablation")
    if table:
        parts += ["## Among hostile drivers on highway-env", HOSTILE, table]
        parts += [provenance(records_of([arguments.runs / "ablation"]))]
    for name, text in SWEEPS.items():
        if (arguments.runs / name / "points.csv").exists():
            experiment = read_experiment(ROOT / "experiments" / f"{name}.yaml")
            parts += [f"## `experiments/{name}.yaml`", text]
            parts += [swept(arguments.runs / name, experiment.safety, experiment.performance)]
    if arguments.write:
        write_page(arguments.out / PAGE.name, parts)
        print(f"written: {arguments.out / PAGE.name}")
    else:
        print("\n\n".join(parts))


ADVERSARIES = """One ego, one or two others on a straight road, who keep the law by the table and otherwise do their
worst; frames of 0.2 s where every spare room is taken out (cars of 2 cm, no wobble, no standstill gap), else of
1/15 s. A duty may be broken without a contact where another margin still covers it. What they say:
[register](../holes.md). Where the table itself lacks a margin (C5) or the ego starts in danger (C6), a contact is not
held against the ego; without the bound of the heading it turns further than the table says, which is no duty."""
HOSTILE = """Random meta-actions on `highway-fast-v0`, among reckless drivers, brake checkers, squeezers, swervers and
rammers (`envs/highway/hostile.py`), judged by the whole table whatever the shield goes by. Costs: in
stock traffic."""

if __name__ == "__main__":
    main()
