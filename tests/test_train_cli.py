"""The training script as its users meet it: bad input, a whole run, a run killed and resumed."""

import json
import os
import runpy
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from shield.params import RSSParams

SCRIPT = Path(__file__).parent.parent / "train.py"
TINY = ["--total-timesteps", "64", "--seeds", "0", "--eval-episodes", "3", "--replay-episodes", "1", "--n-envs", "2"]
CELLS = [("off", "off"), ("off", "on"), ("on", "off"), ("on", "on")]


def call(monkeypatch, *arguments: str) -> None:
    """Run the script in this process."""
    monkeypatch.setattr(sys, "argv", ["train.py", *arguments])
    runpy.run_path(str(SCRIPT), run_name="__main__")


def start(runs: Path, *arguments: str) -> subprocess.Popen:
    command = [sys.executable, str(SCRIPT), *TINY, "--runs-dir", str(runs), *arguments]
    return subprocess.Popen(command, cwd=SCRIPT.parent, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--backend slow", "--backend slow is out of range: expected one of fast, highway-env"),
        ("--arms foo", "--arms foo is out of range: expected one or more of unshielded, shielded"),
        ("--arms shielded shielded", "--arms shielded shielded is out of range: expected one or more of"),
        ("--total-timesteps 0", "--total-timesteps 0 is out of range: expected at least 1"),
        ("--total-timesteps many", "--total-timesteps: invalid literal for int() with base 10: 'many'"),
        ("--seeds", "--seeds  is out of range: expected different whole numbers, 0 to 2**32 - 1"),
        ("--seeds 1 1", "--seeds 1 1 is out of range: expected different whole numbers"),
        ("--seeds -1", "--seeds -1 is out of range: expected different whole numbers"),
        (
            "--preset fast",
            "--preset fast is out of range: expected one of auto, simulator, intersection, slides, ad-rss",
        ),
        ("--entry bold", "--entry bold is out of range: expected one of cautious, priority, assertive"),
        ("--intent left", "--intent left is out of range: expected one of known, straight, any"),
        ("--waiting nowhere", "--waiting nowhere is out of range: expected one of line, anywhere"),
        ("--eval-episodes 0", "--eval-episodes 0 is out of range: expected at least 1"),
        ("--replay-episodes -1", "--replay-episodes -1 is out of range: expected at least 0"),
        ("--n-envs 0", "--n-envs 0 is out of range: expected 1 to 4096"),
        ("--workers 0", "--workers 0 is out of range: expected 1 to 256"),
        ("--device abacus", "--device abacus is out of range: expected one of auto, cpu"),
        ("--name ../home", "--name ../home is out of range: expected letters, digits and"),
        ("--penalty-on frames", "--penalty-on frames is out of range: expected one of response, change"),
        ("--intervention-penalty nan", "--intervention-penalty nan is out of range: expected a number >= 0"),
        ("--resume --overwrite", "expected --resume or --overwrite, not both"),
        ("--env-id no-such-road", "'no-such-road'"),
        ("--env-id CartPole-v1", "CartPole"),
        ("--env-id CartPole-v1 --backend highway-env", "CartPole"),
        (
            "--env-id racetrack-v0 --backend highway-env",
            "environment RacetrackEnv is not supported; expected one of highway-v0",
        ),
        ("--env-id intersection-multi-agent-v0 --backend highway-env", "actions Tuple(Discrete(3), Discrete(3)); "),
        ("--ego.mu -1", "--ego: mu = -1.0 is out of range: expected a finite number >= 0"),
        ("--other.a-min-brake 7", "--other: a_min_brake = 7 is out of range: expected at most a_max_brake = 6"),
        ("--ego.response-time 0.01", "response_time = 0.01 s of the ego is shorter than one simulation frame"),
        ("--no-such-option", "--no-such-option"),
    ],
)
def test_bad_input_ends_in_one_line_and_exit_code_2(arguments, message, monkeypatch, capsys, tmp_path):
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, *arguments.split(), "--runs-dir", str(tmp_path))
    printed = capsys.readouterr().err.strip().splitlines()
    lines = [line for line in printed if "Warning" not in line]
    assert stop.value.code == 2
    assert len(lines) == 1
    assert lines[0].startswith("train.py: error: ")
    assert message in lines[0]
    assert not list(tmp_path.iterdir())


def test_help_shows_examples_and_every_option(monkeypatch, capsys):
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "--help")
    text = capsys.readouterr().out
    assert not stop.value.code
    assert "python train.py --resume" in text
    script = runpy.run_path(str(SCRIPT))
    for option in fields(script["Config"]):
        assert f"--{option.name.replace('_', '-')}" in text
    assert [option.name for option in fields(script["Overrides"])] == list(RSSParams._fields)


def test_the_folder_is_named_after_the_options_that_are_not_defaults():
    script = runpy.run_path(str(SCRIPT))
    config, overrides = script["Config"], script["Overrides"]
    assert script["run_name"](config()) == "highway-fast-v0"
    assert script["run_name"](config(runs_dir=Path("elsewhere"), resume=True)) == "highway-fast-v0"
    chosen = config(env_id="merge-v0", seeds=(1, 2), ego=overrides(response_time=0.5))
    assert script["run_name"](chosen) == "merge-v0,seeds=1-2,ego.response_time=0.5"
    crossing = config(env_id="intersection-v0", entry="priority", intent="known", waiting="anywhere")
    assert script["run_name"](crossing) == "intersection-v0,entry=priority,intent=known,waiting=anywhere"


@pytest.mark.parametrize(
    ("env_id", "name"),
    [("highway-fast-v0", "simulator"), ("roundabout-v0", "simulator"), ("intersection-v0", "intersection")],
)
def test_the_environment_chooses_the_preset_and_single_parameters_replace_its_values(env_id, name):
    script = runpy.run_path(str(SCRIPT))
    config, overrides, preset = script["Config"], script["Overrides"], script["PRESETS"][name]
    assert script["preset_name"](config(env_id=env_id)) == name
    assert script["preset_name"](config(env_id=env_id, preset="slides")) == "slides"
    wobbly = script["resolve"](config(env_id=env_id, ego=overrides(mu=0.5)))
    assert wobbly == preset._replace(ego=preset.ego._replace(mu=0.5))


def test_given_parameters_replace_the_presets_and_nothing_else():
    script = runpy.run_path(str(SCRIPT))
    config, overrides, preset = script["Config"], script["Overrides"], script["PRESETS"]["simulator"]
    assert script["resolve"](config()) == preset
    braking = script["resolve"](config(other=overrides(a_min_brake=4.0)))
    assert braking.other == preset.other._replace(a_min_brake=4.0)
    assert (braking.ego, braking.per_frame) == (preset.ego, True)
    slow = script["resolve"](config(ego=overrides(response_time=0.5)))
    assert (slow.ego.response_time, slow.per_frame) == (0.5, False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A whole run on the engine: (folder, what it printed)."""
    runs = tmp_path_factory.mktemp("runs")
    process = start(runs, "--name", "whole")
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    return runs / "whole", output


def test_a_run_prints_one_table_and_where_everything_is(finished):
    folder, output = finished
    assert " ".join(output.split()).count("95 % interval") == 1
    assert "Traceback" not in output
    assert f"Everything is in {folder}" in output


def test_a_run_writes_everything_a_paper_needs(finished):
    folder, _ = finished
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "config.json",
        "episodes",
        "episodes.csv",
        "replays",
        "replays.csv",
        "results.json",
        "table.txt",
        "table.md",
        "table.tex",
        "table.csv",
        "learning_curve.png",
        "learning_curve.pdf",
        "blame.png",
        "blame.pdf",
        "unshielded-seed0",
        "shielded-seed0",
    }
    assert (folder / "shielded-seed0" / "model.zip").exists()
    config = json.loads((folder / "config.json").read_text())
    assert config["config"]["total_timesteps"] == 64
    assert config["config"]["preset"] == "simulator"
    assert [config["config"][name] for name in ("entry", "intent", "waiting")] == ["cautious", "any", "line"]
    assert not config["config"]["parameters"]["roads_cross"]
    assert config["config"]["parameters"]["ego"]["a_max_brake"] == 6.0
    assert config["packages"]["torch"]
    for name in ("blame", "learning_curve"):
        with Image.open(folder / f"{name}.png") as image:
            image.load()


def test_every_cell_of_a_run_plays_the_same_seeds(finished):
    folder, _ = finished
    episodes = pd.read_csv(folder / "episodes.csv", keep_default_na=False)
    seeds = {cell: list(rows["seed"]) for cell, rows in episodes.groupby(["train", "test"], sort=False)}
    assert list(seeds) == CELLS
    assert list(seeds.values()) == [[10**9, 10**9 + 1, 10**9 + 2]] * 4
    assert (episodes.loc[episodes["test"] == "off", "override_share"] == 0).all()
    cells = json.loads((folder / "results.json").read_text())["cells"]
    assert len(cells) == 40
    assert all(cell["n"] == 3 for cell in cells)


def test_a_sample_of_a_run_is_replayed_and_reported(finished):
    folder, output = finished
    assert "4 of 4 test episodes agree" in " ".join(output.split())
    assert "4 of 4 test episodes agree" in (folder / "table.md").read_text()
    assert "4 of 4 test episodes agree" in " ".join((folder / "table.txt").read_text().split())
    replays = json.loads((folder / "results.json").read_text())["replays"]
    assert [(replay["train"], replay["test"]) for replay in replays] == CELLS
    assert all(replay["agrees"] for replay in replays)


def test_an_episode_tampered_with_is_named_in_the_report(finished, tmp_path):
    folder = shutil.copytree(finished[0], tmp_path / "tampered")
    path = folder / "episodes" / "shielded-seed0-test-on.csv"
    episode = pd.read_csv(folder / "replays" / path.name)["seed"].item()
    episodes = pd.read_csv(path, keep_default_na=False)
    episodes.loc[episodes["seed"] == episode, "length"] += 1
    episodes.to_csv(path, index=False)
    report = [sys.executable, "-m", "eval.report", str(folder)]
    output = subprocess.run(report, cwd=SCRIPT.parent, text=True, capture_output=True, check=True).stdout
    assert "3 of 4 test episodes agree" in " ".join(output.split())
    assert f"DISAGREES: train on, test on, training seed 0, episode {episode}: length" in " ".join(output.split())


def test_the_original_simulator_is_one_flag_away(tmp_path):
    options = ["--backend", "highway-env", "--total-timesteps", "16", "--eval-episodes", "1", "--name", "original"]
    process = start(tmp_path, *options)
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    assert "Replayed" not in output
    episodes = pd.read_csv(tmp_path / "original" / "episodes.csv", keep_default_na=False)
    assert list(zip(episodes["train"], episodes["test"], strict=True)) == CELLS
    assert not (tmp_path / "original" / "replays").exists()


def test_a_run_at_a_junction_says_who_got_across_and_how_the_ego_behaved(tmp_path):
    process = start(tmp_path, "--env-id", "intersection-v0", "--intent", "known", "--name", "junction")
    output, _ = process.communicate(timeout=600)
    assert process.returncode == 0, output
    title = "RSS preset intersection, cautious entry, known intent, waiting at the line, 64 timesteps per arm"
    assert title in " ".join(output.split())
    assert "4 of 4 test episodes agree" in " ".join(output.split())
    table = (tmp_path / "junction" / "table.md").read_text()
    assert "| success [%] | time to goal [s] |" in table
    config = json.loads((tmp_path / "junction" / "config.json").read_text())["config"]
    assert (config["preset"], config["intent"]) == ("intersection", "known")
    assert config["parameters"]["ego"]["a_max_accel"] == 6.0


def test_a_run_killed_thrice_and_resumed_gives_the_same_episodes(finished, tmp_path):
    whole, _ = finished
    folder = tmp_path / "killed"
    cell = "unshielded-seed0-test-off.csv"
    milestones = (folder / "unshielded-seed0" / "model.zip", folder / "episodes" / cell, folder / "replays" / cell)
    kept = {}
    for milestone in milestones:
        process = start(tmp_path, "--name", "killed", "--resume")
        while not milestone.exists():
            assert process.poll() is None, process.stdout.read()
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
        kept[milestone] = milestone.stat().st_mtime_ns
    assert not (folder / "results.json").exists()
    output, _ = start(tmp_path, "--name", "killed", "--resume").communicate(timeout=300)
    assert (folder / "episodes.csv").read_bytes() == (whole / "episodes.csv").read_bytes(), output
    assert (folder / "table.csv").read_bytes() == (whole / "table.csv").read_bytes()
    assert {path: path.stat().st_mtime_ns for path in kept} == kept


def test_a_taken_folder_is_refused(finished, monkeypatch, capsys):
    folder, _ = finished
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, *TINY, "--runs-dir", str(folder.parent), "--name", "whole")
    assert stop.value.code == 2
    assert "exists; --resume goes on with it, --overwrite starts it anew" in capsys.readouterr().err


def test_resuming_with_another_configuration_is_refused_naming_the_field(finished, monkeypatch, capsys):
    folder, _ = finished
    options = [*TINY, "--runs-dir", str(folder.parent), "--name", "whole", "--resume", "--preset", "slides"]
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, *options)
    assert stop.value.code == 2
    assert "preset = 'slides', but" in capsys.readouterr().err


def test_resuming_a_finished_run_repeats_only_the_report(finished, monkeypatch, capsys):
    folder, _ = finished
    before = (folder / "table.csv").read_bytes()
    began = time.perf_counter()
    call(monkeypatch, *TINY, "--runs-dir", str(folder.parent), "--name", "whole", "--resume")
    assert time.perf_counter() - began < 20
    assert "95 % interval" in " ".join(capsys.readouterr().out.split())
    assert (folder / "table.csv").read_bytes() == before
