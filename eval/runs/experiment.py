"""An experiment is a file that names environments, arms or policies, seeds, budgets, tests, and what is varied."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from rss_shield.eval.config_option import as_text, read_config
from rss_shield.eval.files import NAMES, valid_name
from rss_shield.eval.runs.names import check_names, flat

DIRECTIONS = ("minimize", "maximize")


class Range(NamedTuple):
    """Numbers to draw from."""

    low: float
    high: float
    log: bool = False


class Drawn(NamedTuple):
    """What is drawn at random, or chosen by Optuna from what came out before."""

    over: dict[str, Range | tuple]  # option -> range, or the values to choose from
    tasks: int  # how many are drawn
    seed: int = 0
    batch: int = 1  # tasks that Optuna asks for before it hears of any; results depend on it, not on who runs them
    objectives: tuple[tuple[str, str], ...] = ()  # of Optuna: metric, direction


@dataclass(frozen=True)
class Experiment:
    """See docs/experiments.md for every key of a file.

    Every combination of environment, arm or policy, point of `list`, values of `grid`, and seed is a task.
    """

    name: str  # of folders, so as every system takes it
    about: str = ""
    environments: tuple[str, ...] = ("highway-fast-v0",)
    arms: tuple[str, ...] = ()  # of train.py; or
    policies: tuple[str, ...] = ()  # scripted ones
    seeds: tuple[int, ...] = (0,)
    options: dict[str, Any] = field(default_factory=dict)  # dotted names -> values, of every task
    tests: dict[str, Any] = field(default_factory=dict)  # episodes, first_seed
    points: dict[str, dict[str, Any]] = field(default_factory=dict)  # of `sweep.list`
    grid: dict[str, tuple] = field(default_factory=dict)
    drawn: Drawn | None = None
    by_optuna: bool = False
    safety: str = "at_fault"  # metrics of the safety-performance points
    performance: str = "return"

    @property
    def is_sweep(self) -> bool:
        """Does only `rss-shield sweep` run it, because something is varied or nothing is trained?"""
        return bool(self.policies or self.points or self.grid or self.drawn)


_FILE = ("name", "about", "environments", "arms", "policies", "seeds", "options", "tests", "sweep", "axes")
_SWEEP = ("list", "grid", "random", "optuna")
_RANDOM = ("over", "samples", "seed")
_OPTUNA = ("over", "trials", "seed", "batch", "objectives")
_TESTS = {"episodes": 200, "first_seed": 10**9}


def read_experiment(path: str | Path) -> Experiment:
    """An experiment from a YAML, TOML or JSON file.

    Raises:
      ValueError: names the file, and what is wrong with which key.
    """
    given = read_config(str(path))
    try:
        return experiment_of({"name": Path(path).stem, **given})
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def experiment_of(given: Mapping[str, Any]) -> Experiment:
    """An experiment from the keys of its file."""
    check_names(given, _FILE, "the experiment")
    if not isinstance(given.get("about", ""), str):
        raise ValueError(f"about = {given['about']!r}: expected a text")
    if "sweep" in given and not given["sweep"]:
        raise ValueError(f"sweep = {given['sweep']!r}: expected {', '.join(_SWEEP)}, or no sweep at all")
    sweep, axes = _mapping(given, "sweep"), _mapping(given, "axes")
    check_names(sweep, _SWEEP, "sweep")
    check_names(axes, ("safety", "performance"), "axes")
    tests = _TESTS | _mapping(given, "tests")
    check_names(tests, _TESTS, "tests")
    for name, least in (("episodes", 1), ("first_seed", 0)):
        _whole(f"tests.{name}", tests[name], least)
    if bool(given.get("arms")) == bool(given.get("policies")):
        raise ValueError("expected either arms (to train) or policies (scripted ones)")
    if "random" in sweep and "optuna" in sweep:
        raise ValueError("sweep has both random and optuna: expected one of them")
    points = _mapping(sweep, "list")
    for name, values in points.items():
        if not isinstance(values, dict):
            raise ValueError(f"sweep.list.{name} = {values!r}: expected options and their values")
    seeds = _list(given, "seeds", [0])
    for seed in seeds:
        _whole("seeds", seed, 0)
    texts = {name: tuple(map(str, _list(given, name, []))) for name in ("environments", "arms", "policies")}
    for name, values in {"seeds": seeds, **texts}.items():
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {list(values)}: something is named twice")
    name = valid_name(str(given["name"]))
    if not name:
        raise ValueError(f"name = {given['name']!r}: expected {NAMES}")
    return Experiment(
        name=name,
        about=" ".join(str(given.get("about", "")).split()),
        environments=texts["environments"] or Experiment.environments,
        arms=texts["arms"],
        policies=texts["policies"],
        seeds=tuple(seeds),
        options=_flat(_mapping(given, "options")),
        tests=tests,
        points={str(name): _flat(values) for name, values in points.items()},
        grid={name: _values(f"sweep.grid.{name}", values) for name, values in _flat(_mapping(sweep, "grid")).items()},
        drawn=_drawn(sweep),
        by_optuna="optuna" in sweep,
        **{name: str(value) for name, value in axes.items()},
    )


def training_words(
    environment: str, arms: Iterable[str], seeds: Iterable[int], tests: Mapping[str, Any], options: Mapping[str, Any]
) -> list[str]:
    """The command line of `rss-shield train`."""
    words = ["--env-id", environment, "--arms", *arms, "--seeds", *map(str, seeds)]
    words += ["--eval-episodes", str(tests["episodes"]), "--first-seed", str(tests["first_seed"])]
    return [*words, *as_words(options)]


def as_words(options: Mapping[str, Any]) -> list[str]:
    """Options of an experiment as a command line says them: {"rules.memory": False} is --rules.memory False."""
    words = []
    for name, value in options.items():
        flag = name.replace("_", "-")
        if isinstance(value, dict) or name.startswith(("config.", "hyperparameters.")):
            words += [f"--{flag}", as_text(value)]
            continue
        if isinstance(value, bool) and not name.startswith("rules."):
            words.append(f"--{flag}" if value else f"--no-{flag}")
            continue
        values = value if isinstance(value, list | tuple) else [value]
        words += [f"--{flag}", *map(str, values)]
    return words


def _drawn(sweep: Mapping[str, Any]) -> Drawn | None:
    if "random" in sweep:
        given = _mapping(sweep, "random")
        check_names(given, _RANDOM, "sweep.random")
        count = _whole("sweep.random.samples", given.get("samples", 10), 1)
        return Drawn(_space(given, "sweep.random"), count, _whole("sweep.random.seed", given.get("seed", 0), 0))
    if "optuna" in sweep:
        given = _mapping(sweep, "optuna")
        check_names(given, _OPTUNA, "sweep.optuna")
        objectives = _mapping(given, "objectives") or {"at_fault": "minimize", "return": "maximize"}
        for metric, direction in objectives.items():
            if direction not in DIRECTIONS:
                raise ValueError(f"sweep.optuna.objectives.{metric} = {direction!r}: expected minimize or maximize")
        return Drawn(
            _space(given, "sweep.optuna"),
            _whole("sweep.optuna.trials", given.get("trials", 20), 1),
            _whole("sweep.optuna.seed", given.get("seed", 0), 0),
            _whole("sweep.optuna.batch", given.get("batch", 1), 1),
            tuple((str(metric), str(direction)) for metric, direction in objectives.items()),
        )
    return None


def _space(given: Mapping[str, Any], where: str) -> dict[str, Range | tuple]:
    """Ranges are dictionaries of low and high, so they are told from options with dotted names by these keys."""
    space: dict[str, Range | tuple] = {}

    def enter(name: str, value: Any) -> None:
        if isinstance(value, dict) and "low" not in value and "high" not in value:
            for key, inner in value.items():
                enter(f"{name}.{key}" if name else str(key), inner)
        elif isinstance(value, dict):
            check_names(value, Range._fields, f"{where}.over.{name}")
            low, high = (value.get(end, math.nan) for end in ("low", "high"))
            numbers = all(isinstance(end, int | float) and math.isfinite(end) for end in (low, high))
            if not numbers or not low < high or (value.get("log") and low <= 0):
                raise ValueError(f"{where}.over.{name} = {value}: expected low < high, with log both above 0")
            space[name] = Range(float(low), float(high), bool(value.get("log", False)))
        else:
            space[name] = _values(f"{where}.over.{name}", value)

    enter("", _mapping(given, "over"))
    if not space:
        raise ValueError(f"{where}.over: expected options with ranges or values")
    return space


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    return flat(values) if values else {}


def _mapping(given: Mapping[str, Any], name: str) -> dict[str, Any]:
    value = given.get(name)
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise ValueError(f"{name} = {value!r}: expected keys with values")
    return value


def _list(given: Mapping[str, Any], name: str, default: list) -> list:
    value = given.get(name, default)
    if not isinstance(value, list) or not (value or not default):
        raise ValueError(f"{name} = {value!r}: expected a list")
    return value


def _values(name: str, values: Any) -> tuple:
    if not isinstance(values, list) or not values:
        raise ValueError(f"{name} = {values!r}: expected a list of values")
    return tuple(values)


def _whole(name: str, value: Any, least: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name} = {value!r}: expected a whole number >= {least}")
    return value
