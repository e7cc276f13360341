"""Plans of the ego as if there were only one other road user: what it owes to whom."""

from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import ANYWHERE, GO, NEVER, STOP, Scene, go_plan, stop_conflict, throttle

_TOLERANCE = 1e-6


@inner
def alone_with(scene, i):
    """The scene without the ways of others before and after those of a road user, which stand together."""
    first, last = len(scene.threats), 0
    for k in range(len(scene.threats)):
        if scene.threats[k].user == i:
            first, last = min(first, k), k + 1
    return Scene(scene.paths, scene.track, scene.threats[first:last], scene.table, scene.drift)


@inner
def next_alone(scene, i, at):
    """`alone_with` the road user after the one whose ways end before `at`; where to look for the next, too."""
    end = at
    while end < len(scene.threats) and scene.threats[end].user == i:
        end += 1
    if end == at:
        return alone_with(scene, i), at
    return Scene(scene.paths, scene.track, scene.threats[at:end], scene.table, scene.drift), end


@inner
def may_meet(scene):
    """May one of these ways ever meet the ego, for all that is noted of them?"""
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.free_until != NEVER and not threat.ignored:
            return True
    return False


@apart
def plans_and_duty(scene, i, a):
    """Kinds of plans that stay clear of one road user from this sample on, and does the ego do its duty toward it?"""
    items = _plans_now(scene, i)
    return items, (leaves_plan_toward(scene, i, a) if items != 0 else is_resolute(scene, a))


@inner
def _plans_now(scene, i):
    """Kinds of plans that stay clear of one road user from this sample on."""
    brake = limit(-scene.table.ego.a_min_brake, scene.track.v, scene.table.ego, scene.table.dt)
    if stop_conflict(scene, brake, i, ANYWHERE, 0.0) == NEVER:
        return STOP
    return GO if go_plan(scene, throttle(scene, scene.track.s, scene.track.v), i, ANYWHERE, 0.0)[0] >= 0 else 0


@inner
def is_resolute(scene, a):
    """Where there is no plan, does the ego brake or go on with all it has?"""
    stops = scene.track.v + a * scene.table.dt <= _TOLERANCE
    goes = a >= throttle(scene, scene.track.s, scene.track.v) - _TOLERANCE
    return stops or goes or a <= -scene.table.ego.a_min_brake + _TOLERANCE


@inner
def leaves_plan_toward(scene, i, a):
    """Does the ego's acceleration leave it a plan toward a road user?"""
    return stop_conflict(scene, a, i, ANYWHERE, 0.0) == NEVER or go_plan(scene, a, i, ANYWHERE, 0.0)[0] >= 0
