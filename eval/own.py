"""What users bring along: functions of their own modules, by a name `module:function`, and files of their own."""

import functools
import hashlib
import importlib
import os
import reprlib
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from rss_shield.eval.config_option import FILES


class OwnFailed(ValueError):
    """A function of a user's own raised something, or answered with what is no answer; the message is one line."""


Driver = Callable[[np.ndarray], np.ndarray]


def is_own(name: str) -> bool:
    """Does it name a function, and no file?"""
    return ":" in name and not Path(name).exists()


def function_named(name: str) -> Callable[..., Any]:
    """A function of a module, which is looked for in the folder where we are, too.

    Args:
      name: "module:function", the module with dots: "project.drivers:careful".

    Raises:
      ValueError: there is no such module or function, or the module fails when it is imported; the message says which.
    """
    module, _, function = name.partition(":")
    if not (module and function):
        raise ValueError(f"{name!r}: expected module:function")
    here = os.getcwd()
    if sys.path[0] != here:
        sys.path.insert(0, here)  # and it stays there, for what the module imports later
    try:
        found = getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        if error.name and not module.startswith(error.name):
            raise ValueError(f"{name}: {module} imports {error.name!r}, which is not there") from None
        raise ValueError(f"{name}: no module {error.name!r} in {here}, nor installed") from None
    except AttributeError:
        if module in sys.modules:
            raise ValueError(f"{name}: module {module!r} has no {function!r}") from None
        raise
    except Exception as error:
        raise ValueError(f"{name}: {module} cannot be imported: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise ValueError(f"{name}: {type(found).__name__} cannot be called; expected a function")
    return found


def blaming(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """The same function; what it raises is an `OwnFailed` that names it and the line of its file."""

    @functools.wraps(function)
    def called(*args: Any) -> Any:
        try:
            return function(*args)
        except Exception as error:
            text = error.args[0] if isinstance(error, KeyError) and error.args else error
            where = _line_of(function, error)
            raise OwnFailed(" ".join(f"{name}: {type(error).__name__}: {text}{where}".split())) from error

    return called


def _line_of(function: Callable[..., Any], error: Exception) -> str:
    """Where in the function's own file an error came up, at its deepest."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f" ({frames[-1].filename}, line {frames[-1].lineno}: {frames[-1].line})" if frames else ""


def driver_named(name: str, one_by_one: bool = False, actions: gym.Space | None = None) -> Driver:
    """A policy: observations `[B, ...]` -> actions `[B, ...]`.

    Args:
      name: as for `function_named`.
      one_by_one: the function maps one observation to one action.
      actions: what one action is taken from; None: only their number is looked at.

    Raises:
      ValueError: as `function_named`; when it drives, if it does not answer with one action for each observation.
    """
    return functools.partial(_checked, blaming(function_named(name), name), name, one_by_one, actions)


def _checked(
    function: Callable[..., Any], name: str, one_by_one: bool, space: gym.Space | None, observations: np.ndarray
) -> np.ndarray:
    """Its actions, if there is one for each observation."""
    answer = [function(observation) for observation in observations] if one_by_one else function(observations)
    try:
        actions = np.asarray(answer)
    except ValueError:  # rows of unlike length
        actions = np.asarray(None)
    alone = actions.ndim == 0 or len(actions) != len(observations)
    if alone or not _are_of(actions, space):
        hint = "; `rss-shield test --one-by-one` takes functions of one observation" * (alone and not one_by_one)
        raise OwnFailed(
            f"{name}: returned {_told(actions, answer)} for {len(observations)} observations; expected "
            f"{_one_of(space)} for each{hint}"
        )
    return actions


def _are_of(actions: np.ndarray, space: gym.Space | None) -> bool:
    """Has every one the shape and the kind of a space? Of other than numbers and rows of them nothing is said."""
    if isinstance(space, gym.spaces.Discrete):
        whole = actions.ndim == 1 and np.issubdtype(actions.dtype, np.integer)
        return bool(whole and (actions >= space.start).all() and (actions < space.start + space.n).all())
    if isinstance(space, gym.spaces.Box):
        numbers = actions.dtype.kind in "iuf" and bool(np.isfinite(actions).all())
        return numbers and actions.shape[1:] == space.shape
    return True


def _one_of(space: gym.Space | None) -> str:
    if isinstance(space, gym.spaces.Discrete):
        return f"one whole number from {space.start} to {space.start + space.n - 1}"
    if isinstance(space, gym.spaces.Box):
        return f"finite numbers of shape {space.shape}"
    return "one action"


def _told(array: np.ndarray, answer: Any) -> str:
    """What came back, in a few words: the shape and the first of it."""
    if array.ndim == 0:
        return f"{type(answer).__name__} {reprlib.repr(answer)}"
    return f"an array of shape {array.shape} and type {array.dtype}, {reprlib.repr(array[:3].tolist())}"


def digests(values: Iterable[Any]) -> dict[str, str]:
    """Of what is named among some values: functions and files -> what tells one state of their source from another.

    A module that the named one imports is not looked at.
    """
    found = {}
    for name in dict.fromkeys(value for value in values if isinstance(value, str)):
        source = _source(name)
        if source is not None:
            found[name] = digest_of(source)
    return found


def digest_of(file: Path) -> str:
    """What tells one state of a file from another."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def _source(name: str) -> Path | None:
    if name.lower().endswith(FILES):
        return Path(name) if Path(name).is_file() else None
    if not is_own(name):
        return None
    function = function_named(name)
    file = getattr(sys.modules[name.partition(":")[0]], "__file__", None) or getattr(
        getattr(function, "__code__", None), "co_filename", None
    )
    return Path(file) if file and Path(file).is_file() else None
