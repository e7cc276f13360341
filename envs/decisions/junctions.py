"""Would the shield answer a meta-action where roads cross, if everybody goes on along its way at the speed it has?

What the others may do is in the plans already, which hold for anything inside the table. So only where they are is
played ahead, along every way that each may take, and the ego along its own; and then it is asked whether what the ego's
driver wants on that frame leaves it a plan. After the first frame, every third one and the last one of a decision are
looked at: who has lost all plans hardly ever finds one within two frames.
"""

from rss_shield.envs.decisions.foresight import KP_ACCELERATION
from rss_shield.shield._numba.compiled import apart, inner
from rss_shield.shield.junctions.controller import junction_frame, leaves_plan
from rss_shield.shield.junctions.limits import limit
from rss_shield.shield.junctions.plans import Scene, Track

_STRIDE = 3  # frames from one look to the next


@apart
def first_override(scene, samples, memory, plan, speed, frames, entry, at_line, which):
    """Frame of the coming decision on which the shield would first change the ego's acceleration, `frames` = never.

    Args:
      scene: `Scene` now; its threats are moved.
      samples: `[N]` SAMPLE of all road users.
      memory: `[N]` CROSSING of them, changed in place.
      plan: PLAN, or any record with its fields, changed in place.
      speed: that the ego's driver keeps [m/s].
      frames: of a decision.
      entry, at_line, which: as in `shield.junctions.controller.junction_frame`.
    """
    track, dt = scene.track, scene.table.dt
    wish = KP_ACCELERATION * (speed - track.v)
    if junction_frame(scene, samples, memory, plan, wish, entry, at_line, which, True, 0.0).overridden:
        return 0
    for frame in range(frames):
        here = Scene(scene.paths, track, scene.threats, scene.table, scene.drift)
        wish = KP_ACCELERATION * (speed - track.v)
        looks = frame > 0 and (frame % _STRIDE == 0 or frame == frames - 1)
        if looks and not leaves_plan(here, samples, memory, wish, entry, at_line, which):
            return frame
        for k in range(len(scene.threats)):
            _go_on(scene.threats[k], dt)
        track = _driven(track, limit(wish, track.v, scene.table.ego, dt), dt)
    return frames


@inner
def _driven(track, a, dt):
    """One frame along the path, which a change of lane comes closer to its end by."""
    s, v = track.s + track.v * dt, max(track.v + a * dt, 0.0)
    after = max(track.leaves_after - dt, 0.0)
    return Track(track.path, s, v, track.half_length, track.beside, track.shift, after, track.leaves_at)


@inner
def _go_on(threat, dt):
    """One frame more of the same; a wreck rolls to rest with a time constant of 1 s."""
    if threat.path < 0:
        return
    threat.s += threat.v * dt
    threat.red_for = max(threat.red_for - dt, 0.0)
    if threat.wreck:
        threat.v -= threat.v * dt
