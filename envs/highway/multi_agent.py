"""MultiAgentShield: several controlled vehicles, each with a shield of its own."""

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from highway_env.envs.common.action import MultiAgentAction

from rss_shield.envs.arguments import actions_of, plain, reset_options, seed_of
from rss_shield.envs.highway.egos import EgoShields
from rss_shield.envs.highway.frames import Frame
from rss_shield.envs.highway.step import audit_of, begin_step, charge, end_step, info_of
from rss_shield.envs.highway.wrapper import traffic_info
from rss_shield.envs.options import Given, Options, Params, check_action_type, check_kind
from rss_shield.envs.sensing import Sensing
from rss_shield.envs.stock import check_frequencies, check_reset
from rss_shield.shield.lanes.judge import Audit


class MultiAgentShield(EgoShields, RecordConstructorArgs):
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
      mode, penalty_on, params, rules, record, entry, intent, waiting, traffic, examine, risk, filter, filter_at,
        correction, evasion, judge_params, judge_rules, sensing: see `ShieldWrapper`.

    Raises:
      ValueError: as `ShieldWrapper`.
    """

    def __init__(self, env: gym.Env, mode: str = "override", params: Params = None, **options: Unpack[Given]) -> None:
        given = {"params": params, **options}
        RecordConstructorArgs.__init__(self, mode=mode, **{name: plain(value) for name, value in given.items()})
        EgoShields.__init__(self, env, mode, given)
        self._begin()

    @property
    def frames(self) -> tuple[list[Frame], ...]:
        """Recorded frames of this episode so far, for each agent.

        Raises:
          ValueError: the wrapper was made without `record=True`.
        """
        if not self.options.record:
            raise ValueError("record = False: expected True to keep the frames of an episode")
        return tuple(ego.record or [] for ego in self._guard())

    def audit(self) -> tuple[Audit, ...]:
        """`ShieldWrapper.audit` for each agent. Needs `record=True`."""
        _ = self.frames  # were they kept?
        return tuple(audit_of(ego) for ego in self._egos)

    def reset(self, *, seed=None, options=None):
        check_reset(self.env.unwrapped, reset_options(options).get("config"))
        observation, info = self.env.reset(seed=seed_of(seed), options=options)
        self._take_seed(seed_of(seed))
        self._begin()
        info.update(agents=tuple(info_of(ego) for ego in self._egos), **traffic_info(self))
        return observation, info

    def step(self, action):
        action = actions_of(self.action_space, action)
        egos = self._guard()
        had_contact = [begin_step(ego) for ego in egos]
        reward: Any
        observation, reward, terminated, truncated, info = self.env.step(action)
        egos = self._guard_after_step(egos)
        env: Any = self.env.unwrapped
        kinds = env.action_type.agents_action_types
        agents = tuple(end_step(*one) for one in zip(egos, had_contact, action, kinds, strict=True))
        info.update(agents=agents, raw_reward=reward, **traffic_info(self))
        if self.options.intervention_penalty > 0.0:
            charges = [charge(agent, self.options) for agent in agents]
            if isinstance(reward, tuple):
                reward = tuple(r - c for r, c in zip(reward, charges, strict=True))
            else:
                reward = reward - np.mean(charges)
        return observation, reward, terminated, truncated, info

    def _check(self) -> None:
        check_agents(self.env.unwrapped)
        check_replace_of_agents(self.options)
        sensing = Sensing.of(self.options.sensing)
        if sensing is not None and sensing.agent:
            raise ValueError("sensing.agent = True: expected False for several agents")


def outcome_of_agents(env: Any, actions: tuple) -> tuple[list[float], list[bool]]:
    """What each agent has earned in the last step, and whether its episode is over.

    Where highway-env says it for its first agent only, its own functions are asked again from the seat of each.

    Args:
      env: highway-env's environment after a step, before anything else happens to it.
      actions: of that step.
    """
    vehicles, rewards, ends = env.controlled_vehicles, [], []
    try:
        for vehicle, action in zip(vehicles, actions, strict=True):
            env.controlled_vehicles = [vehicle]
            rewards.append(float(env._reward(action)))
            ends.append(bool(env._is_terminated()))
    finally:
        env.controlled_vehicles = vehicles
    return rewards, ends


def has_agents(env: Any) -> bool:
    """Does an environment take one action for each of several agents?"""
    return isinstance(getattr(env, "action_type", None), MultiAgentAction)


def check_replace_of_agents(options: Options) -> None:
    """Is nothing asked for that one agent's shield does with the action of a decision?"""
    if options.replace != "frame":
        raise ValueError(f"replace = {options.replace!r}: expected 'frame' for several agents")


def check_agents(env: Any) -> None:
    """Can every agent of an environment be shielded?"""
    check_kind(env)
    check_frequencies(env.config)
    if not has_agents(env):
        raise ValueError(f"action type {type(env.action_type).__name__} is for one agent; expected MultiAgentAction")
    kinds, vehicles = env.action_type.agents_action_types, env.controlled_vehicles
    asked = env.config.get("controlled_vehicles", len(vehicles))
    if not len(kinds) == len(vehicles) == asked:
        raise ValueError(f"controlled_vehicles = {asked}: expected {len(kinds)}, as many as {type(env).__name__} has")
    for action_type in kinds:
        check_action_type(action_type, env)
