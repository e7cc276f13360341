"""What to do about others who misbehave: predict them naively, and get out of their way. Defs. 11-13.

Positions are along (x, v) and across (y, u) the ego's lane, y to the right. All functions take floats; `naive` arrays.

Where the paper leaves a choice: a car at rest that accelerates starts, one that brakes does not back up; halting holds
across the lane too, where both signs are alike (N2 asks for the worst case besides: predict with `a_lat` = 0 as well);
third parties are taken at their worst, only the offender is predicted naively (E1); manoeuvres come from a finite
family (E2), and "there was a way out" is relative to it (E3).
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import choose, compiled, compiled_for_arrays, inner, larger, smaller
from rss_shield.shield.definitions.kinematics import reach, stopping_distance, travel
from rss_shield.shield.definitions.lateral import d_min_no_credit
from rss_shield.shield.definitions.longitudinal import d_min_longitudinal, is_safe_longitudinally


class Motion(NamedTuple):
    """A car beside or on the ego's lane, at time 0."""

    x: float  # centre, along       [m]
    v: float  #                     [m/s]
    a: float  #                     [m/s^2]
    y: float  # centre, across      [m]
    u: float  #                     [m/s]
    a_lat: float  #                 [m/s^2]
    half_length: float  #           [m]
    half_width: float  #            [m]


class Plan(NamedTuple):
    """An evasive manoeuvre: one longitudinal acceleration until rest, and a swerve."""

    a: float  # [m/s^2]
    a_lat: float  # across during `swerve`, then against the lateral speed until that is 0 [m/s^2]
    swerve: float  # [s]


@compiled_for_arrays
def naive(p, v, a, t, both_ways=False):
    """Def. 11: (position [m], speed [m/s]) after `t` if the acceleration stays, and ends where it has halted the car.

    Args:
      p, v, a: position [m], speed [m/s] and acceleration [m/s^2] now.
      t: time >= 0 [s], a float or an array.
      both_ways: from rest either sign of acceleration is a start (across the lane); else only a positive one.
    """
    halts = v * a < 0.0 or (v == 0.0 and a < 0.0 and not both_ways)
    stop = -v / a if halts else np.inf
    t_moving = smaller(t, stop)
    speed = choose(t_moving < stop, v + a * t_moving, 0.0)
    return p + v * t_moving + 0.5 * a * t_moving**2, speed


@compiled
def follow(ego, plan, t):
    """(x [m], v [m/s], y [m], u [m/s]) of the ego `t` after it began a plan (Def. 12)."""
    x, v = naive(ego.x, ego.v, plan.a, t)
    t_swerve = smaller(t, plan.swerve)
    y, u = ego.y + ego.u * t_swerve + 0.5 * plan.a_lat * t_swerve**2, ego.u + plan.a_lat * t_swerve
    y, u = naive(y, u, -np.sign(u) * np.abs(plan.a_lat), t - t_swerve, True)
    return x, v, y, u


@compiled
def is_within_limits(plan, driver, a_evade_lat, grip):
    """Def. 12.1: does a plan respect what the car can do?

    Args:
      driver: `RSSParams` of the ego: a in [-a_max_brake, a_max_accel].
      a_evade_lat: largest lateral acceleration of an evasion, larger than `a_lat_max_accel` [m/s^2].
      grip: of the tyres on this road, friction times gravity [m/s^2].
    """
    within = -driver.a_max_brake <= plan.a <= driver.a_max_accel and np.abs(plan.a_lat) <= a_evade_lat
    return within and np.hypot(plan.a, plan.a_lat) <= grip


@inner
def _gaps(ego, x, y, other, x_other, y_other):
    """Signed gaps along and across between two boxes [m]; both negative: they overlap."""
    along = np.abs(x_other - x) - ego.half_length - other.half_length
    return along, np.abs(y_other - y) - ego.half_width - other.half_width


@compiled
def smallest_separation(ego, plan, other, horizon, step):
    """Smallest separation from a car that moves as predicted naively (Def. 12.2) [m]; negative: the boxes overlap.

    The separation is the larger of the gaps along and across, at whole multiples of `step` until `horizon` [s].
    """
    smallest = np.inf
    for k in range(int(horizon / step + 1e-9) + 1):
        t = k * step
        x, _, y, _ = follow(ego, plan, t)
        x_other, _ = naive(other.x, other.v, other.a, t)
        y_other, _ = naive(other.y, other.u, other.a_lat, t, True)
        along, across = _gaps(ego, x, y, other, x_other, y_other)
        smallest = smaller(smallest, larger(along, across))
    return smallest


@compiled
def ends_safely(ego, plan, other, driver, other_driver, horizon):
    """Is the pair out of danger when the plan ends (Def. 12.2): one axis safe (Def. 9), or the ego at rest?"""
    x, v, y, u = follow(ego, plan, horizon)
    x_other, v_other = naive(other.x, other.v, other.a, horizon)
    y_other, u_other = naive(other.y, other.u, other.a_lat, horizon, True)
    along, across = _gaps(ego, x, y, other, x_other, y_other)
    if v <= 0.0 and u == 0.0 and larger(along, across) > 0.0:
        return True
    if x <= x_other:
        needed = d_min_longitudinal(
            v, v_other, False, driver, other_driver, driver.a_min_brake, other_driver.a_min_brake
        )
    else:
        needed = d_min_longitudinal(
            v_other, v, False, other_driver, driver, other_driver.a_min_brake, driver.a_min_brake
        )
    side = 1.0 if y_other >= y else -1.0
    beside = across >= d_min_no_credit(side * u, -side * u_other, driver, other_driver)
    return is_safe_longitudinally(along, needed) or beside


@compiled
def keeps_clear(ego, plan, third, driver, third_driver, horizon, step):
    """Def. 12.3: does a plan keep the proper response toward somebody else, whatever that does within its own?

    At every time on the plan one axis is kept. Along: the ego is behind the third, which brakes hardest from the start
    on, and could still stop behind it; or it is ahead, and the third, however far its response lets it get, could stop
    behind an ego that brakes hardest then. Both compare gaps now and at rest, which suffices as long as nobody's
    `a_min_brake` is above the other's `a_max_brake` (hole H1). Across: the ego, stopping its lateral motion, stays
    clear of where the third may come.

    Args:
      ego, third: `Motion` of both; speeds along the lane >= 0.
      driver, third_driver: `RSSParams` of both.
    """
    rho, a, b, v_cap = driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.v_cap
    its_rho, its_a, its_b = third_driver.response_time, third_driver.a_max_accel, third_driver.a_min_brake
    half = ego.half_length + third.half_length
    hardest = third.x + stopping_distance(third.v, third_driver.a_max_brake)
    farthest = third.x + reach(third.v, its_rho, its_a, its_b, third_driver.v_cap)
    for k in range(int(horizon / step + 1e-9) + 1):
        t = k * step
        x, v, y, u = follow(ego, plan, t)
        gap_behind = third.x + travel(t, third.v, 0.0, 0.0, third_driver.a_max_brake) - x - half
        gap_behind = smaller(gap_behind, hardest - x - reach(v, rho, a, b, v_cap) - half - driver.standstill_gap)
        gap_ahead = x - third.x - travel(t, third.v, its_rho, its_a, its_b, third_driver.v_cap) - half
        stop = stopping_distance(v, driver.a_max_brake)
        gap_ahead = smaller(gap_ahead, x + stop - farthest - half - third_driver.standstill_gap)
        side = 1.0 if third.y >= y else -1.0
        across = side * (third.y - y) - ego.half_width - third.half_width
        if larger(gap_behind, gap_ahead) < 0.0 and across < d_min_no_credit(
            side * u, -side * third.u, driver, third_driver
        ):
            return False
    return True


@compiled
def evades(ego, plan, offender, driver, offender_driver, a_evade_lat, grip, horizon, step):
    """Def. 12.1 and 12.2: is a plan an evasive manoeuvre against an offender? 12.3 is asked of each third party."""
    return (
        is_within_limits(plan, driver, a_evade_lat, grip)
        and smallest_separation(ego, plan, offender, horizon, step) >= 0.0
        and ends_safely(ego, plan, offender, driver, offender_driver, horizon)
    )


def plan_family(driver, a_evade_lat, swerves=(0.0, 1.0, 1.5)):
    """The finite family of manoeuvres that "there is a way out" refers to (E2): `[M]` plans.

    Brakes at a_min_brake, a_max_brake or halfway, and goes straight on or swerves to either side.

    Args:
      driver: `RSSParams` of the ego.
      a_evade_lat: lateral acceleration of a swerve [m/s^2].
      swerves: how long it swerves to one side [s]; 0 = straight on.
    """
    brakings = (driver.a_min_brake, 0.5 * (driver.a_min_brake + driver.a_max_brake), driver.a_max_brake)
    return [
        Plan(-b, side * a_evade_lat if swerve > 0.0 else 0.0, swerve)
        for b in brakings
        for swerve in swerves
        for side in ((-1.0, 1.0) if swerve > 0.0 else (0.0,))
    ]


@compiled
def must_evade(dangerous, offender_complies, basic_response_collides, way_out):
    """Def. 13: does the ego owe an evasive manoeuvre on top of its basic proper response?

    Args:
      dangerous: is the situation dangerous (Def. 9)?
      offender_complies: does the other's acceleration keep its own row of Defs. 4 and 8?
      basic_response_collides: do the basic response and the naive prediction end in a collision?
      way_out: is there an evasive manoeuvre (Def. 12) in the family?
    """
    return dangerous and way_out and (basic_response_collides or not offender_complies)
