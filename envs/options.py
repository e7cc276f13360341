"""What may be asked of a shield, checked where it enters, and what a shield runs with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from typing import Any, NamedTuple, TypedDict

from highway_env.envs.common.action import ContinuousAction, DiscreteMetaAction, MultiAgentAction
from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.lane_keeping_env import LaneKeepingEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.parking_env import ParkingEnv
from highway_env.envs.racetrack_env import RacetrackEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.envs.two_way_env import TwoWayEnv
from highway_env.envs.u_turn_env import UTurnEnv

from rss_shield.envs.arguments import number, preset_of, rules_of
from rss_shield.envs.conditions import ground_of, pieces_of, shares_of
from rss_shield.envs.roads.bicycle import longest_frame
from rss_shield.envs.sensing import Sensing
from rss_shield.envs.stock import LOWEST_FREQUENCY, check_frequencies
from rss_shield.envs.worlds.occluded import OccludedIntersectionEnv
from rss_shield.envs.worlds.signalised import SignalisedIntersectionEnv
from rss_shield.envs.worlds.streets import StreetEnv
from rss_shield.shield.filters.answer import FILTERS, RSS, THRESHOLDS, Filter
from rss_shield.shield.ground import CONDITIONS, Ground
from rss_shield.shield.junctions.examined import EXAMINED, TABLE
from rss_shield.shield.junctions.memory import CAUTIOUS, ENTRIES
from rss_shield.shield.junctions.plans import ANY, INTENTS
from rss_shield.shield.lanes.correction import CORRECTIONS, NEAREST
from rss_shield.shield.open_space.frames import WHEELS
from rss_shield.shield.params import Preset, RSSParams, Rules, Table
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.table import table_for

# distances along the lane (Defs. 1-10), plans through junctions (14-18), trajectories where nothing is marked (19-22)
LANES, PLANS, OPEN_SPACE = range(3)
MODES = ("override", "monitor")
WAITING = ("line", "anywhere")
CAR_MASS = 1500.0  # of everybody [kg]: highway-env's vehicles have none
TRAFFIC = ("stock", "compliant")  # how everybody else drives
PENALTIES = ("response", "change")  # what an intervention penalty is charged for
REPLACES = ("frame", "decision")  # what an action that is not permitted is replaced on
SUPPORTED = (
    "highway-v0, highway-fast-v0, two-way-v0, merge-v0/-v1, merge-generic-v0/-v1, exit-v0/-v1, u-turn-v0/-v1, "
    "racetrack-v0/-v1, racetrack-large-v0/-v1, racetrack-oval-v0/-v1, lane-keeping-v0, roundabout-v0/-v1, "
    "roundabout-generic-v0/-v1, intersection-v0/-v1/-v2, intersection-multi-agent-v0/-v1/-v2, "
    "signalised-intersection-v0, crosswalk-v0, parked-row-v0, occluded-intersection-v0, "
    "parking-v0, parking-parked-v0, parking-ActionRepeat-v0, shared-parking-v0"
)
Params = str | Preset | Sequence[RSSParams] | Mapping[str, Any] | None  # see `ShieldWrapper`
_SCHEMES = {
    **dict.fromkeys((HighwayEnv, TwoWayEnv, MergeEnv, ExitEnv, UTurnEnv, RacetrackEnv, LaneKeepingEnv), LANES),
    RoundaboutEnv: PLANS,
    IntersectionEnv: PLANS,
    StreetEnv: PLANS,
    ParkingEnv: OPEN_SPACE,
}
_META_ONLY = (OccludedIntersectionEnv, StreetEnv)  # where people walk, a car has to keep to its route


class Settings(NamedTuple):
    """What a shield runs with."""

    table: Table
    overrides: bool  # False: watch only
    scheme: int = LANES  # what keeps the ego safe: LANES, PLANS or OPEN_SPACE
    entry: int = CAUTIOUS  # whom the ego expects to give way: index into `shield.junctions.memory.ENTRIES`
    intent: int = ANY  # which routes it expects of others: index into `shield.junctions.plans.INTENTS`
    waits_anywhere: bool = False  # it may also wait inside a junction, in the way of nobody who is there yet
    examine: int = TABLE  # against whom plans are checked: index into `shield.junctions.examined.EXAMINED`
    filter: Filter = Filter(RSS)  # what acts in the shield's place
    correction: int = NEAREST  # what a duty makes of a command: index into `shield.lanes.correction.CORRECTIONS`
    evasion: bool = False  # manoeuvres out of others' way where that is owed (Def. 13)


class Given(TypedDict, total=False):
    """`Options` by name, as keyword arguments, without the table."""

    rules: Rules | Mapping[str, Any]
    intervention_penalty: float
    penalty_on: str
    record: bool
    entry: str
    intent: str
    waiting: str
    traffic: str
    examine: str
    risk: bool | RiskSettings
    measures: bool
    filter: str
    filter_at: float | None
    correction: str
    evasion: bool
    replace: str
    judge_params: Params
    judge_rules: Rules | Mapping[str, Any] | None
    sensing: Sensing | Mapping[str, Any] | None
    conditions: str | Mapping[tuple[float, float], str] | None
    classes: Mapping[str, float] | None


@dataclass(frozen=True)
class Options:
    """What may be asked of a shield; `ShieldWrapper` says what each option means.

    Raises:
      ValueError: names the option, its value and what is expected. Tables depend on the environment: see `params_in`.
    """

    params: Params = None
    rules: Rules | Mapping[str, Any] = field(default_factory=Rules)
    intervention_penalty: float = 0.0
    penalty_on: str = "response"
    record: bool = False
    entry: str = "cautious"
    intent: str = "any"
    waiting: str = "line"
    traffic: str = "stock"
    examine: str = "table"
    risk: bool | RiskSettings = False
    measures: bool = False
    filter: str = "rss"
    filter_at: float | None = None
    correction: str = "nearest"
    evasion: bool = False
    replace: str = "frame"
    judge_params: Params = None
    judge_rules: Rules | Mapping[str, Any] | None = None
    sensing: Sensing | Mapping[str, Any] | None = None
    conditions: str | Mapping[tuple[float, float], str] | None = None
    classes: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        number("intervention_penalty", self.intervention_penalty, 0.0)
        for name, known in (
            ("penalty_on", PENALTIES),
            ("traffic", TRAFFIC),
            ("entry", ENTRIES),
            ("intent", INTENTS),
            ("waiting", WAITING),
            ("examine", EXAMINED),
            ("filter", FILTERS),
            ("correction", CORRECTIONS),
            ("replace", REPLACES),
        ):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected one of {', '.join(known)}")

        Sensing.of(self.sensing)
        pieces_of(self.conditions)
        shares_of(self.classes)
        for name in ("measures", "evasion"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected True or False")
        if self.filter_at is not None:
            number("filter_at", self.filter_at, 0.01)
            if FILTERS.index(self.filter) not in THRESHOLDS:
                able = ", ".join(FILTERS[kind] for kind in THRESHOLDS)
                raise ValueError(
                    f"filter_at = {self.filter_at!r} with filter = {self.filter!r}: expected one of {able}"
                )

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Options":
        """Options by name.

        Raises:
          ValueError: a name that is none.
        """
        known = [option.name for option in fields(cls)]
        for name, value in given.items():
            if name not in known:
                nearest = get_close_matches(name, known, n=1, cutoff=0.0)[0]
                raise ValueError(f"{name} = {value!r}: not an option of the shield; the nearest is {nearest}")
        return cls(**given)

    @property
    def conduct(self) -> dict[str, Any]:
        """The fields of `Settings` that say how the ego behaves at junctions, and what answers in which way."""
        return {
            "entry": ENTRIES.index(self.entry),
            "intent": INTENTS.index(self.intent),
            "waits_anywhere": self.waiting == "anywhere",
            "examine": EXAMINED.index(self.examine),
            "filter": self._filter,
            "correction": CORRECTIONS.index(self.correction),
            "evasion": self.evasion,
        }

    @property
    def _filter(self) -> Filter:
        kind = FILTERS.index(self.filter)
        return Filter(kind, float(THRESHOLDS.get(kind, 0.0) if self.filter_at is None else self.filter_at))

    def params_in(self, env: Any) -> Preset:
        """The table that the egos of an environment are restricted by; see `envs.arguments.preset_of`."""
        return preset_of(self.params, default_preset(env), "params")

    def judge_in(self, env: Any) -> tuple[Preset, Rules] | None:
        """What they are judged by, None = what they are restricted by."""
        if self.judge_params is None and self.judge_rules is None:
            return None
        own = self.judge_params is None
        preset = self.params_in(env) if own else preset_of(self.judge_params, default_preset(env), "judge_params")
        return preset, rules_of(self.rules) if self.judge_rules is None else rules_of(self.judge_rules, "judge_rules")


def check_risk(risk: Any) -> RiskSettings | None:
    """Settings of the measure of risk, or None if it is off.

    Raises:
      ValueError: neither a truth value nor settings in their ranges.
    """
    if isinstance(risk, RiskSettings):
        return RiskSettings.validated(**risk._asdict())
    if not isinstance(risk, bool):
        raise ValueError(f"risk = {risk!r}: expected True, False or RiskSettings")
    return RiskSettings() if risk else None


def split(arguments: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is an option of the shield, and the rest."""
    names = {option.name for option in fields(Options)}
    given = {name: value for name, value in arguments.items() if name in names}
    return given, {name: value for name, value in arguments.items() if name not in names}


def check_mode(mode: Any) -> None:
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}: expected one of {', '.join(MODES)}")


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
    if isinstance(action_type, DiscreteMetaAction) and scheme_of(env) == OPEN_SPACE:
        raise ValueError(
            "action type DiscreteMetaAction is not supported where cars are parked, because it follows lanes; expected "
            "ContinuousAction or DiscreteAction"
        )
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
        frequency, lowest = env.config["simulation_frequency"], 1 / longest_frame()
        if action_type.dynamical and frequency < lowest and not _is_alone(env):
            raise ValueError(
                f"action option dynamical = True with config simulation_frequency = {frequency}: expected >= "
                f"{lowest:.0f} along lanes, because longer frames make a slow car whose tyres slip swing about"
            )
        return
    if scheme_of(env) == OPEN_SPACE:
        _check_open_space(action_type)
        return
    if isinstance(env, _META_ONLY):
        raise ValueError(
            f"action type {type(action_type).__name__} is not supported on {type(env).__name__}, because a car that is "
            "steered freely may leave its route there; expected DiscreteMetaAction"
        )
    if not destination_of(env):
        raise ValueError(
            f"config destination = {env.config['destination']!r}: expected a node such as 'o1', because a car that is "
            "steered freely has to declare its route"
        )


def _is_alone(env: Any) -> bool:
    """Is nobody else on the road, nor ever will be?"""
    return isinstance(env, LaneKeepingEnv) and len(env.road.vehicles) + len(env.road.objects) == 1


def destination_of(env: Any) -> str | None:
    """Node to which a car that is steered freely goes: the one of the configuration, or of highway-env's own ego."""
    return env.config.get("destination", "nxs" if isinstance(env, RoundaboutEnv) else None)


def keeps_speed(env: Any, action_type: Any) -> bool:
    """Has the agent no say in the speed of its car, on a road on which there is one to keep?"""
    return isinstance(env, RacetrackEnv) and isinstance(action_type, ContinuousAction) and not action_type.longitudinal


def _check_open_space(action_type: ContinuousAction) -> None:
    if action_type.dynamical:
        raise ValueError("action option dynamical = True: expected False where cars are parked")
    low, high = action_type.steering_range
    if not -WHEELS - 1e-9 <= low <= high <= WHEELS + 1e-9:
        raise ValueError(
            f"action option steering_range = {(low, high)}: expected within +-{WHEELS:.4f} rad where cars are parked, "
            "because everybody relies on no car to turn tighter"
        )


def check_replace(options: Options, env: Any) -> None:
    """Can actions be replaced at the start of a decision, if that is asked for?"""
    if options.replace == "decision" and not isinstance(env.action_type, DiscreteMetaAction):
        kind = type(env.action_type).__name__
        raise ValueError(f"replace = 'decision' with action type {kind}: expected DiscreteMetaAction, or 'frame'")


def sensing_in(env: Any, given: Any) -> Sensing | None:
    """What goes wrong with what a shield sees in an environment; None = nothing."""
    sensing = Sensing.of(given)
    if sensing is None:
        return None
    if scheme_of(env) == OPEN_SPACE:
        raise ValueError("sensing: expected None where nothing is marked")
    if sensing.inflate and scheme_of(env) != LANES:
        raise ValueError("sensing.inflate = True: expected False where roads cross")
    if sensing.wrong_light > 0.0 and not isinstance(env, SignalisedIntersectionEnv):
        raise ValueError(f"sensing.wrong_light = {sensing.wrong_light!r}: expected 0 where there are no lights")
    return sensing


def ground_in(env: Any, settings: Settings, conditions: Any, classes: Any) -> Ground | None:
    """The ground of an environment, None where all of it is alike; see `on_ground`.

    Raises:
      ValueError: where roads cross there is one condition for all, and cars are all there are.
    """
    if settings.scheme == OPEN_SPACE and conditions is not None:
        raise ValueError(f"conditions = {conditions!r}: expected None where nothing is marked")
    if settings.scheme != LANES and classes is not None:
        raise ValueError(f"classes = {classes!r}: expected None where roads cross")
    if settings.scheme != LANES and isinstance(conditions, Mapping):
        raise ValueError(f"conditions = {conditions!r}: expected one of {', '.join(CONDITIONS)} where roads cross")
    return ground_of(settings.table, conditions, classes)


def on_ground(settings: Settings, ground: Ground | None) -> Settings:
    """What a shield runs with on that ground: its parameters change with the place, but where roads cross."""
    if ground is None:
        return settings
    table = settings.table
    if settings.scheme == LANES:
        return settings._replace(table=table._replace(others=ground.other))
    state = int(ground.roads[0]) * (len(CONDITIONS) + 1)
    ego, other = (RSSParams(*map(float, rows[state])) for rows in (ground.ego, ground.other))
    return settings._replace(table=table._replace(ego=ego, other=other))


def scheme_of(env: Any) -> int:
    """What keeps the ego safe in an environment: LANES, PLANS or OPEN_SPACE."""
    return next(scheme for kind, scheme in _SCHEMES.items() if isinstance(env, kind))


def default_preset(env: Any) -> str:
    """Name of the preset that states the limits of an environment's traffic."""
    if isinstance(env, ParkingEnv):
        return "parking"
    return "intersection" if isinstance(env, IntersectionEnv) else "simulator"


def check_traffic(traffic: str, env: Any) -> None:
    """Compliant traffic follows lanes."""
    if traffic != "stock" and scheme_of(env) == OPEN_SPACE:
        raise ValueError(f"traffic = {traffic!r}: expected 'stock' where cars are parked: agents are all that drives")


def settings_for(env: Any, params: Preset, rules: Rules, mode: str, conduct: dict[str, Any]) -> Settings:
    """What a shield on `env` runs with: response times rounded up to whole frames (condition C2)."""
    dt = 1 / env.config["simulation_frequency"]
    scheme = scheme_of(env)
    if scheme == PLANS and dt > 1 / LOWEST_FREQUENCY + 1e-9:
        raise ValueError(
            f"config simulation_frequency = {env.config['simulation_frequency']}: expected >= {LOWEST_FREQUENCY} where "
            "roads cross, because plans look at single frames"
        )
    if scheme == PLANS:  # the paths hold everybody's width at any speed, so lateral speeds need no limit
        rules = rules._replace(limits=False)
    if isinstance(env, LaneKeepingEnv):  # whose tyres slip, which the limits of lateral motion do not know
        rules = rules._replace(limits=False)
    if scheme == OPEN_SPACE:
        _check_open_table(params)
    _check_distances(scheme, conduct)
    if conduct["filter"].kind != RSS:  # nothing that is the shield's own acts beside another filter
        rules = rules._replace(take_back=False, anticipation=0.0)
    return Settings(table_for(params, rules, dt), mode == "override", scheme, **conduct)


def _check_open_table(params: Preset) -> None:
    """Where nothing is marked, everybody else sees in the ego one of the others: it must keep what is said of those."""
    ego, other = params.ego, params.other
    for name, kept in (
        ("a_max_accel", ego.a_max_accel <= other.a_max_accel),
        ("v_cap", ego.v_cap <= other.v_cap),
        ("a_max_brake", ego.a_max_brake <= other.a_max_brake),
        ("a_min_brake", other.a_min_brake <= ego.a_min_brake <= other.a_max_brake),
    ):
        if not kept:
            raise ValueError(
                f"params: {name} = {getattr(ego, name):g} of the ego is not within what holds for others "
                f"({getattr(other, name):g}): expected so where cars are parked"
            )


def _check_distances(scheme: int, conduct: dict[str, Any]) -> None:
    """Some options are about distances along lanes."""
    for name, index, known in (
        ("filter", conduct["filter"].kind, FILTERS),
        ("correction", conduct["correction"], CORRECTIONS),
    ):
        if scheme != LANES and index != 0:
            where = "where roads cross" if scheme == PLANS else "where cars are parked"
            raise ValueError(f"{name} = {known[index]!r}: expected {known[0]!r} {where}")
    if conduct["evasion"] and scheme != LANES:
        where = "where roads cross" if scheme == PLANS else "where cars are parked"
        raise ValueError(f"evasion = True: expected False {where}")
    if conduct["evasion"] and conduct["filter"].kind != RSS:
        raise ValueError(f"evasion = True with filter = {FILTERS[conduct['filter'].kind]!r}: expected filter = 'rss'")
