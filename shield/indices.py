"""Indices of compiled functions are taken as they are.

numba, like Python, counts a negative index from the end, and asks on every access whether it is one: an eighth of the
engine's time. No compiled function of this project has negative indices. Run with `NUMBA_BOUNDSCHECK=1` (and a
`NUMBA_CACHE_DIR` of its own, as numba's cache does not tell the two apart) one is an IndexError; a test does so.
"""

from typing import Any

from numba.core import types
from numba.np import arrayobj

_arrays: Any = arrayobj
_OURS = "_ZN6shield", "_ZN4envs"  # symbols of functions of these packages
_counted_from_the_end = _arrays.fix_integer_index


def _as_it_is(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
    if not builder.function.name.startswith(_OURS):
        return _counted_from_the_end(context, builder, kind, index, size)
    return context.cast(builder, index, kind, types.intp if kind.signed else types.uintp)


def take_as_they_are() -> None:
    """From now on; whatever numba compiles of other packages remains as it was."""
    _arrays.fix_integer_index = _as_it_is
