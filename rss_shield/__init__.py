"""A Responsibility-Sensitive Safety shield for reinforcement learning on highway-env.

What users need stands here. It is loaded when it is asked for: `rss_shield.shield` alone needs numpy and numba only.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rss_shield.envs.fast.config import Unsupported as Unsupported
    from rss_shield.envs.highway.drivers import RecklessVehicle as RecklessVehicle
    from rss_shield.envs.highway.explained import ExplainedRender as ExplainedRender
    from rss_shield.envs.highway.multi_agent import MultiAgentShield as MultiAgentShield
    from rss_shield.envs.highway.parallel import parallel_env as parallel_env
    from rss_shield.envs.highway.wrapper import ShieldWrapper as ShieldWrapper
    from rss_shield.envs.make import make as make
    from rss_shield.envs.make_vec import make_vec as make_vec
    from rss_shield.shield import PRESETS as PRESETS
    from rss_shield.shield import ROADS as ROADS
    from rss_shield.shield import Preset as Preset
    from rss_shield.shield import Road as Road
    from rss_shield.shield import RSSParams as RSSParams
    from rss_shield.shield import Rules as Rules
    from rss_shield.shield import d_min_lateral as d_min_lateral
    from rss_shield.shield import d_min_longitudinal as d_min_longitudinal
    from rss_shield.shield import d_min_opposite_direction as d_min_opposite_direction
    from rss_shield.shield import d_min_same_direction as d_min_same_direction
    from rss_shield.shield import mu_lateral_velocity as mu_lateral_velocity
    from rss_shield.shield import on_road as on_road

_PUBLIC = {
    "ExplainedRender": "envs.highway.explained",
    "MultiAgentShield": "envs.highway.multi_agent",
    "RecklessVehicle": "envs.highway.drivers",
    "ShieldWrapper": "envs.highway.wrapper",
    "Unsupported": "envs.fast.config",
    "make": "envs.make",
    "make_vec": "envs.make_vec",
    "parallel_env": "envs.highway.parallel",
    **dict.fromkeys(("PRESETS", "ROADS", "Preset", "RSSParams", "Road", "Rules", "on_road"), "shield"),
    **dict.fromkeys(("d_min_lateral", "d_min_longitudinal", "d_min_opposite_direction"), "shield"),
    **dict.fromkeys(("d_min_same_direction", "mu_lateral_velocity"), "shield"),
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)


def __dir__() -> list[str]:
    return __all__
