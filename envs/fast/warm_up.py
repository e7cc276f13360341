"""Compile the engine's kernels before anybody waits for them."""

import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence

# one of each kind of road, which is all that kernels differ in
KINDS = ("highway-fast-v0", "roundabout-v0", "intersection-v0")
_PROGRAM = """
import sys
import numpy as np
from rss_shield.envs.make_vec import make_vec
for shield in ("override", None):
    env = make_vec(sys.argv[1], 1, shield=shield)
    env.reset(seed=0)
    env.step(np.zeros(1, np.int64))
    if shield:
        env.action_masks()
"""


def compile_kernels(env_ids: Iterable[str] = KINDS, jobs: int = 1) -> Iterator[tuple[str, float]]:
    """Compile what these environments need, with a shield and without, or find it compiled; each in its own process.

    numba keeps the result on disk, beside the package or where `NUMBA_CACHE_DIR` says, for this kind of processor.

    Args:
      env_ids: of the engine.
      jobs: processes at a time.

    Yields:
      (environment, seconds it took) as each is ready.

    Raises:
      RuntimeError: one could not be compiled.
    """
    waiting, running = list(env_ids), []  # type: list[str], list[tuple[str, float, subprocess.Popen]]
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                env_id = waiting.pop(0)
                running.append((env_id, time.perf_counter(), subprocess.Popen(_command(env_id))))
            env_id, start, process = running.pop(0)
            if process.wait() != 0:
                raise RuntimeError(f"the kernel of {env_id} could not be compiled; its process says why")
            yield env_id, time.perf_counter() - start
    finally:
        for _, _, process in running:
            process.terminate()
            process.wait()


def _command(env_id: str) -> Sequence[str]:
    return [sys.executable, "-W", "ignore", "-c", _PROGRAM, env_id]
