"""Hashes of whole episodes, to see whether a change of the code changes what happens.

    python tests/fingerprints.py --write before.json     # on the old code
    python tests/fingerprints.py --compare before.json   # on the new code: names every case that differs

A case is an environment, a mode, a conduct and a policy, on one backend; its hash covers every observation, reward,
end and info of a few episodes with fixed seeds. Hashes depend on the processor and on versions of numpy, so they are
compared on one machine and not kept.
"""

import argparse
import hashlib
import json
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rss_shield import make, make_vec

MOTORWAYS = ("highway-fast-v0", "highway-v0", "merge-v0", "merge-v1", "exit-v0", "exit-v1", "two-way-v0")
CROSSINGS = ("intersection-v0", "intersection-v2", "roundabout-v0", "roundabout-v1")
CONDUCTS: tuple[dict[str, str], ...] = (
    dict(),
    dict(intent="known"),
    dict(intent="straight", waiting="anywhere"),
    dict(intent="known", entry="assertive"),
    dict(intent="known", examine="first"),
)
CONTINUOUS = {"action": {"type": "ContinuousAction"}}


def cases() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and arguments of every case."""
    for mode in ("override", "monitor", None):
        for env_id in MOTORWAYS + CROSSINGS:
            for policy in ("random", "fast"):
                yield f"fast {env_id} {mode} {policy}", dict(env_id=env_id, shield=mode, policy=policy)
        yield (
            f"fast highway-fast-v0 {mode} continuous",
            dict(env_id="highway-fast-v0", shield=mode, policy="random", config=CONTINUOUS),
        )
    for env_id in ("intersection-v0", "roundabout-v0"):
        for conduct in CONDUCTS[1:]:
            for mode in ("override", "monitor"):
                yield f"fast {env_id} {mode} {conduct}", dict(env_id=env_id, shield=mode, policy="fast", **conduct)
    stock = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0", "u-turn-v0", "roundabout-v0", "intersection-v0")
    for env_id in (*stock, "intersection-v1", "signalised-intersection-v0", "intersection-multi-agent-v0"):
        for mode in ("override", "monitor"):
            for policy in ("random", "fast"):
                yield (
                    f"highway-env {env_id} {mode} {policy}",
                    dict(env_id=env_id, shield=mode, policy=policy, backend="highway-env"),
                )
    yield (
        "highway-env intersection-v0 compliant",
        dict(env_id="intersection-v0", shield="override", policy="fast", backend="highway-env", traffic="compliant"),
    )


def play(env_id: str, policy: str, backend: str = "fast", **options: Any) -> str:
    """Hash of what happens in one case."""
    digest = hashlib.sha256()
    if backend == "fast":
        envs: Any = make_vec(env_id, 32, backend="fast", **options)
        envs.action_space.seed(1)
        _take_in(digest, envs.reset(seed=1000))
        for _ in range(60):
            _take_in(digest, envs.step(_actions(envs, policy)))
        envs.close()
        return digest.hexdigest()[:16]
    env = make(env_id, **options)
    for seed in (1000, 1001):
        observation, info = env.reset(seed=seed)
        for drawn in ("action", "rewards"):  # highway-env draws an action for the first info, without a seed
            info.pop(drawn, None)
        _take_in(digest, (observation, info))
        env.action_space.seed(seed)
        ended, steps = False, 0
        while not ended and steps < 40:
            outcome = env.step(_action(env, policy))
            _take_in(digest, outcome)
            ended, steps = bool(outcome[2] or outcome[3]), steps + 1
    env.close()
    return digest.hexdigest()[:16]


def _action(env: Any, policy: str) -> Any:
    if policy == "random" or not hasattr(env.unwrapped.action_type, "actions_indexes"):
        return env.action_space.sample()
    return env.unwrapped.action_type.actions_indexes["FASTER"]


def _actions(envs: Any, policy: str) -> Any:
    if policy == "random":
        return envs.action_space.sample()
    return np.full(envs.num_envs, envs.single_action_space.n - 2 if envs.single_action_space.n == 5 else 2)


LEFT_OUT: set[str] = set()  # keys of infos that only one side of a comparison has


def _take_in(digest: Any, value: Any) -> None:
    """Every number in a nest of tuples and dictionaries, in a fixed order."""
    if isinstance(value, dict):
        for key in sorted(value):
            if key.removeprefix("_") in LEFT_OUT:
                continue
            digest.update(key.encode())
            if key != "t":  # of gymnasium's episode statistics: seconds on the clock
                _take_in(digest, value[key])
    elif isinstance(value, (tuple, list)):
        for part in value:
            _take_in(digest, part)
    elif isinstance(value, np.ndarray) and value.dtype != object:
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, np.ndarray):
        _take_in(digest, value.tolist())
    else:
        digest.update(repr(value.item() if isinstance(value, np.generic) else value).encode())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, help="file for the hashes")
    parser.add_argument("--compare", type=Path, help="file of earlier hashes")
    parser.add_argument("--only", default="", help="part of the names of the cases to play")
    parser.add_argument("--without", nargs="*", default=[], help="keys of infos that are left out, e.g. new ones")
    arguments = parser.parse_args()
    LEFT_OUT.update(arguments.without)
    warnings.filterwarnings("ignore")
    hashes = {}
    for name, case in cases():
        if arguments.only in name:
            hashes[name] = play(**case)
            print(hashes[name], name, flush=True)
    if arguments.write:
        arguments.write.write_text(json.dumps(hashes, indent=1))
    if arguments.compare:
        before = json.loads(arguments.compare.read_text())
        differ = [name for name, value in hashes.items() if before.get(name) != value]
        print(f"{len(hashes) - len(differ)} of {len(hashes)} cases are as before")
        print(*(f"  differs: {name}" for name in differ), sep="\n")
        sys.exit(bool(differ))


if __name__ == "__main__":
    main()
