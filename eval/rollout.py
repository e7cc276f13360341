"""Drive a policy through episodes with fixed seeds; one record per episode."""

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import pandas as pd

from eval.progress import progress_bar

MakeEnv = Callable[[], Any]  # builds a gymnasium environment whose info has the shield's keys
Policy = Callable[[Any], Any]  # observation -> action


def evaluate(
    make_env: MakeEnv,
    make_policy: Callable[[], Policy],
    seeds: Sequence[int],
    *,
    n_workers: int = 1,
    description: str = "evaluate",
) -> pd.DataFrame:
    """Play one episode per seed, several at a time, with a progress bar.

    Every episode has an environment of its own, so its record depends on policy and seed alone, not
    on the number of processes.

    Args:
      make_env, make_policy: build the environment and the policy; picklable when n_workers > 1.
      seeds: one per episode.
      n_workers: processes (1: this one).

    Returns:
      One row per episode, in the order of `seeds`; columns as in `run_episode`.
    """
    records = []
    with progress_bar(len(seeds), description, "episode") as bar:
        if n_workers == 1:
            policy = make_policy()
            for seed in seeds:
                records.append(run_episode(make_env, policy, seed))
                bar.update()
        else:
            # forked or spawned from a clean process: this one may hold threads and a GPU
            methods = multiprocessing.get_all_start_methods()
            method = "forkserver" if "forkserver" in methods else "spawn"
            context = multiprocessing.get_context(method)
            with ProcessPoolExecutor(n_workers, context, _start_worker, (make_env, make_policy)) as pool:
                for record in pool.map(_run_in_worker, seeds):
                    records.append(record)
                    bar.update()
    return pd.DataFrame(records)


def run_episode(make_env: MakeEnv, policy: Policy, seed: int) -> dict[str, Any]:
    """Play one episode and return its record.

    seed; return; length [decisions]; speed: mean of info["speed"] [m/s]; crashed: the car touched
    somebody; env_crashed: the simulator's own flag; blame: ego, both, other, inherited, none or
    empty; inherited: blame is "inherited"; cost: sum; override_share: of the simulation frames;
    dangerous_pairs, broken_duties: pair-frames in danger, and those on which the car broke its duty;
    min_ttc: smallest time to collision [s]; evidence: the verdict's grounds as JSON.
    """
    env = make_env()
    try:
        observation, info = env.reset(seed=seed)
        total_reward, length, total_speed = 0.0, 0, 0.0
        done = False
        while not done:
            observation, reward, terminated, truncated, info = env.step(policy(observation))
            total_reward += float(reward)
            total_speed += float(info["speed"])
            length += 1
            done = terminated or truncated
    finally:
        env.close()
    return {
        "seed": seed,
        "return": total_reward,
        "length": length,
        "speed": total_speed / length,
        "crashed": bool(info["blame"]) or bool(info["crashed"]),
        "env_crashed": bool(info["crashed"]),
        "blame": info["blame"],
        "inherited": info["blame"] == "inherited",
        "cost": float(info["episode_cost"]),
        "override_share": float(info["override_share"]),
        "dangerous_pairs": int(info["episode_dangerous_pairs"]),
        "broken_duties": int(info["episode_broken_duties"]),
        "min_ttc": float(info["min_ttc"]),
        "evidence": json.dumps(info["blame_evidence"], default=_plain) if info["blame"] else "",
    }


def _plain(number: Any) -> Any:
    return number.item()  # numpy scalars


_worker: dict[str, Any] = {}  # what a worker process needs for every episode


def _start_worker(make_env: MakeEnv, make_policy: Callable[[], Policy]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    _worker["make_env"] = make_env
    _worker["policy"] = make_policy()


def _exit_with_parent() -> None:
    """A worker whose parent was killed must not wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_in_worker(seed: int) -> dict[str, Any]:
    return run_episode(_worker["make_env"], _worker["policy"], seed)
