"""Whom the ego need not stay clear of at a junction: who is behind it, and who is counted on to give way."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.junctions.conflict_areas import CELL, cell_of
from rss_shield.shield.junctions.memory import ASSERTIVE, CAUTIOUS
from rss_shield.shield.junctions.plans import PATIENCE, START_UP, behind_by, can_give_way, distance_behind, look_ahead
from rss_shield.shield.junctions.reach import STANDING


@compiled
def sort_out(scene, memory, entry):
    """Mark the ways of others that the ego need not stay clear of: followers, and who must give way."""
    _find_followers(scene, memory)
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        threat.ignored, threat.left_out = threat.follows, False
        threat.stands_for = _stands_for(threat, memory[threat.user], entry, scene.table.dt) if threat.path >= 0 else 0.0
        look_ahead(scene, threat)
        if threat.path >= 0 and not threat.follows and entry != CAUTIOUS and not threat.wreck and threat.red_for == 0.0:
            obliged = entry == ASSERTIVE or threat.priority > 0
            if obliged and can_give_way(scene, threat):
                threat.ignored = True
                memory[threat.user].relied = True


@inner
def _stands_for(threat, memory, entry, dt):
    """How long is a road user counted on to stand still, because it has stood for long (rule J9) [s]? 0 = it is not.

    Its time runs from when the ego has no other plan left, once: only when the ego has one it begins anew.
    """
    if threat.wreck or abs(threat.v) >= STANDING or memory.stood * dt < PATIENCE[entry]:
        return 0.0
    return max(START_UP - memory.counted_on * dt, 0.0)


@inner
def find_those_behind(scene, memory):
    """Note who drives behind the ego, at whatever distance."""
    entered, before = _entered(scene.paths, scene.track.path, scene.track.s)
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        threat.behind, threat.follows = -np.inf, False
        if threat.path >= 0:
            threat.behind = behind_by(scene.paths, scene.track, threat)
            known = memory[threat.user].behind
            threat.follows = _drives_behind(scene, threat, threat.behind, known, entered, before)


@inner
def _find_followers(scene, memory):
    """Note who has to keep its distance behind the ego.

    Whoever comes to be behind it at less than its distance is none yet, whether it merged or the ego did: plans go on
    staying clear of it, as they did before. Who was there at first sight is one at any distance.
    """
    find_those_behind(scene, memory)
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.follows:  # a light is nobody, and follows nobody
            known = memory[threat.user]
            if known.age > 0 and not known.follows:
                threat.follows = keeps_distance(scene, threat)


@compiled
def is_follower(scene, threat, established):
    """Does a road user drive behind the ego on its way, or is it behind on a way that has just parted from it?

    Beside the ego it is no follower, unless it has been one before.
    """
    distance = behind_by(scene.paths, scene.track, threat)
    entered, before = _entered(scene.paths, scene.track.path, scene.track.s)
    return _drives_behind(scene, threat, distance, established, entered, before)


@inner
def _drives_behind(scene, threat, distance, established, entered_ego, from_ego):
    """`is_follower` of who is at a `distance` behind; the ego headed for its lane at `entered_ego`, from `from_ego`."""
    paths, track = scene.paths, scene.track
    bodies = 0.0 if established else track.half_length + threat.half_length
    if distance > bodies:
        return True
    if from_ego < 0:
        return False
    entered_other, from_other = _entered(paths, threat.path, threat.s)
    return from_ego == from_other and track.s - entered_ego - (threat.s - entered_other) > bodies


@inner
def _entered(paths, path, s):
    """Where on a path a driver at `s` headed for its lane [m], and the lane before, -1 = none."""
    first = paths.reached[path, cell_of(s, paths.cells[path])]
    return first * CELL, paths.lane[path, first - 1] if first > 0 else -1


@inner
def is_behind(scene, i):
    """Does a road user follow the ego on any of its ways, on all of them, and at a safe distance on those (Lemma 2)?"""
    some, every, safe = False, True, True
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.user != i:
            continue
        some |= threat.follows
        every &= threat.follows
        safe = safe and (not threat.follows or keeps_distance(scene, threat))
    return some, some and every, safe


@inner
def keeps_distance(scene, threat):
    """Is a road user behind the ego at a safe distance (Lemma 2)? Where their ways have parted none is needed."""
    distance = threat.behind
    gap = distance - scene.track.half_length - threat.half_length
    return distance < 0.0 or gap >= distance_behind(threat, max(threat.v, 0.0), scene.track.v, scene.table.other)
