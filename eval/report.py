"""Everything a finished run reports, from its episodes and learning curves.

`python -m rss_shield.eval.report runs/NAME` writes the report of a run anew, without training or testing.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from rss_shield.eval import multipliers, removal
from rss_shield.eval.arms import Arm, arm_named
from rss_shield.eval.cards import write_card
from rss_shield.eval.files import atomic, write_json
from rss_shield.eval.frontier import plot_frontier
from rss_shield.eval.metrics import differences, summarise
from rss_shield.eval.plots import plot_blame, plot_learning_curve
from rss_shield.eval.replay import compare, verdict
from rss_shield.eval.run_folder import given
from rss_shield.eval.table import print_table, write_table

USUAL_OPTIONS = {  # of `rss-shield train`, which a title names where they are others
    "backend": "fast",
    "traffic": "stock",
    "filter": "rss",
    "filter_at": None,
    "examine": "table",
    "correction": "nearest",
    "replace": "frame",
    "penalty_on": "response",
    "history": 1,
    "network": "mlp",
}
_PLACE = {"line": "at the line", "anywhere": "anywhere"}


def write_report(folder: Path) -> None:
    """Read episodes/*.csv, replays/*.csv and */learning_curve.csv of a run; print and write table, figures, results.

    Writes episodes.csv, results.json, table.txt, .md, .tex and .csv, learning_curve.png and .pdf, removal.png and .pdf,
    blame.png and .pdf, the cards of the models; frontier.png and .pdf with more than two arms; multiplier.png and
    .pdf where a price moved; replays.csv if episodes
    were replayed.
    """
    run = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    config = run["config"]
    arms, seeds = [arm_named(name) for name in config["arms"]], config["seeds"]
    models = [(arm.name, seed) for arm in arms if not arm.scripted for seed in seeds]
    cells = [
        (arm.name, seed, test) for arm in arms for test in arm.tests for seed in (seeds[:1] if arm.scripted else seeds)
    ]
    episodes = pd.concat(
        [read_cell(cell_path(folder, *cell)) for cell in cells],
        ignore_index=True,
    )
    curves = [
        read_cell(folder / f"{arm}-seed{seed}" / "learning_curve.csv").assign(arm=arm, train_seed=seed)
        for arm, seed in models
    ]
    removals = removal.read_all(folder, models)
    replayed = [path for path in (replay_path(folder, *cell) for cell in cells) if path.exists()]
    compared = compare(episodes, pd.concat(map(read_cell, replayed), ignore_index=True)) if replayed else None
    note = "" if compared is None else verdict(compared)
    summary = summarise(episodes)
    with atomic(folder / "episodes.csv") as temporary:
        episodes.to_csv(temporary, index=False)
    if compared is not None:
        with atomic(folder / "replays.csv") as temporary:
            compared.to_csv(temporary, index=False)
    write_json(
        folder / "results.json",
        {
            "config": config,
            "cells": summary.to_dict("records"),
            "differences_to_first_cell": differences(episodes).to_dict("records"),
            "replays": [] if compared is None else compared.to_dict("records"),
        },
    )
    title = title_of(config)
    for arm, seed in models:
        of_model = (episodes["train"] == arm_named(arm).called) & (episodes["train_seed"] == seed)
        write_card(folder / f"{arm}-seed{seed}", arm, seed, run, episodes[of_model])
    write_table(summary, folder, title, note)
    if curves:
        plot_learning_curve(pd.concat(curves, ignore_index=True), folder, str(config["env_id"]))
    if len(arms) > 2:
        plot_frontier(summary, folder, str(config["env_id"]))
    prices = multipliers.read_all(folder, models)
    if len(prices):
        multipliers.plot_multipliers(prices, folder, str(config["env_id"]))
    if len(removals):
        removal.plot_removal(removals, folder, str(config["env_id"]))
    plot_blame(episodes, folder, str(config["env_id"]))
    print_table(summary, title, Console(width=None if sys.stdout.isatty() else 160), note)


def title_of(config: dict[str, Any]) -> str:
    """What a run is: who drove where, under which table and rules, how much they learnt, and what else is unusual.

    Args:
      config: of its record; what an older run lacks is as usual.
    """
    arms = [arm_named(name) for name in config["arms"]]
    table = "".join(given(option, config.get(option, {})) for option in ("ego", "other", "rules"))
    unusual = [f"{name} {config[name]}" for name, usual in USUAL_OPTIONS.items() if config.get(name, usual) != usual]
    return ", ".join(
        [
            f"{_who(arms)} on {config['env_id']}{given('config', config.get('config', {}))}",
            f"RSS preset {config.get('preset', 'auto')}{table}",
            *unusual,
            *_conduct(config),
            *([f"reward {config['reward']}"] if config.get("reward") else []),
            *(["nobody learns"] if all(arm.scripted for arm in arms) else _learnt(config)),
        ]
    )


def _learnt(config: dict[str, Any]) -> list[str]:
    seeds = len(config["seeds"])
    return [
        f"{config['total_timesteps']} timesteps per arm{given('hyperparameters', config.get('hyperparameters', {}))}",
        _penalty(config),
        f"{seeds} training seed{'s' if seeds > 1 else ''}",
    ]


def _who(arms: Sequence[Arm]) -> str:
    if all(arm.scripted for arm in arms):
        return "Drivers"
    return "PPO" if all(arm.learner == "ppo" for arm in arms) else "Agents"


def _penalty(config: dict[str, Any]) -> str:
    """The training reward of the shielded arm is not that of the other one if there is a penalty."""
    penalty = config["intervention_penalty"]
    return f"intervention penalty {penalty:g} in training" if penalty else "no intervention penalty"


def _conduct(config: dict[str, Any]) -> list[str]:
    """How the ego behaves where roads cross; empty where none do."""
    if not config["parameters"].get("roads_cross"):
        return []
    return [f"{config['entry']} entry", f"{config['intent']} intent", f"waiting {_PLACE[config['waiting']]}"]


def cell_path(folder: Path, arm: str, seed: int, test: str) -> Path:
    """The episodes of one trained model under one test condition."""
    return folder / "episodes" / f"{arm_named(arm).file}-seed{seed}-test-{test}.csv"


def replay_path(folder: Path, arm: str, seed: int, test: str) -> Path:
    """Those of the episodes that were played again on the original simulator."""
    return folder / "replays" / cell_path(folder, arm, seed, test).name


def write_cell(path: Path, episodes: pd.DataFrame, arm: str, seed: int, test: str) -> None:
    path.parent.mkdir(exist_ok=True)
    labelled = episodes.assign(train=arm_named(arm).called, test=test, train_seed=seed)
    with atomic(path) as temporary:
        labelled.to_csv(temporary, index=False)


def read_cell(path: Path) -> pd.DataFrame:
    """Read episodes as they were written; a float keeps its last bit."""
    return pd.read_csv(path)


if __name__ == "__main__":
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "config.json").exists():
        sys.exit("usage: python -m rss_shield.eval.report RUN, the folder of a finished run, e.g. runs/highway-fast-v0")
    write_report(Path(sys.argv[1]))
