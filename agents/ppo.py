"""PPO on any gymnasium environment: train with checkpoints, go on after a kill, load as a policy.

Training proceeds in blocks of a few rollouts. A block starts by seeding every generator and resetting
every environment from (seed, timesteps done), and ends by saving the model. So a block depends on
the saved model alone, and a run that was killed and resumed gives the same result, bit for bit, as
one that was left alone. The price: at the end of a block the unfinished episodes are dropped (PPO
bootstraps their value, so the estimate stays sound).
"""

import functools
import math
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecMonitor

from agents.curve import CurveRecorder, truncate_curve

# The published starting point for PPO on highway-env (its script sb3_highway_ppo.py).
BATCH_SIZE = 64
ROLLOUT_STEPS = 12 * BATCH_SIZE  # decisions of all environments together between two updates
HYPERPARAMETERS: dict[str, Any] = dict(
    policy_kwargs={"net_arch": {"pi": [256, 256], "vf": [256, 256]}},
    batch_size=BATCH_SIZE,
    n_epochs=10,
    learning_rate=5e-4,
    gamma=0.8,
)
ROLLOUTS_PER_BLOCK = 2  # a kill loses at most this many rollouts


def train(
    make_env: Callable[[], gym.Env],
    folder: Path,
    *,
    seed: int,
    total_timesteps: int,
    n_envs: int = 1,
    device: str = "cpu",
    progress: Callable[[int], None] = lambda timesteps: None,
) -> Path:
    """Train PPO, or go on where an earlier call in the same folder was stopped.

    Writes into `folder`: `checkpoint.zip` after every block, `model.zip` at the end, one row per
    training episode in `learning_curve.csv`, and TensorBoard events in `tensorboard/`.

    Args:
      make_env: builds one environment; must be picklable.
      seed: fixes the network's first weights and every block.
      total_timesteps: decisions to learn from, rounded up to whole rollouts.
      n_envs: environments stepped in parallel, one process each (1: in this process).
      progress: called with the timesteps done so far.

    Returns:
      Path of the trained model. Nothing is trained when it exists already.
    """
    model_path, checkpoint, curve = _paths(folder)
    if model_path.exists():
        progress(rounded_timesteps(n_envs, total_timesteps))
        return model_path
    torch.set_num_threads(1)  # the order of a sum must not depend on the number of cores
    folder.mkdir(parents=True, exist_ok=True)
    n_steps = rollout_steps(n_envs, total_timesteps)
    workers: list[Callable[[], gym.Env]] = [functools.partial(_make_in_worker, make_env)] * n_envs
    env = VecMonitor(DummyVecEnv([make_env]) if n_envs == 1 else SubprocVecEnv(workers))
    try:
        if checkpoint.exists():
            model = PPO.load(checkpoint, env=env, device=device)
        else:
            shutil.rmtree(folder / "tensorboard", ignore_errors=True)
            model = PPO("MlpPolicy", env, n_steps=n_steps, seed=seed, device=device, **HYPERPARAMETERS)
        truncate_curve(curve, model.num_timesteps)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        recorder = CurveRecorder(curve, progress)
        block_steps = ROLLOUTS_PER_BLOCK * n_steps * n_envs
        progress(model.num_timesteps)
        while model.num_timesteps < total_timesteps:
            model.set_random_seed(block_seed(seed, model.num_timesteps))
            model.set_env(env, force_reset=True)
            remaining = total_timesteps - model.num_timesteps
            model.learn(min(block_steps, remaining), callback=recorder, reset_num_timesteps=False)
            _save(model, checkpoint)
        model.logger.close()
    finally:
        env.close()
    os.replace(checkpoint, model_path)
    return model_path


def load_policy(path: Path) -> Callable[[np.ndarray], Any]:
    """Load a trained model as a greedy policy: observation -> action. Runs on the CPU, one thread."""
    torch.set_num_threads(1)
    model = PPO.load(path, device="cpu")
    return lambda observation: model.predict(observation, deterministic=True)[0][()]


def rollout_steps(n_envs: int, total_timesteps: int) -> int:
    """Decisions per environment between two updates.

    About ROLLOUT_STEPS / n_envs, and no more than total_timesteps needs; whole batches in every case.
    """
    whole_batches = BATCH_SIZE // math.gcd(BATCH_SIZE, n_envs)
    wanted = ROLLOUT_STEPS // n_envs // whole_batches
    needed = math.ceil(total_timesteps / (n_envs * whole_batches))
    return max(min(wanted, needed), 1) * whole_batches


def rounded_timesteps(n_envs: int, total_timesteps: int) -> int:
    """The decisions that `train` really makes: total_timesteps rounded up to whole rollouts."""
    rollout = n_envs * rollout_steps(n_envs, total_timesteps)
    return math.ceil(total_timesteps / rollout) * rollout


def block_seed(seed: int, timesteps: int) -> int:
    """Seed of the block that starts after `timesteps` decisions, in [0, 2**29)."""
    return int(np.random.SeedSequence((seed, timesteps)).generate_state(1)[0]) >> 3


def available_devices() -> list[str]:
    """What `device` may be on this machine."""
    return ["auto", "cpu"] + (["cuda"] if torch.cuda.is_available() else [])


def _make_in_worker(make_env: Callable[[], gym.Env]) -> gym.Env:
    """Ctrl-C is the parent's business: it closes its workers, and needs them alive for that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return make_env()


def _paths(folder: Path) -> tuple[Path, Path, Path]:
    return folder / "model.zip", folder / "checkpoint.zip", folder / "learning_curve.csv"


def _save(model: PPO, path: Path) -> None:
    """Save beside the target, then rename: a kill leaves the old checkpoint or the new one."""
    temporary = path.with_name("saving.zip")
    model.save(temporary)
    os.replace(temporary, path)
