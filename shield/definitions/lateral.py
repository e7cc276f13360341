"""Lateral safety: Defs. 5-8, Lemma 4. Lateral speeds are positive to the right."""

import numpy as np

from rss_shield.shield._numba.compiled import choose, compiled_for_arrays
from rss_shield.shield.anything import compiled_for_anything


@compiled_for_anything
def d_min_lateral(u_left, u_right, left, right, mode="no_credit"):
    """Smallest safe lateral gap between two cars side by side (Def. 6, Lemma 4) [m].

    Both may accelerate toward each other for their response times and then brake laterally.

    Four readings, from safe to literal. With equal response times
    "pair" <= "sup" <= "no_credit" and "pair" <= "paper".

      no_credit  a car that moves away gets no credit for it: it may stop at once. Sound for any
                 number of cars and any response times (holes H3, H22).
      sup        largest approach over the whole manoeuvre: exact for two cars alone.
      pair       approach at the end of the manoeuvre; exact for two cars with equal response times.
      paper      Lemma 4 as printed: a car that races away needs more room, not less.

    Args:
      u_left, u_right: lateral speeds, positive to the right [m/s], floats, lists or arrays that broadcast.
      left, right: `RSSParams` of the car on the left and on the right.
      mode: one of the four readings.

    Returns:
      Gap between the sides [m], at least the mean of the two `mu`.

    Raises:
      ValueError: unknown mode.
    """
    w_left, w_right = 1.0 * u_left, -1.0 * u_right  # speeds toward the other
    if mode == "no_credit":
        return d_min_no_credit(w_left, w_right, left, right)
    elif mode == "pair":
        return d_min_of_pair(w_left, w_right, left, right)
    mu = 0.5 * (left.mu + right.mu)
    if mode == "sup":
        return mu + _largest_approach(w_left, w_right, left, right)
    elif mode == "paper":
        return mu + np.maximum(_approach_as_printed(w_left, left) + _approach_as_printed(w_right, right), 0.0)
    else:
        raise ValueError("mode of d_min_lateral: expected 'no_credit', 'pair', 'sup' or 'paper'")


@compiled_for_arrays
def d_min_no_credit(w_1, w_2, car_1, car_2):
    """`d_min_lateral` in the reading "no_credit", by the speeds of both cars toward each other [m]."""
    return 0.5 * (car_1.mu + car_2.mu) + approach_no_credit(w_1, car_1) + approach_no_credit(w_2, car_2)


@compiled_for_arrays
def d_min_of_pair(w_1, w_2, car_1, car_2):
    """`d_min_lateral` in the reading "pair", by the speeds of both cars toward each other [m]."""
    approach = _approach_at_rest(w_1, car_1) + _approach_at_rest(w_2, car_2)
    return 0.5 * (car_1.mu + car_2.mu) + np.maximum(approach, 0.0)


@compiled_for_arrays
def approach_no_credit(w, car):
    """Farthest a car with speed `w` toward its neighbour can still come, receding not credited [m]."""
    return _approach_at_rest(np.maximum(w, 0.0), car)


@compiled_for_arrays
def _approach_at_rest(w, car):
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    return w * rho + 0.5 * a * rho**2 + np.maximum(w + a * rho, 0.0) ** 2 / (2 * b)


@compiled_for_arrays
def _approach_as_printed(w, car):
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    return w * rho + 0.5 * a * rho**2 + (w + a * rho) ** 2 / (2 * b)


@compiled_for_arrays
def _approach_at(t, w, car):
    """Displacement toward the neighbour after `t` of "accelerate, then brake"; a receding car halts at rho."""
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    t_response = np.minimum(t, rho)
    v = np.maximum(w + a * rho, 0.0)
    t_brake = np.minimum(np.maximum(t - rho, 0.0), v / b)
    return w * t_response + 0.5 * a * t_response**2 + v * t_brake - 0.5 * b * t_brake**2


@compiled_for_arrays
def _phase(t, w, car):
    """Speed and acceleration toward the neighbour just after `t`."""
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    v = w + a * rho
    braking = (t >= rho) & (v > b * (t - rho))
    speed = choose(t < rho, w + a * t, choose(braking, v - b * (t - rho), 0.0))
    acceleration = choose(t < rho, a, choose(braking, -b, 0.0))
    return speed, acceleration


@compiled_for_arrays
def _largest_approach(w_left, w_right, left, right):
    """Supremum over time of the sum of both approaches, never below 0 [m].

    The sum is piecewise quadratic, so it is largest at a breakpoint or at a vertex after one. A
    vertex that falls outside its piece is harmless: it is still a time of the manoeuvre.
    """
    rho_l, rho_r = left.response_time, right.response_time
    rest_l = rho_l + np.maximum(w_left + left.a_lat_max_accel * rho_l, 0.0) / left.a_lat_min_brake
    rest_r = rho_r + np.maximum(w_right + right.a_lat_max_accel * rho_r, 0.0) / right.a_lat_min_brake
    largest = 0.0 * (w_left + w_right)
    zero = 0.0 * largest  # gives every candidate the common shape
    for start in (zero, rho_l + zero, rho_r + zero, rest_l + zero, rest_r + zero):
        v_l, a_l = _phase(start, w_left, left)
        v_r, a_r = _phase(start, w_right, right)
        v, a = v_l + v_r, a_l + a_r
        vertex = start + choose((v > 0.0) & (a < 0.0), v / choose(a < 0.0, -a, 1.0), 0.0)
        for t in (start, vertex):
            largest = np.maximum(largest, _approach_at(t, w_left, left) + _approach_at(t, w_right, right))
    return largest


@compiled_for_anything
def mu_lateral_velocity(time, path, k, mu):
    """mu-lateral velocity at sample `k` of a recorded lateral path (Def. 5) [m/s]. Offline: it looks ahead.

    From the position l at sample `k`, let the path (linear between samples) first reach
    l - mu/2 or l + mu/2. If it comes back to l before that, or never gets there, the value is 0;
    otherwise the mean velocity on the way there.

    Args:
      time: `[T]` increasing [s].
      path: `[T]` lateral positions [m].
      k: index of the sample, 0 <= k < T.
      mu: width of the band [m], > 0.
    """
    start = path[k]
    half = 0.5 * mu
    for i in range(k, len(path) - 1):
        a, b = path[i] - start, path[i + 1] - start
        if i > k and a == 0.0:
            return 0.0
        if abs(b) >= half:
            if a * b < 0.0:
                return 0.0  # crossed the start on the way out
            out = half if b > 0.0 else -half
            t_out = time[i] + (out - a) / (b - a) * (time[i + 1] - time[i])
            return out / (t_out - time[k])
        if a * b < 0.0 or (a == 0.0 and b == 0.0):
            return 0.0  # back at the start, or staying there
    return 0.0
