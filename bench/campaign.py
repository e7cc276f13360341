"""Every arm on two roads, with many seeds: what the pages about agents are written from.

    python bench/campaign.py                 begin, or go on: what is finished is not repeated (hours to days)
    python bench/campaign.py --list          what it consists of, and what is done
    python bench/campaign.py --plan short    the most telling arms with fewer seeds and decisions (two hours on 2 cores)
    python bench/campaign.py --write         docs/results/agents.md from what is done; with --list nothing is trained
    python bench/campaign.py --ship          models/ENVIRONMENT/ARM: those of the first seed, made small and tested
    python bench/campaign.py --divide 1000 --runs-dir trial -- --n-envs 2 --replay-episodes 0    try the whole chain
    python bench/campaign.py -- --workers 1  further options of train.py

Each part is a run of train.py, in `runs/campaign-PART`. Kill it whenever you like; a model, a test or a replay that is
there is kept, and a training goes on from its last block. Agents of the intersection are tested for 30 s as well as for
the 13 s of their training, and the frontier of each road is drawn from all of its parts.
"""

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pandas as pd

from rss_shield.agents.slim import write_slim
from rss_shield.eval.arms import ARMS
from rss_shield.eval.cards import write_card
from rss_shield.eval.files import atomic
from rss_shield.eval.paper.agents import write
from rss_shield.eval.runs.experiment import as_words, read_experiment
from rss_shield.shield.filters.answer import FILTERS, RSS

ROOT = Path(__file__).parents[1]
HIGHWAY, INTERSECTION = "highway-fast-v0", "intersection-v0"
MAIN = ("unshielded", "shielded", "change-penalty-0.05", "adaptive-penalty", "maskable", "ppo-lagrangian")
SCRIPTED = tuple(arm.name for arm in ARMS.values() if arm.scripted)
PENALTIES = tuple(name for name in ARMS if "penalty-0" in name or name == "penalty-1")
VARIANTS = ("reward-shaping", "adaptive-share", "proactive", "executed-action", "sailr")
RIVALS = tuple(name for name in FILTERS if name != FILTERS[RSS])  # along lanes only
Q_LEARNERS = ("dqn", "dqn-shielded", "executed-action-dqn", "qr-dqn", "qr-dqn-shielded", "semantic-dqn")
CONTINUOUS = ("sac", "sac-replaced", "sac-projected")  # in the engine on motorways only
LONG = 30  # [s] of an episode at the intersection


class Part(NamedTuple):
    """A run of train.py."""

    name: str
    env_id: str
    arms: tuple[str, ...]
    decisions: int
    seeds: int
    episodes: int = 1000
    options: tuple[str, ...] = ()  # further ones of train.py


def seeing() -> tuple[str, ...]:
    """Options without which Q-learners find no more at the intersection than to drive on: the best of its sweep."""
    swept = read_experiment(ROOT / "experiments" / "intersection.yaml")
    learnt = {name: value for name, value in swept.options.items() if name.startswith("hyperparameters.")}
    return tuple(as_words({**learnt, **swept.points["destinations, others alike"]}))


SEEING = seeing()
OTHERS = tuple(name for name in (*PENALTIES, *VARIANTS) if name not in MAIN)
PARTS = (
    Part("highway-main", HIGHWAY, MAIN, 1_000_000, 10),
    Part("highway-scripted", HIGHWAY, SCRIPTED, 1, 1),
    Part("highway-others", HIGHWAY, (*OTHERS, *RIVALS), 1_000_000, 5),
    Part("highway-off-policy", HIGHWAY, (*Q_LEARNERS, *CONTINUOUS), 200_000, 5),
    Part("intersection-main", INTERSECTION, MAIN, 500_000, 10),
    Part("intersection-scripted", INTERSECTION, SCRIPTED, 1, 1),
    Part("intersection-others", INTERSECTION, OTHERS, 500_000, 5),
    Part("intersection-off-policy", INTERSECTION, Q_LEARNERS, 200_000, 5, options=SEEING),
)
TELLING = ("change-penalty-0.02", "change-penalty-0.1", "penalty-0.5", "reward-shaping", "sailr", "proactive")
IN_ENGINE = tuple(name for name in SCRIPTED if not ARMS[name].backend)  # quick
SHORT = (
    Part("short-highway-main", HIGHWAY, MAIN, 200_000, 5),
    Part("short-highway-scripted", HIGHWAY, IN_ENGINE, 1, 1),
    Part("short-highway-idm", HIGHWAY, ("idm",), 1, 1, 200),
    Part("short-intersection-main", INTERSECTION, MAIN, 100_000, 3),
    Part("short-intersection-scripted", INTERSECTION, IN_ENGINE, 1, 1),
    Part("short-intersection-idm", INTERSECTION, ("idm",), 1, 1, 200),
    Part("short-intersection-off-policy", INTERSECTION, ("dqn", "dqn-shielded", "qr-dqn"), 100_000, 2, options=SEEING),
    Part("short-highway-others", HIGHWAY, (*TELLING, "distance-45m", "literal-def10"), 200_000, 3),
    Part("short-highway-off-policy", HIGHWAY, (*Q_LEARNERS, *CONTINUOUS), 50_000, 3),
)
PLANS = {"full": PARTS, "short": SHORT}


def folder_of(part: Part, runs: Path) -> Path:
    return runs / f"campaign-{part.name}"


def size_of(part: Part, divide: int) -> dict[str, Any]:
    """What is asked for, by train.py's names."""
    return {
        "arms": list(part.arms),
        "seeds": list(range(part.seeds if divide == 1 else 1)),
        "total_timesteps": max(part.decisions // divide, 1),
        "eval_episodes": max(part.episodes // divide, 1),
    }


def is_done(part: Part, runs: Path, divide: int = 1) -> bool:
    """Is all of it there? What a trial or an earlier plan left is another run."""
    folder = folder_of(part, runs)
    if not (folder / "results.json").exists():
        return False
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))["config"]
    return all(config[name] == value for name, value in size_of(part, divide).items())


def train(part: Part, runs: Path, divide: int, more: list[str]) -> None:
    """Begin a part, or go on with it."""
    folder, size = folder_of(part, runs), size_of(part, divide)
    options = ["--env-id", part.env_id, "--arms", *size["arms"], "--seeds", *map(str, size["seeds"])]
    options += ["--total-timesteps", str(size["total_timesteps"]), "--eval-episodes", str(size["eval_episodes"])]
    options += ["--runs-dir", str(runs), "--name", folder.name, "--resume-or-start", *part.options, *more]
    call([str(ROOT / "train.py"), *options])


def test_long(part: Part, runs: Path, divide: int) -> None:
    """The agents of a part on longer episodes, each once."""
    for model in sorted(folder_of(part, runs).glob("*/model.zip")):
        out = model.parent / f"tested-{LONG}s"
        if not (out / "table.md").exists():
            count = str(max(part.episodes // divide, 1))
            options = [str(model), "--config.duration", str(LONG), "--episodes", count, "--out", str(out)]
            call(["-m", "rss_shield.test", *options])


def call(arguments: list[str]) -> None:
    """A Python process in the checkout; its failure is ours."""
    print("+ python", *arguments, flush=True)
    code = subprocess.run([sys.executable, *arguments]).returncode
    if code:
        sys.exit(code)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="show the parts and what is done, and stop")
    parser.add_argument("--plan", choices=list(PLANS), default="full", help="how much of it (default: %(default)s)")
    parser.add_argument("--parts", nargs="+", help="only these of the plan")
    parser.add_argument("--write", action="store_true", help="write agents.md into --out from the parts that are done")
    parser.add_argument("--ship", action="store_true", help="copy the models of the first seed into models/")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "docs" / "results", help="folder of the page (default: %(default)s)"
    )
    parser.add_argument("--runs-dir", type=Path, default=Path("runs"), help="folder of all runs (default: %(default)s)")
    parser.add_argument("--divide", type=int, default=1, help="decisions and episodes by this number, and one seed")
    parser.add_argument("more", nargs="*", metavar="-- OPTION", help="further options of train.py")
    arguments = parser.parse_args()
    if arguments.divide < 1:
        parser.error(f"--divide {arguments.divide}: expected at least 1")
    runs: Path = arguments.runs_dir
    plan = {part.name: part for part in PLANS[arguments.plan]}
    unknown = [name for name in arguments.parts or () if name not in plan]
    if unknown:
        parser.error(f"--parts {' '.join(unknown)}: expected some of {', '.join(plan)}")
    chosen = [part for part in plan.values() if arguments.parts is None or part.name in arguments.parts]
    if arguments.list or arguments.ship:
        for part in chosen:
            state = "done" if is_done(part, runs, arguments.divide) else "to do"
            print(f"{part.name}: {state}; {part.decisions} decisions, {part.seeds} seeds, {', '.join(part.arms)}")
    else:
        play(chosen, runs, arguments)
    if arguments.write:
        done = [folder_of(part, runs) for part in chosen if is_done(part, runs, arguments.divide)]
        if not done:
            parser.error(f"--write: nothing is done in {runs} of {', '.join(part.name for part in chosen)}")
        print(f"written: {write(done, arguments.out)}")
    if arguments.ship:
        for part in chosen:
            if is_done(part, runs, arguments.divide):
                ship(part, runs, ROOT / "models")


def ship(part: Part, runs: Path, to: Path) -> None:
    """The models of a part's first seed, made small, and their cards with what the small ones do in tests."""
    run = folder_of(part, runs)
    record = json.loads((run / "config.json").read_text(encoding="utf-8"))
    for arm in part.arms:
        model, folder = run / f"{arm}-seed0" / "model.zip", to / part.env_id / arm
        if not model.exists():  # nobody learns
            continue
        folder.mkdir(parents=True, exist_ok=True)
        with atomic(folder / "model.zip") as small:
            write_slim(model, small)
        shutil.copyfile(model.parent / "card.json", folder / "card.json")
        with TemporaryDirectory() as out:
            seeds, tests = record["config"]["test_seeds"], ARMS[arm].tests
            options = ["--first-seed", str(seeds["first"]), "--episodes", str(seeds["last"] - seeds["first"] + 1)]
            call(["-m", "rss_shield.test", str(folder / "model.zip"), *options, "--tests", *tests, "--out", out])
            write_card(folder, arm, 0, record, pd.read_csv(Path(out) / "episodes.csv"))
        print(f"written: {folder}")


def play(chosen: list[Part], runs: Path, arguments: argparse.Namespace) -> None:
    """Begin some parts, or go on with them."""
    for part in chosen:
        if not is_done(part, runs, arguments.divide):
            train(part, runs, arguments.divide, arguments.more)
        if part.env_id == INTERSECTION:
            test_long(part, runs, arguments.divide)
    for env_id in dict.fromkeys(part.env_id for part in chosen):
        together = [str(folder_of(part, runs)) for part in chosen if part.env_id == env_id]
        call(["-m", "rss_shield.eval.frontier", *together, "--out", together[0]])


if __name__ == "__main__":
    main()
