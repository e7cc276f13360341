"""Runs and sweeps as sections of a report."""

import json
import os
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rss_shield.eval import removal
from rss_shield.eval.arms import arm_called
from rss_shield.eval.files import linked_names
from rss_shield.eval.frontier import plot_frontier
from rss_shield.eval.metrics import summarise, with_outcomes
from rss_shield.eval.pages import command
from rss_shield.eval.paper import words
from rss_shield.eval.paper.compared import as_texts, comparisons
from rss_shield.eval.paper.figures import plot_comfort, plot_profiles
from rss_shield.eval.paper.section import Figure, Section, Table
from rss_shield.eval.plots import plot_blame, plot_learning_curve, save
from rss_shield.eval.report import title_of
from rss_shield.eval.run_folder import filmstrips_of, pages_of
from rss_shield.eval.runs.points import groups_of, metric_named, with_front
from rss_shield.eval.runs.store import missing_in
from rss_shield.eval.runs.tables import intervals_of, plot_front, shown_metrics, texts, wide
from rss_shield.eval.stats import Interval, interquartile_mean, probability_of_improvement
from rss_shield.eval.table import legend, table_frame

GROUPS = {  # tables of a run: headings of their metrics
    "Safety": (
        "crash",
        "ego at fault",
        "other at fault",
        "inherited",
        "none",
        "min TTC",
        "min time gap",
        "near misses",
    ),
    "Performance": ("success", "time to goal", "return", "own return", "speed", "length", "frozen"),
    "Shield and ride": ("overridden", "anticipated", "change", "rms jerk", "hard braking", "comfortable"),
}
INTERVALS = "[low, high]: 95 % interval over test episodes of these trained models; (low, high): over training seeds."


def kind_of(folder: Path) -> str:
    """What a folder of results holds: "sweep", "run" (of `rss-shield train`) or "test" (of `rss-shield test`).

    Raises:
      ValueError: none of them, or not finished.
    """
    if (folder / "experiment.json").exists() and (folder / "points.csv").exists():
        return "sweep"
    finished = (folder / "config.json").exists() and (folder / "episodes.csv").exists()
    config = record_in(folder).get("config", {}) if finished else {}
    for kind, key in (("run", "arms"), ("test", "policy")):
        if {"env_id", key} <= set(config):
            return kind
    raise ValueError(
        f"{folder}: expected a finished run of rss-shield train or test (config.json, episodes.csv) or sweep "
        "(experiment.json, points.csv)"
    )


def record_in(folder: Path) -> dict[str, Any]:
    """What a run or a test has recorded of itself.

    Raises:
      ValueError: it cannot be read.
    """
    path = folder / "config.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} cannot be read: {error}") from None


def section_of(folder: Path, figures: Path) -> Section:
    """The section of a run, a test or a sweep.

    Args:
      folder: of results.
      figures: folder that its figures are drawn into; its name heads the labels of tables.

    Raises:
      ValueError: none of these, or not finished.
    """
    folder = Path(os.path.abspath(folder))  # which has a name, unlike .
    kind = kind_of(folder)
    figures.mkdir(parents=True, exist_ok=True)
    return _of_sweep(folder, figures) if kind == "sweep" else _of_episodes(folder, figures, kind)


def _of_episodes(folder: Path, figures: Path, kind: str) -> Section:
    """The section of a run or a test; a test has no models of its own, so no curves."""
    record = record_in(folder)
    config = record["config"]
    episodes = read_episodes(folder)
    summary, compared = summarise(episodes), comparisons(episodes)
    frame = table_frame(summary)
    tables = [
        Table(f"{figures.name}-{name.split()[0].lower()}", f"{name}. {INTERVALS}", turned(frame, headings))
        for name, headings in GROUPS.items()
        if any(heading.split(" [")[0] in headings for heading in frame.columns)
    ]
    if len(compared):
        tables.append(
            Table(
                f"{figures.name}-compared",
                "Differences to the first cell, paired by seed and test episode. only here / only first: episodes "
                "in which one of both had the outcome.",
                as_texts(compared),
            )
        )
    return Section(
        folder.name if folder.name == config["env_id"] else f"{config['env_id']} ({folder.name})",
        [*_title_of(folder, kind, config), *words.of_run(episodes, summary, compared)],
        tables,
        list(_figures_of(folder, figures, config, episodes, summary)),
        legend(summary),
        command(record) if kind == "run" else tested_by(record),
        pages_of(folder),
    )


def _title_of(folder: Path, kind: str, config: dict[str, Any]) -> list[str]:
    """What was trained or tested and how; of a test as its table has it in the first line."""
    if kind == "run":
        return [f"{title_of(config)}."]
    table = folder / "table.md"
    return [f"{table.read_text(encoding='utf-8').splitlines()[0]}."] if table.exists() else []


def tested_by(record: dict[str, Any]) -> str:
    """The command line of a test; of one that has not recorded it, the beginning."""
    config = record["config"]
    return record.get("command") or f"rss-shield test {config['policy']} --env-id {config['env_id']}"


def _figures_of(folder: Path, figures: Path, config: dict[str, Any], episodes: pd.DataFrame, summary: pd.DataFrame):
    road = str(config["env_id"])
    models = [(arm, seed) for arm in config.get("arms", ()) for seed in config.get("seeds", ())]
    plot_blame(episodes, figures, road)
    yield Figure("Who is to blame for the contacts of each cell.", figures / "blame.png")
    paths = {model: folder / f"{model[0]}-seed{model[1]}" / "learning_curve.csv" for model in models}
    curves = [
        pd.read_csv(path).assign(arm=arm, train_seed=seed) for (arm, seed), path in paths.items() if path.exists()
    ]
    if curves:
        plot_learning_curve(pd.concat(curves, ignore_index=True), figures, road)
        text = "Training: return, crashes and faults while learning, and how often the shield intervenes."
        yield Figure(text, figures / "learning_curve.png")
    removals = removal.read_all(folder, models)
    if len(removals):
        removal.plot_removal(removals, figures, road)
        yield Figure("The agent on its way through training, with the shield taken away.", figures / "removal.png")
    if summary["train"].nunique() > 2 and all(map(arm_called, summary["train"].unique())):
        plot_frontier(summary, figures, road)
        yield Figure("Who needs the shield, and what it earns with it and without.", figures / "frontier.png")
    if plot_comfort(summary, figures, road):
        yield Figure("How the ride feels.", figures / "comfort.png")
    for strip in filmstrips_of(folder):
        (name,) = linked_names([strip.stem])
        for suffix in (".png", ".pdf"):
            shutil.copyfile(strip.with_suffix(suffix), figures / f"{name}{suffix}")
        text = f"{strip.stem}: five moments from above (the ego blue, who it was about red), and the margins over time."
        yield Figure(text, figures / f"{name}.png")


def _of_sweep(folder: Path, figures: Path) -> Section:
    record = json.loads((folder / "experiment.json").read_text(encoding="utf-8"))
    experiment = record["experiment"]
    points = pd.read_csv(folder / "points.csv")
    axes = [name for name in points.columns if name not in ("metric", "value", "low", "high", "n", "over")]
    safety, performance = experiment["safety"], experiment["performance"]
    table = with_front(wide(points, axes), safety, performance)
    figure = plot_front(table, axes, safety, performance, experiment["name"])
    save(figure, figures / "pareto")
    caption = f"Points of the sweep. {intervals_of(points)}; ★: on the Pareto front of its panel."
    inner = [name for name in axes if name not in ("environment", "policy", "test")]
    groups = [(label, rows.tolist()) for label, rows in groups_of(table)]
    return Section(
        f"Sweep {experiment['name']}",
        [experiment["about"], *words.of_sweep(table, inner, groups, safety, performance), missing_in(folder)],
        [Table(figures.name, caption, texts(table, axes, shown_metrics(table, safety, performance)))],
        [
            Figure(
                f"Safety and performance: {metric_named(safety).label} against {metric_named(performance).label}, with "
                "the Pareto front.",
                figures / "pareto.png",
            )
        ],
        command=sweep_command(record),
    )


def sweep_command(record: dict[str, Any]) -> str:
    """The command line that makes a sweep again."""
    return shlex.join(["rss-shield", "sweep", file_of(record), *record.get("options", [])])


def file_of(record: dict[str, Any]) -> str:
    """The experiment file that a sweep was called with; where it has not recorded that, one of its name."""
    own = Path("experiments") / f"{record['experiment']['name']}.yaml"
    return record.get("file") or str(own if own.exists() else own.name)


def read_episodes(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "episodes.csv")


def turned(frame: pd.DataFrame, headings: Sequence[str]) -> pd.DataFrame:
    """The metrics of some headings, a cell a row."""
    chosen = [name for name in frame.columns[2:] if name == "n" or name.split(" [")[0] in headings]
    cells = (frame["train"] + " / " + frame["test"]).rename("train / test")
    return pd.concat([cells, frame[chosen]], axis=1)


def returns_by_road(folders: Sequence[Path]) -> dict[str, pd.Series]:
    """Environment, and its configuration if it has one of its own -> mean return by train, test and train_seed.

    Of a cell in several runs on one road the first counts.
    """
    roads: dict[str, pd.Series] = {}
    for folder in folders:
        if not ((folder / "episodes.csv").exists() and (folder / "config.json").exists()):
            continue
        config = record_in(folder)["config"]
        own = f" {json.dumps(config['config'], sort_keys=True)}" if config.get("config") else ""
        road = f"{config['env_id']}{own}"
        means = with_outcomes(read_episodes(folder)).groupby(["train", "test", "train_seed"])["return"].mean()
        if road in roads:
            new = ~means.index.droplevel("train_seed").isin(roads[road].index.droplevel("train_seed"))
            means = pd.concat([roads[road], means[new]])
        roads[road] = means
    return roads


def scores_of(roads: dict[str, pd.Series]) -> dict[str, np.ndarray]:
    """Cell -> `[S, R]` returns from 0 (the worst cell of a road) to 1 (its best), of the seeds that all roads have."""
    columns = []
    for returns in roads.values():
        means = returns.groupby(["train", "test"]).mean()
        span = means.max() - means.min()
        columns.append((returns - means.min()) / (span if span > 0 else 1.0))
    cells = pd.concat(columns, axis=1, join="inner").groupby(["train", "test"], sort=False)
    return {" / ".join(map(str, cell)): rows.to_numpy() for cell, rows in cells}


def across_roads(folders: Sequence[Path], figures: Path) -> Section | None:
    """What arms do on several roads together, over the training seeds that they have on all of them.

    Returns:
      None for fewer than two roads, or fewer than two cells that they share.
    """
    roads = returns_by_road(folders)
    scores = scores_of(roads) if len(roads) > 1 else {}
    if len(scores) < 2:
        return None
    figures.mkdir(parents=True, exist_ok=True)
    plot_profiles(scores, figures, f"Performance profiles over {len(roads)} roads")
    first, rows = next(iter(scores)), []
    for name, table in scores.items():
        middle = interquartile_mean(table, np.random.default_rng(0))
        better = probability_of_improvement(table, scores[first], np.random.default_rng(0))
        rows.append(
            {
                "train / test": name,
                "seeds": str(len(table)),
                "interquartile mean": _texted(middle),
                f"better than {first}": "–" if name == first else _texted(better),
            }
        )
    caption = (
        "Returns of all roads together, on each from 0 (worst cell) to 1 (best). 95 % intervals over training seeds "
        "(stratified bootstrap; too narrow with fewer than ten seeds)."
    )
    text = "Profiles: the share of runs (a seed on a road) whose return is above each value; a band is 95 % over seeds."
    return Section(
        "All roads together",
        [f"{len(roads)} roads: {', '.join(roads)}."],
        [Table("roads", caption, pd.DataFrame(rows))],
        [Figure(text, figures / "profiles.png")],
    )


def _texted(interval: Interval) -> str:
    return f"{interval.value:.2f} [{interval.low:.2f}, {interval.high:.2f}]"
