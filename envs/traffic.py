"""Drivers for the other cars. Use: `make(..., config={"other_vehicles_type": RECKLESS})`."""

import math

from highway_env.vehicle.behavior import IDMVehicle

RECKLESS = "envs.traffic.RecklessVehicle"


class RecklessVehicle(IDMVehicle):
    """An IDM driver without scruples: it follows at 0.3 s and changes lanes whenever there is one.

    Both MOBIL thresholds are removed: it asks neither what a lane change gains nor how hard it
    makes the car behind brake.
    """

    TIME_WANTED = 0.3  # time gap [s]
    LANE_CHANGE_MIN_ACC_GAIN = -math.inf  # [m/s^2]
    LANE_CHANGE_MAX_BRAKING_IMPOSED = math.inf  # [m/s^2]
