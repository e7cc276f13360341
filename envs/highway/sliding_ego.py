"""The shield on a car whose tyres slip (`dynamical=True`), along lanes.

A kinematic car moves sideways by its slip, at once, and stops doing so at once. This one does so by forces: a frame of
steering changes the speed across the lane by what the tyres give, and the heading says little about it. So the speed
across the lane is measured as it is, lateral speed included, and the limits that hold for it (Defs. 6, 8) are kept by a
steering angle that is chosen with the simulator's own equations of motion (`envs.roads.bicycle.steer_along`).
"""

from typing import Any

import numpy as np

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.bicycle import across, frame_across, steer_along
from rss_shield.shield.command import Command
from rss_shield.shield.filters.answer import FILTERS
from rss_shield.shield.lanes.controller import Response
from rss_shield.shield.lanes.correction import CORRECTIONS
from rss_shield.shield.lanes.memory import Bounds
from rss_shield.shield.lanes.restriction import restrict

FLUCTUATION = 0.02  # speeds across the lane below this are none (Def. 5): tyres come to rest gradually [m/s]
SLIDES_OUT = 0.15  # likewise where steering has no effect: it is over within centimetres, for which mu is there [m/s]
_STEERS = 1.0  # from this speed on steering has an effect [m/s]
_CREEPS = 0.1  # who is slower has no course [m/s]


class SlidingEgo(ShieldedEgo):
    """`ShieldedEgo` on a `BicycleVehicle`.

    Args:
      vehicle, settings, record: see `ShieldedEgo`.

    Raises:
      ValueError: another filter, or the proper response in full: both steer by slip.
    """

    def __init__(self, vehicle: Any, settings: Settings, record: bool = False) -> None:
        for name, index, known in (
            ("filter", settings.filter.kind, FILTERS),
            ("correction", settings.correction, CORRECTIONS),
        ):
            if index != 0:
                raise ValueError(f"{name} = {known[index]!r}: expected {known[0]!r} with dynamical = True along lanes")
        super().__init__(vehicle, settings, record)
        self.backs_up = False  # in reverse its tyres push it round
        self.steered = 0.0  # steering angle of the last command [rad]
        self.bend = 0.0  # curvature under the ego [1/m]

    def _state(self) -> np.ndarray:
        vehicle = self.vehicle
        return np.array(
            [*vehicle.position, vehicle.heading, vehicle.speed, vehicle.lateral_speed, vehicle.yaw_rate], float
        )

    def _sense(self):
        users, ego, bend = super()._sense()
        speed_across, _ = across(self.road, self._state())
        speed = float(ego["speed"])
        ego["sin"] = np.clip(speed_across / speed, -1.0, 1.0) if abs(speed) > _CREEPS else 0.0
        self.bend = float(bend.curvature)
        return users, ego, bend

    def _command(self, acceleration: float, steering: float) -> Command:
        """A command with the angle between heading and course that the frame will have, as a kinematic car's slip."""
        self.steered = steering
        state, dt = self._state(), self.settings.table.dt
        during, _, _ = frame_across(self.road, state, acceleration, steering, dt)
        speed = state[3]
        if abs(speed) < _CREEPS:
            return Command(acceleration, 0.0)
        none = FLUCTUATION if abs(speed) > _STEERS else SLIDES_OUT
        kept = np.sign(during) * max(abs(during) - none, 0.0)
        drift = 0.5 * self.bend * speed**2 * dt
        _, psi = across(self.road, state)
        return Command(acceleration, float(np.arcsin(np.clip((kept + drift) / speed, -1.0, 1.0)) - psi))

    def _steering_for(self, command: Command) -> float:
        return self.steered

    def _respond(self, wish: Command, danger, ego, users, body) -> Response:
        wanted = self.steered
        limited, owed, eased = (
            self._kept(wish, bounds, wanted, ego, body) for bounds in (danger.free, danger.bounds, danger.eased)
        )
        overridden = owed != limited
        anticipated = eased != owed and not overridden
        acceleration, steering = eased
        changed = eased != (wish.acceleration, wanted)
        command = self._command(acceleration, steering) if changed else wish
        return Response(command, overridden, anticipated, changed and not overridden and not anticipated)

    def _kept(self, wish: Command, bounds: Bounds, wanted: float, ego, body) -> tuple[float, float]:
        """Acceleration [m/s^2] and steering angle [rad] nearest to a wish inside bounds."""
        rules, dt = self.settings.table.rules, self.settings.table.dt
        free = bounds._replace(left=np.inf, right=np.inf)
        acceleration = float(restrict(wish, free, ego, body, rules, dt).acceleration)
        if np.isinf(bounds.left) and np.isinf(bounds.right):
            return acceleration, wanted
        limits = (bounds.left, bounds.right, bounds.left_next, bounds.right_next)
        return acceleration, float(
            steer_along(self.road, self._state(), acceleration, wanted, limits, rules.heading_bound, dt)
        )
