"""The card of a trained model: what it was trained on and with, what it does in tests, how to load it.

`card.json` for programs, `card.md` for people, both beside `model.zip`.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rss_shield.eval.arms import arm_named
from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.metrics import METRICS, Metric, with_outcomes
from rss_shield.eval.pages import markdown
from rss_shield.eval.stats import Interval, student, wilson
from rss_shield.eval.table import rounded

ON_CARD = (
    *("crash", "at_fault", "other", "inherited", "none", "success", "return", "own_return", "speed", "length"),
    *("override_share", "anticipation_share", "mean_acceleration_change"),
)
# of the run's record: what a test of the model has to know, and what else it was trained with
SETTING = ("env_id", "config", "preset", "parameters", "entry", "intent", "waiting")
TRAINING = ("backend", "total_timesteps", "n_envs", "intervention_penalty", "penalty_on")


def write_card(folder: Path, arm: str, seed: int, run: dict[str, Any], episodes: pd.DataFrame) -> None:
    """Write the card of one model of a run.

    Args:
      folder: of the model.
      run: the record of the run, `config.json`.
      episodes: of this model, all tests; columns as in `eval.rollout.evaluate`, and test.
    """
    card = card_of(arm, seed, run, episodes)
    write_json(folder / "card.json", card)
    write_text(folder / "card.md", as_text(card))


def card_of(arm: str, seed: int, run: dict[str, Any], episodes: pd.DataFrame) -> dict[str, Any]:
    row, config = arm_named(arm), run["config"]
    tests = {str(test): results_of(rows) for test, rows in episodes.groupby("test", sort=False)}
    return {
        "arm": arm,
        "what": row.label,
        "train_seed": seed,
        **{name: config[name] for name in SETTING},
        "history": config.get("history", 1),
        "config": {**config["config"], **row.config},
        "options": config.get("shield_options", {}),
        "training": {
            **{name: config[name] for name in TRAINING},
            **({"reward": config["reward"]} if config.get("reward") else {}),
            "shield": dict(row.training),
            "learner": row.learner,
            "hyperparameters": config.get(row.name if row.settings else row.learner, {}),
        },
        "masked": row.masked,
        "tests": {name: {**options, **row.chooses} for name, options in row.tests.items()},
        "test_seeds": config["test_seeds"],
        "results": tests,
        "versions": {name: run[name] for name in ("python", "packages", "git_commit") if name in run},
    }


def results_of(episodes: pd.DataFrame) -> dict[str, Any]:
    """Value, interval and n of every metric on the card: rates with Wilson's interval, means with Student's."""
    outcomes = with_outcomes(episodes)
    known = {metric.name: metric for metric in METRICS}
    return {name: interval_of(known[name], outcomes[name])._asdict() for name in ON_CARD if name in outcomes}


def interval_of(metric: Metric, values: pd.Series) -> Interval:
    sample = values.astype(float).dropna().to_numpy()
    if metric.statistic == "rate":
        return wilson(int(sample.sum()), sample.size)
    interval = student(sample)
    return interval._replace(low=max(interval.low, metric.limits[0]), high=min(interval.high, metric.limits[1]))


def as_text(card: dict[str, Any]) -> str:
    """The card as Markdown."""
    training, tests = card["training"], card["results"]
    known = {metric.name: metric for metric in METRICS}
    names = [name for name in ON_CARD if any(name in results for results in tests.values())]
    rows = [["", *(f"shield {test}" for test in tests)]]
    rows += [[_heading(known[name]), *(_shown(known[name], r.get(name)) for r in tests.values())] for name in names]
    n = max((results["crash"]["n"] for results in tests.values()), default=0)
    seeds = card["test_seeds"]
    return "\n".join(
        [
            f"# {card['arm']}, seed {card['train_seed']}, on {card['env_id']}",
            "",
            f"{card['what']}. Learner `{training['learner']}`, {training['total_timesteps']} decisions, "
            f"{training['n_envs']} environments side by side; shield in training: {training['shield']}; "
            f"{_paid(training)}"
            f"RSS preset {card['preset']}; entry {card['entry']}, intent {card['intent']}, waiting {card['waiting']}.",
            f"Configuration that differs from the environment's: {card['config'] or 'none'}."
            + (f" Options of the shield that are not its defaults: {card['options']}." if card["options"] else "")
            + (f" It sees the last {card['history']} observations, `[H, ...]`." if card["history"] > 1 else ""),
            "",
            f"{n} test episodes a column, seeds {seeds['first']} to {seeds['last']}, greedy; [95 % interval]: Wilson's "
            "for rates, Student's for means.",
            "",
            markdown(rows),
            "",
            "Drive it:",
            "",
            "```sh",
            "rss-shield test model.zip",
            "```",
            "",
            "```python",
            "from pathlib import Path",
            "",
            "from rss_shield.agents.load import load_policy",
            "",
            'policy = load_policy(Path("model.zip"))  # observations [B, ...] -> actions [B]',
            "```",
            "",
        ]
    )


def _paid(training: dict[str, Any]) -> str:
    return f"reward {training['reward']}; " if "reward" in training else ""


def _heading(metric: Metric) -> str:
    return f"{metric.label} [{metric.unit}]" if metric.unit else metric.label


def _shown(metric: Metric, result: dict[str, Any] | None) -> str:
    if result is None or result["value"] is None:
        return "–"
    digits = max(metric.digits, 1)
    value, low, high = (rounded(metric.scale * np.float64(result[key]), digits) for key in ("value", "low", "high"))
    return f"{value} [{low}, {high}]"
