"""`rss-shield report RUN...`: one page of what came out of runs and sweeps, to read, to print and to paste.

    rss-shield report runs/highway-fast-v0
    rss-shield report runs/highway-fast-v0 runs/merge-v0 runs/response-times --out runs/report

Writes OUT/index.html (self-contained), report.md, report.tex, and figures/RUN/*.png and .pdf. Nothing is trained.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from rss_shield.eval.files import folder_for, linked_names, refuse
from rss_shield.eval.paper.read import across_roads, kind_of, section_of
from rss_shield.eval.paper.render import write_report
from rss_shield.eval.provenance import records_of


@dataclass(frozen=True)
class Arguments:
    """One option a field."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders of finished runs of train, test and sweep."""
    out: Path | None = None
    """Folder of the report; by default report/ in the first run."""
    title: str = "Shielded and unshielded agents compared"
    """Heading of the page."""


def write(runs: tuple[Path, ...], out: Path | None, title: str) -> Path:
    """Write the report; returns the page, by default in report/ of the first run.

    Raises:
      ValueError: no run, or a folder that holds no finished one.
    """
    if not runs:
        raise ValueError("name a run or sweep folder, such as runs/highway-fast-v0")
    for run in runs:  # all of them, before anything is written
        kind_of(run)
    out = folder_for(out or runs[0] / "report")
    names = linked_names(map(_name, runs), taken=["roads"])
    sections = [section_of(run, out / "figures" / name) for run, name in zip(runs, names, strict=True)]
    together = across_roads(runs, out / "figures" / "roads")
    sections += [together] if together else []
    write_report(out, title, sections, footer(runs))
    return out / "index.html"


def _name(run: Path) -> str:
    """Of a folder, also of one that is named as it is seen from here, as . is."""
    return Path(os.path.abspath(run)).name


def footer(runs: tuple[Path, ...]) -> str:
    """From which code, versions and machines the numbers are."""
    lines = []
    for run in runs:
        for record in records_of([run]):
            versions = record.get("versions", record)
            packages = ", ".join(f"{package} {version}" for package, version in versions["packages"].items() if version)
            changed = " with changes" if versions["git_changes"] else ""
            code = f"code {versions['git_commit']}{changed}" if versions["git_commit"] else "code without a commit"
            cores = f", {versions['cores']} cores" if "cores" in versions else ""
            lines += [
                f"{_name(run)}: {code}; Python {versions['python']}; {versions['platform']}; {versions['cpu']}{cores}",
                f"  {packages}",
            ]
    return "\n".join(lines)


def run(arguments: list[str]) -> None:
    """What a command line asks for."""
    given = tyro.cli(Arguments, prog="rss-shield report", description=__doc__, args=arguments)
    try:
        page = write(given.runs, given.out, given.title)
    except (ValueError, OSError, IndexError) as error:
        refuse("rss-shield report", error)
    print(f"written: {page}, report.md, report.tex, figures/")
