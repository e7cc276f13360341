"""The shield in a simulator of your own: numbers in, the permitted command out. Needs numpy and numba, nothing else.

    python examples/own_simulator.py

A car at full throttle comes up behind a slower one, which brakes hard after four seconds. One lane, frames of 0.1 s.
"""

import numpy as np

from rss_shield.shield import PRESETS, Rules, table_for
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.controller import find_danger, respond
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body

DT, SECONDS = 0.1, 12.0
table = table_for(PRESETS["slides"], Rules(), DT)
body = Body(half_wheelbase=1.25, max_slip=0.5, curvature=0.0)


def car(s: float, speed: float) -> np.ndarray:
    """A road user in the middle of the lane, in the lane frame of the ego."""
    record = np.zeros(1, ROAD_USER)[0]
    record["s"], record["speed"], record["along"] = s, speed, speed
    record["cos"], record["around"], record["in_own_lane"] = 1.0, np.inf, True
    record["half_length"], record["half_width"] = 2.5, 1.0
    return record


def drive(shielded: bool) -> str:
    """How it ends."""
    ego, leader = car(0.0, 15.0), car(60.0, 12.0)
    ego_before, leader_before = np.zeros(1, ROAD_USER)[0], np.zeros(1, ROAD_USER)
    memory, smallest = np.zeros(1, MEMORY), np.inf  # one record per road user, kept from frame to frame
    for frame in range(round(SECONDS / DT)):
        smallest = min(smallest, leader["s"] - ego["s"] - 5.0)
        if smallest <= 0.0:
            return f"they touch after {frame * DT:.1f} s at {ego['speed']:.0f} m/s"
        users = np.array([leader])
        danger = find_danger(ego, users, ego_before, leader_before, memory, table)
        response = respond(
            Command(table.ego.a_max_accel, 0.0), danger, ego, body, table.rules, DT
        )  # full throttle, if permitted
        ego_before, leader_before = ego.copy(), users
        braking = -8.0 if frame * DT > 4.0 else 0.0
        for user, a in ((ego, response.command.acceleration if shielded else table.ego.a_max_accel), (leader, braking)):
            user["s"] += user["speed"] * DT
            user["along"] = user["speed"]
            user["speed"] = max(user["speed"] + a * DT, 0.0)
    return f"smallest gap {smallest:.1f} m, and they stand" if ego["speed"] == 0.0 else f"smallest gap {smallest:.1f} m"


print(f"without the shield: {drive(False)}")
print(f"with the shield: {drive(True)}")
