"""How the engine is compiled, and when again."""

from pathlib import Path
from typing import Any

import numba

from rss_shield.envs._numpy.blas import ROUNDING
from rss_shield.shield._numba.compiled import APART, MERGED, PLAIN, also_outside, fingerprint, inner, only_inside

_njit: Any = numba.njit  # its published types lack some options

# What has one caller only becomes part of its source and is never compiled alone, which saves compile time.
unfolded = _njit(**PLAIN, inline="always")


def callable_too(function):
    """What Python calls as well, outside the loops."""
    return also_outside(function, **PLAIN, **MERGED)


def compiled(function):
    """An inner function. It becomes a part of the kernel, which alone is cached, and is nothing to Python.

    Where it is large or called from several places, it stays a function of its own there.
    """
    return only_inside(function, **PLAIN, **APART)


# An inner function merged into its callers: calls hand over tuples of arrays field by field, which may cost more
# than the work.
merged = inner


def kernel(function):
    """Compile an entry point that releases the interpreter lock, with a cache on disk.

    As in `shield._numba.compiled`, any change in what the kernel may be made of compiles it anew, and so does another
    way of numpy's to round: numba's cache knows the processor, but not what numpy makes of it.
    """
    return also_outside(function, f"{fingerprint(*sources())} {ROUNDING}", nogil=True, **PLAIN, **APART)


def sources() -> list[Path]:
    """Files that the kernel may be made of, beside those of `shield/`."""
    return sorted(Path(__file__).resolve().parent.rglob("*.py"))
