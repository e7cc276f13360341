"""PPO on any vector environment: train with checkpoints, go on after a kill, load as a policy.

Training proceeds in blocks of a few rollouts. A block starts by seeding every generator and resetting
every environment from (seed, timesteps done), and ends by saving the model. So a block depends on
the saved model alone, and a run that was killed and resumed gives the same result, bit for bit, as
one that was left alone. The price: at the end of a block the unfinished episodes are cut off (PPO
bootstraps their value, so the estimate stays sound; the learning curve says which were).
"""

import inspect
import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.vector import VectorEnv
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import FloatSchedule

from rss_shield.agents.curve import CurveRecorder, truncate_curve
from rss_shield.agents.vec_env import VectorEnvAdapter

# For many environments side by side, and a few hundred thousand decisions
ROLLOUT_STEPS = 8192  # decisions of all environments together between two updates, at most
UPDATES = 10  # at least
BATCHES = 8  # in one pass over a rollout
LEARNING_RATE = 1e-3  # at the start; falls to nothing, block by block
HYPERPARAMETERS: dict[str, Any] = dict(
    policy_kwargs={"net_arch": {"pi": [128, 128], "vf": [128, 128]}},
    n_epochs=10,
    learning_rate=LEARNING_RATE,
    gamma=0.9,
)
ROLLOUTS_PER_BLOCK = 3  # a kill loses at most this many rollouts


def train(
    make_vec: Callable[[int], VectorEnv],
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
      make_vec: builds that many environments, with autoreset in the same step.
      seed: fixes the network's first weights and every block.
      total_timesteps: decisions to learn from, rounded up to whole rollouts.
      n_envs: environments stepped side by side.
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
    env = VectorEnvAdapter(make_vec(n_envs))
    try:
        if checkpoint.exists():
            model = PPO.load(checkpoint, env=env, device=device)
        else:
            shutil.rmtree(folder / "tensorboard", ignore_errors=True)
            model = PPO("MlpPolicy", env, seed=seed, device=device, **_options(n_envs, total_timesteps))
        truncate_curve(curve, model.num_timesteps)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        recorder = CurveRecorder(curve, progress)
        block_steps = ROLLOUTS_PER_BLOCK * n_steps * n_envs
        progress(model.num_timesteps)
        while model.num_timesteps < total_timesteps:
            model.set_random_seed(block_seed(seed, model.num_timesteps))
            model.set_env(env, force_reset=True)
            model.lr_schedule = FloatSchedule(LEARNING_RATE * (1 - model.num_timesteps / total_timesteps))
            remaining = total_timesteps - model.num_timesteps
            model.learn(min(block_steps, remaining), callback=recorder, reset_num_timesteps=False)
            _save(model, checkpoint)
        model.logger.close()
    finally:
        env.close()
    os.replace(checkpoint, model_path)
    return model_path


def load_policy(path: Path) -> Callable[[np.ndarray], np.ndarray]:
    """Load a trained model as a greedy policy: observations `[B, ...]` -> discrete actions `[B]`.

    Runs on the CPU, one thread, in double precision: rounding depends on B, and so must be far too
    small to turn one action into another.
    """
    torch.set_num_threads(1)
    policy = PPO.load(path, device="cpu").policy
    logits = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net).double()

    def act(observations: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            flat = torch.as_tensor(observations, dtype=torch.float64).flatten(1)
            return logits(flat).argmax(dim=1).numpy()

    return act


def hyperparameters(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    """Everything that a training depends on, besides seed, device and environment."""
    signature = inspect.signature(PPO.__init__).parameters.values()
    defaults = {p.name: p.default for p in signature if p.default is not p.empty and p.name not in _NO_HYPERPARAMETERS}
    return {
        "algorithm": "stable_baselines3.PPO",
        "policy": "MlpPolicy",
        **defaults,
        **_options(n_envs, total_timesteps),
        "learning_rate_schedule": "falls linearly to 0, from block to block",
        "rollouts_per_block": ROLLOUTS_PER_BLOCK,
        "timesteps": rounded_timesteps(n_envs, total_timesteps),
    }


_NO_HYPERPARAMETERS = ("seed", "device", "tensorboard_log", "verbose", "stats_window_size", "_init_setup_model")


def _options(n_envs: int, total_timesteps: int) -> dict[str, Any]:
    """What differs from the defaults of stable-baselines3."""
    n_steps = rollout_steps(n_envs, total_timesteps)
    return {"n_steps": n_steps, "batch_size": n_steps * n_envs // BATCHES, **HYPERPARAMETERS}


def rollout_steps(n_envs: int, total_timesteps: int) -> int:
    """Decisions per environment between two updates.

    A multiple of BATCHES, so that all batches have one size, and so many that rollouts are as large as
    ROLLOUT_STEPS and UPDATES permit.
    """
    largest = ROLLOUT_STEPS // n_envs // BATCHES
    enough = math.ceil(total_timesteps / UPDATES / (n_envs * BATCHES))
    return max(min(largest, enough), 1) * BATCHES


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


def _paths(folder: Path) -> tuple[Path, Path, Path]:
    return folder / "model.zip", folder / "checkpoint.zip", folder / "learning_curve.csv"


def _save(model: PPO, path: Path) -> None:
    """Save beside the target, then rename: a kill leaves the old checkpoint or the new one."""
    temporary = path.with_name("saving.zip")
    model.save(temporary)
    os.replace(temporary, path)
