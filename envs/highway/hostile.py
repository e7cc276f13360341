"""Drivers who mean harm, on highway-env: `make(..., config={"other_vehicles_type": HOSTILE["tailgater"]})`.

What they do is in `envs.roads.hostile`; "bounded-tailgater" and so on keep to the limits of the table, "mixed" has one
of each. They aim at the nearest car that is not hostile itself.
"""

import numpy as np
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield.envs.roads.hostile import HOSTILE, MIXED, VICES, WRONG_WAY, harass, hostile_command, vice_at

__all__ = ["HOSTILE", "HostileVehicle"]


class HostileVehicle(IDMVehicle):
    """An IDM driver with its eye on a victim."""

    VICE = MIXED
    BOUNDED = False
    action: dict[str, float]

    def __init__(self, road, position, heading=0, speed=0, *args, **kwargs) -> None:
        self.vice = int(vice_at(self.VICE, float(position[0]), float(position[1])))
        turned = np.pi if self.vice == WRONG_WAY else 0.0
        super().__init__(road, position, heading + turned, speed, *args, **kwargs)

    def act(self, action=None) -> None:
        super().act(action)
        victim = self._victim()
        if victim is not None and not self.crashed:
            s, y = victim.lane.local_coordinates(victim.position)
            s_own, y_own = victim.lane.local_coordinates(self.position)
            here = self.lane.heading_at(self.lane.local_coordinates(self.position)[0])
            mirrored = bool(np.cos(victim.lane.heading_at(s) - here) < 0.0)
            wanted = harass(
                self.vice,
                float(s_own - s),
                float(y_own - y),
                float(self.speed),
                float(victim.speed),
                float(self.timer),
                float(self.action["acceleration"]),
            )
            turn, steering = float(self.heading - here), float(self.action["steering"])
            command = hostile_command(self.vice, self.BOUNDED, wanted, float(self.speed), turn, mirrored, steering)
            self.action = dict(zip(("acceleration", "steering"), command, strict=True))

    def _victim(self):
        others = [v for v in self.road.vehicles if not isinstance(v, HostileVehicle) and v is not self]
        return min(others, key=lambda v: float(np.linalg.norm(v.position - self.position)), default=None)


# classes by name, because highway-env finds its traffic by path
for _number, _vice in enumerate((*VICES, "mixed")):
    for _suffix, _bounded in (("", False), ("Bounded", True)):
        _name = _vice.title() + _suffix
        globals()[_name] = type(
            _name, (HostileVehicle,), {"VICE": _number, "BOUNDED": _bounded, "__module__": __name__, "__doc__": _vice}
        )
