"""Campaigns killed (SIGKILL) at any moment: whoever goes on with them counts nothing twice and loses nothing."""

import os
import signal
import time

import numpy as np
import pytest

from rss_shield.eval.runs.experiment import experiment_of
from rss_shield.eval.suite import stress
from rss_shield.eval.suite.sweep import do_task, sweep

KILLS = 20

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


def in_a_child(work, ready=None, later=0.0):
    """Do something in another process, which is killed some seconds after it is `ready`. Was it, before it was done?"""
    child = os.fork()
    if child == 0:
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        try:
            work()
        finally:
            os._exit(0)
    if ready is not None:
        while not ready():
            if os.waitpid(child, os.WNOHANG)[0]:
                return False
            time.sleep(0.002)
        time.sleep(later)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


def killed_again_and_again(work, done, pieces, per_piece, rng):
    """At twenty random moments, each up to `pieces` pieces of work after the one before.

    Moments are counted in pieces that are done, so a machine that becomes faster or slower meanwhile does not matter.
    On one that is very busy the work may run ahead and be done too early: returns how many were killed.
    """
    killed = 0
    for _ in range(KILLS):
        wanted, later = done() + int(rng.integers(pieces)), rng.uniform(0.0, per_piece)
        killed += in_a_child(work, lambda wanted=wanted: done() >= wanted, later)
    return killed


def written(folder, pattern):
    """Files that are whole; what a killed process had half written is hidden, or in a hidden folder."""
    inside = (path.relative_to(folder) for path in sorted(folder.rglob(pattern)) if path.is_file())
    return [path for path in inside if not any(part.startswith(".") for part in path.parts)]


def count(folder, pattern):
    while True:
        try:
            return len(written(folder, pattern))
        except FileNotFoundError:  # a hidden folder that was there when it was listed
            continue


def contents(folder, pattern):
    return {str(path): (folder / path).read_bytes() for path in written(folder, pattern)}


@pytest.mark.parametrize("seed", [0])
def test_a_campaign_of_stress(tmp_path, capsys, seed):
    episodes = 120
    few = ["--envs", "highway-fast-v0", "--policies", "random", "--block", "1", "--episodes", str(episodes)]
    stress.run([*few, "--out", str(tmp_path / "whole")])  # compiles, too
    said = capsys.readouterr().out.splitlines()[-4:]
    began = time.perf_counter()
    in_a_child(lambda: stress.run([*few, "--out", str(tmp_path / "again")]))
    per_piece = (time.perf_counter() - began) / episodes

    folder = tmp_path / "killed"
    killed = killed_again_and_again(
        lambda: stress.run([*few, "--out", str(folder)]),
        lambda: count(folder, "*.json"),
        *(5, per_piece, np.random.default_rng(seed)),
    )
    assert killed >= KILLS // 2
    stress.run([*few, "--out", str(folder)])
    assert capsys.readouterr().out.splitlines()[-4:] == said
    assert said[0].startswith(f"{episodes} episodes")
    assert contents(folder, "*.json") == contents(tmp_path / "whole", "*.json")


def test_a_sweep(tmp_path):
    tasks = 90
    grid = {"rules.anticipation": [round(0.1 * k, 1) for k in range(tasks)]}
    tiny = {
        "name": "tiny",
        "policies": ["faster"],
        "tests": {"episodes": 2},
        "options": {"config": {"vehicles_count": 4, "duration": 3}},
        "sweep": {"grid": grid},
    }
    experiment, known = experiment_of(tiny), {}

    def work(config):
        if not known:
            known.update(do_task(config))
        time.sleep(0.03)
        with open(tmp_path / "done.txt", "a") as file:  # a line per task that was worked on
            file.write(f"{config['options']['rules.anticipation']}\n")
        return dict(known)

    whole = sweep(experiment, tmp_path / "whole", work)
    (tmp_path / "done.txt").unlink()
    folder = tmp_path / "killed"
    began = time.perf_counter()
    in_a_child(lambda: sweep(experiment, tmp_path / "again", work))
    per_piece = (time.perf_counter() - began) / tasks
    (tmp_path / "done.txt").unlink()

    killed = killed_again_and_again(
        lambda: sweep(experiment, folder, work),
        lambda: count(folder / "tasks", "*.csv"),
        *(3, per_piece, np.random.default_rng(1)),
    )
    assert killed >= KILLS // 2
    done = sweep(experiment, folder, work)
    assert not done.failed and len(done.tasks) == len(whole.tasks) == tasks
    assert contents(folder / "tasks", "*.csv") == contents(tmp_path / "whole" / "tasks", "*.csv")
    assert (folder / "points.csv").read_bytes() == (tmp_path / "whole" / "points.csv").read_bytes()
    # a task may be begun again if it was killed between the work and the file, but no more often than that
    lines = (tmp_path / "done.txt").read_text().splitlines()
    assert set(lines) == {str(value) for value in grid["rules.anticipation"]}
    assert len(lines) <= tasks + killed
