"""Many environments at once, on either simulator."""

from functools import partial
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from highway_env.envs.common.action import DiscreteMetaAction

from envs.fast.config import Unsupported, compile_scenario
from envs.fast.vector import FastVectorEnv
from envs.highway import PLANS
from envs.scenarios import make
from envs.wrapper import MODES, check_conduct, check_environment, check_params, check_penalty, settings_for
from shield.params import Preset, RSSParams, Rules

BACKENDS = ("fast", "highway-env")


def make_vec(
    env_id: str,
    num_envs: int,
    shield: str | None = "override",
    backend: str = "fast",
    params: Preset | tuple[RSSParams, RSSParams] | None = None,
    rules: Rules = Rules(),
    intervention_penalty: float = 0.0,
    penalty_on: str = "response",
    config: dict | None = None,
    threads: int = 1,
    autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
    entry: str = "cautious",
    intent: str = "any",
    waiting: str = "line",
    examine: str = "table",
) -> VectorEnv:
    """Environments side by side, each with a shield around its ego.

    Both backends have the same spaces, seeds, episodes and infos.

    Args:
      env_id: "highway-fast-v0", "highway-v0", ...
      num_envs: how many.
      shield: "override", "monitor", or None for bare environments.
      backend: "fast", the compiled engine, or "highway-env", the original one after the other.
      params, rules, intervention_penalty, penalty_on, entry, intent, waiting, examine: see `ShieldWrapper`.
      config: as for `gymnasium.make` of a highway-env environment.
      threads: of the compiled engine.
      autoreset_mode: see `FastVectorEnv`.

    Raises:
      ValueError: unknown names, or something that the engine does not support; the message names it.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend = {backend!r}: expected one of {', '.join(BACKENDS)}")
    if shield is not None and shield not in MODES:
        raise ValueError(f"shield = {shield!r}: expected 'override', 'monitor' or None")
    for name, value in (("num_envs", num_envs), ("threads", threads)):
        if not (isinstance(value, int) and value >= 1):
            raise ValueError(f"{name} = {value!r}: expected a whole number >= 1")
    check_penalty(intervention_penalty, penalty_on)
    if backend == "highway-env":
        options: dict[str, Any] = dict(
            params=params,
            rules=rules,
            intervention_penalty=intervention_penalty,
            penalty_on=penalty_on,
            config=config,
        )
        options |= dict(entry=entry, intent=intent, waiting=waiting, examine=examine)
        one = partial(_make_counted, env_id, shield, options)
        return SyncVectorEnv([one] * num_envs, autoreset_mode=autoreset_mode)
    scenario = compile_scenario(env_id, config)
    settings = None
    if shield is not None:
        stock = scenario.stock
        check_environment(stock)
        conduct = check_conduct(entry, intent, waiting, examine)
        settings = settings_for(stock, check_params(params, stock), rules, shield, conduct)
        if settings.scheme == PLANS and not isinstance(stock.action_type, DiscreteMetaAction):
            kind = type(stock.action_type).__name__
            raise Unsupported(f"action type {kind} with a shield where roads cross", "backend = 'highway-env'")
    by_change = penalty_on == "change"
    return FastVectorEnv(scenario, num_envs, settings, intervention_penalty, autoreset_mode, threads, by_change)


def _make_counted(env_id: str, shield: str | None, options: dict) -> gym.Env:
    return RecordEpisodeStatistics(make(env_id, shield, **options))
