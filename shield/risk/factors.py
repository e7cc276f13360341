"""What makes an accident cost more: types of road users, roads and drivers ((10), (11), (14)-(17) of the paper)."""

from typing import Any, NamedTuple, Self

from rss_shield.shield.risk.ranges import NOT_NEGATIVE, POSITIVE, Range, checked, in_range, one_of

TYPES = ("car", "truck", "motorcycle", "cyclist", "pedestrian")
VISIBILITIES = ("below_50", "50_to_100", "100_to_200", "above_200")  # [m]
SLOPES = ("flat", "ordinary", "steep", "continuous")
CURVES = ("straight", "ordinary", "sharp")
DRY, WET = 0.9, 0.6  # friction mu of the paper


class Factors(NamedTuple):
    """Classes of road users, roads and drivers: losses of an accident relative to the reference class."""

    # Psi_T [1] of the road user's type
    car: float = 1.0
    truck: float = 1.443
    motorcycle: float = 0.40  # assumed
    cyclist: float = 0.30  # any vehicle without a motor; assumed
    pedestrian: float = 0.30  # assumed
    # Psi_delta [1] of visibility
    visibility_below_50: float = 1.0
    visibility_50_to_100: float = 1.0  # assumed
    visibility_100_to_200: float = 1.0  # assumed
    visibility_above_200: float = 1.457
    # Psi_rho,tau [1] of alignment: slope, curve
    flat_straight: float = 1.0
    flat_ordinary: float = 1.0  # assumed
    flat_sharp: float = 1.0  # assumed
    ordinary_straight: float = 1.0  # assumed
    ordinary_ordinary: float = 1.0  # assumed
    ordinary_sharp: float = 1.0  # assumed
    steep_straight: float = 1.0  # assumed
    steep_ordinary: float = 1.0  # assumed
    steep_sharp: float = 1.0  # assumed
    continuous_straight: float = 1.0  # assumed
    continuous_ordinary: float = 1.0  # assumed
    continuous_sharp: float = 1.0  # assumed
    # DR of a person who drives: their product, clipped to [0, 1]; 0 where nobody does
    driver: float = 0.5  # DR0 [1] of an ordinary driver; assumed
    driver_state: float = 1.0  # [1] physical and mental, by age; assumed
    driver_cognition: float = 1.0  # [1] by schooling; assumed
    driver_skill: float = 1.0  # [1] by years of driving; assumed
    driver_violations: float = 1.0  # [1] assumed

    @classmethod
    def validated(cls, **fields: Any) -> Self:
        """Build factors from keyword arguments, defaults for the others.

        Raises:
          ValueError: an unknown factor, or a value outside its range; the message names field, value and range.
        """
        ranges = {name: NOT_NEGATIVE if name.startswith("driver") else POSITIVE for name in cls._fields}
        return cls(**checked("risk factor", fields, cls._field_defaults, ranges))


def type_factor(kind: str, factors: Factors = Factors()) -> float:
    """Psi_T of a type of road user: one of `TYPES`."""
    return float(getattr(factors, one_of("kind", kind, TYPES)))


def friction_loss(friction: float) -> float:
    """phi(mu): loss by friction of the road [yuan] (14). A fit, not monotone: least at 0.465, a hump at 0.695."""
    mu = in_range("friction", friction, Range(0.0, strict=False, high=1.0))
    return ((-87290.0 * mu + 151900.0) * mu - 84630.0) * mu + 21780.0


def road_factor(
    factors: Factors = Factors(),
    friction: float = DRY,
    visibility: str = "above_200",
    slope: str = "flat",
    curve: str = "straight",
) -> float:
    """R [yuan] of the road where somebody is (10); the defaults are a dry, clear, flat, straight one.

    Args:
      factors: of the classes.
      friction: mu [1].
      visibility, slope, curve: one of `VISIBILITIES`, `SLOPES`, `CURVES`.

    Raises:
      ValueError: an unknown class, or a friction outside [0, 1].
    """
    seen = getattr(factors, f"visibility_{one_of('visibility', visibility, VISIBILITIES)}")
    alignment = getattr(factors, f"{one_of('slope', slope, SLOPES)}_{one_of('curve', curve, CURVES)}")
    return float(seen * alignment * friction_loss(friction))


def driver_factor(factors: Factors = Factors(), automated: bool = False) -> float:
    """DR [1] of who drives (11): 0 where no person does, else the product of the driver's classes in [0, 1]."""
    if automated:
        return 0.0
    product = factors.driver_state * factors.driver_cognition * factors.driver_skill * factors.driver_violations
    return min(max(factors.driver * product, 0.0), 1.0)
