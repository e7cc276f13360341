"""Names in files of users: known ones, or an error that says which was meant."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any


def check_names(given: Iterable[str], known: Iterable[str], where: str) -> None:
    """Are all names known?

    Raises:
      ValueError: names the first that is not, and the nearest known one.
    """
    names = list(known)
    for name in given:
        if name not in names:
            nearest = get_close_matches(str(name), names, n=1, cutoff=0.0)
            raise ValueError(f"{where} has an unknown key {name!r}; the nearest is {nearest[0]!r}")


def flat(values: Any, name: str = "") -> dict[str, Any]:
    """Nested dictionaries under dotted names: {"rules": {"memory": False}} is {"rules.memory": False}."""
    if not isinstance(values, dict) or not values:
        return {name: values}
    return {
        key: value
        for outer, inner in values.items()
        for key, value in flat(inner, f"{name}.{outer}" if name else str(outer)).items()
    }


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """The opposite of `flat`.

    Raises:
      ValueError: a name that is both a value and the beginning of others.
    """
    result: dict[str, Any] = {}
    for name, value in values.items():
        *outer, last = name.split(".")
        place = result
        for key in outer:
            place = place.setdefault(key, {})
            if not isinstance(place, dict):
                raise ValueError(f"{name}: {key} is {place!r} and cannot have keys of its own")
        if isinstance(place.get(last), dict):
            raise ValueError(f"{name} = {value!r}: it has keys of its own already")
        place[last] = value
    return result
