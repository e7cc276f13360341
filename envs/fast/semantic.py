"""Semantic actions in the engine: `envs.highway.semantic.SemanticActions` for a batch."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from rss_shield.envs.fast.vector import FastVectorEnv
from rss_shield.envs.semantic.outlook import CAR_FIELDS
from rss_shield.envs.semantic.settings import SemanticSettings
from rss_shield.envs.semantic.space import Outlook, SemanticSpace

_COLUMNS = ("x", "y", "heading", "speed", "length", "width", "acceleration")


class SemanticVectorEnv(VectorEnv):
    """Environments in the engine whose agents choose among semantic actions.

    Episodes are those of `SemanticActions` on highway-env, to the last bit; autoreset and infos as in `FastVectorEnv`,
    with `semantic_action` `[E]`, what was carried out, and `semantic_value` `[E]`, what it promised.

    Args:
      env: in the engine, made with `follows`. Where episodes begin in the same step it must leave that to this one
        (DISABLED), which has to look at how they end.
      settings: see `SemanticSettings`.
      autoreset_mode: of this one.
    """

    def __init__(self, env: FastVectorEnv, settings: SemanticSettings, autoreset_mode: AutoresetMode) -> None:
        stock: Any = env.scenario.stock
        self.env, self.semantic_settings = env, settings
        self.num_envs, self.scenario, self.settings = env.num_envs, env.scenario, env.settings
        self.engine, self.recording = env.engine, env.recording
        self.space = SemanticSpace(stock, settings)
        self.single_action_space = self.space.single_action_space
        self.single_observation_space = self.space.feature_space if settings.features else env.single_observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.metadata = env.metadata | {"autoreset_mode": autoreset_mode}
        self.render_mode = env.render_mode
        self._lanes = list(stock.road.network.lanes_dict())
        ways = [(origin, end) for origin, ends in stock.road.network.graph.items() for end in ends]
        routes = env.scenario.network.route_roads
        self._ends = [ways[int(route[route >= 0][-1])][1] for route in routes]
        self.outlooks: list[Outlook] = []

    def reset(self, *, seed=None, options=None):
        observations, infos = self.env.reset(seed=seed, options=options)
        self._look()
        return self._seen(observations), infos

    def step(self, actions):
        """One decision everywhere; see `FastVectorEnv.step`.

        Args:
          actions: `[E]` integers.
        """
        self.env.check_begun("step")
        chosen = self._chosen(np.asarray(actions))
        heads_for = self._of_egos("target_lane")
        labels = np.zeros(self.num_envs, np.int64)
        trajectories: Any = self.engine.trajectories
        for e, action in enumerate(chosen):
            trajectories[e] = self.outlooks[e].plans[action]
            labels[e] = self.space.label(action, heads_for[e])
        promised = np.array([self.outlooks[e].value[action] for e, action in enumerate(chosen)])
        observations, rewards, terminated, truncated, infos = self.env.step(labels)
        self._look()
        observations = self._seen(observations)
        decided = infos.get("_action", np.zeros(self.num_envs, bool))
        told = {"semantic_action": np.array(chosen), "semantic_value": promised}
        infos = infos | told | {f"_{name}": decided for name in told}
        ended = terminated | truncated
        if ended.any() and self.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP:
            final = {name: values for name, values in infos.items() if name not in ("final_info", "_final_info")}
            begun, new = self.env.reset(options={"reset_mask": ended})
            last, infos = observations.copy(), _begun(infos, new, ended)
            self._look()
            observations = self._seen(begun)
            infos |= {"final_obs": last, "_final_obs": ended, "final_info": final, "_final_info": ended}
        return observations, rewards, terminated, truncated, infos

    def action_masks(self) -> np.ndarray:
        """Which semantic actions there are now, `[E, A]` bool; see `SemanticActions.action_masks`."""
        return np.stack([outlook.valid for outlook in self.outlooks])

    def render(self) -> Any:
        """Pictures of all environments, see `FastVectorEnv.render`."""
        return self.env.render()

    def info(self, e: int) -> dict:
        """The last infos of one environment as a plain dictionary, without what is semantic."""
        return self.env.info(e)

    def close_extras(self, **kwargs) -> None:
        self.env.close()

    def _chosen(self, actions: np.ndarray) -> list[int]:
        """What is carried out: the actions, or where there is none of it now, the same without a neighbour."""
        count, shape = len(self.space.actions), (self.num_envs,)
        whole = actions.shape == shape and np.issubdtype(actions.dtype, np.integer)
        if not whole or actions.min() < 0 or actions.max() >= count:
            raise ValueError(f"actions = {actions}: expected integers from 0 to {count - 1}, shape {shape}")
        return [self.space.valid_instead(int(a), self.outlooks[e]) for e, a in enumerate(actions)]

    def _seen(self, observations: np.ndarray) -> np.ndarray:
        if not self.semantic_settings.features:
            return observations
        return np.stack([outlook.features for outlook in self.outlooks])

    def _of_egos(self, name: str) -> np.ndarray:
        batch = self.engine.batch
        return batch.cars[name][np.arange(self.num_envs), batch.episodes["ego"]]

    def _look(self) -> None:
        batch = self.engine.batch
        cars = np.stack([batch.cars[name] for name in _COLUMNS], axis=2)
        assert cars.shape[2] == CAR_FIELDS
        egos, present = batch.episodes["ego"], batch.episodes["vehicles"]
        lanes, routes = self._of_egos("target_lane"), self._of_egos("route")
        self.outlooks = []
        for e in range(self.num_envs):
            lane = self._lanes[lanes[e]]
            end = self._ends[routes[e]] if routes[e] >= 0 else lane[1]
            self.outlooks.append(self.space.look(cars[e, : present[e]], egos[e], self.space.path(lane, end)))


def _begun(infos: dict, new: dict, ended: np.ndarray) -> dict:
    """Infos of a decision, and where it ended an episode those of the next one's beginning.

    What only the end of an episode has is left out, what only a decision has is not valid there.
    """
    merged: dict[str, Any] = {}
    for name, values in infos.items():
        if name.lstrip("_") == "episode":
            continue
        if name in new and isinstance(values, dict):
            merged[name] = _begun(values, new[name], ended)
        elif name in new:
            here = ended.reshape(-1, *[1] * (np.ndim(values) - 1))
            merged[name] = np.where(here, new[name], values)
        else:
            merged[name] = values & ~ended if name.startswith("_") and values.dtype == bool else values
    return merged
