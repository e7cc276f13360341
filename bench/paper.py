"""Every number and figure of the pages that compare agents, parameters and rules, from nothing: `make paper`.

    python bench/paper.py                       begin, or go on: what is finished is not repeated
    python bench/paper.py --list                the commands, one a line
    python bench/paper.py --plan full           the whole campaign (days), not the short one (hours)
    python bench/paper.py --divide 1000         try the whole chain (minutes), in RUNS/divided-1000

Runs are in `--runs-dir`, pages and figures in `--out`, the report of all of it in RUNS/report; how long each command
took is in RUNS/paper-times.csv. Decisions and episodes are divided by `--divide`, seeds then are one or two.
"""

import argparse
import csv
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from bench.campaign import PLANS, folder_of  # noqa: E402
from rss_shield.eval.runs.experiment import Experiment, read_experiment  # noqa: E402

SWEEPS = ("ablation", "rules", "presets", "response-times", "intersection")
ON_THEIR_PAGE = ("presets", "response-times", "intersection")
# environment -> decisions of the runs on the page of PPO, and their further options
COMPARED = {
    "highway-fast-v0": (200_000, ["--seeds", "0", "1", "2"]),
    "intersection-v0": (50_000, ["--intent", "known", "--seeds", "0", "1", "2", "3", "4"]),
}
ADVERSARIES = 2000  # episodes a row of the ablation
TIMES = "paper-times.csv"


class Step(NamedTuple):
    """One command of Python in the checkout."""

    name: str
    words: list[str]


def steps_of(arguments: argparse.Namespace) -> Iterator[Step]:
    """The commands, in their order."""
    runs, out, divide, plan = arguments.runs_dir, str(arguments.out), arguments.divide, arguments.plan
    workers = ["--workers", str(arguments.workers)]
    campaign = ["bench/campaign.py", "--plan", plan, "--runs-dir", str(runs), "--out", out, "--divide", str(divide)]
    more = ["--", *workers, *_small(divide)]
    for part in PLANS[plan]:
        yield Step(f"campaign: {part.name}", [*campaign, "--parts", part.name, *more])
    yield Step("campaign: page", [*campaign, "--write", *more])
    for name in SWEEPS:
        file = f"experiments/{name}.yaml"
        words = [*RSS_SHIELD, "sweep", file, "--runs-dir", str(runs), *workers]
        yield Step(f"sweep: {name}", [*words, *_divided(read_experiment(ROOT / file), divide)])
    count = str(max(ADVERSARIES // divide, 2))
    words = ["bench/ablation.py", "--episodes", count, "--runs", str(runs), "--write", "--out", out]
    yield Step("ablation: page", words)
    swept = [str(runs / name) for name in ON_THEIR_PAGE]
    yield Step("sweeps: page", ["-m", "rss_shield.eval.paper.sweeps", *swept, "--out", out])
    for env_id, (decisions, further) in COMPARED.items():
        words = ["train.py", "--env-id", env_id, "--total-timesteps", str(max(decisions // divide, 1)), *further]
        words += ["--runs-dir", str(runs), "--name", env_id, "--resume-or-start", *workers, *_small(divide, pages=True)]
        yield Step(f"compare: {env_id}", words if divide == 1 else [*words, "--seeds", "0", "1"])  # the last ones count
    compared = [str(runs / env_id) for env_id in COMPARED]
    yield Step("compare: page", ["-m", "rss_shield.eval.pages", *compared, "--out", out])
    every = [*compared, *(str(folder_of(part, runs)) for part in PLANS[plan]), *(str(runs / name) for name in SWEEPS)]
    yield Step("report", [*RSS_SHIELD, "report", *every, "--out", str(runs / "report")])


RSS_SHIELD = ["-c", "from rss_shield.cli import main; main()"]  # the console command of this very interpreter


def _divided(experiment: Experiment, divide: int) -> list[str]:
    """Options of `rss-shield sweep`: little of everything where all is divided."""
    if divide == 1:
        return []
    words = ["--episodes", str(max(experiment.tests["episodes"] // divide, 2))]
    if not experiment.arms:
        return words
    return [*words, "--total-timesteps", str(max(experiment.options["total_timesteps"] // divide, 1))]


def _small(divide: int, pages: bool = False) -> list[str]:
    """Options of train.py: no pages for every arm of a campaign, and little of everything where all is divided."""
    shown = [] if pages else ["--replay-episodes", "0", "--no-pages"]
    if divide == 1:
        return shown
    episodes = ["--eval-episodes", str(max(1000 // divide, 4))] if pages else []
    return [*shown, *episodes, "--removal-checks", "2", "--removal-episodes", "2", "--n-envs", "8"]


def as_typed(step: Step) -> str:
    """The command, as one would type it."""
    if step.words[:2] == RSS_SHIELD:
        return shlex.join(["rss-shield", *step.words[2:]])
    return shlex.join(["python", *step.words])


def run(step: Step, times: Path) -> None:
    """Run a command; its failure is ours. Adds a row to the table of times."""
    print(f"+ {as_typed(step)}", flush=True)
    began = time.time()
    code = subprocess.run([sys.executable, *step.words], cwd=ROOT).returncode
    if code:
        sys.exit(f"bench/paper.py: {step.name} ended with code {code}; the same command goes on from here")
    new = not times.exists()
    with times.open("a", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerows([["step", "minutes"]] * new)
        rows.writerow([step.name, f"{(time.time() - began) / 60:.2f}"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plan", choices=list(PLANS), default="short", help="of the campaign (default: %(default)s)")
    parser.add_argument("--divide", type=int, default=1, help="decisions and episodes by this number")
    parser.add_argument("--workers", type=int, default=2, help="processes at a time (default: %(default)s)")
    parser.add_argument("--runs-dir", type=Path, default=Path("runs"), help="folder of all runs (default: %(default)s)")
    parser.add_argument(
        "--out", type=Path, help="folder of the pages (default: docs/results; where all is divided RUNS/pages)"
    )
    parser.add_argument("--list", action="store_true", help="show the commands, and run none")
    arguments = parser.parse_args()
    if arguments.divide < 1:
        parser.error(f"--divide {arguments.divide}: expected at least 1")
    arguments.runs_dir = arguments.runs_dir.resolve()
    if arguments.divide > 1:  # a trial overwrites no results, and is never taken for any
        arguments.runs_dir /= f"divided-{arguments.divide}"
    default = ROOT / "docs" / "results" if arguments.divide == 1 else arguments.runs_dir / "pages"
    arguments.out = (arguments.out or default).resolve()
    for step in steps_of(arguments):
        if arguments.list:
            print(as_typed(step))
        else:
            arguments.runs_dir.mkdir(parents=True, exist_ok=True)
            run(step, arguments.runs_dir / TIMES)


if __name__ == "__main__":
    main()
