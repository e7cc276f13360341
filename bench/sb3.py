"""PPO of stable-baselines3 from end to end: the compiled engine against highway-env in two processes.

    python bench/sb3.py [--rollouts 3] [--shield monitor]

and beside it the PPO in one file of examples/own_algorithm.py, with four passes over a rollout where theirs makes ten.

Both sides have the same network, the same decisions per rollout and the same batches; an iteration
is a rollout and its update. Wall-clock time on a machine that does nothing else, start-up excluded.
"""

import argparse
import functools
import subprocess
import sys
import time
from pathlib import Path

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv

import rss_shield
from rss_shield.agents.ppo import BATCHES, HYPERPARAMETERS, ROLLOUT_STEPS
from rss_shield.agents.vec_env import VectorEnvAdapter

WORKERS = 2


def steps_per_second(env: VecEnv, decisions: int, rollouts: int) -> float:
    """Decisions per second of `rollouts` iterations of PPO, after a short one that is not counted.

    Args:
      env: what to learn on.
      decisions: per rollout, all environments together.
      rollouts: how many.
    """
    options = {"batch_size": decisions // BATCHES, **HYPERPARAMETERS}
    model = PPO("MlpPolicy", env, n_steps=decisions // env.num_envs, seed=0, device="cpu", **options)
    env.reset()  # compiles
    env.step([1] * env.num_envs)
    start = time.perf_counter()
    model.learn(rollouts * decisions)
    seconds = time.perf_counter() - start
    env.close()
    return model.num_timesteps / seconds


def in_one_file(decisions: int) -> str:
    """What the example says of its speed."""
    script = Path(__file__).parents[1] / "examples" / "own_algorithm.py"
    done = subprocess.run([sys.executable, script, str(decisions)], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--env-id", default="highway-fast-v0")
    parser.add_argument("--shield", choices=("override", "monitor"), help="default: none")
    parser.add_argument("--n-envs", type=int, default=128, help="environments in the engine")
    parser.add_argument("--decisions", type=int, default=ROLLOUT_STEPS, help="per rollout")
    parser.add_argument("--rollouts", type=int, default=1, help="on highway-env; ten times as many in the engine")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    make = functools.partial(rss_shield.make, arguments.env_id, shield=arguments.shield)
    fast = VectorEnvAdapter(rss_shield.make_vec(arguments.env_id, arguments.n_envs, shield=arguments.shield))
    engine = steps_per_second(fast, arguments.decisions, 10 * arguments.rollouts)
    print(f"engine, {arguments.n_envs} environments in one process: {engine:.0f} decisions/s", flush=True)
    print(f"examples/own_algorithm.py, highway-fast-v0 behind the shield: {in_one_file(10 * arguments.decisions)}")
    original = steps_per_second(SubprocVecEnv([make] * WORKERS), arguments.decisions, arguments.rollouts)
    print(f"highway-env, SubprocVecEnv with {WORKERS} processes: {original:.1f} decisions/s")
    print(f"ratio: {engine / original:.0f}")


if __name__ == "__main__":
    main()
