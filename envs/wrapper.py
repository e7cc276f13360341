"""ShieldWrapper: the RSS shield around a highway-env environment."""

import math
from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs
from highway_env.envs.common.action import ContinuousAction, DiscreteMetaAction
from highway_env.envs.exit_env import ExitEnv
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.two_way_env import TwoWayEnv

from envs.highway import Frame, Settings, ShieldedEgo, StepTally, log_of, response_name
from shield.blame import Audit, audit
from shield.kinematics import frames_for
from shield.params import PRESETS, Preset, RSSParams, Rules

MODES = ("override", "monitor")
SUPPORTED = "highway-v0, highway-fast-v0, two-way-v0, merge-v0/-v1, exit-v0/-v1"
LONGEST_TTC = 100.0  # times to collision are reported up to this [s]


class ShieldWrapper(gym.Wrapper, RecordConstructorArgs):
    """Watches the ego on every simulation frame and says who is to blame at a contact.

    In mode "override" a command that RSS does not permit is replaced by the proper response; in
    mode "monitor" nothing is changed and the trajectory is the bare environment's, bit for bit.
    Observations are never changed; rewards only by `intervention_penalty`.

    Every info has

      shield: dict of this step: `intervened`, `override_fraction` (share of the frames in which a
        duty toward somebody changed the command), `limited_fraction` (frames in which only the
        always-on limits did), `proposed_action` (after a step), `acceleration_change` [m/s^2] and
        `steering_change` [rad] (largest), `dangerous`, `dangerous_pairs` and `broken_duties`
        (pair-frames), and for the pair nearest to danger `partner` (index in `road.vehicles`,
        static objects after them, -1 = nobody), `min_margin_lon`, `min_margin_lat` (gap minus
        required gap [m], inf = nobody); `response`: "none", "longitudinal", "lateral" or "both".
      cost: 1.0 if the ego broke its proper response in this step or a contact was its fault.
      blame: "" before a contact, then "ego", "other", "both", "inherited", or "none" (a bug).
      blame_evidence: {} or partner, kind of danger, seconds since its threshold, duties broken and
        by how much.
      override_share, episode_cost, episode_dangerous_pairs, episode_broken_duties, min_ttc: since
        reset; min_ttc [s] is at most 100.
      raw_reward: the environment's own reward (after a step).

    Args:
      env: a highway-env environment with one controlled vehicle; see `SUPPORTED`.
      mode: "override" or "monitor".
      params: `Preset`, or a pair of `RSSParams` (ego, other).
      intervention_penalty: subtracted from the reward, times the step's `override_fraction`.
      rules: which duties and margins are in force, for ablations.
      record: keep every frame of the episode in `frames`, for `audit`.

    Raises:
      ValueError: unsupported environment, action type or mode; bad parameters; a response time
        below one simulation frame.
    """

    def __init__(
        self,
        env: gym.Env,
        mode: str = "override",
        params: Preset | tuple[RSSParams, RSSParams] = PRESETS["simulator"],
        intervention_penalty: float = 0.0,
        rules: Rules = Rules(),
        record: bool = False,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, mode=mode, params=params, intervention_penalty=intervention_penalty, rules=rules, record=record
        )
        gym.Wrapper.__init__(self, env)
        if mode not in MODES:
            raise ValueError(f"mode = {mode!r}: expected one of {', '.join(MODES)}")
        if not (isinstance(intervention_penalty, (int, float)) and 0.0 <= intervention_penalty < math.inf):
            raise ValueError(f"intervention_penalty = {intervention_penalty!r}: expected a finite number >= 0")
        check_environment(env.unwrapped)
        self.mode = mode
        self.params = check_params(params)
        self.rules = rules
        self.intervention_penalty = float(intervention_penalty)
        self.record = record
        self._attach()

    @property
    def frames(self) -> list[Frame]:
        """Recorded frames of this episode so far.

        Raises:
          ValueError: the wrapper was made without `record=True`.
        """
        if self._ego.record is None:
            raise ValueError("record = False: expected True to keep the frames of an episode")
        return self._ego.record

    def audit(self) -> Audit:
        """For every dangerous pair-frame of this episode so far: did the ego keep its duty? Needs `record=True`."""
        settings = self.settings
        return audit(log_of(self.frames), settings.ego, settings.other, settings.rules, settings.dt)

    @property
    def settings(self) -> Settings:
        """The parameter table in force, response times rounded up to whole frames."""
        return self._ego.settings

    def reset(self, *, seed=None, options=None):
        observation, info = self.env.reset(seed=seed, options=options)
        check_environment(self.env.unwrapped)
        self._attach()
        info.update(self._info(StepTally(), cost=0.0))
        return observation, info

    def step(self, action):
        ego = self._ego
        ego.tally = tally = StepTally()
        had_contact = ego.contact is not None
        observation, reward, terminated, truncated, info = self.env.step(action)
        ego.check_contact()
        at_fault = not had_contact and ego.contact is not None and ego.contact["verdict"] in ("ego", "both")
        cost = 1.0 if tally.broken_duties or at_fault else 0.0
        ego.cost += cost
        info.update(self._info(tally, cost=cost))
        info["shield"]["proposed_action"] = action
        info["raw_reward"] = reward
        reward = reward - self.intervention_penalty * info["shield"]["override_fraction"]
        return observation, reward, terminated, truncated, info

    def _attach(self) -> None:
        env: Any = self.env.unwrapped
        settings = settings_for(self.params, self.rules, self.mode, 1 / env.config["simulation_frequency"])
        self._ego = ShieldedEgo(env.vehicle, settings, self.record)

    def _info(self, tally: StepTally, cost: float) -> dict:
        ego = self._ego
        frames = max(tally.frames, 1)
        return {
            "shield": {
                "intervened": tally.overridden > 0,
                "override_fraction": tally.overridden / frames,
                "limited_fraction": tally.limited / frames,
                "acceleration_change": tally.acceleration_change,
                "steering_change": tally.steering_change,
                "dangerous": tally.dangerous_pairs > 0,
                "dangerous_pairs": tally.dangerous_pairs,
                "broken_duties": tally.broken_duties,
                "min_margin_lon": tally.margin_lon,
                "min_margin_lat": tally.margin_lat,
                "partner": tally.partner,
                "response": response_name(tally.response),
            },
            "cost": cost,
            "blame": ego.contact["verdict"] if ego.contact else "",
            "blame_evidence": dict(ego.contact) if ego.contact else {},
            "override_share": ego.frames_overridden / max(ego.frames, 1),
            "episode_cost": ego.cost,
            "episode_dangerous_pairs": ego.dangerous_pairs,
            "episode_broken_duties": ego.broken_duties,
            "min_ttc": min(ego.min_ttc, LONGEST_TTC),
        }


def check_environment(env: Any) -> None:
    if not isinstance(env, (HighwayEnv, TwoWayEnv, MergeEnv, ExitEnv)):
        raise ValueError(f"environment {type(env).__name__} is not supported; expected one of {SUPPORTED}")
    if len(env.controlled_vehicles) != 1:
        raise ValueError(f"controlled_vehicles = {len(env.controlled_vehicles)}: expected exactly 1")
    action_type = env.action_type
    if not isinstance(action_type, (DiscreteMetaAction, ContinuousAction)):
        raise ValueError(
            f"action type {type(action_type).__name__} is not supported; "
            "expected DiscreteMetaAction, ContinuousAction or DiscreteAction"
        )
    if getattr(action_type, "dynamical", False):
        raise ValueError("action option dynamical = True is not supported; expected False")


def check_params(params) -> Preset:
    if isinstance(params, Preset):
        return params
    if isinstance(params, tuple) and len(params) == 2 and all(isinstance(p, RSSParams) for p in params):
        return Preset(*params, source="given by the user")
    raise ValueError(f"params = {params!r}: expected a Preset or a pair of RSSParams (ego, other)")


def settings_for(params: Preset, rules: Rules, mode: str, dt: float) -> Settings:
    """The table for frames of `dt` seconds: response times rounded up to whole frames (condition C2)."""
    RSSParams.validated(**params.ego._asdict())
    RSSParams.validated(**params.other._asdict())
    rho = params.ego.response_time
    if rho < dt - 1e-9 and not params.per_frame:
        raise ValueError(
            f"response_time = {rho:g} s of the ego is shorter than one simulation frame; expected >= {dt:g} s"
        )
    ego = params.ego._replace(response_time=float(frames_for(max(rho, dt), dt) * dt))
    other = params.other._replace(response_time=float(frames_for(params.other.response_time, dt) * dt))
    return Settings(ego, other, rules, mode == "override", dt)
