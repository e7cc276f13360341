"""Who acts in an arm: a learner, or a driver that learns nothing."""

from typing import Any

import numpy as np

from rss_shield.agents.learner import Learner, learner_of
from rss_shield.eval import drivers
from rss_shield.eval.arms import FROM_OPTIONS, SHIELDED, Arm
from rss_shield.eval.own import driver_named
from rss_shield.eval.suite.comparison.making import original
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.shield.params import Preset


def learner(config: Config, arm: Arm) -> Learner:
    """The learner of an arm."""
    fixed = {name: value for name, value in arm.settings.items() if name != FROM_OPTIONS}
    asked = {name: getattr(config, option) for name, option in arm.settings.get(FROM_OPTIONS, {}).items()}
    try:
        known = learner_of(arm.learner, **fixed, **asked).with_hyperparameters(config.hyperparameters)
    except ValueError as error:
        raise ValueError(f"arm {arm.name}: {error}") from None
    return known if arm.chooses else known.with_network(config.network)


def driver(config: Config, preset: Preset, arm: Arm, seed: int) -> drivers.Driver:
    """The policy of an arm that learns nothing."""
    env: Any = original(config, preset, arm, SHIELDED)()
    env.close()
    if arm.own:
        return driver_named(arm.name, actions=env.action_space)
    numbers = env.unwrapped.action_type.actions_indexes
    name = arm.settings["driver"]
    if name == "semantic":
        return drivers.best_value()
    if name == "any semantic":
        return drivers.any_valid(np.random.default_rng(seed))
    if name == "random":
        return drivers.uniform(len(numbers), np.random.default_rng(seed))
    return drivers.always(numbers["IDLE" if name == "idm" else name])  # that one drives itself
