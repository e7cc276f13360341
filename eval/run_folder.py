"""The folder of a run: made once, gone on with only under the same configuration."""

import json
import platform
import shutil
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

from eval.files import to_json, write_json

PACKAGES = (
    "rss-shield",
    "gymnasium",
    "highway-env",
    "matplotlib",
    "numba",
    "numpy",
    "pandas",
    "scipy",
    "stable-baselines3",
    "torch",
)


def open_run(folder: Path, config: dict[str, Any], *, resume: bool, overwrite: bool) -> list[str]:
    """Make the folder of a run, or check that the run in it may go on, and record its configuration.

    Args:
      config: everything that the result depends on; strict JSON apart from tuples and infinities.
      resume: go on with the run in the folder, if there is one.
      overwrite: throw the run in the folder away, if there is one.

    Returns:
      Warnings: what has changed in packages and code since the run was started.

    Raises:
      ValueError: the folder is taken, or holds a run with another configuration (names the field).
    """
    record = folder / "config.json"
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
        write_json(record, provenance)
        return []
    before = json.loads(record.read_text(encoding="utf-8"))
    now = json.loads(to_json(provenance))
    for field in now["config"] | before["config"]:
        old, new = before["config"].get(field), now["config"].get(field)
        if old != new:
            raise ValueError(
                f"{field} = {new!r}, but {folder} was started with {old!r}; "
                "give the same value, or --overwrite, or another --name"
            )
    return [
        f"{name} was {before.get(name)} when this run was started and is {now[name]} now"
        for name in now
        if name != "config" and before.get(name) != now[name]
    ]


def versions() -> dict[str, Any]:
    """Versions of Python, of the packages that matter, and of this code."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": {name: _version(name) for name in PACKAGES},
        "git_commit": _git("rev-parse", "HEAD"),
        "git_changes": bool(_git("status", "--porcelain", "--untracked-files=no")),
    }


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    here = Path(__file__).parent
    try:
        done = subprocess.run(["git", *arguments], cwd=here, capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None
