"""The page of sweeps: a table, sentences and the Pareto front of each.

    python -m rss_shield.eval.paper.sweeps runs/presets runs/response-times --out docs/results

writes sweeps.md and a figure for each from finished runs of `rss-shield sweep`.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from rss_shield.eval.files import atomic, linked_names
from rss_shield.eval.pages import write_page
from rss_shield.eval.paper import words
from rss_shield.eval.paper.read import file_of, sweep_command
from rss_shield.eval.provenance import provenance, records_of
from rss_shield.eval.runs.points import APART, groups_of, with_front
from rss_shield.eval.runs.store import missing_in
from rss_shield.eval.runs.tables import markdown_of, plot_front, shown_metrics, texts, wide

PAGE = "sweeps.md"
HEADER = """# Sweeps

Written by `python -m rss_shield.eval.paper.sweeps runs/NAME ...` from runs of `rss-shield sweep`.

[low, high]: 95 % intervals over episodes, of rates Clopper-Pearson's, else bootstrap; with several seeds over seeds and
episodes (Student's t); ★: on the Pareto front of its environment and policy, where no other row is as good in both
measures and better in one. Settings are compared on the
same episodes; rows whose intervals overlap may be on the front by chance."""


def section_of(folder: Path, out: Path) -> list[str]:
    """The parts of the page on one sweep; draws its figure into `out`.

    Raises:
      ValueError: the sweep is not finished.
    """
    if not (folder / "points.csv").exists():
        raise ValueError(f"{folder}: expected a finished sweep (points.csv); rss-shield sweep comes first")
    (record,) = records_of([folder])
    experiment, points = record["experiment"], pd.read_csv(folder / "points.csv")
    axes = [name for name in points.columns if name not in ("metric", "value", "low", "high", "n", "over")]
    safety, performance = experiment["safety"], experiment["performance"]
    table = with_front(wide(points, axes), safety, performance)
    groups = [(label, rows.tolist()) for label, rows in groups_of(table)]
    inner = [name for name in axes if name not in APART]
    (name,) = linked_names([f"sweeps-{experiment['name']}"])
    picture = out / f"{name}.png"
    with atomic(picture) as temporary:
        plot_front(table, axes, safety, performance, experiment["name"]).savefig(temporary, format="png")
    sentences = [*words.of_sweep(table, inner, groups, safety, performance), missing_in(folder)]
    fixed = experiment["options"]
    return [
        f"## `{file_of(record)}`",
        experiment["about"],
        played(experiment) + (f"; all with {json.dumps(fixed)}." if fixed else "."),
        "\n".join(f"- {sentence}" for sentence in sentences if sentence),
        f"![Safety and performance of {experiment['name']}]({picture.name})",
        markdown_of(texts(table, axes, shown_metrics(table, safety, performance))),
        f"```sh\n{sweep_command(record)}\n```",
        provenance([record]),
    ]


def played(experiment: dict[str, Any]) -> str:
    """How much a row of the table stands for."""
    episodes, seeds = experiment["tests"]["episodes"], len(experiment["seeds"])
    return f"{episodes} episodes a row" if seeds == 1 else f"{episodes} episodes for each of {seeds} seeds a row"


def write(folders: Sequence[Path], out: Path) -> Path:
    """Write the page and its figures; returns the page.

    Raises:
      ValueError: a sweep that is not finished.
    """
    out.mkdir(parents=True, exist_ok=True)
    write_page(out / PAGE, [HEADER, *(part for folder in folders for part in section_of(folder, out))])
    return out / PAGE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sweeps", nargs="+", type=Path, help="folders of finished sweeps")
    parser.add_argument("--out", type=Path, default=Path("docs/results"), help="folder (default: %(default)s)")
    arguments = parser.parse_args()
    try:
        print(f"written: {write(arguments.sweeps, arguments.out)}")
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
