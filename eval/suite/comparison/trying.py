"""Environments of the comparison are made and stepped once before anything is started, so that bad values show."""

from collections.abc import Sequence
from dataclasses import replace

import gymnasium as gym
import numpy as np

from rss_shield.agents.networks import check_network
from rss_shield.command_line import shown
from rss_shield.eval.arms import SHIELDED, Arm, arm_named
from rss_shield.eval.suite.comparison.making import batch, original
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.shield.params import Preset


def tried(config: Config, preset: Preset) -> gym.Env:
    """The original environment, after bad values of any kind have shown.

    Raises:
      ValueError: says what is wrong, and with which keys of the environment's configuration.
    """
    try:
        return _tried(config, preset)
    except Exception as error:
        if not config.config or not _works(replace(config, config={}), preset):
            raise
        alone = [{key: value} for key, value in config.config.items()]
        bad = [one for one in alone if not _works(replace(config, config=one), preset)] or alone
        named = ", ".join(f"config.{key} = {value!r}" for one in bad for key, value in one.items())
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise ValueError(f"{named}: not possible in {config.env_id}: {kind}{error}") from error


def _works(config: Config, preset: Preset) -> bool:
    try:
        _tried(config, preset)
    except Exception:
        return False
    return True


def _tried(config: Config, preset: Preset) -> gym.Env:
    envs = [_tried_arm(config, preset, arm_named(name)) for name in _unlike(config.arms)]
    return envs[0]


def _unlike(names: Sequence[str]) -> list[str]:
    """One arm of each kind of environment."""
    arms = {name: arm_named(name) for name in reversed(names)}
    kinds = {name: shown(sorted({**arm.config, **arm.chooses}.items())) for name, arm in arms.items()}
    return list({kind: name for name, kind in kinds.items()}.values())[::-1]


def _tried_arm(config: Config, preset: Preset, arm: Arm) -> gym.Env:
    env = original(config, preset, arm, SHIELDED)()
    env.close()
    actions, observations = env.action_space, env.observation_space
    kind, called = (gym.spaces.Box, "a Box") if arm.continuous else (gym.spaces.Discrete, "Discrete ones")
    if not isinstance(actions, kind):
        raise ValueError(f"env_id = {config.env_id!r}: actions {actions}; expected {called}")
    if not (isinstance(observations, gym.spaces.Box) and np.issubdtype(observations.dtype, np.floating)):
        raise ValueError(f"env_id = {config.env_id!r}: observations {observations}; expected a Box of floats")
    first = batch(config, preset, arm, SHIELDED, n_envs=1)
    if not (arm.scripted or arm.chooses):
        check_network(config.network, first.single_observation_space.shape or ())
    first.reset(seed=0)
    first.step(np.zeros((1, *(actions.shape or ())), actions.dtype))  # and the engine is compiled once for all workers
    first.close()
    return env
