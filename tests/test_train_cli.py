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
from places import ROOT
from stable_baselines3 import PPO

from rss_shield.command_line import Overrides
from rss_shield.eval.files import valid_name
from rss_shield.eval.metrics import METRICS, with_outcomes
from rss_shield.eval.suite.comparison.naming import run_name
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.eval.suite.comparison.reading import preset_name, resolve, started
from rss_shield.shield.params import PRESETS, RSSParams

SCRIPT = ROOT / "train.py"
TINY = ["--total-timesteps", "64", "--seeds", "0", "--eval-episodes", "3", "--replay-episodes", "1", "--n-envs", "2"]
CELLS = [("off", "off"), ("off", "on"), ("on", "off"), ("on", "on")]


@pytest.fixture(autouse=True)
def interrupts_as_before():
    """The script takes Ctrl-C and uncaught errors over."""
    handler, hook = signal.getsignal(signal.SIGINT), sys.excepthook
    yield
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGINT, handler)
    sys.excepthook = hook


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
        ("--arms foo", "--arms: 'foo' is no arm; the nearest is "),
        ("--arms shielded adaptive-penaltie", "'adaptive-penaltie' is no arm; the nearest is adaptive-penalty, --list"),
        ("--arms shielded shielded", "--arms shielded shielded is out of range: expected one or more different"),
        ("--cost-limit 2", "--cost-limit 2.0 is out of range: expected 0 to 1"),
        ("--target-intervention -1", "--target-intervention -1.0 is out of range: expected a number >= 0"),
        ("--removal-checks -1", "--removal-checks -1 is out of range: expected at least 0"),
        ("--total-timesteps 0", "--total-timesteps 0 is out of range: expected at least 1"),
        ("--total-timesteps many", "error: --total-timesteps many: expected a whole number (see train.py --help)"),
        ("--total-timesteps 1e4", "error: --total-timesteps 1e4: expected a whole number"),
        ("--ego.mu wide", "error: --ego.mu wide: expected a number"),
        (
            "--env-id highway-fast",
            "does not support env_id = 'highway-fast'; expected one of highway-v0, highway-fast-v0",
        ),
        ("--seeds", "--seeds is out of range: expected different whole numbers, 0 to 2**32 - 1"),
        ("--seeds 1 1", "--seeds 1 1 is out of range: expected different whole numbers"),
        ("--seeds -1", "--seeds -1 is out of range: expected different whole numbers"),
        (
            "--preset fast",
            "--preset fast is out of range: expected one of auto, simulator, intersection, parking, slides, ad-rss",
        ),
        ("--rules.anticipation -1", "--rules.anticipation = -1.0: expected a finite number >= 0"),
        ("--rules.heading-bound 2", "--rules.heading_bound = 2.0: expected a finite number >= 0 and <= 1"),
        ("--rules.memory maybe", "--rules.memory"),
        ("--examine some", "examine = 'some': expected one of"),
        ("--filter abs", "filter = 'abs': expected one of rss"),
        ("--traffic compliant", "the fast engine does not support traffic = 'compliant'"),
        ("--tracker paper", "--tracker paper is out of range: expected one of tensorboard, wandb, mlflow"),
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
        ("--env-id intersection-multi-agent-v0 --backend highway-env", "actions Tuple(Discrete(3), Discrete(3)); "),
        ("--ego.mu -1", "--ego: mu = -1.0 is out of range: expected a finite number >= 0"),
        ("--other.a-min-brake 7", "--other: a_min_brake = 7 is out of range: expected at most a_max_brake = 6"),
        ("--ego.response-time 0.01", "response_time = 0.01 s of the ego is shorter than one simulation frame"),
        ("--no-such-option", "--no-such-option"),
        ("--name aux", "--name aux is out of range: expected letters, digits and . , = + - _, such as _aux"),
        ("--name a:b", "--name a:b is out of range: expected letters, digits and . , = + - _, such as a-b"),
        (
            "--config.lane-count 4",
            "config.lane_count is not known to highway-fast-v0; the nearest is config.lanes_count",
        ),
        ("--config.lanes-count four", "config.lanes_count = 'four': expected a whole number >= 1"),
        ("--config.lanes-count 0", "config.lanes_count = 0: expected a whole number >= 1"),
        ("--config.vehicles-density 0", "config.vehicles_density = 0: expected a number > 0"),
        ("--config.duration -5", "config.duration = -5: expected a number > 0"),
        ("--config.initial-lane-id 9", "config.initial_lane_id = 9: expected None or a whole number from -3 to 2"),
        (
            "--config.observation.vehicle-count 8",
            "config.observation.vehicle_count is not known; the nearest is config.observation.vehicles_count",
        ),
        ("--config.action.type ContinuousAction", "config.action = {'type': 'ContinuousAction'}: not possible in"),
        ("--config.duration.seconds 3", "--config.duration.seconds: config.duration = 30 has no keys of its own"),
        ("--config.lanes-count", "--config.lanes-count: expected a key and a value"),
        ("--hyperparameters.gamma", "--hyperparameters.gamma: expected a key and a value, as in --hyperparameters"),
        ("--hyperparameters.gamma 2", "arm unshielded: hyperparameters.gamma = 2: expected a number >= 0 and <= 1"),
        ("--hyperparameters.gama 0.9", "arm unshielded: hyperparameters.gama: PPO takes batch_size, "),
        (
            "--arms shielded dqn --hyperparameters.clip-range 0.1",
            "arm dqn: hyperparameters.clip_range: SinglyDQN takes batch_size, ",
        ),
        ("--config nowhere.json", "--config: nowhere.json: no such file or directory"),
        ("--config [1]", "--config: [1]: expected a file .json, .toml, .yaml or .yml, or JSON itself"),
    ],
)
def test_bad_input_ends_in_one_line_and_exit_code_2(arguments, message, monkeypatch, capsys, tmp_path):
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, *arguments.split(), "--runs-dir", str(tmp_path))
    printed = capsys.readouterr().err.strip().splitlines()
    lines = [line for line in printed if "Warning" not in line and not line.startswith("compiling")]
    assert stop.value.code == 2
    assert len(lines) == 1
    assert lines[0].startswith("train.py: error: ")
    assert message in lines[0]
    assert not list(tmp_path.iterdir())


def test_a_folder_of_runs_that_is_none_is_named_by_its_option(monkeypatch, capsys, tmp_path):
    (tmp_path / "road.json").write_text("{}")
    for taken in ("road.json", "road.json/below"):
        with pytest.raises(SystemExit) as stop:
            call(monkeypatch, "--runs-dir", str(tmp_path / taken))
        assert stop.value.code == 2
        assert f"train.py: error: --runs-dir {tmp_path / taken}: expected a folder; {tmp_path}/road.json is a file" in (
            capsys.readouterr().err
        )


def test_help_shows_examples_and_every_option(monkeypatch, capsys):
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "--help")
    text = capsys.readouterr().out
    assert not stop.value.code
    assert "python train.py --resume" in text
    for option in fields(Config):
        assert f"--{option.name.replace('_', '-')}" in text
    assert [option.name for option in fields(Overrides)] == list(RSSParams._fields)


def test_the_folder_is_named_after_the_options_that_are_not_defaults():
    assert run_name(Config()) == "highway-fast-v0"
    assert run_name(Config(runs_dir=Path("elsewhere"), resume=True)) == "highway-fast-v0"
    chosen = Config(env_id="merge-v0", seeds=(1, 2), ego=Overrides(response_time=0.5))
    assert run_name(chosen) == "merge-v0,seeds=1-2,ego.response_time=0.5"
    configured = Config(
        config={"lanes_count": 4, "reward_speed_range": [20, 30], "observation": {"type": "Kinematics"}}
    )
    name = "highway-fast-v0,config.lanes_count=4,config.reward_speed_range=20-30,config.observation.type=Kinematics"
    assert run_name(configured) == name
    crossing = Config(env_id="intersection-v0", entry="priority", intent="known", waiting="anywhere")
    assert run_name(crossing) == "intersection-v0,entry=priority,intent=known,waiting=anywhere"


@pytest.mark.parametrize(
    ("env_id", "name"),
    [("highway-fast-v0", "simulator"), ("roundabout-v0", "simulator"), ("intersection-v0", "intersection")],
)
def test_the_environment_chooses_the_preset_and_single_parameters_replace_its_values(env_id, name):
    preset = PRESETS[name]
    assert preset_name(Config(env_id=env_id)) == name
    assert preset_name(Config(env_id=env_id, preset="slides")) == "slides"
    wobbly = resolve(Config(env_id=env_id, ego=Overrides(mu=0.5)))
    assert wobbly == preset._replace(ego=preset.ego._replace(mu=0.5))


def test_given_parameters_replace_the_presets_and_nothing_else():
    preset = PRESETS["simulator"]
    assert resolve(Config()) == preset
    braking = resolve(Config(other=Overrides(a_min_brake=4.0)))
    assert braking.other == preset.other._replace(a_min_brake=4.0)
    assert (braking.ego, braking.per_frame) == (preset.ego, True)
    slow = resolve(Config(ego=Overrides(response_time=0.5)))
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
    named = output.split(f"Everything is in {folder}: ")[1].split("\n")[0].split(", ")
    assert "learning_curve.png" in named and all((folder / name).exists() for name in named)


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
        "removal.png",
        "removal.pdf",
        "pages",
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
    ppo = config["config"]["ppo"]
    assert (ppo["gamma"], ppo["gae_lambda"], ppo["n_epochs"], ppo["clip_range"]) == (0.9, 0.95, 10, 0.2)
    assert ppo["n_steps"] * 2 == ppo["batch_size"] * 8
    assert config["config"]["environment"]["lanes_count"] == 3
    assert config["config"]["test_seeds"] == {"first": 10**9, "last": 10**9 + 2}
    for name in ("blame", "learning_curve"):
        with Image.open(folder / f"{name}.png") as image:
            image.load()


def test_every_cell_of_a_run_plays_the_same_seeds(finished):
    folder, _ = finished
    episodes = pd.read_csv(folder / "episodes.csv")
    seeds = {cell: list(rows["seed"]) for cell, rows in episodes.groupby(["train", "test"], sort=False)}
    assert list(seeds) == CELLS
    assert list(seeds.values()) == [[10**9, 10**9 + 1, 10**9 + 2]] * 4
    assert (episodes.loc[episodes["test"] == "off", "override_share"] == 0).all()
    cells = json.loads((folder / "results.json").read_text())["cells"]
    # here nothing can succeed, sooner or later, and nobody asked for risk and measures
    assert {cell["metric"] for cell in cells} == {m.name for m in METRICS} & set(with_outcomes(episodes).columns)
    assert len(cells) == 4 * len({cell["metric"] for cell in cells}) > 4 * 15
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
    episodes = pd.read_csv(path)
    episodes.loc[episodes["seed"] == episode, "length"] += 1
    episodes.to_csv(path, index=False)
    report = [sys.executable, "-m", "rss_shield.eval.report", str(folder)]
    output = subprocess.run(report, cwd=SCRIPT.parent, text=True, capture_output=True, check=True).stdout
    assert "3 of 4 test episodes agree" in " ".join(output.split())
    assert f"DISAGREES: train on, test on, training seed 0, episode {episode}: length" in " ".join(output.split())


def test_the_original_simulator_is_one_flag_away(tmp_path):
    options = ["--backend", "highway-env", "--total-timesteps", "16", "--eval-episodes", "1", "--name", "original"]
    process = start(tmp_path, *options)
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    assert "Replayed" not in output
    episodes = pd.read_csv(tmp_path / "original" / "episodes.csv")
    assert list(zip(episodes["train"], episodes["test"], strict=True)) == CELLS
    assert not (tmp_path / "original" / "replays").exists()


def test_a_run_at_a_junction_says_who_got_across_and_how_the_ego_behaved(tmp_path):
    process = start(tmp_path, "--env-id", "intersection-v0", "--intent", "known", "--name", "junction")
    output, _ = process.communicate(timeout=600)
    assert process.returncode == 0, output
    title = (
        "RSS preset intersection, cautious entry, known intent, waiting at the line, 64 timesteps per arm, no interv"
    )
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
        process = start(tmp_path, "--name", "killed", "--resume-or-start")
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


def test_a_run_with_a_configuration_trains_tests_and_replays_with_it(tmp_path):
    (tmp_path / "road.json").write_text('{"lanes_count": 2, "vehicles_count": 8, "duration": 6}')
    options = [
        "--config",
        str(tmp_path / "road.json"),
        "--config.lanes-count",
        "4",
        "--config.observation.vehicles-count=9",
    ]
    learners = ["--hyperparameters", '{"gamma": 0.8}', "--hyperparameters.learning-rate", "3e-4"]
    process = start(tmp_path, *options, *learners, "--name", "wide", "--intervention-penalty", "0.25")
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    assert "4 of 4 test episodes agree" in " ".join(output.split())
    folder = tmp_path / "wide"
    config = json.loads((folder / "config.json").read_text())["config"]
    assert config["config"] == {
        "lanes_count": 4,
        "vehicles_count": 8,
        "duration": 6,
        "observation": {"type": "Kinematics", "vehicles_count": 9},
    }
    assert [config["environment"][key] for key in ("lanes_count", "duration", "policy_frequency")] == [4, 6, 1]
    model = PPO.load(folder / "shielded-seed0" / "model.zip")
    assert (model.gamma, model.learning_rate) == (config["ppo"]["gamma"], config["ppo"]["learning_rate"]) == (0.8, 3e-4)
    assert pd.read_csv(folder / "episodes.csv")["length"].max() == 6
    assert pd.read_csv(folder / "unshielded-seed0" / "learning_curve.csv")["length"].max() <= 6
    title = (folder / "table.md").read_text().splitlines()[0]
    for part in (
        "config.lanes_count 4",
        "config.observation.vehicles_count 9",
        "intervention penalty 0.25 in training",
    ):
        assert part in title
    again, _ = start(tmp_path, "--name", "wide", "--resume").communicate(timeout=300)
    assert f"Everything is in {folder}" in again


def test_the_original_simulator_takes_the_same_configuration(tmp_path):
    options = (
        "--backend highway-env --total-timesteps 16 --eval-episodes 1 --name few --config.duration 4 --arms shielded"
    )
    process = start(tmp_path, *options.split(), "--config", '{"vehicles_count": 5}')
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output
    assert pd.read_csv(tmp_path / "few" / "episodes.csv")["length"].max() <= 4


MILESTONES = {
    "while it imports": lambda folder: True,
    "while it is set up": lambda folder: (folder.parent / "a moment later").exists(),
    "when workers start": lambda folder: (folder / "config.json").exists(),
    "in training": lambda folder: len(list(folder.glob("*/learning_curve.csv"))) == 2,
    "in testing": lambda folder: len(list(folder.glob("*/model.zip"))) == 2,
}


@pytest.mark.parametrize(
    ("milestone", "workers"), [*((milestone, 2) for milestone in MILESTONES), ("in training", 1), ("in testing", 1)]
)
def test_two_interrupts_at_once_end_a_run_within_seconds_and_it_can_be_resumed(milestone, workers, tmp_path):
    runs, folder = tmp_path / "runs", tmp_path / "runs" / "stopped"
    small = ["--name", "stopped", "--resume-or-start", "--workers", str(workers), "--runs-dir", str(runs)]
    options = ["--total-timesteps", "200000" if milestone == "in training" else "64", "--eval-episodes"]
    options += ["100000" if milestone == "in testing" else "3"]
    command = [sys.executable, str(SCRIPT), *TINY, *small, *options]
    process = subprocess.Popen(
        command, cwd=SCRIPT.parent, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )
    time.sleep(1.5)  # the interpreter itself has started
    if milestone == "while it is set up":
        time.sleep(4)
        (runs / "a moment later").mkdir(parents=True)
    while not MILESTONES[milestone](folder):
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.02)
    began = time.perf_counter()
    for _ in range(2):
        os.killpg(process.pid, signal.SIGINT)
    process.wait(timeout=60)
    assert time.perf_counter() - began < 10
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 130, output
    assert output.count("train.py: stopping; nothing that is finished is lost") == 1
    assert "Traceback" not in output
    assert "leaked" not in output
    if milestone == "in testing":
        finished = {path: path.stat().st_mtime_ns for path in folder.glob("*/model.zip")}
        record = json.loads((folder / "config.json").read_text())
        record["config"] |= {"eval_episodes": 3, "test_seeds": {"first": 10**9, "last": 10**9 + 2}}
        (folder / "config.json").write_text(json.dumps(record))
        again, _ = start(runs, "--name", "stopped", "--resume").communicate(timeout=300)
        assert f"Everything is in {folder}" in again
        assert {path: path.stat().st_mtime_ns for path in finished} == finished


def test_to_resume_nothing_is_refused_unless_it_may_start(tmp_path, monkeypatch, capsys):
    there = ["--name", "never", "--runs-dir", str(tmp_path)]
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "--resume", *there)
    assert stop.value.code == 2 and not list(tmp_path.iterdir())
    said = capsys.readouterr().err.strip()
    assert said.startswith(f"train.py: error: --resume: there is no run in {tmp_path / 'never'};")
    config, _ = started(["--resume-or-start", *there])
    assert config.resume and not capsys.readouterr().err


@pytest.mark.parametrize("seeds", ["", "a", "0 1.5"])
def test_seeds_that_are_none_are_refused_by_the_command_that_was_called(seeds, capsys):
    with pytest.raises(SystemExit):
        started(["--seeds", *seeds.split(), "--n-envs", "2"])
    expected = "is out of range: expected different whole numbers, 0 to 2**32 - 1, at least one"
    assert capsys.readouterr().err == f"rss-shield train: error: {f'--seeds {seeds}'.strip()} {expected}\n"


NAMED = [
    ("highway_env:highway-v0", "highway_env-highway-v0"),
    ('a/b\\c*d?e"f<g>h|i', "a-b-c-d-e-f-g-h-i"),
    ("..hidden..", "hidden"),
    ("NUL", "_NUL"),
    ("com1.old", "_com1.old"),
    ("merge-v0,seeds=1-2", "merge-v0,seeds=1-2"),
    ("mein früher versuch", "mein-früher-versuch"),
    ("pru\u0308fung", "prüfung"),  # as macOS spells it
]


@pytest.mark.parametrize(("text", "name"), NAMED)
def test_a_name_is_one_that_every_system_takes(text, name):
    assert valid_name(text) == name


def test_long_names_are_shortened_and_stay_different():
    long = [valid_name("road," + ",".join(f"option{i}={i + last}" for i in range(40))) for last in range(3)]
    assert len(set(long)) == 3
    assert all(len(name) == 120 for name in long)


def test_a_taken_folder_is_refused(finished, monkeypatch, capsys):
    folder, _ = finished
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, *TINY, "--runs-dir", str(folder.parent), "--name", "whole")
    assert stop.value.code == 2
    assert "exists; --resume goes on with it, --overwrite starts it anew" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "contradiction"),
    [
        ("--preset slides", "--preset slides contradicts simulator"),
        ("--seeds 0 1", "--seeds 0 1 contradicts 0"),
        ("--ego.mu 0.3", "--ego.mu 0.3 contradicts (not given)"),
        ("--config.lanes-count 4", "--config.lanes-count 4 contradicts (not given)"),
        ("--n-envs 3 --intent known", "--intent known contradicts any, --n-envs 3 contradicts 2"),
        ("--intervention-penalty 0.5", "--intervention-penalty 0.5 contradicts 0.0"),
    ],
)
def test_resuming_with_other_options_is_refused_naming_them(options, contradiction, finished, monkeypatch, capsys):
    folder, _ = finished
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, "--runs-dir", str(folder.parent), "--name", "whole", "--resume", *options.split())
    assert stop.value.code == 2
    printed = capsys.readouterr().err
    assert f"{contradiction}, with which the run in {folder} was started" in printed
    assert len([line for line in printed.splitlines() if "Warning" not in line and line.strip()]) == 1


@pytest.mark.parametrize("options", [" ".join(TINY), "", "--seeds 0", "--preset auto --n-envs 2 --workers 1"])
def test_resuming_a_finished_run_with_its_options_or_none_repeats_only_the_report(
    options, finished, monkeypatch, capsys
):
    folder, _ = finished
    before = (folder / "table.csv").read_bytes()
    began = time.perf_counter()
    call(monkeypatch, *options.split(), "--runs-dir", str(folder.parent), "--name", "whole", "--resume")
    assert time.perf_counter() - began < 20
    assert "95 % interval" in " ".join(capsys.readouterr().out.split())
    assert (folder / "table.csv").read_bytes() == before
