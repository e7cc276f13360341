"""Plans of the ego through a junction, and whether they stay clear of everybody (Def. 17, pointwise in time).

A plan is a throttle phase at `a_max_accel`, possibly empty, and then braking at `a_min_brake` to rest. It
is clear of a car iff on no frame the ego is in the way of any place where that car may be by then: it may
brake at `a_max_brake` or accelerate at `a_max_accel`, on any of the paths it may follow. That makes the
items of Def. 17 safe where the published ones compare end points only:

  item 1   the ego stops before the conflict area;
  item 2   the ego follows through the area behind the other, or leads it: on every frame, not at rest only;
  item 3   the ego has left the area before the other can arrive, without any braking by the other.

A follower on the ego's own lane has to keep its distance itself (Lemma 2); a car that merges behind the
ego counts as one once its distance is safe.
"""

from typing import NamedTuple

import numpy as np

from shield.compiled import compiled, inner
from shield.conflict_areas import CELL, Paths, cell_of, in_conflict
from shield.kinematics import response_distance, stopping_distance, travel
from shield.longitudinal import d_min_following
from shield.params import RSSParams
from shield.right_of_way import can_stop_before

STOP, GO = 1, 2  # kinds of plans
KNOWN, STRAIGHT, ANY = range(3)  # what is known of the ways that others take: see `INTENTS`
INTENTS = ("known", "straight", "any")
NEVER = 1 << 30  # frame of something that does not happen

# Arguments as numpy numbers: for each number of Python's that it is handed, numba compiles a function anew.
EVERYBODY = np.int64(-1)  # whom a plan stays clear of
ANYWHERE = np.bool_(False)  # it may come to rest wherever nobody meets it, not only `at_line`
NOW, NEXT = np.int64(0), np.int64(1)  # frames of a plan

SLACK = 0.2  # a new plan stays clear even if the ego is this far off; one in force only has to stay clear [m]
_SHORT_CUT = 1.0  # a car that cuts the corners of its path gains or loses at most this ...
_SHORT_CUT_SHARE = 0.05  # ... and at most this share of the distance driven
_REVERSE = 1.0  # a car that reverses may go on for this long [s]
_TAIL = 3  # frames between two moments at which a go plan may begin to brake
_LONGEST = 10.0  # throttle phase of a plan, at most [s]
_BODIES = 8.0  # cars that follow each other are in each other's way that far apart, margins included [m]
_REST = 1e-9  # below this speed a plan has come to rest [m/s]

# One way that a road user may take. SI units.
THREAT = np.dtype(
    [
        ("user", "i8"),  # index of the road user, -1 = nobody: a red light
        ("path", "i8"),  # row in `Paths`; -1 = an obstacle off all paths
        ("s", "f8"),  # arc length of the centre on that path
        ("v", "f8"),  # speed, negative in reverse
        ("cap", "f8"),  # speed above which it does not accelerate
        ("half_length", "f8"),
        ("wreck", "?"),  # has crashed: it may stop on the spot
        ("priority", "i8"),  # +1: the ego has the right of way over it, -1: the other way round
        ("red_for", "f8"),  # it is counted on to wait at a light for this long [s]; 0 = it is not
        ("line", "f8"),  # and until then its centre stays behind this arc length [m]
        ("ignored", "?"),  # behind the ego on its lane, or obliged and able to give way
        ("left_out", "?"),  # the ego's plans are not checked against it: see `shield.examined`
        ("stops_here", "?"),  # who is behind it on its approach is not looked at
        ("left", "i8"),  # frame of the plan from which on it is a follower
        ("free_until", "i8"),  # frame of a plan before which it cannot reach the ego's path ahead
        ("joins", "i8"),  # cell of the ego's path from which on it may be on the ego's lane
        ("from_cell", "i8"),  # cells of the ego's path in the way of an obstacle
        ("to_cell", "i8"),
        ("from_cell_beside", "i8"),  # likewise of the path of the lane that it is leaving
        ("to_cell_beside", "i8"),
    ],
    align=True,
)


class Track(NamedTuple):
    """Where the ego is on its path."""

    path: int
    s: float  # arc length of the centre [m]
    v: float  # speed [m/s]
    half_length: float
    beside: int = -1  # path of the lane that it has not left yet for this one, -1 = none
    shift: float = 0.0  # arc length on that path, less s [m]
    leaves_after: float = 0.0  # it has left that lane once it has driven for this long [s] ...
    leaves_at: float = 0.0  # ... and is past this arc length [m]


class Scene(NamedTuple):
    """Everything that a plan depends on. M ways of others."""

    paths: Paths
    track: Track
    threats: np.ndarray  # `[M]` THREAT
    ego: RSSParams
    other: RSSParams
    dt: float  # length of a frame [s]
    drift: float = 0.0  # the ego may come this much further, or less far, than a plan says [m]


# ---------------------------------------------------------------- where others may be


@inner
def nearest(threat, t, other):
    """Least arc length at which a road user can be `t` from now [m]."""
    if threat.wreck:
        return threat.s
    if threat.v < 0.0:
        return threat.s + threat.v * min(t, _REVERSE)
    driven = travel(t, threat.v, 0.0, 0.0, other.a_max_brake)
    return threat.s + driven - _short_cut(driven)


@compiled
def farthest(threat, t, other):
    """Largest arc length at which it can be `t` from now [m]."""
    if threat.wreck:
        return threat.s + max(threat.v, 0.0)  # a wreck rolls to rest with a time constant of 1 s
    driven = response_distance(max(threat.v, 0.0), t, other.a_max_accel, threat.cap)
    if threat.red_for > 0.0:
        driven = min(driven, threat.line - threat.s + _beyond_line(max(t - threat.red_for, 0.0), other))
    return threat.s + driven + _short_cut(driven)


@inner
def _beyond_line(t, other):
    """How far behind a stop line a car can be `t` after it may go, if until then it was able to stop there [m].

    With v = sqrt(2 b d) at a distance d it comes to v t + a t^2 / 2 - d, at most when v = b t.
    """
    return 0.5 * (other.a_max_accel + other.a_min_brake) * t**2


@inner
def _short_cut(driven):
    """How far progress along a path may differ from the distance driven [m]."""
    return min(_SHORT_CUT_SHARE * driven, _SHORT_CUT)


@inner
def fastest(threat, t, other):
    """Largest speed it can have `t` from now [m/s]."""
    return max(threat.v, min(threat.v + other.a_max_accel * t, threat.cap), 0.0)


# ---------------------------------------------------------------- the ego and one of them


@inner
def follows(scene, s, v, threat, t):
    """Would a road user be behind the ego, at `s` with speed `v`, on its lane by then, at a safe distance (Lemma 2)?"""
    track, other = scene.track, scene.other
    if threat.path < 0 or threat.wreck or not _shares_lane(scene.paths, track.path, s, threat):
        return False
    s_other = on_path_of_ego(scene.paths, track.path, s, threat, farthest(threat, t, other))
    gap = s - track.half_length - threat.half_length - s_other
    return gap > 0.0 and gap >= distance_behind(threat, fastest(threat, t, other), v, other)


@inner
def _shares_lane(paths, path, s, threat):
    """Does the way of a road user run along the lane that the ego is on at `s`?"""
    return not np.isnan(paths.offset[threat.path, paths.lane[path, cell_of(s, paths.cells[path])]])


@inner
def distance_behind(threat, v_threat, v, other):
    """Distance that a follower has to keep (Lemma 2) [m]; beyond the speed limit it does not accelerate."""
    rear = RSSParams(
        other.response_time,
        other.a_max_accel,
        other.a_min_brake,
        other.a_max_brake,
        other.a_min_brake_correct,
        other.a_lat_max_accel,
        other.a_lat_min_brake,
        other.mu,
        other.standstill_gap,
        min(other.v_cap, threat.cap),
    )
    return d_min_following(v_threat, v, rear, other)


@inner
def on_path_of_ego(paths, path, s, threat, s_threat):
    """Arc length of a road user as the ego counts it, inf where it does not drive along the ego's lane [m]."""
    lane = paths.lane[path, cell_of(s, paths.cells[path])]
    offset = paths.offset[threat.path, lane]
    if np.isnan(offset):
        return np.inf
    s_other = s_threat - offset + paths.offset[path, lane]
    return s_other if s_other >= s or _comes_from_behind(paths, path, s, threat, s_threat, s - s_other) else np.inf


@inner
def _comes_from_behind(paths, path, s, threat, s_threat, distance):
    """Does a road user at `distance` [m] behind the ego not come in its way before? On a ring everybody is behind."""
    return paths.first[path, threat.path, cell_of(s, paths.cells[path])] - s_threat >= distance - _BODIES


@inner
def behind_by(paths, track, threat):
    """How far a road user on the ego's own way is behind it; -inf if it is not on it [m]."""
    lane = paths.lane[threat.path, cell_of(threat.s, paths.cells[threat.path])]
    offset = paths.offset[track.path, lane]
    if np.isnan(offset):
        return -np.inf
    distance = track.s - (threat.s - paths.offset[threat.path, lane] + offset)
    clear = _comes_from_behind(paths, track.path, track.s, threat, threat.s, distance)
    return distance if distance <= 0.0 or clear else -np.inf


@inner
def meets(scene, s, slack, threat, t, resting):
    """Can a road user be in the way of the ego at `s`, at time `t` from now or, if it rests, ever after?

    With a `slack` [m], the ego may be that much further or less far than at `s`.
    """
    track, other = scene.track, scene.other
    leaves = track.beside >= 0 and (t <= track.leaves_after or s <= track.leaves_at)
    if threat.path < 0:
        return _overlaps(scene.paths, track.path, s, slack, threat.from_cell, threat.to_cell) or (
            leaves
            and _overlaps(
                scene.paths, track.beside, s + track.shift, slack, threat.from_cell_beside, threat.to_cell_beside
            )
        )
    low, high = nearest(threat, t, other), np.inf if resting else farthest(threat, t, other)
    return _conflicts(scene.paths, track.path, s, slack, threat.path, low, high) or (
        leaves and _conflicts(scene.paths, track.beside, s + track.shift, slack, threat.path, low, high)
    )


@inner
def _overlaps(paths, path, s, slack, from_cell, to_cell):
    """Is the ego in one of these cells of a path?"""
    return from_cell <= cell_of(s + slack, paths.cells[path]) and cell_of(s - slack, paths.cells[path]) <= to_cell


@inner
def _conflicts(paths, path, s, slack, other_path, low, high):
    """Is the ego, on a path, in the way of somebody between `low` and `high` on another [m]?"""
    for i in range(cell_of(s - slack, paths.cells[path]), cell_of(s + slack, paths.cells[path]) + 1):
        if in_conflict(paths, path, i, other_path, low, high):
            return True
    return False


@compiled
def can_give_way(scene, threat):
    """Can a road user stop before it comes in the way of the ego's path (Def. 17, item 1)?"""
    if threat.path < 0:
        return False
    paths, track = scene.paths, scene.track
    entry = paths.first[track.path, threat.path, cell_of(track.s, paths.cells[track.path])]
    return can_stop_before(entry - CELL - threat.s, max(threat.v, 0.0), scene.other)


@inner
def look_ahead(scene, threat):
    """Note until when a road user is neither in the way of the ego nor behind it, wherever a plan may take the ego.

    Most are far away: this spares looking at them on the frames of each plan, and changes nothing else.
    """
    threat.free_until, threat.joins = 0, 0
    paths, track = scene.paths, scene.track
    if threat.path < 0 or track.beside >= 0:
        return
    here = cell_of(track.s - SLACK - scene.drift, paths.cells[track.path])
    entry = paths.first[track.path, threat.path, here]
    low, high = 0, int(_LONGEST / scene.dt)  # the frame sought is among them, or later
    if entry == np.inf:
        low = high
    while low < high:
        middle = (low + high) // 2
        if farthest(threat, middle * scene.dt, scene.other) < entry:
            low = middle + 1
        else:
            high = middle
    threat.free_until = low
    threat.joins = paths.joins[track.path, threat.path, cell_of(track.s, paths.cells[track.path])]


# ---------------------------------------------------------------- plans


@inner
def step(s, v, a, dt):
    """One frame of explicit Euler, never backwards."""
    return s + v * dt, max(v + a * dt, 0.0)


@compiled
def throttle(scene, s, v):
    """Acceleration of a plan's throttle phase: up to the speed limit [m/s^2]."""
    paths, path, ego = scene.paths, scene.track.path, scene.ego
    cap = min(ego.v_cap, paths.speed_limit[path, cell_of(s, paths.cells[path])])
    return min(ego.a_max_accel, max((cap - v) / scene.dt, 0.0))


@inner
def _counts(threat, n, only):
    """Must a plan stay clear of a road user from frame n on, `only` being the one that counts, -1 = all?"""
    if threat.ignored or threat.left <= n:
        return False
    return threat.user == only if only >= 0 else not threat.left_out


@inner
def _is_away(scene, s, n, threat):
    """Is a road user too far away on frame n to be in the way of the ego at `s` or behind it (see `look_ahead`)?"""
    return n < threat.free_until and cell_of(s, scene.paths.cells[scene.track.path]) < threat.joins


@inner
def _meets_anyone(scene, s, v, n, only, slack):
    """Does the ego, at `s` with speed `v` on frame n of a plan's throttle phase, meet anyone?

    Whoever is a follower by then counts no more for the rest of the plan.
    """
    t = n * scene.dt
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if not _counts(threat, n, only) or _is_away(scene, s, n, threat):
            continue
        if follows(scene, s, v, threat, t):
            threat.left = n
        elif meets(scene, s, slack, threat, t, False):
            return True
    return False


@inner
def begin(scene):
    """Nobody has become a follower yet."""
    for k in range(len(scene.threats)):
        scene.threats[k].left = NEVER


@compiled
def tail_conflict(scene, s, v, n, brake, only, at_line, slack):
    """First frame on which braking to rest from frame `n` meets somebody, `NEVER` if none.

    Args:
      scene: `Scene`.
      s, v: the ego's on frame n.
      brake: [m/s^2].
      only: index of the road user that counts, -1 = all.
      at_line: the ego may rest only where it is in nobody's way, whoever may come.
      slack: how exactly the ego is known to follow the plan [m].
    """
    paths, path, dt = scene.paths, scene.track.path, scene.dt
    rest = s + v * dt + stopping_distance(v, brake) + scene.drift
    if at_line and paths.crossed[path, cell_of(rest, paths.cells[path])]:
        return n
    s_rest, v_rest, n_rest = s, v, n
    while v_rest > _REST:
        s_rest, v_rest = step(s_rest, v_rest, -brake, dt)
        n_rest += 1
    conflict = NEVER
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if not _counts(threat, n, only):
            continue
        if n_rest > 0 and _is_away(scene, s_rest, n_rest - 1, threat):
            if n_rest < conflict and meets(scene, s_rest, slack, threat, n_rest * dt, True):
                conflict = n_rest
        else:
            conflict = min(conflict, _meets_braking(scene, s, v, n, brake, conflict, slack, threat))
    return conflict


@inner
def _meets_braking(scene, s, v, n, brake, until, slack, threat):
    """First frame from n on, before `until`, on which the braking ego meets a road user; `NEVER` if none.

    Once it is a follower, it is none that the ego meets.
    """
    while n < until:
        t, resting = n * scene.dt, v <= _REST
        if resting or not _is_away(scene, s, n, threat):
            if follows(scene, s, v, threat, t):
                return NEVER
            if meets(scene, s, slack, threat, t, resting):
                return n
        if resting:
            return NEVER
        s, v = step(s, v, -brake, scene.dt)
        n += 1
    return NEVER


@compiled
def stop_conflict(scene, a, only, at_line, slack):
    """First frame on which "this frame `a`, then brake" meets somebody, `NEVER` if none."""
    begin(scene)
    s, v = step(scene.track.s, scene.track.v, a, scene.dt)
    return tail_conflict(scene, s, v, NEXT, scene.ego.a_min_brake, only, at_line, slack)


@compiled
def go_plan(scene, a, only, at_line, slack):
    """Find a plan "this frame `a`, then throttle, then brake" that meets nobody.

    Returns:
      (frames of throttle, frame of the first conflict): frames = -1 if there is no such plan; then the
      latest first conflict of all.
    """
    begin(scene)
    s, v = step(scene.track.s, scene.track.v, a, scene.dt)
    n, latest = NEXT, NOW
    while n * scene.dt < _LONGEST:
        if _meets_anyone(scene, s, v, n, only, slack):
            return -1, max(latest, n)
        if n % _TAIL == 2:
            conflict = tail_conflict(scene, s, v, n, scene.ego.a_min_brake, only, at_line, slack)
            if conflict == NEVER:
                return n - 1, NEVER
            latest = max(latest, conflict)
        s, v = step(s, v, throttle(scene, s, v), scene.dt)
        n += 1
    return -1, latest


@compiled
def plan_conflict(scene, go, only, slack):
    """First frame on which "throttle for `go` frames, then brake" meets somebody, `NEVER` if none."""
    begin(scene)
    s, v = scene.track.s, scene.track.v
    for n in range(go):
        if n > 0 and _meets_anyone(scene, s, v, n, only, slack):
            return n
        s, v = step(s, v, throttle(scene, s, v), scene.dt)
    return tail_conflict(scene, s, v, go, scene.ego.a_min_brake, only, ANYWHERE, slack)
