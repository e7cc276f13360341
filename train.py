"""Train agents with and without the RSS shield, test each with and without it, and report who crashes."""

from rss_shield.eval.interrupt import stop_on_interrupt

if __name__ == "__main__":  # before all that takes its time
    stop_on_interrupt("train.py: stopping; nothing that is finished is lost, the same command with --resume goes on")

import functools
import hashlib
import itertools
import math
import multiprocessing
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd

from rss_shield.agents.blocks import available_devices, train_in_blocks
from rss_shield.agents.load import load_policy, policy_of
from rss_shield.agents.own_reward import RewardFailed
from rss_shield.agents.trackers import TRACKERS, check_tracker
from rss_shield.command_line import Overrides, fail, parsed, shown
from rss_shield.envs.arguments import rules_of
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.envs.fast.config import Unsupported
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import PENALTIES, PLANS, WAITING, Options, scheme_of
from rss_shield.eval import removal
from rss_shield.eval.arms import Arm, arm_named, table
from rss_shield.eval.config_option import HYPERPARAMETERS, Keys, split_arguments, with_values
from rss_shield.eval.jobs import Job, run_jobs
from rss_shield.eval.own import OwnFailed, blaming, digests, function_named, is_own
from rss_shield.eval.replay import chosen, replay
from rss_shield.eval.report import cell_path, read_cell, replay_path, write_cell, write_report
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.run_folder import changes, open_run, recorded
from rss_shield.eval.suite import showcase
from rss_shield.eval.suite.comparison.acting import driver, learner
from rss_shield.eval.suite.comparison.making import batch, original, test_batch, wrapped
from rss_shield.eval.suite.comparison.options import COMMAND, FIRST_REMOVAL_SEED, FIRST_TEST_SEED, HELP, Config
from rss_shield.eval.suite.comparison.trying import tried
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, is_file, preset_in, usual_preset
from rss_shield.eval.suite.scored import columns_of, scored
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import PRESETS, Preset, Rules, with_parameters

TEST_ENVS = {"fast": 256, "highway-env": 1}  # side by side in testing; the engine is the faster, the more there are
PROGRAM = "train.py" if __name__ == "__main__" else COMMAND  # as it was called
Progress = Callable[[int], None]
NAMES = "letters, digits and . , = + - _"
SEEDS = "different whole numbers, 0 to 2**32 - 1, at least one"
LONGEST_NAME = 120
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{i}" for port in ("COM", "LPT") for i in range(10))}  # on Windows


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


def cells_of(config: Config, arm: Arm, seed: int) -> list[tuple[str, int, str]]:
    """Where an arm is tested; who learns nothing is tested once, not once a training seed."""
    if arm.scripted and seed != config.seeds[0]:
        return []
    return [(arm.name, seed, test) for test in arm.tests]


def in_engine(arm: Arm) -> bool:
    """Can its episodes be played by numbered meta-actions in the engine?"""
    return not arm.backend and not arm.continuous and not arm.chooses


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


def model_path(folder: Path, arm: str, seed: int) -> Path:
    """The trained model; `train` puts it there when it is finished."""
    return folder / f"{arm}-seed{seed}" / "model.zip"


def training(config: Config, preset: Preset, folder: Path, arm: str, seed: int) -> Job:
    total = learner(config, arm_named(arm)).rounded(config.n_envs, config.total_timesteps)
    return Job(f"train {arm}, seed {seed}", total, "step", functools.partial(_train, config, preset, folder, arm, seed))


def testing(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str) -> Job:
    work = functools.partial(_test, config, preset, folder, arm, seed, test)
    return Job(f"test {arm}, seed {seed}, shield {test}", config.eval_episodes, "episode", work)


def replaying(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str) -> Job:
    count = min(config.replay_episodes, config.eval_episodes)
    work = functools.partial(_replay, config, preset, folder, arm, seed, test)
    return Job(f"replay {arm}, seed {seed}, shield {test}", count, "episode", work)


def showing(config: Config, preset: Preset, folder: Path, arm: str) -> Job:
    work = functools.partial(_show, config, preset, folder, arm)
    return Job(f"show {arm}", showcase.shown(tuple(arm_named(arm).tests)), "episode", work)


def _train(config: Config, preset: Preset, folder: Path, arm: str, seed: int, progress: Progress) -> None:
    row = arm_named(arm)
    paid = {"intervention_penalty": config.intervention_penalty, "penalty_on": config.penalty_on}
    chosen = learner(config, row)
    total = chosen.rounded(config.n_envs, config.total_timesteps)
    path = model_path(folder, arm, seed).parent / removal.FILE
    train_in_blocks(
        chosen,
        functools.partial(batch, config, preset, row, {**paid, **row.training}),
        model_path(folder, arm, seed).parent,
        seed=seed,
        total_timesteps=config.total_timesteps,
        n_envs=config.n_envs,
        device=config.device,
        progress=progress,
        reward=blaming(function_named(config.reward), config.reward) if config.reward else None,
        tracker=config.tracker,
        watch=functools.partial(_remove, config, preset, row, total, path),
    )


def _remove(config: Config, preset: Preset, arm: Arm, total: int, path: Path, model: Any) -> None:
    """Test the agent as it is now with the shield and without, if it is time to."""
    rows = removal.read(path)
    rows = rows[rows["timesteps"] < model.num_timesteps]  # what a killed run had gone on to will happen again
    if not config.removal_checks or not config.removal_episodes:
        return
    if not removal.is_due(rows, model.num_timesteps, total, config.removal_checks):
        return
    try:
        here = replace(config, backend="fast")  # the same trajectories, sooner
        tests = {
            test: _played(here, preset, arm, shield, policy_of(model), FIRST_REMOVAL_SEED, config.removal_episodes)
            for test, shield in arm.tests.items()
        }
    except Unsupported:
        return
    removal.record(path, rows, model.num_timesteps, tests)


def _test(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str, progress: Progress) -> None:
    row = arm_named(arm)
    policy = driver(config, preset, row, seed) if row.scripted else load_policy(model_path(folder, arm, seed))
    count = config.eval_episodes
    episodes = _played(config, preset, row, row.tests[test], policy, FIRST_TEST_SEED, count, progress)
    write_cell(cell_path(folder, arm, seed, test), episodes, arm, seed, test)


def _played(
    config: Config,
    preset: Preset,
    arm: Arm,
    shield: Mapping[str, Any],
    policy: Callable[..., np.ndarray],
    first: int,
    count: int,
    progress: Progress = lambda episodes: None,
) -> pd.DataFrame:
    make: Callable[[int], Any] = functools.partial(test_batch, config, preset, arm, shield)
    return evaluate(
        scored(make, config.reward),
        policy,
        range(first, first + count),
        n_envs=TEST_ENVS[arm.backend or config.backend],
        keep_actions=in_engine(arm),
        masked=arm.masked and shield["shield"] == "override",
        progress=progress,
        more=columns_of,
    )


def _replay(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str, progress: Progress) -> None:
    row = arm_named(arm)
    sample = chosen(read_cell(cell_path(folder, arm, seed, test)), config.replay_episodes, seed)
    replays = replay(original(config, preset, row, row.tests[test]), sample, progress)
    write_cell(replay_path(folder, arm, seed, test), replays, arm, seed, test)


def _show(config: Config, preset: Preset, folder: Path, arm: str, progress: Progress) -> None:
    row, seed = arm_named(arm), config.seeds[0]
    tests = {test: read_cell(cell_path(folder, arm, seed, test)) for test in row.tests}
    making = {test: original(config, preset, row, shield) for test, shield in row.tests.items()}
    showcase.show(tests, making.__getitem__, folder, arm, f"{row.label}, {config.env_id}", progress)


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


def options_of(config: Config) -> dict[str, Any]:
    """Every option but those that only say where and how to start."""
    options = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in _NOT_RECORDED}
    rules = {name: value for name, value, _ in changes(config.rules._asdict(), Rules()._asdict())}
    return {**options, "ego": config.ego.given, "other": config.other.given, "rules": rules}


def record(config: Config, preset: Preset, env: gym.Env) -> dict[str, Any]:
    """All that the result depends on."""
    parameters = {"ego": preset.ego._asdict(), "other": preset.other._asdict()}
    own = digests([*config.arms, config.reward, config.preset])  # what is changed later is another run
    return {
        **options_of(config),
        "parameters": {
            **parameters,
            "per_frame": preset.per_frame,
            "source": preset.source,
            "roads_cross": scheme_of(env.unwrapped) == PLANS,  # otherwise entry, intent and waiting change nothing
            "rules": config.rules._asdict(),  # the margins of the published table
        },
        "environment": env.unwrapped.config,  # type: ignore[attr-defined]  # the whole of it
        **{
            arm.name if arm.settings else arm.learner: learner(config, arm).hyperparameters(
                config.n_envs, config.total_timesteps
            )
            for arm in map(arm_named, config.arms)
            if not arm.scripted
        },
        **({"sources": own} if own else {}),
        "test_seeds": {"first": FIRST_TEST_SEED, "last": FIRST_TEST_SEED + config.eval_episodes - 1},
    }


def run_name(config: Config) -> str:
    """The environment, then every option that differs from its default."""
    chosen_options = changes(options_of(config), options_of(Config()))
    parts = [f"{name}={shown(value, '-')}" for name, value, _ in chosen_options if name != "env_id"]
    return valid_name(",".join([config.env_id, *parts]))


def valid_name(text: str) -> str:
    """A name of a folder that every system takes: no / \\ : * ? " < > |, no dot at an end, no device, not too long."""
    name = re.sub(r"[^\w=.,+-]+", "-", text).strip("-.")
    if name.split(".")[0].upper() in DEVICES:
        name = f"_{name}"
    if len(name) > LONGEST_NAME:
        name = f"{name[: LONGEST_NAME - 9]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return name


_NOT_RECORDED = ("list_arms", "workers", "tracker", "name", "runs_dir", "resume", "resume_or_start", "overwrite")


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
