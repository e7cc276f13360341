"""Field, force and energy between the ego and one other road user (Section 3 of the paper and its appendix A).

Whatever stands or drives is the source of a field; another road user in it feels a force and has a safety potential
energy. Only ratios of these mean anything: their unit is arbitrary.
"""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, records
from rss_shield.shield.risk.factors import Factors, type_factor
from rss_shield.shield.risk.ranges import NOT_NEGATIVE, POSITIVE, in_range
from rss_shield.shield.risk.settings import KMH, RADIAL, RiskSettings

# Every road user, the ego included.
SOURCE = records(
    [
        ("x", "f8"),  # position of the centre [m]
        ("y", "f8"),
        ("vx", "f8"),  # velocity [m/s]
        ("vy", "f8"),
        ("mass", "f8"),  # m [kg]
        ("type_factor", "f8"),  # Psi_T [1]
        ("road", "f8"),  # R [yuan] of the road where it is
        ("driver", "f8"),  # DR [1] of who drives it
    ]
)


def road_users(
    x: Any,
    y: Any,
    vx: Any,
    vy: Any,
    mass: Any = 1500.0,
    kind: str = "car",
    road: float | None = None,
    driver: float = 0.0,
    settings: RiskSettings = RiskSettings(),
    factors: Factors = Factors(),
) -> np.ndarray:
    """Road users of one type as `SOURCE` records.

    Args:
      x, y, vx, vy: positions [m] and velocities [m/s], floats or `[N]`.
      mass: [kg], likewise.
      kind: one of `shield.risk.factors.TYPES`.
      road: R where they are, from `road_factor`; by default the reference road.
      driver: DR of their drivers, from `driver_factor`.

    Returns:
      `[N]`.

    Raises:
      ValueError: a value outside its range; speeds have to stay below the wave speed, where the field is infinite.
    """
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(column, float)) for column in (x, y, vx, vy, mass)))
    users = np.zeros(len(columns[0]), SOURCE)
    for name, column in zip(("x", "y", "vx", "vy", "mass"), columns, strict=True):
        if not np.isfinite(column).all():
            raise ValueError(f"{name} = {column[~np.isfinite(column)][0]}: expected a finite number")
        users[name] = column
    for value in users["mass"]:
        in_range("mass", float(value), POSITIVE)
    users["type_factor"] = type_factor(kind, factors)
    users["road"] = in_range("road", settings.reference_road if road is None else road, POSITIVE)
    users["driver"] = in_range("driver", driver, NOT_NEGATIVE._replace(high=1.0))
    check_speeds(np.hypot(users["vx"], users["vy"]), settings)
    return users


def check_speeds(speeds: np.ndarray, settings: RiskSettings) -> None:
    """Are speeds `[N]` [m/s] such that there is a field?

    Raises:
      ValueError: one is not below the wave speed.
    """
    fastest = float(speeds.max(initial=0.0))
    if not fastest < settings.wave_speed:
        raise ValueError(f"speed = {fastest:g} is out of range: expected < wave_speed = {settings.wave_speed:g} m/s")


class Bearing(NamedTuple):
    """How the ego sees a source."""

    distance: float  # r [m] between the centres
    to_ego_x: float  # unit vector from the source to the ego; 0 if they are at the same place
    to_ego_y: float
    along: float  # v_b cos theta [m/s]: the source's speed toward the ego
    speed: float  # v_b [m/s]
    closing: float  # [m/s] at which the distance shrinks
    doppler: float  # [1] field on this bearing, relative to that of a standing source: more ahead of it, less behind
    shape: float  # [1] energy likewise


class Field(NamedTuple):
    """What a source does to the ego."""

    strength: float  # abs(E), without the share of the source's driver
    force: float  # abs(F)
    force_x: float
    force_y: float
    energy: float  # SPE
    rate: float  # dSPE/dt
    dsi: float  # DSI


@compiled
def bearing(ego, source, settings):
    """`Bearing` of a source, both `SOURCE` records."""
    dx, dy = ego.x - source.x, ego.y - source.y
    distance = np.sqrt(dx * dx + dy * dy)
    x, y = (dx / distance, dy / distance) if distance > 0.0 else (0.0, 0.0)
    along, speed = source.vx * x + source.vy * y, speed_of(source)
    closing = (source.vx - ego.vx) * x + (source.vy - ego.vy) * y
    doppler = settings.wave_speed / (settings.wave_speed - along)
    shape = doppler if settings.mode == RADIAL else _iso_shape(along, speed, settings)
    return Bearing(distance, x, y, along, speed, closing, doppler, shape)


@compiled
def speed_of(user):
    """Speed of a `SOURCE` record [m/s]."""
    return np.sqrt(user.vx * user.vx + user.vy * user.vy)


@compiled
def field(ego, source, settings):
    """`Field` of a source at the ego ((A3), (A5), (A7), (5), (6)).

    Args:
      ego, source: `SOURCE` records.
      settings: `RiskSettings`.
    """
    sight = bearing(ego, source, settings)
    r = max(sight.distance, settings.nearest)
    strength = field_strength(r, settings.field_constant * source.road * mass_of(source, settings), sight, settings)
    felt = coupling(ego, source, settings)
    pull = force(r, felt, sight, settings)
    stored, rate = energy(r, felt, sight, settings), pull * sight.closing
    return Field(
        strength,
        pull,
        pull * sight.to_ego_x,
        pull * sight.to_ego_y,
        stored,
        rate,
        dsi(stored, rate, settings),
    )


@compiled
def loss(v, settings):
    """g(v): mean loss of an accident at a speed [yuan] (13).

    A fit to the mean speeds of five classes of road, negative below 13 km/h and without bound above, so speeds are
    clipped to where it holds.
    """
    u = min(max(v, settings.slowest_loss), settings.fastest_loss) / KMH
    return ((0.002368 * u - 0.3224) * u + 12.57) * u * u - 1492.0


@compiled
def virtual_mass(mass, type_factor, v, settings):
    """M [kg yuan] (9): a mass [kg] weighted with the type of road user and with what its speed [m/s] destroys."""
    return type_factor * mass * loss(v, settings)


@compiled
def mass_of(user, settings):
    """`virtual_mass` of a `SOURCE` record."""
    return virtual_mass(user.mass, user.type_factor, speed_of(user), settings)


@inner
def coupling(ego, source, settings):
    """A: what force and energy of a pair are proportional to, drivers included ((A4), (A5))."""
    drivers = (1.0 + ego.driver) * (1.0 + source.driver)
    masses = mass_of(ego, settings) * mass_of(source, settings)
    return settings.field_constant * ego.road * source.road * masses * drivers


@inner
def field_strength(r, charge, sight, settings):
    """abs(E) at a distance r [m] on a bearing ((A1), (A3)): stronger ahead of a moving source, weaker behind it."""
    return charge / (r * _decay(r, settings)) * sight.doppler


@inner
def force(r, felt, sight, settings):
    """abs(F) at a distance r [m] on a bearing, of a pair with a `coupling` (A5)."""
    return field_strength(r, felt, sight, settings)


@inner
def energy(r, felt, sight, settings):
    """SPE at a distance r [m] on a bearing, of a pair with a `coupling` ((1) and (3) of the paper, (5) for drivers).

    The field has a curl, so energy depends on the way from infinity: "radial" comes straight along the bearing and
    is the integral of the force; "iso", as published, follows a line of equal field strength to straight ahead of
    the source and goes on from there. Both are the same there, and where the source stands.
    """
    return felt / ((settings.distance_exponent - 1.0) * _decay(r, settings)) * sight.shape


@inner
def _iso_shape(along, speed, settings):
    """(A10): the exact one at straight ahead, taken along a line of equal field strength to here."""
    k1, k3 = settings.distance_exponent, settings.wave_speed
    return k3 / (_decay(k3 - along, settings) * (k3 - speed)) ** (1.0 / k1)


@inner
def _decay(r, settings):
    """r^(k1 - 1); a root, at the paper's k1, takes a tenth of the time that a power does."""
    exponent = settings.distance_exponent - 1.0
    return np.sqrt(r) if exponent == 0.5 else r**exponent


@inner
def dsi(stored, rate, settings):
    """DSI: energy and its rate, weighted (6)."""
    return settings.energy_weight * stored + (1.0 - settings.energy_weight) * rate


@inner
def dsi_at(r, closing, felt, sight, settings):
    """DSI at a distance r [m] on a bearing, closing at a speed [m/s], of a pair with a `coupling`."""
    return dsi(energy(r, felt, sight, settings), force(r, felt, sight, settings) * closing, settings)
