"""Plans judged frame by frame, road user by road user: what `plans` means, without what makes it fast.

`plans.tail_conflict` and `plans.go_plan` look at several frames together and leave out who cannot be met yet; they find
the same. Nobody drives with these here: they are for reading, and for the tests that hold both against each other.
"""

from rss_shield.shield._numba.compiled import compiled, compiled_for_arrays
from rss_shield.shield.junctions.plans import LONGEST, NEVER, NEXT, REST, TAIL, follows, meets, step, throttle


@compiled
def is_met(scene, s, v, n, only, slack, resting):
    """Is the ego in the way of anybody on frame `n` of a plan, at arc length `s` with speed `v`?

    Who has become a follower by then is left alone from there on: it has to keep its own distance.

    Args:
      scene: `Scene`.
      only: index of the one road user who counts; negative = everybody.
      slack: the ego may be this far off [m].
      resting: it stays there for ever.
    """
    for k in range(len(scene.threats)):
        threat = scene.threats[k]
        if threat.ignored or threat.left <= n or 0 <= only != threat.user:
            continue
        if follows(scene, s, v, threat, n * scene.table.dt):
            threat.left = n
        elif meets(scene, s, slack, threat, n * scene.table.dt, resting):
            return True
    return False


@compiled
def stop_frame_by_frame(scene, s, v, n, brake, only, slack):
    """Frame on which somebody is met by an ego that brakes from frame `n` on; `NEVER` if nobody is."""
    while v > REST:
        if is_met(scene, s, v, n, only, slack, False):
            return n
        s, v = step(s, v, -brake, scene.table.dt)
        n += 1
    return n if is_met(scene, s, v, n, only, slack, True) else NEVER


@compiled_for_arrays
def go_frame_by_frame(scene, a, only, slack):
    """Frames of throttle, after one of `a`, from which the ego can brake to rest and meet nobody; -1 = none."""
    dt, threats = scene.table.dt, scene.threats
    s, v = step(scene.track.s, scene.track.v, a, dt)
    for k in range(len(threats)):
        threats[k].left = NEVER
    before = threats.left.copy()
    n = NEXT
    while n * dt < LONGEST:
        if is_met(scene, s, v, n, only, slack, False):
            return -1
        if n % TAIL == TAIL - 1:
            before[:] = threats.left
            if stop_frame_by_frame(scene, s, v, n, scene.table.ego.a_min_brake, only, slack) == NEVER:
                return n - 1
            threats.left[:] = before
        s, v = step(s, v, throttle(scene, s, v), dt)
        n += 1
    return -1
