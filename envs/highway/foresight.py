"""Masks of meta-actions on highway-env: would the coming decision pass without a proper response?

Nothing is decided here: what looking ahead changes of a shield or of its vehicle is put back.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from highway_env.envs.common.action import DiscreteMetaAction

from rss_shield.envs.decisions.foresight import Aim, Seen, first_response, make_stage, without_anticipation
from rss_shield.envs.decisions.junctions import first_override
from rss_shield.envs.decisions.masks import allow
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.roads.steering import PURSUIT
from rss_shield.shield.junctions.controller import has_plan
from rss_shield.shield.lanes.restriction import Body


def action_mask(ego: ShieldedEgo, env: Any) -> np.ndarray:
    """Which meta-actions would pass the coming decision, `[A]` bool.

    Args:
      ego: the shield on the ego.
      env: highway-env's environment.

    Raises:
      ValueError: the actions are no meta-actions.
    """
    kind = env.action_type
    if not isinstance(kind, DiscreteMetaAction):
        raise ValueError(f"action_masks: expected DiscreteMetaAction, not {type(kind).__name__}")
    mask = np.ones(len(kind.actions), bool)
    if ego.has_contact or ego.vehicle.crashed or ego.vehicle.impact is not None:
        return mask
    frames = int(env.config["simulation_frequency"] // env.config["policy_frequency"])
    names = [kind.actions[a] for a in range(len(mask))]
    first = _at_junctions(ego, names, frames) if isinstance(ego, JunctionEgo) else _on_lanes(ego, names, frames)
    allow(first, frames, labels_of(kind), mask)
    return mask


def labels_of(kind: DiscreteMetaAction) -> np.ndarray:
    """`[A]` meta-action of each action, index into highway-env's `ACTIONS_ALL`."""
    numbers = {name: number for number, name in DiscreteMetaAction.ACTIONS_ALL.items()}
    return np.array([numbers[kind.actions[a]] for a in range(len(kind.actions))], np.int64)


def _on_lanes(ego: ShieldedEgo, names: list[str], frames: int) -> np.ndarray:
    """Frame on which each action would first be answered, `[A]`."""
    vehicle = ego.vehicle
    before, first = vehicle.target_lane_index, np.zeros(len(names), np.int64)
    with _peeking(ego):
        ego._meet()
        settings = without_anticipation(ego.settings)
        users, me, bend = ego._sense()
        seen, stage = Seen(me, users, *ego.last, ego.memory), make_stage(len(users))
        body = Body(
            *ego.body, bend.curvature, bend.slack, bend.turned, bend.idle, False, settings.table.ego.a_min_brake
        )
        for a, name in enumerate(names):
            with _as_if(vehicle, name):
                target = vehicle.target_lane_index
                if not ego.is_refused(before, target):
                    lane = vehicle.road.network.get_lane(target)
                    s, offset = lane.local_coordinates(vehicle.position)
                    ahead = lane.heading_at(s + vehicle.speed * PURSUIT)
                    turn = ahead - (vehicle.heading - me["heading"])
                    aim = Aim(float(vehicle.target_speed), float(offset), float(turn))
                    first[a] = first_response(seen, stage, aim, body, frames, settings.table)
    return first


def _at_junctions(ego: JunctionEgo, names: list[str], frames: int) -> np.ndarray:
    """Frame on which the shield would change what each action asks for, `[A]`."""
    settings, vehicle = ego.settings, ego.vehicle
    before, first = vehicle.target_lane_index, np.zeros(len(names), np.int64)
    for a, name in enumerate(names):
        with _peeking(ego), _as_if(vehicle, name):
            ego._meet()
            target = vehicle.target_lane_index
            rules = settings.entry, not settings.waits_anywhere
            if target != before and target[:2] == before[:2]:
                changed = ego._scene_of(*ego._look())
                if not has_plan(changed, ego._remembered(len(ego.samples)), *rules):
                    continue
            scene, speed = ego._scene(), float(vehicle.target_speed)
            first[a] = first_override(
                scene, ego.samples, ego._remembered(len(ego.samples)), ego.plan, speed, frames, *rules, settings.examine
            )
    return first


@contextmanager
def _peeking(ego: ShieldedEgo) -> Iterator[None]:
    """What the shield learns meanwhile is forgotten."""
    saved = dict(vars(ego))
    for name in ("memory", "crossings", "plan"):
        if name in saved:
            setattr(ego, name, saved[name].copy())
    try:
        yield
    finally:
        vars(ego).clear()
        vars(ego).update(saved)


@contextmanager
def _as_if(vehicle: Any, name: str) -> Iterator[None]:
    """Inside, the vehicle has taken a meta-action."""
    saved, random = dict(vars(vehicle)), vehicle.road.np_random.bit_generator
    state = random.state  # where roads fork, the next one may be drawn
    if vehicle.route:
        vehicle.route = list(vehicle.route)
    try:
        type(vehicle).act(vehicle, name)
        yield
    finally:
        vars(vehicle).clear()
        vars(vehicle).update(saved)
        random.state = state
