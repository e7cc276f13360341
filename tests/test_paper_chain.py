"""`make paper`: its commands, their times, and what its pages say of code, machine and seeds."""

import argparse
import json
from pathlib import Path

import pandas as pd
import pytest

from bench import paper
from bench.campaign import PLANS
from rss_shield.eval.paper import command, sweeps
from rss_shield.eval.provenance import provenance, records_of
from rss_shield.eval.runs.experiment import experiment_of
from rss_shield.eval.runs.points import metric_named
from rss_shield.eval.runs.store import missing_in
from rss_shield.eval.runs.tables import labels_of
from rss_shield.eval.suite.sweep import with_budget

VERSIONS = {
    "python": "3.12.1",
    "platform": "Linux",
    "cpu": "znver4",
    "cores": 2,
    "packages": {"numpy": "2.4.6", "torch": None, "rss-shield": "0.2.0"},
    "git_commit": "0123456789abcdef",
    "git_changes": None,
}
EXPERIMENT = {
    "name": "tables",
    "about": "Two tables.",
    "options": {"config.lanes_count": 2},
    "seeds": [0],
    "tests": {"episodes": 40, "first_seed": 7},
    "safety": "crash",
    "performance": "return",
}


def words(**given):
    defaults = {"plan": "short", "divide": 1, "workers": 2, "runs_dir": Path("runs"), "out": Path("pages")}
    return [paper.as_typed(step) for step in paper.steps_of(argparse.Namespace(**defaults | given))]


@pytest.mark.parametrize("plan", list(PLANS))
def test_every_part_sweep_and_page_is_made_once_and_pages_come_after_what_they_show(plan):
    typed = words(plan=plan)
    for part in PLANS[plan]:
        (trained,) = (i for i, text in enumerate(typed) if f"--parts {part.name} " in text)
        assert trained < len(PLANS[plan])
    page = typed.index(f"python bench/campaign.py --plan {plan} --runs-dir runs --out pages --divide 1 --write "
                       "-- --workers 2 --replay-episodes 0 --no-pages")  # fmt: skip
    assert page == len(PLANS[plan])
    ran = [
        typed.index(f"rss-shield sweep experiments/{name}.yaml --runs-dir runs --workers 2") for name in paper.SWEEPS
    ]
    assert page < min(ran) and max(ran) < typed.index(
        "python bench/ablation.py --episodes 2000 --runs runs --write --out pages"
    )
    assert typed[-1].startswith("rss-shield report runs/highway-fast-v0 runs/intersection-v0 runs/campaign-")
    assert all(f"runs/{name}" in typed[-1] for name in paper.SWEEPS)
    assert len(set(typed)) == len(typed)


def test_a_divided_trial_has_little_of_everything_and_seeds_of_its_own():
    typed = words(divide=1000)
    assert all("--divide 1000" in text for text in typed if "campaign.py" in text)
    assert all("--episodes 2" in text for text in typed if text.startswith("rss-shield sweep"))
    assert [text for text in typed if "--total-timesteps 100 " in f"{text} "] == [
        "rss-shield sweep experiments/intersection.yaml --runs-dir runs --workers 2 --episodes 2 --total-timesteps 100"
    ]
    (compared,) = (text for text in typed if "--env-id highway-fast-v0" in text)
    assert "--total-timesteps 200 " in compared and "--eval-episodes 4" in compared and compared.endswith("--seeds 0 1")


def test_a_trial_never_overwrites_results(tmp_path, monkeypatch, capsys):
    for divide, folder in (("1", paper.ROOT / "docs" / "results"), ("10", tmp_path / "divided-10" / "pages")):
        monkeypatch.setattr("sys.argv", ["paper.py", "--list", "--divide", divide, "--runs-dir", str(tmp_path)])
        paper.main()
        typed = capsys.readouterr().out
        assert f"--write --out {folder}\n" in typed
        assert ("divided" in typed) == (divide != "1")  # nor do its runs count as real ones


def test_times_are_kept_and_a_failure_ends_the_chain(tmp_path):
    times = tmp_path / "times.csv"
    paper.run(paper.Step("nothing", ["-c", "pass"]), times)
    paper.run(paper.Step("nothing again", ["-c", "pass"]), times)
    assert list(pd.read_csv(times)["step"]) == ["nothing", "nothing again"]
    with pytest.raises(SystemExit, match="a failure ended with code 3; the same command goes on"):
        paper.run(paper.Step("a failure", ["-c", "raise SystemExit(3)"]), times)
    assert len(pd.read_csv(times)) == 2


def test_a_page_says_code_machine_and_seeds_once():
    run = {"config": {"seeds": [0, 1, 2], "test_seeds": {"first": 5, "last": 9}}, **VERSIONS}
    other = {"config": {"seeds": [0, 4], "test_seeds": {"first": 5, "last": 9}}, **VERSIONS}
    assert provenance([run, other, run]) == (
        "Code 0123456789ab; Python 3.12.1, numpy 2.4.6; znver4, 2 cores, Linux. "
        "Seeds 0 to 2; test episodes 5 to 9. Seeds 0, 4; test episodes 5 to 9."
    )
    assert provenance([{"config": {"seeds": [0]}}]) == ""
    old = {name: value for name, value in VERSIONS.items() if name != "cores"} | {"git_changes": "abc"}
    assert provenance([old]) == "Code 0123456789ab, changed by hand; Python 3.12.1, numpy 2.4.6; znver4, Linux."


@pytest.fixture
def swept(tmp_path):
    """A finished sweep of two tables: the second returns more, and crashes more."""
    folder = tmp_path / "tables"
    folder.mkdir()
    (folder / "experiment.json").write_text(json.dumps({"experiment": EXPERIMENT, "versions": VERSIONS}))
    rows = [
        {"preset": preset, "metric": metric, "value": value, "low": value, "high": value, "n": 40, "over": "episodes"}
        for preset, numbers in (("slides", (0.0, 20.0)), ("carla", (0.1, 21.0)), ("ad-rss", (0.2, 20.5)))
        for metric, value in zip(("crash", "return"), numbers, strict=True)
    ]
    pd.DataFrame(rows).to_csv(folder / "points.csv", index=False)
    return folder


def test_the_page_of_sweeps_has_the_front_in_words_and_in_a_picture(swept, tmp_path):
    text = sweeps.write([swept], tmp_path / "out").read_text(encoding="utf-8")
    assert (
        "| slides | 0 [0, 0] | 20.0 [20.0, 20.0] | ★ |" in text
        and "| carla | 10 [10, 10] | 21.0 [21.0, 21.0] | ★ |" in text
    )
    assert "| ad-rss | 20 [20, 20] | 20.5 [20.5, 20.5] |  |" in text
    assert "- 2 of 3 points are on the Pareto front" in text
    assert "The best return there is 21.0, with crash 10 % (preset = carla)." in text and "failed" not in text
    assert '40 episodes a row; all with {"config.lanes_count": 2}.' in text
    assert "znver4, 2 cores, Linux. Seeds 0; test episodes from 7, 40 each." in text
    assert (tmp_path / "out" / "sweeps-tables.png").stat().st_size > 10_000
    assert len(records_of([swept, tmp_path])) == 1


def test_pages_of_a_sweep_name_the_tasks_that_failed(swept, tmp_path):
    failed = [
        "merge-v0, mine:drive, seed 0 (NameError: name 'x' is not defined)",
        "merge-v0, mine:drive, seed 1 (killed)",
    ]
    (swept / "failed.json").write_text(json.dumps(failed))
    said = f"2 tasks failed, and the points that need them are missing: {'; '.join(failed)}."
    assert f"- {said}" in sweeps.write([swept], tmp_path / "out").read_text(encoding="utf-8")
    command.write((swept,), tmp_path / "report", "One failed")
    report = (tmp_path / "report" / "report.md").read_text(encoding="utf-8")
    assert said in report and "Safety and performance: crash against return" in report
    (swept / "failed.json").unlink()  # as older ones are
    for key, done in (("a1", True), ("b2", False)):
        (swept / "tasks" / key).mkdir(parents=True)
        (swept / "tasks" / key / "error.txt").write_text("Traceback\n  ...\nValueError: too fast\n")
        if done:
            (swept / "tasks" / key / "task.json").write_text("{}")
    assert missing_in(swept) == "One task failed, and the points that need them are missing: b2 (ValueError: too fast)."


def test_points_that_nearly_coincide_share_a_label():
    points = pd.DataFrame({"preset": ["a", "b", "c"], "crash": [0.1, 0.1, 0.5], "return": [20.0, 20.1, 30.0]})
    labels = labels_of(points, ["preset"], metric_named("return"), metric_named("crash"))
    assert labels == [((20.0, 10.0), "a, b"), ((30.0, 50.0), "c")]


def test_a_sweep_that_is_not_finished_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"expected a finished sweep \(points\.csv\)"):
        sweeps.write([tmp_path], tmp_path)


def test_a_row_says_what_it_stands_for():
    assert sweeps.played(EXPERIMENT) == "40 episodes a row"
    assert sweeps.played(EXPERIMENT | {"seeds": [0, 1, 2]}) == "40 episodes for each of 3 seeds a row"


def test_other_numbers_of_episodes_and_decisions():
    experiment = experiment_of({"name": "x", "policies": ["faster"]})
    assert with_budget(experiment, None) == experiment
    assert with_budget(experiment, 3).tests == {"episodes": 3, "first_seed": 10**9}
    with pytest.raises(ValueError, match="--episodes 0 is out of range"):
        with_budget(experiment, 0)
    with pytest.raises(ValueError, match="--total-timesteps 5: x trains no arms"):
        with_budget(experiment, None, 5)
    trains = experiment_of({"name": "x", "arms": ["dqn"], "options": {"total_timesteps": 7, "n_envs": 2}})
    assert with_budget(trains, None, 5).options == {"total_timesteps": 5, "n_envs": 2}
    with pytest.raises(ValueError, match="--total-timesteps 0 is out of range"):
        with_budget(trains, None, 0)
