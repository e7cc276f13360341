"""Limits of the acceleration that hold at a junction whoever else is there."""

from rss_shield.shield._numba.compiled import compiled


@compiled
def limit(a, v, ego, dt):
    """Limits that always hold: never harder than the parameters say, never backwards [m/s^2]."""
    a = min(max(a, -ego.a_max_brake), ego.a_max_accel, max((ego.v_cap - v) / dt, 0.0))
    return max(a, -max(v, 0.0) / dt)
