"""What a configuration may say, key by key: names that an environment knows, and values that it can run with.

highway-env ignores what it does not know, and fails somewhere else on what it cannot run.
"""

import difflib
import inspect
import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from numbers import Integral, Real
from typing import Any

import numpy as np
from highway_env.envs.common import action, observation
from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.utils import class_from_path
from highway_env.vehicle.controller import ControlledVehicle

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

EVERYWHERE = ("duration", "controlled_vehicles")  # see `envs.stock.Upkeep`
# the least whole number of what is counted; whatever else ends in _count may be 0
LEAST = {
    **dict.fromkeys(("lanes_count", "controlled_vehicles", "roundabout_lanes", "actions_per_axis"), 1),
    **dict.fromkeys(("other_vehicles", "pedestrians"), 0),
}
# roads are built by these, and episodes end by the first
POSITIVE = ("duration", "vehicles_density", "roundabout_radius")
POSITIVE_ENDINGS = ("_frequency", "_merge_length")
DRAWN = ("destination",)  # at random where it is None
SHARES = ("spawn_probability", "unreasonable")


def refuse(message: str) -> None:
    """What an experiment would ignore must not be in it."""
    raise ValueError(message)


def warn(message: str) -> None:
    """Somebody's own code may read it."""
    warnings.warn(f"{message}, and it is ignored here", UserWarning, stacklevel=2)


def check_known(
    env_id: str, kind: type, config: Any, reward_names: Callable[[], set[str]], unknown: Callable[[str], None] = refuse
) -> None:
    """Refuse what an environment would ignore, and values that it cannot run with.

    Args:
      env_id: as it is called in messages.
      kind: class of the environment.
      config: what replaces its defaults, as for `gymnasium.make`.
      reward_names: tells the parts of its reward. Asked only if there is a key without a default.
      unknown: what becomes of a key that highway-env would ignore.

    Raises:
      ValueError: names the key and the nearest known one, or key, value and what is expected.
    """
    if not isinstance(config, Mapping):
        raise ValueError(f"config = {config!r}: expected keys with values")
    defaults: dict[str, Any] = {**dict.fromkeys(EVERYWHERE, 1), **kind.default_config()}  # type: ignore[attr-defined]
    if issubclass(kind, RoundaboutEnv):
        defaults.setdefault("destination", None)
    for key, value in config.items():
        name = f"config.{key}"
        if key not in defaults:
            known = {*defaults, *reward_names()}
            if key not in known:
                unknown(f"{name} is not known to {env_id}; the nearest is config.{_nearest(key, known)}")
            else:
                _check_value(name, value, 0.0)
        elif key in TYPES:
            _check_typed(name, value, defaults[key], key, unknown)
        else:
            _check_value(name, value, defaults[key])
            if isinstance(value, Mapping):
                _check_names(name, value, defaults[key], unknown)
    _check_scene(kind, {**defaults, **config})


def _check_scene(kind: type, config: Mapping[str, Any]) -> None:
    """What depends on the road, or on another key."""
    lanes, lane = config.get("lanes_count", 1), config.get("initial_lane_id")
    if issubclass(kind, ExitEnv) and lanes < 2:
        raise ValueError(f"config.lanes_count = {lanes!r}: expected >= 2, because traffic leaves the last lane free")
    if lane is not None and not (_is_whole(lane) and -lanes <= lane < lanes):
        expected = f"None or a whole number from {-lanes} to {lanes - 1}, below 0 from the last lane on"
        raise ValueError(f"config.initial_lane_id = {lane!r}: expected {expected}")
    goal = config.get("incoming_vehicle_destination")
    if goal is not None and not (_is_whole(goal) and 0 <= goal <= 2):
        expected = "None or a whole number from 0 to 2, the exit"
        raise ValueError(f"config.incoming_vehicle_destination = {goal!r}: expected {expected}")
    if "other_vehicles_type" in config:
        _check_traffic(config["other_vehicles_type"])


def _check_traffic(path: Any) -> None:
    """Traffic is made of a class, and draws its own habits."""
    try:
        kind = class_from_path(path)
    except (AttributeError, ImportError, TypeError, ValueError):
        kind = None
    if not (isinstance(kind, type) and issubclass(kind, ControlledVehicle) and hasattr(kind, "randomize_behavior")):
        raise ValueError(
            f"config.other_vehicles_type = {path!r}: expected the path of a class that drives by itself, such as "
            "'highway_env.vehicle.behavior.IDMVehicle', or one derived from it"
        )


def _check_typed(name: str, config: Any, default: Any, what: str, unknown: Callable[[str], None]) -> None:
    """An observation or an action: "type" says which, the rest are its parameters."""
    if not isinstance(config, Mapping):
        raise ValueError(f"{name} = {config!r}: expected keys with values, such as {default!r}")
    types, kind = TYPES[what], config.get("type")
    own = kind == default["type"]  # which may be a type of the environment's own
    if not own and not (isinstance(kind, str) and kind in types):
        near = f"; the nearest is {_nearest(kind, types)}" if isinstance(kind, str) else ""
        raise ValueError(f"{name}.type = {kind!r}: expected one of {', '.join(types)}{near}")
    # a default may hold keys that its own type ignores
    known = {**(default if own else {"type": kind}), **(_parameters(types[kind]) if kind in types else {})}
    _check_names(name, config, known, unknown)
    for key, value in config.items():
        if key == f"{what}_config":  # of each agent: where there is one by default, as for that one
            _check_typed(f"{name}.{key}", value, default.get(key, default), what, unknown)
        elif key == f"{what}_configs":
            _check_value(f"{name}.{key}", value, [])
            for i, one in enumerate(value):
                _check_typed(f"{name}.{key}[{i}]", one, default, what, unknown)
        elif key in known:
            _check_value(f"{name}.{key}", value, known[key])


def _check_names(name: str, config: Mapping[str, Any], known: Iterable[str], unknown: Callable[[str], None]) -> None:
    for key in config:
        if key not in known:
            unknown(f"{name}.{key} is not known; the nearest is {name}.{_nearest(key, known)}")


def _check_value(name: str, value: Any, default: Any) -> None:
    """A value must be of the default's kind; anything goes where there is no default."""
    key = name.rpartition(".")[2]
    least = LEAST.get(key, 0 if key.endswith("_count") else None)
    if least is not None and not (_is_whole(value) and value >= least):
        raise ValueError(f"{name} = {value!r}: expected a whole number >= {least}")
    if value is None and (default is None or key in DRAWN):
        return
    if key.endswith("_range") and not _is_number(default) and not (_is_range(value) or isinstance(value, Mapping)):
        raise ValueError(f"{name} = {value!r}: expected two numbers, the smaller first")
    if key == "target_speeds" and not _is_ladder(value):
        raise ValueError(f"{name} = {value!r}: expected two speeds or more [m/s], each greater than the one before")
    if isinstance(default, bool):
        good, expected = isinstance(value, bool | np.bool_), "true or false"
    elif _is_number(default):
        good, expected = _is_number(value), "a finite number"
    elif isinstance(default, str):
        good, expected = isinstance(value, str), "a text"
    elif isinstance(default, list | tuple):
        good, expected = _is_row(value), "a list"
    elif isinstance(default, Mapping):
        good, expected = isinstance(value, Mapping), "keys with values"
    else:
        return
    if not good:
        raise ValueError(f"{name} = {value!r}: expected {expected}, such as {default!r}")
    if (key in POSITIVE or key.endswith(POSITIVE_ENDINGS)) and value <= 0:
        raise ValueError(f"{name} = {value!r}: expected a number > 0")
    if key in SHARES and not 0 <= value <= 1:
        raise ValueError(f"{name} = {value!r}: expected a number from 0 to 1")


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _is_row(value: Any) -> bool:
    return isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim > 0)


def _is_range(value: Any) -> bool:
    return _is_row(value) and len(value) == 2 and all(map(_is_number, value)) and value[0] < value[1]


def _is_ladder(value: Any) -> bool:
    """Speeds that a `DiscreteMetaAction` can climb: highway-env divides by the last one less the first."""
    numbers = _is_row(value) and len(value) > 1 and all(map(_is_number, value))
    return numbers and all(slow < fast for slow, fast in pairwise(value))


def _parameters(kind: type) -> dict[str, Any]:
    """Parameters of an observation or action with their defaults (None if there is none), its bases' included."""
    found: dict[str, Any] = {}
    for base in reversed(kind.__mro__[:-1]):
        for parameter in list(inspect.signature(base).parameters.values())[1:]:  # without env
            if parameter.kind is parameter.POSITIONAL_OR_KEYWORD:
                found[parameter.name] = None if parameter.default is parameter.empty else parameter.default
    return found


def _nearest(name: str, known: Iterable[str]) -> str:
    return difflib.get_close_matches(str(name), known, n=1, cutoff=0.0)[0]
