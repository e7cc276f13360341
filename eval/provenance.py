"""Where the numbers of a page come from: code, versions, machine and seeds, said in one way on every page."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

RECORDS = ("config.json", "experiment.json")  # of runs, of sweeps
SHOWN = ("gymnasium", "highway-env", "numba", "numpy", "scipy", "stable-baselines3", "torch")


def records_of(folders: Iterable[Path]) -> list[dict[str, Any]]:
    """What runs and sweeps have recorded of themselves; those that have not are left out."""
    paths = [folder / name for folder in folders for name in RECORDS if (folder / name).exists()]
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def provenance(records: Sequence[dict[str, Any]]) -> str:
    """A paragraph for the foot of a page: each code, machine and set of seeds once.

    Args:
      records: as of `records_of`, or `{**versions()}` of what is measured now.
    """
    lines = []
    for record in records:
        versions = record.get("versions", record)
        if "git_commit" not in versions:  # a run that has not recorded any
            continue
        code = str(versions["git_commit"] or "without a commit")[:12]
        changed = ", changed by hand" if versions["git_changes"] else ""
        packages = ", ".join(f"{name} {versions['packages'][name]}" for name in SHOWN if versions["packages"].get(name))
        cores = f", {versions['cores']} cores" if "cores" in versions else ""
        lines.append(
            f"Code {code}{changed}; Python {versions['python']}, {packages}; {versions['cpu']}{cores}, "
            f"{versions['platform']}."
        )
    seeds = [text for text in map(_seeds, records) if text]
    return " ".join([*dict.fromkeys(lines), *dict.fromkeys(seeds)])


def _seeds(record: dict[str, Any]) -> str:
    options = record.get("config") or record.get("experiment") or {}
    if "seeds" not in options or not {"test_seeds", "tests"} & set(options):
        return ""
    told = f"Seeds {_listed(options['seeds'])}"
    if "test_seeds" in options:
        tests = options["test_seeds"]
        return f"{told}; test episodes {tests['first']} to {tests['last']}."
    first, count = options["tests"]["first_seed"], options["tests"]["episodes"]
    return f"{told}; test episodes from {first}, {count} each."


def _listed(seeds: Sequence[int]) -> str:
    whole = list(range(min(seeds), max(seeds) + 1))
    return f"{seeds[0]} to {seeds[-1]}" if len(seeds) > 2 and list(seeds) == whole else ", ".join(map(str, seeds))
