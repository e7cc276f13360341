"""Tasks in this process, in several, and on Ray: the same results, whoever is killed on the way."""

import importlib.util
from functools import partial

import pytest
from killing import double, dying, task_or_die
from places import ROOT

from rss_shield.eval.runs.backends import run_tasks
from rss_shield.eval.runs.experiment import experiment_of, read_experiment
from rss_shield.eval.runs.tasks import Task
from rss_shield.eval.suite.sweep import do_task, sweep

NEEDS_RAY = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed")
PARALLEL = [
    pytest.param("local", id="two processes"),
    pytest.param("ray", id="ray", marks=NEEDS_RAY),
]


@pytest.fixture(autouse=True)
def _workers_find_the_tests(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{ROOT / 'tests' / 'eval'}")
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")


def tasks(*values):
    return [Task({"value": value}, {}) for value in values]


def outcomes(work, values, **options):
    return {outcome.task.config["value"]: outcome for outcome in run_tasks(tasks(*values), work, **options)}


def test_an_unknown_backend_is_refused():
    with pytest.raises(ValueError, match="backend = 'slurm': expected one of local, ray"):
        list(run_tasks(tasks(1), double, backend="slurm"))


@pytest.mark.parametrize(("backend", "workers"), [("local", 1), ("local", 2)])
def test_a_task_that_fails_costs_itself_only(backend, workers):
    done = outcomes(double, [1, -2, 3], backend=backend, workers=workers)
    assert done[1].files == {"double.txt": b"2"} and done[3].files == {"double.txt": b"6"}
    assert done[-2].files is None and "ArithmeticError: value = -2" in done[-2].error


@pytest.mark.parametrize("backend", PARALLEL)
def test_a_worker_that_is_killed_is_replaced_and_its_task_done_again(tmp_path, backend):
    done = outcomes(dying(tmp_path, deadly=3, times=1), range(6), backend=backend, workers=2)
    assert {value: outcome.files["double.txt"] for value, outcome in done.items()} == {
        value: str(2 * value).encode() for value in range(6)
    }
    assert len(list(tmp_path.iterdir())) == 1


def test_a_task_that_kills_every_worker_is_given_up(tmp_path):
    done = outcomes(dying(tmp_path, deadly=0, times=9), range(4), workers=2)
    assert done[0].files is None and "killed 3 times" in done[0].error
    assert all(done[value].files for value in (1, 2, 3))
    assert len(list(tmp_path.iterdir())) == 3


def results(folder):
    """All that a sweep writes, but for when and from which code."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "experiment.json")
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The 48 tasks in one process."""
    folder = tmp_path_factory.mktemp("alone")
    assert not sweep(read_experiment(ROOT / "experiments" / "smoke.yaml"), folder).failed
    return results(folder)


@pytest.mark.parametrize("backend", PARALLEL)
def test_48_tasks_give_the_same_wherever_they_run_though_a_worker_is_killed(tmp_path, alone, backend):
    experiment = read_experiment(ROOT / "experiments" / "smoke.yaml")
    (tmp_path / "deaths").mkdir()
    work = partial(task_or_die, str(tmp_path / "deaths"), "faster")
    done = sweep(experiment, tmp_path / "sweep", work, backend=backend, workers=2)
    assert len(done.tasks) == 48 and not done.failed
    assert len(list((tmp_path / "deaths").iterdir())) == 1
    assert results(tmp_path / "sweep") == alone


TINY = {
    "name": "tiny",
    "policies": ["faster"],
    "tests": {"episodes": 2},
    "options": {"config": {"vehicles_count": 4, "duration": 3}},
}


def test_a_sweep_goes_on_where_it_was_stopped(tmp_path):
    ran = []

    def counted(config):
        ran.append(config["options"]["rules.anticipation"])
        if len(ran) == 2:
            raise KeyboardInterrupt
        return do_task(config)

    experiment = experiment_of(TINY | {"sweep": {"grid": {"rules.anticipation": [0, 1, 2]}}})
    with pytest.raises(KeyboardInterrupt):
        sweep(experiment, tmp_path, counted)
    assert not sweep(experiment, tmp_path, counted).failed
    assert ran == [0, 1, 1, 2]
    before = results(tmp_path)
    sweep(experiment, tmp_path, counted)
    assert len(ran) == 4 and results(tmp_path) == before


def test_optuna_chooses_the_same_again_and_runs_nothing_twice(tmp_path):
    pytest.importorskip("optuna")
    ran = []

    def counted(config):
        ran.append(config["options"]["ego.response_time"])
        return do_task(config)

    space = {"ego": {"response_time": {"low": 0.2, "high": 2.0}}}
    experiment = experiment_of(TINY | {"sweep": {"optuna": {"trials": 5, "batch": 2, "over": space}}})
    done = sweep(experiment, tmp_path, counted)
    assert len(done.tasks) == len(set(ran)) == 5 and all(0.2 <= time <= 2.0 for time in ran)
    again = sweep(experiment, tmp_path, counted)
    assert len(ran) == 5 and [task.key for task in again.tasks] == [task.key for task in done.tasks]


def test_the_table_says_what_came_out(tmp_path):
    experiment = experiment_of(TINY | {"sweep": {"list": {"on": {}, "off": {"shield": "monitor"}}}})
    sweep(experiment, tmp_path)
    table = (tmp_path / "table.md").read_text()
    assert "| setting | ego at fault [%] | return |" in table and "over episodes" in table
    assert (tmp_path / "pareto.png").stat().st_size > 10_000 and (tmp_path / "pareto.pdf").exists()
