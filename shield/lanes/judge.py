"""Who broke their proper response (Def. 27), judged relative to one published parameter table.

A contact at time t_c has a danger threshold t_b: the last sample at which an axis was safe. The
required distance at t_b is the sum of what each of the two may use up until they meet:

  longitudinal   how far the rear car may get, less how far the front car must still get
  lateral        how far each may come toward the other

so, as long as both stay inside their own share, they cannot touch. Hence a contact always has a
culprit: somebody used more than that share. Displacements are judged, because heading, slip, reversing
and turning all end up in them. On top of that the accelerations of both are held to Def. 4, and the
ego's lateral speed to Def. 8, on every dangerous frame.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import apart, compiled, compiled_for_arrays, inner
from rss_shield.shield.chosen import how_many, which
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.kinematics import forward_reach, speed_envelope, travel
from rss_shield.shield.definitions.lateral import approach_no_credit
from rss_shield.shield.definitions.response import FRONT, LAT, LON, NEITHER, lateral_speed_limit, longitudinal_response
from rss_shield.shield.ground import table_of
from rss_shield.shield.lanes.memory import MEMORY, catch_up, forget_safe, owes, remember, role_of_ego, role_of_other
from rss_shield.shield.lanes.pair import assess, head_on_braking, is_following
from rss_shield.shield.sampling import euler_margin, lateral_euler_margin, sampled_approach, slowest_in_danger
from rss_shield.shield.verdicts import (
    KEPT,
    NOBODY,
    REVERSED,
    TOO_CLOSE,
    TOO_FAR,
    TOO_HARD,
    TOO_SHORT,
    TOO_WEAK,
    TOWARD,
    judged,
    who_broke,
)

NOW, NEXT_FRAME = np.int64(0), np.int64(1)
_TOLERANCE = 1e-6  # rounding, in the unit of each duty


@inner
def is_broken(duty, excess, tolerances):
    """Was a duty broken by more than rounding, and than is tolerated of it? `tolerances`: `[D]`, None = nothing is."""
    if tolerances is None:
        return excess > _TOLERANCE
    return excess > max(_TOLERANCE, tolerances[duty])


@inner
def blame_ego(memory, duty, excess, tolerances=None):
    """Note that the ego broke a duty, if it did; the first one counts, and the most that it was broken by."""
    if is_broken(duty, excess, tolerances):
        if memory.ego_broke == KEPT:
            memory.ego_broke = duty
        if memory.ego_broke == duty:
            memory.ego_excess = max(memory.ego_excess, excess)


@inner
def _blame_other(memory, duty, excess, tolerances):
    if is_broken(duty, excess, tolerances):
        if memory.other_broke == KEPT:
            memory.other_broke = duty
        if memory.other_broke == duty:
            memory.other_excess = max(memory.other_excess, excess)


@compiled
def judge_motion(memory, ego, user, table, ahead, slack):
    """`judge_motion_in` of cars that a simulator moves by explicit Euler, frame by frame."""
    judge_motion_in(memory, ego, user, table, ahead, slack, table.dt, None)


@compiled
def judge_motion_in(memory, ego, user, table, ahead, slack, step, tolerances):
    """Hold what each has used of the distance at the threshold against its share, on a dangerous sample.

    Args:
      memory: `MEMORY` record after this sample, since > 0; the verdict so far is kept in it.
      ego, user: `ROAD_USER` records.
      table: `Table` in force.
      ahead: frames to extrapolate along the headings: 0, or 1 where contact is predicted.
      slack: how far the ego's heading may overshoot its share in that extrapolation [m]; it lags
        behind the lateral speed, and `overlap_margin` is there for it.
      step: of explicit Euler [s]; 0 where cars move as cars do, and frames are only when somebody looked.
      tolerances: see `is_broken`.
    """
    table = table_of(table, user)
    dt = table.dt
    later = ahead * dt
    if owes(memory, LON):
        travel_ego = memory.travel_ego + ego.speed * ego.cos * later
        travel_other = memory.travel_other + user.speed * user.cos * later
        longer_ego = ego.half_length - memory.half_length_ego
        longer_other = user.half_length - memory.half_length_other
        # danger from the start is counted from its first sample, any other from the safe one before
        tau = (memory.since - (memory.axes == NEITHER) + ahead) * dt
        if not is_following(memory.v_ego, memory.v_other, memory.opposite):
            sign = 1.0 if memory.ego_is_rear else -1.0
            b_ego, b_other = head_on_braking(memory.opposite, memory.in_own_lane, table.ego, table.other)
            share = _share_toward(sign * memory.v_ego, table.ego, b_ego, step)
            blame_ego(memory, TOO_FAR, sign * travel_ego + longer_ego - share, tolerances)
            share = _share_toward(-sign * memory.v_other, table.other, b_other, step)
            _blame_other(memory, TOO_FAR, -sign * travel_other + longer_other - share, tolerances)
        elif memory.ego_is_rear:
            share = _share_rear(tau, memory.v_ego, table.ego, step)
            blame_ego(memory, TOO_FAR, travel_ego + longer_ego - share, tolerances)
            share = _share_front(tau, memory.v_other, table.other, step)
            _blame_other(memory, TOO_SHORT, share - travel_other + longer_other, tolerances)
        else:
            share = _share_front(tau, memory.v_ego, table.ego, step) - memory.way_back
            blame_ego(memory, TOO_SHORT, share - travel_ego + longer_ego, tolerances)
            share = _share_rear(tau, memory.v_other, table.other, step)
            _blame_other(memory, TOO_FAR, travel_other + longer_other - share, tolerances)
        if ahead == 0 and memory.age > 1 and not user.wreck:
            duty, excess = _audit_acceleration(
                role_of_other(memory),
                tau - dt,
                memory.speed_other - memory.acceleration_other * dt,
                memory.acceleration_other,
                table.other,
                dt,
            )
            _blame_other(memory, duty, excess, tolerances)
    if owes(memory, LAT):
        used = memory.approach_ego + max(memory.side * ego.speed * ego.sin, 0.0) * later
        share = approach_no_credit(memory.w_ego, table.ego) + lateral_euler_margin(memory.w_ego, table.ego, step)
        blame_ego(memory, TOO_CLOSE, used - share - slack, tolerances)
        used = memory.approach_other + max(-memory.side * user.speed * user.sin, 0.0) * later
        # a driver may already use the first frame's growth on it; mu has room for that
        first_frame = table.other.a_lat_max_accel * step**2
        excess = used - sampled_approach(memory.w_other, table.other, step) - first_frame
        _blame_other(memory, TOO_CLOSE, excess, tolerances)


@inner
def _share_rear(tau, v, params, dt):
    """Farthest a follower may have got `tau` after the threshold, sampled by explicit Euler [m]."""
    rho, a, b = params.response_time, params.a_max_accel, params.a_min_brake
    v_now = speed_envelope(tau, v, rho, a, b, params.v_cap)
    return travel(tau, v, rho, a, b, params.v_cap) + (v - v_now) * dt / 2 + b * dt**2 / 8


@inner
def _share_front(tau, v, params, dt):
    """Least a leader must have got on `tau` after the threshold, sampled by explicit Euler [m]."""
    v_now = speed_envelope(tau, v, 0.0, 0.0, params.a_max_brake)
    return travel(tau, v, 0.0, 0.0, params.a_max_brake) + (v - v_now) * dt / 2


@inner
def _share_toward(v, params, b, dt):
    """Farthest a car with speed `v` toward the other may ever come (Def. 2 and Section 4.1's table) [m]."""
    return forward_reach(v, params.response_time, params.a_max_accel, b, params.v_cap) + euler_margin(v, b, dt)


@compiled
def audit_command(memory, ego, command, drift, params, dt, tolerances=None):
    """Did the ego's command keep its duties toward one road user on one dangerous frame?

    These are the duties of the threshold (Def. 10) and those of the situation as it is now (hole H23), each with
    the response time counted from when it came about.

    Args:
      memory: `MEMORY` record after this sample, since > 0.
      ego: `ROAD_USER` record.
      command: executed `Command` of the frame.
      drift: lateral speed at which a curved lane leaves its tangent during the frame [m/s].
      params: `RSSParams` of the ego.
      dt: length of the frame [s].
      tolerances: see `is_broken`.

    Returns:
      (duty, excess): index into `DUTIES`, 0 = kept, and how much it was broken by.
    """
    if owes(memory, LON):
        duty, excess = _audit_acceleration(
            role_of_ego(memory), memory.since * dt, ego.speed, command.acceleration, params, dt
        )
        if is_broken(duty, excess, tolerances):
            return duty, excess
        if role_of_ego(memory) == FRONT and memory.since * dt >= params.response_time - _TOLERANCE:
            excess = slowest_in_danger(ego.speed, params, dt) - (ego.speed + command.acceleration * dt)
            if is_broken(REVERSED, excess, tolerances):
                return REVERSED, excess
    if memory.role_now != FRONT:
        duty, excess = _audit_acceleration(
            memory.role_now, memory.role_for * dt, ego.speed, command.acceleration, params, dt
        )
        if is_broken(duty, excess, tolerances):
            return duty, excess
    u = ego.speed * np.sin(ego.heading + command.slip) - drift
    if owes(memory, LAT):
        excess = memory.side * u - lateral_speed_limit(memory.since, memory.w_ego, params, dt)
        if is_broken(TOWARD, excess, tolerances):
            return TOWARD, excess
    if memory.side_now != 0.0:
        excess = memory.side_now * u - lateral_speed_limit(memory.side_for, memory.w_side, params, dt)
        if is_broken(TOWARD, excess, tolerances):
            return TOWARD, excess
    return KEPT, 0.0


@inner
def _audit_acceleration(role, tau, v, a, params, dt):
    """Def. 4 on one frame that starts `tau` after the threshold at speed `v`: (duty, excess), 0 = kept."""
    lower, upper = longitudinal_response(role, tau, v, params)
    stops = (upper < 0.0 or v <= 0.0) and v + a * dt <= _TOLERANCE  # the last braking step is partial, in reverse too
    if a - upper > _TOLERANCE and not stops:
        return TOO_WEAK, a - upper
    if role == FRONT and lower - a > _TOLERANCE:
        return TOO_HARD, lower - a
    return KEPT, 0.0


@apart
def judge_frame(ego, users, memory, command, curvature, table, who=None):
    """Judge one frame of all pairs after `find_danger` has updated their memory.

    Args:
      ego, users, memory: as in `find_danger`; the verdict so far is kept in `memory`.
      command: `Command` that the ego executes on this frame.
      curvature: of the lane under the ego, see `shield.lanes.frame.Bend` [1/m].
      table: as in `find_danger`.
      who: as in `find_danger`; nobody else may be in danger.

    Returns:
      (pairs, broken): dangerous pairs on this frame, and those whose duty the ego broke on it.
    """
    drift = 0.5 * curvature * ego.speed**2 * table.dt
    pairs = broken = 0
    for a in range(how_many(who, users)):
        i = which(who, a)
        if memory[i].since > 0:
            judge_motion(memory[i], ego, users[i], table, NOW, 0.0)
            duty, excess = audit_command(memory[i], ego, command, drift, table.ego, table.dt)
            blame_ego(memory[i], duty, excess)
            pairs += 1
            broken += duty != KEPT
    return pairs, broken


@apart
def judge_contact(ego, user, memory, table):
    """Verdict at the first contact of the ego with one road user (Def. 27).

    Args:
      ego, user: `ROAD_USER` records at the sample at which contact exists or is predicted for the
        next frame, before any impact displaces the cars.
      memory: `MEMORY` record after the previous sample, nothing skipped (`shield.lanes.memory.catch_up`).

    Returns:
      `Verdict`. "inherited": never safe since first sight and the ego responded properly all the
      time. "none" must not happen: a margin is missing.
    """
    pair = assess(ego, user, table)
    remember(memory, pair, ego, user, table.dt)
    if memory.since > 0:
        judge_motion(memory, ego, user, table, NOW, 0.0)
        # the simulator predicts contacts one frame ahead
        judge_motion(memory, ego, user, table, NEXT_FRAME, table.rules.overlap_margin)
    return sum_up(memory)


@compiled
def sum_up(memory):
    """`Verdict` of a contact by what is remembered of the pair."""
    never_safe = memory.axes == NEITHER
    return judged(NOBODY if memory.since == 0 else who_broke(memory, never_safe), memory.axes, memory)


class Log(NamedTuple):
    """A recorded episode of T frames with N road users, in shield terms."""

    ego: np.ndarray  # `[T]` `ROAD_USER`
    users: np.ndarray  # `[T, N]` `ROAD_USER`
    present: np.ndarray  # `[T, N]` bool; absent users are masked
    acceleration: np.ndarray  # `[T]` executed by the ego [m/s^2]
    slip: np.ndarray  # `[T]` [rad]
    curvature: np.ndarray  # `[T]` of the lane under the ego [1/m]
    jumped: np.ndarray  # `[T, N]` bool: the lane frame jumped on this frame, or the user around a ring in it
    ego_before: np.ndarray  # `[T]` `ROAD_USER` on the frame before, in this frame's lane frame; read where it jumped
    users_before: np.ndarray  # `[T, N]` likewise


class Audit(NamedTuple):
    """Was the ego's duty kept? One entry per frame and road user."""

    dangerous: np.ndarray  # `[T, N]` bool: a duty was owed on this frame
    duty: np.ndarray  # `[T, N]` index into DUTIES, 0 = kept
    excess: np.ndarray  # `[T, N]` how much it was broken by


@compiled_for_arrays
def audit(log, table):
    """Replay a log and say for every dangerous pair-frame whether the ego kept its duty (Defs. 4, 8, 10).

    Args:
      log: `Log`.
      table: `Table` in force.

    Returns:
      `Audit`.
    """
    dt = table.dt
    frames, count = log.present.shape
    dangerous = np.zeros((frames, count), np.bool_)
    duty = np.zeros((frames, count), np.int64)
    excess = np.zeros((frames, count))
    memory = np.zeros(count, MEMORY)
    for t in range(frames):
        ego = log.ego[t]
        command = Command(log.acceleration[t], log.slip[t])
        drift = 0.5 * log.curvature[t] * ego.speed**2 * dt
        for i in range(count):
            if not log.present[t, i]:
                continue
            if log.jumped[t, i]:
                forget_safe(memory[i])
            catch_up(memory[i], log.ego_before[t], log.users_before[t, i], table)
            pair = assess(ego, log.users[t, i], table)
            remember(memory[i], pair, ego, log.users[t, i], dt)
            if memory[i].since > 0:
                dangerous[t, i] = True
                duty[t, i], excess[t, i] = audit_command(memory[i], ego, command, drift, table.ego, dt)
    return Audit(dangerous, duty, excess)
