"""Anticipation for plans: of the accelerations that leave one, the smoothest (a rule of the table, `Rules.anticipation`).

A plan is safe whether it brakes gently or at `a_min_brake`, so an ego that is only held to its plans throttles until
none is left but to brake as hard as it may. Before that, its acceleration is capped such that it comes to rest at
`BRAKE` before its line, as long as no plan to go on is found, and behind whoever drives ahead; and it changes by no
more than `JERK`. Nothing in the proof of plans moves: whatever is chosen here leaves a plan, or is not chosen.
"""

import numpy as np

from shield.compiled import compiled, inner
from shield.conflict_areas import CELL, cell_of
from shield.plans import BETWEEN, SLACK, behind_by

BRAKE = 2.5  # deceleration of a comfortable stop [m/s^2]
SETTLE = 0.5  # time constant of its end: at speed v it is over v SETTLE later, at most [s]
JERK = 10.0  # [m/s^3]
ROOM = 0.1  # between the place where the ego rests and where it may not [m]


@compiled
def approach_cap(room, room_next, v, brake, settle, rate, dt):
    """Largest acceleration that keeps a share of what is left before a comfortable stop has to begin [m/s^2].

    With the way to rest R(v) = v^2 / (2 b) + v T and the margin h = room - R(v), the largest next speed v' with

        room' - R(v') >= (1 - kappa dt) h

    Args:
      room, room_next: from the ego to where it has to rest, now and on the next sample [m].
      v: speed of the ego, >= 0 [m/s].
      brake, settle: b [m/s^2] and T [s].
      rate: kappa [1/s].
      dt: length of a frame [s].

    Returns:
      Not less than the constant deceleration that is over after `room`, or -`brake`.
    """
    margin = room - way_to_rest(v, brake, settle)
    d = max(room_next - max(1.0 - rate * dt, 0.0) * margin, 0.0)
    fastest = np.sqrt((brake * settle) ** 2 + 2.0 * brake * d) - brake * settle
    hardest = max(brake, v**2 / (2.0 * room)) if room > 0.0 else np.inf
    return max((fastest - v) / dt, -hardest)


@inner
def way_to_rest(v, brake, settle):
    """R(v) of `approach_cap` [m]."""
    return v**2 / (2.0 * brake) + v * settle


@compiled
def cap_before_line(scene, at_line, rate, tune):
    """Cap of the acceleration before a place where the ego may not rest, or an obstacle; inf = none [m/s^2]."""
    paths, track, threats = scene.paths, scene.track, scene.threats
    cells = paths.cells[track.path]
    here, end = cell_of(track.s, cells), cells
    ahead = way_to_rest(track.v, tune[1], tune[2]) + (track.v + scene.ego.a_max_accel / tune[1] * track.v) / rate
    last = min(cell_of(track.s + ahead + 2.0, cells), cells - 1)
    if at_line and not paths.crossed[track.path, here]:
        for i in range(here, last + 1):
            if paths.crossed[track.path, i]:
                end = i
                break
    for k in range(len(threats)):
        if threats[k].path < 0 and here < threats[k].from_cell < end:
            end = threats[k].from_cell
    if end == cells:
        return np.inf
    room = end * CELL - SLACK - scene.drift - ROOM - track.s
    return approach_cap(room, room - track.v * scene.dt, track.v, tune[1], tune[2], rate, scene.dt)


@compiled
def cap_behind_others(scene, memory, rate, tune):
    """Cap of the acceleration behind those who drive ahead on the ego's way; inf = nobody does [m/s^2].

    Both come to rest at `BRAKE`, or the other brakes as hard as it may and the ego as hard as it has to.
    """
    track, dt, cap = scene.track, scene.dt, np.inf
    v, hard = track.v, scene.ego.a_min_brake
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.path < 0 or threat.ignored or threat.left_out:
            continue
        ahead = -behind_by(scene.paths, track, threat)
        if not 0.0 < ahead < np.inf:
            continue
        v_other = max(threat.v, 0.0)
        slower = min(v_other - max(memory[threat.user].speed, 0.0), 0.0) if memory[threat.user].age > 0 else 0.0
        v_next = max(v_other + max(slower, -scene.other.a_max_brake * dt), 0.0)
        gap = ahead - track.half_length - threat.half_length - BETWEEN
        moved = gap + (v_other - v) * dt
        reach, reach_next = way_to_rest(v_other, tune[1], tune[2]), way_to_rest(v_next, tune[1], tune[2])
        cap = min(cap, approach_cap(gap + reach, moved + reach_next, v, tune[1], tune[2], rate, dt))
        b = scene.other.a_max_brake
        reach, reach_next = way_to_rest(v_other, b, 0.0), way_to_rest(v_next, b, 0.0)
        cap = min(cap, approach_cap(gap + reach, moved + reach_next, v, hard, 0.0, rate, dt))
    return cap
