"""Lane markings as sources of risk ((A2) and (2) of the paper).

Their weights LT are lost, and so is the proof of their form. They are set by what they come to: eta, the part of the
standard DSI* that the energy of an ego on the line makes up.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, records
from rss_shield.shield.risk.ranges import NOT_NEGATIVE, POSITIVE, in_range, one_of
from rss_shield.shield.risk.settings import RiskSettings

MARKINGS = ("none", "striped", "solid", "edge")
_ETA = dict(none="no_marking", striped="striped_marking", solid="solid_marking", edge="road_edge")

MARKING = records(
    [
        ("eta", "f8"),  # [1] weight
        ("distance", "f8"),  # r [m] from the ego's centre, >= 0
        ("approach", "f8"),  # w [m/s] toward the marking, negative when leaving
        ("lane_width", "f8"),  # D [m]
    ]
)


class MarkingRisk(NamedTuple):
    """What a marking does to the ego, in parts of the standard DSI* of any source."""

    energy: float  # SPE_L / DSI*
    force: float  # -dSPE_L/dr / DSI* [1/m]
    rate: float  # dSPE_L/dt / DSI*
    rdsi: float  # RDSI_L, never negative


def weight_of(kind: str, settings: RiskSettings = RiskSettings()) -> float:
    """eta of a type of marking: one of `MARKINGS`."""
    return float(getattr(settings, _ETA[one_of("marking", kind, MARKINGS)]))


def marking(
    kind: str, distance: float, approach: float, lane_width: float, settings: RiskSettings = RiskSettings()
) -> np.ndarray:
    """`[1]` `MARKING` record, see there.

    Raises:
      ValueError: an unknown kind, or a value outside its range.
    """
    if not np.isfinite(approach):
        raise ValueError(f"approach = {approach!r}: expected a finite number")
    row = (
        weight_of(kind, settings),
        in_range("distance", distance, NOT_NEGATIVE),
        float(approach),
        in_range("lane_width", lane_width, POSITIVE),
    )
    return np.array([row], MARKING)


@compiled
def marking_risk(line, settings):
    """`MarkingRisk` of one marking; it ends half a lane away.

    Args:
      line: `MARKING` record.
      settings: `RiskSettings`.
    """
    u = 1.0 - 2.0 * line.distance / line.lane_width
    if u <= 0.0:
        return MarkingRisk(0.0, 0.0, 0.0, 0.0)
    k2, alpha = settings.marking_exponent, settings.energy_weight
    energy = line.eta / alpha * u ** (k2 + 1.0)
    force = line.eta / alpha * (k2 + 1.0) * u**k2 * (2.0 / line.lane_width)
    rate = force * line.approach
    return MarkingRisk(energy, force, rate, max(alpha * energy + (1.0 - alpha) * rate, 0.0))
