"""`rss-shield train`, `test` and `report` read the experiment files of `rss-shield sweep`.

`rss-shield train experiments/compare.yaml` trains its arms in one run per environment, in runs/NAME (with several
environments in runs/NAME-ENVIRONMENT); the same command goes on with what was stopped. `test` tests the models that are
there, `report` writes the page of these runs, or of the sweep.
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rss_shield.eval.runs.experiment import Experiment

FILES = (".yaml", ".yml", ".toml", ".json")
TAKES_FILES = ("train", "test", "report")


def expanded(command: str, arguments: list[str]) -> list[list[str]]:
    """The command lines that one with an experiment file stands for; one without is itself.

    Args:
      command: of `rss-shield`.
      arguments: of it; further options come after the file and win.

    Raises:
      ValueError: the file cannot be read, or the command has nothing to do with it; the message says what has.
    """
    if command not in TAKES_FILES or not arguments or not arguments[0].lower().endswith(FILES):
        return [arguments]
    from rss_shield.eval.runs.experiment import read_experiment  # with what it needs

    file, *more = arguments
    if not Path(file).exists():
        raise ValueError(f"{file}: no such file; expected an experiment, as those in experiments/")
    experiment, runs_dir = read_experiment(file), runs_dir_in(more)
    if command == "report":
        return [[*map(str, existing(file, experiment, runs_dir)), *without_runs_dir(more)]]
    if experiment.is_sweep:
        raise ValueError(
            f"{file} has {'policies' if experiment.policies else 'a sweep'}: rss-shield sweep {file} runs it"
        )
    if command == "train":
        return [[*train_words(file, experiment, env_id), *more] for env_id in experiment.environments]
    models = [model for run in existing(file, experiment, runs_dir) for model in sorted(run.glob("*/model.zip"))]
    tests = ["--episodes", str(experiment.tests["episodes"]), "--first-seed", str(experiment.tests["first_seed"])]
    return [[str(model), *tests, *without_runs_dir(more)] for model in models]


def run_folder(experiment: "Experiment", env_id: str) -> str:
    """Name of the folder of one environment's run."""
    from rss_shield.eval.files import valid_name

    return experiment.name if len(experiment.environments) == 1 else valid_name(f"{experiment.name}-{env_id}")


def train_words(file: str, experiment: "Experiment", env_id: str) -> list[str]:
    """The options of `rss-shield train` for one environment of an experiment."""
    from rss_shield.eval.runs.experiment import training_words

    try:
        words = training_words(env_id, experiment.arms, experiment.seeds, experiment.tests, experiment.options)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    return ["--name", run_folder(experiment, env_id), "--resume-or-start", *words]


def existing(file: str, experiment: "Experiment", runs_dir: Path) -> list[Path]:
    """The folders of an experiment's runs, or of its sweep.

    Raises:
      ValueError: none is there.
    """
    names = dict.fromkeys([experiment.name, *(run_folder(experiment, env_id) for env_id in experiment.environments)])
    found = [runs_dir / name for name in names if (runs_dir / name).is_dir()]
    if not found:
        what = "sweep" if experiment.is_sweep else "train"
        raise ValueError(f"{file}: nothing in {runs_dir / experiment.name} yet; rss-shield {what} {file} comes first")
    return found


def runs_dir_in(words: list[str]) -> Path:
    return Path(words[words.index("--runs-dir") + 1]) if "--runs-dir" in words[:-1] else Path("runs")


def without_runs_dir(words: list[str]) -> list[str]:
    if "--runs-dir" not in words:
        return words
    at = words.index("--runs-dir")
    return words[:at] + words[at + 2 :]
