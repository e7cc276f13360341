"""Where a road user may be on its way: between braking at `a_max_brake` and accelerating at `a_max_accel`."""

from rss_shield.shield._numba.compiled import compiled, inner, records
from rss_shield.shield.definitions.kinematics import (
    response_distance,
    travel,
)

STANDING = 0.5  # slower than this is standing: highway-env's drivers creep [m/s]
SHORT_CUT = 1.0  # a car that cuts the corners of its path gains or loses at most this ...
SHORT_CUT_SHARE = 0.05  # ... and at most this share of the distance driven
_REVERSE = 1.0  # a car that reverses may go on for this long [s]

# One way that a road user may take. SI units.
THREAT = records(
    [
        ("user", "i8"),  # index of the road user, -1 = nobody: a red light
        ("path", "i8"),  # row in `Paths`; -1 = an obstacle off all paths
        ("s", "f8"),  # arc length of the centre on that path
        ("v", "f8"),  # speed, negative in reverse
        ("cap", "f8"),  # speed above which it does not accelerate
        ("half_length", "f8"),
        ("wreck", "?"),  # has crashed: it may stop on the spot
        ("priority", "i8"),  # +1: the ego has the right of way over it, -1: the other way round
        ("stands_for", "f8"),  # it is counted on to stand for this long still [s]; 0 = it is not
        ("red_for", "f8"),  # it is counted on to wait at a light for this long [s]; 0 = it is not
        ("line", "f8"),  # and until then its centre stays behind this arc length [m]
        ("behind", "f8"),  # how far it is behind the ego on its way, -inf = it is not on that [m]
        ("follows", "?"),  # drives behind the ego on its way
        ("ignored", "?"),  # behind the ego on its lane, or obliged and able to give way
        ("left_out", "?"),  # the ego's plans are not checked against it: see `shield.junctions.examined`
        ("stops_here", "?"),  # who is behind it on its approach is not looked at
        ("left", "i8"),  # frame of the plan from which on it is a follower
        ("free_until", "i8"),  # frame of a plan before which it cannot reach the ego's path ahead
        ("joins", "i8"),  # cell of the ego's path from which on it may be on the ego's lane
        ("from_cell", "i8"),  # cells of the ego's path in the way of an obstacle
        ("to_cell", "i8"),
        ("from_cell_beside", "i8"),  # likewise of the path of the lane that it is leaving
        ("to_cell_beside", "i8"),
        ("arrives", "f8"),  # it is in these cells from then on only [s]
        ("yields", "?"),  # it walks around whoever has come to rest there
    ]
)


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
    if threat.stands_for > 0.0:
        creeps, t = min(t, threat.stands_for), max(t - threat.stands_for, 0.0)
        driven = STANDING * creeps + response_distance(STANDING, t, other.a_max_accel, threat.cap)
    else:
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
    return min(SHORT_CUT_SHARE * driven, SHORT_CUT)


@inner
def fastest(threat, t, other):
    """Largest speed it can have `t` from now [m/s]."""
    if threat.stands_for > 0.0:
        return max(STANDING, min(STANDING + other.a_max_accel * max(t - threat.stands_for, 0.0), threat.cap))
    return max(threat.v, min(threat.v + other.a_max_accel * t, threat.cap), 0.0)
