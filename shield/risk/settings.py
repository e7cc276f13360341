"""Every number of the driving safety field, with its symbol, its unit and where it comes from.

The field is that of Chen, Wang, Li, Bai et al., Automotive Engineering 44(11), 2022, 1636-1646
(doi 10.19562/j.chinasae.qcgc.2022.11.002), "the paper" throughout this package. Part of its tables and rules is lost;
what stands in for it says "assumed" here and is listed in `ASSUMED`, so that a report can name it.
"""

from typing import Any, NamedTuple, Self

from rss_shield.shield.risk.factors import Factors, road_factor
from rss_shield.shield.risk.ranges import NOT_NEGATIVE, POSITIVE, Range, checked, index_of

KMH = 1 / 3.6  # [m/s]

ISO, RADIAL = range(2)
MODES = ("iso", "radial")
FROZEN, SAME, CAR = range(3)
STANDARDS = ("frozen", "same", "car")


class RiskSettings(NamedTuple):
    """Constants of the field, of its standard and of its classes. Passes straight into compiled code."""

    field_constant: float = 0.1  # K [1] scales every field alike; cancels in RDSI
    distance_exponent: float = 1.5  # k1 [1] decay of a road user's field
    marking_exponent: float = 1.0  # k2 [1] decay of a lane marking's field
    wave_speed: float = 160 * KMH  # k3 [m/s] of the kinetic field; the model ends there
    energy_weight: float = 0.1  # alpha [1] weight of the energy against its rate in the DSI
    mode: int = ISO  # which energy: index into `MODES`, "iso" as published or "radial", the exact one
    slowest_loss: float = 20 * KMH  # [m/s] speeds below count as this in the virtual mass; assumed
    fastest_loss: float = 120 * KMH  # [m/s] speeds above likewise; assumed
    nearest: float = 0.5  # [m] distances below count as this; assumed
    lateral_exponent: float = 0.0  # k4 [1] of the weight of what is beside the ego: 0 as the paper, 1 as Jing; assumed
    lane_width: float = 4.0  # [m] beyond half of it that weight begins; assumed
    farthest: float = 100.0  # [m] road users beyond are left out of a scene; assumed
    # the standard DSI* that risk is relative to
    standard: int = FROZEN  # which source it has: index into `STANDARDS`; assumed
    headway: float = 1.0  # THW [s]
    ttc: float = 4.0  # TTC [s]
    least_standard_gap: float = 5.0  # [m] of a slow ego, instead of speed times headway; assumed
    length_offset: float = 0.0  # [m] between centres at bumper contact, for headway and TTC; assumed
    reference_road: float = road_factor()  # R [yuan] of a dry, clear, flat, straight road
    reference_mass: float = 1500.0  # [kg] of the car that the standard "car" has; assumed
    # distances at which a lane change becomes unknown and known unsafe
    comfortable_response: float = 1.0  # tau [s]; assumed
    comfortable_brake: float = 3.0  # b [m/s^2]; assumed
    emergency_response: float = 0.5  # tau [s]; assumed
    emergency_brake: float = 7.0  # b [m/s^2]; assumed
    least_distance: float = 7.0  # d0 [m] between centres; assumed
    # energy of the ego on a lane marking, times alpha, in standards DSI*
    no_marking: float = 0.0  # eta [1]; assumed
    striped_marking: float = 0.02  # eta [1]; assumed
    solid_marking: float = 0.10  # eta [1]; assumed
    road_edge: float = 0.30  # eta [1] also of a barrier; assumed
    least_stay: float = 0.2  # [s] shorter stays in a class are noise; assumed

    @classmethod
    def validated(cls, **fields: Any) -> Self:
        """Build settings from keyword arguments, defaults for the others. `mode` and `standard` may be names.

        Raises:
          ValueError: an unknown field, or a value outside its range; the message names field, value and range.
        """
        names = {
            name: index_of(name, fields.pop(name), known)
            for name, known in (("mode", MODES), ("standard", STANDARDS))
            if name in fields
        }
        settings = cls(**checked("risk setting", fields, cls._field_defaults, _RANGES), **names)
        for low, high in _ORDERS:
            if getattr(settings, low) > getattr(settings, high):
                raise ValueError(
                    f"{low} = {getattr(settings, low):g} is out of range: "
                    f"expected at most {high} = {getattr(settings, high):g}"
                )
        return settings


_RANGES = dict.fromkeys(RiskSettings._fields, POSITIVE) | {
    "distance_exponent": Range(1.0),  # at 1 the energy is infinite
    "energy_weight": Range(0.0, high=1.0),
    "slowest_loss": Range(13.1 * KMH, strict=False),  # below 13.05 km/h the loss would be negative
    "lateral_exponent": NOT_NEGATIVE,
    "length_offset": NOT_NEGATIVE,
    "least_distance": NOT_NEGATIVE,
    "comfortable_response": NOT_NEGATIVE,
    "emergency_response": NOT_NEGATIVE,
    "no_marking": NOT_NEGATIVE,
    "striped_marking": NOT_NEGATIVE,
    "solid_marking": NOT_NEGATIVE,
    "road_edge": NOT_NEGATIVE,
    "least_stay": NOT_NEGATIVE,
}

_ORDERS = (
    ("slowest_loss", "fastest_loss"),
    ("emergency_response", "comfortable_response"),
    ("comfortable_brake", "emergency_brake"),
)

_KNOWN_FACTORS = frozenset({"car", "truck", "visibility_below_50", "visibility_above_200", "flat_straight"})
_KNOWN_SETTINGS = frozenset(
    {
        *("field_constant", "distance_exponent", "marking_exponent", "wave_speed", "energy_weight", "mode"),
        *("headway", "ttc", "reference_road"),
    }
)
ASSUMED = (frozenset(RiskSettings._fields) - _KNOWN_SETTINGS) | (frozenset(Factors._fields) - _KNOWN_FACTORS)


def assumed(*tables: NamedTuple) -> dict[str, float]:
    """The values in force that the literature has lost, by name, for reports."""
    return {name: value for table in tables for name, value in table._asdict().items() if name in ASSUMED}
