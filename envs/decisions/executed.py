"""What was executed in a decision, as an action of its space: what a replay buffer may hold instead of the proposal."""

from itertools import product
from typing import Any

import numpy as np
from highway_env import utils
from highway_env.envs.common.action import ContinuousAction, DiscreteAction, DiscreteMetaAction

from rss_shield.envs.decisions.masks import LANE_LEFT, LANE_RIGHT


def executed_actions(kind: Any, handed: np.ndarray, refused: np.ndarray, commands: np.ndarray) -> np.ndarray:
    """Executed actions of a batch.

    A meta-action counts as it was handed to the simulator, a lane change that was refused or taken back as IDLE; what
    the shield changed on single frames is no meta-action. A continuous action is the one whose command is the mean of
    what was executed on the frames, and a discretised one the nearest to that.

    Args:
      kind: highway-env's action type.
      handed: `[E, ...]` actions that were handed to the simulator.
      refused: `[E]` bool, a lane change was refused or taken back.
      commands: `[E, 2]` means over the frames of acceleration [m/s^2] and steering [rad]; nan without frames.

    Returns:
      `[E, ...]` actions; as handed where there was no frame.
    """
    if isinstance(kind, DiscreteMetaAction):
        if not refused.any():
            return handed
        idle = kind.actions_indexes["IDLE"]
        changes = np.isin(handed, [a for a, name in kind.actions.items() if name in _CHANGES])
        return np.where(refused & changes, idle, handed)
    if not isinstance(kind, ContinuousAction):
        return handed
    unit = _in_unit_range(kind, commands)
    known = np.isfinite(unit).all(axis=1)
    if isinstance(kind, DiscreteAction):
        box = ContinuousAction.space(kind)
        grid = np.array([*product(*np.linspace(box.low, box.high, kind.actions_per_axis).T)])
        distances = np.linalg.norm(np.where(known[:, None], unit, 0.0)[:, None] - grid, axis=2)
        return np.where(known, distances.argmin(axis=1), handed)
    return np.where(known[:, None], unit, handed).astype(handed.dtype)


_CHANGES = tuple(DiscreteMetaAction.ACTIONS_ALL[label] for label in (LANE_LEFT, LANE_RIGHT))


def _in_unit_range(kind: ContinuousAction, commands: np.ndarray) -> np.ndarray:
    """Commands `[E, 2]` as continuous actions `[E, A]` in [-1, 1]."""
    columns = []
    if kind.longitudinal:
        columns.append(utils.lmap(commands[:, 0], kind.acceleration_range, [-1, 1]))
    if kind.lateral:
        columns.append(utils.lmap(commands[:, 1], kind.steering_range, [-1, 1]))
    return np.clip(np.stack(columns, axis=1), -1.0, 1.0)
