"""The danger threshold (Defs. 3, 7, 9, 10) and the proper response to danger (Defs. 4, 8)."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.definitions.kinematics import speed_envelope

NEITHER, LON, LAT = 0, 1, 2  # axes that were safe at the last safe sample; LON | LAT is both
AXES = {0: "inherited", LON: "longitudinal", LAT: "lateral", LON | LAT: "both"}
REAR, FRONT, CORRECT, WRONG = 0, 1, 2, 3  # longitudinal roles of the ego; the last two where cars drive at each other


@compiled
def step_threshold(axes, since, safe_lon, safe_lat):
    """Danger threshold of one pair, one sample on (Defs. 3, 7, 9, 10).

    A sample is dangerous iff both axes are unsafe; the threshold t_b is the last sample that was
    not, and the axes that were safe there are the ones to respond on.

    Args:
      axes, since: as in `MEMORY`, after the previous sample.
      safe_lon, safe_lat: is each axis safe now?

    Returns:
      (axes, since) after this sample. Dangerous iff since > 0.
    """
    if safe_lon or safe_lat:
        return (LON if safe_lon else NEITHER) | (LAT if safe_lat else NEITHER), 0
    return axes, since + 1


# ---------------------------------------------------------------- longitudinal: Def. 4


@compiled
def braking_owed(role, params):
    """Braking asked of a driver after the response time [m/s^2]; 0 for the car in front."""
    if role == FRONT:
        return 0.0
    return params.a_min_brake_correct if role == CORRECT else params.a_min_brake


@compiled
def longitudinal_response(role, tau, v, params):
    """Accelerations a driver may choose in danger, in the own driving direction (Def. 4).

    After standstill the car holds, and one that backs up does not drive forward: reversing out of one danger must not
    make another (hole H12), so it has a rule of its own (`may_back_up`).

    Args:
      role: REAR, FRONT, CORRECT or WRONG at the threshold.
      tau: time since the threshold [s].
      v: own speed [m/s], negative in reverse.
      params: `RSSParams` of the driver.

    Returns:
      (lower, upper) [m/s^2]; upper is inf where nothing bounds it.
    """
    if role == FRONT:
        return -params.a_max_brake, np.inf
    if tau < params.response_time:
        return -params.a_max_brake, params.a_max_accel
    if v <= 0.0:
        return 0.0, 0.0
    return -params.a_max_brake, -braking_owed(role, params)


# ---------------------------------------------------------------- lateral: Def. 8


@compiled
def lateral_response(side, tau, u, params):
    """Lateral proper response as published, two-sided, read directionally (Def. 8, hole H11).

    For comparison with the literature; the shield uses `lateral_speed_limit`.

    Args:
      side: +1 the driver is the right car of the pair, -1 the left one.
      tau: time since the threshold [s].
      u: own mu-lateral velocity, positive to the right [m/s].
      params: `RSSParams` of the driver.

    Returns:
      (a_lower, a_upper, u_lower, u_upper): bounds on lateral acceleration [m/s^2] and velocity [m/s].
    """
    if tau < params.response_time:
        return -params.a_lat_max_accel, params.a_lat_max_accel, -np.inf, np.inf
    moves_toward = side * u < 0.0
    if side < 0.0:
        if moves_toward:
            return -np.inf, -params.a_lat_min_brake, -np.inf, np.inf
        return -np.inf, np.inf, -np.inf, 0.0
    if moves_toward:
        return params.a_lat_min_brake, np.inf, -np.inf, np.inf
    return -np.inf, np.inf, 0.0, np.inf


@compiled
def lateral_speed_limit(frame, w_threshold, params, dt):
    """Fastest a driver may move toward the neighbour during a frame (one-sided Def. 8, hole H22) [m/s].

    w_b + a rho during the response time, then falling at `a_lat_min_brake` to 0 for good. Any set of
    neighbours can be obeyed at once, because moving away or stopping is never forbidden.

    Args:
      frame: frames since the threshold; 0 is the frame that starts at it.
      w_threshold: speed toward the neighbour at the threshold, >= 0 [m/s].
      params: `RSSParams` of the driver, response time in whole frames.
      dt: length of a frame [s].
    """
    tau = frame * dt
    if tau < params.response_time - 1e-9:
        tau = min(tau + dt, params.response_time)
    return speed_envelope(tau, w_threshold, params.response_time, params.a_lat_max_accel, params.a_lat_min_brake)
