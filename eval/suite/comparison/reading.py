"""From a command line to all options of the comparison, the folder of its run, and its RSS parameters."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from rss_shield.command_line import Overrides, parsed, shown
from rss_shield.envs.arguments import rules_of
from rss_shield.envs.configuration import check_config, default_config
from rss_shield.eval.arms import arm_named
from rss_shield.eval.config_option import HYPERPARAMETERS, Keys, split_arguments, with_values
from rss_shield.eval.run_folder import changes, recorded
from rss_shield.eval.suite.comparison.acting import learner
from rss_shield.eval.suite.comparison.checking import check, check_seeds
from rss_shield.eval.suite.comparison.naming import run_name
from rss_shield.eval.suite.comparison.options import COMMAND, HELP, Config
from rss_shield.eval.suite.comparison.record import options_of
from rss_shield.eval.suite.own_table import preset_in, usual_preset
from rss_shield.shield.params import Preset, with_parameters


def started(arguments: list[str], program: str = COMMAND) -> tuple[Config, Path]:
    """All options, and the folder of the run. What `--resume` finds there are the defaults of the rest.

    Args:
      program: what messages call it.

    Raises:
      ValueError: the environment's configuration cannot be read, or options contradict those of the run.
    """
    options, values = split_arguments(arguments)
    options, altered = split_arguments(options, HYPERPARAMETERS)
    config = parse(options, Config(), program)
    check(config, program)
    asked = config.resume
    options += ["--resume"] * (config.resume_or_start and not asked)
    config = replace(config, resume=asked or config.resume_or_start)
    before = recorded(config.runs_dir / config.name) if config.resume and config.name else None
    if before is None:
        config = complete(config, values, altered, program)
        config = replace(config, name=config.name or run_name(config))
        before = recorded(config.runs_dir / config.name) if config.resume else None
    folder = config.runs_dir / config.name
    if before is None:
        if asked and not config.resume_or_start and not folder.exists():
            raise ValueError(
                f"--resume: there is no run in {folder}; --name names another, --resume-or-start starts one there"
            )
        return replace(config, preset=preset_name(config)), folder
    stored = stored_config(before)
    config = parse(options, stored, program)
    config = replace(
        config,
        config={**stored.config, **config.config},
        hyperparameters={**stored.hyperparameters, **config.hyperparameters},
    )
    config = complete(config, values, altered, program)
    config = replace(config, preset=preset_name(config))
    contradictions = [
        f"--{name.replace('_', '-')} {shown(now)} contradicts {shown(then)}"
        for name, now, then in changes(options_of(config), options_of(stored))
    ]
    if contradictions:
        raise ValueError(
            f"{', '.join(contradictions)}, with which the run in {folder} was started; "
            "leave them out to go on with it, --overwrite starts it anew, --name chooses another folder"
        )
    return config, folder


def parse(arguments: list[str], default: Config, program: str) -> Config:
    """Read the command line. What cannot be read ends in one line and exit code 2."""
    check_seeds(arguments, program)
    return parsed(Config, program, HELP, arguments, default)


def complete(config: Config, values: dict[Keys, Any], altered: dict[Keys, Any], program: str) -> Config:
    """Options that are all in range, with single values put into the environment's configuration and learners."""
    check(config, program)
    config = replace(config, hyperparameters=with_values(config.hyperparameters, altered, {}))
    for arm in map(arm_named, config.arms):
        if not arm.scripted:
            learner(config, arm)
    if not (config.config or values):
        return config
    given = with_values(config.config, values, default_config(config.env_id))
    check_config(config.env_id, given)
    return replace(config, config=given)


def stored_config(options: dict[str, Any]) -> Config:
    """The options in a run's record; what was not recorded has its default."""
    known = {f.name: options[f.name] for f in fields(Config) if f.name in options}
    known["rules"] = rules_of(known.get("rules", {}))
    for name in ("arms", "seeds"):
        known[name] = tuple(known[name])
    for name in ("ego", "other"):
        known[name] = Overrides(**{parameter: float(value) for parameter, value in known[name].items()})
    return Config(**known)


def preset_name(config: Config) -> str:
    """The preset asked for, or the one of the environment."""
    if config.preset != "auto":
        return config.preset
    return usual_preset(config.env_id)


def resolve(config: Config) -> Preset:
    """The preset with the parameters given on the command line put in."""
    try:
        return with_parameters(preset_in(preset_name(config)), config.ego.given, config.other.given)
    except ValueError as error:
        raise ValueError(f"--{error}") from None
