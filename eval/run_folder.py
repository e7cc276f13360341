"""The folder of a run: made once, gone on with only under the same configuration."""

import hashlib
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import llvmlite.binding

from rss_shield.eval.files import to_json, write_json

PACKAGES = (
    "rss-shield",
    "gymnasium",
    "highway-env",
    "llvmlite",
    "matplotlib",
    "numba",
    "numpy",
    "pandas",
    "scipy",
    "stable-baselines3",
    "torch",
)
_CODE_PATHS = (":(top)", ":(top,exclude)docs")  # pages of results are written by what they tell of
SOURCES = "sources."  # of a record: digests of what a user brought along, by name
Change = tuple[str, Any, Any]  # dotted name, now, before
PAGES = "pages"  # folder in a run: episodes that play


def open_run(
    folder: Path,
    config: dict[str, Any],
    *,
    resume: bool,
    overwrite: bool,
    defaults: Mapping[str, Any] = {},
    command: Sequence[str] = (),
) -> list[str]:
    """Make the folder of a run, or check that the run in it may go on, and record its configuration.

    Args:
      config: everything that the result depends on; strict JSON apart from tuples, infinities and arrays.
      resume: go on with the run in the folder, if there is one.
      overwrite: throw the run in the folder away, if there is one.
      defaults: of options, which a run that was started before there were these has had.
      command: options of a command line that asks for this configuration, for pages; of a new run it is recorded.

    Returns:
      Warnings: what has changed in packages and code since the run was started.

    Raises:
      ValueError: the folder is taken, or holds a run with another configuration (names the field).
    """
    record = folder / "config.json"
    if (folder / "experiment.json").exists() and not record.exists():
        raise ValueError(f"{folder} holds a sweep; --name chooses another folder")
    if folder.exists() and any(folder.iterdir()) and not resume:
        if not overwrite:
            raise ValueError(
                f"{folder} exists; --resume goes on with it, --overwrite starts it anew, --name chooses another folder"
            )
        if not record.exists():
            raise ValueError(f"{folder} holds no run (no config.json); --overwrite leaves it alone")
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    provenance = {"config": config, **versions()}
    if not record.exists():
        write_json(record, provenance | ({"command": list(command)} if command else {}))
        return []
    before = json.loads(record.read_text(encoding="utf-8"))
    now = json.loads(to_json(provenance))
    changed = changes(now["config"], {**json.loads(to_json(dict(defaults))), **before["config"]})
    if changed:
        raise ValueError(_refusal(changed, folder))
    return [
        f"{name} was {before.get(name)} when this run was started and is {now[name]} now"
        for name in now
        if name in before and name != "config" and before[name] != now[name]
    ]


def _refusal(changed: list[Change], folder: Path) -> str:
    """Why a run does not go on, and what to do."""
    edited = [_is_edited(*one) for one in changed]
    ways = ["give the same value"] * (not all(edited)) + ["put it back as it was"] * any(edited)
    return (
        f"{'; '.join(said(changed, f'{folder} was started'))}; {' and '.join(ways)}, or --overwrite starts it anew, or "
        "--name chooses another folder"
    )


def said(changed: list[Change], since: str) -> list[str]:
    """What differs, in words: a digest of a file says nothing to who has edited it.

    Args:
      changed: as of `changes`.
      since: subject and verb of what was before: "runs/NAME was started".
    """
    return [
        f"the file {'of ' * (':' in field)}{field.removeprefix(SOURCES)} has been changed since {since}"
        if _is_edited(field, new, old)
        else f"{field} = {new!r}, but {since} with {old!r}"
        for field, new, old in changed
    ]


def _is_edited(field: str, new: Any, old: Any) -> bool:
    return field.startswith(SOURCES) and None not in (new, old)


def recorded(folder: Path) -> dict[str, Any] | None:
    """The configuration of the run in a folder; None if there is no run.

    Raises:
      ValueError: the record cannot be read.
    """
    record = folder / "config.json"
    if not record.exists():
        return None
    try:
        return json.loads(record.read_text(encoding="utf-8"))["config"]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{record} cannot be read: {error!r}; --overwrite starts anew") from None


def changes(now: Any, before: Any, name: str = "") -> list[Change]:
    """(dotted name, now, before) of every value that differs; None where there is none."""
    sides = (now, before)
    if any(isinstance(side, dict) for side in sides) and all(isinstance(side, dict | None) for side in sides):
        now, before = now or {}, before or {}
        return [
            change
            for key in now | before
            for change in changes(now.get(key), before.get(key), f"{name}.{key}" if name else key)
        ]
    return [] if now == before else [(name, now, before)]


def given(option: str, values: dict[str, Any]) -> str:
    """What replaces the defaults of an environment or a preset: " (config.lanes_count 4)"; empty if nothing does."""
    named = [f"{option}.{name} {value}" for name, value, _ in changes(values, {})]
    return f" ({', '.join(named)})" if named else ""


def versions() -> dict[str, Any]:
    """Versions of Python, of the packages that matter, and of this code."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "cpu": llvmlite.binding.get_host_cpu_name(),  # what is compiled for it may round the last bit differently
        "packages": {name: _version(name) for name in PACKAGES},
        "git_commit": _git("rev-parse", "HEAD"),
        "git_changes": _digest(_git("diff", "HEAD", "--", *_CODE_PATHS)),
    }


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _digest(changes: str | None) -> str | None:
    """What tells one state of changed files from another; None if nothing is changed."""
    return hashlib.sha256(changes.encode()).hexdigest()[:16] if changes else None


def _git(*arguments: str) -> str | None:
    here = Path(__file__).parent
    try:
        done = subprocess.run(["git", *arguments], cwd=here, capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def pages_of(folder: Path) -> tuple[Path, ...]:
    """Pages on which episodes of a run play, by name."""
    return tuple(sorted((folder / PAGES).glob("*.html")))


def filmstrips_of(folder: Path) -> tuple[Path, ...]:
    """Pictures of the same episodes, by name; each is there as .pdf, too."""
    return tuple(sorted((folder / PAGES).glob("*.png")))
