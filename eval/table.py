"""The comparison as one table: in the terminal, as plain text, Markdown, LaTeX and CSV."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rss_shield.eval.files import atomic, write_text
from rss_shield.eval.metrics import metrics_in

LEGEND = (
    "train: shield off or on while PPO was trained, or the name of another arm; test: shield off or on. crash (% of "
    "the n test episodes) = ego at fault + other at fault + inherited (the episode began in that danger) + none "
    "(unexplained: a bug). overridden: % of simulation frames on which a duty changed the command; anticipated: on "
    "which no duty did, but anticipation; change: of the acceleration, mean size over the frames. length: decisions. "
    "min TTC: smallest time to collision, median of the episodes of all training seeds. rms jerk: along the car; hard "
    "braking: % of frames below -3 m/s²; comfortable: % inside nuPlan's bounds of acceleration, jerk, lateral and yaw "
    "acceleration; min time gap: to the car ahead, median. [low, high]: 95 % interval over test episodes of these "
    "trained models (rates Wilson, others bootstrap). (low, high): the same over training seeds, so what other seeds "
    "may give (Student's t of the seeds' values, at least as wide as the first; – for a single seed)."
)
MOST_DIGITS = 9  # what is closer to a limit is at the limit
GOAL_LEGEND = (
    " success: % of the n test episodes that reached the goal without a contact; time to goal: mean of those episodes."
)
OWN_LEGEND = " own return: of the reward that --reward names; return: of the environment's."


def table_frame(summary: pd.DataFrame) -> pd.DataFrame:
    """One row per cell, texts only: train, test, n and a "value [low, high] (seed_low, seed_high)" per metric."""
    rows = []
    for (train, test), cell in summary.groupby(["train", "test"], sort=False):
        cell = cell.set_index("metric")
        row = {"train": train, "test": test, "n": str(cell["n"].iloc[0])}
        for metric in metrics_in(cell.index):
            heading = f"{metric.label} [{metric.unit}]" if metric.unit else metric.label
            numbers = cell.loc[metric.name, ["value", "low", "high", "seed_low", "seed_high"]].to_numpy(float)
            limits = tuple(metric.scale * limit for limit in metric.limits)
            row[heading] = with_intervals(numbers * metric.scale, metric.digits, limits)
        rows.append(row)
    return pd.DataFrame(rows)


def legend(summary: pd.DataFrame) -> str:
    """What the columns mean."""
    shown = set(summary["metric"])
    return LEGEND + GOAL_LEGEND * ("success" in shown) + OWN_LEGEND * ("own_return" in shown)


def with_intervals(numbers: np.ndarray, digits: int, limits: tuple[float, ...] = ()) -> str:
    """Value, interval over episodes, interval over seeds: "3.1 [2.8, 3.4] (1.9, 4.3)"; a dash for what is unknown."""
    value, low, high, seed_low, seed_high = (rounded(number, digits, limits) for number in numbers)
    if value == "–":
        return value
    over_episodes = "[–]" if "–" in (low, high) else f"[{low}, {high}]"
    over_seeds = "(–)" if "–" in (seed_low, seed_high) else f"({seed_low}, {seed_high})"
    return f"{value} {over_episodes} {over_seeds}"


def rounded(number: float, digits: int, limits: tuple[float, ...] = ()) -> str:
    """At least `digits` decimals, and so many that it does not look like zero or a limit that it is only close to."""
    if np.isnan(number):
        return "–"
    away = min(abs(number - limit) for limit in (0.0, *limits))
    needed = math.ceil(-math.log10(away)) if 10.0**-MOST_DIGITS < away < 1 else 0
    return f"{number:z.{max(digits, needed)}f}"


def write_table(summary: pd.DataFrame, folder: Path, title: str, note: str = "") -> None:
    """Write table.txt, table.md, table.tex (texts) and table.csv (numbers, tidy) into `folder`.

    `note` stands below the legend.
    """
    frame = table_frame(summary)
    with atomic(folder / "table.txt") as temporary, open(temporary, "w", encoding="utf-8") as stream:
        print_table(summary, title, Console(file=stream, width=160), note)
    text = markdown([frame.columns, *frame.itertuples(index=False)])
    below = f"\n\n{note}" if note else ""
    write_text(
        folder / "table.md",
        f"{title}\n\n{text}\n\n{legend(summary)}{below}\n",
    )
    write_text(folder / "table.tex", _latex(frame))
    with atomic(folder / "table.csv") as temporary:
        summary.to_csv(temporary, index=False)


def print_table(summary: pd.DataFrame, title: str, console: Console, note: str = "") -> None:
    """Print the table, its legend and a note; on a narrow terminal the cells become the columns."""
    frame = table_frame(summary)
    table = _rich(frame, title)
    tables = [table]
    if not _fits(table, console):
        cells = frame["train"] + " / " + frame["test"]
        turned = frame.drop(columns=["train", "test"]).set_axis(cells).T
        tables = _side_by_side(turned, title, console)
    for table in tables:
        console.print(table)
    console.print(legend(summary), markup=False, highlight=False)
    if note:
        console.print("\n" + note, markup=False, highlight=False)


def _side_by_side(turned: pd.DataFrame, title: str, console: Console) -> list[Table]:
    """One cell a column, as many columns in a table as the console is wide."""
    for count in range(len(turned.columns), 0, -1):
        parts = [turned.iloc[:, first : first + count] for first in range(0, len(turned.columns), count)]
        tables = [_rich(part.rename_axis("train / test", axis=0).reset_index(), title) for part in parts]
        if all(_fits(table, console) for table in tables):
            break
    return tables


def _fits(table: Table, console: Console) -> bool:
    unbounded = console.options.update(max_width=10_000)
    return console.measure(table, options=unbounded).maximum <= console.width


def _rich(frame: pd.DataFrame, title: str) -> Table:
    """Headings and intervals break at the brackets only, so a column is as narrow as its widest interval."""
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for i, heading in enumerate(frame.columns):
        table.add_column(_broken(heading), justify="left" if i == 0 else "right", no_wrap=True)
    for row in frame.itertuples(index=False):
        table.add_row(*(_broken(text) for text in row))
    return table


def _broken(text: str) -> str:
    return text.replace(" [", "\n\\[").replace(" (", "\n(")


def markdown(rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table; the first row is its heading."""
    heading, *body = [[_cell(value) for value in row] for row in rows]
    lines = [heading, ["---"] * len(heading), *body]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(value: Any) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")


def _latex(frame: pd.DataFrame) -> str:
    """A booktabs tabular."""
    lines = [
        r"\begin{tabular}{ll" + "r" * (len(frame.columns) - 2) + "}",
        r"\toprule",
        " & ".join(_escaped(heading) for heading in frame.columns) + r" \\",
        r"\midrule",
        *(" & ".join(map(_escaped, row)) + r" \\" for row in frame.itertuples(index=False)),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    return text.replace("%", r"\%").replace("–", "--")
