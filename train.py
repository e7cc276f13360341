"""Train PPO with and without the RSS shield, test each with and without it, and report who crashes."""

from rss_shield.eval.interrupt import stop_on_interrupt

if __name__ == "__main__":  # before all that takes its time
    stop_on_interrupt("train.py: stopping; nothing that is finished is lost, the same command with --resume goes on")

import contextlib
import functools
import hashlib
import io
import json
import math
import multiprocessing
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import gymnasium as gym
import numpy as np
import tyro
from gymnasium.vector import AutoresetMode, VectorEnv

import rss_shield
from rss_shield.agents.ppo import available_devices, hyperparameters, load_policy, rounded_timesteps, train
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import PENALTIES, PLANS, WAITING, default_preset, scheme_of
from rss_shield.eval.config_option import read_config, split_arguments, with_values
from rss_shield.eval.jobs import Job, run_jobs
from rss_shield.eval.replay import chosen, replay
from rss_shield.eval.report import cell_path, read_cell, replay_path, write_cell, write_report
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.run_folder import changes, open_run, recorded
from rss_shield.shield.junctions.controller import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import PRESETS, Preset, RSSParams, Rules

TRAIN_MODE = {"unshielded": "monitor", "shielded": "override"}  # what the shield does in training
TEST_MODE = {"off": "monitor", "on": "override"}  # a monitor assigns blame and changes nothing
TEST_ENVS = {"fast": 256, "highway-env": 1}  # side by side in testing; the engine is the faster, the more there are
HELP = """Train PPO with and without the RSS shield, test each with and without it, report who crashes.

One table at the end: shield {off, on} in training x {off, on} in testing. Everything is written
to runs/NAME.

examples:
  python train.py
      the comparison with its defaults: 3 seeds, 200 000 decisions per arm and seed
  python train.py --total-timesteps 1000000 --seeds 0 1 2 3 4
      the same with more of everything
  python train.py --backend highway-env --total-timesteps 5376 --n-envs 2 --seeds 0 --eval-episodes 60
      on the original simulator, with much less of everything
  python train.py --env-id intersection-v0 --total-timesteps 50000 --intent known
      a junction, where the shield is told everybody's route
  python train.py --env-id roundabout-v0 --entry priority --waiting anywhere
      a ring, where others are expected to give way
  python train.py --env-id merge-v0 --preset slides
      another road, stricter assumptions
  python train.py --ego.response-time 0.5 --other.a-min-brake 4
      single RSS parameters
  python train.py --config.lanes-count 4 --config.reward-speed-range 20 35
      the environment's configuration, key by key
  python train.py --config my-road.json --config.observation.vehicles-count 8
      the same from a file; what the command line says wins
  python train.py --arms shielded --intervention-penalty 0.1
      one arm, which pays for what the shield must correct
  python train.py --resume --name my-run
      go on with a run that was stopped, with the options it was started with
"""
Progress = Callable[[int], None]
NAMES = "letters, digits and . , = + - _"
LONGEST_NAME = 120
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{i}" for port in ("COM", "LPT") for i in range(10))}  # on Windows
FIRST_TEST_SEED = 10**9  # test episode i: FIRST_TEST_SEED + i; training seeds stay below 2**30


@dataclass(frozen=True)
class Overrides:
    """None keeps the preset's value."""

    response_time: float | None = None  # rho [s], > 0: delay before the driver must have reacted
    a_max_accel: float | None = None  # [m/s^2], >= 0: strongest forward acceleration
    a_min_brake: float | None = None  # [m/s^2], > 0: weakest braking that may be relied on
    a_max_brake: float | None = None  # [m/s^2], >= a_min_brake: hardest braking of a leader
    a_min_brake_correct: float | None = None  # [m/s^2], > 0, <= a_min_brake: in one's own lane
    a_lat_max_accel: float | None = None  # [m/s^2], >= 0: strongest lateral acceleration
    a_lat_min_brake: float | None = None  # [m/s^2], > 0: weakest lateral braking
    mu: float | None = None  # [m], >= 0: width of the lateral wobble
    standstill_gap: float | None = None  # lambda [m], >= 0: gap left when both stand
    v_cap: float | None = None  # [m/s], > 0: speed above which nobody accelerates


# a file is read where the command line is
ConfigFile = Annotated[
    dict[str, Any],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="FILE",
        instance_from_str=lambda texts: read_config(texts[0]),
        is_instance=lambda value: isinstance(value, dict),
        str_from_instance=lambda value: [json.dumps(value)],
    ),
]


@dataclass(frozen=True)
class Config:
    """What `python train.py --help` shows; one option a field."""

    env_id: str = "highway-fast-v0"
    """Environment of highway-env."""
    config: ConfigFile = field(default_factory=dict)
    """Its configuration, a JSON, TOML or YAML file or JSON itself, as make() takes it; single keys as
    --config.lanes-count 4, nested ones as --config.observation.type Kinematics."""
    backend: str = "fast"
    """What simulates: fast (the compiled engine, with the same trajectories) or highway-env (the original)."""
    arms: tuple[str, ...] = ("unshielded", "shielded")
    """What to train: unshielded (the shield only watches), shielded (it overrides), or both."""
    total_timesteps: int = 200_000
    """Decisions to learn from, per arm and seed; rounded up to whole rollouts of about 8192."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Training seeds; each trains every arm once."""
    preset: str = "auto"
    """RSS parameters by name: simulator, intersection, slides, ad-rss, carla, rodionova-conservative,
    rodionova-assertive; auto: intersection at intersections, simulator elsewhere."""
    ego: Overrides = Overrides()
    """RSS parameters of the ego that replace the preset's."""
    other: Overrides = Overrides()
    """RSS parameters assumed of everybody else that replace the preset's."""
    entry: str = "cautious"
    """Whom the ego expects to give way where roads cross: cautious (nobody), priority (who must and still
    can) or assertive (everybody who still can)."""
    intent: str = "any"
    """Which routes it expects of others there: known (theirs), straight, or any that fits."""
    waiting: str = "line"
    """Where it may wait there: at the line, or anywhere that is in the way of nobody who is there."""
    intervention_penalty: float = 0.0
    """Taken off the training reward when the shield overrides; >= 0. Testing uses the raw reward."""
    penalty_on: str = "response"
    """What it is times: response (share of frames overridden) or change (of acceleration, mean [m/s^2])."""
    eval_episodes: int = 1000
    """Test episodes per trained model and test condition, on the same seeds for all."""
    replay_episodes: int = 5
    """How many of these are played again on the original simulator and compared; none if it is the backend."""
    n_envs: int = 128
    """Environments side by side in each training."""
    workers: int = os.cpu_count() or 1
    """Processes that share the trainings and tests. Results do not depend on it."""
    device: str = "cpu"
    """Where PPO learns: cpu, cuda or auto. For networks this small the CPU is faster."""
    name: str = ""
    """Folder of the run inside runs-dir; by default made from the options that differ from their defaults."""
    runs_dir: Path = Path("runs")
    """Folder of all runs."""
    resume: bool = False
    """Go on with the run in the folder, with the options it was started with; nothing that is finished is
    repeated. Options that are given as well must be the same."""
    overwrite: bool = False
    """Throw the run in the folder away and start anew."""


def main(arguments: list[str]) -> None:
    try:
        config, folder = started(arguments)
        preset = resolve(config)
        env = tried(config, preset)
        warnings = open_run(folder, record(config, preset, env), resume=config.resume, overwrite=config.overwrite)
    except (ValueError, OSError) as error:
        fail(" ".join(str(error).split()))
    for warning in warnings:
        print(f"train.py: warning: {warning}", file=sys.stderr)

    models = [(arm, seed) for seed in config.seeds for arm in config.arms]
    cells = [(arm, seed, test) for arm, seed in models for test in TEST_MODE]
    untrained = [model for model in models if not model_path(folder, *model).exists()]
    run_jobs([training(config, preset, folder, *model) for model in untrained], config.workers)
    untested = [cell for cell in cells if not cell_path(folder, *cell).exists()]
    run_jobs([testing(config, preset, folder, *cell) for cell in untested], config.workers)
    if config.backend == "fast" and config.replay_episodes:
        unchecked = [cell for cell in cells if not replay_path(folder, *cell).exists()]
        run_jobs([replaying(config, preset, folder, *cell) for cell in unchecked], config.workers)

    write_report(folder)
    print(f"\nEverything is in {folder}: table.md, results.json, learning_curve.png, blame.png, ...")


def started(arguments: list[str]) -> tuple[Config, Path]:
    """All options, and the folder of the run. What `--resume` finds there are the defaults of the rest.

    Raises:
      ValueError: the environment's configuration cannot be read, or options contradict those of the run.
    """
    options, values = split_arguments(arguments)
    config = parse(options, Config())
    check(config)
    before = recorded(config.runs_dir / config.name) if config.resume and config.name else None
    if before is None:
        config = complete(config, values)
        config = replace(config, name=config.name or run_name(config))
        before = recorded(config.runs_dir / config.name) if config.resume else None
    folder = config.runs_dir / config.name
    if before is None:
        if config.resume:
            print(f"train.py: nothing to resume in {folder}: a new run is started there", file=sys.stderr)
        return replace(config, preset=preset_name(config)), folder
    stored = stored_config(before)
    config = parse(options, stored)
    config = complete(replace(config, config={**stored.config, **config.config}), values)
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


def complete(config: Config, values: dict[tuple[str, ...], Any]) -> Config:
    """Options that are all in range, the environment's configuration with its single values put in."""
    check(config)
    if not (config.config or values):
        return config
    given = with_values(config.config, values, default_config(config.env_id))
    check_config(config.env_id, given)
    return replace(config, config=given)


def stored_config(options: dict[str, Any]) -> Config:
    """The options in a run's record; what was not recorded has its default."""
    known = {f.name: options[f.name] for f in fields(Config) if f.name in options}
    for name in ("arms", "seeds"):
        known[name] = tuple(known[name])
    for name in ("ego", "other"):
        known[name] = Overrides(**{parameter: float(value) for parameter, value in known[name].items()})
    return Config(**known)


def tried(config: Config, preset: Preset) -> gym.Env:
    """The original environment, after bad values of any kind have shown.

    Raises:
      ValueError: says what is wrong, and with which keys of the environment's configuration.
    """
    try:
        return _tried(config, preset)
    except Exception as error:
        if not config.config or not _works(replace(config, config={}), preset):
            raise
        alone = [{key: value} for key, value in config.config.items()]
        bad = [one for one in alone if not _works(replace(config, config=one), preset)] or alone
        named = ", ".join(f"config.{key} = {value!r}" for one in bad for key, value in one.items())
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise ValueError(f"{named}: not possible in {config.env_id}: {kind}{error}") from error


def _works(config: Config, preset: Preset) -> bool:
    try:
        _tried(config, preset)
    except Exception:
        return False
    return True


def _tried(config: Config, preset: Preset) -> gym.Env:
    env = original(config, preset, "override")()
    env.close()
    actions, observations = env.action_space, env.observation_space
    if not isinstance(actions, gym.spaces.Discrete):
        raise ValueError(f"env_id = {config.env_id!r}: actions {actions}; expected Discrete ones")
    if not (isinstance(observations, gym.spaces.Box) and np.issubdtype(observations.dtype, np.floating)):
        raise ValueError(f"env_id = {config.env_id!r}: observations {observations}; expected a Box of floats")
    first = batch(config, preset, "override", n_envs=1)
    first.reset(seed=0)
    first.step(np.zeros(1, int))  # and the engine is compiled once for all workers
    first.close()
    return env


def original(config: Config, preset: Preset, mode: str) -> Callable[..., gym.Env]:
    """Builds an environment of the original simulator."""
    return functools.partial(rss_shield.make, config.env_id, shield=mode, params=preset, **setting(config))


def batch(config: Config, preset: Preset, mode: str, n_envs: int, **options: Any) -> VectorEnv:
    """Environments of the chosen simulator side by side."""
    options |= {"backend": config.backend, "params": preset, **setting(config)}
    return rss_shield.make_vec(config.env_id, n_envs, shield=mode, **options)


def setting(config: Config) -> dict[str, Any]:
    """The environment's configuration, and how the ego behaves where roads cross."""
    conduct = {"entry": config.entry, "intent": config.intent, "waiting": config.waiting}
    return {**conduct, **configured(config)}


def configured(config: Config) -> dict[str, Any]:
    """The environment's configuration, if it is told any."""
    return {"config": config.config} if config.config else {}


def model_path(folder: Path, arm: str, seed: int) -> Path:
    """The trained model; `train` puts it there when it is finished."""
    return folder / f"{arm}-seed{seed}" / "model.zip"


def training(config: Config, preset: Preset, folder: Path, arm: str, seed: int) -> Job:
    total = rounded_timesteps(config.n_envs, config.total_timesteps)
    return Job(f"train {arm}, seed {seed}", total, "step", functools.partial(_train, config, preset, folder, arm, seed))


def testing(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str) -> Job:
    work = functools.partial(_test, config, preset, folder, arm, seed, test)
    return Job(f"test {arm}, seed {seed}, shield {test}", config.eval_episodes, "episode", work)


def replaying(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str) -> Job:
    count = min(config.replay_episodes, config.eval_episodes)
    work = functools.partial(_replay, config, preset, folder, arm, seed, test)
    return Job(f"replay {arm}, seed {seed}, shield {test}", count, "episode", work)


def _train(config: Config, preset: Preset, folder: Path, arm: str, seed: int, progress: Progress) -> None:
    paid: dict[str, Any] = {"intervention_penalty": config.intervention_penalty, "penalty_on": config.penalty_on}
    train(
        functools.partial(batch, config, preset, TRAIN_MODE[arm], **paid),
        model_path(folder, arm, seed).parent,
        seed=seed,
        total_timesteps=config.total_timesteps,
        n_envs=config.n_envs,
        device=config.device,
        progress=progress,
    )


def _test(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str, progress: Progress) -> None:
    episodes = evaluate(
        functools.partial(batch, config, preset, TEST_MODE[test], autoreset_mode=AutoresetMode.DISABLED),
        load_policy(model_path(folder, arm, seed)),
        range(FIRST_TEST_SEED, FIRST_TEST_SEED + config.eval_episodes),
        n_envs=TEST_ENVS[config.backend],
        progress=progress,
    )
    write_cell(cell_path(folder, arm, seed, test), episodes, arm, seed, test)


def _replay(config: Config, preset: Preset, folder: Path, arm: str, seed: int, test: str, progress: Progress) -> None:
    sample = chosen(read_cell(cell_path(folder, arm, seed, test)), config.replay_episodes, seed)
    replays = replay(original(config, preset, TEST_MODE[test]), sample, progress)
    write_cell(replay_path(folder, arm, seed, test), replays, arm, seed, test)


def parse(arguments: list[str], default: Config) -> Config:
    """Read the command line. What cannot be read ends in one line and exit code 2."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(
                Config,
                prog="train.py",
                description=HELP,
                args=arguments,
                default=default,
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if not stop.code:  # --help
            raise
        _, *box = (line.strip("│| ") for line in printed.getvalue().splitlines() if line.strip())
        message = " ".join(line for line in box if line.strip("─-╰╯+"))
        fail(re.split("Argument helptext|For full helptext", message)[0] + "(see train.py --help)")


def check(config: Config) -> None:
    """Refuse what is out of range, naming option, value and range. RSS parameters: see `resolve`."""
    arms, presets, devices = list(TRAIN_MODE), ["auto", *PRESETS], available_devices()
    for option, good, expected in (
        ("backend", config.backend in BACKENDS, f"one of {', '.join(BACKENDS)}"),
        ("arms", is_set_of(config.arms, arms), f"one or more of {', '.join(arms)}"),
        ("total_timesteps", config.total_timesteps >= 1, "at least 1"),
        ("seeds", is_set_of(config.seeds, range(2**32)), "different whole numbers, 0 to 2**32 - 1"),
        ("preset", config.preset in presets, f"one of {', '.join(presets)}"),
        ("entry", config.entry in ENTRIES, f"one of {', '.join(ENTRIES)}"),
        ("intent", config.intent in INTENTS, f"one of {', '.join(INTENTS)}"),
        ("waiting", config.waiting in WAITING, f"one of {', '.join(WAITING)}"),
        ("intervention_penalty", 0 <= config.intervention_penalty < math.inf, "a number >= 0"),
        ("penalty_on", config.penalty_on in PENALTIES, f"one of {', '.join(PENALTIES)}"),
        ("eval_episodes", config.eval_episodes >= 1, "at least 1"),
        ("replay_episodes", config.replay_episodes >= 0, "at least 0"),
        ("n_envs", 1 <= config.n_envs <= 4096, "1 to 4096"),
        ("workers", 1 <= config.workers <= 256, "1 to 256"),
        ("device", config.device in devices, f"one of {', '.join(devices)} on this machine"),
        ("name", config.name in ("", valid_name(config.name)), f"{NAMES}, such as {valid_name(config.name)}"),
        ("resume", not (config.resume and config.overwrite), "--resume or --overwrite, not both"),
    ):
        if not good:
            value = shown(getattr(config, option))
            fail(f"--{option.replace('_', '-')} {value} is out of range: expected {expected}")


def is_set_of(values: tuple, accepted: Sequence) -> bool:
    """At least one value, none twice, all of them accepted."""
    return 0 < len(values) == len(set(values)) and all(value in accepted for value in values)


def preset_name(config: Config) -> str:
    """The preset asked for, or the one of the environment."""
    if config.preset != "auto":
        return config.preset
    env = rss_shield.make(config.env_id, shield=None)
    env.close()
    return default_preset(env.unwrapped)


def resolve(config: Config) -> Preset:
    """The preset with the parameters given on the command line put in."""
    preset = PRESETS[preset_name(config)]
    given = {"ego": _given(config.ego), "other": _given(config.other)}
    for side, values in given.items():
        try:
            params = RSSParams.validated(**{**getattr(preset, side)._asdict(), **values})
        except ValueError as error:
            raise ValueError(f"--{side}: {error}") from None
        preset = preset._replace(**{side: params})  # type: ignore[arg-type]
    if "response_time" in given["ego"]:  # asked for, so never raised to one frame silently
        preset = preset._replace(per_frame=False)
    return preset


def options_of(config: Config) -> dict[str, Any]:
    """Every option but those that only say where and how to start."""
    options = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in _NOT_RECORDED}
    return {**options, "ego": _given(config.ego), "other": _given(config.other)}


def record(config: Config, preset: Preset, env: gym.Env) -> dict[str, Any]:
    """All that the result depends on."""
    parameters = {"ego": preset.ego._asdict(), "other": preset.other._asdict()}
    return {
        **options_of(config),
        "parameters": {
            **parameters,
            "per_frame": preset.per_frame,
            "source": preset.source,
            "roads_cross": scheme_of(env.unwrapped) == PLANS,  # otherwise entry, intent and waiting change nothing
            "rules": Rules()._asdict(),  # the margins of the published table
        },
        "environment": env.unwrapped.config,  # type: ignore[attr-defined]  # the whole of it
        "ppo": hyperparameters(config.n_envs, config.total_timesteps),
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


def shown(value: Any, separator: str = " ") -> str:
    """A value as on a command line."""
    if value is None:
        return "(not given)"
    return separator.join(map(str, value)) if isinstance(value, list | tuple) else str(value)


_NOT_RECORDED = ("workers", "name", "runs_dir", "resume", "overwrite")


def _given(overrides: Overrides) -> dict[str, float]:
    return {name: value for name, value in asdict(overrides).items() if value is not None}


def fail(message: str) -> NoReturn:
    print(f"train.py: error: {message}", file=sys.stderr)
    raise SystemExit(2)


def run(arguments: list[str]) -> None:
    """What a command line asks for."""
    # worker processes are forked from a server that has imported the slow packages once
    multiprocessing.set_forkserver_preload(
        [
            "rss_shield.envs.make_vec",
            "rss_shield.agents.ppo",
            "rss_shield.eval.jobs",
            "rss_shield.eval.orphans",
            "rss_shield.eval.rollout",
        ]
    )
    main(arguments)


if __name__ == "__main__":
    run(sys.argv[1:])
