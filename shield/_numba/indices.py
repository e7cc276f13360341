"""Indices of compiled functions are taken as they are.

numba, like Python, counts a negative index from the end, and asks on every access whether it is one: an eighth of the
engine's time. It does not ask where an index has no sign, and so it is told here of every index into an array. No
compiled function of this project has negative indices. Run with `NUMBA_BOUNDSCHECK=1` (and a
`NUMBA_CACHE_DIR` of its own, as numba's cache does not tell the two apart) one is an IndexError; a test does so.
"""

from typing import Any

from numba import types
from numba.core.lowering import Lower

_types: Any = types
_Lower: Any = Lower


class AsTheyAre(_Lower):
    """numba's step from a function with types to LLVM. Nobody's functions take it but those compiled with it."""

    def lower_getitem(self, *what: Any) -> Any:
        *before, signature = what
        return super().lower_getitem(*before, _without_sign(signature))

    def lower_setitem(self, *what: Any) -> Any:
        *before, signature = what
        return super().lower_setitem(*before, _without_sign(signature))


def _without_sign(signature: Any) -> Any:
    """Signature of an access: what is accessed, the index, and perhaps a value."""
    array, index, *value = signature.args
    return signature.replace(args=(array, _index(index), *value)) if isinstance(array, _types.Buffer) else signature


def _index(kind: Any) -> Any:
    if isinstance(kind, _types.Integer) and kind.signed:
        return _types.uintp
    if isinstance(kind, _types.Tuple | _types.UniTuple):
        return _types.BaseTuple.from_types([_index(one) for one in kind.types])
    return kind
