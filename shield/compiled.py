"""How the functions of this package are compiled, and when again."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba import njit


def fingerprint(*more: Path) -> str:
    """A text that changes with every source file of this package, and with the files named."""
    digest = sha256()
    for source in sorted({*Path(__file__).parent.glob("*.py"), *more}):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit` with a cache on disk that knows what a function is made of.

    Compiled functions contain the ones they call, but numba's cache looks at the time stamp of the
    function's own file alone: after an edit elsewhere it would go on with the old code. A shield must
    never do that, so any change in the package compiles everything anew.
    """
    dispatcher: Any = njit(cache=True)(function)
    stamp = fingerprint(Path(function.__code__.co_filename))
    dispatcher._cache._cache_file._source_stamp = stamp
    return dispatcher
