"""How the functions of this package are compiled, and when again.

| decorator | Python may call it | in compiled callers | for |
| --- | --- | --- | --- |
| `compiled` | yes | merged | most functions: numbers, records and views of arrays |
| `compiled_for_arrays` | yes | merged | what takes whole arrays, or makes them |
| `apart` | yes | a function of its own | what is large and rarely called |
| `inner` | no | merged | small parts of others |
| `part` | no | a function of its own | large parts, and what has several callers |
| `rare` | no | a function of its own, out of the way | what is seldom called |

The engine has two more of its own in `envs.compiled`.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import overload

# with NUMBA_DISABLE_JIT=1 nothing is compiled: for debuggers, and for tests of altered sources
INTERPRETED = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
_njit: Any = numba.njit  # its published types lack some options
_parts: Any
try:
    from rss_shield.shield._numba import parts as _parts
except ImportError as error:
    _parts = None
    warnings.warn(f"{error}: functions are compiled in numba's own way, slower and for the same results", stacklevel=2)

# Options of numba. What allocates nothing needs no reference counts, which would cost more than the work itself.
PLAIN: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
# said of every function: numba would else give it what its first compiled caller has
MERGED: dict[str, Any] = {"forceinline": True}
APART: dict[str, Any] = {"forceinline": False}


def fingerprint(*more: Path) -> str:
    """A text that changes with every source file of `shield`, at any depth, and with the files named."""
    digest = sha256()
    for source in sorted({*Path(__file__).resolve().parents[1].rglob("*.py"), *more}):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def inner(function: Callable[..., Any]) -> Any:
    """`compiled` for what is called from compiled functions only."""
    return only_inside(function, **PLAIN, **MERGED)


def part(function: Callable[..., Any]) -> Any:
    """`inner`, but a function of its own in its callers."""
    return only_inside(function, **PLAIN, **APART)


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit` for what handles numbers, records and views of arrays but allocates nothing.

    numba need not count references to the arrays then, which would cost more than the work itself.

    The cache on disk knows what a function is made of: compiled functions contain the ones they
    call, but numba looks at the time stamp of the function's own file alone, and after an edit
    elsewhere it would go on with the old code. A shield must never do that, so any change in the
    package, or in that of the function, compiles everything anew.
    """
    return also_outside(function, _stamp_of(function), **PLAIN, **MERGED)


def apart(function: Callable[..., Any]) -> Any:
    """`compiled`, but a function of its own in compiled callers too; `compiled` ones are merged into them.

    For what is large and rarely called: one huge function takes far longer to translate than several.
    """
    return also_outside(function, _stamp_of(function), **PLAIN, **APART)


def rare(function: Callable[..., Any]) -> Any:
    """`inner`, but a function of its own in its callers: for what is seldom called.

    It does not even lie between what is often executed, so that more of that fits into the processor's cache.
    """
    return only_inside(function, rare=True, **PLAIN, **APART)


def compiled_for_arrays(function: Callable[..., Any]) -> Any:
    """`compiled` for what also takes whole arrays, or makes them."""
    return also_outside(function, _stamp_of(function), error_model="numpy", **MERGED)


def only_inside(function: Callable[..., Any], rare: bool = False, **options: Any) -> Any:
    """Compile what is called from compiled functions only: it becomes a part of them."""
    if INTERPRETED:
        return function
    return _njit(**options)(function) if _parts is None else _parts.only_inside(function, rare, **options)


def also_outside(function: Callable[..., Any], sources: str = "", **options: Any) -> Any:
    """Compile what Python calls, and compiled functions perhaps.

    Args:
      function: Python's.
      sources: a text that stands for all that it is made of, to keep it on disk for later runs; "" = it is not kept.
      options: of numba.
    """
    if INTERPRETED:
        return function
    make = _njit if _parts is None else _parts.also_outside
    if not sources:
        return make(function, **options)
    return cached_for(make(function, cache=True, **options), sources)


@contextmanager
def compiling_quickly() -> Iterator[None]:
    """Compile at LLVM's first level of optimisation: large functions are ready sooner and run as fast."""
    with _parts.quickly() if _parts else nullcontext():
        yield


def cached_for(dispatcher: Any, sources: str) -> Any:
    """Let what is cached on disk of a function count only for the sources that a `fingerprint` stands for."""
    index = dispatcher._cache._cache_file
    index._source_stamp = sources
    # compared before anything else is read, which may name types that are no more
    index._version = f"{numba.__version__} {sources}"
    return dispatcher


def _stamp_of(function: Callable[..., Any]) -> str:
    return _stamp(package_root(Path(function.__code__.co_filename)))


def package_root(file: Path) -> Path:
    """Outermost package that a file is in; links are followed first, because `rglob` does not go through them."""
    folder = file.resolve().parent
    while (folder.parent / "__init__.py").exists():
        folder = folder.parent
    return folder


@cache
def _stamp(folder: Path) -> str:
    return fingerprint(*folder.rglob("*.py"))


def records(fields: list[Any]) -> np.dtype:
    """A type of record whose fields functions read and write as attributes, compiled or not."""
    plain = np.dtype(fields, align=True)
    return np.dtype((np.record, plain)) if INTERPRETED else plain


def choose(condition: Any, this: Any, that: Any) -> Any:
    """`np.where`, which for floats would put each of its arguments into an array in compiled code."""
    return np.where(condition, this, that)


def smaller(a: Any, b: Any) -> Any:
    """`np.minimum`, which for floats would look for nan in compiled code; one in `b` is kept all the same."""
    return np.minimum(a, b)


def larger(a: Any, b: Any) -> Any:
    """`np.maximum` likewise."""
    return np.maximum(a, b)


def _are_numbers(*arguments: Any) -> bool:
    return all(isinstance(argument, types.Number | types.Omitted) for argument in arguments)


@overload(smaller)
def _smaller(a, b):
    if _are_numbers(a, b):
        return lambda a, b: a if a < b else b
    return lambda a, b: np.minimum(a, b)


@overload(larger)
def _larger(a, b):
    if _are_numbers(a, b):
        return lambda a, b: a if a > b else b
    return lambda a, b: np.maximum(a, b)


@overload(choose)
def _choose(condition, this, that):
    if isinstance(condition, types.Boolean):
        return lambda condition, this, that: this if condition else that
    return lambda condition, this, that: np.where(condition, this, that)
