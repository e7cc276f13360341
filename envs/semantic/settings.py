"""What may be asked of semantic actions, checked where it enters."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from rss_shield.shield.definitions.semantics import LIMITS

MOST_NEIGHBOURS = 12


class SemanticSettings(NamedTuple):
    """Size of the action space, and how far ahead its trajectories are looked at."""

    neighbours: int = 3  # that an action may be about, the nearest ones
    speeds: tuple[float, ...] | None = None  # shares of the legal speed; None = those of the meta-actions
    pushes: tuple[str, ...] = ("brisk", "hard")  # keys of `shield.definitions.semantics.LIMITS`
    headway: float = 1.0  # behind somebody, or somebody behind  [s]
    gap: float = 7.0  # on top of that, between both centres     [m]
    horizon: float = 6.0  # of a trajectory                      [s]
    features: bool = False  # observe the actions `[A, D]` in place of what the environment observes


def semantic_settings(given: Any) -> SemanticSettings | None:
    """Settings out of what a user hands over; None: no semantic actions.

    Args:
      given: True or False, `SemanticSettings`, or a dict of those of its fields that differ.

    Raises:
      ValueError: names the field, its value and what is expected.
    """
    if isinstance(given, bool):
        return SemanticSettings() if given else None
    if isinstance(given, SemanticSettings):
        given = given._asdict()
    if not isinstance(given, Mapping) or not set(given) <= set(SemanticSettings._fields):
        names = ", ".join(SemanticSettings._fields)
        raise ValueError(f"semantic_actions = {given!r}: expected True, False or a dict with some of {names}")
    asked = SemanticSettings(**given)
    asked = asked._replace(pushes=tuple(asked.pushes), speeds=None if asked.speeds is None else tuple(asked.speeds))
    known = ", ".join(LIMITS)
    for name, good, expected in (
        ("neighbours", _is_whole(asked.neighbours, MOST_NEIGHBOURS), f"a whole number, 0 to {MOST_NEIGHBOURS}"),
        ("speeds", asked.speeds is None or _are_shares(asked.speeds), "shares from 0 to 1, none twice, or None"),
        ("pushes", 0 < len(set(asked.pushes) & set(LIMITS)) == len(asked.pushes), f"some of {known}, none twice"),
        ("headway", _is_within(asked.headway, 0.0, 10.0), "0 to 10 s"),
        ("gap", _is_within(asked.gap, 0.0, 50.0), "0 to 50 m"),
        ("horizon", _is_within(asked.horizon, 1.0, 30.0), "1 to 30 s"),
        ("features", isinstance(asked.features, bool), "True or False"),
    ):
        if not good:
            raise ValueError(f"semantic_actions: {name} = {getattr(asked, name)!r}: expected {expected}")
    return asked


def check_unreplaced(options: Any) -> None:
    """A shield that replaces meta-actions before a decision would replace what only goes with a trajectory.

    Args:
      options: `Options` of the shield, None = there is none.

    Raises:
      ValueError: it does.
    """
    if options is not None and options.replace == "decision":
        raise ValueError("replace = 'decision' with semantic_actions: expected 'frame'")


def _is_whole(value: Any, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most


def _is_within(value: Any, least: float, most: float) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and least <= value <= most


def _are_shares(values: tuple[Any, ...]) -> bool:
    return 0 < len(values) == len(set(values)) and all(_is_within(value, 0.0, 1.0) for value in values)
