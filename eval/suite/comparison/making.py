"""Environments of the comparison, made from its options, one at a time or side by side."""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode, VectorEnv

import rss_shield
from rss_shield.agents.history import with_history
from rss_shield.envs.highway.idm_ego import make_idm_vec
from rss_shield.envs.options import Options
from rss_shield.eval.arms import Arm
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.shield.params import Preset

# options of the shield that have no place of their own in `setting`
WRAPPED = ("rules", "examine", "traffic", "filter", "filter_at", "correction", "replace", "risk")


def original(config: Config, preset: Preset, arm: Arm, shield: Mapping[str, Any]) -> Callable[..., gym.Env]:
    """Builds an environment of the original simulator."""
    options = {**wrapped(config), **shield, **setting(config, arm)}
    return functools.partial(rss_shield.make, config.env_id, params=preset, **options)


def batch(
    config: Config, preset: Preset, arm: Arm, shield: Mapping[str, Any], n_envs: int, **options: Any
) -> VectorEnv:
    """Environments of the chosen simulator side by side, as an arm needs them."""
    given = {**wrapped(config), **shield, **setting(config, arm)}
    options = {"backend": config.backend, **options, "params": preset, **given}
    env = rss_shield.make_vec(config.env_id, n_envs, **options)
    return env if arm.scripted and not arm.own else with_history(env, config.history)


def test_batch(config: Config, preset: Preset, arm: Arm, shield: Mapping[str, Any], n_envs: int) -> VectorEnv:
    """The same for tests, where the next episode begins when it is told to."""
    if arm.scripted and arm.settings["driver"] == "idm":
        return make_idm_vec(config.env_id, n_envs, params=preset, **wrapped(config), **shield, **setting(config, arm))
    return batch(config, preset, arm, shield, n_envs, autoreset_mode=AutoresetMode.DISABLED)


def setting(config: Config, arm: Arm) -> dict[str, Any]:
    """The environment's configuration, if it is told any, among what the ego chooses, and its conduct at junctions."""
    conduct = {"entry": config.entry, "intent": config.intent, "waiting": config.waiting, **arm.chooses}
    configured = {**config.config, **arm.config}
    return {**conduct, "config": configured} if configured else conduct


def wrapped(config: Config) -> dict[str, Any]:
    """Other options of the shield's, as far as they are not its defaults; what an arm says comes before them."""
    default = Options()
    given = {name: getattr(config, name) for name in WRAPPED}
    return {name: value for name, value in given.items() if value != getattr(default, name)}
