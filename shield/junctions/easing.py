"""Anticipation for plans: the ego eases off before it has to brake (`Rules.anticipation`).

A plan brakes at `a_min_brake`, so an ego that is only held to having one would throttle until nothing is left but to
brake as hard. Before that its acceleration is capped, so that the margin to the last moment of braking shrinks
smoothly: before the place where it may not rest, as long as it has no plan to go on past it, and behind whoever drives
ahead. Nothing in the proof of plans moves: what is carried out has been checked to leave a plan, and where nothing
smooth does, the ego does what it would have done without.

Progress is not given up for it: a plan to go on is taken as soon as there is one, and the most that leaves a plan to
stop leads as far as full throttle and full braking in turn would.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.junctions.conflict_areas import CELL, cell_of

SETTLE = 0.08  # at speed v it is over this much times v later, so that its end is soft [s]
EAGER = 5.0  # margins shrink at this many times the rate of anticipation: nobody but the ego changes them much
RISE = 60.0  # by so much the acceleration grows at most after the ego was held back [m/s^3]
SEARCH = 5  # halvings of what is open
ROOM = 0.05  # between where the ego comes to rest and where it may not [m]
BETWEEN = 1.0  # and the bumper of who drives ahead: about as near as plans let it come [m]


class Caps(NamedTuple):
    """Largest accelerations from which the ego can ease off [m/s^2]; inf = any."""

    behind: float  # whoever drives ahead
    line: float  # before a place where the ego may not rest, unless it has a plan to go on past it
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
    line, place = _before_line(scene, at_line, kappa)
    return Caps(_behind_others(scene, memory, kappa), line, place)


@compiled
def approach_cap(room, room_next, v, brake, rate, dt):
    """Largest acceleration that keeps a share of the margin before braking has to begin [m/s^2].

    With the way to rest R(v) = v^2 / (2 b) + T v and the margin h = room - R(v), it leads to the largest speed v' with

        room' - R(v') >= (1 - kappa dt) h

    Args:
      room, room_next: how far the ego may go, now and on the next sample [m].
      v: its speed, >= 0 [m/s].
      brake: b [m/s^2].
      rate: kappa [1/s].
      dt: length of a frame [s].

    Returns:
      Not less than -`brake`: that suffices, or there is no plan to stop.
    """
    margin = room - v**2 / (2.0 * brake) - SETTLE * v
    way = max(room_next - max(1.0 - rate * dt, 0.0) * margin, 0.0)
    fastest = np.sqrt((brake * SETTLE) ** 2 + 2.0 * brake * way) - brake * SETTLE
    return max((fastest - v) / dt, -brake)


@inner
def _before_line(scene, at_line, rate):
    """Cap before the first place where the ego may not rest, or an obstacle, and that place; none in the junction."""
    paths, track, dt = scene.paths, scene.track, scene.table.dt
    cells = paths.cells[track.path]
    here, end = cell_of(track.s, cells), cells
    if at_line:
        end = min(paths.line[track.path, here], cells)
        end = end if end > here else cells
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path < 0 and threat.arrives == 0.0 and here < threat.from_cell:
            end = min(end, threat.from_cell)
    if end == cells:
        return np.inf, -np.inf
    room = end * CELL - scene.drift - ROOM - track.s
    return approach_cap(room, room - track.v * dt, track.v, scene.table.ego.a_min_brake, rate, dt), end * CELL


@inner
def _behind_others(scene, memory, rate):
    """Cap behind those who drive ahead on the ego's way, if they go on as on the last frame.

    The other may brake at `a_max_brake`, the ego brakes at `a_min_brake`.
    """
    track, dt, cap = scene.track, scene.table.dt, np.inf
    brake, brake_other = scene.table.ego.a_min_brake, scene.table.other.a_max_brake
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path < 0 or threat.ignored or threat.left_out:
            continue
        ahead = -threat.behind
        if not 0.0 < ahead < np.inf:
            continue
        known = memory[threat.user]
        v = max(threat.v, 0.0)
        change = v - max(known.speed, 0.0) if known.age > 0 else 0.0
        v_next = max(v + min(max(change, -brake_other * dt), 0.0), 0.0)
        gap = ahead - track.half_length - threat.half_length - BETWEEN
        room = gap + v**2 / (2.0 * brake_other)
        room_next = gap + (v - track.v) * dt + v_next**2 / (2.0 * brake_other)
        cap = min(cap, approach_cap(room, room_next, track.v, brake, rate, dt))
    return cap
