"""Whom a wrapper shields: whichever vehicles are the egos of its environment, at every step."""

from collections.abc import Iterator, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from highway_env.envs.lane_keeping_env import LaneKeepingEnv

from rss_shield.envs.arguments import rules_of
from rss_shield.envs.highway.drivers import drivers_on, shield_everybody
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.grip import draw_groups, hold_everybody
from rss_shield.envs.highway.measured import EgoMeter
from rss_shield.envs.highway.risk import RiskMeter
from rss_shield.envs.highway.senses import Seen, Senses
from rss_shield.envs.highway.step import attach, shield_on
from rss_shield.envs.options import (
    OPEN_SPACE,
    PLANS,
    Options,
    Settings,
    check_mode,
    check_risk,
    check_traffic,
    destination_of,
    ground_in,
    keeps_speed,
    on_ground,
    sensing_in,
    settings_for,
)
from rss_shield.envs.roads.understood import check_roads
from rss_shield.envs.sensing import mixed
from rss_shield.shield.filters.answer import RSS, Filter
from rss_shield.shield.ground import Ground
from rss_shield.shield.lanes.correction import NEAREST


class EgoShields(gym.Wrapper):
    """What `ShieldWrapper` and `MultiAgentShield` have in common. A shield lies with its vehicle, not here.

    So it is copied with the vehicle, however an environment is copied, and somebody who changes vehicles changes
    shields. A car that becomes an ego between two steps gets one; what counts since reset goes on.
    """

    _settings: Settings
    _judge: Settings | None  # what the egos are judged by, where that is not what they are restricted by
    _ground: Ground | None = None  # what they drive on, where not all of it is alike, by their own table
    _ground_of_judge: Ground | None = None  # and by the judge's
    _egos: list[ShieldedEgo]  # shields of the last step, in the order of the vehicles

    def __init__(self, env: gym.Env, mode: str, given: Mapping[str, Any]) -> None:
        super().__init__(env)
        check_mode(mode)
        self.mode, self.options = mode, Options.of(given)
        self._check()
        check_traffic(self.options.traffic, env.unwrapped)
        self.params, self.rules = self.options.params_in(env.unwrapped), rules_of(self.options.rules)
        self.judge = self.options.judge_in(env.unwrapped)
        self.risk = check_risk(self.options.risk)
        self.sensing = sensing_in(env.unwrapped, self.options.sensing)
        self._take_seed(None)
        inner: gym.Env = env
        while isinstance(inner, gym.Wrapper):
            if isinstance(inner, EgoShields):
                break
            inner = inner.env
        if isinstance(inner, EgoShields) or next(egos_on(env.unwrapped), None) is not None:
            raise ValueError(f"environment {env} is behind a shield already: expected one that is not (shield=None)")

    @property
    def settings(self) -> Settings:
        """The parameter table in force for every ego, response times rounded up to whole frames."""
        return self._settings

    @property
    def drivers(self) -> list[ShieldedEgo]:
        """Shields of the cars that are no egos, in compliant traffic."""
        env: Any = self.env.unwrapped
        return drivers_on(env.road)

    def _check(self) -> None:
        """Can the egos of the environment, as it is now, be shielded?"""
        raise NotImplementedError

    def _current_settings(self) -> Settings:
        """Settings for the environment as it is now, and the ground."""
        settings = settings_for(self.env.unwrapped, self.params, self.rules, self.mode, self.options.conduct)
        self._ground = self._ground_by(settings)
        return on_ground(settings, self._ground)

    def _judge_settings(self) -> Settings | None:
        """What the egos are judged by, where that is not what they are restricted by."""
        if not self.judge:
            return None
        settings = settings_for(self.env.unwrapped, *self.judge, "monitor", self.options.conduct)
        self._ground_of_judge = self._ground_by(settings)
        return on_ground(settings, self._ground_of_judge)

    def _ground_by(self, settings: Settings) -> Ground | None:
        """The ground as a table has it."""
        return ground_in(self.env.unwrapped, settings, self.options.conditions, self.options.classes)

    def _take_seed(self, seed: int | None) -> None:
        """Errors of sensing begin anew with a seed; without one they go on."""
        if self.sensing is not None and (seed is not None or not hasattr(self, "_key")):
            self._key, self._episode = self.sensing.keys(seed), -1

    def _begin(self) -> None:
        """Put new shields on for a new episode."""
        self._check()
        _check_action_space(self.action_space, self.env.unwrapped)
        if self.sensing is not None:
            self._episode += 1
        self._settings, self._judge = self._current_settings(), self._judge_settings()
        env: Any = self.env.unwrapped
        # nobody follows the lanes of a car park, and nobody else is on those of `LaneKeepingEnv`, which do not meet
        if self._settings.scheme != OPEN_SPACE and not isinstance(env, LaneKeepingEnv):
            check_roads(env.road.network, self._settings.scheme == PLANS)
        if self._ground is not None:
            draw_groups(env, self._ground)
        for shield in list(egos_on(env)):
            _take_off(shield)
        self._egos = []
        self._guard()

    def _guard(self) -> list[ShieldedEgo]:
        """Shields of all egos, and of compliant traffic: who has come to be one since the last step gets one.

        Raises:
          ValueError: an ego is not on the environment's road, or is behind a shield with other settings.
        """
        self._check()
        env: Any = self.env.unwrapped
        if self._settings.table.dt != 1 / env.config["simulation_frequency"]:
            self._settings, self._judge = self._current_settings(), self._judge_settings()
        self._egos = [self._shield_of(i, vehicle) for i, vehicle in enumerate(env.controlled_vehicles)]
        for shield in list(egos_on(env)):
            if shield not in self._egos:
                _take_off(shield)
        if self.options.traffic == "compliant":
            conduct = self._settings._replace(filter=Filter(RSS), correction=NEAREST)
            shield_everybody(env.road, conduct, self._ground)
        if self._ground is not None:
            hold_everybody(env, self._ground)
        return self._egos

    def _shield_of(self, i: int, vehicle: Any) -> ShieldedEgo:
        env: Any = self.env.unwrapped
        if vehicle.road is not env.road or not any(vehicle is one for one in env.road.vehicles):
            raise ValueError(
                f"controlled_vehicles[{i}] = {vehicle} is not on the environment's road: expected one of road.vehicles"
            )
        shield = shield_on(vehicle)
        if shield is None or not shield.is_ego:
            among = self.options.traffic == "compliant"
            own = self._settings, self.options.record, destination_of(env) or "", among, self._judge
            grounds = self._ground, self._ground_of_judge
            shield = attach(vehicle, *own, self._senses(i), grounds)
            shield.is_ego = True
            kinds = getattr(env.action_type, "agents_action_types", [env.action_type])
            if self._settings.overrides and i < len(kinds) and keeps_speed(env, kinds[i]):
                shield.cruise = float(vehicle.speed)
            shield.meter = RiskMeter(self.risk) if self.risk is not None else None
            shield.measured = EgoMeter(shield) if self.options.measures else None
            if vehicle.crashed:
                shield.had_contact_before()
                shield.judge.had_contact_before()
            if env.time > 0.0 and i < len(self._egos):
                shield.go_on_from(self._egos[i])
        elif shield.given != self._settings:
            raise ValueError(
                f"controlled_vehicles[{i}] = {vehicle} is behind a shield with other settings: expected one shield "
                "around an environment, and a reset after a change of its configuration"
            )
        return shield

    def _senses(self, i: int) -> Senses | None:
        """Sensors of an ego."""
        if self.sensing is None:
            return None
        sensor = self.sensing.sensor(self._settings.table.dt)
        episode = np.uint64(mixed(self._key, self._episode))
        return Senses(sensor, np.uint64(mixed(episode, i)), self.options.record)

    def _sensed(self, observation: Any) -> Any:
        """What an agent observes, if that is what is sensed."""
        if self.sensing is None or not self.sensing.agent:
            return observation
        env: Any = self.env.unwrapped
        (ego,) = self._egos
        assert ego.senses is not None
        with Seen(env, ego.senses, ego.vehicle, int(ego.since["frames"])):
            return env.observation_type.observe()

    def _guard_after_step(self, egos: list[ShieldedEgo]) -> list[ShieldedEgo]:
        """Those who were egos during a step, or if another wrapper has begun a new episode instead, the new ones.

        Raises:
          ValueError: an ego was replaced in the middle of an episode, so somebody has driven without a shield.
        """
        env: Any = self.env.unwrapped
        if [shield_on(vehicle) for vehicle in env.controlled_vehicles] == egos:
            return egos
        if env.time > 0.0:
            raise ValueError(
                "controlled_vehicles changed during a step: expected an ego to be replaced between steps, from outside "
                "of the shield"
            )
        return self._guard()


def egos_on(env: Any) -> Iterator[ShieldedEgo]:
    """Shields of egos, also of former ones; those of compliant traffic are not among them."""
    shields = (shield_on(vehicle) for vehicle in [*env.road.vehicles, *env.controlled_vehicles])
    return (shield for shield in shields if shield is not None and shield.is_ego)


def _take_off(shield: ShieldedEgo) -> None:
    vars(shield.vehicle).pop("act", None)


def _check_action_space(space: Any, env: Any) -> None:
    """Do actions mean what they mean in the environment? Masks and replacements are lists of its own actions.

    Numbers may be clipped or rescaled on their way: the shield sees what becomes of them.
    """
    own = env.action_space
    same = space.shape == own.shape if isinstance(space, spaces.Box) and isinstance(own, spaces.Box) else space == own
    if not same:
        raise ValueError(
            f"action_space = {space}: expected {own}, that of {type(env).__name__}; put a wrapper that changes it "
            "around the shield"
        )
