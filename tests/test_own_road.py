"""An environment of one's own, "module:my-road-v0", in the folder where commands are called."""

import os
import subprocess
import sys

import pytest
from places import ROOT

OWN = """
import gymnasium
from highway_env.envs.highway_env import HighwayEnvFast

class Own(HighwayEnvFast):
    pass

gymnasium.register("own-v0", entry_point="my_road:Own")
"""
# as an installed command: the folder where we are is not on the path by itself
COMMAND = [sys.executable, "-P", "-c", "from rss_shield.cli import main; main()"]
TRAIN = ["train", "--arms", "lazy", "--seeds", "0", "--eval-episodes", "1", "--workers", "1", "--no-pages"]
TRAIN += ["--config.duration", "3"]


def called(folder, *words):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run([*COMMAND, *words], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "my_road.py").write_text(OWN)
    (tmp_path / "broken_road.py").write_text("import nothing_of_this_name")
    return tmp_path


def test_it_is_found_where_commands_are_called(folder):
    done = called(folder, *TRAIN, "--env-id", "my_road:own-v0", "--backend", "highway-env", "--name", "own")
    assert done.returncode == 0, done.stderr
    assert (folder / "runs" / "own" / "episodes.csv").exists()


@pytest.mark.parametrize(
    ("env_id", "said"),
    [
        ("my_raod:own-v0", "my_raod cannot be imported: no module 'my_raod' here, nor installed"),
        ("my_road:onw-v0", "env_id = 'my_road:onw-v0': Environment `onw` doesn't exist"),
        ("broken_road:own-v0", "broken_road cannot be imported: ModuleNotFoundError: No module named 'nothing_of_"),
        ("my_road:own-v0", "the fast engine does not support env_id = 'my_road:own-v0'"),
    ],
)
def test_what_is_wrong_with_it_is_one_line(folder, env_id, said):
    done = called(folder, *TRAIN, "--env-id", env_id)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and said in done.stderr, done.stderr
