"""Pedestrians on highway-env's roads, what hides them, and who has seen whom.

Reasonable pedestrians keep what `shield.people.judge` asks of them: on a crossing they go when they like, at most as
fast as the published table says; elsewhere they cross where every car can still stop or has passed, and children run
out between parked cars only where they come first. Nobody reasonable walks into a car. Unreasonable ones jump onto the
road from where they stand, or run out faster, or when it is too late.
"""

from typing import Any, NamedTuple

import numpy as np
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.objects import Obstacle, RoadObject

from rss_shield.envs.roads.visibility import NOBODY, Box, Columns, HiddenLane, box_of, hidden_people, sees, walls_of
from rss_shield.shield.definitions.kinematics import reach
from rss_shield.shield.definitions.occlusion import REASONABLE
from rss_shield.shield.definitions.pedestrians import WALKS, Walk

RADIUS = 0.36  # of a body: half the diagonal of a square of 0.5 m [m]
WALK = WALKS["paper"]
WAITING, WALKING, OVER = range(3)
CROSSES, CROSSES_ELSEWHERE, RUNS_OUT, JUMPS, DASHES = range(5)
ERRANDS = ("crosses on the crossing", "crosses elsewhere", "runs out", "jumps onto the road", "dashes out")
UNREASONABLE_ERRANDS = (JUMPS, DASHES)
_BRAKES = 4.0  # a walker does, at most [m/s^2]
_COMES_FIRST = 0.3  # room that a child leaves to a car which it comes before [m]
_DRIVER = (1.0, 3.0, 4.0)  # response time [s], acceleration and braking [m/s^2] that walkers grant to drivers
_HARDEST = 3.0  # acceleration of cars that children expect [m/s^2]
_KEPT_CLEAR = 1.0  # between somebody who waits and where cars drive [m]
_APART = 0.13  # half the way from one place looked at to the next [m]
_STANDS = 0.1  # slower is standing [m/s]
_LEAP = 6.0  # acceleration of who is unreasonable [m/s^2]


class Crossing(NamedTuple):
    """A marked crossing: a strip across the road."""

    start: float  # x [m]
    end: float


class Errand(NamedTuple):
    """What a walker is about to do."""

    kind: int  # index into `ERRANDS`
    speed: float  # that it walks at [m/s]
    after: float  # it goes no sooner [s]
    when_near: float  # nor before the ego's front is so near along the road [m]
    until: float  # y where it stops [m]


class Walker(RoadObject):
    """A pedestrian. It walks straight across the road, along y."""

    LENGTH = WIDTH = 0.5
    position: np.ndarray  # [m]
    speed: float  # [m/s]

    def __init__(self, road, position, heading: float = 0.0, speed: float = 0.0) -> None:
        super().__init__(road, position, heading, speed)
        self.errand = Errand(CROSSES, 1.0, np.inf, np.inf, float(position[1]))
        self.place = ("pedestrian", "roadside")  # in the published table
        self.state = WAITING
        self.acceleration = 0.0

    @property
    def side(self) -> float:
        """+1 if it walks towards larger y."""
        return 1.0 if np.sin(self.heading) > 0.0 else -1.0

    @property
    def is_reasonable(self) -> bool:
        """Does it mean to do nothing that nobody need expect?"""
        return self.errand.kind not in UNREASONABLE_ERRANDS

    @property
    def v_high(self) -> float:
        """Largest speed that is reasonable where it is [m/s]."""
        return REASONABLE[self.place].v_high

    def to_dict(self, origin_vehicle=None, observe_intentions=True):
        row = super().to_dict(origin_vehicle, observe_intentions)
        row["vx"], row["vy"] = row["vx"] + self.velocity[0], row["vy"] + self.velocity[1]
        return row

    def decide(self, time: float, dt: float) -> None:
        """Choose an acceleration for the coming frame."""
        errand, side = self.errand, self.side
        if self.crashed or self.state == OVER:
            self._brake(dt)
            return
        if self.state == WAITING:
            if time < errand.after or not self._may_go():
                return
            self.state = WALKING
        left = side * (errand.until - self.position[1])
        if left <= self.speed**2 / (2 * _BRAKES) + self.speed * dt:
            self.state = OVER
            self._brake(dt)
        elif self.is_reasonable and self._must_stop():
            self._brake(dt)
        else:
            hardest = WALK.a_max_accel if self.is_reasonable else _LEAP
            self.acceleration = float(np.clip((errand.speed - self.speed) / dt, -_BRAKES, hardest))

    def _brake(self, dt: float) -> None:
        self.acceleration = -min(_BRAKES, self.speed / dt)

    def step(self, dt: float) -> None:
        """One frame of explicit Euler, as for cars."""
        self.position = self.position + self.velocity * dt
        self.speed = max(self.speed + self.acceleration * dt, 0.0)

    # -- when to go

    def _may_go(self) -> bool:
        errand, ego = self.errand, self.road.watcher
        if ego is None or self._ahead_of(ego) > errand.when_near:
            return False
        if errand.kind == CROSSES_ELSEWHERE:
            return all(self._can_stop(car) for car in self._cars())
        return True  # children decide when they see the road

    def _cars(self) -> list[Any]:
        """Those whose lane is still ahead of it."""
        return [car for car in self.road.vehicles if self._to_lane(car) > 0.0]

    def _to_lane(self, car) -> float:
        """From its body to where a car's is, across the road [m]; negative once it is there."""
        return float(self.side * (car.position[1] - self.position[1]) - car.WIDTH / 2 - RADIUS)

    def _ahead_of(self, car) -> float:
        """From the front of a car to it, along the road [m]; negative once the front has passed."""
        return float((self.position - car.position) @ car.direction) - car.LENGTH / 2

    def _has_passed(self, car) -> bool:
        return self._ahead_of(car) < -car.LENGTH - 1.0

    def _waits_for_it(self, car) -> bool:
        """Does a car stand before it?"""
        return bool(car.speed < _STANDS and self._ahead_of(car) > RADIUS)

    def _can_stop(self, car) -> bool:
        """Can a driver stop before it, or has passed?"""
        rho, a, b = _DRIVER
        ahead = self._ahead_of(car)
        return (
            self._has_passed(car)
            or self._waits_for_it(car)
            or ahead > reach(max(car.speed, 0.0), rho, a, b, np.inf) + 3.0
        )

    def _comes_first(self, car) -> bool:
        """Is it before the front of a car however the driver accelerates, or has that passed by then?"""
        t = self._time_to(self._to_lane(car))
        if self._has_passed(car) or self._waits_for_it(car):
            return True
        return self._ahead_of(car) > max(car.speed, 0.0) * t + 0.5 * _HARDEST * t**2 + _COMES_FIRST

    def _time_to(self, distance: float) -> float:
        """Until it has come so far, on its way to its speed [s]."""
        v, a = self.speed, WALK.a_max_accel
        top = max(self.errand.speed, v)
        speeding = (top**2 - v**2) / (2 * a)
        if distance <= speeding:
            return float(np.sqrt(v**2 + 2 * a * max(distance, 0.0)) - v) / a
        return float((top - v) / a + (distance - speeding) / max(top, 1e-6))

    # -- whom not to walk into

    def _must_stop(self) -> bool:
        """Is a car in its way so near that it has to stop, or would it come too late?"""
        stop = self.speed**2 / (2 * _BRAKES) + self.speed * self.road.dt + _KEPT_CLEAR
        for car in self._cars():
            room = self._to_lane(car)
            if room > stop:
                continue
            if abs(self._ahead_of(car) + car.LENGTH / 2) < car.LENGTH / 2 + 0.8:  # it is there
                return True
            late = room > self.speed**2 / (2 * _BRAKES)  # else it cannot stop any more
            if late and self.errand.kind == RUNS_OUT and not self._comes_first(car):
                return True
            if late and self.errand.kind == CROSSES_ELSEWHERE and not self._can_stop(car):
                return True
        return False


class ParkedCar(Obstacle):
    """Stands beside the road, where nobody drives: contacts with it are not looked for."""

    LENGTH, WIDTH = 4.6, 1.9

    def __init__(self, road, position, heading: float = 0.0, speed: float = 0.0) -> None:
        super().__init__(road, position, heading, speed)
        self.collidable = False


class Surroundings(NamedTuple):
    """What stands around a road."""

    boxes: tuple[Box, ...] = ()  # that nobody looks through and nobody drives into: buildings, parked cars
    columns: tuple[Columns, ...] = ()  # where people may stand unseen
    crossings: tuple[Crossing, ...] = ()
    walk: Walk = WALK


class Watched:
    """What a road with walkers does besides: they move, and the car of `watcher` sees them or not. A mixin of roads."""

    network: Any
    vehicles: list
    objects: list
    surroundings = Surroundings()
    watcher: Any = None  # the car whose view counts
    dt = 1 / 15  # of a frame [s]
    lanes_hidden: tuple[HiddenLane, ...] = ()
    ghosts_on = True  # False: what is hidden does not count, for comparison

    def begin(self, watcher: Any, surroundings: Surroundings, dt: float) -> None:
        """A new episode. Frames count from here."""
        self.watcher, self.surroundings, self.dt = watcher, surroundings, dt
        self.frames = 0
        self.walls = walls_of(list(surroundings.boxes))
        self.look()

    @property
    def walkers(self) -> list[Walker]:
        return [o for o in self.objects if isinstance(o, Walker)]

    def look(self) -> None:
        """Take in whom the watcher sees now: each road user carries the frames of its arrival and of first sight."""
        cars = [box_of(v) for v in self.vehicles if v is not self.watcher]
        self.all_walls = np.concatenate([self.walls, walls_of(cars)])
        for user in [*self.vehicles, *self.walkers]:
            vars(user).setdefault("came", self.frames)
            if user is not self.watcher and not hasattr(user, "first_seen") and self._sees(user):
                user.first_seen = self.frames

    def _sees(self, user) -> bool:
        if isinstance(user, Walker):
            return sees(self.watcher, user, self.all_walls)
        cars = [box_of(v) for v in self.vehicles if v is not self.watcher and v is not user]
        return sees(self.watcher, user, np.concatenate([self.walls, walls_of(cars)]))

    def is_known(self, user) -> bool:
        """Has the watcher ever seen a road user? Before an episode has begun everybody is known."""
        return self.watcher is None or user is self.watcher or hasattr(user, "first_seen")

    def was_hidden(self, user) -> bool:
        """Was a road user there before it was seen first?"""
        return getattr(user, "first_seen", 0) > getattr(user, "came", 0)

    def ghosts(self, crossings: np.ndarray) -> np.ndarray:
        """`[G]` PERSON: who may be hidden on this frame. crossings: `[Z, 2]` along the watcher's way [m]."""
        columns = self.surroundings.columns
        if not self.ghosts_on or not columns:
            return NOBODY
        found = [hidden_people(self.watcher, c, self.all_walls, RADIUS + _APART, crossings) for c in columns]
        return np.concatenate(found) if len(found) > 1 else found[0]

    def hidden_cars(self) -> list[tuple[Any, float, float]]:
        """(lane index, arc length of its front [m], speed [m/s]) of a car that may be hidden on each lane looked up."""
        if not self.ghosts_on:
            return []
        return [  # who is behind a car that is seen does not come before it
            (hidden.index, hidden.look(self.watcher, self.walls, self.frames, self.dt), hidden.v_high)
            for hidden in self.lanes_hidden
        ]

    # -- called by highway-env

    def act(self) -> None:
        super().act()  # type: ignore[misc]
        for vehicle in self.vehicles:
            if isinstance(vehicle, IDMVehicle):  # its law alone would roll back
                action = vehicle.action
                action["acceleration"] = max(action["acceleration"], -max(vehicle.speed, 0.0) / self.dt)
        for walker in self.walkers:
            walker.decide(self.frames * self.dt, self.dt)

    def step(self, dt: float) -> None:
        for walker in self.walkers:  # everybody moves before contacts are looked for
            walker.step(dt)
        super().step(dt)  # type: ignore[misc]
        if self.watcher is not None:
            self.frames += 1
            self.look()

    def neighbour_vehicles(self, vehicle, lane_index=None):
        """highway-env's, but nobody stops for who stands beside their way: those wait for each other for ever else."""
        kept = self.objects
        self.objects = [o for o in kept if not (isinstance(o, ParkedCar) or _lets_pass(o, vehicle))]
        try:
            return super().neighbour_vehicles(vehicle, lane_index)  # type: ignore[misc]
        finally:
            self.objects = kept

    def close_objects_to(self, vehicle, distance, count=None, see_behind=True, sort=True, vehicles_only=False):
        """highway-env's, without who was never seen and what stands beside the road."""
        kept = self.vehicles, self.objects
        self.vehicles = [v for v in self.vehicles if self.is_known(v)]
        self.objects = [o for o in self.objects if not isinstance(o, ParkedCar) and self.is_known(o)]
        try:
            return super().close_objects_to(vehicle, distance, count, see_behind, sort, vehicles_only)  # type: ignore[misc]
        finally:
            self.vehicles, self.objects = kept


def _lets_pass(user, vehicle) -> bool:
    """Does a pedestrian stand beside where a car drives along x?"""
    beside = abs(user.position[1] - vehicle.position[1]) - vehicle.WIDTH / 2
    return isinstance(user, Walker) and user.speed < _STANDS and beside > RADIUS + 0.2


class WatchedRoad(Watched, Road):
    """A road with walkers."""


def along_way(crossings: tuple[Crossing, ...], start: float) -> np.ndarray:
    """`[Z, 2]` crossings along a straight way in the direction of x that begins at `start` [m]."""
    return np.array([(z.start - start, z.end - start) for z in crossings]).reshape(-1, 2)
