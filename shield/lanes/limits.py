"""What a car may do while it owes nobody anything: the limits of the table, which the proofs rely on everywhere."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.lanes.memory import Bounds
from rss_shield.shield.lanes.pair import STANDSTILL, toward
from rss_shield.shield.sampling import slowest_in_danger

_CROOKED = 1.2  # times the heading bound: a car turned farther than this does not back up


@compiled
def always_on(ego, params, rules, dt):
    """Limits that hold even where nobody is in danger (conditions C1, C1y of the sampled proof)."""
    if not rules.limits:
        return Bounds(-np.inf, np.inf, np.inf, np.inf, np.inf, np.inf, min(ego.speed, 0.0))
    cap = max((params.v_cap - ego.speed) / dt, 0.0)
    growth = params.a_lat_max_accel * dt
    left, right = max(toward(-1.0, ego), 0.0) + growth, max(toward(1.0, ego), 0.0) + growth
    slowest = _slowest(ego, params, rules, dt)
    return Bounds(-params.a_max_brake, min(params.a_max_accel, cap), left, right, left, right, slowest)


@inner
def _slowest(ego, params, rules, dt):
    """Least speed after this frame where nobody is behind [m/s]: one that stands may back up slowly, if it is straight.

    Backwards its wheels cannot both keep it from moving sideways and turn it straight.
    """
    held = slowest_in_danger(ego.speed, params, dt)
    if ego.speed > STANDSTILL or ego.cos <= 0.0 or abs(ego.sin) > _CROOKED * rules.heading_bound:
        return held
    return min(max(ego.speed - params.a_max_accel * dt, -rules.reverse_speed), held)
