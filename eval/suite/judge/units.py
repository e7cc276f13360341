"""Units that columns of a log may be in, and what they measure."""

from collections.abc import Mapping

import numpy as np

_FOOT = 0.3048  # [m]
UNITS: Mapping[str, Mapping[str, float]] = {  # by what they measure: how much of the SI unit each is
    "length": {"m": 1.0, "ft": _FOOT, "km": 1000.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "frame": 1.0},  # frames: of `Format.frame_rate`
    "angle": {"rad": 1.0, "deg": np.pi / 180.0},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 1609.344 / 3600.0, "ft/s": _FOOT},
}
MEASURES = {  # what each field of a `Format` measures; those that are not here are names
    **{"t": "time", "heading": "angle", "speed": "speed"},
    **dict.fromkeys(("x", "y", "length", "width"), "length"),
}


def check_units(units: Mapping[str, str], frame_rate: float = 0.0) -> None:
    """Can columns be in these units?

    Args:
      units: by the field of a `Format`.
      frame_rate: of times that are counted in frames [Hz]; 0 = not known.

    Raises:
      ValueError: names a field with a unit of something else, or with one that none has.
    """
    for field, unit in units.items():
        if field not in MEASURES:
            raise ValueError(f"unit of {field} = {unit!r}: expected none, but of {', '.join(MEASURES)}")
        known = [one for one in UNITS[MEASURES[field]] if one != "frame" or frame_rate]
        if unit not in known:
            raise ValueError(f"unit of {field} = {unit!r}: expected a {MEASURES[field]} in {', '.join(known)}")


def factor_of(field: str, unit: str | None) -> float:
    """What a column in a unit is multiplied by; None = it is in SI units."""
    return 1.0 if unit is None else UNITS[MEASURES[field]][unit]
