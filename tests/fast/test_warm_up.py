"""Kernels are compiled beforehand, each environment in a process of its own."""

import sys

import pytest

from rss_shield import warm_up as command
from rss_shield.envs.fast import warm_up
from rss_shield.envs.fast.tasks import SCENARIOS


def test_every_kind_of_road_is_there():
    assert set(warm_up.KINDS) <= set(SCENARIOS)


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_each_environment_has_a_process(monkeypatch, tmp_path, jobs):
    code = "import pathlib, sys; pathlib.Path(sys.argv[1]).touch()"
    monkeypatch.setattr(warm_up, "_command", lambda env_id: [sys.executable, "-c", code, str(tmp_path / env_id)])
    ready = list(warm_up.compile_kernels(["a", "b", "c"], jobs))
    assert [env_id for env_id, _ in ready] == ["a", "b", "c"]
    assert all(seconds > 0.0 for _, seconds in ready)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "c"]


def test_a_process_that_fails_is_an_error(monkeypatch):
    monkeypatch.setattr(warm_up, "_command", lambda env_id: [sys.executable, "-c", "raise SystemExit(3)"])
    with pytest.raises(RuntimeError, match="the kernel of merge-v0 could not be compiled"):
        list(warm_up.compile_kernels(["merge-v0"]))


def test_the_command_says_when_each_is_ready(monkeypatch, capsys):
    monkeypatch.setattr(command, "compile_kernels", lambda envs, jobs: iter([(envs[0], 12.4)]))
    command.run(["merge-v0", "--jobs", "2"])
    assert capsys.readouterr().out == "merge-v0: ready after 12 s\n"


@pytest.mark.parametrize("arguments", [["parking-v0"], ["--jobs", "0"]])
def test_bad_arguments_are_named(arguments, capsys):
    with pytest.raises(SystemExit):
        command.run(arguments)
    assert arguments[-1] in capsys.readouterr().err
