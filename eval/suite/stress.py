"""`rss-shield stress`: very many episodes in the engine, until somebody finds an ego at fault.

A campaign is environments x policies x traffic x presets, played in blocks of seeds; a block is one file, written when
it is finished, so a campaign that was killed goes on where it stopped, and nothing is counted twice or lost. At the
first verdict that charges the ego, or none, the episode is played again on highway-env with the same actions, and its
trace is kept beside the blocks for `rss-shield judge`.
"""

import argparse
import hashlib
import itertools
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode

from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.make import make
from rss_shield.envs.make_vec import make_vec
from rss_shield.envs.roads.hostile import HOSTILE
from rss_shield.eval.files import folder_for, refuse, write_json
from rss_shield.eval.own import digests
from rss_shield.eval.rollout import NO_CONTACT, evaluate
from rss_shield.eval.run_folder import versions
from rss_shield.eval.stats import clopper_pearson
from rss_shield.eval.suite.assault import CONTINUOUS, FREE, POLICIES, STEERED, policy_of
from rss_shield.eval.suite.own_table import KNOWN_PRESETS, is_file, preset_in
from rss_shield.eval.suite.stress_page import write_page
from rss_shield.eval.suite.watched import Watched
from rss_shield.shield.params import Preset
from rss_shield.shield.trace import save
from rss_shield.shield.verdicts import AT_FAULT, VERDICTS

DEFAULT_ENVS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0", "roundabout-v0", "intersection-v0")
STOCK = "stock"  # the environment's own traffic
SIDE_BY_SIDE = 512  # environments in the engine
CODE = ("git_commit", "git_changes")  # of a block's versions
BAD = (*AT_FAULT, "none")  # verdicts that a campaign stops at


class Block(NamedTuple):
    """Episodes of one kind, with consecutive seeds."""

    env_id: str
    policy: str
    params: str  # preset or file; "" = what the environment has
    shield: str
    first: int  # seed
    episodes: int
    traffic: str = STOCK  # or one of HOSTILE
    judged: bool = False  # contacts are judged from the outside, too

    @property
    def name(self) -> str:
        """Of its file; the same block has the same, in any campaign."""
        files = digests([self.params])  # another state of a table is another block
        told = [*self, files] if files else self
        digest = hashlib.sha256(json.dumps(told).encode()).hexdigest()[:8]
        table = Path(self.params).stem if is_file(self.params) else self.params or "own"
        mode = f"{self.shield}{'_judged' if self.judged else ''}"
        kind = f"{self.env_id}_{self.policy}_{self.traffic}_{table}_{mode}"
        return f"{kind}_{self.first}_{digest}.json"

    @property
    def table(self) -> Preset | None:
        """In force; None = what the environment has."""
        return preset_in(self.params) if self.params else None

    @property
    def config(self) -> dict[str, Any] | None:
        """Of its environment."""
        config: dict[str, Any] = dict(CONTINUOUS) if self.policy in FREE else {}
        if self.traffic != STOCK:
            if self.traffic not in HOSTILE:
                known = ", ".join((STOCK, *HOSTILE))
                raise ValueError(f"traffic = {self.traffic!r}: expected one of {known}")
            config["other_vehicles_type"] = HOSTILE[self.traffic]
        return config or None


def blocks_of(
    envs: Iterable[str],
    policies: Iterable[str],
    presets: Iterable[str],
    shield: str,
    seed: int,
    episodes: int,
    size: int,
    traffic: Sequence[str] = (STOCK,),
    judged: bool = False,
) -> list[Block]:
    """All blocks of a campaign, a little of everything first. The engine steers freely on some roads only."""
    starts = range(seed, seed + episodes, size)
    return [
        Block(env_id, policy, params, shield, first, min(size, seed + episodes - first), others, judged)
        for first, env_id, policy, others, params in itertools.product(starts, envs, policies, traffic, presets)
        if policy not in FREE or env_id in STEERED
    ]


def play(block: Block, threads: int = 1) -> dict[str, Any]:
    """Play a block.

    Returns:
      JSON: the block and what `counted` says.
    """
    rng = np.random.default_rng([block.first, block.episodes, *"".join(map(str, block[:4])).encode()])
    envs: list[Watched] = []

    def made(n: int) -> Any:
        options: dict[str, Any] = {"params": block.table, "config": block.config, "threads": threads}
        env = make_vec(block.env_id, n, block.shield, autoreset_mode=AutoresetMode.DISABLED, **options)
        envs.append(Watched(env, block.judged))
        return envs[-1]

    policy = policy_of(block.policy, lambda: envs[-1].env, rng)
    seeds = range(block.first, block.first + block.episodes)
    table = evaluate(
        made, policy, seeds, n_envs=min(SIDE_BY_SIDE, block.episodes), keep_actions=False, more=Watched.columns
    )
    return {"block": block._asdict(), **counted(table)}


def counted(table: pd.DataFrame) -> dict[str, Any]:
    """What is kept of episodes: how many there were by verdict, seconds and metres driven, duties broken, pair-frames
    in danger, seconds overridden, the smallest time to collision and margin, of episodes with a bad verdict seed,
    verdict and actions, and likewise of those in which a duty was broken or the judge says something else."""
    bad = table[table["blame"].isin(BAD)]
    judged: dict[str, Any] = {}
    if "judged" in table:
        contacts = table[table["blame"] != NO_CONTACT]
        others = contacts[contacts["blame"] != contacts["judged"]]
        judged = {
            "contacts": len(contacts),
            "different": others[["seed", "blame", "judged", "actions"]].to_dict("records"),
        }
    return {
        "episodes": len(table),
        "verdicts": {name: int((table["blame"] == name).sum()) for name in (*VERDICTS, NO_CONTACT)},
        "seconds": float(table["time"].sum()),
        "metres": float((table["time"] * table["speed"]).sum()),
        "overridden": float((table["time"] * table["override_share"]).sum()),
        "broken_duties": int(table["broken_duties"].sum()),
        "dangerous_pairs": int(table["dangerous_pairs"].sum()),
        "min_ttc": float(table["min_ttc"].min()),
        "worst_margin": float(table["worst_margin"].min()),
        "bad": bad[["seed", "blame", "actions"]].to_dict("records"),
        "broken": table.loc[table["broken_duties"] > 0, ["seed", "actions"]].to_dict("records"),
        **({"judged": judged} if judged else {}),
    }


def keep_trace(block: Block, seed: int, actions: str, path: Path) -> str:
    """Play one episode of a block again on highway-env, into a file; returns the verdict there."""
    recorded = iter([_action(action) for action in actions.split()])
    env = make(block.env_id, block.shield, block.table, config=block.config)
    stand_still = np.zeros(2, np.float32) if block.policy in FREE else 0
    trace = record_trace(env, lambda observation: next(recorded, stand_still), seed)
    save(trace, path)
    return str(trace.meta["blame"])


def _action(text: str) -> Any:
    return np.array(text.split(","), np.float32) if "," in text else int(text)


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
    parser.add_argument("--policies", default=",".join(POLICIES), help=f"separated by commas; also {', '.join(FREE)}")
    parser.add_argument("--traffic", default=STOCK, help=f"separated by commas: {STOCK}, {', '.join(HOSTILE)}, or all")
    parser.add_argument("--preset", "--params", default="", help=f"separated by commas: {KNOWN_PRESETS}")
    parser.add_argument("--shield", choices=("override", "monitor"), default="override")
    parser.add_argument("--episodes", type=int, default=1000, help="of each kind")
    parser.add_argument("--block", type=int, default=1000, help="episodes in a file")
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--threads", type=int, default=1, help="of the engine")
    parser.add_argument("--judged", action="store_true", help="judge every contact from the outside, too")
    parser.add_argument("--go-on", action="store_true", help="write down what is found, and do not stop")
    parser.add_argument("--out", type=Path, default=Path("runs/stress"), help="folder of a campaign")
    parser.add_argument("--write", type=Path, help="play nothing; write the page of what is there into this folder")
    options = parser.parse_args(arguments)
    if options.write is not None:
        try:
            write_page(options.out, folder_for(options.write, "--write"), "rss-shield stress --write docs/results")
        except ValueError as error:
            refuse("rss-shield stress", error)
        return
    envs, policies, presets = (text.split(",") for text in (options.envs, options.policies, options.preset))
    traffic = [STOCK, *HOSTILE] if options.traffic == "all" else options.traffic.split(",")
    numbers = options.seed, options.episodes, options.block
    kinds = itertools.product(envs, policies, traffic, presets)
    try:
        for option, least in (("seed", 0), ("episodes", 1), ("block", 1), ("threads", 1)):
            if getattr(options, option) < least:
                raise ValueError(f"--{option} {getattr(options, option)}: expected a whole number >= {least}")
        for kind in kinds:
            _check(*kind)
        folder_for(options.out)
    except ValueError as error:
        refuse("rss-shield stress", error)
    results, now = [], versions()
    older = 0
    for block in blocks_of(envs, policies, presets, options.shield, *numbers, traffic, options.judged):
        path = options.out / block.name
        if path.exists():
            result = json.loads(path.read_text(encoding="utf-8"))
            older += any(result.get("versions", {}).get(name) != now[name] for name in CODE)
        else:
            try:
                result = {**play(block, options.threads), "versions": now}
            except ValueError as error:
                refuse("rss-shield stress", error)
            write_json(path, result)
            print(f"{path.name}: {result['verdicts']}", flush=True)
        results.append(result)
        if result["bad"] and not options.go_on:
            _stop(block, result, path, results)
    print(summary(results))
    if older:
        print(
            f"rss-shield stress: warning: {older} of {len(results)} blocks were played by other code than this; in "
            "another --out all are played again",
            file=sys.stderr,
        )


def _check(env_id: str, policy: str, traffic: str, preset: str) -> None:
    """Can a kind be played at all?

    Raises:
      ValueError: what is wrong with it.
    """
    for option, value, known in (("policy", policy, (*POLICIES, *FREE)), ("traffic", traffic, (STOCK, *HOSTILE))):
        if value not in known:
            raise ValueError(f"{option} = {value!r}: expected one of {', '.join(known)}")
    if preset:
        preset_in(preset)
    make(env_id, shield=None).close()


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
