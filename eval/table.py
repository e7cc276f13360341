"""The comparison as one table: in the terminal, as plain text, Markdown, LaTeX and CSV."""

from pathlib import Path

import numpy as np
import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table

from eval.files import atomic, write_text
from eval.metrics import metrics_in

LEGEND = (
    "train, test: shield off or on. crash (% of the n test episodes) = ego at fault + other at fault + inherited (the "
    "episode began in that danger) + none (unexplained: a bug). overridden: % of simulation frames on which a duty "
    "changed the command; anticipated: on which no duty did, but anticipation; change: of the acceleration, mean size "
    "over the frames. length: decisions. min TTC: smallest time to collision, median of the episodes. rms jerk: along "
    "the car; hard braking: % of frames below -3 m/s²; comfortable: % inside nuPlan's bounds of acceleration, jerk, "
    "lateral and yaw acceleration; min time gap: to the car ahead, median. [low, high]: 95 % interval over test "
    "episodes (rates Wilson, others bootstrap); other training seeds may differ by more."
)
GOAL_LEGEND = (
    " success: % of the n test episodes that reached the goal without a contact; time to goal: mean of those episodes."
)


def table_frame(summary: pd.DataFrame) -> pd.DataFrame:
    """One row per cell, texts only: train, test, n and a "value [low, high]" per metric."""
    rows = []
    for (train, test), cell in summary.groupby(["train", "test"], sort=False):
        cell = cell.set_index("metric")
        row = {"train": train, "test": test, "n": str(cell["n"].iloc[0])}
        for metric in metrics_in(cell.index):
            heading = f"{metric.label} [{metric.unit}]" if metric.unit else metric.label
            value, low, high = cell.loc[metric.name, ["value", "low", "high"]].to_numpy(float) * metric.scale
            row[heading] = with_interval(value, low, high, metric.digits)
        rows.append(row)
    return pd.DataFrame(rows)


def legend(summary: pd.DataFrame) -> str:
    """What the columns mean."""
    return LEGEND + GOAL_LEGEND * ("success" in set(summary["metric"]))


def with_interval(value: float, low: float, high: float, digits: int) -> str:
    """ "3.1 [2.8, 3.4]"; a dash for what is unknown."""
    if np.isnan(value):
        return "–"
    if np.isnan(low) or np.isnan(high):
        return f"{value:.{digits}f} [–]"
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def write_table(summary: pd.DataFrame, folder: Path, title: str, note: str = "") -> None:
    """Write table.txt, table.md, table.tex (texts) and table.csv (numbers, tidy) into `folder`.

    `note` stands below the legend.
    """
    frame = table_frame(summary)
    with atomic(folder / "table.txt") as temporary, open(temporary, "w", encoding="utf-8") as stream:
        print_table(summary, title, Console(file=stream, width=160), note)
    below = f"\n\n{note}" if note else ""
    write_text(folder / "table.md", f"{title}\n\n{_markdown(frame)}\n\n{legend(summary)}{below}\n")
    write_text(folder / "table.tex", _latex(frame))
    with atomic(folder / "table.csv") as temporary:
        summary.to_csv(temporary, index=False)


def print_table(summary: pd.DataFrame, title: str, console: Console, note: str = "") -> None:
    """Print the table, its legend and a note; on a narrow terminal the cells become the columns."""
    frame = table_frame(summary)
    table = _rich(frame, title)
    unbounded = console.options.update(max_width=10_000)
    if console.measure(table, options=unbounded).maximum > console.width:
        cells = frame["train"] + " / " + frame["test"]
        turned = frame.drop(columns=["train", "test"]).set_axis(cells).T
        table = _rich(turned.rename_axis("train / test", axis=0).reset_index(), title)
    console.print(table)
    console.print(legend(summary), markup=False, highlight=False)
    if note:
        console.print("\n" + note, markup=False, highlight=False)


def _rich(frame: pd.DataFrame, title: str) -> Table:
    """Headings and intervals break at the bracket only, so a column is as narrow as its interval."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for i, heading in enumerate(frame.columns):
        table.add_column(_broken(heading), justify="left" if i == 0 else "right", no_wrap=True)
    for row in frame.itertuples(index=False):
        table.add_row(*(_broken(text) for text in row))
    return table


def _broken(text: str) -> str:
    return text.replace(" [", "\n\\[")


def _markdown(frame: pd.DataFrame) -> str:
    lines = [frame.columns, ["---"] * len(frame.columns), *frame.itertuples(index=False)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


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
