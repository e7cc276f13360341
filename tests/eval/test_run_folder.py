"""A run's folder is made once and gone on with only under the same configuration."""

import json
import subprocess

import numpy as np
import pytest

from rss_shield.eval import run_folder
from rss_shield.eval.files import atomic, to_json, write_json
from rss_shield.eval.run_folder import open_run, recorded
from rss_shield.eval.runs.experiment import experiment_of
from rss_shield.eval.suite.sweep import sweep

CONFIG = {"env_id": "a-road", "seeds": (0, 1), "cap": float("inf")}


def test_a_new_run_records_configuration_and_versions(tmp_path):
    assert open_run(tmp_path / "run", CONFIG, resume=False, overwrite=False) == []
    record = json.loads((tmp_path / "run" / "config.json").read_text())
    assert record["config"] == {"env_id": "a-road", "seeds": [0, 1], "cap": "inf"}
    assert record["packages"]["numpy"]
    assert "git_commit" in record


def test_a_taken_folder_is_refused_with_the_ways_out(tmp_path):
    open_run(tmp_path, CONFIG, resume=False, overwrite=False)
    with pytest.raises(ValueError, match="exists; --resume goes on with it, --overwrite"):
        open_run(tmp_path, CONFIG, resume=False, overwrite=False)


def test_a_sweep_and_a_run_are_not_in_one_folder(tmp_path):
    (tmp_path / "swept").mkdir()
    (tmp_path / "swept" / "experiment.json").write_text("{}")
    with pytest.raises(ValueError, match="swept holds a sweep; --name chooses another folder"):
        open_run(tmp_path / "swept", {"seed": 0}, resume=True, overwrite=False)
    open_run(tmp_path / "trained", {"seed": 0}, resume=False, overwrite=False)
    with pytest.raises(ValueError, match="trained holds a run of rss-shield train"):
        sweep(experiment_of({"name": "trained", "policies": ["idle"]}), tmp_path / "trained")


def test_a_run_goes_on_with_the_same_configuration(tmp_path):
    open_run(tmp_path, CONFIG, resume=False, overwrite=False)
    assert open_run(tmp_path, CONFIG, resume=True, overwrite=False) == []


def test_a_different_configuration_is_refused_naming_the_field(tmp_path):
    open_run(tmp_path, CONFIG, resume=False, overwrite=False)
    with pytest.raises(ValueError, match=r"seeds = \[0\], but .* was started with \[0, 1\]"):
        open_run(tmp_path, CONFIG | {"seeds": (0,)}, resume=True, overwrite=False)


def test_a_run_that_is_older_than_an_option_has_had_its_default(tmp_path):
    open_run(tmp_path, CONFIG, resume=False, overwrite=False)
    how = {"resume": True, "overwrite": False, "defaults": {"history": 1}}
    assert open_run(tmp_path, CONFIG | {"history": 1}, **how) == []
    with pytest.raises(ValueError, match=r"history = 2, but .* was started with 1"):
        open_run(tmp_path, CONFIG | {"history": 2}, **how)


def test_every_difference_is_named_however_deep(tmp_path):
    nested = CONFIG | {"ppo": {"gamma": 0.9, "net": {"pi": [64]}}}
    open_run(tmp_path, nested, resume=False, overwrite=False)
    other = CONFIG | {"ppo": {"gamma": 0.99, "net": {"pi": [64, 64]}}}
    with pytest.raises(ValueError, match=r"ppo\.gamma = 0\.99, but .*0\.9; ppo\.net\.pi = \[64, 64\], but .*\[64\]"):
        open_run(tmp_path, other, resume=True, overwrite=False)


def test_an_edited_file_of_a_users_own_is_named_and_not_its_digest(tmp_path):
    brought = CONFIG | {"sources": {"rewards:tidy": "d009", "mine.yaml": "77aa"}}
    open_run(tmp_path, brought, resume=False, overwrite=False)
    edited = brought | {"sources": {"rewards:tidy": "63f1", "mine.yaml": "77aa"}}
    with pytest.raises(ValueError, match=r"^the file of rewards:tidy has been changed since .*; put it back") as told:
        open_run(tmp_path, edited, resume=True, overwrite=False)
    assert "63f1" not in str(told.value) and "--overwrite" in str(told.value) and "--name" in str(told.value)


def test_the_configuration_of_a_run_is_read_back(tmp_path):
    assert recorded(tmp_path / "nothing") is None
    open_run(tmp_path, CONFIG | {"table": np.array([1.0, 2.0])}, resume=False, overwrite=False)
    assert recorded(tmp_path) == {"env_id": "a-road", "seeds": [0, 1], "cap": "inf", "table": [1.0, 2.0]}
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(ValueError, match=r"config\.json cannot be read"):
        recorded(tmp_path)


def test_code_is_changed_by_hand_where_it_is_and_not_where_pages_are_written(tmp_path, monkeypatch):
    for folder in ("eval", "docs/results"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "file").write_text("as it was\n")
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "all"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    monkeypatch.setattr(run_folder, "__file__", str(tmp_path / "eval" / "run_folder.py"))
    (tmp_path / "docs" / "results" / "file").write_text("a page\n")
    assert run_folder.versions()["git_commit"] and run_folder.versions()["git_changes"] is None
    (tmp_path / "eval" / "file").write_text("altered\n")
    assert run_folder.versions()["git_changes"] is not None


def test_changed_packages_are_reported_when_a_run_goes_on(tmp_path):
    open_run(tmp_path, CONFIG, resume=False, overwrite=False)
    record = json.loads((tmp_path / "config.json").read_text())
    write_json(tmp_path / "config.json", record | {"python": "2.7"})
    (warning,) = open_run(tmp_path, CONFIG, resume=True, overwrite=False)
    assert warning.startswith("python was 2.7 when this run was started and is 3.")


def test_resume_starts_a_run_that_was_killed_before_it_wrote_anything(tmp_path):
    (tmp_path / ".config.json.tmp").write_text("{")
    assert open_run(tmp_path, CONFIG, resume=True, overwrite=False) == []
    assert (tmp_path / "config.json").exists()


def test_overwrite_removes_a_run_but_nothing_else(tmp_path):
    open_run(tmp_path / "run", CONFIG, resume=False, overwrite=False)
    (tmp_path / "run" / "old").write_text("old")
    open_run(tmp_path / "run", CONFIG, resume=False, overwrite=True)
    assert not (tmp_path / "run" / "old").exists()
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "letter").write_text("dear")
    with pytest.raises(ValueError, match="holds no run"):
        open_run(tmp_path / "letters", CONFIG, resume=False, overwrite=True)
    assert (tmp_path / "letters" / "letter").exists()


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic(path) as temporary:
        temporary.write_text("ne")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_json_is_strict():
    assert json.loads(to_json({"a": float("nan"), "b": (1, float("-inf"))})) == {"a": None, "b": [1, "-inf"]}
