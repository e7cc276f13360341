"""An older rule for contacts with pedestrians, for scores only: was the car slower than the pedestrian on average?

The version of the paper that the article on RSS describes exonerates a car that, from the moment at which it sees the
pedestrian, does not accelerate during its response time, then brakes until the contact or until it stands, and is
slower than the pedestrian on average meanwhile. It is no rule of safety, and no shield follows it.
"""

import numpy as np
from numpy.typing import ArrayLike

_TOLERANCE = 1e-6


def is_exonerated(
    speed: ArrayLike, acceleration: ArrayLike, dt: float, response_time: float, a_min_brake: float, v_pedestrian: float
) -> bool:
    """Does the older rule exonerate the car?

    Args:
      speed: `[T]` of the car, T >= 1, on each frame from exposure to contact or rest [m/s].
      acceleration: `[T]` that it executes on them [m/s^2].
      dt: length of a frame [s].
      response_time, a_min_brake: of the driver [s], [m/s^2].
      v_pedestrian: speed of the pedestrian [m/s].

    Raises:
      ValueError: no frame, or arrays of different lengths.
    """
    v, a = np.asarray(speed, float), np.asarray(acceleration, float)
    if v.ndim != 1 or len(v) == 0 or v.shape != a.shape:
        raise ValueError(f"speed and acceleration have shapes {v.shape} and {a.shape}: expected one, [T] with T >= 1")
    first = int(np.ceil(response_time / dt - 1e-9))
    stands = v + a * dt <= _TOLERANCE
    brakes = (a[first:] <= -a_min_brake + _TOLERANCE) | stands[first:]
    return bool((a[:first] <= _TOLERANCE).all() and brakes.all() and v.mean() < v_pedestrian)
