"""The shield of a car in open space on one frame: what happened since the last one, and what it does on this one."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, part
from rss_shield.shield.comfort import gap_in_way
from rss_shield.shield.definitions.kinematics import time_to_collision
from rss_shield.shield.definitions.occupancy import MAX_STEPS, ROW_FIELDS
from rss_shield.shield.geometry import turned_half_extents
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE, RESPONSE_STEER
from rss_shield.shield.open_space.frames import (
    MAX_SLIP,
    PEDESTRIAN,
    braking_at_once,
    fastest,
    sampled_occupancy,
    slowest,
)
from rss_shield.shield.open_space.judge import judge_motion
from rss_shield.shield.open_space.pair import distance_between, permits, remember, role_of
from rss_shield.shield.open_space.trajectory import braking_of, intention

SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the way from braking to what the agent asks for, in this order
WORK = (8, MAX_STEPS, ROW_FIELDS)  # shape of the scratch array


class Intended(NamedTuple):
    """What a car is about to do."""

    acceleration: float  # [m/s^2]
    slip: float  # angle between heading and motion [rad]
    held: float  # slip of the last frame, which it keeps while it carries out its last way out


class SpaceReport(NamedTuple):
    """What happened on one frame, and what is let through."""

    acceleration: float
    slip: float
    overridden: bool
    anticipated: bool
    limited: bool
    response: int  # sum of RESPONSE_BRAKE, RESPONSE_STEER
    pairs: int  # in danger
    broken: int  # of these, those toward which the ego has broken its duty on the frame before
    partner: int  # who is in the way of what the agent asks for, else the first one in danger; -1 = nobody
    ttc: float  # time to collision with somebody ahead in the way of the ego [s]; inf if none


@compiled
def open_space_frame(now, before, memory, wish, table, space, overrides, work):
    """One frame of one ego: judge the last one, look at everybody, restrict the command.

    Args:
      now: `[N + 1]` USER, the ego last, before: the same on the frame before; who is new has age 0 in memory.
      memory: `[N]` PAIR, in place.
      wish: `Intended`.
      table: `Table`; everybody's sets are by `table.other`, also the ego's, as others see it.
      space: `Space`.
      overrides: False = only watch.
      work: scratch of shape WORK.

    Returns:
      `SpaceReport`.
    """
    n, dt, ego = len(memory), table.dt, now[len(memory)]
    limited = _limited(ego, wish, table)
    brake = braking_of(ego.speed, table.ego.a_min_brake, dt)
    free = np.int64(0)  # bits of the shares of the command that are permitted toward everybody
    for c in range(len(SHARES)):
        free |= np.int64(1) << np.int64(c)
    own = sampled_occupancy(ego, table.other, dt, work[6], work[7])
    pairs, broken, partner, in_danger, ttc = 0, 0, -1, -1, np.inf
    for i in range(n):
        user, pair = now[i], memory[i]
        if pair.age > 0:
            broken += judge_motion(before[n], before[i], ego, user, pair, table, space, work)
        driver = space.pedestrian if user.kind == PEDESTRIAN else table.other
        other = sampled_occupancy(user, driver, dt, work[2], work[3])
        ttc = min(ttc, _time_to(ego, user))
        remember(pair, distance_between(own, other, user.kind, user.first, space), ego, user, space, dt)
        if pair.since == 0:
            continue
        pairs += 1
        in_danger = i if in_danger < 0 else in_danger
        if not overrides:
            continue
        braking_at_once(user, driver, dt, work[4])
        role = role_of(pair.last, not user.first)
        blocked = False
        for c in range(len(SHARES)):
            bit = np.int64(1) << np.int64(c)
            if free & bit:
                acceleration = brake + SHARES[c] * (limited.acceleration - brake)
                plan = intention(ego, acceleration, limited.slip, table.ego.a_min_brake, dt, work[5])
                if not permits(plan, ego, acceleration, other, work[4], user, role, space.clearance, space, dt):
                    free &= ~bit
                    blocked |= c == 0
        if blocked and partner < 0:
            partner = i
    partner = in_danger if partner < 0 else partner
    if not overrides:
        return SpaceReport(wish.acceleration, wish.slip, False, False, False, 0, pairs, broken, partner, ttc)
    acceleration, slip, response = brake, wish.held, RESPONSE_BRAKE | RESPONSE_STEER
    if ego.speed == 0.0:
        slip, response = limited.slip, RESPONSE_BRAKE  # wheels may be turned where they stand
    for c in range(len(SHARES) - 1, -1, -1):
        if free & (np.int64(1) << np.int64(c)):
            acceleration, slip = brake + SHARES[c] * (limited.acceleration - brake), limited.slip
            response = 0 if c == 0 else RESPONSE_BRAKE
    is_limited = limited.acceleration != wish.acceleration or limited.slip != wish.slip
    return SpaceReport(acceleration, slip, response != 0, False, is_limited, response, pairs, broken, partner, ttc)


@part
def _limited(ego, wish, table):
    """What a wish is within the limits that everybody else relies on: acceleration, braking, speed and wheels."""
    gear = -1.0 if ego.speed < 0.0 or (ego.speed == 0.0 and wish.acceleration < 0.0) else 1.0
    v, dt = gear * ego.speed, table.dt
    v_next = min(max(v + gear * wish.acceleration * dt, slowest(v, table.ego, dt)), fastest(v, table.ego, dt))
    acceleration = gear * (v_next - v) / dt
    if np.abs(acceleration - wish.acceleration) < 1e-9:
        acceleration = wish.acceleration
    return Intended(acceleration, min(max(wish.slip, -MAX_SLIP), MAX_SLIP), wish.held)


@part
def _time_to(ego, user):
    """Time to collision with somebody ahead in the ego's way, at constant velocities [s]; inf if it isn't."""
    gear = -1.0 if ego.speed < 0.0 else 1.0
    cos, sin = gear * np.cos(ego.heading), gear * np.sin(ego.heading)
    dx, dy = user.x - ego.x, user.y - ego.y
    c, s = np.cos(user.heading), np.sin(user.heading)
    length, width = turned_half_extents(2 * user.half_length, 2 * user.half_width, c * cos + s * sin, s * cos - c * sin)
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    gap = gap_in_way(along, across, 2 * (length + ego.half_length), 2 * (width + ego.half_width))
    if gap == np.inf:
        return np.inf
    return time_to_collision(gap, gear * ego.speed - user.speed * (c * cos + s * sin))
