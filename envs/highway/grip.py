"""Vehicles of highway-env do what tyres and brakes admit: their commands are held to it before they move."""

from typing import Any

import numpy as np

from rss_shield.envs.conditions import group_of, held
from rss_shield.shield.ground import Ground

_LOW = (1 << 64) - 1


class Grip:
    """Takes the place of a vehicle's `clip_actions`, which highway-env calls before it moves.

    Args:
      vehicle: highway-env's.
      ground: `Ground`.
      group: its class, -1 = it is the ego.
    """

    def __init__(self, vehicle: Any, ground: Ground, group: int) -> None:
        self.vehicle, self.ground, self.group = vehicle, ground, group
        vehicle.clip_actions = self.clip

    def clip(self) -> None:
        vehicle = self.vehicle
        asked, x = float(vehicle.action["acceleration"]), float(vehicle.position[0])
        vehicle.action = vehicle.action | {"acceleration": float(held(asked, self.ground, x, self.group))}
        type(vehicle).clip_actions(vehicle)


def grip_on(vehicle: Any) -> Grip | None:
    """The grip of a vehicle itself; a shallow copy carries that of the original."""
    grip = getattr(vars(vehicle).get("clip_actions"), "__self__", None)
    return grip if isinstance(grip, Grip) and grip.vehicle is vehicle else None


def draw_groups(env: Any, ground: Ground) -> None:
    """Vehicle classes of everybody on the road, at the start of an episode."""
    key = np.uint64(env.np_random.bit_generator.state["state"]["state"] & _LOW)
    for i, vehicle in enumerate(env.road.vehicles):
        own = any(vehicle is one for one in env.controlled_vehicles)
        vehicle.rss_group = 0 if own else int(group_of(key, i, ground.shares))


def hold_everybody(env: Any, ground: Ground) -> None:
    """Grip for every vehicle that has none yet."""
    for vehicle in env.road.vehicles:
        if grip_on(vehicle) is None:
            own = any(vehicle is one for one in env.controlled_vehicles)
            Grip(vehicle, ground, -1 if own else getattr(vehicle, "rss_group", 0))
