"""Known safe, unknown, known unsafe: the areas of SOTIF (ISO 21448) that a risk falls into (table 2 of the paper)."""

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.risk.settings import RiskSettings

KNOWN_SAFE, UNKNOWN, KNOWN_UNSAFE = range(3)  # area 1; areas 3 and 4; area 2
STATES = ("known_safe", "unknown", "known_unsafe")


@compiled
def classify(rdsi, lower, upper):
    """Class of a risk between its thresholds RDSI1*, RDSI2*; both belong to the unknown."""
    if rdsi > upper:
        return KNOWN_UNSAFE
    return UNKNOWN if rdsi >= lower else KNOWN_SAFE


def steady(states: np.ndarray, dt: float, least_stay: float = RiskSettings().least_stay) -> np.ndarray:
    """Classes `[T]`, sampled every `dt` [s], in which stays shorter than `least_stay` [s] are taken for noise.

    They go to the class before them, or after them at the start; a class lasts from its first sample to the next's.
    """
    states = np.asarray(states)
    starts = np.flatnonzero(np.r_[True, states[1:] != states[:-1]]) if states.size else np.zeros(0, int)
    lengths = np.diff(np.r_[starts, states.size])
    kept = lengths * dt >= least_stay - 1e-9
    if not kept.any():
        return states.copy()
    last = np.maximum.accumulate(np.where(kept, np.arange(kept.size), -1))
    last[last < 0] = np.flatnonzero(kept)[0]
    return np.repeat(states[starts[last]], lengths)
