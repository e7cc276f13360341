"""How functions are compiled."""

import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile
from places import ROOT

import rss_shield
import rss_shield.shield
from rss_shield.envs._numpy.floats import norm
from rss_shield.envs.compiled import sources
from rss_shield.envs.fast.engine import run
from rss_shield.shield._numba.compiled import cached_for, compiled, compiling_quickly, inner, larger, smaller
from rss_shield.shield.junctions.plans import step


@inner
def _twice(x):
    return 2.0 * x


@pytest.mark.parametrize("function", [_twice, step, norm])
def test_functions_for_compiled_callers_say_so(function):
    with pytest.raises(TypeError, match=f"{function.py_func.__name__} can only be called from compiled code"):
        function(1.0)


@compiled
def _outside(x):
    return 5.0 * x


@inner
def _through(x):
    return _twice(_outside(x))


@pytest.mark.parametrize("first", ["from Python", "from an inner function"])
def test_python_calls_what_inner_functions_call_too(first):
    """In compiled code a function is intermediate code; called from Python it has machine code all the same."""
    number = {"from Python": 3, "from an inner function": 3.0}[first]  # a type each, so that both are first calls
    if first == "from Python":
        assert _outside(number) == 15.0
    assert numba.njit(lambda x: _through(x))(number) == 30.0
    assert _outside(number) == 15.0


def _parts(dispatcher, found):
    """All compiled functions that one is made of."""
    if dispatcher not in found:
        found.add(dispatcher)
        function = dispatcher.py_func
        for name in function.__code__.co_names:
            part = function.__globals__.get(name)
            if hasattr(part, "py_func"):
                _parts(part, found)
    return found


def test_every_function_says_whether_it_is_merged_into_its_callers():
    """numba would else give it what its first compiled caller has, and what is large would be merged too."""
    for function in _parts(run, set()):
        options = function.targetoptions
        assert "forceinline" in options or options.get("inline") == "always", function


def test_a_change_in_any_file_that_the_kernel_is_made_of_compiles_it_anew():
    files = {Path(function.py_func.__code__.co_filename).resolve() for function in _parts(run, set())}
    assert {file.name for file in files} >= {"engine.py", "guard.py", "ways.py", "plans.py"}
    assert files <= {*sources(), *Path(rss_shield.shield.__file__).resolve().parent.rglob("*.py")}


STAMPS = """
from rss_shield.envs.compiled import sources
from rss_shield.envs.roads.network import position
from rss_shield.shield._numba.compiled import fingerprint
from rss_shield.shield.junctions.plans import throttle
from rss_shield.shield.lanes.pair import assess
parts = (function._cache._cache_file._source_stamp for function in (assess, throttle, position))
print(fingerprint(*sources()), *parts)
"""


def test_an_edit_at_any_depth_is_noticed(tmp_path):
    """Once in the checkout, whose package holds links, and once installed, where it holds the folders."""
    for name, linked in (("checkout", True), ("installed", False)):
        copy = tmp_path / name
        ignored = shutil.ignore_patterns("__pycache__", "train.py")
        for folder in ("shield", "envs", "rss_shield"):
            if linked or folder == "rss_shield":
                shutil.copytree(ROOT / folder, copy / folder, symlinks=linked, ignore=ignored)
        assert (copy / "rss_shield" / "shield").is_symlink() == linked
        stamps = [_stamps(copy)]
        for edited in ("shield/definitions/kinematics.py", "shield/junctions/plans.py", "shield/_numba/indices.py"):
            with open(copy / "rss_shield" / edited, "a") as file:
                file.write("# edited\n")
            stamps.append(_stamps(copy))
        for before, after in pairwise(stamps):
            assert all(one != other for one, other in zip(before, after, strict=True))


def _stamps(folder):
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", STAMPS], env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


class _Vanished:
    """A type that the sources of before had, in a cache that they left behind."""

    def __reduce__(self):
        return getattr, (numba, "vanished")


def test_what_other_sources_left_in_the_cache_is_not_read(tmp_path):
    def index(sources):
        file = IndexDataCacheFile(str(tmp_path), "run", None)
        return cached_for(SimpleNamespace(_cache=SimpleNamespace(_cache_file=file)), sources)._cache._cache_file

    index("before").save(_Vanished(), b"")
    with pytest.raises(AttributeError, match="vanished"):
        index("before").load(0)
    assert index("now").load(0) is None


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0", "roundabout-v0"])
def test_one_kernel_runs_whether_the_shield_acts_or_watches_and_another_without(env_id):
    shielded, watched, bare = (
        rss_shield.make_vec(env_id, 2, shield=mode).engine for mode in ("override", "monitor", None)
    )
    for part in ("world", "batch", "film", "settings"):
        assert numba.typeof(getattr(shielded, part)) == numba.typeof(getattr(watched, part)), part
    # nothing of a shield is compiled where there is none: its memory is absent
    assert bare.batch.past is bare.batch.crossings is bare.batch.rides is bare.world.frames is bare.world.ways is None


def test_the_smaller_and_the_larger_are_those_of_numpy():
    compiled = numba.njit(lambda a, b: (smaller(a, b), larger(a, b)))
    values = [-np.inf, -1.5, 0.0, 2, np.inf]
    for a in values:
        for b in values:
            assert compiled(a, b) == (np.minimum(a, b), np.maximum(a, b)) == (smaller(a, b), larger(a, b))
        expected = np.minimum(values, a), np.maximum(values, a)
        np.testing.assert_array_equal(compiled(np.array(values), a), expected)
        assert np.isnan(compiled(a, np.nan)).all()


def test_only_our_functions_are_compiled_quickly():
    levels = [numba.config.OPT]
    with compiling_quickly():
        levels.append(numba.config.OPT)
        assert numba.njit(lambda x: _through(x) + 1)(2.5) == 26.0
        levels.append(numba.config.OPT)
    assert levels == [numba.config.OPT] * 3


CHANGED = """
import warnings
import numba
import numba.core.typed_passes as passes
del passes.{gone}  # as if numba had another name for it; numba itself has its own reference
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    import rss_shield, rss_shield.shield.lanes.controller, rss_shield.shield.junctions.plans
for warning in said:
    print(warning.message)
table = rss_shield.PRESETS["simulator"]
print(rss_shield.d_min_same_direction(20.0, 15.0, table.ego, table.other))
print(rss_shield.d_min_lateral(1.0, -0.5, table.ego, table.other))
"""


def test_where_numba_has_changed_functions_are_compiled_in_its_own_way(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", CHANGED.format(gone="NativeLowering")],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    said, *values = done.stdout.splitlines()
    table = rss_shield.PRESETS["simulator"]
    assert "NativeLowering" in said and "numba's own way" in said, done.stderr
    assert [float(value) for value in values] == [
        rss_shield.d_min_same_direction(20.0, 15.0, table.ego, table.other),
        rss_shield.d_min_lateral(1.0, -0.5, table.ego, table.other),
    ]
