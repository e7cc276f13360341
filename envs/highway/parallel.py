"""PettingZoo's parallel interface to several shielded agents. Needs the extra `multiagent`."""

from typing import Any

from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.envs.common.observation import MultiAgentObservation
from pettingzoo import ParallelEnv

from rss_shield.envs.arguments import actions_of
from rss_shield.envs.highway.multi_agent import MultiAgentShield, outcome_of_agents
from rss_shield.envs.highway.step import charge
from rss_shield.envs.make import make


def parallel_env(env_id: str = "intersection-multi-agent-v0", **options) -> "ShieldedParallelEnv":
    """An environment for several agents, each behind its own shield, as a PettingZoo `ParallelEnv`.

    Args:
      env_id: "intersection-multi-agent-v0", "intersection-multi-agent-v1", "intersection-multi-agent-v2", or any other
        with a `config` for several agents: action type "MultiAgentAction", observation type "MultiAgentObservation"
        and, on motorways, "controlled_vehicles".
      options: as for `rss_shield.make`; `shield` is "override" or "monitor".

    Raises:
      ValueError: whatever `make` objects to, no shield, or an environment for one agent.
    """
    env = make(env_id, **options)
    if not isinstance(env, MultiAgentShield):
        shield = options.get("shield", "override")
        raise ValueError(
            f"env_id = {env_id!r} with shield = {shield!r}: expected several agents and 'override' or 'monitor'"
        )
    return ShieldedParallelEnv(env)


class ShieldedParallelEnv(ParallelEnv):
    """Agents "agent_0", "agent_1", ... in the order of the environment's controlled vehicles.

    The infos of an agent are those of its shield: see `ShieldWrapper`. Rewards and ends are the
    agent's own, also where highway-env knows only those of the first: it is terminated when its car
    has crashed or arrived, and truncated with everybody else when time is up. It then leaves
    `agents` while the others go on; its car stays on the road, under its shield, with the action IDLE.

    Args:
      env: `MultiAgentShield`; its penalty is subtracted from each agent's reward.

    Raises:
      ValueError: no observations per agent, or an action type without IDLE.
    """

    def __init__(self, env: MultiAgentShield) -> None:
        unwrapped: Any = env.unwrapped
        if not isinstance(unwrapped.observation_type, MultiAgentObservation):
            kind = type(unwrapped.observation_type).__name__
            raise ValueError(
                f"config observation: {kind} is one observation for all; expected type MultiAgentObservation, with "
                "observation_config = what each agent sees"
            )
        for action_type in unwrapped.action_type.agents_action_types:
            if not isinstance(action_type, DiscreteMetaAction):
                raise ValueError(f"action type {type(action_type).__name__} has no IDLE; expected DiscreteMetaAction")
        self.env = env
        self.render_mode = env.render_mode
        self.metadata = {**env.metadata, "name": env.spec.id if env.spec else type(unwrapped).__name__}
        self.possible_agents = [f"agent_{i}" for i in range(len(unwrapped.controlled_vehicles))]
        self.agents: list[str] = []
        self.action_spaces = dict(zip(self.possible_agents, unwrapped.action_space, strict=True))
        self.observation_spaces = dict(zip(self.possible_agents, unwrapped.observation_space, strict=True))
        self._idle = [kind.actions_indexes["IDLE"] for kind in unwrapped.action_type.agents_action_types]

    def observation_space(self, agent: str):
        return self.observation_spaces[agent]

    def action_space(self, agent: str):
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict | None = None):
        observations, info = self.env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        return self._of_agents(observations), self._of_agents(info["agents"])

    def step(self, actions: dict[str, Any]):
        """One decision of every agent in `agents`.

        Raises:
          ValueError: an action is missing, or there is one for nobody, or one that no agent can do.
        """
        if set(actions) != set(self.agents):
            raise ValueError(f"actions for {sorted(actions)}: expected one for each of {self.agents}")
        everybody = zip(self.possible_agents, self._idle, strict=True)
        joint = tuple(actions.get(agent, idle) for agent, idle in everybody)
        joint = actions_of(self.env.action_space, joint, [f"action of {agent}" for agent in self.possible_agents])
        observations, _, _, truncated, info = self.env.step(joint)
        earned, ended = info.get("agents_rewards"), info.get("agents_terminated")
        if earned is None:  # an intersection says it, and its traffic has moved on since
            earned, ended = outcome_of_agents(self.env.unwrapped, joint)
        infos = tuple({**one, "raw_reward": float(reward)} for one, reward in zip(info["agents"], earned, strict=True))
        rewards = tuple(one["raw_reward"] - charge(one, self.env.options) for one in infos)
        terminations = self._of_agents([bool(one) for one in ended])
        truncations = dict.fromkeys(self.agents, bool(truncated))
        outcome = self._of_agents(observations), self._of_agents(rewards), terminations, truncations
        of_agents = self._of_agents(infos)
        self.agents = [agent for agent in self.agents if not (terminations[agent] or truncated)]
        return *outcome, of_agents

    def render(self):
        return self.env.render()

    def close(self) -> None:
        self.env.close()

    def _of_agents(self, values) -> dict[str, Any]:
        """What concerns the agents that are still there."""
        everybody = zip(self.possible_agents, values, strict=True)
        return {agent: value for agent, value in everybody if agent in self.agents}
