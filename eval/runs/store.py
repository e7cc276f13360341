"""What tasks have written: a folder each, which is there with all its files or not at all."""

import json
import os
import shutil
from pathlib import Path

from rss_shield.eval.files import write_json
from rss_shield.eval.runs.tasks import Task

Files = dict[str, bytes]  # name -> content


class Store:
    """Results of tasks under their keys. Whoever asks for a task that is there already need not run it again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, task: Task) -> Path:
        return self.folder / task.key

    def has(self, task: Task) -> bool:
        return self.path(task).is_dir()

    def put(self, task: Task, files: Files) -> None:
        """Keep the files of a task. A kill leaves all of them or none."""
        if self.has(task):
            return
        temporary = self.folder / f".{task.key}.{os.getpid()}.tmp"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        write_json(temporary / "task.json", task.config)
        for name, content in files.items():
            (temporary / name).write_bytes(content)
        os.rename(temporary, self.path(task))

    def config(self, task: Task) -> dict:
        return json.loads((self.path(task) / "task.json").read_text(encoding="utf-8"))
