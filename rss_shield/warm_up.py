"""`rss-shield warm-up`: compile the engine now, so that the first run need not wait.

In a Dockerfile, or once per kind of processor of a cluster with a shared `NUMBA_CACHE_DIR`.
"""

import argparse
import os

from rss_shield.envs.arguments import whole
from rss_shield.envs.fast.tasks import SCENARIOS
from rss_shield.envs.fast.warm_up import KINDS, compile_kernels


def run(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="rss-shield warm-up", description=__doc__.split("\n")[0])
    parser.add_argument("envs", nargs="*", default=list(KINDS), help="environments; without, one of each kind of road")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at a time")
    given = parser.parse_args(arguments)
    for env_id in given.envs:
        if env_id not in SCENARIOS:
            parser.error(f"{env_id!r}: expected one of {', '.join(SCENARIOS)}")
    try:
        jobs = whole("--jobs", given.jobs, 1)
    except ValueError as error:
        parser.error(str(error))
    for env_id, seconds in compile_kernels(given.envs, jobs):
        print(f"{env_id}: ready after {seconds:.0f} s", flush=True)
