"""ShieldWrapper: the RSS shield around a highway-env environment."""

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from highway_env.envs.intersection_env import IntersectionEnv

from rss_shield.envs.arguments import action_of, plain, reset_options, seed_of
from rss_shield.envs.decisions.replacement import order_of, replace
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.egos import EgoShields
from rss_shield.envs.highway.foresight import action_mask, labels_of
from rss_shield.envs.highway.frames import Frame
from rss_shield.envs.highway.risk import RiskFrame
from rss_shield.envs.highway.step import audit_of, begin_step, charge, end_step, info_of, tell_inside
from rss_shield.envs.options import Given, Params, check_environment, check_replace
from rss_shield.envs.stock import check_reset
from rss_shield.shield.lanes.judge import Audit


class ShieldWrapper(EgoShields, RecordConstructorArgs):
    """Watches the ego on every simulation frame and says who is to blame at a contact.

    In mode "override" a command that RSS does not permit is replaced by the proper response; in
    mode "monitor" nothing is changed and the trajectory is the bare environment's, bit for bit.
    Observations are never changed; rewards only by `intervention_penalty`.
    The shield is on whichever vehicle is the ego at a step; it is copied with its vehicle.

    Every info has

      shield: dict of this step: `intervened`, `override_fraction` (share of the frames in which a
        duty toward somebody changed the command: the proper response), `anticipation_fraction` (in which no duty did,
        but anticipation), `limited_fraction` (in which only the always-on limits did), after a step `proposed_action`,
        `executed_action` (see `rss_shield.envs.decisions.executed`) and `action_replaced` (before the first frame, with
        the option `replace`), `acceleration_change` [m/s^2] and `steering_change` [rad] (largest),
        `mean_acceleration_change` and `mean_steering_change` (over the frames), `lane_change_refused`, `dangerous`,
        `dangerous_pairs`, `broken_duties` (pair-frames), and for the pair nearest to danger `partner` (index in
        `road.vehicles`,
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
      measures: only with the option `measures`, since reset: `min_thw_ahead`, `min_ttc_ahead`, `max_drac_ahead`,
        `min_pet`, `near_misses`, `standing_free`, `impact_speed`, `delta_v` (`shield.risk.meter.Measures`);
        `violation_ego`, `violation_other`, `violation_nobody`: time with a dangerous pair of which the ego, the other
        or nobody has broken a duty by then [s]; `shield_time`: of the shield per frame, mean [s].
      traffic_blame: with compliant traffic, the verdicts of all other cars that have had a contact, each from its
        own view.

    Args:
      env: a highway-env environment with one controlled vehicle; see `SUPPORTED`.
      mode: "override" or "monitor".
      params: name of a preset, `Preset`, a pair of `RSSParams` (ego, other), a dict of RSS parameters that both have,
        a dict of two such dicts ("ego", "other"), or None: "intersection" at intersections, "parking" on car parks,
        "simulator" elsewhere. What a dict leaves out is that of None.
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
        somebody (`shield.junctions.examined`).
      traffic: "stock", or "compliant": every other car has a shield of its own, in every mode.
      risk: measure the driving safety field around the ego, too: True, or `RiskSettings`.
      measures: tell in infos how critical the episode was, and what the shield took in time.
      filter: what acts, for comparison: "rss", this shield, or one of the literature's, judged by RSS all the same:
        "ttc" brakes below a time to collision, "distance-45m" below 45 m, "cbf" is a control barrier function on the
        headway, "limits" are the always-on limits alone, "literal-def10" is Def. 10 as printed, looked at once per
        decision. Only along lanes. See `rss_shield.shield.filters`.
      filter_at: the threshold of "ttc" [s] or "distance-45m" [m], or the headway of "cbf" [s]; None = as in their
        files.
      correction: what a duty makes of a command: the "nearest" permitted one, or the proper "response" in full
        (`rss_shield.shield.lanes.correction`); the latter along lanes only.
      evasion: where others do not comply, or braking alone ends in a contact, get out of the way by a manoeuvre out of
        a finite family, if one harms nobody (Defs. 11-13, `rss_shield.shield.lanes.evasion`); along lanes only.
      replace: "frame", commands are restricted on every frame, or "decision", before that a meta-action whose
        `action_masks` is False is replaced by the nearest one whose mask is True
        (`rss_shield.envs.decisions.replacement`).
      judge_params, judge_rules: what the ego is judged by, with a memory of its own: blame, duties, cost and dangerous
        pairs. None = what it is restricted by. A sweep over response times needs one judge for all.
      sensing: what goes wrong between the world and the shield, `rss_shield.envs.sensing.Sensing` or a dict of its
        fields; None = it sees what is there. The judge always does, and what is measured is measured there; margins,
        times to collision, comfort and `partner` are the shield's own.
      conditions: of the road: "dry", "wet", "snow" or "ice", or along lanes a dict (from, to) -> one of these, in x
        [m]; what nobody names is dry. Everybody is held to the grip there, and to the parameters that hold where it
        will be.
      classes: kinds of vehicles among the others, as shares: "motorcycle", "truck", "bus"; the rest are cars. Each has
        parameters of its own (`rss_shield.shield.ground.CLASSES`). Along lanes.

    Raises:
      ValueError: unsupported environment, action type or mode; bad parameters; a response time
        below one simulation frame; more decisions than frames; a shield around a shield; at a step, an ego that is
        not on the environment's road.
    """

    def __init__(self, env: gym.Env, mode: str = "override", params: Params = None, **options: Unpack[Given]) -> None:
        given = {"params": params, **options}
        RecordConstructorArgs.__init__(self, mode=mode, **{name: plain(value) for name, value in given.items()})
        EgoShields.__init__(self, env, mode, given)
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
        check_reset(self.env.unwrapped, reset_options(options).get("config"))
        observation, info = self.env.reset(seed=seed_of(seed), options=options)
        self._take_seed(seed_of(seed))
        self._begin()
        env: Any = self.env.unwrapped
        info.update(info_of(self._egos[0]), time=float(env.time), **traffic_info(self))
        return self._sensed(observation), info

    def step(self, action):
        handed = action_of(self.action_space, action)
        self._stepping = self._guard()
        if self.mode == "override" and self.options.replace == "decision" and handed is not None:
            handed = self._permitted(handed)
        self._action, self._handed, self._had_contact = action, handed, begin_step(self._stepping[0])
        self._told = False
        observation, reward, terminated, truncated, info = self.env.step(handed)
        self.tell(info, reward)
        reward = reward - charge(info, self.options)
        return self._sensed(observation), reward, terminated, truncated, info

    def tell(self, info: dict, reward: Any) -> None:
        """Write into the info of this step what the shield says, once."""
        if self._told:
            return
        self._told = True
        (ego,) = self._guard_after_step(self._stepping)
        env: Any = self.env.unwrapped
        info.update(end_step(ego, self._had_contact, self._action, env.action_type, self._handed), **traffic_info(self))
        info.update(time=float(env.time), raw_reward=reward)
        if isinstance(env, IntersectionEnv):
            info["is_success"] = bool(env.has_arrived(env.vehicle))

    def action_masks(self) -> np.ndarray:
        """Which meta-actions would pass the coming decision without a proper response, `[A]` bool.

        For each action the ego is played ahead on the frames of one decision, with its own control laws and the
        always-on limits, while everybody else keeps the speed along the lane and across it. An action is False if on
        any of these frames a duty would change its command, or if its lane change would be refused or taken back.
        What anticipation would have made of it does not count. Where roads cross, everybody goes on along every way
        that they may take, and an action is False if on one of the frames looked at, the first, every third and the
        last, it would leave the ego no plan, or if its lane change would be refused.

        If no action passes, the one is True that is answered last; of several, the first of SLOWER, IDLE, LANE_LEFT,
        LANE_RIGHT, FASTER. After a contact all are True. The frame shield does not rely on any of this: it acts behind
        a masked agent as behind any other. In mode "monitor" the mask is the same: what the shield would do.

        `sb3_contrib.MaskablePPO` finds this method. Nothing changes by calling it.

        Raises:
          ValueError: the actions are no meta-actions.
        """
        return action_mask(self._ego, self.env.unwrapped)

    def _permitted(self, action: Any) -> Any:
        """The action, or the nearest one whose mask is True."""
        env: Any = self.env.unwrapped
        order = order_of(labels_of(env.action_type))
        return int(replace(np.array([action]), self.action_masks()[None], order)[0])

    @property
    def _ego(self) -> ShieldedEgo:
        """The shield on the ego, whichever vehicle that is now."""
        return self._guard()[0]

    def _check(self) -> None:
        check_environment(self.env.unwrapped)
        check_replace(self.options, self.env.unwrapped)


def traffic_info(wrapper) -> dict[str, Any]:
    """What infos say about compliant traffic."""
    if wrapper.options.traffic == "stock":
        return {}
    return {"traffic_blame": tuple(driver.blame for driver in wrapper.drivers if driver.check_contact())}
