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

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import (
    stopping_distance,
    time_to_cover_accelerating,
)
from rss_shield.shield.definitions.longitudinal import d_min_following
from rss_shield.shield.definitions.right_of_way import can_stop_before
from rss_shield.shield.junctions.conflict_areas import CELL, Paths, cell_of, in_conflict
from rss_shield.shield.junctions.reach import SHORT_CUT, SHORT_CUT_SHARE, STANDING, farthest, fastest, nearest
from rss_shield.shield.params import RSSParams, Table

STOP, GO = 1, 2  # kinds of plans
PLAN_NAMES = {0: "inherited", STOP: "stop", GO: "go", STOP | GO: "both"}
KNOWN, STRAIGHT, ANY = range(3)  # what is known of the ways that others take: see `INTENTS`
INTENTS = ("known", "straight", "any")
NEVER = 1 << 30  # frame of something that does not happen

# Arguments as numpy numbers: for each number of Python's that it is handed, numba compiles a function anew.
EVERYBODY = np.int64(-1)  # whom a plan stays clear of
ANYWHERE = np.bool_(False)  # it may come to rest wherever nobody meets it, not only `at_line`
NOW, NEXT = np.int64(0), np.int64(1)  # frames of a plan
ANY_PLACE = -np.inf  # a plan may come to rest before it

# Rule J9. Who has stood for `PATIENCE` has to notice first that somebody counts on that: it stands for `START_UP` more.
PATIENCE = (15.0, 5.0, 5.0)  # by `entry`: cautious, priority, assertive [s]
START_UP = 2.5  # from when the ego has no other plan [s]

SLACK = 0.2  # a new plan stays clear even if the ego is this far off; one in force only has to stay clear [m]
TAIL = 3  # frames between two moments at which a go plan may begin to brake
EVERY_FRAME = 1  # no frame between them
LONGEST = 10.0  # throttle phase of a plan, at most [s]
_BETWEEN = 3.0  # cars that follow each other are in each other's way with so much between them, margins included [m]
REST = 1e-9  # below this speed a plan has come to rest [m/s]
_STRIDE = 8  # frames of a plan that are looked at together
_FEW = 250.0  # frames, in which rounding ...
_ROUNDING = 1e-9  # ... moves a place by less than this [m] ...
_UNSURE = 1e-10  # ... and a moment by less than this many frames


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
    table: Table
    drift: float = 0.0  # the ego may come this much further, or less far, than a plan says [m]


# ---------------------------------------------------------------- the ego and one of them


@inner
def follows(scene, s, v, threat, t):
    """Would a road user be behind the ego, at `s` with speed `v`, on its lane by then, at a safe distance (Lemma 2)?"""
    track, other = scene.track, scene.table.other
    if threat.path < 0 or threat.wreck or not _shares_lane(scene.paths, track.path, s, threat):
        return False
    s_other = on_path_of_ego(scene.paths, track, s, threat, farthest(threat, t, other))
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
def on_path_of_ego(paths, track, s, threat, s_threat):
    """Arc length of a road user as the ego counts it, inf where it does not drive along the ego's lane [m]."""
    path = track.path
    lane = paths.lane[path, cell_of(s, paths.cells[path])]
    offset = paths.offset[threat.path, lane]
    if np.isnan(offset):
        return np.inf
    s_other = s_threat - offset + paths.offset[path, lane]
    return s_other if s_other >= s or _comes_from_behind(paths, track, s, threat, s_threat, s - s_other) else np.inf


@inner
def _comes_from_behind(paths, track, s, threat, s_threat, distance):
    """Does a road user at `distance` [m] behind the ego not come in its way before? On a ring everybody is behind."""
    first = paths.first[track.path, threat.path, cell_of(s, paths.cells[track.path])]
    return first - s_threat >= distance - (track.half_length + threat.half_length + _BETWEEN)


@inner
def behind_by(paths, track, threat):
    """How far a road user on the ego's own way is behind it; -inf if it is not on it [m]."""
    lane = paths.lane[threat.path, cell_of(threat.s, paths.cells[threat.path])]
    offset = paths.offset[track.path, lane]
    if np.isnan(offset):
        return -np.inf
    distance = track.s - (threat.s - paths.offset[threat.path, lane] + offset)
    clear = _comes_from_behind(paths, track, track.s, threat, threat.s, distance)
    return distance if distance <= 0.0 or clear else -np.inf


@inner
def meets(scene, s, slack, threat, t, resting):
    """Can a road user be in the way of the ego at `s`, at time `t` from now or, if it rests, ever after?

    With a `slack` [m], the ego may be that much further or less far than at `s`.
    """
    track, other = scene.track, scene.table.other
    leaves = track.beside >= 0 and (t <= track.leaves_after or s <= track.leaves_at)
    if threat.path < 0:
        if threat.yields if resting else t < threat.arrives:
            return False
        return _overlaps(scene.paths, track.path, s, slack, threat.from_cell, threat.to_cell) or (
            leaves
            and _overlaps(
                scene.paths, track.beside, s + track.shift, slack, threat.from_cell_beside, threat.to_cell_beside
            )
        )
    low, high = nearest(threat, t, other), np.inf if resting else farthest(threat, t, other)
    if _conflicts(scene.paths, track.path, s - slack, s + slack, threat.path, low, high):
        return True
    s += track.shift
    return leaves and _conflicts(scene.paths, track.beside, s - slack, s + slack, threat.path, low, high)


@inner
def _overlaps(paths, path, s, slack, from_cell, to_cell):
    """Is the ego in one of these cells of a path?"""
    return from_cell <= cell_of(s + slack, paths.cells[path]) and cell_of(s - slack, paths.cells[path]) <= to_cell


@inner
def _conflicts(paths, path, start, end, other_path, low, high):
    """Is the ego, between two places on a path, in the way of somebody between `low` and `high` on another [m]?"""
    for i in range(cell_of(start, paths.cells[path]), cell_of(end, paths.cells[path]) + 1):
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
    return can_stop_before(entry - CELL - threat.s, max(threat.v, 0.0), scene.table.other)


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
    if entry == np.inf:
        threat.free_until = NEVER
        return
    threat.free_until = _frames_before(threat, entry, scene.table.other, scene.table.dt)
    threat.joins = paths.joins[track.path, threat.path, cell_of(track.s, paths.cells[track.path])]


@inner
def _frames_before(threat, s, other, dt):
    """First frame on which a road user may have come to an arc length, or one before it.

    By the inverse of `farthest`; a light would only make it later.
    """
    if threat.wreck:
        return NOW if farthest(threat, 0.0, other) >= s else NEVER - 1
    distance = s - threat.s - _ROUNDING
    driven = max(distance - SHORT_CUT, distance / (1.0 + SHORT_CUT_SHARE))
    if threat.stands_for > 0.0:
        rest = driven - STANDING * threat.stands_for
        starting = time_to_cover_accelerating(rest, STANDING, other.a_max_accel, threat.cap)
        t = threat.stands_for + starting if rest > 0.0 else driven / STANDING
    else:
        t = time_to_cover_accelerating(driven, max(threat.v, 0.0), other.a_max_accel, threat.cap)
    return int(min(np.ceil(t / dt - _UNSURE), NEVER - 1))


# ---------------------------------------------------------------- plans


@inner
def step(s, v, a, dt):
    """One frame of explicit Euler, never backwards."""
    return s + v * dt, max(v + a * dt, 0.0)


@compiled
def throttle(scene, s, v):
    """Acceleration of a plan's throttle phase: up to the speed limit [m/s^2]."""
    paths, path, ego = scene.paths, scene.track.path, scene.table.ego
    cap = min(ego.v_cap, paths.speed_limit[path, cell_of(s, paths.cells[path])])
    return min(ego.a_max_accel, max((cap - v) / scene.table.dt, 0.0))


@inner
def _counts(threat, n, only):
    """Must a plan stay clear of a road user from frame n on, `only` being the one that counts, -1 = all?"""
    if threat.ignored or threat.left <= n:
        return False
    return threat.user == only if only >= 0 else not threat.left_out


@inner
def _may_follow(scene, s, threat):
    """May a road user be behind the ego at `s`, for all that `look_ahead` noted?"""
    return cell_of(s, scene.paths.cells[scene.track.path]) >= threat.joins


@inner
def _meets_anyone(scene, s, v, n, only, slack):
    """Does the ego, at `s` with speed `v` on frame n of a plan's throttle phase, meet anyone?

    Whoever is a follower by then counts no more for the rest of the plan.
    """
    t = n * scene.table.dt
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if not _counts(threat, n, only):
            continue
        if _may_follow(scene, s, threat) and follows(scene, s, v, threat, t):
            threat.left = n
        elif n >= threat.free_until and meets(scene, s, slack, threat, t, False):
            return True
    return False


@inner
def begin(scene):
    """Nobody has become a follower yet; who never meets the ego need not be looked at, as if it were one."""
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        threat.left = NOW if threat.free_until == NEVER else NEVER


@compiled
def tail_conflict(scene, s, v, n, brake, only, at_line, slack):
    """First frame on which braking to rest from frame `n` meets somebody, `NEVER` if none.

    Where only one road user counts, any such frame: then nobody asks how long the plan would last.

    Args:
      scene: `Scene`.
      s, v: the ego's on frame n.
      brake: [m/s^2].
      only: index of the road user that counts, -1 = all.
      at_line: the ego may rest only where it is in nobody's way, whoever may come.
      slack: how exactly the ego is known to follow the plan [m].
    """
    paths, path, dt = scene.paths, scene.track.path, scene.table.dt
    rest = s + v * dt + stopping_distance(v, brake) + scene.drift
    if at_line and paths.crossed[path, cell_of(rest, paths.cells[path])]:
        return n
    s_rest, n_rest = _rest(scene, s, v, n, brake, slack)
    return _braking_conflict(scene, s, v, n, s_rest, n_rest, brake, only, slack)


@inner
def _braking_conflict(scene, s, v, n, s_rest, n_rest, brake, only, slack):
    """`tail_conflict`, with the place and the frame of the ego's rest, wherever that is."""
    dt, conflict = scene.table.dt, NEVER
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if not _counts(threat, n, only):
            continue
        met_at_rest = meets(scene, s_rest, slack, threat, n_rest * dt, True)
        if not met_at_rest and _is_clear(scene, s, n, s_rest, n_rest, slack, threat):
            continue
        falls_behind = _may_fall_behind(scene, s, v, n, s_rest, brake, threat)
        if met_at_rest and not falls_behind and (only >= 0 or n_rest <= threat.free_until):
            conflict = min(conflict, n_rest)
        else:
            at = _meets_braking(scene, s, v, n, n_rest, brake, conflict, slack, threat, falls_behind)
            conflict = min(conflict, at)
        if only >= 0 and conflict < NEVER:
            return conflict
    return conflict


@inner
def _rest(scene, s, v, n, brake, slack):
    """Where and on which frame the ego comes to rest if it brakes from frame n on.

    In closed form, and frame by frame where the difference by rounding might matter to `meets`.
    """
    dt = scene.table.dt
    frames = (v - REST) / (brake * dt)
    whole = max(np.ceil(frames), 0.0)
    s_rest = s + dt * whole * (v - 0.5 * brake * dt * (whole - 1.0))
    doubtful = whole > _FEW or abs(frames - np.rint(frames)) < _UNSURE or scene.track.beside >= 0
    if doubtful or _is_at_edge(s_rest - slack) or _is_at_edge(s_rest + slack):
        s_rest = s
        while v > REST:
            s_rest, v = step(s_rest, v, -brake, dt)
            n += 1
        return s_rest, n
    return s_rest, n + int(whole)


@inner
def _is_at_edge(s):
    """Would rounding matter to the cell at arc length `s`?"""
    return np.floor((s - _ROUNDING) / CELL) != np.floor((s + _ROUNDING) / CELL)


@inner
def _is_clear(scene, s, n, s_rest, n_rest, slack, threat):
    """Is a road user beyond doubt not met while the ego is between `s` on frame n and `s_rest` on frame `n_rest`?

    Neither of them drives back, so both are where they may be on the first frame, on the last one or in between.
    """
    if n_rest <= threat.free_until:
        return True
    if threat.path < 0 or threat.v < 0.0 or scene.track.beside >= 0:
        return False
    low = nearest(threat, n * scene.table.dt, scene.table.other) - _ROUNDING
    high = farthest(threat, n_rest * scene.table.dt, scene.table.other) + _ROUNDING
    end = s_rest + slack + _ROUNDING
    return not _conflicts(scene.paths, scene.track.path, s - slack, end, threat.path, low, high)


@inner
def _may_fall_behind(scene, s, v, n, s_rest, brake, threat):
    """May a road user become a follower while the ego brakes from `s` and `v` on frame n to `s_rest`?

    The gap grows only while the ego is faster than the other may be, and the distance that a follower needs only grows.
    """
    paths, track, other, t = scene.paths, scene.track, scene.table.other, n * scene.table.dt
    s_rest += _ROUNDING
    if threat.path < 0 or threat.wreck or not _may_follow(scene, s_rest, threat):
        return False
    if threat.red_for > 0.0:
        return True
    v_other = fastest(threat, t, other)
    faster = max(v - v_other, 0.0)
    s_other = farthest(threat, t, other) - _furthest_ahead(paths, track.path, s, s_rest, threat.path)
    gap = s - track.half_length - threat.half_length - s_other
    widest = gap + faster * scene.table.dt + stopping_distance(faster, brake) + _ROUNDING
    return widest > 0.0 and widest >= distance_behind(threat, v_other, v, other)


@inner
def _furthest_ahead(paths, path, s, s_end, other_path):
    """How much larger arc lengths are on another path at most, on lanes of both that the ego follows up to `s_end`."""
    most, i, last = -np.inf, cell_of(s, paths.cells[path]), cell_of(s_end, paths.cells[path])
    while i <= last:
        lane = paths.lane[path, last]
        offset = paths.offset[other_path, lane]
        if not np.isnan(offset):
            most = max(most, offset - paths.offset[path, lane])
        last = paths.reached[path, last] - 1
    return most


@inner
def _meets_braking(scene, s, v, n, n_rest, brake, until, slack, threat, falls_behind):
    """First frame from n on, before `until`, on which the braking ego meets a road user; `NEVER` if none.

    Once it is a follower, it is none that the ego meets.
    """
    single_until = n_rest if falls_behind else n  # frame up to which single frames are looked at
    while n < until:
        if single_until <= n < n_rest - _STRIDE:
            if _is_clear(scene, s, n, s + _STRIDE * v * scene.table.dt, n + _STRIDE, slack, threat):
                for _ in range(_STRIDE):
                    s, v = step(s, v, -brake, scene.table.dt)
                n += _STRIDE
                continue
            single_until = n + _STRIDE
        t, resting = n * scene.table.dt, v <= REST
        if falls_behind and _may_follow(scene, s, threat) and follows(scene, s, v, threat, t):
            return NEVER
        if (resting or n >= threat.free_until) and meets(scene, s, slack, threat, t, resting):
            return n
        if resting:
            return NEVER
        s, v = step(s, v, -brake, scene.table.dt)
        n += 1
    return NEVER


class Braking(NamedTuple):
    """A plan that stops: the ego on the next frame, from which on it brakes at `a_min_brake`, and at rest."""

    s: float  # [m]
    v: float  # [m/s]
    s_rest: float  # [m]
    n_rest: int


@inner
def braking_after(scene, a):
    """The plan "this frame `a`, then brake", for `meets_braking`."""
    s, v = step(scene.track.s, scene.track.v, a, scene.table.dt)
    return Braking(s, v, *_rest(scene, s, v, NEXT, scene.table.ego.a_min_brake, 0.0))


@inner
def meets_braking(scene, plan, only):
    """`stop_conflict` of a plan with one road user, wherever it stops: the plan is the same toward all of them."""
    begin(scene)
    brake = scene.table.ego.a_min_brake
    return _braking_conflict(scene, plan.s, plan.v, NEXT, plan.s_rest, plan.n_rest, brake, only, 0.0)


@compiled
def stop_conflict(scene, a, only, at_line, slack):
    """First frame on which "this frame `a`, then brake" meets somebody, `NEVER` if none."""
    begin(scene)
    s, v = step(scene.track.s, scene.track.v, a, scene.table.dt)
    return tail_conflict(scene, s, v, NEXT, scene.table.ego.a_min_brake, only, at_line, slack)


@compiled
def first_met(scene, a, brake):
    """First frame on which "this frame `a`, then `brake` [m/s^2] and stay at rest" may meet somebody, `NEVER` if none.

    `stop_conflict` says when a place to rest is reached at which somebody is met, this when the other is there. One who
    needs longer than the longest plan is none.
    """
    begin(scene)
    s, v = step(scene.track.s, scene.track.v, a, scene.table.dt)
    n = NEXT
    while n * scene.table.dt < LONGEST:
        if _meets_anyone(scene, s, v, n, EVERYBODY, 0.0):
            return n
        s, v = step(s, v, -brake, scene.table.dt)
        n += 1
    return NEVER


@compiled
def go_plan(scene, a, only, at_line, slack):
    """Find a plan "this frame `a`, then throttle, then brake" that meets nobody.

    Returns:
      (frames of throttle, frame of the first conflict): frames = -1 if there is no such plan; then the
      latest first conflict of all, as `tail_conflict` says it.
    """
    return go_plan_past(scene, a, only, at_line, slack, ANY_PLACE, TAIL)


@compiled
def go_plan_past(scene, a, only, at_line, slack, place, stride):
    """`go_plan`, but none that comes to rest before a `place` [m], and braking tried every `stride` frames."""
    begin(scene)
    s, v = step(scene.track.s, scene.track.v, a, scene.table.dt)
    n, latest = NEXT, NOW
    while n * scene.table.dt < LONGEST:
        if _meets_anyone(scene, s, v, n, only, slack):
            return -1, max(latest, n)
        if n % stride == stride - 1 and s + stopping_distance(v, scene.table.ego.a_min_brake) >= place:
            conflict = tail_conflict(scene, s, v, n, scene.table.ego.a_min_brake, only, at_line, slack)
            if conflict == NEVER:
                return n - 1, NEVER
            latest = max(latest, conflict)
        s, v = step(s, v, throttle(scene, s, v), scene.table.dt)
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
        s, v = step(s, v, throttle(scene, s, v), scene.table.dt)
    return tail_conflict(scene, s, v, go, scene.table.ego.a_min_brake, only, ANYWHERE, slack)
