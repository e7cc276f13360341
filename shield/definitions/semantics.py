"""Semantic actions: what to do, in words that people use for it; a trajectory follows (Section 5 of the paper).

An action says to which lane, ahead of or behind whom, how fast, and how hard to push for it. Each is turned into one
trajectory under a nominal model of the world (others keep their speeds), its value is the mean reward on the way, the
best is begun, and all are planned anew at the next decision. RSS filters what was chosen; it is no part of the reward.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, larger, smaller

NONE, BEHIND, AHEAD = 0, 1, 2  # of whom: nobody, give way, take way
ACTION_FIELDS = 5
LANE, RELATION, NEIGHBOUR, SPEED, PUSH = range(ACTION_FIELDS)
ROLLOUT_FIELDS = 5
S, V, Y, U, A = range(ROLLOUT_FIELDS)

_SETTLING = 1.0  # in which a gap is closed          [s]
_FOLLOWING = 0.5  # in which a speed is taken up     [s]
_ROOM = 0.5  # left before a place with a speed      [m]


class Limits(NamedTuple):
    """Aggressiveness: how hard a trajectory may push for its goals."""

    a_accel: float  # [m/s^2]
    a_brake: float  # [m/s^2]
    a_lat: float  # either way [m/s^2]
    jerk: float  # [m/s^3]


# our choice, from what passengers hardly notice to what tyres easily do
LIMITS = {"calm": Limits(1.0, 2.0, 0.5, 1.0), "brisk": Limits(2.0, 4.0, 1.0, 4.0), "hard": Limits(3.0, 6.0, 2.0, 20.0)}


def number_of_actions(lanes: int, neighbours: int, speeds: int, pushes: int) -> int:
    """Size of the action space: linear in the neighbours that are seen."""
    return lanes * (1 + 2 * neighbours) * speeds * pushes


def semantic_actions(lanes: int, neighbours: int, speeds: tuple[float, ...], pushes: int) -> np.ndarray:
    """All semantic actions, `[A, 5]`: lane, relation, neighbour (-1: none), share of the legal speed, push.

    Args:
      lanes, pushes: how many there are to choose from.
      neighbours: how many are seen.
      speeds: shares of the legal speed.
    """
    relations = [(NONE, -1), *((side, j) for j in range(neighbours) for side in (BEHIND, AHEAD))]
    return np.array(
        [
            (lane, relation, j, speed, push)
            for lane in range(lanes)
            for relation, j in relations
            for speed in speeds
            for push in range(pushes)
        ],
        dtype=float,
    )


class Goals(NamedTuple):
    """What one semantic action wants, in lane coordinates."""

    y: float  # lateral goal: where in the road to be             [m]
    v_wanted: float  # speed goal                                 [m/s]
    relation: int  # to whom: NONE, BEHIND or AHEAD
    s_other: float  # centre of that car                          [m]
    v_other: float  # which it keeps                              [m/s]
    gap: float  # between both centres when they stand            [m]
    headway: float  # on top of that, at the speed of who follows [s]
    s_place: float  # a place with a speed of its own; inf: none  [m]
    v_place: float  # 0 at a stop line                            [m/s]


@inner
def _wanted_speed(s, v, t, goals, limits):
    """Speed that leads to the longitudinal goals [m/s]."""
    wanted = goals.v_wanted
    if goals.relation != NONE:
        s_other = goals.s_other + goals.v_other * t
        if goals.relation == BEHIND:
            wanted = smaller(wanted, goals.v_other + (s_other - goals.gap - goals.headway * v - s) / _SETTLING)
        else:
            ahead = s_other + goals.gap + goals.headway * goals.v_other
            wanted = smaller(wanted, goals.v_other + (ahead - s) / _SETTLING)
    if goals.s_place >= s:
        wanted = smaller(wanted, np.sqrt(goals.v_place**2 + limits.a_brake * larger(goals.s_place - s - _ROOM, 0.0)))
    return larger(wanted, 0.0)


@inner
def _braking_before(s, v, goals, limits):
    """Largest acceleration that still leads to the speed of a place ahead by even braking [m/s^2].

    It counts from where a good part of the braking is needed.
    """
    if s > goals.s_place or v <= goals.v_place:
        return np.inf
    needed = (v**2 - goals.v_place**2) / (2 * larger(goals.s_place - s - _ROOM, 0.1 * _ROOM))
    return -needed if needed > 0.4 * limits.a_brake else np.inf


@compiled
def rollout(s, v, y, u, a, goals, limits, dt, out):
    """The trajectory of a semantic action under the nominal model: fills `out`.

    Args:
      s, v: position [m] and speed [m/s] along the road.
      y, u: across it, to the right.
      a: longitudinal acceleration just applied [m/s^2].
      goals, limits: `Goals`, `Limits`.
      dt: length of a step [s].
      out: `[T, 5]` s, v, y, u, a after each step.
    """
    for k in range(len(out)):
        wanted = (_wanted_speed(s, v, k * dt, goals, limits) - v) / _FOLLOWING
        wanted = smaller(wanted, _braking_before(s, v, goals, limits))
        wanted = smaller(larger(wanted, -limits.a_brake), limits.a_accel)
        a = smaller(larger(wanted, a - limits.jerk * dt), a + limits.jerk * dt)
        a = larger(a, -v / dt)  # nobody backs up
        s, v = s + v * dt + 0.5 * a * dt**2, v + a * dt
        # as fast as one can stop from at the lateral goal, or get there with one last step
        away, step = np.abs(goals.y - y), limits.a_lat * dt
        fastest = larger(np.sqrt(2 * limits.a_lat * away) - 0.5 * step, smaller(away / dt, step))
        u = smaller(larger(np.sign(goals.y - y) * fastest, u - step), u + step)
        y += u * dt
        out[k, S], out[k, V], out[k, Y], out[k, U], out[k, A] = s, v, y, u, a


@compiled
def value(rewards):
    """Value of a trajectory: the mean of its rewards `[T]`."""
    total = 0.0
    for k in range(len(rewards)):
        total += rewards[k]
    return total / len(rewards)
