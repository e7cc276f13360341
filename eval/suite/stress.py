"""`rss-shield stress`: very many episodes in the engine, until somebody finds an ego at fault.

A campaign is environments x policies x presets, played in blocks of seeds; a block is one file, written when it is
finished, so a campaign that was killed goes on where it stopped, and nothing is counted twice or lost. At the first
verdict that charges the ego, or none, the episode is played again on highway-env with the same actions, and its trace
is kept beside the blocks for `rss-shield judge`.
"""

import argparse
import hashlib
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode

from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.make import make
from rss_shield.envs.make_vec import make_vec
from rss_shield.eval.files import write_json
from rss_shield.eval.rollout import NO_CONTACT, evaluate
from rss_shield.eval.stats import clopper_pearson
from rss_shield.shield.params import PRESETS
from rss_shield.shield.trace import save
from rss_shield.shield.verdicts import AT_FAULT, VERDICTS

POLICIES = ("random", "faster", "slower", "switching")
DEFAULT_ENVS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0", "roundabout-v0", "intersection-v0")
SIDE_BY_SIDE = 512  # environments in the engine
_KEPT_FOR = 0.2  # chance per decision that a switching policy takes another action
BAD = (*AT_FAULT, "none")  # verdicts that a campaign stops at


class Block(NamedTuple):
    """Episodes of one kind, with consecutive seeds."""

    env_id: str
    policy: str
    params: str  # "" = what the environment has
    shield: str
    first: int  # seed
    episodes: int

    @property
    def name(self) -> str:
        """Of its file; the same block has the same, in any campaign."""
        digest = hashlib.sha256(json.dumps(self).encode()).hexdigest()[:8]
        return f"{self.env_id}_{self.policy}_{self.params or 'own'}_{self.shield}_{self.first}_{digest}.json"


def blocks_of(
    envs: list[str], policies: list[str], presets: list[str], shield: str, seed: int, episodes: int, size: int
) -> list[Block]:
    """All blocks of a campaign, a little of everything first."""
    starts = range(seed, seed + episodes, size)
    return [
        Block(env_id, policy, params, shield, first, min(size, seed + episodes - first))
        for first, env_id, policy, params in itertools.product(starts, envs, policies, presets)
    ]


def play(block: Block, threads: int = 1) -> dict[str, Any]:
    """Play a block.

    Returns:
      JSON: the block, episodes by verdict, seconds, duties broken, smallest time to collision, and of episodes with a
      bad verdict seed, verdict and actions.
    """
    params, mode = block.params or None, AutoresetMode.DISABLED
    rng = np.random.default_rng([block.first, block.episodes, *block.env_id.encode(), *block.policy.encode()])
    envs: list[Any] = []

    def made(n: int) -> Any:
        envs.append(make_vec(block.env_id, n, block.shield, params=params, threads=threads, autoreset_mode=mode))
        return envs[-1]

    policy = policy_of(block.policy, lambda: int(envs[-1].single_action_space.n), rng)
    seeds = range(block.first, block.first + block.episodes)
    table = evaluate(made, policy, seeds, n_envs=min(SIDE_BY_SIDE, block.episodes))
    return {"block": block._asdict(), **counted(table)}


def counted(table: pd.DataFrame) -> dict[str, Any]:
    """What is kept of episodes."""
    bad = table[table["blame"].isin(BAD)]
    return {
        "episodes": len(table),
        "verdicts": {name: int((table["blame"] == name).sum()) for name in (*VERDICTS, NO_CONTACT)},
        "seconds": float(table["time"].sum()),
        "broken_duties": int(table["broken_duties"].sum()),
        "dangerous_pairs": int(table["dangerous_pairs"].sum()),
        "min_ttc": float(table["min_ttc"].min()),
        "bad": bad[["seed", "blame", "actions"]].to_dict("records"),
    }


def policy_of(name: str, actions: Callable[[], int], rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
    """A scripted policy of many environments; FASTER and SLOWER are the last two meta-actions, or the last and "
    "first."""
    if name not in POLICIES:
        raise ValueError(f"policy = {name!r}: expected one of {', '.join(POLICIES)}")
    last: dict[int, np.ndarray] = {}

    def act(observations: np.ndarray) -> np.ndarray:
        count, n = len(observations), actions()
        if name == "random":
            return rng.integers(n, size=count)
        if name == "faster":
            return np.full(count, n - 2 if n == 5 else n - 1)
        if name == "slower":
            return np.full(count, n - 1 if n == 5 else 0)
        drawn = rng.integers(n, size=count)
        kept = last.get(count, drawn)
        last[count] = np.where(rng.random(count) < _KEPT_FOR, drawn, kept)
        return last[count]

    return act


def keep_trace(block: Block, seed: int, actions: str, path: Path) -> str:
    """Play one episode of a block again on highway-env, into a file; returns the verdict there."""
    recorded = iter([int(action) for action in actions.split()])
    env = make(block.env_id, block.shield, block.params or None)
    trace = record_trace(env, lambda observation: next(recorded, 0), seed)
    save(trace, path)
    return str(trace.meta["blame"])


def summary(results: list[dict[str, Any]]) -> str:
    """What a campaign has come to so far."""
    total = {name: sum(one["verdicts"][name] for one in results) for name in (*VERDICTS, NO_CONTACT)}
    n = sum(one["episodes"] for one in results)
    at_fault = sum(total[name] for name in AT_FAULT)
    lines = [
        f"{n} episodes, {sum(one['seconds'] for one in results) / 3600:.1f} h of driving: "
        + ", ".join(f"{name} {count}" for name, count in total.items())
    ]
    for what, k in (("ego at fault", at_fault), ("no verdict", total["none"])):
        lines.append(f"{what}: {k}, upper end of the exact 95 % interval {clopper_pearson(k, n).high:.2g}")
    lines.append(f"duties broken: {sum(one['broken_duties'] for one in results)} pair-frames")
    return "\n".join(lines)


def run(arguments: list[str] | None = None) -> None:
    """Play a campaign, or go on with it."""
    parser = argparse.ArgumentParser(prog="rss-shield stress", description="Look for an ego at fault, in the engine.")
    parser.add_argument("--envs", default=",".join(DEFAULT_ENVS), help="separated by commas")
    parser.add_argument("--policies", default=",".join(POLICIES), help="separated by commas")
    parser.add_argument("--params", default="", help=f"presets, separated by commas: {', '.join(PRESETS)}")
    parser.add_argument("--shield", choices=("override", "monitor"), default="override")
    parser.add_argument("--episodes", type=int, default=1000, help="of each kind")
    parser.add_argument("--block", type=int, default=1000, help="episodes in a file")
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--threads", type=int, default=1, help="of the engine")
    parser.add_argument("--out", type=Path, default=Path("runs/stress"), help="folder of a campaign")
    options = parser.parse_args(arguments)
    if options.episodes < 1 or options.block < 1:
        sys.exit(
            f"rss-shield stress: --episodes {options.episodes} --block {options.block}: expected whole numbers >= 1"
        )
    envs, policies, presets = (text.split(",") for text in (options.envs, options.policies, options.params))
    options.out.mkdir(parents=True, exist_ok=True)
    results = []
    for block in blocks_of(envs, policies, presets, options.shield, options.seed, options.episodes, options.block):
        path = options.out / block.name
        if path.exists():
            result = json.loads(path.read_text(encoding="utf-8"))
        else:
            try:
                result = play(block, options.threads)
            except ValueError as error:
                sys.exit(f"rss-shield stress: {error}")
            write_json(path, result)
            print(f"{path.name}: {result['verdicts']}", flush=True)
        results.append(result)
        if result["bad"]:
            _stop(block, result, path, results)
    print(summary(results))


def _stop(block: Block, result: dict[str, Any], path: Path, results: list[dict[str, Any]]) -> None:
    """Keep the shortest bad episode and end the campaign."""
    worst = min(result["bad"], key=lambda one: len(one["actions"].split()))
    trace = path.with_suffix(f".seed{worst['seed']}.npz")
    verdict = keep_trace(block, int(worst["seed"]), worst["actions"], trace)
    print(summary(results))
    sys.exit(
        f"rss-shield stress: seed {worst['seed']} of {block.env_id} with {block.policy} ends with blame "
        f"{worst['blame']!r} ({verdict!r} on highway-env): rss-shield judge {trace}"
    )
