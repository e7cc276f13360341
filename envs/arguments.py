"""What users hand over, in whatever form: read once where it enters, or refused with its name, value and range."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from gymnasium import spaces

from rss_shield.shield.params import PRESETS, Preset, RSSParams, Rules

GIVEN = "given by the user"
_SIDES = ("ego", "other")
_TABLE = (
    f"a Preset, a pair of RSSParams (ego, other), the name of a preset ({', '.join(PRESETS)}), a dict of RSS "
    "parameters, a dict of two such dicts ('ego', 'other') or None"
)


def whole(name: str, value: Any, least: int) -> int:
    """A whole number of Python's or numpy's."""
    if not isinstance(value, Integral) or value < least:
        raise ValueError(f"{name} = {value!r}: expected a whole number >= {least}")
    return int(value)


def number(name: str, value: Any, least: float = 0.0, most: float = math.inf) -> float:
    """A finite number of Python's or numpy's."""
    exact = float(value) if isinstance(value, Real) else math.nan
    if not (math.isfinite(exact) and least <= exact <= most):
        upper = "" if most == math.inf else f" and <= {most:g}"
        raise ValueError(f"{name} = {value!r}: expected a finite number >= {least:g}{upper}")
    return exact


def seed_of(seed: Any) -> int | None:
    return None if seed is None else whole("seed", seed, 0)


def reset_options(options: Any) -> dict[str, Any]:
    """Options of a reset by name; which of them mean something is up to whoever reads them."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options = {options!r}: expected a dict such as {{'config': {{...}}}}, or None")
    return dict(options or {})


# ---------------------------------------------------------------- actions


def action_of(space: spaces.Space, action: Any, name: str = "action") -> Any:
    """An action, if one agent can do it; None, which leaves the last one in force, is one, too.

    Where actions are continuous, numbers outside the space are left to the environment, which clips them.
    """
    if isinstance(space, spaces.Discrete) and action is not None:
        one, last = np.asarray(action, object), int(space.start + space.n) - 1
        if one.size != 1 or not isinstance(one.item(), Real) or one.item() not in range(int(space.start), last + 1):
            raise ValueError(f"{name} = {action!r}: expected a whole number from {space.start} to {last}")
        return int(one.item())
    if isinstance(space, spaces.Box) and action is not None:
        try:
            numbers = np.asarray(action, float)
        except (TypeError, ValueError):
            numbers = np.zeros(0)
        if numbers.shape != space.shape or not np.isfinite(numbers).all():
            raise ValueError(f"{name} = {action!r}: expected finite numbers, shape {space.shape}")
    return action


def actions_of(space: spaces.Space, actions: Any, names: Sequence[str] | None = None) -> tuple:
    """One action for each of several agents."""
    each: Sequence[spaces.Space] = space.spaces if isinstance(space, spaces.Tuple) else ()
    several = isinstance(actions, tuple | list) or (isinstance(actions, np.ndarray) and actions.ndim > 0)
    if not several or len(actions) != len(each):
        raise ValueError(f"action = {actions!r}: expected a tuple of {len(each)} actions, one for each agent")
    names = names or [f"action[{i}]" for i in range(len(each))]
    return tuple(action_of(one, action, name) for one, action, name in zip(each, actions, names, strict=True))


# ---------------------------------------------------------------- the published table


def preset_of(params: Any, default: str, name: str = "params") -> Preset:
    """The table that somebody asks for.

    Args:
      params: None, the name of a preset, `Preset`, a pair of tables (ego, other), or a dict: of RSS parameters that
        both have, or with such dicts under "ego" and "other". What a dict leaves out is that of the default.
      default: name of the preset that None stands for.
      name: of the argument.
    """
    if params is None:
        return PRESETS[default]
    if isinstance(params, str):
        if params not in PRESETS:
            raise ValueError(f"{name} = {params!r}: expected one of {', '.join(PRESETS)}")
        return PRESETS[params]
    base = PRESETS[default]
    if isinstance(params, Preset):
        ego, other = _side(params.ego, None, f"{name}.ego"), _side(params.other, None, f"{name}.other")
        return params._replace(ego=ego, other=other)
    if isinstance(params, Mapping):
        return _from_dict(params, base, name)
    if isinstance(params, tuple | list) and not isinstance(params, RSSParams) and len(params) == 2:
        ego, other = (_side(one, None, f"{name}[{i}]") for i, one in enumerate(params))
        return _named(Preset(ego, other, GIVEN))
    raise ValueError(f"{name} = {params!r}: expected {_TABLE}")


def rules_of(rules: Any, name: str = "rules") -> Rules:
    """Rules given as such, or as a dict of those that are not the default."""
    values = rules._asdict() if isinstance(rules, Rules) else dict(rules) if isinstance(rules, Mapping) else None
    if values is None:
        raise ValueError(f"{name} = {rules!r}: expected Rules or a dict of {', '.join(Rules._fields)}")
    for field, value in values.items():
        if field not in Rules._fields:
            raise ValueError(f"{name} has an unknown field {field!r}; expected {', '.join(Rules._fields)}")
        if isinstance(Rules._field_defaults[field], bool):
            if not isinstance(value, bool | np.bool_):
                raise ValueError(f"{name}.{field} = {value!r}: expected True or False")
            values[field] = bool(value)
        else:
            values[field] = number(f"{name}.{field}", value, *_REACH.get(field, ()))
    return Rules(**values)


def plain(value: Any) -> Any:
    """The same of dicts, lists and Python's own numbers, as JSON has them."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value


_REACH = {"heading_bound": (0.0, 1.0)}


def _from_dict(given: Mapping, base: Preset, name: str) -> Preset:
    known = (*_SIDES, "source", "per_frame")
    flat = [field for field in given if field in RSSParams._fields]
    strange = [field for field in given if field not in (*RSSParams._fields, *known)]
    if strange or (flat and any(side in given for side in _SIDES)):
        raise ValueError(
            f"{name} has {', '.join(map(repr, strange or given))}: expected RSS parameters "
            f"({', '.join(RSSParams._fields)}), or 'ego' and 'other' with a dict of them each"
        )
    both = {field: given[field] for field in flat}
    ego, other = (_side(given.get(side, both), getattr(base, side), f"{name}.{side}") for side in _SIDES)
    if "per_frame" in given:
        return Preset(ego, other, str(given.get("source", GIVEN)), bool(given["per_frame"]))
    # a response time that was asked for is never raised to one frame silently
    asked = ego.response_time != base.ego.response_time
    return _named(Preset(ego, other, str(given.get("source", GIVEN)), base.per_frame and not asked))


def _side(given: Any, base: RSSParams | None, name: str) -> RSSParams:
    """Checked parameters of one driver; a dict may leave out what `base` has."""
    fields = given._asdict() if isinstance(given, RSSParams) else given
    if not isinstance(fields, Mapping):
        raise ValueError(f"{name} = {given!r}: expected RSSParams or a dict of them; as params, expected {_TABLE}")
    try:
        return RSSParams.validated(**((base._asdict() if base else {}) | dict(fields)))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _named(preset: Preset) -> Preset:
    """The values of a preset are that preset, however they were given."""
    return next((known for known in PRESETS.values() if known[:2] == preset[:2]), preset)
