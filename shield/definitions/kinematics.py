"""How far a car gets and when: the distances and times behind every RSS definition.

All functions are compiled, in SI units. Distances take floats or arrays that broadcast, times floats.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, compiled_for_arrays, larger, smaller

_TINY = 1e-300  # stands in for a positive divisor where the dividend is 0


@compiled_for_arrays
def speed_after_response(v, rho, a, v_cap):
    """Speed after accelerating at `a` for `rho`, never beyond `v_cap` [m/s]. A faster car keeps its speed."""
    return smaller(v + a * rho, larger(v_cap, v))


@compiled_for_arrays
def response_distance(v, rho, a, v_cap):
    """Distance covered while accelerating at `a` for `rho`, speed limited to `v_cap` [m]."""
    cut = v + a * rho - speed_after_response(v, rho, a, v_cap)  # speed that the cap takes away
    return v * rho + 0.5 * a * rho**2 - cut**2 / (2 * larger(_TINY, a))


@compiled_for_arrays
def stopping_distance(v, b):
    """Distance to rest from speed `v` >= 0 with braking `b` > 0 [m]."""
    return v**2 / (2 * b)


@compiled_for_arrays
def reach(v, rho, a, b, v_cap):
    """Distance covered by "accelerate at `a` for `rho`, then brake at `b` to rest" from v >= 0 [m]."""
    v_rho = speed_after_response(v, rho, a, v_cap)
    return response_distance(v, rho, a, v_cap) + stopping_distance(v_rho, b)


@compiled_for_arrays
def forward_reach(v, rho, a, b, v_cap=np.inf):
    """Largest displacement ever reached in the positive direction, for any sign of `v` [m].

    The car accelerates at `a` for `rho` and then brakes at `b`; if it moves backwards at first it
    counts only from where it started, never less than 0. On the lateral axis this is one car's
    approach e(w) of Lemma 4; on the longitudinal one it makes Lemma 2 and 3 total.
    """
    v_rho = speed_after_response(v, rho, a, v_cap)
    end = response_distance(v, rho, a, v_cap) + stopping_distance(larger(0.0, v_rho), b)
    return larger(0.0, end)


@compiled_for_arrays
def speed_envelope(tau, v, rho, a, b, v_cap=np.inf):
    """Fastest speed a driver may have `tau` after the danger threshold [m/s].

    Accelerate at `a` during `rho`, then brake at `b` to rest (first phase and second phase of the
    proper responses, Defs. 4 and 8), starting from `v` >= 0.
    """
    v_response = speed_after_response(v, smaller(tau, rho), a, v_cap)
    return larger(0.0, v_response - b * larger(0.0, tau - rho))


@compiled_for_arrays
def travel(tau, v, rho, a, b, v_cap=np.inf):
    """Distance covered `tau` after the danger threshold at the speeds of `speed_envelope` [m]."""
    v_rho = speed_after_response(v, rho, a, v_cap)
    t_brake = smaller(larger(0.0, tau - rho), v_rho / b)
    response = response_distance(v, smaller(tau, rho), a, v_cap)
    return response + v_rho * t_brake - 0.5 * b * t_brake**2


@compiled
def time_to_collision(gap, closing):
    """Time until a gap that shrinks at a constant speed is gone [s]: TTC; inf if it does not shrink."""
    return max(gap, 0.0) / closing if closing > 0.0 else np.inf


@compiled
def time_to_cover_accelerating(distance, v, a, v_cap):
    """Time to cover a distance while accelerating at `a` >= 0 up to `v_cap`, from v >= 0 [s]; inf if it never is."""
    if distance <= 0.0:
        return 0.0
    a = max(a, _TINY)
    v_top = max(v_cap, v)
    to_cap = (v_top**2 - v**2) / (2 * a)
    if distance <= to_cap:
        end_speed = np.sqrt(v**2 + 2 * a * distance)
        return 2 * distance / (v + end_speed) if a > _TINY or v > 0.0 else np.inf
    return (v_top - v) / a + (distance - to_cap) / v_top


@compiled
def time_to_cover_braking(distance, v, b):
    """Time to cover a distance while braking at `b` > 0 from v >= 0 [s]; inf if the car stops before."""
    if distance <= 0.0:
        return 0.0
    if distance > stopping_distance(v, b):
        return np.inf
    return 2 * distance / (v + np.sqrt(max(v**2 - 2 * b * distance, 0.0)))


@compiled
def time_to_cover(distance, v, rho, a, b, v_cap=np.inf):
    """Time to cover a distance under "accelerate at `a` for `rho`, then brake at `b`" [s]; inf if it stops before."""
    t = time_to_cover_accelerating(distance, v, a, v_cap)
    if t <= rho:
        return t
    rest = distance - response_distance(v, rho, a, v_cap)
    return rho + time_to_cover_braking(rest, speed_after_response(v, rho, a, v_cap), b)


@compiled
def time_to_stop(v, rho, a, b, v_cap=np.inf):
    """Time to rest under "accelerate at `a` for `rho`, then brake at `b`", from v >= 0 [s]."""
    return rho + speed_after_response(v, rho, a, v_cap) / b
