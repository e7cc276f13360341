"""Brake below a time to collision (Hayward, "Near-miss determination", 1972).

    brake at a_min_brake  while  gap / (v - v_leader) < threshold

A gap that does not close is never answered, however small: a leader that brakes is noticed late. 1.5 s is the time
that separates serious from slight conflicts in traffic conflict studies (van der Horst, Hogema 1993).
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.definitions.kinematics import time_to_collision

SECONDS = 1.5  # the threshold where nobody says another [s]


@compiled
def acceleration_cap(v, leader, threshold, ego_params):
    """Largest acceleration that the rule permits [m/s^2]; inf where it has nothing to say.

    Args:
      v: speed of the ego [m/s].
      leader: `Leader`.
      threshold: [s].
      ego_params: `RSSParams` of the ego.
    """
    closing = v - leader.speed
    if closing > 0.0 and time_to_collision(leader.gap, closing) < threshold:
        return -ego_params.a_min_brake
    return np.inf
