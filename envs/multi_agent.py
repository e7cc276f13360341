"""MultiAgentShield: several controlled vehicles, each with a shield of its own."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from highway_env.envs.common.action import MultiAgentAction

from envs.highway import Frame, Settings, ShieldedEgo
from envs.risk import RiskMeter, check_risk
from envs.shielding import attach, audit_of, begin_step, charge, end_step, info_of
from envs.traffic import shield_everybody
from envs.wrapper import (
    check_action_type,
    check_conduct,
    check_kind,
    check_options,
    check_params,
    settings_for,
    traffic_info,
)
from shield.blame import Audit
from shield.params import Preset, RSSParams, Rules
from shield.risk import RiskSettings


class MultiAgentShield(gym.Wrapper, RecordConstructorArgs):
    """`ShieldWrapper` for environments with several agents: each ego has its own shield and sees the others as cars.

    Actions, observations, rewards and ends are the environment's: tuples, or one value for all. Every info has

      agents: for each agent in turn a dict with the keys that `ShieldWrapper` writes: `shield`, `cost`, `blame`,
        ... Blame is from the agent's own view: where two agents touch, "other" may be the other agent.
      raw_reward: the environment's own reward or rewards (after a step).
      traffic_blame: see `ShieldWrapper`; the agents are not among the others.

    Args:
      env: a highway-env environment with `MultiAgentAction`, such as intersection-multi-agent-v0/-v1/-v2.
      intervention_penalty: subtracted from each agent's reward, times what `penalty_on` names of its own; from one
        reward for all, times the mean of that.
      mode, penalty_on, params, rules, record, entry, intent, waiting, traffic, examine, risk: see `ShieldWrapper`.

    Raises:
      ValueError: as `ShieldWrapper`.
    """

    def __init__(
        self,
        env: gym.Env,
        mode: str = "override",
        params: Preset | tuple[RSSParams, RSSParams] | None = None,
        intervention_penalty: float = 0.0,
        penalty_on: str = "response",
        rules: Rules = Rules(),
        record: bool = False,
        entry: str = "cautious",
        intent: str = "any",
        waiting: str = "line",
        traffic: str = "stock",
        examine: str = "table",
        risk: bool | RiskSettings = False,
    ) -> None:
        RecordConstructorArgs.__init__(
            self,
            mode=mode,
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
        )
        gym.Wrapper.__init__(self, env)
        check_options(mode, intervention_penalty, penalty_on, traffic)
        check_agents(env.unwrapped)
        self.mode = mode
        self.params = check_params(params, env.unwrapped)
        self.conduct = check_conduct(entry, intent, waiting, examine)
        self.rules = rules
        self.intervention_penalty, self.penalty_on = float(intervention_penalty), penalty_on
        self.record = record
        self.traffic = traffic
        self.risk = check_risk(risk)
        self._attach()

    @property
    def frames(self) -> tuple[list[Frame], ...]:
        """Recorded frames of this episode so far, for each agent.

        Raises:
          ValueError: the wrapper was made without `record=True`.
        """
        if not self.record:
            raise ValueError("record = False: expected True to keep the frames of an episode")
        return tuple(ego.record or [] for ego in self._egos)

    def audit(self) -> tuple[Audit, ...]:
        """`ShieldWrapper.audit` for each agent. Needs `record=True`."""
        return tuple(audit_of(frames, self.settings) for frames in self.frames)

    @property
    def settings(self) -> Settings:
        """The parameter table in force for every agent, response times rounded up to whole frames."""
        return self._settings

    @property
    def drivers(self) -> list[ShieldedEgo]:
        """Shields of the cars that are no agents, in compliant traffic."""
        return self._drivers

    def reset(self, *, seed=None, options=None):
        observation, info = self.env.reset(seed=seed, options=options)
        check_agents(self.env.unwrapped)
        self._attach()
        info.update(agents=tuple(info_of(ego) for ego in self._egos), **traffic_info(self))
        return observation, info

    def step(self, action):
        self._welcome()
        had_contact = [begin_step(ego) for ego in self._egos]
        reward: Any
        observation, reward, terminated, truncated, info = self.env.step(action)
        agents = tuple(end_step(*one) for one in zip(self._egos, had_contact, action, strict=True))
        info.update(agents=agents, raw_reward=reward, **traffic_info(self))
        if self.intervention_penalty > 0.0:
            charges = [charge(agent, self.intervention_penalty, self.penalty_on) for agent in agents]
            if isinstance(reward, tuple):
                reward = tuple(r - c for r, c in zip(reward, charges, strict=True))
            else:
                reward = reward - np.mean(charges)
        return observation, reward, terminated, truncated, info

    def _attach(self) -> None:
        env: Any = self.env.unwrapped
        self._settings = settings_for(env, self.params, self.rules, self.mode, self.conduct)
        goal, among = env.config.get("destination"), self.traffic == "compliant"
        self._egos = [attach(vehicle, self._settings, self.record, goal, among) for vehicle in env.controlled_vehicles]
        for ego in self._egos:
            ego.meter = RiskMeter(self.risk) if self.risk is not None else None
        self._drivers: list[ShieldedEgo] = []
        self._welcome()

    def _welcome(self) -> None:
        """Shield the cars that have come since the last step."""
        if self.traffic == "compliant":
            env: Any = self.env.unwrapped
            self._drivers = shield_everybody(env.road, self._drivers, self.settings)


def has_agents(env: Any) -> bool:
    """Does an environment take one action for each of several agents?"""
    return isinstance(getattr(env, "action_type", None), MultiAgentAction)


def check_agents(env: Any) -> None:
    """Can every agent of an environment be shielded?"""
    check_kind(env)
    if not has_agents(env):
        raise ValueError(f"action type {type(env.action_type).__name__} is for one agent; expected MultiAgentAction")
    for action_type in env.action_type.agents_action_types:
        check_action_type(action_type, env)
