"""Anticipation for plans: of the accelerations that leave one, the smoothest (`Rules.anticipation`).

A plan brakes at `a_min_brake`, so an ego that is only held to having one throttles until nothing is left but to brake
as hard. Before that, its acceleration is capped so that it comes to rest comfortably before its line, as long as no
plan to go on is found, and behind whoever drives ahead; and it changes slowly. Nothing in the proof of plans moves:
what is chosen leaves a plan, and where nothing smooth does, the ego does what it would have done without.
"""

from typing import NamedTuple

import numpy as np

from shield.compiled import compiled, inner
from shield.conflict_areas import CELL, cell_of
from shield.plans import BETWEEN, SLACK, behind_by

BRAKE = 3.0  # deceleration of a comfortable stop [m/s^2]
SETTLE = 0.1  # at speed v it is over this much times v later, so that its end is soft [s]
JERK = 15.0  # by so much the acceleration changes at most [m/s^3] ...
PULL_AWAY = 90.0  # ... but grows by so much where only a plan to go on is left, which is a matter of time [m/s^3]
EAGER = 4.0  # margins shrink at this many times the rate of anticipation: nobody but the ego changes them much
ROOM = 0.1  # between where the ego comes to rest and where it may not [m]


class Caps(NamedTuple):
    """Largest accelerations that leave room for a comfortable stop [m/s^2]; inf = none is needed."""

    behind: float  # whoever drives ahead
    line: float  # before a place where the ego may not rest, unless it has a plan to go on
    place: float  # arc length of that place, -inf = none [m]


@compiled
def caps(scene, memory, at_line, rate):
    """`Caps` of the ego on one frame.

    Args:
      scene: `Scene`.
      memory: `[N]` CROSSING of the frame before.
      at_line: the ego may rest only where it is in nobody's way, whoever may come.
      rate: of anticipation, see `Rules` [1/s].
    """
    kappa = EAGER * rate
    return Caps(_behind_others(scene, memory, kappa), *_before_line(scene, at_line, kappa))


@compiled
def approach_cap(room, room_next, v, brake, settle, rate, dt):
    """Largest acceleration that keeps a share of the margin before braking has to begin [m/s^2].

    With the way to rest R(v) = v^2 / (2 b) + T v and the margin h = room - R(v), it leads to the largest speed v' with

        room' - R(v') >= (1 - kappa dt) h

    Args:
      room, room_next: how far the ego may go, now and on the next sample [m].
      v: its speed, >= 0 [m/s].
      brake, settle: b [m/s^2] and T [s].
      rate: kappa [1/s].
      dt: length of a frame [s].

    Returns:
      Not less than -`brake`, or than the constant deceleration that comes to rest within `room`.
    """
    margin = room - _way_to_rest(v, brake, settle)
    way = max(room_next - max(1.0 - rate * dt, 0.0) * margin, 0.0)
    fastest = np.sqrt((brake * settle) ** 2 + 2.0 * brake * way) - brake * settle
    hardest = max(brake, v**2 / (2.0 * room)) if room > 0.0 else np.inf
    return max((fastest - v) / dt, -hardest)


@inner
def _way_to_rest(v, brake, settle):
    """R(v) of `approach_cap` [m]."""
    return v**2 / (2.0 * brake) + settle * v


@inner
def _before_line(scene, at_line, rate):
    """Cap before the first place where the ego may not rest, or an obstacle, and that place; none in the junction."""
    paths, track = scene.paths, scene.track
    cells = paths.cells[track.path]
    here, end = cell_of(track.s, cells), cells
    if at_line:
        end = here
        while end < cells and not paths.crossed[track.path, end]:
            end += 1
        end = end if end > here else cells
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path < 0 and here < threat.from_cell:
            end = min(end, threat.from_cell)
    if end == cells:
        return np.inf, -np.inf
    room = end * CELL - SLACK - scene.drift - ROOM - track.s
    cap = approach_cap(room, room - track.v * scene.dt, track.v, BRAKE, SETTLE, rate, scene.dt)
    return cap, end * CELL


@inner
def _behind_others(scene, memory, rate):
    """Cap behind those who drive ahead on the ego's way, if they go on as on the last frame.

    Both come to rest comfortably, or the other brakes at `a_max_brake` and the ego at `a_min_brake`.
    """
    track, dt, cap = scene.track, scene.dt, np.inf
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path < 0 or threat.ignored or threat.left_out:
            continue
        ahead = -behind_by(scene.paths, track, threat)
        if not 0.0 < ahead < np.inf:
            continue
        known = memory[threat.user]
        v = max(threat.v, 0.0)
        change = v - max(known.speed, 0.0) if known.age > 0 else 0.0
        v_next = max(v + min(max(change, -scene.other.a_max_brake * dt), 0.0), 0.0)
        gap = ahead - track.half_length - threat.half_length - BETWEEN
        gap_next = gap + (v - track.v) * dt
        for brake, brake_other, settle in (
            (BRAKE, BRAKE, SETTLE),
            (scene.ego.a_min_brake, scene.other.a_max_brake, 0.0),
        ):
            room = gap + _way_to_rest(v, brake_other, settle)
            room_next = gap_next + _way_to_rest(v_next, brake_other, settle)
            cap = min(cap, approach_cap(room, room_next, track.v, brake, settle, rate, dt))
    return cap
