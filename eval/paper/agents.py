"""The page of trained agents: every arm of a campaign on each road, against drivers that learn nothing.

    python -m rss_shield.eval.paper.agents runs/A runs/B --out docs/results

writes agents.md and its figures from finished runs of `train.py`. Who learns nothing (`lazy`, `idm`, ...) is what a
trained agent has to beat behind the same shield.
"""

import argparse
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rss_shield.eval import multipliers, removal
from rss_shield.eval.arms import ARMS, OFF, ON, Arm
from rss_shield.eval.frontier import plot_frontier
from rss_shield.eval.metrics import METRICS, RATES, paired, summarise, with_outcomes
from rss_shield.eval.pages import command, markdown, write_page
from rss_shield.eval.paper.compared import difference
from rss_shield.eval.plots import joined_bins
from rss_shield.eval.provenance import provenance, records_of
from rss_shield.eval.stats import Interval, clopper_pearson, cluster_bootstrap, weighted_mean
from rss_shield.shield.verdicts import AT_FAULT

PAGE = "agents.md"
BASELINES = ("lazy", "idm")
SELDOM = 0.10  # share of frames overridden, at most
RISING = 0.02  # of a multiplier over the last fifth of training, at most, if it is at rest
NEARLY = 0.02  # of the best return, lost at most
HARMLESS = 0.01  # crashes without the shield, at most
WORTHWHILE = 0.5  # of the best return, at least: who stands, or leaves the road, meets nobody either
FLAT = 0.02  # change of the return over the last fifth of training, at most, in parts of its size
LIMITS = {metric.name: metric.limits for metric in METRICS}  # what a value can be
CALLED = {arm.called: arm for arm in ARMS.values()}
DRAWN = (  # what the frontier is drawn from
    *("train", "test", "train_seed", "seed", "crashed", "blame"),
    *("return", "override_share", "mean_acceleration_change"),
)
HEADER = """# Arms compared

Written by `python bench/campaign.py --write`, with the `--plan` of its runs, from runs of `train.py`.

What the arms are: [arms](../arms.md). *Without* and *with*: tested without the shield and with it, on the same
episodes. [low, high]: 95 % intervals; of arms with several training seeds over seeds and episodes (hierarchical
bootstrap, Student's t), else over episodes (rates: Clopper-Pearson). A rate is never said to be known better than its
episodes alone would tell."""


class Road(NamedTuple):
    """What the runs on one road left."""

    env_id: str
    records: list[dict[str, Any]]  # options, versions and machine of each
    episodes: pd.DataFrame  # test episodes; train as in tables
    curves: pd.DataFrame  # training episodes; arm, train_seed
    removals: pd.DataFrame
    prices: pd.DataFrame
    longer: dict[str, pd.DataFrame]  # folder beside each model -> test episodes of other lengths


def roads_in(runs: Sequence[Path]) -> list[Road]:
    """The finished ones among some runs, by road.

    Raises:
      ValueError: none is finished.
    """
    finished = [run for run in runs if (run / "results.json").exists()]
    if not finished:
        raise ValueError(f"runs = {', '.join(map(str, runs))}: expected at least one finished run (results.json)")
    by_road: dict[str, list[Path]] = {}
    for run in finished:
        by_road.setdefault(_config(run)["env_id"], []).append(run)
    return [_road(env_id, folders) for env_id, folders in by_road.items()]


def _config(run: Path) -> dict[str, Any]:
    return json.loads((run / "config.json").read_text(encoding="utf-8"))["config"]


def _road(env_id: str, runs: list[Path]) -> Road:
    configs = [_config(run) for run in runs]
    curves, removals, prices = [], [], []
    for run, config in zip(runs, configs, strict=True):
        models = [(arm, seed) for arm in config["arms"] for seed in config["seeds"]]
        removals.append(removal.read_all(run, models))
        prices.append(multipliers.read_all(run, models))
        for arm, seed in models:
            path = run / f"{arm}-seed{seed}" / "learning_curve.csv"
            if path.exists():
                curves.append(pd.read_csv(path).assign(arm=arm, train_seed=seed))
    episodes = pd.concat([pd.read_csv(run / "episodes.csv") for run in runs], ignore_index=True)
    trained = _joined(curves), _joined(removals), _joined(prices)
    return Road(env_id, records_of(runs), with_outcomes(episodes), *trained, _longer(runs))


def _longer(runs: list[Path]) -> dict[str, pd.DataFrame]:
    """What `rss-shield test` left in folders `tested-*` beside models."""
    found: dict[str, list[pd.DataFrame]] = {}
    for run in runs:
        for path in sorted(run.glob("*/tested-*/episodes.csv")):
            arm, _, seed = path.parents[1].name.rpartition("-seed")
            episodes = pd.read_csv(path).assign(train=ARMS[arm].called, train_seed=int(seed))
            found.setdefault(path.parent.name, []).append(episodes)
    return {name: with_outcomes(_joined(tables)) for name, tables in found.items()}


def _joined(tables: list[pd.DataFrame]) -> pd.DataFrame:
    filled = [table for table in tables if len(table)]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=["arm"])


# ---------------------------------------------------------------- numbers


def cells_of(road: Road) -> dict[tuple[str, str], pd.DataFrame]:
    """(arm, test) -> its test episodes."""
    groups = road.episodes.groupby(["train", "test"], sort=False)
    return {(CALLED[str(train)].name, str(test)): rows for (train, test), rows in groups if train in CALLED}


def estimate(cell: pd.DataFrame, metric: str) -> Interval:
    """A mean over test episodes and, where there are several, training seeds."""
    seeds = [rows[metric].to_numpy(float) for _, rows in cell.groupby("train_seed")]
    pooled = np.concatenate(seeds)
    if len(seeds) > 1:
        over = cluster_bootstrap(seeds, np.random.default_rng(0))
    else:
        mean = float(pooled.mean())
        half = 1.96 * float(pooled.std(ddof=1)) / np.sqrt(pooled.size) if pooled.size > 1 else np.nan
        over = Interval(mean, mean - half, mean + half, pooled.size)
    if metric in RATES:
        exact = clopper_pearson(int(pooled.sum()), pooled.size)
        if len(seeds) == 1:
            return exact
        over = over._replace(low=min(over.low, exact.low), high=max(over.high, exact.high))
    lowest, highest = LIMITS.get(metric, (-np.inf, np.inf))
    return over._replace(low=max(over.low, lowest), high=min(over.high, highest))


def per_decision(cell: pd.DataFrame, what: str) -> Interval:
    """What is counted in an episode, per decision: a ratio of sums, linearised so that each episode has its share."""
    shares = []
    for _, rows in cell.groupby("train_seed"):
        ratio = rows[what].sum() / rows["length"].sum()
        shares.append(rows.assign(share=ratio + (rows[what] - ratio * rows["length"]) / rows["length"].mean()))
    found = estimate(pd.concat(shares), "share")
    return found._replace(low=max(found.low, 0.0))


def against(cell: pd.DataFrame, baseline: pd.DataFrame, metric: str = "return") -> Interval:
    """Cell minus a baseline that learns nothing, on the same test episodes."""
    pairs = paired(cell, baseline.drop_duplicates("seed"), "_baseline")
    there = pairs[f"{metric}_baseline"]
    return difference(pairs, pairs[metric], there, np.random.default_rng(0), metric in RATES)


def last_change(curve: pd.DataFrame) -> float:
    """How much the return of training episodes changed over the last fifth of training, in parts of its size.

    Args:
      curve: of one arm, all seeds; columns as in `learning_curve.csv`.

    Returns:
      NaN where too many of these episodes were cut off to tell.
    """
    edges = np.linspace(0, curve["timesteps"].max(), 6)
    bins = joined_bins(curve, edges)
    if len(bins) < 2:
        return float("nan")
    before, last = (weighted_mean(inside["return"], inside["weight"]).value for _, _, inside in bins[-2:])
    return (last - before) / max(abs(before), 1e-9)


def mean_of(cell: pd.DataFrame, metric: str) -> float:
    """What `estimate` is about, without its interval."""
    return float(cell.groupby("train_seed")[metric].mean().mean())


def best_behind_shield(cells: dict[tuple[str, str], pd.DataFrame]) -> float:
    """The highest return of an arm behind the shield."""
    return max(mean_of(cell, "return") for (_, test), cell in cells.items() if test == ON)


# ---------------------------------------------------------------- texts


def percent(interval: Interval, digits: int = 1) -> str:
    low, value, high = (f"{100 * number:.{digits}f}" for number in (interval.low, interval.value, interval.high))
    return f"{value} [{low}, {high}]"


def number(interval: Interval, digits: int = 1, sign: str = "") -> str:
    low, value, high = (f"{bound:{sign}.{digits}f}" for bound in (interval.low, interval.value, interval.high))
    return f"{value} [–]" if np.isnan(interval.low) else f"{value} [{low}, {high}]"


def row_of(arm: Arm, road: Road, cells: dict[tuple[str, str], pd.DataFrame]) -> list[str]:
    """An arm's line of the table."""
    without, behind = cells.get((arm.name, OFF)), cells.get((arm.name, ON))
    shown = [f"`{arm.name}`", str((behind if behind is not None else without)["train_seed"].nunique())]  # type: ignore[index]
    shown += (
        ["–", "–"] if without is None else [percent(estimate(without, "crash")), number(estimate(without, "return"))]
    )
    if behind is None:
        return [*shown, *["–"] * 5, *_training(arm, road)]
    shown += [percent(estimate(behind, "at_fault")), percent(estimate(behind, "crash"))]
    shown += [number(estimate(behind, "return")), percent(estimate(behind, "override_share"))]
    shown += [number(estimate(behind, "mean_acceleration_change"))]
    return [*shown, *_training(arm, road)]


def _training(arm: Arm, road: Road) -> list[str]:
    """Crashes while it learnt, and whether it still did at the end."""
    curve = road.curves[road.curves["arm"] == arm.name]
    if not len(curve):
        return ["–", "–", "–"]
    decisions = curve["length"].sum()
    crashes, faults = curve["crashed"].sum(), curve["blame"].isin(AT_FAULT).sum()
    change = last_change(curve)
    flat = "–" if np.isnan(change) else f"{'yes' if abs(change) <= FLAT else 'no'} ({100 * change:+.0f} %)"
    return [f"{1000 * crashes / decisions:.1f}", f"{1000 * faults / decisions:.1f}", flat]


TABLE_HEADING = [
    *("arm", "seeds", "without: crashes [%]", "without: return", "with: ego at fault [%]", "with: crashes [%]"),
    *("with: return", "overridden [% of frames]", "change [m/s²]"),
    *("crashes per 1000 decisions of training", "... the ego's fault", "flat"),
]
GOAL_HEADING = ["arm", "without: arrives [%]", "with: arrives [%]", "without: time [s]", "with: time [s]"]


def goal_row(arm: Arm, cells: dict[tuple[str, str], pd.DataFrame]) -> list[str]:
    """How many arrive without a contact, and when."""
    tested = [cells.get((arm.name, test)) for test in (OFF, ON)]
    shares = ["–" if cell is None else percent(estimate(cell, "success")) for cell in tested]
    times = ["–" if cell is None or not cell["success"].any() else number(_arrival(cell)) for cell in tested]
    return [f"`{arm.name}`", *shares, *times]


def _arrival(cell: pd.DataFrame) -> Interval:
    return estimate(cell.dropna(subset=["time_to_goal"]), "time_to_goal")


def first_sentences(road: Road, cells: dict[tuple[str, str], pd.DataFrame]) -> str:
    """Who beats the drivers that learn nothing, behind the shield."""
    parts = []
    for baseline in BASELINES:
        if (baseline, ON) not in cells:
            continue
        differences = {
            arm: against(cell, cells[baseline, ON]) for (arm, test), cell in cells.items() if test == ON and learns(arm)
        }
        better = {arm: gain for arm, gain in differences.items() if gain.low > 0}
        worse = [arm for arm, loss in differences.items() if loss.high < 0]
        name = f"`{baseline}` ({ARMS[baseline].label}, return {mean_of(cells[baseline, ON], 'return'):.1f})"
        if better:
            listed = ", ".join(f"`{arm}` by {number(gain, 2, '+')}" for arm, gain in better.items())
            parts.append(f"Behind the shield these beat {name}: {listed}.")
        else:
            parts.append(f"**Behind the shield no trained agent beats {name}.**")
        if worse:
            parts.append(f"Worse than it: {', '.join(f'`{arm}`' for arm in worse)}.")
    return " ".join(parts)


def learns(arm: str) -> bool:
    return not ARMS[arm].scripted


def questions(road: Road, cells: dict[tuple[str, str], pd.DataFrame]) -> str:
    """Who lets the shield sleep and earns as much, who is harmless without it, who meets the limit of costs."""
    best = best_behind_shield(cells)
    asleep: list[str] = []
    harmless: list[str] = []
    useless: list[str] = []
    for (arm, test), cell in cells.items():
        if not learns(arm):
            continue
        if test == ON:
            share, earned = mean_of(cell, "override_share"), mean_of(cell, "return")
            if share <= SELDOM and earned >= best - NEARLY * abs(best):
                asleep.append(f"`{arm}` ({100 * share:.1f} %, {earned:.1f})")
        if test == OFF and mean_of(cell, "crash") <= HARMLESS:
            earned = mean_of(cell, "return")
            name = f"`{arm}` ({percent(estimate(cell, 'crash'))} %, return {earned:.1f})"
            (harmless if earned >= WORTHWHILE * best else useless).append(name)
    lines = [
        f"Overridden in at most {100 * SELDOM:.0f} % of the frames with at least {100 * (1 - NEARLY):.0f} % of the "
        f"best return behind the shield ({best:.1f}): {', '.join(asleep) or 'nobody'}.",
        f"Crashes in at most {100 * HARMLESS:.0f} % of the episodes without the shield and earns at least "
        f"{100 * WORTHWHILE:.0f} % of the best return: {', '.join(harmless) or 'nobody'}."
        + (f" Crashes as seldom and earns less: {', '.join(useless)}." if useless else ""),
    ]
    lines += sentences_on_costs(road.prices[road.prices["arm"] == "ppo-lagrangian"], cells)
    return "\n".join(f"- {line}" for line in lines)


def sentences_on_costs(prices: pd.DataFrame, cells: dict[tuple[str, str], pd.DataFrame]) -> Iterator[str]:
    """Does PPO-Lagrangian meet its limit, in training and when it is tested, and who could?"""
    if not len(prices):
        return
    late = prices[prices["timesteps"] > 0.8 * prices["timesteps"].max()]
    per_seed = late.groupby("train_seed")[["measured", "target", "multiplier"]].mean()
    limit = per_seed["target"].iloc[0]
    paid = ", ".join(f"{cost:.4f}" for cost in per_seed["measured"])
    multiplied = ", ".join(f"{price:.2f}" for price in per_seed["multiplier"])
    yield (
        f"Cost per decision of PPO-Lagrangian in the last fifth of training, by seed: {paid}; its limit is {limit:g}; "
        f"multiplier {multiplied}{_still_rising(late)}."
    )
    costs = {arm: per_decision(cell, "cost") for (arm, test), cell in cells.items() if test == OFF}
    if "ppo-lagrangian" in costs:
        cost = costs["ppo-lagrangian"]
        verdict = "meets it" if cost.high <= limit else "does not meet it" if cost.low > limit else "may meet it"
        yield f"Tested without the shield, where it does not explore, it costs {number(cost, 4)}: it {verdict}."
    others = {arm: cost for arm, cost in costs.items() if not learns(arm)}
    if others:
        least = min(others, key=lambda arm: others[arm].value)
        yield (
            f"Of drivers that learn nothing `{least}` ({ARMS[least].label}) costs least without the shield: "
            f"{number(others[least], 4)}."
        )


def _still_rising(late: pd.DataFrame) -> str:
    """Was a multiplier not at rest in the last fifth of training?"""
    rises = late.groupby("train_seed")["multiplier"].agg(lambda price: price.iloc[-1] - price.iloc[0])
    return ", still rising when training ended" if (rises > RISING * late["multiplier"].mean()).any() else ""


def other_filters(road: Road, arms: Sequence[Arm], cells: dict[tuple[str, str], pd.DataFrame]) -> list[str]:
    """A table of agents behind the filters that they were trained behind."""
    tested = [(arm, cells[arm.name, test]) for arm in arms for test in arm.tests if (arm.name, test) in cells]
    rows = []
    for arm, cell in tested:
        if cell["test"].iloc[0] not in (OFF, ON):
            rates = [percent(estimate(cell, metric)) for metric in ("at_fault", "crash")]
            means = [number(estimate(cell, metric)) for metric in ("return", "mean_acceleration_change")]
            rows.append([f"`{arm.name}`", *rates, *means])
    heading = ["arm", "ego at fault [%]", "crashes [%]", "return", "change [m/s²]"]
    return ["Behind the filters that these were trained behind:", markdown([heading, *rows])] if rows else []


def figures_of(road: Road, folder: Path) -> Iterator[str]:
    """Draw the figures of a road beside the page; yields their Markdown."""
    drawn = folder / f".{road.env_id}"
    drawn.mkdir(parents=True, exist_ok=True)
    try:
        summary = summarise(road.episodes.loc[road.episodes["train"].isin(CALLED), list(DRAWN)])
        plot_frontier(summary, drawn, road.env_id)
        found = [("frontier", "Who needs the shield, and what it earns with it and without.")]
        if len(road.removals):
            removal.plot_removal(road.removals, drawn, road.env_id)
            found.append(("removal", "The agents on their way through training, with the shield taken away."))
        if len(road.prices):
            multipliers.plot_multipliers(road.prices, drawn, road.env_id)
            found.append(("multiplier", "Prices that find themselves."))
        for name, caption in found:
            target = folder / f"agents-{road.env_id}-{name}.png"
            shutil.move(drawn / f"{name}.png", target)
            yield f"![{caption}]({target.name})\n\n{caption}"
    finally:
        shutil.rmtree(drawn)


def section_of(road: Road, folder: Path) -> list[str]:
    """The parts of the page on one road."""
    cells = cells_of(road)
    arms = [ARMS[name] for name in dict.fromkeys(arm for arm, _ in cells)]
    counts = sorted({len(rows) // rows["train_seed"].nunique() for rows in cells.values()})
    episodes = " or ".join(map(str, counts))
    commands = "\n".join(map(command, road.records))
    return [
        f"## `{road.env_id}`",
        first_sentences(road, cells),
        f"{episodes} test episodes per arm, seed and test.",
        markdown([TABLE_HEADING, *(row_of(arm, road, cells) for arm in arms)]),
        *other_filters(road, arms, cells),
        *_goals(road, arms, cells),
        questions(road, cells),
        *figures_of(road, folder),
        f"```sh\n{commands}\n```",
        provenance(road.records),
    ]


def _goals(road: Road, arms: list[Arm], cells: dict[tuple[str, str], pd.DataFrame]) -> list[str]:
    """Tables of arrivals where there is a goal, also of longer episodes that the agents were tested in."""
    if "success" not in road.episodes:
        return []
    parts = ["Arrivals without a contact:", markdown([GOAL_HEADING, *(goal_row(arm, cells) for arm in arms)])]
    for name, episodes in road.longer.items():
        longer = cells_of(road._replace(episodes=episodes))
        seconds = name.removeprefix("tested-").removesuffix("s")
        heading = [*GOAL_HEADING, "with: ego at fault [%]"]
        rows = [
            [*goal_row(arm, longer), percent(estimate(longer[arm.name, ON], "at_fault"))]
            for arm in arms
            if (arm.name, ON) in longer
        ]
        parts += [f"The same agents in episodes of {seconds} s:", markdown([heading, *rows])]
    return parts


def write(runs: Sequence[Path], folder: Path) -> Path:
    """Write the page and its figures; returns the page.

    Raises:
      ValueError: no finished run.
    """
    roads = roads_in(runs)
    folder.mkdir(parents=True, exist_ok=True)
    legend = (
        "*Overridden*: frames in which a proper response changed the command; *change*: mean size of all changes of "
        f"the acceleration. *Flat*: the return of training episodes changed by at most {100 * FLAT:.0f} % from the "
        "last fifth but one to the last, or between longer spans where too few episodes ended in these."
    )
    write_page(folder / PAGE, [HEADER, legend, *(part for road in roads for part in section_of(road, folder))])
    return folder / PAGE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path, help="folders of runs; those that are not finished are left out")
    parser.add_argument("--out", type=Path, default=Path("docs/results"), help="folder (default: %(default)s)")
    arguments = parser.parse_args()
    try:
        print(f"written: {write(arguments.runs, arguments.out)}")
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
