"""Which road users the ego's plans are checked against at a junction, and how many that spares.

all                everybody
table              whose ways meet the rest of the ego's path at all, which is looked up: nothing is lost
geofence           who is within `RADIUS` of the junction
walk               of the table's, on each approach from the junction backwards: up to the first that
                   arrives more than `TAU` after the ego, both at unchanged motion
first-conflicting  likewise, up to the first one
first              the first car of each approach, if it is one of the table's

The last four may lose somebody whom a plan meets, and then the ego is to blame: they are for comparison.
Obstacles and red lights are always examined, and whoever is on the ego's own way unless the table says
that they do not meet. The judge looks at everybody.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.junctions.conflict_areas import CELL, X, Y, cell_of

ALL, TABLE, GEOFENCE, WALK, FIRST_CONFLICTING, FIRST = range(6)
EXAMINED = ("all", "table", "geofence", "walk", "first-conflicting", "first")
RADIUS = 60.0  # of the geofence [m]
TAU = 1.5  # arrivals closer than this are simultaneous [s]


@compiled
def examine(scene, samples, which, slack):
    """Mark the ways of others that plans are not checked against.

    Args:
      scene: `Scene`, `left_out` and `stops_here` of its threats are overwritten.
      samples: `[N]` SAMPLE of all road users.
      which: index into `EXAMINED`.
      slack: how far behind its place the ego may be [m].
    """
    paths, track, threats = scene.paths, scene.track, scene.threats
    for k in range(len(threats)):
        threats[k].left_out = threats[k].stops_here = False
    if which == ALL:
        return
    x, y = _centre(paths, track) if which == GEOFENCE else (0.0, 0.0)
    for k in range(len(threats)):
        threat = threats[k]
        if threat.path < 0:
            continue
        if which == GEOFENCE:
            far = np.hypot(samples[threat.user].x - x, samples[threat.user].y - y) >= RADIUS
            threat.left_out = far and not _is_on_way(paths, track, threat)
            continue
        threat.left_out = not _meets_path(paths, track, threat, slack)
        if which != TABLE and not _is_on_way(paths, track, threat):
            to_ego, to_other = _to_meeting(paths, track, threat)
            threat.left_out |= to_other == np.inf
            if which == FIRST:
                threat.stops_here = _is_before_exit(paths, threat)
            elif not threat.left_out:
                late = _arrival(to_other, threat.v) > _arrival(to_ego, track.v) + TAU
                threat.stops_here = late or which == FIRST_CONFLICTING
    if which >= WALK:
        _thin_out(paths, track, threats)


@inner
def _thin_out(paths, track, threats):
    """Leave out whoever is on the approach of one at whom the filter stops, and behind it."""
    for k in range(len(threats)):
        threat = threats[k]
        if threat.path < 0 or threat.left_out or _is_on_way(paths, track, threat):
            continue
        for m in range(len(threats)):
            other = threats[m]
            if not other.stops_here or other.user == threat.user or other.s <= threat.s:
                continue
            if paths.lane[other.path, 0] == paths.lane[threat.path, 0]:
                threat.left_out = True


@inner
def _meets_path(paths, track, threat, slack):
    """Is any of the ego's path ahead, or of the lane that it is leaving, in the way of a road user's?"""
    here = cell_of(track.s - slack, paths.cells[track.path])
    meets = paths.first[track.path, threat.path, here] < np.inf
    if track.beside >= 0:
        here = cell_of(track.s + track.shift - slack, paths.cells[track.beside])
        meets |= paths.first[track.beside, threat.path, here] < np.inf
    return meets


@inner
def _is_on_way(paths, track, threat):
    """Is a road user on a lane of the ego's path?"""
    lane = paths.lane[threat.path, cell_of(threat.s, paths.cells[threat.path])]
    return not np.isnan(paths.offset[track.path, lane])


@inner
def _to_meeting(paths, track, threat):
    """How far the ego and a road user are from where they first meet [m]; inf if one has passed it already."""
    for i in range(cell_of(track.s, paths.cells[track.path]), paths.cells[track.path]):
        interval = paths.conflicts[track.path, threat.path, i]
        to_ego = max(i * CELL - track.s, 0.0)
        if threat.s <= interval[1]:
            return to_ego, max(interval[0] - threat.s, 0.0)
        if threat.s <= interval[3]:
            return to_ego, max(interval[2] - threat.s, 0.0)
    return np.inf, np.inf


@inner
def _arrival(distance, speed):
    """Time to a place ahead at unchanged motion [s]."""
    if distance <= 0.0:
        return 0.0
    return distance / speed if speed > 0.0 else np.inf


@inner
def _is_before_exit(paths, threat):
    """Is a road user before the junction, or in it?"""
    for i in range(cell_of(threat.s, paths.cells[threat.path]), paths.cells[threat.path]):
        if paths.crossed[threat.path, i]:
            return True
    return False


@inner
def _centre(paths, track):
    """Middle between the ends of the stretch of the ego's path on which it is in the way of others."""
    first, last = -1, -1
    for i in range(paths.cells[track.path]):
        if paths.crossed[track.path, i]:
            first, last = (i if first < 0 else first), i
    if first < 0:
        first = last = cell_of(track.s, paths.cells[track.path])
    a, b = paths.boxes[track.path, first], paths.boxes[track.path, last]
    return 0.5 * (a[X] + b[X]), 0.5 * (a[Y] + b[Y])


@compiled
def is_left_out(scene, i):
    """Does a road user have a way that plans are not checked against?"""
    found = False
    for k in range(len(scene.threats)):
        found |= scene.threats[k].user == i and scene.threats[k].left_out
    return found


@compiled
def count_examined(scene):
    """Road users with a way that plans are checked against; the ways of each stand together.

    A light is none (`user` = -1).
    """
    count, last = 0, -1
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.user >= 0 and threat.user != last and not (threat.ignored or threat.left_out):
            count, last = count + 1, threat.user
    return count
