"""What tasks have written: a folder each, which is there with all its files or not at all."""

import json
import os
import shutil
from pathlib import Path

from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.runs.tasks import Task

Files = dict[str, bytes]  # name -> content
TASK = "task.json"
ERROR = "error.txt"  # in the folder of a task that failed: its traceback
FAILED = "failed.json"  # of a sweep: which of its tasks failed, and of what, a text each


class Store:
    """Results of tasks under their keys. Whoever asks for a task that is there already need not run it again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, task: Task) -> Path:
        return self.folder / task.key

    def has(self, task: Task) -> bool:
        return (self.path(task) / TASK).is_file()

    def put(self, task: Task, files: Files) -> None:
        """Keep the files of a task. A kill leaves all of them or none."""
        if self.has(task):
            return
        temporary = self.folder / f".{task.key}.{os.getpid()}.tmp"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        write_json(temporary / TASK, task.config)
        for name, content in files.items():
            (temporary / name).write_bytes(content)
        shutil.rmtree(self.path(task), ignore_errors=True)  # it may have failed before
        os.rename(temporary, self.path(task))

    def fail(self, task: Task, error: str) -> None:
        """Keep what a task failed of; it is still to be done."""
        self.path(task).mkdir(exist_ok=True)
        write_text(self.path(task) / ERROR, error)

    def config(self, task: Task) -> dict:
        return json.loads((self.path(task) / TASK).read_text(encoding="utf-8"))


def missing_in(folder: Path) -> str:
    """A sentence that names the tasks of a sweep that failed, and of what; empty where none did.

    Args:
      folder: of the sweep. An older one has not recorded which they are, so they are named by their folders.
    """
    if (folder / FAILED).exists():
        failed = json.loads((folder / FAILED).read_text(encoding="utf-8"))
    else:
        errors = [path for path in sorted((folder / "tasks").glob(f"*/{ERROR}")) if not (path.parent / TASK).exists()]
        failed = [f"{path.parent.name} ({last_line(path.read_text(encoding='utf-8'))})" for path in errors]
    if not failed:
        return ""
    tasks = "One task" if len(failed) == 1 else f"{len(failed)} tasks"
    return f"{tasks} failed, and the points that need them are missing: {'; '.join(failed)}."


def last_line(error: str) -> str:
    """Of a traceback: what was raised."""
    return error.strip().splitlines()[-1]
