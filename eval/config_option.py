"""The option --config of a command line, and others like it: a file, and single values under dotted names."""

import ast
import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from rss_shield.eval.files import plainly, to_json

PREFIX, HYPERPARAMETERS = "--config.", "--hyperparameters."
EXAMPLES = {PREFIX: "lanes-count 4", HYPERPARAMETERS: "gamma 0.95"}
FILES = (".json", ".toml", ".yaml", ".yml")  # how the names of what can be read end
Keys = tuple[str, ...]  # of a nested value: ("observation", "type")


class _Once(yaml.SafeLoader):
    """Refuses a key that is there twice: YAML would take the last without a word."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        keys = [key.value for key, _ in node.value if key.value != "<<" and isinstance(key, yaml.ScalarNode)]
        twice = [key for key in keys if keys.count(key) > 1]
        if twice:
            raise ValueError(f"the key {twice[0]!r} is there twice (line {node.start_mark.line + 1} on)")
        return super().construct_mapping(node, deep)


def read_config(text: str) -> dict[str, Any]:
    """A configuration from a file, or from JSON itself.

    Args:
      text: path of a .json, .toml, .yaml or .yml file, or "{...}".

    Raises:
      ValueError: says what cannot be read.
    """
    if text.lstrip().startswith("{"):
        return _object(text, _parsed(text, "json", "JSON"))
    path = Path(text)
    kind = path.suffix.lower().lstrip(".")
    if path.suffix.lower() not in FILES:
        raise ValueError(f"{text}: expected a file .json, .toml, .yaml or .yml, or JSON itself")
    try:
        content = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ValueError(plainly(error)) from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{text}: {error}") from None
    return _object(text, _parsed(content, kind, text))


def _parsed(content: str, kind: str, source: str) -> Any:
    try:
        if kind == "json":
            return json.loads(content)
        if kind == "toml":
            return tomllib.loads(content)
        return yaml.load(content, _Once)
    except (ValueError, yaml.YAMLError) as error:
        raise ValueError(f"{source} cannot be read: {' '.join(str(error).split())}") from None


def _object(source: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{source}: expected keys with values, found {value!r}")
    return value


def split_arguments(arguments: Sequence[str], prefix: str = PREFIX) -> tuple[list[str], dict[Keys, Any]]:
    """Take `--config.lanes-count 4` and the like out of a command line; the last value of a key wins.

    A value is what JSON or Python reads it as, else a text; several values are a list.

    Returns:
      The other arguments; path of keys -> value.

    Raises:
      ValueError: a key without a value.
    """
    others: list[str] = []
    values: dict[Keys, Any] = {}
    upcoming = list(arguments)
    while upcoming:
        option, equals, given = upcoming[0].partition("=")
        if not option.startswith(prefix):
            others.append(upcoming.pop(0))
            continue
        upcoming.pop(0)
        texts = [given] if equals else []
        while not equals and upcoming and not upcoming[0].startswith("--") and upcoming[0] != "-h":
            texts.append(upcoming.pop(0))
        keys = tuple(option.removeprefix(prefix).replace("-", "_").split("."))
        if not texts or not all(keys):
            raise ValueError(f"{option}: expected a key and a value, as in {prefix}{EXAMPLES[prefix]}")
        parsed = [_value(text) for text in texts]
        values[keys] = parsed[0] if len(parsed) == 1 else parsed
    return others, values


def as_text(value: Any) -> str:
    """A value as `split_arguments` reads it: JSON, or a text as it is where nothing else is read from it."""
    if isinstance(value, str) and not value.startswith("-") and _value(value) == value:
        return value
    return json.dumps(value)


def _value(text: str) -> Any:
    for read in (json.loads, ast.literal_eval):
        try:
            return read(text)
        except (ValueError, SyntaxError):
            pass
    return text


def with_values(config: Mapping[str, Any], values: Mapping[Keys, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Put single values into a configuration.

    A nested value is put into the configuration's dictionary or, where it has none, into the default's, which
    is left aside if another "type" is asked for: its other keys belong to its own.

    Args:
      config: replaces defaults key by key.
      values: path of keys -> value.

    Returns:
      What replaces the defaults, as JSON has it: tuples are lists.

    Raises:
      ValueError: a path that leads into what is not a dictionary, or a value that JSON does not have.
    """
    result = dict(config)
    # the shorter first: a dictionary, then what is in it; its type before the rest
    for keys, value in sorted(values.items(), key=lambda item: (len(item[0]), item[0][-1] != "type")):
        *parents, last = keys
        place = result
        for depth, key in enumerate(parents):
            inner = place.get(key, defaults.get(key, {}) if depth == 0 else {})
            if not isinstance(inner, Mapping):
                name = ".".join(keys[: depth + 1])
                raise ValueError(f"{PREFIX}{'.'.join(keys)}: config.{name} = {inner!r} has no keys of its own")
            another_type = last == "type" and depth == len(parents) - 1 and inner.get("type", value) != value
            place[key] = {} if another_type else dict(inner)
            place = place[key]
        place[last] = value
    try:
        return json.loads(to_json(result))
    except TypeError as error:
        raise ValueError(
            f"config: {error}; expected numbers, texts, true, false, null, lists and dictionaries"
        ) from None
