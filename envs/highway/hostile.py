"""Drivers who mean harm, on highway-env's motorways: `make(..., config={"other_vehicles_type": HOSTILE["tailgater"]})`.

Each is an IDM driver but for one vice, aimed at the nearest car that is not hostile itself. None of them can be kept
from running into others; what a shield can do is not to be the one at fault, and to avoid what can be avoided.
"""

import numpy as np
from highway_env.vehicle.behavior import IDMVehicle

_BEFORE = 12.0  # [m] ahead of the victim, centre to centre, from where a hostile driver cuts in


class HostileVehicle(IDMVehicle):
    """An IDM driver with its eye on a victim; what it does to it is `harass`'s."""

    REVERSES = False
    action: dict[str, float]

    def act(self, action=None) -> None:
        super().act(action)
        victim = self._victim()
        if victim is not None and not self.crashed:
            acceleration, aim = self.harass(victim, *self._seen(victim))
            if not self.REVERSES:
                acceleration = max(acceleration, -5.0 * max(self.speed, 0.0))
            self.action = {
                "acceleration": float(np.clip(acceleration, -12.0, 5.0)),
                "steering": self.action["steering"] if aim is None else self._steer(aim),
            }

    def harass(self, victim, ahead: float, aside: float) -> tuple[float, float | None]:
        """What it does: (acceleration [m/s^2], lateral speed wanted [m/s], None = keep the lane).

        Args:
          victim: the other car.
          ahead, aside: how far this car is ahead of the victim and to its right [m].
        """
        raise NotImplementedError

    def _victim(self):
        others = [v for v in self.road.vehicles if not isinstance(v, HostileVehicle) and v is not self]
        return min(others, key=lambda v: float(np.linalg.norm(v.position - self.position)), default=None)

    def _seen(self, victim) -> tuple[float, float]:
        s, y = victim.lane.local_coordinates(victim.position)
        s_own, y_own = victim.lane.local_coordinates(self.position)
        return float(s_own - s), float(y_own - y)

    def _steer(self, lateral_speed: float) -> float:
        """Steering angle that brings about a lateral speed [rad]."""
        speed = max(self.speed, 3.0)
        heading = self.lane.heading_at(self.lane.local_coordinates(self.position)[0])
        wanted = heading + np.arcsin(np.clip(lateral_speed / speed, -0.5, 0.5))
        turn = (wanted - self.heading + np.pi) % (2 * np.pi) - np.pi
        return float(np.clip(np.arctan(2 * turn * self.LENGTH / 2 / speed * 5.0), -0.4, 0.4))

    def _match(self, speed: float) -> float:
        return (speed - self.speed) / 0.6


class Tailgater(HostileVehicle):
    """Drives up close behind and stays there."""

    def harass(self, victim, ahead, aside):
        return self._match(victim.speed + np.clip(-ahead - 7.0, -4.0, 4.0)), -aside


class BrakeChecker(HostileVehicle):
    """Gets ahead into the victim's way and brakes as hard as it can."""

    def harass(self, victim, ahead, aside):
        if ahead < _BEFORE:
            return self._match(victim.speed + 5.0), None
        if abs(aside) > 0.5:
            return self._match(victim.speed), -np.clip(aside, -1.5, 1.5)
        return (-12.0 if ahead < 3 * _BEFORE else 0.0), 0.0


class Overtaker(HostileVehicle):
    """Passes without distance, moves in ahead, and then slows down gently, for good."""

    def harass(self, victim, ahead, aside):
        if ahead < 8.0:
            return self._match(victim.speed + 4.0), 0.0 if abs(aside) > 2.2 else np.sign(aside) * 1.0
        return max(self._match(victim.speed - 6.0), -3.0), -np.clip(aside / 0.8, -1.0, 1.0)


class Companion(HostileVehicle):
    """Comes up in the gap between two lanes and stays beside the victim."""

    def harass(self, victim, ahead, aside):
        side = 1.0 if aside >= 0.0 else -1.0
        return self._match(victim.speed + np.clip(-ahead, -4.0, 9.0)), np.clip(side * 3.0 - aside, -1.0, 1.0)


class Squeezer(HostileVehicle):
    """Comes beside the victim and pushes toward it."""

    def harass(self, victim, ahead, aside):
        toward = -np.sign(aside) * 1.5 if abs(ahead) < 5.0 else 0.0
        return self._match(victim.speed + np.clip(-ahead, -4.0, 4.0)), toward


class Swerver(HostileVehicle):
    """Swerves from side to side, wherever it is."""

    def harass(self, victim, ahead, aside):
        return self.action["acceleration"], 4.0 if (self.timer * 1.3) % 2.0 < 1.0 else -4.0


class Stopper(HostileVehicle):
    """Stops for good in the victim's way."""

    def harass(self, victim, ahead, aside):
        return (-6.0 if 0.0 < ahead < 60.0 and self.speed > 0.0 else self._match(20.0)), None


class Reverser(HostileVehicle):
    """Stops ahead of the victim and drives backwards into it."""

    REVERSES = True

    def harass(self, victim, ahead, aside):
        return (self._match(-6.0) if 0.0 < ahead < 50.0 else self._match(victim.speed + 3.0)), None


class Rammer(HostileVehicle):
    """Drives at the victim, from wherever it is."""

    def harass(self, victim, ahead, aside):
        return self._match(victim.speed + np.clip(-ahead, -6.0, 6.0)), -np.clip(aside * 1.5, -4.0, 4.0)


_DRIVERS = (Tailgater, BrakeChecker, Overtaker, Companion, Squeezer, Swerver, Stopper, Reverser, Rammer)
HOSTILE = {driver.__name__.lower(): f"rss_shield.envs.highway.hostile.{driver.__name__}" for driver in _DRIVERS}
