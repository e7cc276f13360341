"""Distances of whatever holds numbers: lists, arrays, columns of tables."""

import functools
import inspect
from numbers import Real
from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from rss_shield.shield._numba.compiled import INTERPRETED, compiled_for_arrays
from rss_shield.shield.params import RSSParams

_TABLES = ("rear", "front", "left", "right", "correct", "wrong")  # arguments that are `RSSParams`
_SPEEDS = ("v_", "u_")  # how the names of speeds begin
_AS_IT_IS = [np.dtype(kind) for kind in ("f8", "f4", "i8", "i4")]


def compiled_for_numbers(function: Any) -> Any:
    """`compiled_for_anything` for one pair at a time."""
    return compiled_for_anything(function, arrays=False)


def compiled_for_anything(function: Any, arrays: bool = True) -> Any:
    """`compiled_for_arrays`, which Python may call with lists and columns of tables, too.

    In compiled functions nothing is different. What cannot be taken is a ValueError that names it.
    """
    dispatcher = compiled_for_arrays(function)
    usual: Any = type(dispatcher)
    run = (lambda self, *given, **named: function(*given, **named)) if INTERPRETED else usual.__call__
    names = tuple(inspect.signature(function).parameters)
    plain = tuple(RSSParams if name in _TABLES else float for name in names if name != "mode")

    def call(self: Any, *given: Any, **named: Any) -> Any:
        if not named and tuple(map(type, given)) == plain:
            return run(self, *given)
        positional = [_ready(self, name, value, arrays) for name, value in zip(names, given, strict=False)]
        by_name = {name: _ready(self, name, value, arrays) for name, value in named.items()}
        _check_shapes(self, dict(zip(names, positional, strict=False)) | by_name)
        try:
            return run(self, *positional, *given[len(names) :], **by_name)
        except NumbaError:
            kinds = ", ".join(f"{name} {type(value).__name__}" for name, value in zip(names, positional, strict=False))
            raise ValueError(f"{self.__name__}: {kinds}: expected {', '.join(names)} as documented") from None

    if INTERPRETED:
        return functools.wraps(function)(functools.partial(call, function))
    dispatcher.__class__ = type("Anything", (usual,), {"__call__": call, "__doc__": usual.__doc__})
    return dispatcher


def _ready(function: Any, name: str, value: Any, arrays: bool) -> Any:
    """An argument as numba takes it."""
    if type(value) is float or isinstance(value, RSSParams if name in _TABLES else str if name == "mode" else bool):
        return value
    if name in _TABLES or name == "mode":
        raise ValueError(_refusal(function, name, value, arrays))
    if isinstance(value, Real):
        return value.item() if isinstance(value, np.generic) else value
    try:
        numbers = np.asarray(value)
        if numbers.dtype not in _AS_IT_IS or not numbers.dtype.isnative:
            if numbers.dtype.kind not in "biufO" or any(one is None for one in numbers.flat):
                raise TypeError
            numbers = numbers.astype(float)
        if numbers.ndim and not arrays:
            raise TypeError
    except (TypeError, ValueError):
        raise ValueError(_refusal(function, name, value, arrays)) from None
    return numbers if numbers.ndim else numbers.item()


def _refusal(function: Any, name: str, value: Any, arrays: bool) -> str:
    numbers = "a number, or numbers in a list or an array" if arrays else "a number"
    expected = "RSSParams" if name in _TABLES else "a text" if name == "mode" else numbers
    text = " ".join(repr(value).split())
    return f"{function.__name__}: {name} = {text if len(text) < 80 else text[:77] + '...'}: expected {expected}"


def _check_shapes(function: Any, arguments: dict[str, Any]) -> None:
    arrays = {name: np.shape(value) for name, value in arguments.items() if name.startswith(_SPEEDS)}
    if any(arrays.values()):
        try:
            np.broadcast_shapes(*arrays.values())
        except ValueError:
            shapes = ", ".join(f"{name} {shape}" for name, shape in arrays.items())
            raise ValueError(f"{function.__name__}: shapes {shapes}: expected shapes that broadcast") from None
