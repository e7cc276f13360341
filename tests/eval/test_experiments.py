"""Experiments as files: what is understood, what is refused, and which tasks come of it."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from places import ROOT

from rss_shield import make
from rss_shield.cli import main
from rss_shield.envs.options import default_preset
from rss_shield.eval.runs.experiment import Range, experiment_of, read_experiment
from rss_shield.eval.runs.names import flat, nested
from rss_shield.eval.runs.store import Store
from rss_shield.eval.runs.tasks import Task, key_of, samples_of, tasks_of
from rss_shield.eval.suite.setup import setup_of
from rss_shield.eval.suite.sweep import check_tasks, distinct_tasks_of
from rss_shield.shield.params import PRESETS

LEAST = {"name": "x", "policies": ["faster"]}


def test_every_combination_is_a_task():
    experiment = experiment_of(
        LEAST
        | {
            "environments": ["highway-fast-v0", "merge-v0"],
            "policies": ["random", "faster"],
            "seeds": [0, 1],
            "sweep": {"list": {"a": {}, "b": {"shield": "monitor"}}, "grid": {"rules": {"anticipation": [0, 1, 2]}}},
        }
    )
    tasks = tasks_of(experiment)
    assert len(tasks) == len({task.key for task in tasks}) == 2 * 2 * 2 * 2 * 3
    assert tasks[0].config["options"] == {"rules.anticipation": 0}
    assert tasks[0].point == {
        "environment": "highway-fast-v0", "policy": "random", "setting": "a", "rules.anticipation": 0
    }  # fmt: skip
    assert tasks[-1].config["options"] == {"shield": "monitor", "rules.anticipation": 2}


@pytest.mark.parametrize("environment", ["highway-fast-v0", "intersection-v0", "parking-parked-v0"])
def test_single_parameters_change_the_table_that_suits_the_environment(environment):
    env = make(environment, shield=None)
    env.close()
    usual = PRESETS[default_preset(env.unwrapped)]
    changed = setup_of(environment, {"ego.mu": usual.ego.mu + 0.01})["params"]
    assert (changed.other, changed.ego.v_cap) == (usual.other, usual.ego.v_cap)


def test_the_key_is_that_of_the_configuration_however_it_is_written():
    assert key_of({"a": 1, "b": {"c": (1, 2), "d": 0.1}}) == key_of({"b": {"d": 0.1, "c": [1, 2]}, "a": 1})
    assert key_of({"a": 1}) != key_of({"a": 1.5})
    assert len(key_of({"a": 1})) == 16


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"polices": ["faster"]}, "the experiment has an unknown key 'polices'; the nearest is 'policies'"),
        ({"sweep": {"gird": {}}}, "sweep has an unknown key 'gird'; the nearest is 'grid'"),
        ({"tests": {"episode": 3}}, "tests has an unknown key 'episode'; the nearest is 'episodes'"),
        ({"tests": {"episodes": 0}}, "tests.episodes = 0: expected a whole number >= 1"),
        ({"arms": ["shielded"]}, "either arms"),
        ({"policies": []}, "either arms"),
        ({"about": 3}, "about = 3: expected a text"),
        ({"sweep": None}, "sweep = None: expected list, grid"),
        ({"seeds": [0, "1"]}, "seeds = '1': expected a whole number >= 0"),
        ({"seeds": [0, 0]}, "seeds = [0, 0]: something is named twice"),
        ({"environments": "merge-v0"}, "environments = 'merge-v0': expected a list"),
        ({"policies": ["faster", "faster"]}, "something is named twice"),
        ({"sweep": {"grid": {"rules.memory": True}}}, "sweep.grid.rules.memory = True: expected a list of values"),
        ({"sweep": {"random": {"samples": 3}}}, "sweep.random.over: expected options"),
        ({"sweep": {"random": {"over": {"ego.mu": {"low": 1, "high": 0}}}}}, "expected low < high"),
        ({"sweep": {"random": {"over": {"ego.mu": {"low": 0, "high": 1, "log": True}}}}}, "with log both above 0"),
        ({"sweep": {"optuna": {"over": {"a": [1]}, "objectives": {"return": "up"}}}}, "expected minimize or maximize"),
        ({"sweep": {"random": {"over": {"a": [1]}}, "optuna": {"over": {"a": [1]}}}}, "expected one of them"),
    ],
)
def test_what_is_wrong_is_named(changed, message):
    with pytest.raises(ValueError) as error:
        experiment_of(LEAST | changed)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rule.memory": False}, "options has an unknown key 'rule'; the nearest is 'rules'"),
        ({"rules.memroy": False}, "rules has an unknown key 'memroy'; the nearest is 'memory'"),
        ({"ego.respons_time": 1}, "ego has an unknown key 'respons_time'; the nearest is 'response_time'"),
        ({"ego.response_time": -1}, "ego: response_time = -1"),
        ({"preset": "slide"}, "preset = 'slide': expected one of"),
        ({"others": "rammers"}, "others = 'rammers': expected one of stock, reckless"),
        ({"entry": "bold"}, "entry = 'bold': expected one of"),
        ({"config.lane_count": 3}, "config.lane_count is not known to highway-fast-v0; the nearest is config.lanes_co"),
        ({"judge.rule.memory": True}, "judge has an unknown key 'rule'; the nearest is 'rules'"),
    ],
)  # fmt: skip
def test_options_are_refused_before_anything_runs(options, message):
    with pytest.raises(ValueError) as error:
        check_tasks(tasks_of(experiment_of(LEAST | {"options": options})))
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"environments": ["highway-fat-v0"]}, "no environment 'highway-fat-v0'; the nearest is 'highway-fast-v0'"),
        ({"options": {"traffic": "compliant"}}, "expected backend = 'highway-env'"),
        ({"policies": ["continuous"]}, "policy = 'continuous': not for the actions Discrete(5)"),
        ({"policies": [], "arms": ["shielded"], "options": {"traffic": "compliant"}}, "expected backend = 'highway-e"),
    ],
)
def test_what_no_task_could_begin_is_refused_before_any(changed, message):
    with pytest.raises(ValueError) as error:
        check_tasks(tasks_of(experiment_of(LEAST | changed)))
    assert message in str(error.value)


@pytest.mark.parametrize("workers", [0, -1, 257])
def test_workers_are_refused_before_any_work(tmp_path, monkeypatch, capsys, workers):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "e.yaml").write_text("policies: [idle]\n")
    with pytest.raises(SystemExit) as stop:
        main(["sweep", "e.yaml", "--workers", str(workers)])
    said = capsys.readouterr()
    assert stop.value.code == 2 and not said.out
    assert said.err == f"rss-shield sweep: error: --workers {workers} is out of range: expected 1 to 256\n"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--runs-dir e.yaml", "--runs-dir e.yaml: expected a folder; e.yaml is a file"),
        ("--episodes 1e4", "--episodes 1e4: expected a whole number (see rss-shield sweep --help)"),
    ],
)
def test_options_of_a_sweep_are_refused_by_name(tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "e.yaml").write_text("policies: [idle]\n")
    with pytest.raises(SystemExit) as stop:
        main(["sweep", "e.yaml", *options.split()])
    assert stop.value.code == 2 and capsys.readouterr().err == f"rss-shield sweep: error: {said}\n"


def test_a_task_that_fails_says_so_in_one_line_and_is_done_again(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "broken_driver.py").write_text("def drive(observations):\n    return sped\n")
    (tmp_path / "e.yaml").write_text("policies: ['broken_driver:drive']\ntests: {episodes: 1}\n")
    with pytest.raises(SystemExit) as stop:
        main(["sweep", "e.yaml"])
    said, (path,) = capsys.readouterr(), (tmp_path / "runs" / "e" / "tasks").glob("*/error.txt")
    assert stop.value.code == 1 and "Everything is in" not in said.out
    (line,) = [line for line in said.err.splitlines() if line.startswith("rss-shield sweep: ")]
    assert "broken_driver:drive, seed 0 failed: " in line and "NameError: name 'sped' is not defined" in line
    assert path.parent.name in line and "Traceback" in path.read_text()
    (failed,) = json.loads((tmp_path / "runs" / "e" / "failed.json").read_text())
    assert (
        failed
        == "highway-fast-v0, broken_driver:drive, seed 0 (" + line.split("failed: ")[1].split(" (all of")[0] + ")"
    )
    with pytest.raises(SystemExit):
        main(["sweep", "e.yaml"])  # what failed is not taken for done


@pytest.mark.parametrize(
    ("text", "tasks", "said"),
    [
        (
            "axes: {safety: crash, performance: success}",
            1,
            "metric = 'success': episodes on highway-fast-v0 with these",
        ),
        ("axes: {performance: own_return}\nseeds: [0, 1, 2]", 1, "metric = 'own_return': episodes on highway-fast-v0"),
        (
            "sweep: {optuna: {trials: 2, over: {ego.response_time: [0.5, 1.0]}, objectives: {retrun: maximize}}}",
            0,
            "metric = 'retrun': expected one of crash,",
        ),
    ],
)
def test_a_metric_that_the_episodes_have_not_is_said_after_the_first_and_not_after_the_last(
    tmp_path, monkeypatch, capsys, text, tasks, said
):
    monkeypatch.chdir(tmp_path)
    options = "options: {config.duration: 3}\ntests: {episodes: 1}"
    (tmp_path / "e.yaml").write_text(f"policies: [idle, slower]\n{options}\n{text}\n")
    with pytest.raises(SystemExit) as stop:
        main(["sweep", "e.yaml"])
    assert stop.value.code == 2 and said in capsys.readouterr().err
    assert len(list((tmp_path / "runs").glob("e/tasks/*/episodes.csv"))) == tasks


def test_who_learns_nothing_is_tested_once_whatever_the_training_seeds(tmp_path, monkeypatch):
    """Ten copies of the same episodes would make intervals far too narrow."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "sitting_driver.py").write_text("def drive(observations):\n    return None\n")
    arms = ["lazy", "sitting_driver:drive", "shielded"]
    tasks = distinct_tasks_of(experiment_of({"name": "x", "arms": arms, "seeds": [3, 4, 5]}))
    seeds = {arm: [task.config["seed"] for task in tasks if task.config["arm"] == arm] for arm in arms}
    assert seeds == {"lazy": [3], "sitting_driver:drive": [3], "shielded": [3, 4, 5]}


def test_an_option_is_set_once():
    sweep = {"list": {"a": {"rules.memory": False}}, "grid": {"rules.memory": [True]}}
    with pytest.raises(ValueError, match=r"rules.memory is in sweep.list and varied as well"):
        tasks_of(experiment_of(LEAST | {"sweep": sweep}))


def test_samples_are_in_their_ranges_and_the_same_again():
    over = {"ego": {"response_time": {"low": 0.1, "high": 2.0, "log": True}}, "entry": ["cautious", "priority"]}
    experiment = experiment_of(LEAST | {"sweep": {"random": {"samples": 50, "seed": 3, "over": over}}})
    assert experiment.drawn.over["ego.response_time"] == Range(0.1, 2.0, True)
    samples = list(samples_of(experiment.drawn))
    assert samples == list(samples_of(experiment.drawn)) and len(samples) == 50
    times = [sample["ego.response_time"] for sample in samples]
    assert all(0.1 <= time <= 2.0 for time in times)
    # half of a logarithmic range lies below the geometric mean of its ends, 0.447
    assert 15 <= sum(time < 0.447 for time in times) <= 35
    assert {sample["entry"] for sample in samples} == {"cautious", "priority"}


@pytest.mark.parametrize(
    ("given", "name"),
    [("mein versuch (2)", "mein-versuch-2"), ("mein/versuch: 2", "mein-versuch-2"), ("größer 2.1", "größer-2.1")],
)
def test_a_name_is_made_one_that_a_folder_may_have(given, name):
    assert experiment_of(LEAST | {"name": given}).name == name


def test_a_name_of_no_letters_is_refused():
    with pytest.raises(ValueError, match=r"name = ' - ': expected letters, digits and"):
        experiment_of(LEAST | {"name": " - "})


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("e.yaml", "policies: [idle]\nsweep: {grid: {rules.memory: [true, false]}}\n"),
        ("e.toml", 'policies = ["idle"]\n[sweep.grid]\n"rules.memory" = [true, false]\n'),
        ("e.json", '{"policies": ["idle"], "sweep": {"grid": {"rules": {"memory": [true, false]}}}}'),
    ],
)
def test_yaml_toml_and_json_say_the_same(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    experiment = read_experiment(tmp_path / name)
    assert experiment.name == "e" and experiment.grid == {"rules.memory": (True, False)}


def test_a_key_is_there_once(tmp_path):
    (tmp_path / "twice.yaml").write_text("policies: [idle]\nseeds: [0]\nseeds: [1]\n")
    with pytest.raises(ValueError, match=r"twice\.yaml.*the key 'seeds' is there twice"):
        read_experiment(tmp_path / "twice.yaml")


def test_an_error_names_the_file(tmp_path):
    (tmp_path / "bad.yaml").write_text("policys: [idle]\n")
    with pytest.raises(ValueError, match=r"bad\.yaml: the experiment has an unknown key 'policys'"):
        read_experiment(tmp_path / "bad.yaml")


def test_a_file_that_is_not_there_is_named_as_people_name_it(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["sweep", str(tmp_path / "none.yaml")])
    assert capsys.readouterr().err.endswith("none.yaml: no such file or directory\n")


NAMES = st.text("abc", min_size=1, max_size=2)


@given(st.recursive(st.integers(), lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=3), max_leaves=8))
def test_flat_names_lead_back(values):
    if isinstance(values, dict):
        assert nested(flat(values)) == values


@pytest.mark.parametrize("values", [{"a": 1, "a.b": 2}, {"a.b": 2, "a": 1}])
def test_a_value_has_no_keys_of_its_own(values):
    with pytest.raises(ValueError, match="a"):
        nested(values)


def test_a_task_is_there_with_all_its_files_or_not_at_all(tmp_path):
    store, task = Store(tmp_path), Task({"value": 1}, {})
    assert not store.has(task)
    store.put(task, {"a.csv": b"x", "b.csv": b"y"})
    assert store.has(task) and (store.path(task) / "b.csv").read_bytes() == b"y"
    store.put(task, {"a.csv": b"another"})  # it is there: nothing happens
    assert (store.path(task) / "a.csv").read_bytes() == b"x"
    assert json.loads((store.path(task) / "task.json").read_text()) == {"value": 1}
    assert [path.name for path in tmp_path.iterdir()] == [task.key]


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((ROOT / "experiments").glob("*.*")), ids=lambda path: path.name)
def test_the_experiments_of_the_documentation_can_be_run(path):
    experiment = read_experiment(path)
    if experiment.policies and experiment.drawn is None:
        check_tasks(tasks_of(experiment))
