"""train, test and report read the files of sweep."""

import pytest
from places import ROOT

from rss_shield.cli import main
from rss_shield.eval.files import valid_name
from rss_shield.eval.suite.comparison.options import FIRST_TEST_SEED
from rss_shield.eval.suite.comparison.reading import started
from rss_shield.experiment import expanded

TWO_ROADS = """
environments: [highway-fast-v0, merge-v0]
arms: [shielded, lazy]
seeds: [0, 3]
tests: {episodes: 40}
options: {total_timesteps: 500, risk: true, rules: {memory: false}, config: {lanes_count: 2}}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "two-roads.yaml"
    path.write_text(TWO_ROADS)
    return str(path)


def test_an_experiment_is_one_training_run_per_road(file):
    first, second = expanded("train", [file, "--workers", "1"])
    assert " ".join(first) == (
        "--name two-roads-highway-fast-v0 --resume-or-start --env-id highway-fast-v0 --arms shielded lazy --seeds 0 3 "
        "--eval-episodes 40 --first-seed 1000000000 --total-timesteps 500 --risk --rules.memory False "
        "--config.lanes-count 2 --workers 1"
    )
    assert second[:5] == ["--name", "two-roads-merge-v0", "--resume-or-start", "--env-id", "merge-v0"]
    config, folder = started(first)
    assert config.risk and not config.rules.memory and config.config == {"lanes_count": 2}
    assert folder.name == "two-roads-highway-fast-v0"


@pytest.mark.parametrize("name", ["mein versuch", "größer 2.1", "a,b=c & d"])
def test_a_file_of_any_name_is_a_run_of_a_valid_one(name, tmp_path):
    (tmp_path / f"{name}.yaml").write_text(TWO_ROADS.replace("merge-v0", "highway_env:merge-v0"))
    lines = expanded("train", [str(tmp_path / f"{name}.yaml")])
    folders = [words[1] for words in lines]
    assert folders == [valid_name(folder) for folder in folders] and " " not in "".join(folders)
    started(lines[0])


@pytest.mark.parametrize("name", ["compare", "arms"])
def test_the_experiments_of_the_docs_are_what_training_takes(name):
    for words in expanded("train", [str(ROOT / "experiments" / f"{name}.yaml")]):
        started(words)


def test_test_and_report_take_what_is_there(file, tmp_path):
    run = tmp_path / "runs" / "two-roads-merge-v0"
    (run / "shielded-seed0").mkdir(parents=True)
    (run / "shielded-seed0" / "model.zip").write_bytes(b"")
    there = ["--runs-dir", str(tmp_path / "runs")]
    (words,) = expanded("test", [file, *there, "--tests", "on"])
    assert words == [
        *(str(run / "shielded-seed0" / "model.zip"), "--episodes", "40", "--first-seed", str(FIRST_TEST_SEED)),
        *("--tests", "on"),
    ]
    assert expanded("report", [file, *there, "--out", "x"]) == [[str(run), "--out", "x"]]


def test_other_command_lines_are_themselves(file):
    assert expanded("train", ["--env-id", "merge-v0"]) == [["--env-id", "merge-v0"]]
    assert expanded("sweep", [file]) == [[file]]
    assert expanded("test", ["model.zip"]) == [["model.zip"]]


@pytest.mark.parametrize(
    "command, text, message",
    [
        ("train", "policies: [random]", "has policies: rss-shield sweep"),
        ("train", "arms: [shielded]\nsweep: {grid: {entry: [cautious]}}", "has a sweep: rss-shield sweep"),
        ("train", "arms: [shielded]\ntests: {first_seed: 5}", "--first-seed 5 is out of range: expected 1000000000 to"),
        ("train", "arms: [shielded]\nsedes: [1]", "the nearest is 'seeds'"),
        ("report", "arms: [shielded]", "nothing in"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(command, text, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(SystemExit) as end:
        main([command, "x.yaml"])
    assert end.value.code == 2 and message in capsys.readouterr().err


def test_a_missing_file_is_named(capsys):
    with pytest.raises(SystemExit):
        main(["train", "not-there.yaml"])
    assert "not-there.yaml: no such file; expected an experiment" in capsys.readouterr().err
