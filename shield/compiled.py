"""How the functions of this package are compiled, and when again."""

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import overload

from shield.parts import also_outside, only_inside

_njit: Any = numba.njit  # its published types lack some options
UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def fingerprint(*more: Path) -> str:
    """A text that changes with every source file of this package, and with the files named."""
    digest = sha256()
    for source in sorted({*Path(__file__).parent.glob("*.py"), *more}):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def inner(function: Callable[..., Any], **options: Any) -> Any:
    """`compiled` for what is called from compiled functions only; it becomes a part of each."""
    return only_inside(_njit(error_model="numpy", _nrt=False, **UNWRAPPED, **options)(function))


def inner_merged(function: Callable[..., Any]) -> Any:
    """`inner`, and merged into its callers: handing over tables by value would cost more than the work."""
    return inner(function, forceinline=True)


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit` for what handles numbers, records and views of arrays but allocates nothing.

    numba need not count references to the arrays then, which would cost more than the work itself.

    The cache on disk knows what a function is made of: compiled functions contain the ones they
    call, but numba looks at the time stamp of the function's own file alone, and after an edit
    elsewhere it would go on with the old code. A shield must never do that, so any change in the
    package, or in that of the function, compiles everything anew.
    """
    return _stamped(_njit(cache=True, error_model="numpy", _nrt=False, no_cfunc_wrapper=True)(function))


def merged(function: Callable[..., Any]) -> Any:
    """`compiled`, and merged into compiled callers."""
    return _stamped(
        _njit(cache=True, error_model="numpy", _nrt=False, no_cfunc_wrapper=True, forceinline=True)(function)
    )


def compiled_for_arrays(function: Callable[..., Any]) -> Any:
    """`compiled` for what also takes whole arrays, or makes them."""
    return _stamped(_njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function))


def _stamped(dispatcher: Any) -> Any:
    return also_outside(cached_for(dispatcher, _stamp(Path(dispatcher.py_func.__code__.co_filename).parent)))


def cached_for(dispatcher: Any, sources: str) -> Any:
    """Let what is cached on disk of a function count only for the sources that a `fingerprint` stands for."""
    index = dispatcher._cache._cache_file
    index._source_stamp = sources
    # compared before anything else is read, which may name types that are no more
    index._version = f"{numba.__version__} {sources}"
    return dispatcher


@cache
def _stamp(folder: Path) -> str:
    return fingerprint(*folder.rglob("*.py"))


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
