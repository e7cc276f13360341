"""Drivers for the other cars: reckless ones, and ones that keep every duty themselves.

Reckless: `make(..., config={"other_vehicles_type": RECKLESS})`. Compliant: `make(..., traffic="compliant")`.
"""

import math
from typing import Any

from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle

from envs.compliant import CompliantDriver, take_turns
from envs.highway import LANES, Settings, ShieldedEgo
from envs.shielding import attach
from shield.junction import PRIORITY
from shield.plans import KNOWN

RECKLESS = "envs.traffic.RecklessVehicle"
TRAFFIC = ("stock", "compliant")


class RecklessVehicle(IDMVehicle):
    """An IDM driver without scruples: it follows at 0.3 s and changes lanes whenever there is one.

    Both MOBIL thresholds are removed: it asks neither what a lane change gains nor how hard it
    makes the car behind brake.
    """

    TIME_WANTED = 0.3  # time gap [s]
    LANE_CHANGE_MIN_ACC_GAIN = -math.inf  # [m/s^2]
    LANE_CHANGE_MAX_BRAKING_IMPOSED = math.inf  # [m/s^2]


def shield_everybody(road: Any, drivers: list[ShieldedEgo], settings: Settings) -> list[ShieldedEgo]:
    """Compliant traffic: a shield for every car that has none yet.

    Where everybody keeps their duties there are no crashes (Lemmas 5 and 6), apart from dangers that cars
    appear in. At junctions these drivers share their routes and take turns (`envs.compliant`); of anybody else they
    expect way only if they must give it and still can (Def. 17, item 1).

    Cars may appear at any time, so this is called at reset and before every step.

    Args:
      road: highway-env's road.
      drivers: shields of all cars so far; those of cars that have left without a contact are dropped.
      settings: of the ego; its duties hold for everybody.

    Returns:
      Shields of all cars but those that had one before.
    """
    duties = settings._replace(overrides=True, entry=PRIORITY)
    stay = [driver for driver in drivers if driver.contact or driver.vehicle in road.vehicles]
    unshielded = [v for v in road.vehicles if isinstance(v, ControlledVehicle) and "act" not in vars(v)]
    if settings.scheme == LANES:
        return stay + [attach(vehicle, duties) for vehicle in unshielded]
    new = [CompliantDriver(vehicle, duties._replace(intent=KNOWN)) for vehicle in unshielded]
    take_turns(road)
    return stay + new
