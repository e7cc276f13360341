"""Drive a policy through episodes with fixed seeds; one record per episode."""

import itertools
import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

NO_CONTACT = "no contact"  # blame in tables: an empty text would come back from a CSV file as a missing value
# what was changed, and how the ride felt
RIDE = (
    *("anticipation_share", "limited_share", "mean_acceleration_change", "mean_steering_change"),
    *("rms_acceleration", "rms_jerk", "rms_lateral_acceleration", "rms_lateral_jerk", "rms_yaw_acceleration"),
    *("p99_acceleration", "p99_jerk", "p99_lateral_acceleration", "p99_lateral_jerk", "p99_yaw_acceleration"),
    *("comfortable_share", "hard_braking_share", "hard_brakings_per_km", "min_time_gap", "mean_time_gap"),
)
# of the driving safety field and beside it, where it is measured
RISK = (
    *("max_rdsi", "max_total_rdsi", "time_known_safe", "time_unknown", "time_known_unsafe"),
    *("band_risk", "min_thw", "max_drac"),
)
MOST_DRAC = 100.0  # braking beyond says nothing more, and is infinite at a contact [m/s^2]
MakeEnv = Callable[[], Any]  # builds a gymnasium environment whose info has the shield's keys
Policy = Callable[[Any], Any]  # observation -> action


def evaluate(
    make_vec: Callable[[int], Any],
    policy: Callable[..., np.ndarray],
    seeds: Sequence[int],
    *,
    n_envs: int = 1,
    keep_actions: bool = True,
    masked: bool = False,
    progress: Callable[[int], None] = lambda episodes: None,
    more: Callable[[Any, int], dict[str, Any]] = lambda env, e: {},
) -> pd.DataFrame:
    """Play exactly one episode per seed, several side by side.

    An environment whose episode ends takes the next seed, so the record of an episode depends on
    policy and seed alone, not on `n_envs`.

    Args:
      make_vec: builds that many environments without autoreset (a `gymnasium.vector.VectorEnv` whose
        `reset` takes a "reset_mask").
      policy: observations `[E, ...]` -> actions `[E]`.
      seeds: one per episode.
      n_envs: E.
      keep_actions: fill the column "actions"; they must be whole numbers.
      masked: the policy gets `action_masks()` of the environments `[E, A]` as a second argument.
      progress: called with the episodes done so far.
      more: further columns, of environment `e` of `env`, whose episode has just ended.

    Returns:
      One row per episode, in the order of `seeds`; columns as in `run_episode`, and actions: the
      numbers of the actions, separated by spaces.
    """
    envs = min(n_envs, len(seeds))
    env = make_vec(envs)
    records: dict[int, dict[str, Any]] = {}  # by index into seeds
    playing, upcoming = list(range(envs)), itertools.count(envs)  # indices into seeds; beyond: nothing is left
    returns, speeds, lengths = np.zeros(envs), np.zeros(envs), np.zeros(envs, int)
    actions: list[list[int]] = [[] for _ in range(envs)]
    try:
        observations, _ = env.reset(seed=[int(seed) for seed in seeds[:envs]])
        while len(records) < len(seeds):
            chosen = policy(observations, _masks(env)) if masked else policy(observations)
            observations, rewards, terminated, truncated, infos = env.step(chosen)
            returns += rewards
            speeds += infos["speed"]
            lengths += 1
            for e in range(envs if keep_actions else 0):
                actions[e].append(int(chosen[e]))
            ended = terminated | truncated
            if not ended.any():
                continue
            for e in np.flatnonzero(ended).tolist():
                if playing[e] < len(seeds):
                    record = _record(seeds[playing[e]], returns[e], speeds[e], int(lengths[e]), _info(infos, e))
                    record |= {"actions": " ".join(map(str, actions[e]))} | more(env, e)
                    records[playing[e]] = with_frozen(record, bool(truncated[e] and not terminated[e]))
                playing[e] = next(upcoming)
                returns[e], speeds[e], lengths[e], actions[e] = 0.0, 0.0, 0, []
            progress(len(records))
            next_seeds = [int(seeds[i % len(seeds)]) if end else None for i, end in zip(playing, ended, strict=True)]
            observations, _ = env.reset(seed=next_seeds, options={"reset_mask": ended})
    finally:
        env.close()
    return pd.DataFrame([records[i] for i in range(len(seeds))])


def _masks(env: Any) -> np.ndarray:
    """`action_masks()` of all environments, `[E, A]`: of the engine at once, of others one after the other."""
    return env.action_masks() if hasattr(env, "action_masks") else np.stack(env.call("action_masks"))


def run_episode(make_env: MakeEnv, policy: Policy, seed: int) -> dict[str, Any]:
    """Play one episode in an environment of its own and return its record.

    seed; return; length [decisions]; speed: mean of info["speed"] [m/s]; crashed: the car touched
    somebody; env_crashed: the simulator's own flag; blame: ego, both, other, inherited, none or
    NO_CONTACT; inherited: blame is "inherited"; time: how long the episode lasted [s]; success: the car has
    reached its goal untouched (no such column where there is no goal); cost: sum; override_share: of
    the simulation frames; dangerous_pairs, broken_duties: pair-frames in danger, and those on which the
    car broke its duty; min_ttc: smallest time to collision [s]; what was changed and how the ride felt: the keys
    `RIDE`, and with the option `risk` the keys `RISK`, as `envs.highway.wrapper.ShieldWrapper` documents them
    (max_drac at most `MOST_DRAC`); with the option `measures` what it adds, and frozen: the time was up and the ego had
    stood for 5 s or more with nobody within 20 m; evidence: the verdict's grounds as JSON, {} without contact.
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
    return with_frozen(_record(seed, total_reward, total_speed, length, info), bool(truncated and not terminated))


FROZEN = 5.0  # [s]


def with_frozen(record: dict[str, Any], time_up: bool) -> dict[str, Any]:
    """Where it is known how long the ego has stood with nobody within 20 m: has it frozen until the time was up?"""
    if "standing_free" not in record:
        return record
    return record | {"frozen": time_up and record["standing_free"] >= FROZEN}


def _record(seed: int, total_reward: float, total_speed: float, length: int, info: dict[str, Any]) -> dict[str, Any]:
    """The record of an episode from its sums and its last info."""
    blame = str(info["blame"])
    crashed = bool(blame) or bool(info["crashed"])
    goal = {"success": bool(info["is_success"]) and not crashed} if "is_success" in info else {}
    return {
        "seed": int(seed),
        "return": float(total_reward),
        "length": length,
        "time": float(info["time"]),
        **goal,
        "speed": float(total_speed) / length,
        "crashed": crashed,
        "env_crashed": bool(info["crashed"]),
        "blame": blame or NO_CONTACT,
        "inherited": blame == "inherited",
        "cost": float(info["episode_cost"]),
        "override_share": float(info["override_share"]),
        "dangerous_pairs": int(info["episode_dangerous_pairs"]),
        "broken_duties": int(info["episode_broken_duties"]),
        "min_ttc": float(info["min_ttc"]),
        **{name: float(info[name]) for name in RIDE if name in info},
        **{name: float(value) for name, value in info.get("measures", {}).items()},
        **{name: _risk(name, info[name]) for name in RISK if name in info},
        "evidence": json.dumps(info["blame_evidence"] if blame else {}, default=_plain),
    }


def _risk(name: str, value: Any) -> float:
    return min(float(value), MOST_DRAC) if name == "max_drac" else float(value)


def _info(infos: dict[str, Any], e: int) -> dict[str, Any]:
    """The info of environment `e` out of dictionaries of arrays `[E]`, without the "_name" marks."""
    return {
        name: _info(values, e) if isinstance(values, dict) else values[e]
        for name, values in infos.items()
        if not name.startswith("_")
    }


def _plain(number: Any) -> Any:
    return number.item()  # numpy scalars
