"""A car that is steered freely where roads cross: it keeps to the route that it has declared.

Plans are made for a path, and an agent that steers itself may drive anywhere. So the ego's path is widened by
`ROOM` to either side, and a steering angle is let through if the car stays within that: one frame with it, then
the plan in force, steered by a law that follows the lane (`envs.roads.bicycle`), to rest. That future is played with
the simulator's own equations of motion, kinematic or dynamical. What was let through before has left such a
future, so there is always something to carry out: the plan in force, steered by that law.
"""

from typing import Any

import numpy as np
from highway_env.vehicle.dynamics import BicycleVehicle

from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.bicycle import HEADING, LATERAL_SPEED, SPEED, YAW_RATE, lane_keeping, move
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, is_after_end, local_coordinates
from rss_shield.envs.roads.paths import MARGIN_LAT, MARGIN_LON
from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.junctions.conflict_areas import cell_of, reach_beyond
from rss_shield.shield.junctions.controller import JunctionReport
from rss_shield.shield.junctions.plans import Scene, throttle
from rss_shield.shield.verdicts import KEPT, LEFT_PATHS

ROOM = 0.75  # to either side of what highway-env's drivers sweep [m]
DRIFT = 0.3  # how exactly such a car follows a plan [m]
_SHARES = (1.0, 0.5, 0.0)  # of the way from the law's steering angle to the agent's, in this order
_LONGEST = 300  # frames played ahead, at most
_STILL = 0.02  # sum of lateral speed [m/s] and yaw rate [rad/s] at which a car stands still
_AGAIN = 2.0  # so long it has to stay on its route after starting again [s]


class FreeEgo(JunctionEgo):
    """`JunctionEgo` for a car with continuous actions.

    Args:
      vehicle, settings, record: see `ShieldedEgo`.
      destination: name of the node where the ego goes; the way there is its route.

    Raises:
      ValueError: no way leads there, or the car is none of highway-env's size.
    """

    clearance = ROOM

    def __init__(self, vehicle: Any, settings: Settings, record: bool, destination: str) -> None:
        if (vehicle.LENGTH, vehicle.WIDTH) != (CAR_LENGTH, CAR_WIDTH):
            raise ValueError(
                f"vehicle of {vehicle.LENGTH:g} m x {vehicle.WIDTH:g} m: expected {CAR_LENGTH:g} m x {CAR_WIDTH:g} m, "
                "because the way of a car that is steered freely is played ahead for that size only"
            )
        super().__init__(vehicle, settings, record)
        self.route = declared_route(self.junction.walks, vehicle.lane_index, destination)
        self.passed = 0  # lanes of the route that lie behind
        self.dynamical = isinstance(vehicle, BicycleVehicle)
        self.astray = False  # has left its route: only where nothing is overridden

    def _declared(self, vehicle) -> tuple:
        if vehicle is not self.vehicle:
            return super()._declared(vehicle)
        network = vehicle.road.network
        while self.passed < len(self.route) - 1 and network.get_lane(self.route[self.passed]).after_end(
            vehicle.position
        ):
            self.passed += 1
        return self.route[self.passed], self.route[self.passed + 1 :]

    def _scene(self) -> Scene:
        return super()._scene()._replace(drift=DRIFT)

    def _restrict(
        self, scene: Scene, acceleration: float, steering: float, holds: bool = False
    ) -> tuple[JunctionReport, float]:
        if not self.settings.overrides:
            report, _ = super()._restrict(scene, acceleration, steering)
            return self._note_if_astray(scene, report), steering
        plan, crossings = self.plan.copy(), self.crossings.copy()
        report, _ = super()._restrict(scene, acceleration, steering)
        steered = self._steer(scene, report.acceleration, steering)
        if steered is None:  # at that speed the route can't be kept
            self.plan, self.crossings = plan, crossings
            report, _ = super()._restrict(scene, acceleration, steering, holds=True)
            steered = self._steer(scene, report.acceleration, steering)
            report = report._replace(overridden=False, limited=True, response=0)
        if steered is None:  # not even so: somebody has made the ego do what it had not planned
            steered = self._law(scene, report.acceleration)
        if steered != steering and not report.overridden:
            report = report._replace(limited=True)
        return report, steered

    def _steer(self, scene: Scene, acceleration: float, wish: float) -> float | None:
        """Steering angle nearest to a wish that keeps to the route; None if there is none [rad]."""
        law = self._law(scene, acceleration)
        go = max(int(self.plan["go"]), 0)
        for share in _SHARES:
            steering = wish if share == 1.0 else law + share * (wish - law)
            if _stays(scene, *self._way(), self._state(), self.dynamical, acceleration, steering, go):
                return steering
        return None

    def _law(self, scene: Scene, acceleration: float) -> float:
        """Steering angle that follows the route [rad]."""
        lanes, way, k = self._way()
        return float(lane_keeping(lanes[way[k]], self._state(), acceleration, self.dynamical, scene.table.dt))

    def _way(self):
        """Lanes of the network, numbers of those on the ego's path, and which of these it follows."""
        way = [self.junction.number[index] for index in self.junction.walks[self.path]]
        return self.junction.lanes, np.array(way), way.index(self.junction.number[self.route[self.passed]])

    def _state(self) -> np.ndarray:
        vehicle = self.vehicle
        slide = (vehicle.lateral_speed, vehicle.yaw_rate) if self.dynamical else (0.0, 0.0)
        return np.array([*vehicle.position, vehicle.heading, vehicle.speed, *slide], float)

    def _note_if_astray(self, scene: Scene, report: JunctionReport) -> JunctionReport:
        """Off its route, the ego has broken its duty toward everybody."""
        lanes, way, k = self._way()
        self.astray = not _is_on_route(scene, lanes[way[k]], way[k], self._state())
        if not self.astray:
            return report
        self.crossings["ego_broke"][self.crossings["ego_broke"] == KEPT] = LEFT_PATHS
        self.crossings["behind"] = False
        return report._replace(pairs=len(self.crossings), broken=len(self.crossings))


def declared_route(walks: list[list[tuple]], start: tuple, destination: str) -> list[tuple]:
    """Lanes from the lane `start` to a node and beyond.

    Args:
      walks: all ways through the network, see `envs.roads.paths.walks`.

    Raises:
      ValueError: no way leads there.
    """
    ahead = [walk[walk.index(start) :] for walk in walks if start in walk]
    there = [walk for walk in ahead if destination in {lane[1] for lane in walk[1:]}]
    if not there:
        raise ValueError(
            f"config destination = {destination!r}: expected a node that a car from {start[0]!r} can drive to, because "
            "a car that is steered freely has to declare its route"
        )
    return min(there, key=len)


# ---------------------------------------------------------------- the future, played ahead


@compiled
def _stays(scene, lanes, way, k, state, dynamical, acceleration, steering, go):
    """Does the ego stay on its route: one frame with a command, `go` frames of throttle, braking to rest, off again?

    It has to be able to start again from where it comes to rest, or an agent could park it across its lane.

    Args:
      scene: `Scene`.
      lanes: `[L]` LANE, way: numbers of those on the ego's path, k: which of them it follows.
      state: `[6]` x, y, heading, speed, lateral speed, yaw rate; overwritten.
      dynamical: the bicycle is `BicycleVehicle`, not `Vehicle`.
    """
    has_stopped, again = False, 0
    move(state, acceleration, steering, dynamical, scene.table.dt)
    for n in range(_LONGEST):
        while k + 1 < len(way) and is_after_end(lanes[way[k]], _arc_length(lanes[way[k]], state)):
            k += 1
        lane = lanes[way[k]]
        if not _is_on_route(scene, lane, way[k], state):
            return False
        has_stopped |= n >= go and state[SPEED] <= 0.0 and abs(state[LATERAL_SPEED]) + abs(state[YAW_RATE]) < _STILL
        if has_stopped:
            again += 1
        if again * scene.table.dt > _AGAIN:
            return True
        s = scene.paths.offset[scene.track.path, way[k]] + _arc_length(lane, state)
        if n < go or has_stopped:
            a = throttle(scene, s, state[SPEED])
        else:
            a = -min(scene.table.ego.a_min_brake, state[SPEED] / scene.table.dt)
        move(state, a, lane_keeping(lane, state, a, dynamical, scene.table.dt), dynamical, scene.table.dt)
    return False


@compiled
def _arc_length(lane, state):
    return local_coordinates(lane, state[0], state[1])[0]


@compiled
def _is_on_route(scene, lane, number, state):
    """Is the whole car inside the ego's widened path? Where that ends, it goes on straight."""
    paths, path = scene.paths, scene.track.path
    i = cell_of(paths.offset[path, number] + _arc_length(lane, state), paths.cells[path])
    pose = state[0], state[1], state[HEADING]
    along, across = reach_beyond(paths.boxes[path, i], *pose, 0.5 * CAR_LENGTH, 0.5 * CAR_WIDTH)
    return across <= -MARGIN_LAT and (along <= -MARGIN_LON or i == paths.cells[path] - 1)
