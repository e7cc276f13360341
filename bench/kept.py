"""What the results pages were written from: kept beside them, to check, to plot anew, or to go on from.

    python bench/kept.py pack                 docs/results/data/NAME.tar.xz of what is in runs/
    python bench/kept.py pack people stress   only these
    python bench/kept.py unpack               into runs/: the commands that measured go on from there
    python bench/kept.py list                 what is kept, and what is in runs/

Only tables and numbers are kept (CSV, JSON and lines of JSON), no models, traces or pictures; of parts of the campaign
what their page is written from, without actions and grounds of verdicts, to five digits. The same files make the same
archive, to the byte. `unpack` leaves alone what is in runs/ already. What was measured before the shield, a road
or a driver was changed is no longer true: delete its archive, and measure anew.
"""

import dataclasses
import io
import lzma
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import pandas as pd
import tyro

from rss_shield.eval.files import atomic, folder_for, refuse

SUFFIXES = (".csv", ".json", ".jsonl")
DATA = Path(__file__).resolve().parents[1] / "docs" / "results" / "data"
ENTRIES = ("environments", "people.jsonl", "parking", "stress", "evidence", "semantic", "evasion")  # in runs/
NAMES = {Path(entry).stem: entry for entry in ENTRIES}  # of an archive: the file or folder that is in it
CAMPAIGN = "campaign-"  # so begin folders of its parts, each an archive of its own
OF_CAMPAIGN = ("config.json", "results.json", "card.json", "episodes.csv", "learning_curve.csv")
OF_CAMPAIGN += ("removal_curve.csv", "multiplier.csv")
LEFT_OUT = ["actions", "evidence"]  # columns


@dataclasses.dataclass(frozen=True)
class Config:
    """Keep the numbers behind the pages."""

    what: Annotated[Literal["pack", "unpack", "list"], tyro.conf.Positional]
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = ()  # of archives; none: all
    runs: Path = Path("runs")
    data: Path = DATA  # folder of the archives


def known(runs: Path, data: Path) -> list[str]:
    """Names of archives: the fixed ones, and finished parts of the campaign that are in `runs` or kept."""
    parts = {path.parent.name for path in runs.glob(f"{CAMPAIGN}*/results.json")}
    parts |= {path.name.removesuffix(".tar.xz") for path in data.glob(f"{CAMPAIGN}*.tar.xz")}
    return [*NAMES, *sorted(parts)]


def files_of(name: str, runs: Path) -> Iterator[Path]:
    """Tables and numbers of an archive, relative to `runs`, in order; what was half written is none."""
    path = runs / NAMES.get(name, name)
    for file in [path] if path.is_file() else sorted(path.rglob("*")):
        if not file.is_file() or file.suffix not in SUFFIXES or file.name.startswith("."):
            continue
        if name in NAMES or (file.name in OF_CAMPAIGN and file.parent.name != "episodes"):
            yield file.relative_to(runs)


def content_of(file: Path, name: str) -> bytes:
    """What is kept of a file."""
    if name in NAMES or file.suffix != ".csv":
        return file.read_bytes()
    table = pd.read_csv(file, keep_default_na=False, na_values=[""], low_memory=False).drop(
        columns=LEFT_OUT, errors="ignore"
    )
    return table.to_csv(index=False, float_format="%.5g", lineterminator="\n").encode()


def archive(name: str, data: Path) -> Path:
    return data / f"{name}.tar.xz"


def kept(name: str, data: Path) -> dict[str, bytes]:
    """The files in an archive; empty where there is none."""
    path = archive(name, data)
    if not path.exists():
        return {}
    with tarfile.open(path, "r:xz") as tar:
        members = [member for member in tar.getmembers() if member.isfile()]
        return {member.name: tar.extractfile(member).read() for member in members}  # type: ignore[union-attr]


def pack(name: str, runs: Path, data: Path) -> int:
    """Put what is in `runs` into an archive, beside what it holds already; returns the number of its files."""
    files = kept(name, data) | {path.as_posix(): content_of(runs / path, name) for path in files_of(name, runs)}
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for path, content in sorted(files.items()):
            member = tarfile.TarInfo(path)  # no times, no owners: the same files are the same archive
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    packed = lzma.compress(buffer.getvalue(), preset=9 | lzma.PRESET_EXTREME)
    with atomic(archive(name, data)) as temporary:
        temporary.write_bytes(packed)
    return len(files)


def unpack(name: str, runs: Path, data: Path) -> int:
    """Put files of an archive into `runs` that are not there; returns how many that were."""
    missing = [(runs / path, content) for path, content in kept(name, data).items() if not (runs / path).exists()]
    for path, content in missing:
        if not path.resolve().is_relative_to(runs.resolve()):
            raise ValueError(f"{archive(name, data)}: {path} is outside {runs}")
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path) as temporary:
            temporary.write_bytes(content)
    return len(missing)


def main(config: Config) -> None:
    there_are = known(config.runs, config.data)
    names = config.names or tuple(there_are)
    unknown = [name for name in names if name not in there_are]
    if unknown:
        raise ValueError(f"{' '.join(unknown)}: expected some of {', '.join(there_are)}")
    for name in names:
        there = len(list(files_of(name, config.runs)))
        if config.what == "list":
            print(f"{name}: {len(kept(name, config.data))} files kept, {there} in {config.runs}")
        elif config.what == "unpack":
            folder_for(config.runs, "--runs")
            print(f"{name}: {unpack(name, config.runs, config.data)} files put into {config.runs}")
        elif there:
            folder_for(config.data, "--data")
            print(f"{name}: {pack(name, config.runs, config.data)} files in {archive(name, config.data)}")


if __name__ == "__main__":
    try:
        main(tyro.cli(Config, prog="bench/kept.py", description=__doc__))
    except (ValueError, OSError, tarfile.TarError, lzma.LZMAError) as error:
        refuse("bench/kept.py", error)
