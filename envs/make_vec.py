"""Many environments at once, on either simulator."""

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.arguments import rules_of, seed_of, whole
from rss_shield.envs.fast.config import Unsupported, compile_scenario
from rss_shield.envs.fast.vector import FastVectorEnv
from rss_shield.envs.make import make
from rss_shield.envs.options import (
    MODES,
    PLANS,
    Options,
    Params,
    Settings,
    check_environment,
    check_replace,
    check_risk,
    settings_for,
    split,
)
from rss_shield.shield.risk import RiskSettings

BACKENDS = ("fast", "highway-env")


def make_vec(
    env_id: str,
    num_envs: int,
    shield: str | None = "override",
    backend: str = "fast",
    params: Params = None,
    config: dict | None = None,
    threads: int = 1,
    autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
    **kwargs: Any,
) -> VectorEnv:
    """Environments side by side, each with a shield around its ego.

    Both backends have the same spaces, seeds, episodes and infos. gymnasium's vector wrappers that ask for it
    (`NormalizeObservation`, `FlattenObservation`) take `autoreset_mode=AutoresetMode.NEXT_STEP` on either.

    Args:
      env_id: "highway-fast-v0", "highway-v0", ...
      num_envs: how many.
      shield: "override", "monitor", or None for bare environments.
      backend: "fast", the compiled engine, or "highway-env", the original one after the other.
      params: the table in force, see `ShieldWrapper`.
      config: as for `gymnasium.make` of a highway-env environment.
      threads: of the compiled engine.
      autoreset_mode: see `FastVectorEnv`; gymnasium's, or its value as a text.
      kwargs: `max_episode_steps`; `rules`, `intervention_penalty`, `penalty_on`, `entry`, `intent`, `waiting`,
        `examine`, `filter`, `filter_at`, `correction`, `evasion`, `replace` and `risk` of `ShieldWrapper`; and
        whatever else `make` takes (`judge_params`, ...) where the backend is "highway-env".

    Raises:
      ValueError: unknown names, or something that the engine does not support; the message names it.
    """
    num_envs, threads = whole("num_envs", num_envs, 1), whole("threads", threads, 1)
    autoreset_mode = _autoreset(autoreset_mode)
    for name, instead in _OF_GYMNASIUM.items():
        if name in kwargs:
            raise ValueError(f"{name} = {kwargs[name]!r}: make_vec does not support it; expected {instead}")
    if backend not in BACKENDS:
        raise ValueError(f"backend = {backend!r}: expected one of {', '.join(BACKENDS)}")
    if shield is not None and shield not in MODES:
        raise ValueError(f"shield = {shield!r}: expected 'override', 'monitor' or None")
    given, rest = split({"params": params, **kwargs})
    options = Options.of(given)
    if backend == "highway-env":
        arguments = {**given, **rest, "config": config}
        return _SideBySide(
            [partial(_make_counted, env_id, shield, arguments)] * num_envs, autoreset_mode=autoreset_mode
        )
    _check_supported(options, rest)
    scenario = compile_scenario(env_id, config, max_episode_steps=rest.get("max_episode_steps"))
    settings = _settings_in(scenario.stock, shield, options) if shield is not None else None
    penalty, by_change = float(options.intervention_penalty), options.penalty_on == "change"
    replaces, risk = shield is not None and options.replace == "decision", _risk_in(shield, options)
    return FastVectorEnv(scenario, num_envs, settings, penalty, autoreset_mode, threads, by_change, replaces, risk)


def _check_supported(options: Options, rest: dict[str, Any]) -> None:
    """Does the engine know all that is asked for?"""
    unknown = {name: getattr(options, name) for name in _OF_HIGHWAY_ENV}
    unknown = {name: value for name, value in unknown.items() if value != _OF_HIGHWAY_ENV[name]}
    others = {name: value for name, value in rest.items() if value is not None and name != "max_episode_steps"}
    for name, value in (unknown | others).items():
        raise Unsupported(f"{name} = {value!r}", "backend = 'highway-env'")


def _settings_in(stock: Any, shield: str, options: Options) -> Settings:
    check_environment(stock)
    check_replace(options, stock)
    settings = settings_for(stock, options.params_in(stock), rules_of(options.rules), shield, options.conduct)
    if settings.scheme == PLANS and not isinstance(stock.action_type, DiscreteMetaAction):
        kind = type(stock.action_type).__name__
        raise Unsupported(f"action type {kind} with a shield where roads cross", "backend = 'highway-env'")
    return settings


def _risk_in(shield: str | None, options: Options) -> RiskSettings | None:
    """What risk is measured by; compiled code cannot say that somebody is too fast for it."""
    risk = check_risk(options.risk)
    if risk is not None and shield is None:
        raise ValueError(f"risk = {options.risk!r}: expected False without a shield; use shield = 'monitor'")
    if risk is not None and not risk.wave_speed > Vehicle.MAX_SPEED:
        raise ValueError(f"risk: wave_speed = {risk.wave_speed:g}: expected > {Vehicle.MAX_SPEED:g} m/s in the engine")
    return risk


# options that the engine has no answer to, and what says that nobody asks
_OF_HIGHWAY_ENV = {
    **{"traffic": "stock", "record": False, "measures": False},
    **{"judge_params": None, "judge_rules": None},
}
_OF_GYMNASIUM = {  # arguments of its `make_vec` that mean something else here
    "vectorization_mode": "backend = 'fast' or 'highway-env'",
    "vector_kwargs": "autoreset_mode and threads",
    "wrappers": "wrappers around what make_vec returns",
}


class _SideBySide(SyncVectorEnv):
    """gymnasium's, for seeds of numpy as well."""

    def reset(self, *, seed: Any = None, options: dict | None = None):
        several = seed is not None and np.ndim(seed) > 0
        return super().reset(seed=[seed_of(one) for one in seed] if several else seed_of(seed), options=options)


def _autoreset(mode: Any) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(f"AutoresetMode.{known.name}" for known in AutoresetMode)
        raise ValueError(f"autoreset_mode = {mode!r}: expected one of {names}") from None


def _make_counted(env_id: str, shield: str | None, options: dict) -> gym.Env:
    return RecordEpisodeStatistics(make(env_id, shield, **options))
