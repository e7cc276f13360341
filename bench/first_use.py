"""Seconds from a fresh process to the first step of the engine, with nothing compiled, and again with what is kept.

    python bench/first_use.py                     a motorway and an intersection
    python bench/first_use.py --envs merge-v0

Each environment is built and stepped in a process of its own, first with an empty cache and then with what the first
has left there. Processor time is what counts on a machine that others use, too.
"""

import dataclasses
import os
import subprocess
import sys
import tempfile

import tyro

_PROGRAM = """
import resource, sys, time
wall = time.perf_counter()
import rss_shield
env = rss_shield.make_vec(sys.argv[1], 64, shield=None if sys.argv[2] == "None" else sys.argv[2])
built = time.perf_counter() - wall
env.reset(seed=0)
env.step(env.action_space.sample())
used = resource.getrusage(resource.RUSAGE_SELF)
memory = used.ru_maxrss / 1024
print(f"{time.perf_counter() - wall:.1f} s by the clock ({built:.1f} s until the environments are built), "
      f"{used.ru_utime + used.ru_stime:.1f} s of a processor, {memory:.0f} MiB")
"""


@dataclasses.dataclass(frozen=True)
class Config:
    """Measure the first start."""

    envs: tuple[str, ...] = ("highway-fast-v0", "intersection-v0")  # which environments
    shield: str = "override"  # or "monitor", or "None"


def first_step(env_id: str, shield: str, cache: str) -> str:
    """What a fresh process says that finds this cache."""
    command = [sys.executable, "-W", "ignore", "-c", _PROGRAM, env_id, shield]
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    return subprocess.run(command, env=environment, check=True, text=True, stdout=subprocess.PIPE).stdout.strip()


def main(config: Config) -> None:
    for env_id in config.envs:
        with tempfile.TemporaryDirectory() as cache:
            for when in ("nothing compiled", "compiled before"):
                print(f"{env_id}, {when}: {first_step(env_id, config.shield, cache)}", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Config, description=__doc__))
