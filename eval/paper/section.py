"""What a report consists of, whatever it is written as."""

from pathlib import Path
from typing import NamedTuple

import pandas as pd


class Table(NamedTuple):
    name: str  # of files and labels
    caption: str  # what is in it, over what its intervals are
    frame: pd.DataFrame  # texts


class Figure(NamedTuple):
    caption: str
    png: Path  # the same is beside it as .pdf


class Section(NamedTuple):
    title: str
    words: list[str]  # paragraphs that say what came out
    tables: list[Table]
    figures: list[Figure]
    note: str = ""  # what the columns mean
    command: str = ""  # that made the run
    pages: tuple[Path, ...] = ()  # on which episodes play
