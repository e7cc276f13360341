"""The results of `rss-shield test`: whether a folder may take them, and what they are called."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rss_shield.eval.arms import OFF_AND_ON
from rss_shield.eval.files import to_json
from rss_shield.eval.run_folder import changes, given, recorded, said
from rss_shield.eval.suite.comparison.options import FIRST_TEST_SEED
from rss_shield.shield.params import Rules

USUAL = {"reward": "", "entry": "cautious", "intent": "any", "waiting": "line", "history": 1, "backend": "fast"}
MOST_SAID = 4  # differences in one line


def check_free(folder: Path, record: Mapping[str, Any], overwrite: bool) -> None:
    """May results be written there? Those of the same settings may be: they are the same again.

    Args:
      record: the settings, see `title_of`.
      overwrite: those of others may be, too.

    Raises:
      ValueError: the folder holds results of other settings, or of another command.
    """
    try:
        before = recorded(folder)
    except ValueError:
        if not overwrite:
            raise
        before = None
    if (folder / "experiment.json").exists() or (before is not None and "policy" not in before):
        raise ValueError(f"--out {folder}: expected a folder of its own; this one is that of a training or a sweep")
    if before is None or overwrite:
        return
    differing = changes(json.loads(to_json(dict(record))), before)
    # what follows from other settings is said only where nothing else is
    differing = [one for one in differing if not one[0].startswith("parameters.")] or differing
    if differing:
        words = said(differing, "it was written")
        words = [*words[:MOST_SAID], f"and {len(words) - MOST_SAID} more"] if len(words) > MOST_SAID + 1 else words
        raise ValueError(
            f"{folder} holds results of other settings: {'; '.join(words)}; --overwrite replaces them, --out chooses "
            "another folder"
        )


def title_of(record: Mapping[str, Any]) -> str:
    """What was tested and how: all that differs from the defaults, so that no two settings are called the same.

    Args:
      record: options of `rss-shield test` by name; preset: the name of the one in force; ego, other: parameters that
        are not the preset's; shield: name of each test -> options of the shield.
    """
    seeds = "" if record["first_seed"] == FIRST_TEST_SEED else f" from seed {record['first_seed']} on"
    return ", ".join(
        [
            f"{record['policy']} on {record['env_id']}{given('config', record['config'])}",
            f"RSS preset {record['preset']}{given('ego', record['ego'])}{given('other', record['other'])}",
            *(f"{name} {record[name]}" for name, usual in USUAL.items() if record[name] != usual),
            *_of_the_shield(record["shield"]),
            f"{record['episodes']} episodes{seeds}",
        ]
    )


def _of_the_shield(tests: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Options beyond off and on: of all tests, then of single ones."""
    each = {test: _beyond(dict(options), dict(OFF_AND_ON.get(test, {}))) for test, options in tests.items()}
    common = [option for option in next(iter(each.values())) if all(option in options for options in each.values())]
    own = {test: [option for option in options if option not in common] for test, options in each.items()}
    texts = [f"shield {', '.join(common)}"] if common else []
    return texts + [f"test {test}: {', '.join(options)}" for test, options in own.items() if options]


def _beyond(options: dict[str, Any], usual: dict[str, Any]) -> list[str]:
    """Options with another value than usual; cards have all rules."""
    differing = changes(options, {"rules": Rules()._asdict(), **usual})
    return [f"{name} {value}" for name, value, _ in differing if value is not None]
