"""Where on the ego's way pedestrians may be, and from when on: what plans stay clear of.

Off the crossings a pedestrian owns what it may reach (`definitions.pedestrians`). It gives way to a car that is there
before it and walks around one that stands, so the front of a moving car must not come to where it may be by then. On a
crossing it has the right of way: a car stays out of the whole crossing unless it has left before the pedestrian comes.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import time_to_cover_accelerating
from rss_shield.shield.junctions.conflict_areas import CELL, COS, HALF_WIDTH, SIN, X, Y, cell_of
from rss_shield.shield.junctions.plans import NEVER

_MARGIN = 0.1  # before and behind places along the way [m]

# One pedestrian, or somebody who may be hidden, in the world.
PERSON = np.dtype(
    [
        ("user", "i8"),  # index of the road user, -1 = who may be hidden; the latter come first
        ("x", "f8"),  # [m]
        ("y", "f8"),
        ("heading", "f8"),  # in which it walks [rad]
        ("v", "f8"),  # >= 0 [m/s]
        ("radius", "f8"),  # of its body [m]
        ("v_high", "f8"),  # largest speed that is reasonable where it is [m/s]
        ("route_from", "f8"),  # the crossing along the ego's path [m]; nan = it is on none
        ("route_to", "f8"),
    ],
    align=True,
)


@compiled
def place_on_path(paths, path, x, y, heading):
    """Where somebody is as seen from a path: arc length, offset to the right [m], heading to it [rad], half its width.

    Args:
      paths: `Paths`; path: index.
      x, y, heading: in the world [m], [rad].
    """
    best, nearest = 0, np.inf
    for i in range(paths.cells[path]):
        box = paths.boxes[path, i]
        distance = (x - box[X]) ** 2 + (y - box[Y]) ** 2
        if distance < nearest:
            best, nearest = i, distance
    box = paths.boxes[path, best]
    dx, dy = x - box[X], y - box[Y]
    along, across = dx * box[COS] + dy * box[SIN], dy * box[COS] - dx * box[SIN]
    turned = np.arctan2(
        np.sin(heading) * box[COS] - np.cos(heading) * box[SIN], np.cos(heading) * box[COS] + np.sin(heading) * box[SIN]
    )
    return (best + 0.5) * CELL + along, across, turned, box[HALF_WIDTH]


@compiled
def sampled_room(v, walk, dt):
    """What frames of length `dt` add to a pedestrian's reach [m]: half a frame at its top speed, and its last step."""
    return 0.5 * (v + walk.a_max_accel * walk.response_time) * dt + walk.a_min_brake * dt**2 / 8


@compiled
def note_reach(arrivals, s, y, heading, v, half_width, radius, walk, dt):
    """Lower the times from which on a pedestrian may be on a way, by its reach.

    Up to `t` it comes v t ahead, give or take a t^2 / 2; after its response time it goes on along its way, braking or
    not, until it stands: together these discs are the hull of `definitions.pedestrians.reach_disc`.

    Args:
      arrivals: `[C]` by cell of arc length [s], lowered in place; inf = never.
      s, y: where it is along and beside the way [m]; heading: to the way [rad]; v: its speed >= 0 [m/s].
      half_width, radius: of the way and of the pedestrian [m].
      walk: `Walk`.
      dt: length of a frame [s].
    """
    rho, a, b = walk.response_time, walk.a_max_accel, walk.a_min_brake
    last = (v + rho * a) / (2 * b)  # it comes no further than in this time after its response at unchanged speed
    room = radius + sampled_room(v, walk, dt)
    t = 0.0
    while True:
        after = min(max(t - rho, 0.0), last)
        within = min(t, rho)
        ahead, spread = v * (within + after), 0.5 * a * within**2 + a * rho * after + room
        _note_disc(arrivals, s + ahead * np.cos(heading), y + ahead * np.sin(heading), spread, half_width, t - dt)
        if t - rho >= last:
            return
        t += dt


@inner
def _note_disc(arrivals, s, y, radius, half_width, t):
    beside = max(abs(y) - half_width, 0.0)
    if beside >= radius:
        return
    half = np.sqrt(radius * radius - beside * beside)
    first = max(int(np.floor((s - half) / CELL)), 0)
    last = min(int(np.floor((s + half) / CELL)), len(arrivals) - 1)
    for i in range(first, last + 1):
        arrivals[i] = min(arrivals[i], max(t, 0.0))


@compiled
def note_route(arrivals, start, end, clearance, v, v_high, walk, dt):
    """Lower the times from which on a pedestrian may be on a crossing.

    Args:
      arrivals: `[C]` by cell of arc length [s], lowered in place.
      start, end: of the crossing along the way [m].
      clearance: between the pedestrian and the way, bodies included [m].
      v: its speed toward the way >= 0, v_high: above which it does not accelerate [m/s].
      walk, dt: as in `note_reach`.
    """
    t = time_to_cover_accelerating(clearance, v, walk.a_max_accel, v_high) - dt
    for i in range(max(int(np.floor(start / CELL)), 0), min(int(np.floor(end / CELL)), len(arrivals) - 1) + 1):
        arrivals[i] = min(arrivals[i], max(t, 0.0))


@compiled
def has_way(person, y, turned, clearance):
    """Has a pedestrian the right of way on a crossing? On the ego's way, or where it faces that."""
    return not np.isnan(person.route_from) and (clearance <= 0.0 or -np.sign(y) * np.sin(turned) > 0.0)


@compiled
def list_people(paths, track, people, walk, dt, scratch, threats):
    """Ways that pedestrians may take across the ego's path, as threats.

    Args:
      paths: `Paths`; track: `Track` of the ego.
      people: `[K]` PERSON, who may be hidden first.
      walk: `Walk` of all.
      dt: length of a frame [s].
      scratch: `[2, C]`, overwritten.
      threats: `[M]` THREAT, overwritten.

    Returns:
      How many threats there are; more than M if they did not fit.
    """
    count, k = 0, 0
    while k < len(people):
        user = people[k].user
        scratch[:] = np.inf
        while k < len(people) and people[k].user == user:
            _note_person(paths, track.path, people[k], walk, dt, scratch)
            k += 1
        count = _list_rows(paths, track, scratch[0], user, True, dt, threats, count)
        count = _list_rows(paths, track, scratch[1], user, False, dt, threats, count)
    return count


@inner
def _note_person(paths, path, person, walk, dt, scratch):
    s, y, turned, half_width = place_on_path(paths, path, person.x, person.y, person.heading)
    clearance = abs(y) - half_width - person.radius
    if has_way(person, y, turned, clearance):
        toward = max(-np.sign(y) * person.v * np.sin(turned), 0.0)
        v_high = max(person.v_high, toward)
        start, end = person.route_from - person.radius, person.route_to + person.radius
        note_route(scratch[1], start, end, max(clearance, 0.0), toward, v_high, walk, dt)
    else:
        note_reach(scratch[0], s, y, turned, person.v, half_width, person.radius, walk, dt)


@inner
def _list_rows(paths, track, arrivals, user, yields, dt, threats, count):
    """One threat for each stretch of equal times, in whole frames."""
    first, end = cell_of(track.s - track.half_length, len(arrivals)), len(arrivals)
    i = first
    while i < end:
        if arrivals[i] == np.inf:
            i += 1
            continue
        t = _whole(arrivals[i], dt)
        j = i
        while j < end and _whole(arrivals[j], dt) == t:
            j += 1
        if count < len(threats):
            _fill_in(paths, track, i * CELL, j * CELL, t, user, yields, threats[count])
        count += 1
        i = j
    return count


@inner
def _whole(t, dt):
    """Rounded down to frames, so that what is left of a time is what it was a frame before, less a frame."""
    return np.floor(t / dt + 1e-6) * dt if t < np.inf else np.inf


@inner
def _fill_in(paths, track, start, end, t, user, yields, threat):
    threat.user, threat.path, threat.s, threat.v, threat.cap = user, -1, 0.0, 0.0, 0.0
    threat.half_length, threat.wreck, threat.priority, threat.red_for = 0.0, False, 0, 0.0
    threat.arrives, threat.yields = t, yields
    # who gives way to a car that is there is met by its front only
    behind = -track.half_length if yields else track.half_length
    threat.from_cell = int(np.floor((start - track.half_length - _MARGIN) / CELL))
    threat.to_cell = int(np.floor((end + behind + _MARGIN) / CELL))
    threat.from_cell_beside, threat.to_cell_beside = NEVER, -1
