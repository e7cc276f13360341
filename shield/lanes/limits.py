"""What a car may do while it owes nobody anything: the limits of the table, which the proofs rely on everywhere."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.lanes.memory import Bounds
from rss_shield.shield.lanes.pair import STANDSTILL, toward
from rss_shield.shield.sampling import slowest_in_danger


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

    Backwards its wheels cannot both keep it from moving sideways and turn it straight, so it turns farther on the way:
    it goes no faster than lets it come to rest inside the heading bound (`straight_enough`).
    """
    held = slowest_in_danger(ego.speed, params, dt)
    if ego.speed > STANDSTILL or ego.cos <= 0.0:
        return held
    slowest, b = -rules.reverse_speed, params.a_min_brake
    if rules.heading_bound < 1.0:
        # or less; in tight bends up to 0.1 % more, where its box is counted as turned by more than this bound anyway
        half_wheelbase = ego.half_length - rules.heading_bound * ego.half_width
        turned = max(abs(ego.sin), 1e-9) / rules.heading_bound
        room = min(ego.speed, 0.0) * dt - half_wheelbase * np.log(turned)  # way that is left after this frame
        if room <= 0.0:
            return held
        slowest = max(slowest, -min(room / dt, max(np.sqrt(2 * b * room) - 0.5 * b * dt, b * dt)))
    return min(max(ego.speed - params.a_max_accel * dt, slowest), held)
