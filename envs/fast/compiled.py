"""How the engine is compiled, and when again."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba

from envs.fast.blas import ROUNDING
from shield.compiled import cached_for, fingerprint, inner
from shield.parts import APART, MERGED, PLAIN, UNWRAPPED, also_outside, only_inside

_njit: Any = numba.njit  # its published types lack some options
_config: Any = numba.config

# What has one caller only becomes part of its source and is never compiled alone, which saves compile time.
unfolded = _njit(**PLAIN, inline="always")


def callable_too(function):
    """What Python calls as well, outside the loops."""
    return also_outside(_njit(**PLAIN, **MERGED)(function))


def compiled(function):
    """An inner function. It becomes a part of the kernel, which alone is cached, and is nothing to Python.

    Where it is large or called from several places, it stays a function of its own there.
    """
    return only_inside(_njit(**PLAIN, **UNWRAPPED, **APART)(function))


# An inner function merged into its callers: calls hand over tuples of arrays field by field, which may cost more
# than the work.
merged = inner


def kernel(function):
    """Compile an entry point that releases the interpreter lock, with a cache on disk.

    As in `shield.compiled`, any change in what the kernel may be made of compiles it anew, and so does another
    way of numpy's to round: numba's cache knows the processor, but not what numpy makes of it.
    """
    dispatcher = _njit(cache=True, nogil=True, no_cfunc_wrapper=True, **PLAIN, **APART)(function)
    return also_outside(cached_for(dispatcher, f"{fingerprint(*sources())} {ROUNDING}"))


def sources() -> list[Path]:
    """Files that the kernel may be made of, beside those of `shield/`."""
    return sorted(Path(__file__).parents[1].rglob("*.py"))


@contextmanager
def compiling_quickly() -> Iterator[None]:
    """Compile at LLVM's first level of optimisation: the kernel is ready sooner and runs as fast."""
    level = _config.OPT
    _config.OPT = type(level)(1)
    try:
        yield
    finally:
        _config.OPT = level
