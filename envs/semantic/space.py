"""The semantic actions of one environment of highway-env, on either simulator."""

from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.envs.highway_env import HighwayEnv
from highway_env.envs.intersection_env import IntersectionEnv

from rss_shield.envs.semantic.outlook import (
    FEATURES,
    MEAN_SPEED,
    NEAR_FIELDS,
    PLAN_FIELDS,
    VALID,
    VALUE,
    Desk,
    Payoff,
    Rules,
    look_ahead,
)
from rss_shield.envs.semantic.paths import Path, route_path, straight_path
from rss_shield.envs.semantic.settings import SemanticSettings
from rss_shield.envs.worlds.signalised import SignalisedIntersectionEnv
from rss_shield.shield.definitions.semantics import (
    LANE,
    LIMITS,
    NONE,
    PUSH,
    RELATION,
    ROLLOUT_FIELDS,
    SPEED,
    semantic_actions,
)

SUPPORTED = "highway-v0, highway-fast-v0, intersection-v0/-v2"
_LOOKS = 0.4  # from one look for contacts to the next [s]
_MOST_CARS = 512
_PROGRESS = 1e-3  # what decides between equal values


class Outlook(NamedTuple):
    """What each action leads to, from one situation."""

    features: np.ndarray  # `[A, D]` float32, see `outlook.FEATURES`
    plans: np.ndarray  # `[A, F, 2]` what each does on the frames of the coming decision

    @property
    def valid(self) -> np.ndarray:
        """Which actions there are now, `[A]` bool."""
        return self.features[:, VALID] > 0.0

    @property
    def value(self) -> np.ndarray:
        """What each promises, `[A]`."""
        return self.features[:, VALUE]

    @property
    def best(self) -> int:
        """The valid action that promises most; of several, the one that gets farthest."""
        promised = self.value + _PROGRESS * self.features[:, MEAN_SPEED]
        return int(np.where(self.valid, promised, -np.inf).argmax())


class SemanticSpace:
    """All semantic actions of an environment: lanes x (nobody, behind or ahead of each neighbour) x speeds x pushes.

    Args:
      env: highway-env's, as it is after a reset; roads must not change from one episode to the next.
      settings: how many.

    Raises:
      ValueError: an environment or actions for which there are none.
    """

    def __init__(self, env: Any, settings: SemanticSettings) -> None:
        _check(env)
        config, network = env.config, env.road.network
        self.settings = settings
        self.frames = int(config["simulation_frequency"] // config["policy_frequency"])
        dt = 1 / config["simulation_frequency"]
        kind = env.action_type
        speeds = np.asarray(env.vehicle.target_speeds, float)
        legal = float(speeds.max())
        shares = tuple((speeds / legal).tolist()) if settings.speeds is None else settings.speeds
        self._network, self._paths = network, dict[tuple[Any, str], Path]()
        self._straight = straight_path(_side_by_side(network)) if isinstance(env, HighwayEnv) else None
        lanes = 1 if self._straight is None else len(self._straight.lanes)
        self.actions = semantic_actions(lanes, settings.neighbours, shares, len(settings.pushes))
        self.limits = np.array([LIMITS[push] for push in settings.pushes], float)
        self.labels = {name: kind.actions_indexes.get(name, -1) for name in ("LANE_LEFT", "IDLE", "LANE_RIGHT")}
        every = max(round(_LOOKS / dt), 1)
        self.rules = Rules(dt, every, legal, float(settings.headway), float(settings.gap), lanes > 1)
        self.payoff = _payoff(env, self.frames)
        steps = max(round(settings.horizon / dt), self.frames)
        self._desk = Desk(
            np.zeros((_MOST_CARS, NEAR_FIELDS)),
            np.zeros(settings.neighbours, np.int64),
            np.zeros((steps, ROLLOUT_FIELDS)),
            np.zeros(steps),
        )

    @property
    def single_action_space(self) -> spaces.Discrete:
        return spaces.Discrete(len(self.actions))

    @property
    def feature_space(self) -> spaces.Box:
        """Of the actions' features `[A, D]`, where they are observed."""
        return spaces.Box(-np.inf, np.inf, (len(self.actions), len(FEATURES)), np.float32)

    def path(self, lane: Any, end: str) -> Path:
        """The path of an ego that heads for a lane, an index of highway-env's, on its way to a node."""
        if self._straight is not None:
            return self._straight
        if (lane, end) not in self._paths:
            self._paths[lane, end] = route_path(self._network, lane, end)
        return self._paths[lane, end]

    def look(self, cars: np.ndarray, ego: int, path: Path) -> Outlook:
        """What each action leads to.

        Args:
          cars: `[N, 7]` x, y, heading, speed, length, width, acceleration of everybody.
          ego: index of the ego.
          path: its own.
        """
        features = np.empty((len(self.actions), len(FEATURES)), np.float32)
        plans = np.empty((len(self.actions), self.frames, PLAN_FIELDS))
        fixed = self.actions, self.limits, self.rules, self.payoff, self._desk
        look_ahead(np.ascontiguousarray(cars), int(ego), path.points, path.lanes, *fixed, features, plans)
        return Outlook(features, plans)

    def valid_instead(self, action: int, outlook: Outlook) -> int:
        """The action; where there is none of it now, the same one without a neighbour."""
        if outlook.valid[action]:
            return action
        same = [LANE, SPEED, PUSH]
        alike = (self.actions[:, same] == self.actions[action, same]).all(axis=1)
        return int(np.flatnonzero(alike & (self.actions[:, RELATION] == NONE))[0])

    def label(self, action: int, heads_for: int) -> int:
        """The meta-action that goes with an action: toward its lane, where the ego does not head for it yet."""
        if self._straight is None:
            return self.labels["IDLE"]
        away = int(self.actions[action, LANE]) - int(heads_for)
        return self.labels["LANE_LEFT" if away < 0 else "LANE_RIGHT" if away > 0 else "IDLE"]


def _check(env: Any) -> None:
    supported = isinstance(env, (HighwayEnv, IntersectionEnv)) and not isinstance(env, SignalisedIntersectionEnv)
    if not supported:
        raise ValueError(f"semantic_actions in {type(env).__name__}: expected one of {SUPPORTED}")
    kind = env.action_type
    if not isinstance(kind, DiscreteMetaAction):
        raise ValueError(f"semantic_actions with action type {type(kind).__name__}: expected DiscreteMetaAction")
    needed = ("IDLE", "LANE_LEFT", "LANE_RIGHT") if isinstance(env, HighwayEnv) else ("IDLE",)
    missing = [name for name in needed if name not in kind.actions_indexes]
    if missing:
        raise ValueError(f"semantic_actions without the meta-actions {', '.join(missing)}: expected lateral = True")


def _side_by_side(network: Any) -> list[Any]:
    """The lanes of a road that is nothing but straight lanes."""
    ways = [lanes for ends in network.graph.values() for lanes in ends.values()]
    if len(ways) != 1 or any(lane.heading_at(0.0) != lane.heading_at(lane.length) for lane in ways[0]):
        raise ValueError("semantic_actions on a road of several pieces or with curves: expected one of straight lanes")
    return ways[0]


def _payoff(env: Any, frames: int) -> Payoff:
    config = env.config
    slow, fast = map(float, config["reward_speed_range"])
    right = float(config.get("right_lane_reward", 0.0))
    speed, contact = float(config["high_speed_reward"]), float(config["collision_reward"])
    worst, best = 0.0, 1.0
    if config["normalize_reward"]:
        worst, best = contact, speed + right if isinstance(env, HighwayEnv) else float(config["arrived_reward"])
    return Payoff(speed, slow, fast, right, contact, worst, best, frames)
