"""Drivers for the other cars: reckless ones, and ones that keep every duty themselves.

Reckless: `make(..., config={"other_vehicles_type": RECKLESS})`. Compliant: `make(..., traffic="compliant")`.
"""

import math
from typing import Any

from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs.highway.compliant import CompliantDriver, take_turns
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.step import attach, shield_on
from rss_shield.envs.options import LANES, Settings
from rss_shield.envs.worlds.walkers import Watched
from rss_shield.shield.ground import Ground
from rss_shield.shield.junctions.memory import PRIORITY
from rss_shield.shield.junctions.plans import KNOWN

RECKLESS = "rss_shield.envs.highway.drivers.RecklessVehicle"


class RecklessVehicle(IDMVehicle):
    """An IDM driver without scruples: it follows at 0.3 s and changes lanes whenever there is one.

    Both MOBIL thresholds are removed: it asks neither what a lane change gains nor how hard it
    makes the car behind brake.
    """

    TIME_WANTED = 0.3  # time gap [s]
    LANE_CHANGE_MIN_ACC_GAIN = -math.inf  # [m/s^2]
    LANE_CHANGE_MAX_BRAKING_IMPOSED = math.inf  # [m/s^2]


def drivers_on(road: Any) -> list[ShieldedEgo]:
    """Shields of the cars of compliant traffic, also of those that have left after a contact.

    The road holds them, so that they are copied with their cars.
    """
    return getattr(road, "drivers", [])


def shield_everybody(road: Any, settings: Settings, ground: Ground | None = None) -> None:
    """Compliant traffic: a shield for every car that has none yet, but for the ego's.

    Where everybody keeps their duties there are no crashes (Lemmas 5 and 6), apart from dangers that cars
    appear in. At junctions these drivers share their routes and take turns (`envs.highway.compliant`); of anybody
    else they expect way only if they must give it and still can (Def. 17, item 1).

    Cars may appear at any time, so this is called at reset and before every step.

    Args:
      road: highway-env's road.
      settings: of the ego; its duties hold for everybody.
      ground: what everybody drives on, where not all of that is alike.

    Raises:
      ValueError: a road with pedestrians, or of which the ego does not see everything.
    """
    if isinstance(road, Watched):
        raise ValueError("traffic = 'compliant': expected 'stock' among pedestrians and where somebody may be hidden")
    duties = settings._replace(overrides=True, entry=PRIORITY)
    there = [v for v in road.vehicles if isinstance(v, ControlledVehicle) and v.collidable]
    shields = [shield_on(v) for v in there]
    stay = [driver for driver in drivers_on(road) if driver.has_contact or any(driver is one for one in shields)]
    unshielded = [v for v, shield in zip(there, shields, strict=True) if shield is None]
    if settings.scheme == LANES:
        road.drivers = stay + [attach(vehicle, duties, grounds=(ground, None)) for vehicle in unshielded]
        return
    road.drivers = stay + [CompliantDriver(vehicle, duties._replace(intent=KNOWN)) for vehicle in unshielded]
    take_turns(road)
