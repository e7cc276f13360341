"""Traffic lights: priority as a function of time (Defs. 17, 18).

A plan is a cycle of phases; in each, some groups of approaches have green, then yellow, then everybody waits (all-red).
Lights only say who has priority, so green entitles nobody to hit a car that is still inside. A light that changes must
not put a driver in the wrong who can do nothing about it (hole H8): a car that could no longer stop when its green
ended keeps its right to pass, and a plan leaves time for it to clear the area.
"""

import math
from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.params import RSSParams

GREEN, YELLOW, RED = 0, 1, 2  # columns of `SignalPlan.durations`, too


class SignalPlan(NamedTuple):
    """A cycle of P phases for G groups of approaches. Arrays in a NamedTuple pass into compiled code."""

    goes: np.ndarray  # [P, G] bool, does the group have green in this phase?
    durations: np.ndarray  # [P, 3] of green, yellow and all-red [s]

    @classmethod
    def validated(cls, goes, durations, speed_limit: float, area_length: float, params: RSSParams) -> "SignalPlan":
        """Build a plan and check it.

        Args:
          goes: `[P, G]` does the group have green in this phase? Groups of one phase must not conflict.
          durations: `[P, 3]` of green, yellow and all-red [s].
          speed_limit: on the approaches [m/s].
          area_length: way through the area, from the stop line until the rear has left it [m].
          params: `RSSParams` of the drivers.

        Raises:
          ValueError: a shape, a duration, the limit or the length is out of range, a group never has green, or yellow
            and all-red are too short to clear the area (`clearance_time`); the message names field, value and range.
        """
        goes, durations = np.array(goes, dtype=bool), np.array(durations, dtype=float)
        if goes.ndim != 2 or goes.size == 0:
            raise ValueError(f"goes has shape {goes.shape}; expected [phases, groups], at least one of each")
        if durations.shape != (len(goes), 3):
            raise ValueError(f"durations has shape {durations.shape}; expected ({len(goes)}, 3)")
        for group, has_green in enumerate(goes.any(axis=0)):
            if not has_green:
                raise ValueError(f"goes[:, {group}] is never true; expected green in at least one phase")
        needed = clearance_time(speed_limit, area_length, params)
        for phase, (green, yellow, all_red) in enumerate(durations.tolist()):
            _check_range(f"green of phase {phase}", green, 0.0, strict=True)
            _check_range(f"yellow of phase {phase}", yellow, 0.0)
            _check_range(f"all-red of phase {phase}", all_red, 0.0)
            if yellow + all_red < needed:
                raise ValueError(
                    f"yellow + all-red of phase {phase} = {yellow + all_red:g} s is out of range: expected at least "
                    f"{needed:g} s to clear {area_length:g} m at {speed_limit:g} m/s"
                )
        return cls(goes, durations)


def _check_range(name: str, value: float, low: float, strict: bool = False) -> None:
    if not math.isfinite(value) or value < low or (strict and value == low):
        accepted = f"> {low:g}" if strict else f">= {low:g}"
        raise ValueError(f"{name} = {value!r} is out of range: expected a finite number {accepted}")


def clearance_time(speed_limit: float, area_length: float, params: RSSParams) -> float:
    """Yellow and all-red that a car at the limit needs to clear the area, if it just failed to stop (hole H8) [s].

    Raises:
      ValueError: the speed limit or the length is out of range.
    """
    _check_range("speed_limit", speed_limit, 0.0, strict=True)
    _check_range("area_length", area_length, 0.0)
    return (_distance_to_stop(speed_limit, params) + area_length) / speed_limit


@compiled
def _distance_to_stop(v, params):
    """Distance in which a driver who holds the speed for the response time comes to rest [m]."""
    return reach(v, params.response_time, 0.0, params.a_min_brake, np.inf)


@compiled
def cycle_time(plan):
    """Duration of one cycle [s]."""
    total = 0.0
    for phase in range(len(plan.durations)):
        for part in range(3):
            total += plan.durations[phase, part]
    return total


@compiled
def signal_at(plan, group, time):
    """GREEN, YELLOW or RED for a group of approaches at a time; the first phase starts at 0 [s]."""
    left = time % cycle_time(plan)
    for phase in range(len(plan.durations)):
        for part in range(3):
            if left < plan.durations[phase, part]:
                return part if plan.goes[phase, group] else RED
            left -= plan.durations[phase, part]
    return RED  # rounding at the end of the cycle


@compiled
def time_to_change(plan, group, time):
    """Until a group of approaches sees another signal [s]; inf if it never does."""
    signal = signal_at(plan, group, time)
    times = (_time_to(plan, group, time, GREEN), _time_to(plan, group, time, YELLOW), _time_to(plan, group, time, RED))
    return min(times[(signal + 1) % 3], times[(signal + 2) % 3])


@compiled
def time_to_green(plan, group, time):
    """Until a group of approaches has green [s]; 0 if it has."""
    return 0.0 if signal_at(plan, group, time) == GREEN else _time_to(plan, group, time, GREEN)


@inner
def _time_to(plan, group, time, signal):
    """Until a part of the cycle begins in which a group sees a signal [s]; inf if there is none."""
    start, now = 0.0, time % cycle_time(plan)
    for _ in range(2):
        for phase in range(len(plan.durations)):
            for part in range(3):
                shown = part if plan.goes[phase, group] else RED
                if shown == signal and start > now and plan.durations[phase, part] > 0.0:
                    return start - now
                start += plan.durations[phase, part]
    return np.inf


@compiled
def priority_at(plan, group, time):
    """Rank of an approach for `right_of_way.Approach`: 1 on green, else 0."""
    return 1.0 if signal_at(plan, group, time) == GREEN else 0.0


@compiled
def may_pass(signal, distance_to_line, v, params):
    """May a car pass the stop line? On green, or if it can no longer stop before the line.

    For the moment at which a light changes; from then on `keep_right` remembers the answer.

    Args:
      signal: GREEN, YELLOW or RED.
      distance_to_line: from the front of the car [m].
      v: speed, >= 0 [m/s].
      params: `RSSParams` of the driver.
    """
    return signal == GREEN or _distance_to_stop(v, params) > distance_to_line


@compiled
def keep_right(had_right, signal, distance_to_line, v, params):
    """Right to pass, one sample on: kept after green by those who could not stop any more, and lost for good by others.

    Whoever was able to stop when the light changed cannot regain the right by driving on. A car that keeps its right
    ranks with green; between it and a newcomer on green nobody has priority.

    Args:
      had_right: at the previous sample; at first sight `signal == GREEN`.
      signal, distance_to_line, v, params: as `may_pass`.
    """
    return signal == GREEN or (had_right and may_pass(signal, distance_to_line, v, params))
