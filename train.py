"""Train agents with and without the RSS shield, test each with and without it, and report who crashes."""

from rss_shield.eval.here import look_here
from rss_shield.eval.interrupt import stop_on_interrupt

if __name__ == "__main__":  # before all that takes its time
    stop_on_interrupt("train.py: stopping; nothing that is finished is lost, the same command with --resume goes on")

import multiprocessing
import sys

from rss_shield.agents.own_reward import RewardFailed
from rss_shield.command_line import fail
from rss_shield.eval.arms import arm_named, table
from rss_shield.eval.files import folder_for, refuse
from rss_shield.eval.jobs import run_jobs
from rss_shield.eval.own import OwnFailed
from rss_shield.eval.report import cell_path, replay_path, write_report
from rss_shield.eval.run_folder import open_run
from rss_shield.eval.suite.comparison.jobs import cells_of, in_engine, model_path, replaying, showing, testing, training
from rss_shield.eval.suite.comparison.options import COMMAND, Config
from rss_shield.eval.suite.comparison.reading import resolve, started
from rss_shield.eval.suite.comparison.record import DERIVED, options_of, record, words_of
from rss_shield.eval.suite.comparison.trying import tried

PROGRAM = "train.py" if __name__ == "__main__" else COMMAND  # as it was called
SHOWN = ("table.md", "results.json", "blame.png", "learning_curve.png", "removal.png", "frontier.png", "pages")


def main(arguments: list[str]) -> None:
    look_here()
    if "--list-arms" in arguments:
        print_arms()
        return
    try:
        config, folder = started(arguments, PROGRAM)
        preset = resolve(config)
        recorded = record(config, preset, tried(config, preset))
        folder_for(config.runs_dir, "--runs-dir")
        warnings = open_run(
            folder,
            recorded,
            resume=config.resume,
            overwrite=config.overwrite,
            defaults={**options_of(Config()), DERIVED: recorded[DERIVED]},
            command=words_of(config),
        )
    except (ValueError, OSError) as error:
        refuse(PROGRAM, error)
    for warning in warnings:
        print(f"{PROGRAM}: warning: {warning}", file=sys.stderr)

    models = [(arm, seed) for seed in config.seeds for arm in config.arms if not arm_named(arm).scripted]
    cells = [cell for seed in config.seeds for arm in config.arms for cell in cells_of(config, arm_named(arm), seed)]
    untrained = [model for model in models if not model_path(folder, *model).exists()]
    run_jobs([training(config, preset, folder, *model) for model in untrained], config.workers)
    untested = [cell for cell in cells if not cell_path(folder, *cell).exists()]
    run_jobs([testing(config, preset, folder, *cell) for cell in untested], config.workers)
    if config.backend == "fast" and config.replay_episodes:
        played = [cell for cell in cells if in_engine(arm_named(cell[0]))]
        unchecked = [cell for cell in played if not replay_path(folder, *cell).exists()]
        run_jobs([replaying(config, preset, folder, *cell) for cell in unchecked], config.workers)
    if config.pages:
        filmed = [arm for arm in config.arms if in_engine(arm_named(arm))]
        run_jobs([showing(config, preset, folder, arm) for arm in filmed], config.workers)

    write_report(folder)
    there = [name for name in SHOWN if (folder / name).exists()]
    print(f"\nEverything is in {folder}: {', '.join(there)}")


def print_arms() -> None:
    """The table of arms, as wide as it must be."""
    rows = table()
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())


def run(arguments: list[str]) -> None:
    """What a command line asks for."""
    # worker processes are forked from a server that has imported the slow packages once
    multiprocessing.set_forkserver_preload(
        [
            "rss_shield.envs.make_vec",
            "rss_shield.agents.blocks",
            "rss_shield.agents.ppo",
            "rss_shield.eval.jobs",
            "rss_shield.eval.orphans",
            "rss_shield.eval.rollout",
        ]
    )
    try:
        main(arguments)
    except (OwnFailed, RewardFailed) as error:
        fail(PROGRAM, str(error))


if __name__ == "__main__":
    run(sys.argv[1:])
