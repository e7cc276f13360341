"""Many environments at once, on either simulator."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper
from gymnasium.wrappers import RecordEpisodeStatistics
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.arguments import reset_options, rules_of, seed_of, whole
from rss_shield.envs.fast.config import Scenario, Unsupported, compile_scenario
from rss_shield.envs.fast.pictures import MODES as RENDER_MODES
from rss_shield.envs.fast.semantic import SemanticVectorEnv
from rss_shield.envs.fast.vector import FastVectorEnv
from rss_shield.envs.fast.views.record import KINEMATICS, TIME_TO_COLLISION
from rss_shield.envs.highway.multi_agent import check_agents, check_replace_of_agents
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
    ground_in,
    on_ground,
    scheme_of,
    sensing_in,
    settings_for,
    split,
)
from rss_shield.envs.semantic.settings import SemanticSettings, check_unreplaced, semantic_settings
from rss_shield.envs.sensing import Sensing
from rss_shield.envs.stock import hands_out_rewards
from rss_shield.shield.ground import Ground
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
    wrappers: Sequence[Callable[[Any], Any]] = (),
    semantic_actions: Any = False,
    **kwargs: Any,
) -> VectorEnv:
    """Environments side by side, each with a shield around its ego.

    Both backends have the same spaces, seeds, episodes and infos. gymnasium's vector wrappers that ask for it
    (`NormalizeObservation`, `FlattenObservation`) take `autoreset_mode=AutoresetMode.NEXT_STEP` on either.

    Args:
      env_id: "highway-fast-v0", "highway-v0", ...; "intersection-multi-agent-v0" for several agents, see
        `FastVectorEnv`.
      num_envs: how many.
      shield: "override", "monitor", or None for bare environments.
      backend: "fast", the compiled engine, or "highway-env", the original one after the other.
      params: the table in force, see `ShieldWrapper`.
      config: as for `gymnasium.make` of a highway-env environment.
      threads: of the compiled engine.
      autoreset_mode: see `FastVectorEnv`; gymnasium's, or its value as a text.
      wrappers: put around in this order: each `VectorWrapper` of gymnasium around the whole on either backend, others
        around each environment where the backend is "highway-env".
      semantic_actions: True, or a dict of the fields of `SemanticSettings` that differ, see `SemanticActions`.
      kwargs: `max_episode_steps`; `render_mode` (the engine knows "rgb_array"); `rules`, `intervention_penalty`,
        `penalty_on`, `entry`, `intent`, `waiting`, `examine`, `filter`, `filter_at`, `correction`, `evasion`,
        `replace`, `risk`, `conditions`, `classes` and, along lanes, `sensing` of `ShieldWrapper`; and whatever else
        `make` takes (`traffic`, `judge_params`, ...) where the backend is "highway-env".

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
    if not isinstance(wrappers, Sequence) or not all(callable(wrapper) for wrapper in wrappers):
        raise ValueError(f"wrappers = {wrappers!r}: expected a list of wrappers")
    around = [wrapper for wrapper in wrappers if _is_for_batches(wrapper)]
    within = [wrapper for wrapper in wrappers if not _is_for_batches(wrapper)]
    if within and backend == "fast":
        name = getattr(within[0], "__name__", repr(within[0]))
        raise Unsupported(f"wrappers = [{name}]", "gymnasium.vector.VectorWrapper classes, or backend = 'highway-env'")
    given, rest = split({"params": params, **kwargs})
    options, semantic = Options.of(given), semantic_settings(semantic_actions)
    envs: VectorEnv
    if backend == "highway-env":
        arguments = {**given, **rest, "config": config, "semantic_actions": semantic_actions}
        one = partial(_make_counted, env_id, shield, within, arguments)
        envs = _SideBySide([one] * num_envs, autoreset_mode=autoreset_mode)
    else:
        envs = _in_engine(env_id, num_envs, shield, options, config, threads, autoreset_mode, semantic, rest)
    for wrapper in around:
        envs = wrapper(envs)
    return envs


def _in_engine(
    env_id: str,
    num_envs: int,
    shield: str | None,
    options: Options,
    config: dict | None,
    threads: int,
    autoreset_mode: AutoresetMode,
    semantic: SemanticSettings | None,
    rest: dict[str, Any],
) -> VectorEnv:
    _check_supported(options, rest)
    scenario = compile_scenario(env_id, config, max_episode_steps=rest.get("max_episode_steps"))
    settings = _settings_in(scenario, shield, options) if shield is not None else None
    if semantic is not None and scenario.agents is not None:
        raise Unsupported("semantic_actions of several agents", "False")
    penalty, by_change = float(options.intervention_penalty), options.penalty_on == "change"
    replaces, risk = shield is not None and options.replace == "decision", _risk_in(shield, options)
    wanted = autoreset_mode
    if semantic is not None:
        check_unreplaced(options)
        if wanted == AutoresetMode.SAME_STEP:
            autoreset_mode = AutoresetMode.DISABLED
    ground = _ground_in(scenario, settings, options)
    if settings is not None:
        settings = on_ground(settings, ground)
    rules = settings, penalty, autoreset_mode, threads, by_change, replaces, risk, rest.get("render_mode")
    env = FastVectorEnv(
        scenario, num_envs, *rules, semantic is not None, _sensing_in(scenario, shield, options), ground
    )
    return env if semantic is None else SemanticVectorEnv(env, semantic, wanted)


def _is_for_batches(wrapper: Any) -> bool:
    return isinstance(wrapper, type) and issubclass(wrapper, VectorWrapper)


def _check_supported(options: Options, rest: dict[str, Any]) -> None:
    """Does the engine know all that is asked for?"""
    unknown = {name: getattr(options, name) for name in _OF_HIGHWAY_ENV}
    unknown = {name: value for name, value in unknown.items() if value != _OF_HIGHWAY_ENV[name]}
    known = ("max_episode_steps", "render_mode")
    others = {name: value for name, value in rest.items() if value is not None and name not in known}
    for name, value in (unknown | others).items():
        raise Unsupported(f"{name} = {value!r}", "backend = 'highway-env'")
    if rest.get("render_mode") not in (None, *RENDER_MODES):
        raise Unsupported(f"render_mode = {rest['render_mode']!r}", f"{RENDER_MODES[0]!r}, or backend = 'highway-env'")


def _settings_in(scenario: Scenario, shield: str, options: Options) -> Settings:
    stock = scenario.stock
    if scenario.agents is None:
        check_environment(stock)
        check_replace(options, stock)
    else:
        check_agents(stock)
        check_replace_of_agents(options)
    settings = settings_for(stock, options.params_in(stock), rules_of(options.rules), shield, options.conduct)
    if settings.scheme == PLANS and not isinstance(scenario.kind, DiscreteMetaAction):
        kind = type(scenario.kind).__name__
        raise Unsupported(f"action type {kind} with a shield where roads cross", "backend = 'highway-env'")
    return settings


def _ground_in(scenario: Scenario, settings: Settings | None, options: Options) -> Ground | None:
    """Conditions of the road and classes of vehicles."""
    if settings is not None:
        return ground_in(scenario.stock, settings, options.conditions, options.classes)
    for name in ("conditions", "classes"):
        if getattr(options, name) is not None:
            raise ValueError(f"{name} = {getattr(options, name)!r}: expected None without a shield; use 'monitor'")
    return None


def _sensing_in(scenario: Scenario, shield: str | None, options: Options) -> Sensing | None:
    """What goes wrong with what is seen."""
    if options.sensing is not None and shield is None:
        raise ValueError(f"sensing = {options.sensing!r}: expected None without a shield; use shield = 'monitor'")
    sensing = sensing_in(scenario.stock, options.sensing)
    if sensing is None:
        return None
    if scheme_of(scenario.stock) == PLANS:
        raise Unsupported("sensing where roads cross", "backend = 'highway-env'")
    kind = scenario.view.record[0]["kind"]
    if sensing.agent and (kind not in (KINEMATICS, TIME_TO_COLLISION) or scenario.glances):
        raise Unsupported("sensing.agent with observations of that type", "agent = False, or backend = 'highway-env'")
    if sensing.agent and sensing.ghosts > 0.0 and kind == TIME_TO_COLLISION:
        raise Unsupported("sensing.ghosts in observed times to collision", "agent = False, or backend = 'highway-env'")
    if scenario.linear is not None:
        raise Unsupported("sensing among linear drivers", "backend = 'highway-env'")
    sensing.sensor(float(scenario.config["dt"][0]))
    return sensing


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
}


class _SideBySide(SyncVectorEnv):
    """gymnasium's, for seeds of numpy and several agents as well."""

    def reset(self, *, seed: Any = None, options: dict | None = None):
        reset_options(options)
        several = seed is not None and np.ndim(seed) > 0
        return super().reset(seed=[seed_of(one) for one in seed] if several else seed_of(seed), options=options)

    def _add_info(self, vector_infos: dict, env_info: dict, env_num: int) -> dict:
        """gymnasium's; what is said of each of several agents becomes arrays, too."""
        agents = env_info.get("agents")
        if agents is None:
            return super()._add_info(vector_infos, env_info, env_num)
        rest = {name: value for name, value in env_info.items() if name != "agents"}
        infos = super()._add_info(vector_infos, rest, env_num)
        before = infos.get("agents", tuple({} for _ in agents))
        infos["agents"] = tuple(
            super(_SideBySide, self)._add_info(*one, env_num) for one in zip(before, agents, strict=True)
        )
        infos.setdefault("_agents", np.zeros(self.num_envs, bool))[env_num] = True
        return infos


def _autoreset(mode: Any) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(f"AutoresetMode.{known.name}" for known in AutoresetMode)
        raise ValueError(f"autoreset_mode = {mode!r}: expected one of {names}") from None


def _make_counted(env_id: str, shield: str | None, wrappers: list, options: dict) -> gym.Env:
    one = make(env_id, shield, **options)
    if hands_out_rewards(one):
        raise ValueError(
            f"env_id = {env_id!r} with backend = 'highway-env': each agent has a reward of its own, and gymnasium's "
            "batches have room for one; expected 'intersection-multi-agent-v0', or backend = 'fast'"
        )
    env: gym.Env = RecordEpisodeStatistics(one)
    for wrapper in wrappers:
        env = wrapper(env)
    return env
