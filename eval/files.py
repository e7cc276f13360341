"""Files: names that every system takes, and writing so that a kill leaves the old file or the new one, never a half."""

import hashlib
import json
import math
import os
import re
import sys
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

NAMES = "letters, digits and . , = + - _"
LONGEST_NAME = 120
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{i}" for port in ("COM", "LPT") for i in range(10))}  # on Windows


def valid_name(text: str) -> str:
    """A name of a folder that every system takes: no / \\ : * ? " < > |, no dot at an end, no device, not too long."""
    name = re.sub(r"[^\w=.,+-]+", "-", unicodedata.normalize("NFC", text)).strip("-.")
    if name.split(".")[0].upper() in DEVICES:
        name = f"_{name}"
    if len(name) > LONGEST_NAME:
        name = f"{name[: LONGEST_NAME - 9]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return name


def linked_names(texts: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """A name for each, no two alike, in ASCII: links, LaTeX's labels and its paths take them as they are."""
    used, names = {name.lower() for name in taken}, []
    for text in texts:
        ascii_only = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
        base = re.sub(r"[^A-Za-z0-9.+_-]+", "-", ascii_only).strip("-.") or "run"
        name, number = base, 2
        while name.lower() in used:
            name, number = f"{base}-{number}", number + 1
        used.add(name.lower())
        names.append(name)
    return names


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` when the block ends without error."""
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def plainly(error: Exception) -> str:
    """What a user is told of an error: of a file that cannot be read its name first, and no number."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror is not None:
        return f"{error.filename}: {error.strerror[:1].lower()}{error.strerror[1:]}"
    return str(error)


def refuse(program: str, error: Exception | str) -> NoReturn:
    """End a command that was asked for what cannot be done: one line says what, the exit code is 2."""
    text = plainly(error) if isinstance(error, Exception) else error
    print(f"{program}: error: {' '.join(text.split())}", file=sys.stderr)
    raise SystemExit(2)


def folder_for(path: str | Path, option: str = "--out") -> Path:
    """A folder to write into, which is there from now on. Asked for before the work, of which nothing is then lost.

    Raises:
      ValueError: there is a file in its place, or nothing may be written there.
    """
    path = Path(path)
    taken = next((one for one in (path, *path.parents) if one.exists() and not one.is_dir()), None)
    if taken is not None:
        raise ValueError(f"{option} {path}: expected a folder; {taken} is a file")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{option} {path}: expected a folder that can be written; {plainly(error)}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise ValueError(f"{option} {path}: expected a folder that can be written; permission denied")
    return path


def file_for(path: str | Path, option: str = "--out") -> Path:
    """A file to write, whose folder is there from now on; as `folder_for`.

    Raises:
      ValueError: it is a folder, or nothing may be written there.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{option} {path}: expected a file; it is a folder")
    try:
        folder_for(path.parent, option)
    except ValueError as error:
        raise ValueError(str(error).replace(f"{option} {path.parent}", f"{option} {path}", 1)) from None
    return path


def write_text(path: Path, text: str) -> None:
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    write_text(path, to_json(value) + "\n")


def to_json(value: Any) -> str:
    """Strict JSON: numbers that JSON lacks become null (not a number) or "inf"."""
    return json.dumps(_strict(value), indent=2, allow_nan=False)


def _strict(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _strict(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _strict(value.tolist())
    if isinstance(value, list | tuple):
        return [_strict(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
