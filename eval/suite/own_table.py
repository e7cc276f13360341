"""A table of RSS parameters by the name of a preset, or from a file of one's own."""

from typing import Any

from rss_shield.envs.make import make
from rss_shield.envs.options import default_preset
from rss_shield.eval.config_option import FILES, read_config
from rss_shield.eval.runs.names import check_names
from rss_shield.shield.params import PRESETS, Preset, RSSParams, with_parameters

_KEYS = ("like", "ego", "other", "source")
LIKE = "simulator"
KNOWN_PRESETS = f"{', '.join(PRESETS)}, or a file such as my-table.yaml"


def is_file(name: str) -> bool:
    """Does it name a file, and no preset?"""
    return name.lower().endswith(FILES)


def preset_in(name: str) -> Preset:
    """A preset.

    Args:
      name: of `PRESETS`, or a YAML, TOML or JSON file with the keys `like` (the preset that the rest comes from, by
        default `simulator`), `ego` and `other` (fields of `RSSParams`), `source` (where the numbers are from).

    Raises:
      ValueError: no such preset or file, an unknown key, or a value out of range.
    """
    if not is_file(name):
        if name not in PRESETS:
            raise ValueError(f"preset = {name!r}: expected one of {KNOWN_PRESETS}")
        return PRESETS[name]
    given = read_config(name)
    try:
        return _preset_of(given, name)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def usual_preset(environment: str) -> str:
    """Name of the preset that suits an environment, by its id."""
    env = make(environment, shield=None)
    env.close()
    return default_preset(env.unwrapped)


def _preset_of(given: dict[str, Any], name: str) -> Preset:
    check_names(given, _KEYS, "the table")
    like = given.get("like", LIKE)
    if like not in PRESETS:
        raise ValueError(f"like = {like!r}: expected one of {', '.join(PRESETS)}")
    sides = {side: given.get(side) or {} for side in ("ego", "other")}
    for side, values in sides.items():
        if not isinstance(values, dict):
            raise ValueError(f"{side} = {values!r}: expected parameters and their values")
        check_names(values, RSSParams._fields, side)
    table = with_parameters(PRESETS[like], sides["ego"], sides["other"])
    return table._replace(source=str(given.get("source", f"{name}, like {like}")))
