"""Pages of results, written by the commands that measure.

`python -m rss_shield.eval.pages runs/highway-fast-v0 runs/intersection-v0` puts these runs of `train.py` on the page
docs/results/ppo.md; without names, all below runs/.
"""

import argparse
import json
import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from rss_shield.eval import arms
from rss_shield.eval.files import write_text
from rss_shield.eval.provenance import provenance, records_of
from rss_shield.eval.replay import verdict
from rss_shield.eval.table import legend, markdown, table_frame

__all__ = ["fill", "markdown", "spaced", "write_page"]  # what pages are written with


def spaced(number: int) -> str:
    """A whole number in groups of three digits: 7 754 999."""
    return f"{number:,}".replace(",", " ")


def write_page(path: Path, parts: Iterable[str]) -> None:
    """Write a page, its parts one blank line apart; the old page stays until the new one is there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, "\n\n".join(part.strip("\n") for part in parts) + "\n")


def fill(path: Path, name: str, block: str) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- /name -->` in a file, and nothing else.

    Raises:
      ValueError: the file does not have each marker once, in this order.
    """
    text = path.read_text(encoding="utf-8")
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise ValueError(f"{path}: expected {begin} and {end} once each, in this order")
    before, after = text.split(begin)[0], text.split(end)[1]
    write_text(path, f"{before}{begin}\n{block}\n{end}{after}")


# ---------------------------------------------------------------- runs of train.py


USUAL = ("unshielded", "shielded")  # arms
PPO_PAGE = Path("docs/results/ppo.md")
PPO_HEADER = """# PPO with and without the shield

Written by `python -m rss_shield.eval.pages` from the runs of `train.py` below `runs/`."""


def ppo_page(runs: Iterable[Path]) -> list[str]:
    """The parts of the page of trained agents: a table per finished run, and what its rows mean."""
    parts = [PPO_HEADER]
    legends: list[str] = []
    for run in runs:
        path = run / "results.json"
        if not path.exists():
            continue
        results = json.loads(path.read_text(encoding="utf-8"))
        summary = pd.DataFrame(results["cells"])
        frame = table_frame(summary)
        title, config = (run / "table.md").read_text(encoding="utf-8").splitlines()[0], results["config"]
        recorded = run / "config.json"
        record = json.loads(recorded.read_text(encoding="utf-8")) if recorded.exists() else {"config": config}
        parts += [f"## `{config['env_id']}`, {run.name}", f"{title}.", f"```sh\n{command(record)}\n```"]
        parts += [markdown(_turned(frame)), *_replayed(results["replays"]), *_provenance(run)]
        legends.append(legend(summary))
    return [*parts, "## What the rows mean", max(legends, key=len)] if legends else parts


def command(record: dict[str, Any]) -> str:
    """The command line that asks for the same as a run did, in a folder of its own.

    Args:
      record: of the run, `config.json`.
    """
    return shlex.join(["rss-shield", "train", *map(str, record.get("command") or _told(record["config"]))])


def _told(config: dict[str, Any]) -> list[Any]:
    """Options of a run that is older than the record of its command, as far as pages tell of it."""
    words = ["--env-id", config["env_id"], "--total-timesteps", config["total_timesteps"], "--seeds", *config["seeds"]]
    if config.get("arms", list(USUAL)) != list(USUAL):
        words += ["--arms", *config["arms"]]
    if config["parameters"].get("roads_cross"):
        words += ["--intent", config["intent"], "--entry", config["entry"], "--waiting", config["waiting"]]
    if config.get("reward"):
        words += ["--reward", config["reward"]]
    if config["intervention_penalty"]:
        words += ["--intervention-penalty", config["intervention_penalty"]]
    for name, usual in (("eval_episodes", 1000), ("explore_for", 1), ("history", 1), ("network", "mlp")):
        if config.get(name, usual) != usual:
            words += [f"--{name.replace('_', '-')}", config[name]]
    if config.get("config"):
        words += ["--config", json.dumps(config["config"])]
    for name, value in config.get("hyperparameters", {}).items():
        words += [f"--hyperparameters.{name.replace('_', '-')}", json.dumps(value)]
    return words


def _provenance(run: Path) -> list[str]:
    records = records_of([run])
    return [provenance(records)] if records else []


def _turned(frame: pd.DataFrame) -> list[list[str]]:
    """The cells of the comparison side by side, a metric a row."""
    cells = list(frame["train"] + " / " + frame["test"])
    return [["train / test", *cells], *([name, *frame[name]] for name in frame.columns[2:])]


def _replayed(replays: list[dict[str, Any]]) -> list[str]:
    return [verdict(pd.DataFrame(replays))] if replays else []


# ---------------------------------------------------------------- arms


ARMS_PAGE = Path("docs/arms.md")


def arms_block() -> str:
    """The table of arms as the page has it."""
    heading, *rows = arms.table()
    return markdown([heading, *([f"`{row[0]}`", *row[1:]] for row in rows)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=Path, help="folders of runs of train.py; none: all below runs/")
    parser.add_argument("--arms", action="store_true", help=f"put the table of arms on {ARMS_PAGE}, and nothing else")
    parser.add_argument("--out", type=Path, default=PPO_PAGE.parent, help="folder (default: %(default)s)")
    arguments = parser.parse_args()
    if arguments.arms:
        fill(ARMS_PAGE, "arms", arms_block())
        print(f"written: {ARMS_PAGE}")
        return
    page = arguments.out / PPO_PAGE.name
    write_page(page, ppo_page(arguments.runs or sorted(Path("runs").iterdir())))
    print(f"written: {page}")


if __name__ == "__main__":
    main()
