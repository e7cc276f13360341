"""Which configuration an environment of highway-env knows, and a check that a given one is of that kind.

highway-env ignores what it does not know. A misspelt option of an experiment must not be ignored.
"""

import difflib
import inspect
import math
from collections.abc import Iterable, Mapping
from typing import Any

import gymnasium as gym
from highway_env.envs.common import action, observation

from rss_shield.envs.stock import make_stock
from rss_shield.envs.worlds.signalised import KinematicsWithSignal

TYPES: dict[str, dict[str, type]] = {
    "observation": {
        "TimeToCollision": observation.TimeToCollisionObservation,
        "Kinematics": observation.KinematicObservation,
        "KinematicsWithSignal": KinematicsWithSignal,
        "OccupancyGrid": observation.OccupancyGridObservation,
        "KinematicsGoal": observation.KinematicsGoalObservation,
        "GrayscaleObservation": observation.GrayscaleObservation,
        "AttributesObservation": observation.AttributesObservation,
        "MultiAgentObservation": observation.MultiAgentObservation,
        "TupleObservation": observation.TupleObservation,
        "LidarObservation": observation.LidarObservation,
        "ExitObservation": observation.ExitObservation,
    },
    "action": {
        "ContinuousAction": action.ContinuousAction,
        "DiscreteAction": action.DiscreteAction,
        "DiscreteMetaAction": action.DiscreteMetaAction,
        "MultiAgentAction": action.MultiAgentAction,
    },
}

POSITIVE = ("config.vehicles_density", "config.duration")  # the road is built by the one, and ends by the other


def default_config(env_id: str) -> dict[str, Any]:
    """The configuration of an environment that is not told otherwise.

    Raises:
      ValueError: unknown environment, or one that has no configuration.
    """
    try:
        env = make_stock(env_id)
    except gym.error.Error as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    env.close()
    config = getattr(env.unwrapped, "config", None)
    if not isinstance(config, dict):
        raise ValueError(f"env_id = {env_id!r}: expected an environment of highway-env; this one has no configuration")
    return config


def check_config(env_id: str, config: Mapping[str, Any]) -> None:
    """Refuse what the environment would ignore, and values of another kind than its own.

    Args:
      config: what replaces the environment's defaults, as for `gymnasium.make`.

    Raises:
      ValueError: names the key and the nearest known one, or key, value and what is expected.
    """
    defaults = default_config(env_id)
    for key, value in config.items():
        name = f"config.{key}"
        if key not in defaults:
            known = {*defaults, "duration", *_reward_names(env_id)}
            if key not in known:
                raise ValueError(f"{name} is not known to {env_id}; the nearest is config.{_nearest(key, known)}")
            _check_value(name, value, 0.0)
        elif key in TYPES:
            _check_typed(name, value, defaults[key], TYPES[key])
        else:
            _check_value(name, value, defaults[key])
            if isinstance(value, Mapping):
                _check_names(name, value, defaults[key])


def _check_typed(name: str, config: Any, default: Mapping[str, Any], types: Mapping[str, type]) -> None:
    """An observation or an action: "type" says which, the rest are its parameters."""
    _check_value(name, config, default)
    kind = config.get("type")
    if kind not in types:
        near = f"; the nearest is {_nearest(kind, types)}" if isinstance(kind, str) else ""
        raise ValueError(f"{name}.type = {kind!r}: expected one of {', '.join(types)}{near}")
    # a default may hold keys that its own type ignores
    known = {**(default if kind == default["type"] else {"type": kind}), **_parameters(types[kind])}
    _check_names(name, config, known)
    for key, value in config.items():
        _check_value(f"{name}.{key}", value, known[key])


def _check_names(name: str, config: Mapping[str, Any], known: Iterable[str]) -> None:
    for key in config:
        if key not in known:
            raise ValueError(f"{name}.{key} is not known; the nearest is {name}.{_nearest(key, known)}")


def _check_value(name: str, value: Any, default: Any) -> None:
    """A value must be of the default's kind; anything goes where there is no default."""
    least = int(name.endswith("lanes_count"))
    if name.endswith("_count") and not (_is_number(value) and value == int(value) and value >= least):
        raise ValueError(f"{name} = {value!r}: expected a whole number >= {least}")
    if value is None and default is None:
        return
    if name.endswith("_range") and not (_is_range(value) or isinstance(value, Mapping)):
        raise ValueError(f"{name} = {value!r}: expected two numbers, the smaller first")
    if isinstance(default, bool):
        good, expected = isinstance(value, bool), "true or false"
    elif _is_number(default):
        good, expected = _is_number(value), "a finite number"
    elif isinstance(default, str):
        good, expected = isinstance(value, str), "a text"
    elif isinstance(default, list | tuple):
        good, expected = isinstance(value, list | tuple), "a list"
    elif isinstance(default, Mapping):
        good, expected = isinstance(value, Mapping), "keys with values"
    else:
        return
    if not good:
        raise ValueError(f"{name} = {value!r}: expected {expected}, such as {default!r}")
    if name in POSITIVE and value <= 0:
        raise ValueError(f"{name} = {value!r}: expected a number > 0")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_range(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) == 2 and all(map(_is_number, value)) and value[0] < value[1]


def _parameters(kind: type) -> dict[str, Any]:
    """Parameters of an observation or action with their defaults (None if there is none), its bases' included."""
    found: dict[str, Any] = {}
    for base in reversed(kind.__mro__[:-1]):
        for parameter in list(inspect.signature(base).parameters.values())[1:]:  # without env
            if parameter.kind is parameter.POSITIONAL_OR_KEYWORD:
                found[parameter.name] = None if parameter.default is parameter.empty else parameter.default
    return found


def _reward_names(env_id: str) -> set[str]:
    """Parts of the reward: their weights can be configured where the default is nothing."""
    env = make_stock(env_id)
    env.reset(seed=0)
    info = env.step(env.action_space.sample())[4]
    env.close()
    return set(info.get("rewards", ()))


def _nearest(name: str, known: Iterable[str]) -> str:
    return difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]
