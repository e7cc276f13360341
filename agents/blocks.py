"""Train any learner on any vector environment, with checkpoints, and go on after a kill.

Training proceeds in blocks of a few rollouts. A block starts by seeding every generator and resetting
every environment from (seed, timesteps done), and ends by saving the model. So a block depends on
the saved model alone, and a run that was killed and resumed gives the same result, bit for bit, as
one that was left alone. The price: at the end of a block the unfinished episodes are cut off (PPO
bootstraps their value, so the estimate stays sound; the learning curve says which were).

What an off-policy learner has seen belongs to its model: its replay buffer is saved beside every checkpoint, under the
number of decisions that both belong to, so that a kill between the two leaves a pair that fits.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.vector import VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm

from rss_shield.agents.curve import CurveRecorder, truncate_curve
from rss_shield.agents.learner import Learner
from rss_shield.agents.own_reward import Reward
from rss_shield.agents.trackers import logger_of

Watch = Callable[[BaseAlgorithm], None]


def train_in_blocks(
    learner: Learner,
    make_vec: Callable[[int], VectorEnv],
    folder: Path,
    *,
    seed: int,
    total_timesteps: int,
    n_envs: int = 1,
    device: str = "cpu",
    progress: Callable[[int], None] = lambda timesteps: None,
    watch: Watch = lambda model: None,
    reward: Reward | None = None,
    tracker: str = "tensorboard",
) -> Path:
    """Train, or go on where an earlier call in the same folder was stopped.

    Writes into `folder`: `checkpoint.zip` after every block, `model.zip` at the end, one row per
    training episode in `learning_curve.csv`, and TensorBoard events in `tensorboard/`.

    Args:
      make_vec: builds that many environments, with autoreset in the same step.
      seed: fixes the network's first weights and every block.
      total_timesteps: decisions to learn from, rounded up to whole rollouts.
      n_envs: environments stepped side by side.
      progress: called with the timesteps done so far.
      tracker: what else gets the numbers that TensorBoard gets, see `agents.trackers`.
      watch: called with the model before it is saved after a block, for tests on the way. It may draw random
        numbers: the next block seeds every generator anew.
      reward: what the agent is paid by, see `agents.own_reward`; None = the environment's reward.

    Returns:
      Path of the trained model. Nothing is trained when it exists already.
    """
    model_path, checkpoint, curve = folder / "model.zip", folder / "checkpoint.zip", folder / "learning_curve.csv"
    total = learner.rounded(n_envs, total_timesteps)
    if model_path.exists():
        progress(total)
        return model_path
    torch.set_num_threads(1)  # the order of a sum must not depend on the number of cores
    folder.mkdir(parents=True, exist_ok=True)
    block_steps = learner.rollouts_per_block(n_envs) * learner.rollout(n_envs, total_timesteps)
    env = learner.adapt(make_vec(n_envs))
    env.reward = reward
    try:
        model = _loaded(learner, checkpoint, env, device) or _new(learner, folder, env, seed, device, total_timesteps)
        truncate_curve(curve, model.num_timesteps)
        model.set_logger(logger_of(tracker, folder))
        callbacks = [CurveRecorder(curve, progress), *learner.callbacks()]
        progress(model.num_timesteps)
        while model.num_timesteps < total_timesteps:
            model.set_random_seed(block_seed(seed, model.num_timesteps))
            model.set_env(env, force_reset=True)
            learner.begin_block(model, total_timesteps)
            remaining = total_timesteps - model.num_timesteps
            model.learn(min(block_steps, remaining), callback=callbacks, reset_num_timesteps=False)
            watch(model)
            _save(model, checkpoint)
        model.logger.close()
    finally:
        env.close()
    os.replace(checkpoint, model_path)
    for buffer in _buffers(folder):
        buffer.unlink()
    return model_path


def block_seed(seed: int, timesteps: int) -> int:
    """Seed of the block that starts after `timesteps` decisions, in [0, 2**29)."""
    return int(np.random.SeedSequence((seed, timesteps)).generate_state(1)[0]) >> 3


def available_devices() -> list[str]:
    """What `device` may be on this machine."""
    return ["auto", "cpu"] + (["cuda"] if torch.cuda.is_available() else [])


def _new(learner: Learner, folder: Path, env: Any, seed: int, device: str, total_timesteps: int) -> Any:
    shutil.rmtree(folder / "tensorboard", ignore_errors=True)
    options = learner.options(env.num_envs, total_timesteps)
    model: Any = learner.algorithm("MlpPolicy", env, seed=seed, device=device, **options)
    kind = type(model)
    if kind.__module__.startswith("rss_shield."):  # others are recognised by what they are made of
        model.algorithm_path = f"{kind.__module__}.{kind.__name__}"
    for name, value in learner.attributes().items():
        setattr(model, name, value)
    return model


def _loaded(learner: Learner, checkpoint: Path, env: Any, device: str) -> Any:
    if not checkpoint.exists():
        return None
    model: Any = learner.algorithm.load(checkpoint, env=env, device=device)
    if hasattr(model, "replay_buffer"):
        model.load_replay_buffer(_buffer(checkpoint.parent, model.num_timesteps))
    return model


def _save(model: Any, checkpoint: Path) -> None:
    """Save beside the target, then rename: a kill leaves the old checkpoint or the new one, with its buffer."""
    folder = checkpoint.parent
    if hasattr(model, "replay_buffer"):
        kept = _buffer(folder, model.num_timesteps)
        unfinished = folder / "saving.pkl"
        model.save_replay_buffer(unfinished)
        os.replace(unfinished, kept)
    temporary = checkpoint.with_name("saving.zip")
    model.save(temporary)
    os.replace(temporary, checkpoint)
    for buffer in _buffers(folder):
        if buffer != _buffer(folder, model.num_timesteps):
            buffer.unlink()


def _buffer(folder: Path, timesteps: int) -> Path:
    return folder / f"replay-buffer-{timesteps}.pkl"


def _buffers(folder: Path) -> list[Path]:
    return list(folder.glob("replay-buffer-*.pkl"))
