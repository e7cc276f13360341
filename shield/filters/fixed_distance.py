"""Brake below a fixed distance, as the shields of several public repositories do.

    brake at a_min_brake  while  gap < threshold

Speeds do not matter to it: it brakes for a leader that drives away, and too late for one that stands at high speed.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled

METRES = 45.0  # the threshold where nobody says another [m]


@compiled
def acceleration_cap(leader, threshold, ego_params):
    """Largest acceleration that the rule permits [m/s^2]; inf where it has nothing to say.

    Args:
      leader: `Leader`.
      threshold: [m].
      ego_params: `RSSParams` of the ego.
    """
    return -ego_params.a_min_brake if leader.gap < threshold else np.inf
