"""Risk of a run: how long and how deep it is in the unknown band ((8) of the paper).

The paper's text says the integral of RDSI, its numbers are those of the area above the lower threshold; both are here.
"""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.shield.risk.ranges import one_of
from rss_shield.shield.risk.settings import RiskSettings

BAND_MODES = ("integral", "excess")


class BandRisk(NamedTuple):
    """Stays in the band between both thresholds."""

    spans: np.ndarray  # `[K, 2]` when each begins and ends [s]
    risks: np.ndarray  # `[K]` risk of each [s]
    total: float  # [s]
    mode: str  # which risk: one of `BAND_MODES`


def band_risk(
    times: Any,
    rdsi: Any,
    lower: Any,
    upper: Any,
    mode: str = "integral",
    least_stay: float = RiskSettings().least_stay,
) -> BandRisk:
    """Stays inside the band and their risk; all is linear between samples, so crossings are cut there.

    Args:
      times: `[T]` [s], ascending.
      rdsi: `[T]`.
      lower, upper: thresholds, floats or `[T]`.
      mode: "integral" of RDSI, as the paper's text says, or "excess", of what is above the lower threshold.
      least_stay: shorter stays do not count [s].

    Raises:
      ValueError: an unknown mode, or times that do not ascend.
    """
    one_of("mode", mode, BAND_MODES)
    times, rdsi = np.asarray(times, float), np.asarray(rdsi, float)
    if not (np.diff(times) > 0.0).all():
        raise ValueError("times: expected ascending values")
    above, below = rdsi - lower, upper - rdsi
    start_up, end_up = _positive_part(above)
    start_down, end_down = _positive_part(below)
    start, end = np.maximum(start_up, start_down), np.minimum(end_up, end_down)
    inside = np.flatnonzero(end > start)
    start, end = start[inside], end[inside]
    height = above if mode == "excess" else rdsi
    first, rise, step = height[inside], np.diff(height)[inside], np.diff(times)[inside]
    areas = step * (end - start) * (first + rise * 0.5 * (start + end))
    joined = (np.diff(inside) == 1) & (end[:-1] == 1.0) & (start[1:] == 0.0)
    begins = np.r_[True, ~joined] if inside.size else np.zeros(0, bool)
    ends = np.r_[~joined, True] if inside.size else np.zeros(0, bool)
    spans = np.column_stack([(times[inside] + step * start)[begins], (times[inside] + step * end)[ends]])
    risks = np.add.reduceat(areas, np.flatnonzero(begins)) if inside.size else np.zeros(0)
    kept = spans[:, 1] - spans[:, 0] >= least_stay - 1e-9
    return BandRisk(spans[kept], risks[kept], float(risks[kept].sum()), mode)


def _positive_part(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where between two samples `[T - 1]` a series `[T]` is not negative: from one fraction of the step to another."""
    first, second = values[:-1], values[1:]
    rises, falls = (first < 0.0) & (second >= 0.0), (first >= 0.0) & (second < 0.0)
    crossing = np.divide(first, first - second, out=np.zeros_like(first), where=rises | falls)
    start = np.where(rises, crossing, 0.0)
    end = np.where((first < 0.0) & (second < 0.0), -1.0, np.where(falls, crossing, 1.0))
    return start, end
