"""Named environments and how to make them with a shield."""

from typing import Any

import gymnasium as gym

import rss_shield.envs.worlds.crosswalk
import rss_shield.envs.worlds.occluded
import rss_shield.envs.worlds.parking
import rss_shield.envs.worlds.random_roads
import rss_shield.envs.worlds.signalised  # noqa: F401  these register others
from rss_shield.envs.highway.multi_agent import MultiAgentShield, has_agents
from rss_shield.envs.highway.semantic import SemanticActions
from rss_shield.envs.highway.wrapper import ShieldWrapper
from rss_shield.envs.options import MODES, Options, Params, split
from rss_shield.envs.semantic.settings import semantic_settings
from rss_shield.envs.stock import make_stock


def make(
    env_id: str,
    shield: str | None = "override",
    params: Params = None,
    semantic_actions: Any = False,
    **kwargs: Any,
) -> gym.Env:
    """`gymnasium.make` with a shield around it: `MultiAgentShield` for several agents, `ShieldWrapper` for one.

    Args:
      env_id: "highway-fast-v0", "highway-v0", "two-way-v0", "merge-v0", "signalised-intersection-v0", ...
      shield: "override", "monitor", or None for the bare environment.
      params: the table in force, see `ShieldWrapper`.
      semantic_actions: True, or a dict of the fields of `SemanticSettings` that differ: the agent chooses among
        semantic actions in place of meta-actions, see `SemanticActions`.
      kwargs: the other options of a shield: `rules`, `intervention_penalty`, `penalty_on`, `record`, `entry`, `intent`,
        `waiting`, `traffic`, `examine`, `risk`, `measures`, `filter`, `filter_at`, `correction`, `evasion`,
        `replace`, `judge_params`, `judge_rules`, `sensing`, `conditions`, `classes`, see `ShieldWrapper`. The rest
        is passed to `gymnasium.make`, e.g.
        `config={"vehicles_count": 30}`, `render_mode="rgb_array"`.

    Raises:
      ValueError: unknown environment or shield, or whatever `ShieldWrapper` objects to.
    """
    if shield is not None and shield not in MODES:
        raise ValueError(f"shield = {shield!r}: expected 'override', 'monitor' or None")
    given, rest = split({"params": params, **kwargs})
    options, semantic = Options.of(given), semantic_settings(semantic_actions)
    if shield is None and options.traffic != "stock":
        raise ValueError(f"traffic = {options.traffic!r}: expected 'stock' without a shield; use shield = 'monitor'")
    if shield is None and options.risk:
        raise ValueError(f"risk = {options.risk!r}: expected False without a shield; use shield = 'monitor'")
    for name in ("sensing", "conditions", "classes"):
        if shield is None and getattr(options, name) is not None:
            given_as = f"{name} = {getattr(options, name)!r}"
            raise ValueError(f"{given_as}: expected None without a shield; use shield = 'monitor'")
    try:
        env = make_stock(env_id, **rest)
    except gym.error.Error as error:
        raise ValueError(f"env_id = {env_id!r}: {error}") from None
    if shield is not None:
        env = (MultiAgentShield if has_agents(env.unwrapped) else ShieldWrapper)(env, shield, **given)
    return env if semantic is None else SemanticActions(env, semantic)
