"""Values are checked once, where they enter."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class Range(NamedTuple):
    """Accepted values: from `low`, itself left out if `strict`, to `high`."""

    low: float
    strict: bool = True
    high: float = math.inf


POSITIVE, NOT_NEGATIVE = Range(0.0), Range(0.0, strict=False)


def checked(
    kind: str, fields: Mapping[str, Any], defaults: Mapping[str, float], ranges: Mapping[str, Range]
) -> dict[str, Any]:
    """Fields as floats, each inside its range.

    Raises:
      ValueError: a field that has no default, or a value outside its range; the message names field, value and range.
    """
    values: dict[str, Any] = {}
    for name, value in fields.items():
        if name not in defaults:
            raise ValueError(f"unknown {kind} {name!r}; expected one of {', '.join(defaults)}")
        values[name] = in_range(name, value, ranges[name])
    return values


def in_range(name: str, value: Any, accepted: Range) -> float:
    """A value as a float.

    Raises:
      ValueError: it is not a finite number in the range accepted.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r} is not a number") from None
    low, strict, high = accepted
    if not math.isfinite(number) or number < low or (strict and number == low) or number > high:
        text = f"{'>' if strict else '>='} {low:g}" + (f" and <= {high:g}" if high < math.inf else "")
        raise ValueError(f"{name} = {value!r} is out of range: expected a finite number {text}")
    return number


def one_of(name: str, value: Any, known: tuple[str, ...]) -> str:
    """A name that is known.

    Raises:
      ValueError: it is not.
    """
    if value not in known:
        raise ValueError(f"{name} = {value!r}: expected one of {', '.join(known)}")
    return str(value)


def index_of(name: str, value: Any, known: tuple[str, ...]) -> int:
    """Index of a name that is known; an index is kept.

    Raises:
      ValueError: neither.
    """
    if isinstance(value, int) and 0 <= value < len(known):
        return value
    return known.index(one_of(name, value, known))
