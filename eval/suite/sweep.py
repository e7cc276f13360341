"""`rss-shield sweep EXPERIMENT`: run every task of an experiment that is not there yet, and write its points.

    rss-shield sweep experiments/response-times.yaml
    rss-shield sweep experiments/response-times.yaml --workers 2
    rss-shield sweep experiments/presets.yaml --backend ray --address auto

Results are in runs/NAME: tasks/KEY/ per task, points.csv, table.md, pareto.png and .pdf. Stop it whenever you like: the
same command goes on. Results do not depend on backend and workers.
"""

import io
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import pandas as pd
import tyro

from rss_shield.command_line import parsed
from rss_shield.eval.arms import arm_named
from rss_shield.eval.files import folder_for, refuse, to_json, write_json
from rss_shield.eval.metrics import with_outcomes
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.run_folder import versions
from rss_shield.eval.runs.backends import Outcome, Work, run_tasks
from rss_shield.eval.runs.experiment import Experiment, as_words, read_experiment
from rss_shield.eval.runs.points import check_there, metric_named, point_row
from rss_shield.eval.runs.store import ERROR, FAILED, Files, Store, last_line
from rss_shield.eval.runs.tables import write_points
from rss_shield.eval.runs.tasks import Task, samples_of, tasks_of
from rss_shield.eval.suite.policies import check_policy
from rss_shield.eval.suite.scripted import check_environment, check_played, scripted_task

MOST_WORKERS = 256
ROLES = ("environment", "arm", "policy")


@dataclass(frozen=True)
class Arguments:
    """One option a field."""

    experiment: Annotated[Path, tyro.conf.Positional]
    """A YAML, TOML or JSON file; see docs/experiments.md."""
    backend: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster."""
    workers: int = 1
    """How many tasks at a time; on a running cluster (--address) as many as it has room for."""
    address: str = ""
    """Of a running Ray cluster; auto: the one this machine is part of; by default one is started here."""
    episodes: int | None = None
    """Test episodes of each task, in place of the file's: few of them, to try it."""
    total_timesteps: int | None = None
    """Decisions to learn from in each training, likewise."""
    runs_dir: Path = Path("runs")
    """The results are below it, in a folder of the experiment's name."""


def do_task(config: dict[str, Any]) -> Files:
    """Any task, by its configuration."""
    if "arm" not in config:
        return scripted_task(config)
    from rss_shield.eval.suite.trained import trained_task  # PyTorch takes its time

    return trained_task(config)


class Sweep:
    """An experiment under way.

    Args:
      folder: of its results.
      work: does a task.
      run: backend, workers and address of `run_tasks`.
    """

    def __init__(self, experiment: Experiment, folder: Path, work: Work = do_task, **run: Any) -> None:
        self.experiment, self.folder, self.work = experiment, folder, work
        self.run_options = run
        self.store = Store(folder / "tasks")
        self.tasks: list[Task] = []  # all so far, in their order
        self.failed: list[Outcome] = []
        self.checked = False  # that episodes have these:
        self.metrics = metrics_of(experiment)

    def run(self) -> None:
        experiment = self.experiment
        if experiment.drawn is None:
            self.do(distinct_tasks_of(experiment))
        elif experiment.by_optuna:
            self._ask_optuna()
        else:
            self.do([task for sample in samples_of(experiment.drawn) for task in distinct_tasks_of(experiment, sample)])

    def do(self, tasks: list[Task]) -> None:
        """Run what is not there yet."""
        check_tasks(tasks)
        self.tasks += tasks
        self._check_metrics(tasks)
        missing = list({task.key: task for task in tasks if not self.store.has(task)}.values())
        with progress_bar(len(tasks), self.experiment.name, "task") as bar:
            bar.update(len(tasks) - len(missing))
            for outcome in run_tasks(missing, self.work, **self.run_options):
                if outcome.files is None:
                    self.failed.append(outcome)
                    self.store.fail(outcome.task, outcome.error)
                else:
                    self.store.put(outcome.task, outcome.files)
                    self._check_metrics([outcome.task])
                bar.update()

    def _check_metrics(self, tasks: list[Task]) -> None:
        """Do the episodes of the first task that is there have what the experiment is about? Not after the last one.

        Raises:
          ValueError: they have not; of several environments others may have it.
        """
        if self.checked or len(self.experiment.environments) > 1:
            return
        there = next((task for task in tasks if self.store.has(task)), None)
        if there is None:
            return
        columns = with_outcomes(self.episodes(there)).columns
        check_there(self.metrics, columns, f"episodes on {there.config['environment']} with these options")
        self.checked = True

    def why(self, outcome: Outcome) -> str:
        """One line: which task failed, of what, and where more is said."""
        path = self.store.path(outcome.task) / ERROR
        return f"task {described(outcome.task)} failed: {last_line(outcome.error)} (all of it: {path})"

    def _ask_optuna(self) -> None:
        """Let Optuna's TPE choose, a batch at a time. Asked again, it chooses the same, so nothing is run twice."""
        try:
            import optuna
        except ModuleNotFoundError:
            raise ValueError("sweep.optuna needs the package optuna: pip install 'rss-shield[sweep]'") from None
        drawn = self.experiment.drawn
        assert drawn is not None
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        study = optuna.create_study(
            directions=[optuna.study.StudyDirection[direction.upper()] for _, direction in drawn.objectives],
            sampler=optuna.samplers.TPESampler(seed=drawn.seed),
        )
        for first in range(0, drawn.tasks, drawn.batch):
            trials = [study.ask() for _ in range(min(drawn.batch, drawn.tasks - first))]
            tasks = [
                distinct_tasks_of(self.experiment, {n: _suggest(trial, n, s) for n, s in drawn.over.items()})
                for trial in trials
            ]
            self.do([task for some in tasks for task in some])
            for trial, some in zip(trials, tasks, strict=True):
                if all(self.store.has(task) for task in some):
                    study.tell(trial, self.objectives(some))
                else:
                    study.tell(trial, state=optuna.trial.TrialState.FAIL)

    def objectives(self, tasks: list[Task]) -> list[float]:
        """What Optuna is told: each metric's mean over the points."""
        assert self.experiment.drawn is not None
        points = self.points(tasks)
        values = points.groupby("metric")["value"].mean()
        return [float(values[metric]) for metric, _ in self.experiment.drawn.objectives]

    def episodes(self, task: Task) -> pd.DataFrame:
        return pd.read_csv(io.BytesIO((self.store.path(task) / "episodes.csv").read_bytes()), keep_default_na=False)

    def points(self, tasks: Iterable[Task]) -> pd.DataFrame:
        """Long: the rows of `point_row` of every point whose tasks are all there."""
        points: dict[str, tuple[dict[str, Any], dict[int, Task]]] = {}
        for task in tasks:
            point = {
                name: to_json(value) if isinstance(value, list | dict) else value for name, value in task.point.items()
            }
            points.setdefault(to_json(point), (point, {}))[1][task.config["seed"]] = task
        rows = []
        for point, seeds in points.values():
            if not all(self.store.has(task) for task in seeds.values()):
                continue
            frames = {seed: self.episodes(task) for seed, task in seeds.items()}
            if not self.experiment.arms:
                rows += point_row(point, frames, pooled=True)
                continue
            for test in next(iter(frames.values()))["test"].unique():
                tested = {seed: frame[frame["test"] == test] for seed, frame in frames.items()}
                rows += point_row({**point, "test": test}, tested)
        return pd.DataFrame(rows)


def described(task: Task) -> str:
    """Which one it is, in words."""
    config = task.config
    player = config["arm"] if "arm" in config else config["policy"]
    setting = [f"{name} = {value}" for name, value in task.point.items() if name not in ROLES]
    return ", ".join([str(config["environment"]), str(player), f"seed {config['seed']}", *setting])


def _suggest(trial: Any, name: str, space: Any) -> Any:
    if hasattr(space, "low"):
        return trial.suggest_float(name, space.low, space.high, log=space.log)
    return trial.suggest_categorical(name, list(space))


def metrics_of(experiment: Experiment) -> list[str]:
    """What an experiment is about: its axes, and what Optuna is told."""
    objectives = experiment.drawn.objectives if experiment.drawn is not None else ()
    return [experiment.safety, experiment.performance, *(metric for metric, _ in objectives)]


def distinct_tasks_of(experiment: Experiment, drawn: dict[str, Any] | None = None) -> list[Task]:
    """As `eval.runs.tasks.tasks_of`, once of arms that learn nothing: they do the same with every training seed."""
    first = experiment.seeds[0]
    tasks = tasks_of(experiment, drawn)
    return [task for task in tasks if task.config["seed"] == first or not _is_scripted(task)]


def _is_scripted(task: Task) -> bool:
    return "arm" in task.config and arm_named(task.config["arm"]).scripted


def check_tasks(tasks: list[Task]) -> None:
    """Refuse bad options before anything runs."""
    for environment in dict.fromkeys(task.config["environment"] for task in tasks):
        check_environment(environment)
    for task in {to_json({**task.config, "seed": 0}): task for task in tasks}.values():
        if "arm" in task.config:
            from rss_shield.eval.suite.trained import check_trained

            check_trained(task.config)
        else:
            check_policy(task.config["policy"])
            check_played(task.config["environment"], task.config["policy"], task.config["options"])


def sweep(
    experiment: Experiment, folder: Path, work: Work = do_task, file: str = "", options: Sequence[str] = (), **run: Any
) -> Sweep:
    """Run an experiment and write its points.

    Args:
      file, options: of the command line that asked for it, which pages print to do it again.
      run: backend, workers and address of `run_tasks`.

    Raises:
      ValueError: options out of range; a metric that the episodes have not.
    """
    for name in metrics_of(experiment):
        metric_named(name)
    folder.mkdir(parents=True, exist_ok=True)
    for warning in _record(experiment, folder, {"file": file, "options": list(options)}):
        print(f"rss-shield sweep: warning: {warning}", file=sys.stderr)
    under_way = Sweep(experiment, folder, work, **run)
    under_way.run()
    failed = [f"{described(outcome.task)} ({last_line(outcome.error)})" for outcome in under_way.failed]
    write_json(folder / FAILED, failed)
    points = under_way.points(under_way.tasks)
    if len(points):
        axes = [name for name in points.columns if name not in ("metric", "value", "low", "high", "n", "over")]
        title = f"{experiment.name}: {experiment.about}" if experiment.about else experiment.name
        print(write_points(folder, points, axes, experiment.safety, experiment.performance, title))
    return under_way


def with_budget(experiment: Experiment, episodes: int | None, total_timesteps: int | None = None) -> Experiment:
    """Other numbers of test episodes, and of decisions to learn from; None = as in the file.

    Raises:
      ValueError: an option out of range, or decisions where nobody learns.
    """
    for option, value in (("episodes", episodes), ("total-timesteps", total_timesteps)):
        if value is not None and value < 1:
            raise ValueError(f"--{option} {value} is out of range: expected at least 1")
    if episodes is not None:
        experiment = replace(experiment, tests={**experiment.tests, "episodes": episodes})
    if total_timesteps is None:
        return experiment
    if not experiment.arms:
        raise ValueError(f"--total-timesteps {total_timesteps}: {experiment.name} trains no arms")
    return replace(experiment, options={**experiment.options, "total_timesteps": total_timesteps})


def checked_workers(workers: int) -> int:
    """A number of workers.

    Raises:
      ValueError: out of range.
    """
    if not 1 <= workers <= MOST_WORKERS:
        raise ValueError(f"--workers {workers} is out of range: expected 1 to {MOST_WORKERS}")
    return workers


def _record(experiment: Experiment, folder: Path, asked: Mapping[str, Any]) -> list[str]:
    """Write the experiment and the versions beside its results; says what changed since the first task.

    Raises:
      ValueError: a run of another kind is there.
    """
    if (folder / "config.json").exists():
        raise ValueError(f"{folder} holds a run of rss-shield train: expected an experiment of another name")
    path, now = folder / "experiment.json", json.loads(to_json(versions()))
    begun = path.exists() and any((folder / "tasks").glob("[!.]*"))
    before = json.loads(path.read_text(encoding="utf-8")) if begun else {"versions": now}
    write_json(path, {"experiment": asdict(experiment), **asked, "versions": before["versions"]})
    changed = [name for name in now if name in before["versions"] and now[name] != before["versions"][name]]
    return [
        f"{name} is not what it was when the first task of {folder} ran: remove the folder to run all anew"
        for name in changed
    ]


def run(arguments: list[str]) -> None:
    """What a command line asks for."""
    given = parsed(Arguments, "rss-shield sweep", __doc__ or "", arguments)
    try:
        budget = {"episodes": given.episodes, "total_timesteps": given.total_timesteps}
        experiment = with_budget(read_experiment(given.experiment), **budget)
        done = sweep(
            experiment,
            folder_for(given.runs_dir, "--runs-dir") / experiment.name,
            file=str(given.experiment),
            options=as_words({name: value for name, value in budget.items() if value is not None}),
            backend=given.backend,
            workers=checked_workers(given.workers),
            address=given.address,
        )
    except (ValueError, OSError) as error:
        refuse("rss-shield sweep", error)
    if not done.failed:
        print(f"\nEverything is in {done.folder}: table.md, points.csv, pareto.png, tasks/")
        return
    for outcome in done.failed:
        print(f"rss-shield sweep: {done.why(outcome)}", file=sys.stderr)
    raise SystemExit(1)
