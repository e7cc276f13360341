"""What a filter other than the shield makes of the ego's command on one frame."""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.command import Command
from rss_shield.shield.filters import control_barrier, fixed_distance, time_to_collision
from rss_shield.shield.filters.leader import leader_of
from rss_shield.shield.filters.once_per_decision import PRINTED, is_dangerous, printed_duties
from rss_shield.shield.lanes.controller import Response
from rss_shield.shield.lanes.memory import Bounds
from rss_shield.shield.lanes.restriction import restrict

RSS, TTC, DISTANCE, CBF, LIMITS, PRINTED_DEF_10 = range(6)
FILTERS = ("rss", "ttc", "distance-45m", "cbf", "limits", "literal-def10")
THRESHOLDS = {TTC: time_to_collision.SECONDS, DISTANCE: fixed_distance.METRES, CBF: control_barrier.HEADWAY}


class Filter(NamedTuple):
    """A filter and how it is set."""

    kind: int  # index into `FILTERS`
    threshold: float = 0.0  # of those in `THRESHOLDS`: [s], [m] or [s]


class Traffic(NamedTuple):
    """What a filter sees on one frame."""

    ego: Any  # `ROAD_USER` record
    users: np.ndarray  # `[N]` `ROAD_USER` of everybody else
    memory: np.ndarray  # `[N]` `MEMORY` of them, this sample included
    offset: float  # of the ego from the middle of the lane it heads for, positive to the right [m]
    who: Any  # `[K]` indices of those who are near, None = everybody


@apart
def answer(chosen, wish, traffic, free, answers, begins, body, table):
    """The command that a filter lets through.

    Args:
      chosen: `Filter`, not `RSS`.
      wish: `Command` of the ego's own controller.
      traffic: `Traffic`.
      free: `Bounds` of the always-on limits.
      answers: does a filter that looks once per decision give its response in this one?
      begins: it is the first frame of a decision.
      body: `Body` of the ego.
      table: as in `shield.lanes.controller.find_danger`.

    Returns:
      `Response`, and `answers` from now on.
    """
    rules, dt = table.rules, table.dt
    ego, users, who, kind = traffic.ego, traffic.users, traffic.who, chosen.kind
    if kind == LIMITS:
        command = restrict(wish, free, ego, body, rules, dt)
        return Response(command, False, False, command != wish), answers
    if kind == PRINTED_DEF_10:
        if begins:
            answers = is_dangerous(ego, users, table, who)
        command = wish
        if answers:
            bounds = Bounds(-np.inf, np.inf, np.inf, np.inf, np.inf, np.inf, min(ego.speed, 0.0))
            bounds = printed_duties(bounds, users, traffic.memory, table, who)
            command = restrict(wish, bounds, ego, body, PRINTED, dt)
        return Response(command, command != wish, False, False), answers
    leader = leader_of(ego, users, traffic.offset, who)
    if kind == TTC:
        cap = time_to_collision.acceleration_cap(ego.speed, leader, chosen.threshold, table.ego)
    elif kind == DISTANCE:
        cap = fixed_distance.acceleration_cap(leader, chosen.threshold, table.ego)
    else:
        cap = control_barrier.acceleration_cap(ego.speed, leader, chosen.threshold, table.ego)
    command = Command(_capped(wish.acceleration, cap, ego.speed, dt), wish.slip)
    return Response(command, command != wish, False, False), answers


@inner
def _capped(wish, cap, v, dt):
    """An acceleration below a cap [m/s^2]; a cap never makes a car reverse."""
    return min(wish, max(cap, -max(v, 0.0) / dt))
