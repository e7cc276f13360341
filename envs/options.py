"""What may be asked of a shield, checked where it enters, and what a shield runs with."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from highway_env.envs.common.action import ContinuousAction, DiscreteMetaAction, MultiAgentAction
from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.envs.two_way_env import TwoWayEnv
from highway_env.envs.u_turn_env import UTurnEnv

from rss_shield.envs.arguments import number, preset_of, rules_of
from rss_shield.envs.stock import LOWEST_FREQUENCY, check_frequencies
from rss_shield.envs.worlds.signalised import SignalisedIntersectionEnv
from rss_shield.shield.definitions.kinematics import frames_for
from rss_shield.shield.junctions.controller import CAUTIOUS, ENTRIES
from rss_shield.shield.junctions.examined import EXAMINED, TABLE
from rss_shield.shield.junctions.plans import ANY, INTENTS
from rss_shield.shield.params import Preset, RSSParams, Rules

LANES, PLANS = range(2)  # distances along the lane (Defs. 1-10), or plans through junctions (Defs. 14-18)
MODES = ("override", "monitor")
WAITING = ("line", "anywhere")
TRAFFIC = ("stock", "compliant")  # how everybody else drives
PENALTIES = ("response", "change")  # what an intervention penalty is charged for
SUPPORTED = (
    "highway-v0, highway-fast-v0, two-way-v0, merge-v0/-v1, exit-v0/-v1, u-turn-v0/-v1, roundabout-v0/-v1, "
    "roundabout-generic-v0, intersection-v0/-v1/-v2, intersection-multi-agent-v0/-v1/-v2, signalised-intersection-v0"
)
Params = str | Preset | Sequence[RSSParams] | Mapping[str, Any] | None  # see `ShieldWrapper`
_SCHEMES = {
    **dict.fromkeys((HighwayEnv, TwoWayEnv, MergeEnv, ExitEnv, UTurnEnv), LANES),
    RoundaboutEnv: PLANS,
    IntersectionEnv: PLANS,
}


class Settings(NamedTuple):
    """What a shield runs with, response times in whole frames."""

    ego: RSSParams
    other: RSSParams
    rules: Rules
    overrides: bool  # False: watch only
    dt: float  # length of a simulation frame [s]
    scheme: int = LANES  # what keeps the ego safe: LANES or PLANS
    entry: int = CAUTIOUS  # whom the ego expects to give way: index into `shield.junctions.controller.ENTRIES`
    intent: int = ANY  # which routes it expects of others: index into `shield.junctions.plans.INTENTS`
    waits_anywhere: bool = False  # it may also wait inside a junction, in the way of nobody who is there yet
    examine: int = TABLE  # against whom plans are checked: index into `shield.junctions.examined.EXAMINED`


def check_options(mode: str, intervention_penalty: float, penalty_on: str, traffic: str) -> None:
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}: expected one of {', '.join(MODES)}")
    number("intervention_penalty", intervention_penalty, 0.0)
    if penalty_on not in PENALTIES:
        raise ValueError(f"penalty_on = {penalty_on!r}: expected one of {', '.join(PENALTIES)}")
    if traffic not in TRAFFIC:
        raise ValueError(f"traffic = {traffic!r}: expected one of {', '.join(TRAFFIC)}")


def check_environment(env: Any) -> None:
    """Can one ego be shielded in an environment?"""
    check_kind(env)
    check_frequencies(env.config)
    if isinstance(env.action_type, MultiAgentAction):
        raise ValueError("action type MultiAgentAction is not supported by ShieldWrapper; expected MultiAgentShield")
    if len(env.controlled_vehicles) != 1:
        raise ValueError(f"controlled_vehicles = {len(env.controlled_vehicles)}: expected exactly 1")
    check_action_type(env.action_type, env)


def check_kind(env: Any) -> None:
    if not isinstance(env, tuple(_SCHEMES)):
        raise ValueError(f"environment {type(env).__name__} is not supported; expected one of {SUPPORTED}")


def check_action_type(action_type: Any, env: Any) -> None:
    """Can the shield restrict what an agent may do with its car?"""
    if not isinstance(action_type, (DiscreteMetaAction, ContinuousAction)):
        raise ValueError(
            f"action type {type(action_type).__name__} is not supported; "
            "expected DiscreteMetaAction, ContinuousAction or DiscreteAction"
        )
    if isinstance(action_type, ContinuousAction):
        _check_free_driving(action_type, env)


def _check_free_driving(action_type: ContinuousAction, env: Any) -> None:
    lowest = (action_type.speed_range or (0.0,))[0]
    if lowest > 0.0:
        raise ValueError(f"action option speed_range starts at {lowest:g} m/s: expected <= 0, or nobody could stop")
    if scheme_of(env) == LANES:
        if action_type.dynamical:
            raise ValueError("action option dynamical = True is supported at intersections only; expected False")
        return
    if not isinstance(env, IntersectionEnv) or isinstance(env, SignalisedIntersectionEnv):
        raise ValueError(
            f"action type {type(action_type).__name__} is not supported on {type(env).__name__}, because a car that is "
            "steered freely may leave its route there; expected DiscreteMetaAction"
        )
    if not env.config["destination"]:
        raise ValueError(
            f"config destination = {env.config['destination']!r}: expected a node such as 'o1', because a car that is "
            "steered freely has to declare its route"
        )


def scheme_of(env: Any) -> int:
    """What keeps the ego safe in an environment: LANES or PLANS."""
    return next(scheme for kind, scheme in _SCHEMES.items() if isinstance(env, kind))


def check_conduct(entry: str, intent: str, waiting: str, examine: str) -> dict[str, Any]:
    """The fields of `Settings` that say how the ego behaves at junctions."""
    for name, value, known in (
        ("entry", entry, ENTRIES),
        ("intent", intent, INTENTS),
        ("waiting", waiting, WAITING),
        ("examine", examine, EXAMINED),
    ):
        if value not in known:
            raise ValueError(f"{name} = {value!r}: expected one of {', '.join(known)}")
    return {
        "entry": ENTRIES.index(entry),
        "intent": INTENTS.index(intent),
        "waits_anywhere": waiting == "anywhere",
        "examine": EXAMINED.index(examine),
    }


def default_preset(env: Any) -> str:
    """Name of the preset that states the limits of an environment's traffic."""
    return "intersection" if isinstance(env, IntersectionEnv) else "simulator"


def check_params(params: Any, env: Any, name: str = "params") -> Preset:
    """The table that somebody asks for in an environment; see `envs.arguments.preset_of`."""
    return preset_of(params, default_preset(env), name)


def judge_of(params: Any, rules: Any, own: Preset, own_rules: Rules, env: Any) -> tuple[Preset, Rules] | None:
    """The table by which an ego is judged, None = the one by which it is restricted."""
    if params is None and rules is None:
        return None
    preset = own if params is None else check_params(params, env, "judge_params")
    return preset, own_rules if rules is None else rules_of(rules, "judge_rules")


def settings_for(env: Any, params: Preset, rules: Rules, mode: str, conduct: dict[str, Any]) -> Settings:
    """What a shield on `env` runs with: response times rounded up to whole frames (condition C2)."""
    dt = 1 / env.config["simulation_frequency"]
    rho = params.ego.response_time
    if rho < dt - 1e-9 and not params.per_frame:
        raise ValueError(
            f"response_time = {rho:g} s of the ego is shorter than one simulation frame; expected >= {dt:g} s"
        )
    ego = params.ego._replace(response_time=float(frames_for(max(rho, dt), dt) * dt))
    other = params.other._replace(response_time=float(frames_for(params.other.response_time, dt) * dt))
    scheme = scheme_of(env)
    if scheme == PLANS and dt > 1 / LOWEST_FREQUENCY + 1e-9:
        raise ValueError(
            f"config simulation_frequency = {env.config['simulation_frequency']}: expected >= {LOWEST_FREQUENCY} where "
            "roads cross, because plans look at single frames"
        )
    if scheme == PLANS:  # the paths hold everybody's width at any speed, so lateral speeds need no limit
        rules = rules._replace(limits=False)
    return Settings(ego, other, rules, mode == "override", dt, scheme, **conduct)
