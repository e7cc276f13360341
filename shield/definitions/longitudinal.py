"""Longitudinal safety: Defs. 1-4, Lemmas 2 and 3."""

import numpy as np

from rss_shield.shield._numba.compiled import choose, compiled_for_arrays
from rss_shield.shield.anything import compiled_for_anything, compiled_for_numbers
from rss_shield.shield.definitions.kinematics import (
    forward_reach,
    reach,
    response_distance,
    speed_after_response,
    stopping_distance,
)


@compiled_for_anything
def d_min_same_direction(v_rear, v_front, rear, front, mode="exact"):
    """Smallest safe gap to a car ahead driving the same way (Def. 1, Lemma 2) [m].

    Assumes the worst: the rear car accelerates at `a_max_accel` for its response time and then
    brakes at `a_min_brake`, while the front car brakes at its `a_max_brake` at once.

    Lemma 2 compares where the two come to rest. That is exact unless the rear car brakes harder
    than the front one: then they may be closest in the middle of braking (Koopman, Osyk, Weast,
    arXiv:1911.01207).

    Args:
      v_rear, v_front: speeds >= 0 [m/s], floats, lists or arrays that broadcast.
      rear, front: `RSSParams` of each driver.
      mode: "exact" (default) or "lemma2", the printed closed form.

    Returns:
      Bumper-to-bumper gap [m], at least the rear car's `standstill_gap`.

    Raises:
      ValueError: unknown mode.
    """
    if mode == "exact":
        return d_min_following(v_rear, v_front, rear, front)
    elif mode == "lemma2":
        return _d_min_lemma_2(v_rear, v_front, rear, front)
    else:
        raise ValueError("mode of d_min_same_direction: expected 'exact' or 'lemma2'")


@compiled_for_arrays
def d_min_following(v_rear, v_front, rear, front):
    """`d_min_same_direction` in the mode "exact" [m]."""
    d = _d_min_lemma_2(v_rear, v_front, rear, front)
    if rear.a_min_brake > front.a_max_brake:
        d = np.maximum(d, _closest_while_braking(v_rear, v_front, rear, front) + rear.standstill_gap)
    return d


@compiled_for_arrays
def _d_min_lemma_2(v_rear, v_front, rear, front):
    d_rear = reach(v_rear, rear.response_time, rear.a_max_accel, rear.a_min_brake, rear.v_cap)
    return np.maximum(d_rear - stopping_distance(v_front, front.a_max_brake), 0.0) + rear.standstill_gap


@compiled_for_arrays
def _closest_while_braking(v_rear, v_front, rear, front):
    """Room needed at the moment both have the same speed; -inf where they never have while rolling (hole H1)."""
    rho = rear.response_time
    b_rear, b_front = rear.a_min_brake, front.a_max_brake
    v_r = speed_after_response(v_rear, rho, rear.a_max_accel, rear.v_cap)
    v_f = v_front - b_front * rho
    closing = v_r - v_f
    both_roll = (closing > 0.0) & (closing * b_front <= v_f * (b_rear - b_front))
    d_response = response_distance(v_rear, rho, rear.a_max_accel, rear.v_cap)
    d_front = v_front * rho - 0.5 * b_front * rho**2
    needed = d_response - d_front + closing**2 / (2 * (b_rear - b_front))
    return choose(both_roll, needed, -np.inf)


@compiled_for_anything
def d_min_opposite_direction(v_correct, v_wrong, correct, wrong):
    """Smallest safe gap between two cars driving toward each other (Def. 2, Lemma 3) [m].

    Both may speed up for their response times; then the car in its own lane brakes at
    `a_min_brake_correct` and the wrong-way car at `a_min_brake`.

    Args:
      v_correct, v_wrong: speeds as magnitudes >= 0 [m/s], floats, lists or arrays that broadcast.
      correct, wrong: `RSSParams` of the car in its own lane and of the other one.

    Returns:
      Bumper-to-bumper gap [m], at least the larger `standstill_gap`.
    """
    d_correct = reach(v_correct, correct.response_time, correct.a_max_accel, correct.a_min_brake_correct, correct.v_cap)
    d_wrong = reach(v_wrong, wrong.response_time, wrong.a_max_accel, wrong.a_min_brake, wrong.v_cap)
    return d_correct + d_wrong + np.maximum(correct.standstill_gap, wrong.standstill_gap)


@compiled_for_numbers
def d_min_longitudinal(v_rear, v_front, facing, rear, front, b_rear, b_front):
    """Smallest safe gap for any signs of speed (floats only) [m].

    Both speeds are measured from the rear car toward the front one. Forward and forward on the same
    heading is Lemma 2; in every other combination each car is granted the largest displacement it
    can reach toward the other, which is Lemma 3 when the two drive at each other.

    Args:
      v_rear, v_front: signed speeds [m/s].
      facing: the cars point in opposite directions: a standing one may start toward the other.
      rear, front: `RSSParams` of each driver.
      b_rear, b_front: braking owed in a head-on pair [m/s^2]: `a_min_brake_correct` for a car in
        its own lane, else `a_min_brake`.
    """
    if not facing and v_rear >= 0.0 and v_front >= 0.0:
        return d_min_following(v_rear, v_front, rear, front)
    d_rear = forward_reach(v_rear, rear.response_time, rear.a_max_accel, b_rear, rear.v_cap)
    d_front = forward_reach(-v_front, front.response_time, front.a_max_accel, b_front, front.v_cap)
    return d_rear + d_front + np.maximum(rear.standstill_gap, front.standstill_gap)


@compiled_for_arrays
def is_safe_longitudinally(gap, d_min):
    """Def. 1/2 as a predicate on signed bumper-to-bumper gaps: overlapping cars are never safe (hole H4)."""
    return (gap > 0.0) & (gap >= d_min)
