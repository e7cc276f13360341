"""The shield on a car among pedestrians, and where not everything can be seen.

It is shown whom its car has ever seen and, as records like any other, ghosts of those who may be hidden (Def. 26). The
pedestrians' ways are threats beside those of cars; plans, controller and judge are `JunctionEgo`'s.
"""

import numpy as np

from rss_shield.envs.highway.ego import carried_over
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.ways import CAR_ON_ROAD
from rss_shield.envs.worlds.walkers import RADIUS, ParkedCar, Walker, along_way
from rss_shield.shield.definitions.occlusion import REASONABLE
from rss_shield.shield.junctions.choice import is_trapped
from rss_shield.shield.junctions.controller import JunctionReport
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.junctions.plans import Scene
from rss_shield.shield.junctions.reach import THREAT
from rss_shield.shield.people.judge import (
    WATCHED,
    Seen,
    judge_caution,
    note_exposure,
    remember_person,
    stay_uncautious,
    watch_person,
)
from rss_shield.shield.people.reach import PERSON, has_way, list_people, place_on_path
from rss_shield.shield.verdicts import INHERITED, KEPT, NO_CAUTION, OTHER, Verdict

_CAR = (5.0, 2.0)  # length and width of a car that may be hidden [m]
_AT_CROSSING = 0.5, 9.0  # who is so near to its stripes along the road, and to the middle of that, is at a crossing [m]
_FELT = 0.1  # a contact is with whoever is so near to the ego's way [m]


class PeopleEgo(JunctionEgo):
    """`JunctionEgo` that gives pedestrians what is theirs, and expects whom it cannot see."""

    def __init__(self, vehicle, settings: Settings, record: bool = False) -> None:
        super().__init__(vehicle, settings, record)
        self.watched = np.zeros(0, WATCHED)
        self.people: list[int] = []  # indices of pedestrians among `others`
        self.shown = np.zeros(0, PERSON)  # pedestrians and ghosts of this frame
        self.extended: np.ndarray | None = None  # memory of others, and of hidden cars as if never met
        self.scratch = np.zeros((2, 0))
        self.uncautious = False  # had no plan toward who came out, and no plan has stayed clear of everybody since

    # -- who is there

    def _meet(self) -> None:
        """As for any ego, but who was never seen is not there; what is parked beside the road is in nobody's way."""
        road = self.vehicle.road
        kept = road.vehicles, road.objects
        road.vehicles = [v for v in road.vehicles if road.is_known(v)]
        road.objects = [o for o in road.objects if not isinstance(o, ParkedCar) and road.is_known(o)]
        try:
            super()._meet()
        finally:
            road.vehicles, road.objects = kept

    def _follow(self, others: list) -> None:
        self.watched = carried_over(self.watched, self.others, others)
        super()._follow(others)
        self.people = [i for i, other in enumerate(others) if isinstance(other, Walker)]

    def _cars(self) -> np.ndarray:
        cars = super()._cars()
        road = self.vehicle.road
        hidden = road.hidden_cars()
        if not hidden:
            return cars
        ghosts = np.zeros(len(hidden), CAR_ON_ROAD)
        for ghost, (index, front, v) in zip(ghosts, hidden, strict=True):
            lane, s = road.network.get_lane(index), front - _CAR[0] / 2
            ghost["x"], ghost["y"] = lane.position(s, 0.0)
            ghost["heading"], ghost["speed"] = lane.heading_at(s), v
            (ghost["length"], ghost["width"]), ghost["alert"] = _CAR, True
            ghost["on"], ghost["lane"], ghost["choice"] = self.junction.number[index], -1, -1
        everybody = np.zeros(len(cars) + len(ghosts), CAR_ON_ROAD)
        everybody[: len(cars) - 1], everybody[len(cars) - 1 : -1], everybody[-1] = cars[:-1], ghosts, cars[-1]
        return everybody

    def _remembered(self, count: int) -> np.ndarray:
        """What is remembered of others; of who may be hidden, nothing: that clock starts when they are seen."""
        if self.extended is None or len(self.extended) != count:
            self.extended = np.zeros(count, CROSSING)
            self.extended[: len(self.crossings)] = self.crossings
        return self.extended

    # -- what plans stay clear of

    def _look(self):
        self.extended = None
        track, threats, roads = super()._look()
        road, paths = self.vehicle.road, roads.paths
        for i in self.people:  # bounds of cars are none of theirs
            sample = self.samples[i]
            sample["x"] = sample["y"] = sample["heading"] = 0.0
            sample["speed"], sample["lanes"], sample["alert"] = 0.0, 0, True
            sample["wreck"] = sample["astray"] = sample["strays"] = False
        start = float(self.cars[-1]["x"]) - track.s
        ghosts = road.ghosts(along_way(road.surroundings.crossings, start))
        self.shown = np.zeros(len(ghosts) + len(self.people), PERSON)
        self.shown[: len(ghosts)], self.shown[len(ghosts) :] = ghosts, self._persons(start)
        if self.scratch.shape[1] != paths.cells[track.path]:
            self.scratch = np.zeros((2, paths.cells[track.path]))
        cars = threats[~np.isin(threats["user"], self.people)]
        rows = np.zeros(len(cars) + 64, THREAT)
        what = paths, track, self.shown, road.surroundings.walk, self.settings.table.dt, self.scratch
        count = list_people(*what, rows[len(cars) :])
        if count > len(rows) - len(cars):
            rows = np.zeros(len(cars) + count, THREAT)
            list_people(*what, rows[len(cars) :])
        rows[: len(cars)] = cars
        self.room = rows
        return track, rows[: len(cars) + count], roads

    def _persons(self, start: float) -> np.ndarray:
        """Pedestrians as `PERSON`. start: x at which the ego's way begins [m]."""
        surroundings = self.vehicle.road.surroundings
        persons = np.zeros(len(self.people), PERSON)
        for person, i in zip(persons, self.people, strict=True):
            walker = self.others[i]
            person["user"], person["radius"], person["v_high"] = i, RADIUS, walker.v_high
            person["x"], person["y"] = walker.position
            person["heading"], person["v"] = walker.heading, walker.speed
            person["route_from"] = person["route_to"] = np.nan
            z = crossing_at(surroundings.crossings, walker.position[0], walker.position[1])
            if z is not None:
                person["route_from"], person["route_to"] = along_way((z,), start)[0]
        return persons

    # -- who broke a duty

    def _restrict(
        self, scene: Scene, acceleration: float, steering: float, holds: bool = False
    ) -> tuple[JunctionReport, float]:
        remembered, walk, dt = self._remembered(len(self.samples)), self.vehicle.road.surroundings.walk, scene.table.dt
        appeared = self._appeared()
        for i in appeared:
            other = self.others[i]
            note_exposure(remembered[i], max(float(other.speed), 0.0), *reasonable_speeds(other))
        seen = {i: self._seen(scene, i) for i in self.people}
        for i, person in seen.items():
            watch_person(self.watched[i], remembered[i], person, walk, dt)
        result = super()._restrict(scene, acceleration, steering, holds)
        for i in appeared:
            judge_caution(remembered[i])
            self.uncautious |= bool(remembered[i]["ego_broke"] == NO_CAUTION)
        self.uncautious = self.uncautious and (result[0].trapped or bool(is_trapped(scene)))
        if self.uncautious:
            for crossing in remembered[: len(self.crossings)]:
                stay_uncautious(crossing)
        for i, person in seen.items():
            remember_person(self.watched[i], remembered[i], person)
        self.crossings[:] = remembered[: len(self.crossings)]
        return result

    def _appeared(self) -> list[int]:
        """Indices of those who have just come out of hiding."""
        road = self.vehicle.road
        return [i for i, other in enumerate(self.others) if self.crossings[i]["age"] == 0 and road.was_hidden(other)]

    def _seen(self, scene: Scene, i: int) -> Seen:
        track = scene.track
        person = self.shown[self.shown["user"] == i][0]
        where = float(person["x"]), float(person["y"]), float(person["heading"])
        s, y, turned, half_width = place_on_path(scene.paths, track.path, *where)
        clearance = abs(y) - half_width - RADIUS
        near = RADIUS + _FELT
        in_way = abs(y) < self.vehicle.WIDTH / 2 + near
        return Seen(
            *where,
            float(person["v"]),
            float(person["v_high"]),
            bool(has_way(person, y, turned, clearance)),
            not bool(np.isnan(person["route_from"])),
            in_way,
            s < track.s + track.half_length,
            in_way and abs(s - track.s) < track.half_length + near,
            self.vehicle.speed < _FELT,
        )

    def _verdicts(self, touching: list[int]) -> list[Verdict]:
        """Verdicts, with what pedestrians have done since the frame before."""
        track, threats, roads = self._look()
        scene, walk = self._scene_of(track, threats, roads), self.vehicle.road.surroundings.walk
        for i in set(touching).intersection(self.people):
            seen = self._seen(scene, i)._replace(in_way=True, near=True)
            watch_person(self.watched[i], self.crossings[i], seen, walk, self.settings.table.dt)
        found = super()._verdicts(touching)
        return [
            verdict._replace(verdict=OTHER)
            if verdict.verdict == INHERITED and verdict.other_duty != KEPT and verdict.ego_duty == KEPT
            else verdict
            for verdict in found
        ]


def crossing_at(crossings, x: float, y: float):
    """The crossing that a place belongs to, None = none."""
    beside, across = _AT_CROSSING
    return next((z for z in crossings if z.start - beside <= x <= z.end + beside and abs(y) <= across), None)


def reasonable_speeds(user) -> tuple[float, float]:
    """What is reasonable for a road user that was hidden, by the published table [m/s]."""
    place = user.place if isinstance(user, Walker) else ("car", "urban")
    return REASONABLE[place].v_low, REASONABLE[place].v_high
