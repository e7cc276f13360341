"""What whole frames cost: margins and roundings that keep continuous definitions sound when a simulator samples.

Conditions by their names in `docs/guarantee.md`: C2 (response times are whole frames), C5 (explicit Euler, the last
partial step of braking).
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, compiled_for_arrays
from rss_shield.shield.definitions.kinematics import forward_reach
from rss_shield.shield.definitions.lateral import approach_no_credit
from rss_shield.shield.definitions.right_of_way import Approach


@compiled_for_arrays
def frames_for(duration, dt):
    """A duration rounded up to whole frames of length `dt`, in frames (condition C2)."""
    return np.ceil(duration / dt - 1e-9)


@compiled_for_arrays
def euler_margin(closing, b, dt):
    """What explicit Euler needs on top of a continuous longitudinal distance [m] (condition C5).

    The position advances with the speed at the start of the frame, which adds `v dt/2` to each
    stopping distance; the last partial braking step adds at most `b dt^2/8`.

    Args:
      closing: speed toward the other, less the speed at which a leader moves away [m/s]. A faster
        leader would make the margin negative; no credit is taken for it.
      b: braking of the car that must stop [m/s^2].
      dt: length of a frame [s].
    """
    return np.maximum(closing, 0.0) * dt / 2 + b * dt**2 / 8


@compiled
def reach_from_rest(params, b, dt):
    """How far a standing car that starts may get until it rests again, sampled every `dt` (Def. 2) [m].

    It speeds up for its response time and then brakes at `b`.
    """
    way = forward_reach(0.0, params.response_time, params.a_max_accel, b, params.v_cap)
    return way + euler_margin(0.0, b, dt)


@compiled_for_arrays
def lateral_euler_margin(w, car, dt):
    """What frames of length `dt` need on top of one car's continuous lateral approach [m] (condition C5).

    The lateral speed of a frame is the one chosen at its start: `w dt/2` for the sampled braking,
    `b dt^2/8` for its last partial step, `a rho dt` because the first frame may already run at the
    speed reached at its end.
    """
    w = np.maximum(w, 0.0)
    frame_start = car.a_lat_max_accel * car.response_time * dt
    return w * dt / 2 + car.a_lat_min_brake * dt**2 / 8 + frame_start


@compiled
def sampled_approach(w, car, dt):
    """Farthest a compliant car may come, sampled every `dt`, from speed `w` toward its neighbour [m]."""
    w = max(w, 0.0)
    return approach_no_credit(w, car) + sampling_margin(w, car, dt)


@compiled
def sampling_margin(w, car, dt):
    """What sampling every `dt` adds to that, w >= 0 [m]."""
    return w * dt / 2 + car.a_lat_min_brake * dt**2 / 8


@compiled
def with_euler_margin(car, params, dt):
    """A car with its front moved on by what explicit Euler needs (condition C5); its rear stays where it is."""
    margin = euler_margin(car.v, params.a_min_brake, dt)
    return Approach(car.enter - margin, car.leave, car.length + margin, car.v, car.priority)


@compiled
def slowest_in_danger(v, params, dt):
    """Least speed after a frame of a car that may not back up, negative while it still rolls back [m/s]."""
    return min(v + params.a_min_brake * dt, 0.0)
