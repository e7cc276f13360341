"""What the comparison has to do, as jobs for worker processes: train, test, replay, show."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rss_shield.agents.blocks import train_in_blocks
from rss_shield.agents.load import load_policy, policy_of
from rss_shield.envs.fast.config import Unsupported
from rss_shield.eval import removal
from rss_shield.eval.arms import Arm, arm_named
from rss_shield.eval.jobs import Job
from rss_shield.eval.own import blaming, function_named
from rss_shield.eval.replay import chosen, replay
from rss_shield.eval.report import cell_path, read_cell, replay_path, write_cell
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.suite import showcase
from rss_shield.eval.suite.comparison.acting import driver, learner
from rss_shield.eval.suite.comparison.making import batch, original, test_batch
from rss_shield.eval.suite.comparison.options import FIRST_REMOVAL_SEED, Config
from rss_shield.eval.suite.scored import columns_of, scored
from rss_shield.shield.params import Preset

TEST_ENVS = {"fast": 256, "highway-env": 1}  # side by side in testing; the engine is the faster, the more there are
Progress = Callable[[int], None]


def cells_of(config: Config, arm: Arm, seed: int) -> list[tuple[str, int, str]]:
    """Where an arm is tested; who learns nothing is tested once, not once a training seed."""
    if arm.scripted and seed != config.seeds[0]:
        return []
    return [(arm.name, seed, test) for test in arm.tests]


def in_engine(arm: Arm) -> bool:
    """Can its episodes be played by numbered meta-actions in the engine?"""
    return not arm.backend and not arm.continuous and not arm.chooses


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
    episodes = _played(config, preset, row, row.tests[test], policy, config.first_seed, count, progress)
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
