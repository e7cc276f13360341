"""ShieldWrapper: the RSS shield around a highway-env environment."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs
from highway_env.envs.common.action import ContinuousAction, DiscreteMetaAction, MultiAgentAction
from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.envs.two_way_env import TwoWayEnv
from highway_env.envs.u_turn_env import UTurnEnv

from envs.arguments import action_of, number, plain, preset_of, rules_of, seed_of
from envs.egos import EgoShields
from envs.highway import LANES, PLANS, Frame, Settings, ShieldedEgo
from envs.risk import RiskFrame, check_risk
from envs.shielding import PENALTIES, audit_of, begin_step, charge, end_step, info_of, tell_inside
from envs.signalised import SignalisedIntersectionEnv
from envs.stock import LOWEST_FREQUENCY, check_frequencies
from envs.traffic import TRAFFIC
from shield.blame import Audit
from shield.examined import EXAMINED
from shield.junction import ENTRIES
from shield.kinematics import frames_for
from shield.params import Preset, RSSParams, Rules
from shield.plans import INTENTS
from shield.risk import RiskSettings

MODES = ("override", "monitor")
WAITING = ("line", "anywhere")
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


class ShieldWrapper(EgoShields, RecordConstructorArgs):
    """Watches the ego on every simulation frame and says who is to blame at a contact.

    In mode "override" a command that RSS does not permit is replaced by the proper response; in
    mode "monitor" nothing is changed and the trajectory is the bare environment's, bit for bit.
    Observations are never changed; rewards only by `intervention_penalty`.
    The shield is on whichever vehicle is the ego at a step; it is copied with its vehicle.

    Every info has

      shield: dict of this step: `intervened`, `override_fraction` (share of the frames in which a
        duty toward somebody changed the command: the proper response), `anticipation_fraction` (in which no duty did,
        but anticipation), `limited_fraction` (in which only the always-on limits did), `proposed_action` (after a
        step), `acceleration_change` [m/s^2] and `steering_change` [rad] (largest), `mean_acceleration_change` and
        `mean_steering_change` (over the frames), `lane_change_refused`, `dangerous`, `dangerous_pairs`, `broken_duties`
        (pair-frames), and for the pair nearest to danger `partner` (index in `road.vehicles`,
        static objects after them, -1 = nobody; where roads cross, who was in the way when the ego was first
        held back in this step), `min_margin_lon`, `min_margin_lat` (gap minus required gap [m], inf = nobody);
        `response`: "none", "longitudinal", "lateral", "both", or "go": on
        through a junction.
      cost: 1.0 if the ego broke its proper response in this step or a contact was its fault.
      blame: "" before a contact, then "ego", "other", "both", "inherited", or "none" (a bug).
      blame_evidence: {} or partner, kind of danger, seconds since its threshold, duties broken and
        by how much.
      override_share, anticipation_share, limited_share, mean_acceleration_change [m/s^2], mean_steering_change [rad]:
        the same since reset.
      rms_acceleration, rms_jerk, ..., hard_brakings_per_km, min_time_gap: how the ride felt since reset, see
        `shield.comfort.Comfort`. Time gaps are measured where distances along lanes keep the ego safe.
      episode_cost, episode_dangerous_pairs, episode_broken_duties, min_ttc: since
        reset; min_ttc [s] is at most 100.
      raw_reward: the environment's own reward (after a step).
      time: since reset [s].
      is_success: has the ego reached its goal? Only where there is one: past an intersection, on the exit
        (after a step).
      risk: only with the option `risk`: of the worst frame of this step `rdsi`, its thresholds `lower` and `upper`,
        `state` ("known_safe", "unknown", "known_unsafe") and `partner`; the `largest` of one source and the largest
        `total` of all and of lane markings, with `state_of_total`; and toward the leader the smallest `ttc`, `thw` [s]
        and the largest `drac` [m/s^2]. Since reset: max_rdsi (of one source), max_total_rdsi, time_known_safe,
        time_unknown, time_known_unsafe [s], band_risk (integral of RDSI over the stays in the unknown [s]), min_thw
        (at most 100), max_drac. See `shield.risk`.
      traffic_blame: with compliant traffic, the verdicts of all other cars that have had a contact, each from its
        own view.

    Args:
      env: a highway-env environment with one controlled vehicle; see `SUPPORTED`.
      mode: "override" or "monitor".
      params: name of a preset, `Preset`, a pair of `RSSParams` (ego, other), a dict of RSS parameters that both have,
        a dict of two such dicts ("ego", "other"), or None: "intersection" at intersections, "simulator" elsewhere.
        What a dict leaves out is that of None.
      intervention_penalty: subtracted from the reward, times what `penalty_on` names.
      penalty_on: "response", the step's `override_fraction` (the penalty is per decision that is overridden on all
        frames), or "change", its `mean_acceleration_change` (the penalty is per m/s^2).
      rules: which duties and margins are in force, for ablations: `Rules`, or a dict of those that differ.
      record: keep every frame of the episode in `frames`, for `audit`.
      entry: whom the ego expects to give way at a junction: "cautious" nobody, "priority" who must
        and still can, "assertive" everybody who still can (Def. 17 as printed).
      intent: which routes it expects of others: "known" (V2X), "straight", or "any" that fits.
      waiting: where it may wait: at the "line", in nobody's way whoever may come, or "anywhere" in
        the junction that is in the way of nobody who is there.
      examine: against whom it checks its plans through a junction: "table" whose ways meet its own, "all"
        everybody, for the same commands; "geofence", "walk", "first-conflicting" and "first" may miss
        somebody (`shield.examined`).
      traffic: "stock", or "compliant": every other car has a shield of its own, in every mode.
      risk: measure the driving safety field around the ego, too: True, or `RiskSettings`.
      judge_params, judge_rules: what the ego is judged by, with a memory of its own: blame, duties, cost and dangerous
        pairs. None = what it is restricted by. A sweep over response times needs one judge for all.

    Raises:
      ValueError: unsupported environment, action type or mode; bad parameters; a response time
        below one simulation frame; more decisions than frames; a shield around a shield; at a step, an ego that is
        not on the environment's road.
    """

    def __init__(
        self,
        env: gym.Env,
        mode: str = "override",
        params: Params = None,
        intervention_penalty: float = 0.0,
        penalty_on: str = "response",
        rules: Rules | Mapping[str, Any] = Rules(),
        record: bool = False,
        entry: str = "cautious",
        intent: str = "any",
        waiting: str = "line",
        traffic: str = "stock",
        examine: str = "table",
        risk: bool | RiskSettings = False,
        judge_params: Params = None,
        judge_rules: Rules | Mapping[str, Any] | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self,
            mode=mode,
            params=plain(params),
            intervention_penalty=plain(intervention_penalty),
            penalty_on=penalty_on,
            rules=plain(rules),
            record=record,
            entry=entry,
            intent=intent,
            waiting=waiting,
            traffic=traffic,
            examine=examine,
            risk=risk,
            judge_params=plain(judge_params),
            judge_rules=plain(judge_rules),
        )
        check_options(mode, intervention_penalty, penalty_on, traffic)
        check_environment(env.unwrapped)
        EgoShields.__init__(self, env)
        self.mode = mode
        self.params = check_params(params, env.unwrapped)
        self.conduct = check_conduct(entry, intent, waiting, examine)
        self.rules = rules_of(rules)
        self.judge = judge_of(judge_params, judge_rules, self.params, self.rules, env.unwrapped)
        self.intervention_penalty, self.penalty_on = float(intervention_penalty), penalty_on
        self.record = record
        self.traffic = traffic
        self.risk = check_risk(risk)
        self._told = True
        tell_inside(self)
        self._begin()

    @property
    def frames(self) -> list[Frame]:
        """Recorded frames of this episode so far, since the ego became the ego.

        Raises:
          ValueError: the wrapper was made without `record=True`.
        """
        if self._ego.record is None:
            raise ValueError("record = False: expected True to keep the frames of an episode")
        return self._ego.record

    @property
    def risk_frames(self) -> list[RiskFrame]:
        """Risk of every frame of this episode so far.

        Raises:
          ValueError: the wrapper was made without `risk`.
        """
        if self._ego.meter is None:
            raise ValueError("risk = False: expected True to measure the risk of an episode")
        return self._ego.meter.frames

    def audit(self) -> Audit:
        """For every dangerous pair-frame of this episode so far: did the ego keep its duty? Needs `record=True`.

        Raises:
          ValueError: nothing was recorded, or roads cross: infos count the duties there.
        """
        _ = self.frames  # were they kept?
        return audit_of(self._ego)

    def reset(self, *, seed=None, options=None):
        env: Any = self.env.unwrapped
        check_frequencies(env.config | ((options or {}).get("config") or {}))
        observation, info = self.env.reset(seed=seed_of(seed), options=options)
        self._begin()
        env = self.env.unwrapped
        info.update(info_of(self._egos[0]), time=float(env.time), **traffic_info(self))
        return observation, info

    def step(self, action):
        executed = action_of(self.action_space, action)
        self._stepping = self._guard()
        self._action, self._had_contact, self._told = action, begin_step(self._stepping[0]), False
        observation, reward, terminated, truncated, info = self.env.step(executed)
        self.tell(info, reward)
        reward = reward - charge(info, self.intervention_penalty, self.penalty_on)
        return observation, reward, terminated, truncated, info

    def tell(self, info: dict, reward: Any) -> None:
        """Write into the info of this step what the shield says, once."""
        if self._told:
            return
        self._told = True
        (ego,) = self._guard_after_step(self._stepping)
        info.update(end_step(ego, self._had_contact, self._action), **traffic_info(self))
        env: Any = self.env.unwrapped
        info.update(time=float(env.time), raw_reward=reward)
        if isinstance(env, IntersectionEnv):
            info["is_success"] = bool(env.has_arrived(env.vehicle))

    @property
    def _ego(self) -> ShieldedEgo:
        """The shield on the ego, whichever vehicle that is now."""
        return self._guard()[0]

    def _check(self) -> None:
        check_environment(self.env.unwrapped)

    def _current_settings(self) -> Settings:
        return settings_for(self.env.unwrapped, self.params, self.rules, self.mode, self.conduct)

    def _judge_settings(self) -> Settings | None:
        return settings_for(self.env.unwrapped, *self.judge, "monitor", self.conduct) if self.judge else None


def traffic_info(wrapper) -> dict[str, Any]:
    """What infos say about compliant traffic."""
    if wrapper.traffic == "stock":
        return {}
    contacts = [driver.contact for driver in wrapper.drivers if driver.check_contact()]
    return {"traffic_blame": tuple(contact["verdict"] for contact in contacts)}


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
