"""What is recorded of a comparison: the options, and all else that its result depends on."""

import re
from dataclasses import fields
from typing import Any

import gymnasium as gym

from rss_shield.envs.arguments import plain
from rss_shield.envs.options import PLANS, scheme_of
from rss_shield.eval.arms import arm_named
from rss_shield.eval.own import digests
from rss_shield.eval.run_folder import changes
from rss_shield.eval.runs.experiment import as_words
from rss_shield.eval.suite.comparison.acting import learner
from rss_shield.eval.suite.comparison.making import wrapped
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.eval.suite.own_table import usual_preset
from rss_shield.shield.params import Preset, Rules

DERIVED = "shield_options"  # of other options; older runs do not have it
_NOT_RECORDED = ("list_arms", "workers", "tracker", "name", "runs_dir", "resume", "resume_or_start", "overwrite")
_ALWAYS = ("env_id", "total_timesteps", "seeds")  # in a command that is printed


def options_of(config: Config) -> dict[str, Any]:
    """Every option but those that only say where and how to start."""
    options = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in _NOT_RECORDED}
    rules = {name: value for name, value, _ in changes(config.rules._asdict(), Rules()._asdict())}
    return {**options, "ego": config.ego.given, "other": config.other.given, "rules": rules}


def words_of(config: Config) -> list[str]:
    """Options of a command line that asks for the same: road, decisions, seeds, and what differs from its default."""
    usual = {**options_of(Config()), "preset": usual_preset(config.env_id)}
    words = []
    for name, value in options_of(config).items():
        if name in _ALWAYS or value != usual[name]:
            words += as_words(_single(name, value))
    return words


def _single(name: str, value: Any) -> dict[str, Any]:
    """An option value by value where it consists of some, unless a command line would read one of their names anew."""
    if isinstance(value, dict) and all(re.fullmatch(r"\w+", key) for key in value):
        return {f"{name}.{key}": inner for key, inner in value.items()}
    return {name: value}


def record(config: Config, preset: Preset, env: gym.Env) -> dict[str, Any]:
    """All that the result depends on."""
    parameters = {"ego": preset.ego._asdict(), "other": preset.other._asdict()}
    own = digests([*config.arms, config.reward, config.preset])  # what is changed later is another run
    return {
        **options_of(config),
        "parameters": {
            **parameters,
            "per_frame": preset.per_frame,
            "source": preset.source,
            "roads_cross": scheme_of(env.unwrapped) == PLANS,  # otherwise entry, intent and waiting change nothing
            "rules": config.rules._asdict(),  # the margins of the published table
        },
        DERIVED: plain(wrapped(config)),
        "environment": env.unwrapped.config,  # type: ignore[attr-defined]  # the whole of it
        **{
            arm.name if arm.settings else arm.learner: learner(config, arm).hyperparameters(
                config.n_envs, config.total_timesteps
            )
            for arm in map(arm_named, config.arms)
            if not arm.scripted
        },
        **({"sources": own} if own else {}),
        "test_seeds": {"first": config.first_seed, "last": config.first_seed + config.eval_episodes - 1},
    }
