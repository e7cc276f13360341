"""Named environments and how to make them with a shield."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym

import rss_shield.envs.worlds.signalised  # noqa: F401  registers another one
from rss_shield.envs.highway.multi_agent import MultiAgentShield, has_agents
from rss_shield.envs.highway.wrapper import ShieldWrapper
from rss_shield.envs.options import Params
from rss_shield.envs.stock import make_stock
from rss_shield.shield.params import Rules
from rss_shield.shield.risk import RiskSettings


def make(
    env_id: str,
    shield: str | None = "override",
    params: Params = None,
    rules: Rules | Mapping[str, Any] = Rules(),
    intervention_penalty: float = 0.0,
    penalty_on: str = "response",
    record: bool = False,
    entry: str = "cautious",
    intent: str = "any",
    waiting: str = "line",
    traffic: str = "stock",
    examine: str = "table",
    risk: bool | RiskSettings = False,
    judge_params: Params = None,
    judge_rules: Rules | Mapping[str, Any] | None = None,
    **kwargs,
) -> gym.Env:
    """`gymnasium.make` with a shield around it: `MultiAgentShield` for several agents, `ShieldWrapper` for one.

    Args:
      env_id: "highway-fast-v0", "highway-v0", "two-way-v0", "merge-v0", "signalised-intersection-v0", ...
      shield: "override", "monitor", or None for the bare environment.
      params, rules, intervention_penalty, penalty_on, record, entry, intent, waiting, traffic, examine, risk,
        judge_params, judge_rules: see `ShieldWrapper`.
      kwargs: passed to `gymnasium.make`, e.g. `config={"vehicles_count": 30}`, `render_mode="rgb_array"`.

    Raises:
      ValueError: unknown environment or shield, or whatever `ShieldWrapper` objects to.
    """
    if shield is not None and shield not in ("override", "monitor"):
        raise ValueError(f"shield = {shield!r}: expected 'override', 'monitor' or None")
    if shield is None and traffic != "stock":
        raise ValueError(f"traffic = {traffic!r}: expected 'stock' without a shield; use shield = 'monitor'")
    if shield is None and risk:
        raise ValueError(f"risk = {risk!r}: expected False without a shield; use shield = 'monitor'")
    try:
        env = make_stock(env_id, **kwargs)
    except gym.error.Error as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    if shield is None:
        return env
    wrapper = MultiAgentShield if has_agents(env.unwrapped) else ShieldWrapper
    return wrapper(
        env,
        mode=shield,
        params=params,
        intervention_penalty=intervention_penalty,
        penalty_on=penalty_on,
        rules=rules,
        record=record,
        entry=entry,
        intent=intent,
        waiting=waiting,
        traffic=traffic,
        examine=examine,
        risk=risk,
        judge_params=judge_params,
        judge_rules=judge_rules,
    )
