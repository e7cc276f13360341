"""Compiled code takes indices as they are: none may be negative, or too large."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

PLAY = """
import sys
import numpy as np
import envs
env_id, intent = sys.argv[1:]
for mode in ("monitor", "override"):
    env = envs.make_vec(env_id, 16, shield=mode, intent=intent)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(60):
        env.step(rng.integers(env.single_action_space.n, size=16))
env.engine.batch.episodes["ego"] = -1
try:
    env.step(np.zeros(16, int))
except IndexError:
    print("noticed")
"""


@pytest.mark.parametrize(
    ("env_id", "intent"), [("highway-fast-v0", "any"), ("intersection-v0", "known"), ("roundabout-v0", "any")]
)
def test_the_engine_stays_inside_its_arrays(env_id, intent, tmp_path):
    """Here numba checks every access, negative indices included."""
    environment = os.environ | {
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": str(Path(__file__).parent.parent),
    }
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PLAY, env_id, intent],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == ["noticed"], done.stderr


def test_functions_of_others_count_negative_indices_from_the_end():
    assert numba.njit(lambda array: array[-1])(np.arange(3.0)) == 2.0
