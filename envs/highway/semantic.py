"""Semantic actions on highway-env: trajectories that are carried out frame by frame and planned anew each decision."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from highway_env import utils

from rss_shield.envs.arguments import action_of, plain
from rss_shield.envs.highway.multi_agent import has_agents
from rss_shield.envs.semantic.outlook import CAR_FIELDS, DRIFT, PLANNED_ACCELERATION
from rss_shield.envs.semantic.settings import check_unreplaced, semantic_settings
from rss_shield.envs.semantic.space import Outlook, SemanticSpace


class SemanticActions(gym.Wrapper, RecordConstructorArgs):
    """The agent chooses what to do in words: to which lane, ahead of or behind whom, how fast, how hard.

    Put it around a `ShieldWrapper`, or around an environment without a shield. An action `a` is row `a` of
    `space.actions`; its trajectory (`shield.definitions.semantics.rollout`, bang-bang across the road, bounded jerk
    along it) gives the acceleration and the lateral speed of each frame of the decision, and the shield restricts those
    as it restricts any command. All trajectories are planned anew before the next decision. Rewards are the
    environment's; so are observations, unless `features` is set.

    Where there is none of an action now (nobody in that slot, or not in that lane), the same one without a neighbour is
    carried out; `action_masks` says which there are. Infos have `semantic_action`, what was carried out, and
    `semantic_value`, what it promised: the mean reward along its trajectory (`envs.semantic.outlook`).

    Args:
      env: `highway-v0`, `highway-fast-v0` or an intersection, with meta-actions.
      settings: True, a dict of the fields of `SemanticSettings` that differ, or those.

    Raises:
      ValueError: another environment, other actions, actions replaced before a decision, bad settings.
    """

    def __init__(self, env: gym.Env, settings: Any = True) -> None:
        asked = semantic_settings(settings)
        if asked is None:
            raise ValueError("settings = False: expected True or a dict; leave the wrapper out for meta-actions")
        RecordConstructorArgs.__init__(self, settings=plain(asked._asdict()))
        super().__init__(env)
        self.settings = asked
        stock: Any = env.unwrapped
        if has_agents(stock):
            raise ValueError("semantic_actions with several agents: expected one")
        check_unreplaced(getattr(env, "options", None))
        self._begin()

    def reset(self, *, seed=None, options=None):
        observation, info = self.env.reset(seed=seed, options=options)
        if (options or {}).get("config"):
            self._begin()
        self.outlook = self._look()
        return self._seen(observation), info

    def step(self, action):
        chosen = self.space.valid_instead(action_of(self.action_space, action), self.outlook)
        env: Any = self.env.unwrapped
        promised = float(self.outlook.value[chosen])
        label = self.space.label(chosen, env.vehicle.target_lane_index[2])
        with _following(env, self.outlook.plans[chosen]):
            observation, reward, terminated, truncated, info = self.env.step(label)
        self.outlook = self._look()
        info.update(semantic_action=chosen, semantic_value=promised)
        return self._seen(observation), reward, terminated, truncated, info

    def action_masks(self) -> np.ndarray:
        """Which semantic actions there are now, `[A]` bool: whom one is about must be in the lane that it is about."""
        return self.outlook.valid

    def _begin(self) -> None:
        """Of the environment as it is configured now."""
        self.space = SemanticSpace(self.env.unwrapped, self.settings)
        self.action_space = self.space.single_action_space
        if self.settings.features:
            self.observation_space = self.space.feature_space
        self.outlook = self._look()

    def _seen(self, observation: Any) -> Any:
        return self.outlook.features if self.settings.features else observation

    def _look(self) -> Outlook:
        env: Any = self.env.unwrapped
        ego = env.vehicle
        cars = np.zeros((len(env.road.vehicles), CAR_FIELDS))
        for car, vehicle in zip(cars, env.road.vehicles, strict=True):
            size = vehicle.LENGTH, vehicle.WIDTH
            car[:] = *vehicle.position, vehicle.heading, vehicle.speed, *size, vehicle.action["acceleration"]
        index = next(i for i, vehicle in enumerate(env.road.vehicles) if vehicle is ego)
        end = ego.route[-1][1] if ego.route else ego.target_lane_index[1]
        return self.space.look(cars, index, self.space.path(ego.target_lane_index, end))


@contextmanager
def _following(env: Any, plan: np.ndarray) -> Iterator[None]:
    """Inside, the ego carries a plan out `[F, 2]`: highway-env's controllers with another speed law."""
    vehicle = env.vehicle

    def now() -> np.ndarray:
        return plan[env.steps % len(plan)]

    vehicle.speed_control = lambda target_speed: float(now()[PLANNED_ACCELERATION])
    vehicle.steering_control = lambda index: steering_within(vehicle, index, now()[DRIFT])
    try:
        yield
    finally:
        del vehicle.speed_control, vehicle.steering_control


def steering_within(vehicle: Any, index: Any, drift: float) -> float:
    """highway-env's steering toward the middle of a lane, with a largest lateral speed [rad].

    `ControlledVehicle.steering_control`, operation by operation, but for that bound.

    Args:
      vehicle: a `ControlledVehicle`, index: of the lane.
      drift: largest speed across the lane [m/s], inf = highway-env's own.
    """
    lane = vehicle.road.network.get_lane(index)
    s, lateral = lane.local_coordinates(vehicle.position)
    across = np.clip(-vehicle.KP_LATERAL * lateral, -drift, drift)
    course = np.arcsin(np.clip(across / utils.not_zero(vehicle.speed), -1, 1))
    reference = lane.heading_at(s + vehicle.speed * vehicle.TAU_PURSUIT) + np.clip(course, -np.pi / 4, np.pi / 4)
    rate = vehicle.KP_HEADING * utils.wrap_to_pi(reference - vehicle.heading)
    slip = np.arcsin(np.clip(vehicle.LENGTH / 2 / utils.not_zero(vehicle.speed) * rate, -1, 1))
    most = vehicle.MAX_STEERING_ANGLE
    return float(np.clip(np.arctan(2 * np.tan(slip)), -most, most))
