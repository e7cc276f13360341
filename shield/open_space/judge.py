"""Who has kept the proper response of Def. 22, read off two successive frames, and who is to blame for a contact."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, part
from rss_shield.shield.geometry import wrap_angle
from rss_shield.shield.open_space.frames import (
    FIXED,
    MAX_SLIP,
    PEDESTRIAN,
    braking_at_once,
    fastest,
    sampled_occupancy,
    slowest,
)
from rss_shield.shield.open_space.pair import HAS_WAY, permits, role_of
from rss_shield.shield.open_space.trajectory import intention
from rss_shield.shield.verdicts import (
    ACCELERATED,
    JUMPED,
    KEPT,
    NOBODY,
    STEERED,
    TOO_HARD,
    TOO_WEAK,
    WALKED_IN,
    judged,
    who_broke,
)

_SPEED, _ANGLE, _GAP = 1e-6, 1e-3, 0.02  # what rounding may cost [m/s], [rad], [m]
_PLACE = 1e-3  # likewise of a way that speed explains [m]
_ROLLS = 0.05  # slower than this the wheels of another can't be seen [m/s]
_UNSEEN = 10.0  # stands for their slip then


@part
def slip_of(before, after, dt):
    """Angle between heading and motion of a car during a frame, as its turn shows [rad]; 0 at walking pace or less."""
    if np.abs(before.speed) < _ROLLS:
        return 0.0
    sin = wrap_angle(after.heading - before.heading) * before.half_length / (before.speed * dt)
    return np.arcsin(min(max(sin, -1.0), 1.0))


@part
def _limits_kept(before, after, driver, dt):
    """Has nobody sped up or braked harder than the table says? (duty broken, by how much [m/s^2])"""
    gear = -1.0 if before.speed < 0.0 else 1.0
    v, v_after = gear * before.speed, gear * after.speed
    too_fast = v_after - fastest(v, driver, dt)
    if too_fast > _SPEED:
        return ACCELERATED, too_fast / dt
    too_slow = slowest(v, driver, dt) - v_after
    if too_slow > _SPEED:
        return TOO_HARD, too_slow / dt
    return KEPT, 0.0


@part
def _jump(before, after, dt):
    """How much farther than its wheels took it one has moved, or has turned its ends, during a frame [m]."""
    moved = np.hypot(after.x - before.x, after.y - before.y)
    turned = np.abs(wrap_angle(after.heading - before.heading)) * before.half_length
    return max(moved, turned) - max(np.abs(before.speed), np.abs(after.speed)) * dt


@part
def _duty(before, after, other, memory, is_ego, table, space, work):
    """Duty that one of two has broken during a frame toward the other, and by how much.

    Args:
      before, after: `USER` of the one on two successive frames, other: of the other on the first of them.
      memory: `PAIR` as it was on the first.
      work: `[6, K, ROW_FIELDS]` scratch.
    """
    dt, driver = table.dt, space.pedestrian if before.kind == PEDESTRIAN else table.other
    jumped = _jump(before, after, dt)
    if jumped > _PLACE and before.kind != PEDESTRIAN:
        return JUMPED, jumped
    if before.kind == FIXED:
        return KEPT, 0.0
    broke, excess = _limits_kept(before, after, driver, dt)
    slip = slip_of(before, after, dt)
    if broke == KEPT and np.abs(slip) > MAX_SLIP + _ANGLE:
        broke, excess = STEERED, np.abs(slip) - MAX_SLIP
    if broke != KEPT or memory.since == 0 or before.kind == PEDESTRIAN:
        return broke, excess
    if not memory.never and memory.since * dt < driver.response_time - 1e-9:
        return KEPT, 0.0
    role = role_of(memory.last, not other.first if is_ego else before.first)
    if role == HAS_WAY and other.speed != 0.0:
        return KEPT, 0.0
    acceleration = (after.speed - before.speed) / dt
    plan = intention(before, acceleration, slip, driver.a_min_brake, dt, work[0])
    others_driver = space.pedestrian if other.kind == PEDESTRIAN else table.other
    occupancy = sampled_occupancy(other, others_driver, dt, work[1], work[2])
    braking_at_once(other, others_driver, dt, work[3])
    eps = max(space.clearance - _GAP, 0.0)
    if permits(plan, before, acceleration, occupancy, work[3], other, role, eps, space, dt):
        return KEPT, 0.0
    due = max(np.abs(before.speed) - driver.a_min_brake * dt, 0.0)
    too_fast = np.abs(after.speed) - due
    if too_fast > _SPEED:
        return TOO_WEAK, too_fast / dt
    turned = np.abs(slip - (memory.ego_slip if is_ego else memory.other_slip))
    if np.abs(before.speed) >= _ROLLS and _ANGLE < turned < 0.5 * _UNSEEN:
        return STEERED, turned
    return KEPT, 0.0


@compiled
def judge_motion(ego_before, user_before, ego, user, memory, table, space, work):
    """Did both keep their duties between two successive frames? To be called before `remember` of the second.

    Args:
      ego_before, user_before: `USER` of both on the first frame, ego, user: on the second.
      memory: `PAIR`; what is broken first is written down.
      table: `Table`, by which everybody is judged as `other`.
      work: `[6, K, ROW_FIELDS]` scratch.

    Returns:
      Has the ego broken a duty during that frame, in danger?
    """
    broke, excess = _duty(ego_before, ego, user_before, memory, True, table, space, work)
    if broke != KEPT and memory.ego_broke == KEPT:
        memory.ego_broke, memory.ego_excess = broke, excess
    now = broke != KEPT and memory.since > 0
    broke, excess = _duty(user_before, user, ego_before, memory, False, table, space, work)
    if broke != KEPT and memory.other_broke == KEPT:
        memory.other_broke, memory.other_excess = broke, excess
    memory.ego_slip = slip_of(ego_before, ego, table.dt) if np.abs(ego_before.speed) >= _ROLLS else _UNSEEN
    memory.other_slip = slip_of(user_before, user, table.dt) if np.abs(user_before.speed) >= _ROLLS else _UNSEEN
    return now


@compiled
def judge_touch(ego, user, memory):
    """Def. 27 in open space: the `Verdict` of a contact, after `judge_motion` of the frame that led to it."""
    if user.kind == PEDESTRIAN and memory.ego_broke == KEPT and ego.speed == 0.0 and memory.other_broke == KEPT:
        memory.other_broke, memory.other_excess = WALKED_IN, np.abs(user.speed)
    verdict = who_broke(memory, memory.never)
    if verdict == NOBODY and memory.age == 0:
        memory.never = True
        verdict = who_broke(memory, True)
    return judged(verdict, memory.kind, memory)
