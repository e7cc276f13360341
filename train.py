"""Train PPO with and without the RSS shield, test each with and without it, and report who crashes."""

import contextlib
import functools
import io
import math
import multiprocessing
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, NoReturn

import gymnasium as gym
import tyro
from gymnasium.vector import AutoresetMode, VectorEnv

import envs
from agents.ppo import available_devices, load_policy, rounded_timesteps, train
from envs.highway import PLANS
from envs.shielding import PENALTIES
from envs.vector import BACKENDS
from envs.wrapper import WAITING, default_preset, scheme_of
from eval.jobs import Job, run_jobs
from eval.replay import chosen, replay
from eval.report import cell_path, read_cell, replay_path, write_cell, write_report
from eval.rollout import evaluate
from eval.run_folder import open_run
from shield.junction import ENTRIES
from shield.params import PRESETS, Preset, RSSParams, Rules
from shield.plans import INTENTS

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
  python train.py --arms shielded --intervention-penalty 0.1
      one arm, which pays for what the shield must correct
  python train.py --resume
      go on with a run that was stopped, with the options it was started with
"""
Progress = Callable[[int], None]
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


@dataclass(frozen=True)
class Config:
    """What `python train.py --help` shows; one option a field."""

    env_id: str = "highway-fast-v0"
    """Environment of highway-env."""
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
    """Folder of the run inside runs-dir; by default made from the options that differ from theirs."""
    runs_dir: Path = Path("runs")
    """Folder of all runs."""
    resume: bool = False
    """Go on with the run in the folder; nothing that is finished is repeated."""
    overwrite: bool = False
    """Throw the run in the folder away and start anew."""


def main(arguments: list[str]) -> None:
    config = parse(arguments)
    check(config)
    name = config.name or run_name(config)
    try:
        config = replace(config, preset=preset_name(config))
        preset = resolve(config)
        for mode in TEST_MODE.values():
            env = original(config, preset, mode)()  # a bad value shows now
            env.close()
            if not isinstance(env.action_space, gym.spaces.Discrete):
                raise ValueError(f"env_id = {config.env_id!r}: actions {env.action_space}; expected Discrete ones")
        batch(config, preset, "override", n_envs=1).reset(seed=0)  # and the engine is compiled once for all workers
        folder = config.runs_dir / name
        changes = open_run(
            folder, record(config, preset, scheme_of(env.unwrapped)), resume=config.resume, overwrite=config.overwrite
        )
    except (ValueError, OSError) as error:
        fail(str(error))
    for change in changes:
        print(f"train.py: warning: {change}", file=sys.stderr)

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


def original(config: Config, preset: Preset, mode: str) -> Callable[..., gym.Env]:
    """Builds an environment of the original simulator."""
    return functools.partial(envs.make, config.env_id, shield=mode, params=preset, **conduct(config))


def batch(config: Config, preset: Preset, mode: str, n_envs: int, **options: Any) -> VectorEnv:
    """Environments of the chosen simulator side by side."""
    options |= {"backend": config.backend, "params": preset, **conduct(config)}
    return envs.make_vec(config.env_id, n_envs, shield=mode, **options)


def conduct(config: Config) -> dict[str, Any]:
    """How the ego behaves where roads cross."""
    return {"entry": config.entry, "intent": config.intent, "waiting": config.waiting}


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


def parse(arguments: list[str]) -> Config:
    """Read the command line. What cannot be read ends in one line and exit code 2."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(
                Config, prog="train.py", description=HELP, args=arguments, config=(tyro.conf.FlagCreatePairsOff,)
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
        ("name", re.fullmatch(r"([\w=][\w=.,+-]*)?", config.name), "letters, digits and . , = + - _"),
        ("resume", not (config.resume and config.overwrite), "--resume or --overwrite, not both"),
    ):
        if not good:
            value = getattr(config, option)
            shown = " ".join(map(str, value)) if isinstance(value, tuple) else value
            fail(f"--{option.replace('_', '-')} {shown} is out of range: expected {expected}")


def is_set_of(values: tuple, accepted: Sequence) -> bool:
    """At least one value, none twice, all of them accepted."""
    return 0 < len(values) == len(set(values)) and all(value in accepted for value in values)


def preset_name(config: Config) -> str:
    """The preset asked for, or the one of the environment."""
    if config.preset != "auto":
        return config.preset
    env = envs.make(config.env_id, shield=None)
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


def record(config: Config, preset: Preset, scheme: int) -> dict[str, Any]:
    """All that the result depends on: every option but those that only say where and how to start."""
    options = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in _NOT_RECORDED}
    parameters = {"ego": preset.ego._asdict(), "other": preset.other._asdict()}
    return {**options, "ego": _given(config.ego), "other": _given(config.other)} | {
        "parameters": {
            **parameters,
            "per_frame": preset.per_frame,
            "source": preset.source,
            "roads_cross": scheme == PLANS,  # otherwise entry, intent and waiting change nothing
            "rules": Rules()._asdict(),  # the margins of the published table
        }
    }


def run_name(config: Config) -> str:
    """The environment, then every option that differs from its default."""
    default = Config()
    parts = [config.env_id]
    for option in fields(config):
        value = getattr(config, option.name)
        if option.name in (*_NOT_RECORDED, "env_id") or value == getattr(default, option.name):
            continue
        if isinstance(value, Overrides):
            parts += [f"{option.name}.{name}={number}" for name, number in _given(value).items()]
        else:
            shown = "-".join(map(str, value)) if isinstance(value, tuple) else value
            parts.append(f"{option.name}={shown}")
    return ",".join(parts)


_NOT_RECORDED = ("workers", "name", "runs_dir", "resume", "overwrite")


def _given(overrides: Overrides) -> dict[str, float]:
    return {name: value for name, value in asdict(overrides).items() if value is not None}


def fail(message: str) -> NoReturn:
    print(f"train.py: error: {message}", file=sys.stderr)
    raise SystemExit(2)


if __name__ == "__main__":
    # worker processes are forked from a server that has imported the slow packages once
    multiprocessing.set_forkserver_preload(["envs", "agents.ppo", "eval.jobs", "eval.rollout"])
    try:
        main(sys.argv[1:])
    except KeyboardInterrupt:
        print("\ntrain.py: stopped; the same command with --resume goes on", file=sys.stderr)
        raise SystemExit(130) from None
