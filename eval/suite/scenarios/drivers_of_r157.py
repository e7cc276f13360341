"""Drivers that UN Regulation No. 157 measures automated lane keeping by, and the fuzzy safety model, as functions.

All only brake. Arrays are over cases, `[C]`; lengths [m], speeds [m/s], decelerations positive [m/s^2].

* The *careful and competent driver* (UN R157, Annex 4, Appendix 3; ECE/TRANS/WP.29/2020/81): perceives a car that
  leaves its lane once that is 0.375 m off the middle and the time to collision is below 2 s, and one that brakes or
  stands ahead at once; needs 0.4 s to see the risk and 0.75 s more to brake, then brakes up to 0.774 g within 0.6 s.
* The *fuzzy safety model* (Mattas et al., Accident Analysis & Prevention 148, 2020, 105794; as in the amendment of
  the regulation: Mattas et al., same journal, 174, 2022, 106743): brakes gently for a proactive and hard for a critical
  metric, each between 0 and 1, 0.75 s late.
"""

from typing import NamedTuple

import numpy as np

GRAVITY = 9.81
DELAY = 0.75  # from having perceived a risk until braking begins [s]
FULL = 0.774 * GRAVITY  # braking at the most [m/s^2]
ONSET = FULL / 0.6  # how fast it builds up [m/s^3]
RELEASED = 0.4  # a car slows down by itself in the meantime [m/s^2]
_OFF_CENTRE = 0.375  # of a car that is seen to leave its lane [m]
_EVALUATION = 0.4  # [s]
_CRITICAL_TTC = 2.0  # [s]

_RHO = 0.75  # of the fuzzy model [s]
_GENTLE, _HARD, _LEADER = 4.0, 6.0, 7.0  # braking of the ego at the least and the most, and of its leader [m/s^2]
_ALWAYS, _SPARE = 2.0, 2.0  # distances that it keeps besides [m]


class View(NamedTuple):
    """What a driver sees, `[C]`."""

    gap: np.ndarray  # bumper to bumper
    v: np.ndarray  # its own speed
    a: np.ndarray  # its own acceleration over the frame before [m/s^2]
    v_other: np.ndarray
    aside: np.ndarray  # gap across the lane, negative: they overlap
    toward: np.ndarray  # lateral speed of the other toward it
    in_lane: np.ndarray  # it has been in the ego's lane from the start
    perceived: np.ndarray  # for how long that is seen, or that it is off the middle of its own by more than 0.375 m [s]


def careful_sees_risk(view: View) -> np.ndarray:
    """Does the careful driver perceive a risk?"""
    closing = view.v - view.v_other
    ttc = np.where(closing > 0.0, view.gap / np.maximum(closing, 1e-9), np.inf)
    return (view.perceived >= _EVALUATION) & (view.in_lane | (ttc <= _CRITICAL_TTC))


def is_off_centre(moved: np.ndarray) -> np.ndarray:
    """Is a car seen to leave its lane?"""
    return moved > _OFF_CENTRE


def fuzzy_deceleration(view: View) -> np.ndarray:
    """What the fuzzy model brakes with, once its delay is over; 0 = no risk."""
    cfs, pfs = critical_metric(view.gap, view.v, view.v_other, view.a), proactive_metric(view.gap, view.v, view.v_other)
    wanted = np.where(cfs > 0.0, _GENTLE + cfs * (_HARD - _GENTLE), pfs * _GENTLE)
    return np.where(_comes_in_front(view), wanted, 0.0)


def _comes_in_front(view: View) -> np.ndarray:
    """Will the other be in the way before the ego has passed it?"""
    closing = np.maximum(view.v - view.v_other, 1e-9)
    passed = (view.gap + 2.0 * 4.3) / closing  # whole cars
    arrives = np.where(view.toward > 0.0, view.aside / np.maximum(view.toward, 1e-9), np.inf)
    return (view.aside <= 0.0) | (arrives <= passed + 0.1)


def proactive_metric(gap, v, v_other):
    """PFS: from 0 behind a leader that may brake at any time with 7 m/s^2, braking gently, to 1, braking hard."""
    room = gap - _ALWAYS
    leader = v_other**2 / (2.0 * _LEADER)
    safe = v * _RHO + v**2 / (2.0 * _GENTLE) - leader + _SPARE
    unsafe = v * _RHO + v**2 / (2.0 * _HARD) - leader
    return np.clip((safe - room) / np.maximum(safe - unsafe, 1e-9), 0.0, 1.0)


def critical_metric(gap, v, v_other, a):
    """CFS: from 0 to 1 behind a leader that keeps its speed."""
    a_kept = np.maximum(a, -_GENTLE)
    later = v + _RHO * a_kept
    meets = (v - v_other) ** 2 / np.maximum(2.0 * np.abs(a), 1e-9)  # slower than the leader before the delay is over
    during = (0.5 * (v + later) - v_other) * _RHO
    safe = during + (later - v_other) ** 2 / (2.0 * _GENTLE)
    unsafe = during + (later - v_other) ** 2 / (2.0 * _HARD)
    fuzzy = np.clip((safe - gap) / np.maximum(safe - unsafe, 1e-9), 0.0, 1.0)
    return np.where(v <= v_other, 0.0, np.where(later < v_other, (gap < meets).astype(float), fuzzy))
