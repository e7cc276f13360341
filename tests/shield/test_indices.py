"""Compiled code takes indices as they are: none may be negative, or too large."""

import os
import subprocess
import sys
from types import FunctionType

import numba
import numpy as np
import pytest
from places import ROOT

from rss_shield.shield._numba.compiled import compiled, inner

PLAY = """
import sys
import numpy as np
import rss_shield
for env_id, intent in (("highway-fast-v0", "any"), ("intersection-v0", "known"), ("roundabout-v0", "any")):
    for mode in ("monitor", "override"):
        env = rss_shield.make_vec(env_id, 16, shield=mode, intent=intent)
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        for _ in range(60):
            env.action_masks()
            env.step(rng.integers(env.single_action_space.n, size=16))
    env.engine.batch.episodes["ego"] = -1
    try:
        env.step(np.zeros(16, int))
    except IndexError:
        print("noticed", env_id)
"""


def test_the_engine_stays_inside_its_arrays(tmp_path):
    """Here numba checks every access, negative indices included; one process, so that roads share what is compiled."""
    environment = os.environ | {
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PLAY],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    noticed = [f"noticed {env_id}" for env_id in ("highway-fast-v0", "intersection-v0", "roundabout-v0")]
    assert done.stdout.splitlines() == noticed, done.stderr


# ---------------------------------------------------------------- functions of others


def _last(array):
    return array[-1]


def _corner(array):
    return array[-2:][-1] if array.ndim == 1 else array[-1, -2:][-1]


def _mark(array):
    array[-1] = 7.0
    return array[len(array) - 1]


def _of(module, function):
    """A function as if it had been written in another module."""
    twin = FunctionType(function.__code__, {"__name__": module, "len": len}, function.__name__)
    assert twin.__module__ == module
    return twin


@pytest.mark.parametrize(
    "module",
    [
        "envs",
        "rss_shield.envs.fast.mine",
        "shield",
        "rss_shield.shield.junctions.plans",
        "shield_tools",
        "rss_shield.agents.ppo",
        "x",
    ],
)
@pytest.mark.parametrize("function", [_last, _corner, _mark])
def test_functions_of_others_count_negative_indices_from_the_end_whatever_their_package_is_called(module, function):
    theirs = numba.njit(_of(module, function))
    assert theirs(np.arange(3.0)) == function(np.arange(3.0))


def test_tuples_of_indices_count_from_the_end_in_functions_of_others():
    table = np.arange(12.0).reshape(3, 4)
    for place in [(-1, -1), (-3, 2), (1, -4)]:
        assert numba.njit(_of("envs.tables", lambda array, place: array[place]))(table, place) == table[place]


@inner
def _asks(array):
    return _last_of_theirs(array)


@compiled
def _asks_too(array):
    return _last_of_theirs(array)


_last_of_theirs = numba.njit(_of("rss_shield.shield._numba.indices", _last))


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_a_function_of_others_stays_theirs_where_ours_call_it_first(kind):
    """It counts from the end, and has machine code for Python as well."""
    array = np.arange(4).astype(kind)
    asks = numba.njit(lambda array: _asks(array)) if kind != np.int64 else _asks_too
    assert asks(array) == 3
    assert _last_of_theirs(array) == 3


PACKAGE = """
import numba

@numba.njit
def ends(array, table):
    table[-2, -1] = array[-3]
    return array[-1], table[-1, -1], table[-2][-1]
"""

USE = """
import sys
import numpy as np
import {packages}
sys.path.append({project!r})
import rss_shield
table = rss_shield.PRESETS["slides"]
assert rss_shield.d_min_same_direction(20.0, 20.0, table.ego, table.other) > 0.0
for package in ({packages},):
    print(*package.ends(np.arange(5.0), np.arange(6.0).reshape(2, 3)))
"""


def test_packages_of_users_may_be_called_as_ours_are(tmp_path):
    names = ["envs", "agents", "eval", "shielding"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(PACKAGE)
    (tmp_path / "use.py").write_text(USE.format(packages=", ".join(names), project=str(ROOT)))
    done = subprocess.run(
        [sys.executable, "use.py"],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.splitlines() == ["4.0 5.0 2.0"] * len(names), done.stderr
