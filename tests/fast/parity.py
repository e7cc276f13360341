"""Parity of the engine with highway-env at length, one row per case.

    python tests/fast/parity.py --episodes 100
    python tests/fast/parity.py --episodes 20 --envs intersection-multi-agent-v0 --shield none override monitor
    NPY_DISABLE_CPU_FEATURES=X86_V4 python tests/fast/parity.py --episodes 100

The last form takes numpy's AVX-512 functions, which differ from the C library's by one unit in the
last place, from both. Every episode is equal to the last bit with either.
"""

import argparse
import sys
import warnings

from lockstep import POLICIES, compare

BARE = (
    "highway-fast-v0",
    "merge-v0",
    "merge-v1",
    "merge-generic-v0",
    "merge-generic-v1",
    "u-turn-v0",
    "u-turn-v1",
    "two-way-v0",
    "exit-v0",
    "exit-v1",
    "roundabout-v0",
    "roundabout-v1",
    "intersection-v0",
    "intersection-v2",
    "highway-v0",
)
TOO_SLOW = ("highway-v0",)  # behind the shield on highway-env
CONTINUOUS = {"action": {"type": "ContinuousAction"}}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--episodes", type=int, default=100, help="seeds per case")
    parser.add_argument("--envs", nargs="+", default=list(BARE))
    parser.add_argument("--policies", nargs="+", default=list(POLICIES), choices=POLICIES)
    parser.add_argument("--shield", nargs="+", default=["none"], choices=["none", "override", "monitor"])
    parser.add_argument("--continuous", action="store_true", help="steering and throttle instead of meta-actions")
    parser.add_argument("--max-steps", type=int, default=1000, help="decisions of an episode")
    parser.add_argument("--strict", action="store_true", help="fail unless all episodes are equal to the last bit")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    equal = True
    for env_id in arguments.envs:
        for mode in arguments.shield:
            if mode != "none" and env_id in TOO_SLOW:
                continue
            for policy in arguments.policies:
                equal &= _row(env_id, mode, policy, arguments)
    return 1 if arguments.strict and not equal else 0


def _row(env_id: str, mode: str, policy: str, arguments) -> bool:
    """Run and print one case. Is every episode equal to the last bit?"""
    shield = None if mode == "none" else mode
    config = CONTINUOUS if arguments.continuous else None
    seeds = range(arguments.episodes)
    found = compare(env_id, seeds, policy, config=config, shield=shield, max_steps=arguments.max_steps)
    print(
        f"{env_id:16} {policy:7} shield {mode:8}: {found.episodes} episodes, {found.decisions} decisions, "
        f"{found.equal} equal to the last bit, {found.close} within 1e-8; "
        f"largest difference {found.state:.1e} (state), {found.reward:.1e} (reward)",
        flush=True,
    )
    for difference in found.discrete[:5]:
        print(f"    {difference}", flush=True)
    return found.equal == found.episodes


if __name__ == "__main__":
    sys.exit(main())
