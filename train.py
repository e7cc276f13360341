"""Train agents with and without the RSS shield, test each with and without it, and report who crashes."""

from rss_shield.eval.interrupt import stop_on_interrupt

if __name__ == "__main__":  # before all that takes its time
    stop_on_interrupt("train.py: stopping; nothing that is finished is lost, the same command with --resume goes on")

import itertools
import math
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from rss_shield.agents.blocks import available_devices
from rss_shield.agents.own_reward import RewardFailed
from rss_shield.agents.trackers import TRACKERS, check_tracker
from rss_shield.command_line import Overrides, fail, parsed, shown
from rss_shield.envs.arguments import rules_of
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import PENALTIES, WAITING, Options
from rss_shield.eval.arms import arm_named, table
from rss_shield.eval.config_option import HYPERPARAMETERS, Keys, split_arguments, with_values
from rss_shield.eval.jobs import run_jobs
from rss_shield.eval.own import OwnFailed, function_named, is_own
from rss_shield.eval.report import cell_path, replay_path, write_report
from rss_shield.eval.run_folder import changes, open_run, recorded
from rss_shield.eval.suite.comparison.acting import learner
from rss_shield.eval.suite.comparison.jobs import cells_of, in_engine, model_path, replaying, showing, testing, training
from rss_shield.eval.suite.comparison.making import wrapped
from rss_shield.eval.suite.comparison.naming import NAMES, run_name, valid_name
from rss_shield.eval.suite.comparison.options import COMMAND, HELP, Config
from rss_shield.eval.suite.comparison.record import options_of, record
from rss_shield.eval.suite.comparison.trying import tried
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, is_file, preset_in, usual_preset
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import PRESETS, Preset, with_parameters

PROGRAM = "train.py" if __name__ == "__main__" else COMMAND  # as it was called
SEEDS = "different whole numbers, 0 to 2**32 - 1, at least one"


def main(arguments: list[str]) -> None:
    if "--list-arms" in arguments:
        print_arms()
        return
    try:
        config, folder = started(arguments)
        preset = resolve(config)
        env = tried(config, preset)
        warnings = open_run(folder, record(config, preset, env), resume=config.resume, overwrite=config.overwrite)
    except (ValueError, OSError) as error:
        fail(PROGRAM, str(error))
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
    print(f"\nEverything is in {folder}: table.md, results.json, learning_curve.png, blame.png, ...")


def print_arms() -> None:
    """The table of arms, as wide as it must be."""
    rows = table()
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())


def started(arguments: list[str]) -> tuple[Config, Path]:
    """All options, and the folder of the run. What `--resume` finds there are the defaults of the rest.

    Raises:
      ValueError: the environment's configuration cannot be read, or options contradict those of the run.
    """
    options, values = split_arguments(arguments)
    options, altered = split_arguments(options, HYPERPARAMETERS)
    config = parse(options, Config())
    check(config)
    asked = config.resume
    options += ["--resume"] * (config.resume_or_start and not asked)
    config = replace(config, resume=asked or config.resume_or_start)
    before = recorded(config.runs_dir / config.name) if config.resume and config.name else None
    if before is None:
        config = complete(config, values, altered)
        config = replace(config, name=config.name or run_name(config))
        before = recorded(config.runs_dir / config.name) if config.resume else None
    folder = config.runs_dir / config.name
    if before is None:
        if asked and not config.resume_or_start and not folder.exists():
            raise ValueError(
                f"--resume: there is no run in {folder}; --name names another, --resume-or-start starts one there"
            )
        return replace(config, preset=preset_name(config)), folder
    stored = stored_config(before)
    config = parse(options, stored)
    config = replace(
        config,
        config={**stored.config, **config.config},
        hyperparameters={**stored.hyperparameters, **config.hyperparameters},
    )
    config = complete(config, values, altered)
    config = replace(config, preset=preset_name(config))
    contradictions = [
        f"--{name.replace('_', '-')} {shown(now)} contradicts {shown(then)}"
        for name, now, then in changes(options_of(config), options_of(stored))
    ]
    if contradictions:
        raise ValueError(
            f"{', '.join(contradictions)}, with which the run in {folder} was started; "
            "leave them out to go on with it, --overwrite starts it anew, --name chooses another folder"
        )
    return config, folder


def complete(config: Config, values: dict[Keys, Any], altered: dict[Keys, Any]) -> Config:
    """Options that are all in range, with single values put into the environment's configuration and learners."""
    check(config)
    config = replace(config, hyperparameters=with_values(config.hyperparameters, altered, {}))
    for arm in map(arm_named, config.arms):
        if not arm.scripted:
            learner(config, arm)
    if not (config.config or values):
        return config
    given = with_values(config.config, values, default_config(config.env_id))
    check_config(config.env_id, given)
    return replace(config, config=given)


def stored_config(options: dict[str, Any]) -> Config:
    """The options in a run's record; what was not recorded has its default."""
    known = {f.name: options[f.name] for f in fields(Config) if f.name in options}
    known["rules"] = rules_of(known.get("rules", {}))
    for name in ("arms", "seeds"):
        known[name] = tuple(known[name])
    for name in ("ego", "other"):
        known[name] = Overrides(**{parameter: float(value) for parameter, value in known[name].items()})
    return Config(**known)


def parse(arguments: list[str], default: Config) -> Config:
    """Read the command line. What cannot be read ends in one line and exit code 2."""
    check_seeds(arguments)
    return parsed(Config, PROGRAM, HELP, arguments, default)


def check_seeds(arguments: list[str]) -> None:
    """Whole numbers come after --seeds: the reader of the command line would not say which."""
    if "--seeds" not in arguments:
        return
    after = arguments[arguments.index("--seeds") + 1 :]
    seeds = list(itertools.takewhile(lambda word: not word.startswith("--"), after))
    if not seeds or not all(seed.lstrip("-").isdecimal() for seed in seeds if seed != "-h"):
        fail(PROGRAM, f"--seeds {shown(seeds)} is out of range: expected {SEEDS}")


def check(config: Config) -> None:
    """Refuse what is out of range, naming option, value and range. RSS parameters: see `resolve`."""
    try:
        rules_of(config.rules, "--rules")
        if config.tracker in TRACKERS:
            check_tracker(config.tracker)
        Options(**wrapped(config))
    except ValueError as error:
        fail(PROGRAM, str(error))
    devices, resumes = available_devices(), config.resume or config.resume_or_start
    looked_up: list[tuple[str, Callable[[str], Any], str]] = [("--arms", arm_named, arm) for arm in config.arms]
    looked_up += [("--arms", function_named, arm) for arm in config.arms if is_own(arm)]
    looked_up += [("--reward", function_named, config.reward)] * bool(config.reward)
    looked_up += [("--preset", preset_in, config.preset)] * is_file(config.preset)
    for option, look_up, name in looked_up:
        try:
            look_up(name)
        except ValueError as error:
            fail(PROGRAM, f"{option}: {error}")
    for option, good, expected in (
        ("backend", config.backend in BACKENDS, f"one of {', '.join(BACKENDS)}"),
        ("arms", is_set_of(config.arms, config.arms), "one or more different names"),
        ("preset", is_file(config.preset) or config.preset in ("auto", *PRESETS), f"one of auto, {KNOWN_PRESETS}"),
        ("total_timesteps", config.total_timesteps >= 1, "at least 1"),
        ("seeds", is_set_of(config.seeds, range(2**32)), SEEDS),
        ("entry", config.entry in ENTRIES, f"one of {', '.join(ENTRIES)}"),
        ("intent", config.intent in INTENTS, f"one of {', '.join(INTENTS)}"),
        ("waiting", config.waiting in WAITING, f"one of {', '.join(WAITING)}"),
        ("intervention_penalty", 0 <= config.intervention_penalty < math.inf, "a number >= 0"),
        ("penalty_on", config.penalty_on in PENALTIES, f"one of {', '.join(PENALTIES)}"),
        ("target_intervention", 0 <= config.target_intervention < math.inf, "a number >= 0"),
        ("target_share", 0 <= config.target_share <= 1, "0 to 1"),
        ("cost_limit", 0 <= config.cost_limit <= 1, "0 to 1"),
        ("removal_checks", config.removal_checks >= 0, "at least 0"),
        ("removal_episodes", config.removal_episodes >= 0, "at least 0"),
        ("eval_episodes", config.eval_episodes >= 1, "at least 1"),
        ("replay_episodes", config.replay_episodes >= 0, "at least 0"),
        ("n_envs", 1 <= config.n_envs <= 4096, "1 to 4096"),
        ("workers", 1 <= config.workers <= 256, "1 to 256"),
        ("tracker", config.tracker in TRACKERS, f"one of {', '.join(TRACKERS)}"),
        ("device", config.device in devices, f"one of {', '.join(devices)} on this machine"),
        ("name", config.name in ("", valid_name(config.name)), f"{NAMES}, such as {valid_name(config.name)}"),
        (
            "resume",
            not (resumes and config.overwrite),
            "--resume or --overwrite, not both",
        ),
    ):
        if not good:
            value = shown(getattr(config, option))
            fail(PROGRAM, f"--{option.replace('_', '-')} {value} is out of range: expected {expected}")


def is_set_of(values: tuple, accepted: Sequence) -> bool:
    """At least one value, none twice, all of them accepted."""
    return 0 < len(values) == len(set(values)) and all(value in accepted for value in values)


def preset_name(config: Config) -> str:
    """The preset asked for, or the one of the environment."""
    if config.preset != "auto":
        return config.preset
    return usual_preset(config.env_id)


def resolve(config: Config) -> Preset:
    """The preset with the parameters given on the command line put in."""
    try:
        return with_parameters(preset_in(preset_name(config)), config.ego.given, config.other.given)
    except ValueError as error:
        raise ValueError(f"--{error}") from None


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
