"""The tasks of an experiment: each is a configuration, and its key is a hash of that."""

import hashlib
import itertools
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rss_shield.eval.files import to_json
from rss_shield.eval.own import digests
from rss_shield.eval.runs.experiment import Drawn, Experiment, Range


class Task(NamedTuple):
    """One combination, run once."""

    config: dict[str, Any]  # all that its result depends on; strict JSON
    point: dict[str, Any]  # what tells it from the other tasks, but for the seed: column of a table -> value

    @property
    def key(self) -> str:
        """The same configuration has the same key, in whatever order it is written."""
        return key_of(self.config)


def key_of(config: dict[str, Any]) -> str:
    canonical = json.dumps(json.loads(to_json(config)), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def tasks_of(experiment: Experiment, drawn: dict[str, Any] | None = None) -> list[Task]:
    """Every combination; `drawn`: values of what is drawn, of one sample.

    Raises:
      ValueError: something is set twice; a function of one's own is not there.
    """
    kind, players = ("arm", experiment.arms) if experiment.arms else ("policy", experiment.policies)
    names = list(experiment.grid)
    tasks = []
    for environment, player, (label, chosen), *values in itertools.product(
        experiment.environments, players, (experiment.points or {"": {}}).items(), *experiment.grid.values()
    ):
        varied = dict(zip(names, values, strict=True)) | (drawn or {})
        twice = set(chosen) & set(varied)
        if twice:
            raise ValueError(f"{sorted(twice)[0]} is in sweep.list and varied as well")
        options = experiment.options | chosen | varied
        several = {
            "environment": (environment, len(experiment.environments) > 1),
            kind: (player, len(players) > 1),
            "setting": (label, bool(experiment.points)),
        }
        point = {name: value for name, (value, shown) in several.items() if shown} | varied
        own = digests([player, *options.values()])  # what is changed is run anew
        sources = {"sources": own} if own else {}
        for seed in experiment.seeds:
            config = {"environment": environment, kind: player, "seed": seed, "options": options, **experiment.tests}
            config |= sources
            tasks.append(Task(config, point))
    return tasks


def samples_of(drawn: Drawn) -> Iterator[dict[str, Any]]:
    """Values at random, the same for the same seed."""
    rng = np.random.default_rng(drawn.seed)
    for _ in range(drawn.tasks):
        yield {name: _sample(space, rng) for name, space in drawn.over.items()}


def _sample(space: Range | tuple, rng: np.random.Generator) -> Any:
    if not isinstance(space, Range):
        return space[int(rng.integers(len(space)))]
    if space.log:
        return float(np.exp(rng.uniform(np.log(space.low), np.log(space.high))))
    return float(rng.uniform(space.low, space.high))
