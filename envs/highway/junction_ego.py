"""The shield on one controlled vehicle where roads cross: plans in place of distances along the lane."""

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs.highway.ego import ShieldedEgo, carried_over
from rss_shield.envs.highway.frames import Frame, Look
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.paths import Size, size_of
from rss_shield.envs.roads.slip import slip_of
from rss_shield.envs.roads.ways import CAR_ON_ROAD, drift_of, is_outside, junction_of, list_threats, track_of
from rss_shield.envs.worlds.signalised import SignalisedRoad
from rss_shield.shield.comfort import ride_on
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.definitions.signals import keep_right, may_pass
from rss_shield.shield.junctions.conflict_areas import CELL
from rss_shield.shield.junctions.controller import JunctionReport, has_plan, junction_frame
from rss_shield.shield.junctions.held_back import held_by
from rss_shield.shield.junctions.judge import judge_crossing
from rss_shield.shield.junctions.memory import CAUTIOUS, CROSSING, PLAN, SAMPLE
from rss_shield.shield.junctions.plans import NEVER, Scene, Track
from rss_shield.shield.junctions.reach import THREAT
from rss_shield.shield.table import below
from rss_shield.shield.tally import count_change, note_executed
from rss_shield.shield.verdicts import Verdict


class JunctionEgo(ShieldedEgo):
    """`ShieldedEgo` with plans through junctions instead of distances along the lane."""

    clearance = 0.0  # the ego may be this much further to either side than highway-env's drivers [m]

    def __init__(self, vehicle, settings: Settings, record: bool = False) -> None:
        super().__init__(vehicle, settings, record)
        self._take_sizes((size_of(vehicle.LENGTH, vehicle.WIDTH),))
        self.settings = settings._replace(table=below(settings.table, self.junction.limit))
        self.crossings = np.zeros(0, CROSSING)
        self.samples = np.zeros(0, SAMPLE)
        self.cars = np.zeros(0, CAR_ON_ROAD)  # everybody on this sample, the ego last
        self.plan = np.zeros(1, PLAN)[0]
        self.plan["go"], self.plan["held_at"] = -1, np.inf
        self.room = np.zeros(64, THREAT)
        self.size_numbers: list[int] = []  # `[N]` index into the junction's sizes
        self.box = np.zeros(6)
        self.path = -1
        self.track: Track | None = None  # of the last frame, ...
        self.ways = 0  # ... and how many of `room` the others might take on it
        self.refused = False  # the lane change of this decision
        self.frames_trapped = 0
        self.pairs_examined = self.pairs_possible = 0  # pair-frames: plans were checked against somebody, could be
        self.may_pass: bool | None = None  # the light ahead
        self.judging = False  # a contact: who had crashed is read off the frame before

    def _take_sizes(self, sizes: tuple[Size, ...]) -> None:
        self.junction = junction_of(self.vehicle.road.network, self.clearance, self.settings.table.dt, sizes)

    def _frame(self) -> None:
        vehicle, settings = self.vehicle, self.settings
        self._meet()
        # meta-actions compute a new command on every frame, a continuous one persists
        nominal = vehicle.action if isinstance(vehicle, ControlledVehicle) else self.nominal
        acceleration, steering = float(nominal["acceleration"]), float(nominal["steering"])
        scene = self._scene()
        report, steered = self._restrict(scene, acceleration, steering)
        granted = report.acceleration if settings.overrides else acceleration
        self.track, self.ways = scene.track, len(scene.threats)
        if settings.overrides:
            vehicle.action = {"steering": steered, "acceleration": granted}
        note_executed(self.tally, granted, steered)
        if settings.overrides and report.overridden and self.tally["partner"] < 0:
            held = int(held_by(scene, acceleration, len(self.others), not settings.waits_anywhere))
            self.tally["partner"] = self._index_on_road(held) if held >= 0 else -1
        if self.refused:
            report = report._replace(overridden=True, limited=False)
            self.refused = False
            self.tally["lane_change_refused"] = True
        self.frames_trapped += report.trapped
        self.pairs_examined += report.examined
        self.pairs_possible += report.possible
        count_change(self.tally, self.since, abs(granted - acceleration), abs(float(steered - steering)))
        self._count(report, report, report.pairs, report.broken)
        ride_on(self.ride, self.poses[-1, 3], self.poses[-1, 2], np.inf, settings.table.dt)
        wish, command = (
            Command(a, float(slip_of(angle))) for a, angle in ((acceleration, steering), (granted, steered))
        )
        changed = report.overridden and settings.overrides, report.anticipated, report.limited and settings.overrides
        self.look = Look(wish, command, *changed, report.response, -1, report.pairs > 0)
        if self.record is not None:
            self.record.append(Frame(tuple(self.keys), self.poses, command))

    def _scene(self) -> Scene:
        """What plans of this frame depend on."""
        road = self.vehicle.road
        track, threats, roads = self._look()
        if isinstance(road, SignalisedRoad):
            threats = self._heed_lights(road, track, threats, roads)
        return self._scene_of(track, threats, roads)

    def _scene_of(self, track, threats, roads) -> Scene:
        settings, drift = self.settings, drift_of(roads, self.cars[-1], track)
        return Scene(roads.paths, track, threats, settings.table, drift)

    def _restrict(
        self, scene: Scene, acceleration: float, steering: float, holds: bool = False
    ) -> tuple[JunctionReport, float]:
        """What happened on this frame, with the acceleration that is let through, and the steering angle [rad].

        Args:
          scene: `Scene`.
          acceleration, steering: what the agent asks for.
          holds: the plan in force is carried out instead.
        """
        settings = self.settings
        report: JunctionReport = junction_frame(
            scene,
            self.samples,
            self._remembered(len(self.samples)),
            self.plan,
            acceleration,
            settings.entry,
            not settings.waits_anywhere,
            settings.examine,
            settings.overrides,
            settings.table.rules.anticipation,
            holds,
        )
        return report, steering

    def act(self, action=None) -> None:
        before = getattr(self.vehicle, "target_lane_index", None)
        super().act(action)
        if action is not None:
            self.refused = False
            if self.settings.overrides and not self.has_contact:
                self._gate(before)

    def _gate(self, before) -> None:
        """Take back a lane change that leaves no plan. No vehicle has moved since the agent asked for it."""
        vehicle, settings = self.vehicle, self.settings
        if before is None or vehicle.target_lane_index in (before, None):
            return
        if vehicle.target_lane_index[:2] != before[:2]:  # the road went on
            return
        self._meet()
        path = self.path
        scene = self._scene_of(*self._look())
        if not has_plan(scene, self._remembered(len(self.samples)), settings.entry, not settings.waits_anywhere):
            vehicle.target_lane_index, self.path = before, path
            self.refused = True

    def _look(self):
        """The ego's track, the ways of all others, and the roads."""
        junction = self.junction
        cars = self.cars = self._cars()
        if self.judging:  # a contact flags both cars at once
            cars["wreck"][: len(self.crossings)] = self.crossings["wreck"]
        roads, settings = junction.roads, self.settings
        track = track_of(roads, cars[-1], self.path)
        self.path = track.path
        self.samples = np.zeros(len(cars) - 1, SAMPLE)
        remembered = self._remembered(len(self.samples))
        common = (roads, track, cars[:-1], remembered, settings.intent, settings.table.other.v_cap, self.samples)
        count = list_threats(*common, self.room, self.box)
        if count > len(self.room):
            self.room = np.zeros(2 * count, THREAT)
            count = list_threats(*common, self.room, self.box)
        return track, self.room[:count], roads

    def _cars(self) -> np.ndarray:
        """Everybody else and the ego, which comes last, as `CAR_ON_ROAD`."""
        vehicle, junction = self.vehicle, self.junction
        cars = np.zeros(len(self.others) + 1, CAR_ON_ROAD)
        for car, v, size in zip(cars, [*self.others, vehicle], [*self.size_numbers, 0], strict=True):
            car["x"], car["y"] = v.position
            car["heading"], car["speed"], car["length"], car["width"] = v.heading, v.speed, v.LENGTH, v.WIDTH
            car["wreck"] = v.crashed or not hasattr(v, "action")
            car["alert"] = "act" in vars(v)  # under a shield, and waits for its turn or for its agent
            car["size"], car["on"] = size, junction.number[v.lane_index]
            car["lane"] = car["choice"] = -1
            heads_for, route = self._declared(v)
            if heads_for in junction.number:
                car["lane"], car["choice"] = junction.number[heads_for], junction.choice(heads_for, route)
        return cars

    def _remembered(self, count: int) -> np.ndarray:
        """`[N]` CROSSING: what is remembered of those who are sampled."""
        return self.crossings

    def _declared(self, vehicle) -> tuple:
        """Lane that a driver heads for, None = nobody knows, and its route."""
        return getattr(vehicle, "target_lane_index", None), getattr(vehicle, "route", None)

    def _heed_lights(self, road: SignalisedRoad, track, threats, roads):
        """Lights say who has the right of way; where the ego has not, its line is an obstacle."""
        vehicle = self.vehicle
        approach, distance = road.approach_of(vehicle), road.distance_to_line(vehicle)
        if approach < 0:
            return threats
        colour = road.signal(approach) if self.senses is None else self.senses.colour(road.signal(approach))
        ahead = colour, distance, max(vehicle.speed, 0.0), self.settings.table.ego
        if self.may_pass is None:
            self.may_pass = bool(may_pass(*ahead))
        elif distance > 0.0:
            self.may_pass = bool(keep_right(self.may_pass, *ahead))
        for threat in threats:
            other = self.others[threat["user"]]
            if threat["path"] >= 0 and road.approach_of(other) >= 0:
                self._rank(road, other, threat)
        if self.may_pass or distance <= 0.0:
            return threats
        return self._closed_from(int(np.ceil((track.s + distance) / CELL - 1e-6)), track, threats, roads)

    def _closed_from(self, cell: int, track, threats, roads):
        """The ways of others, and an obstacle on the ego's path from a cell on."""
        count = len(threats)
        if count == len(self.room):
            self.room = np.concatenate([self.room, np.zeros(count + 1, THREAT)])
        line = self.room[count]
        line["user"] = line["path"] = -1
        line["from_cell"], line["to_cell"] = cell, roads.paths.cells[track.path]
        line["from_cell_beside"], line["to_cell_beside"] = NEVER, -1
        line["arrives"], line["yields"] = 0.0, False
        return self.room[: count + 1]

    def _rank(self, road: SignalisedRoad, other, threat) -> None:
        """Who goes first by the lights, and is the other counted on to wait for its own?"""
        settings = self.settings
        has_right, left = road.has_right(other), road.distance_to_line(other)
        if self.may_pass != has_right:
            threat["priority"] = 1 if self.may_pass else -1
        elif not road.same_group(self.vehicle, other):
            threat["priority"] = 0
        if has_right or road.has_left(other):
            return
        if left > 0.0 and stopping_distance(other.speed, settings.table.other.a_min_brake) <= left:
            if settings.entry != CAUTIOUS:
                threat["line"] = threat["s"] + left
                threat["red_for"] = road.time_to_green(road.approach_of(other))
        else:  # it was able to stop when its green ended
            self.crossings[threat["user"]]["relied"] = True

    def _follow(self, others: list) -> None:
        self.crossings = carried_over(self.crossings, self.others, others)
        super()._follow(others)
        # what never drives takes no path
        own = self.junction.sizes[0]
        sizes = [size_of(v.LENGTH, v.WIDTH) if hasattr(v, "action") else own for v in others]
        new = [size for size in dict.fromkeys(sizes) if size not in self.junction.sizes]
        if new:
            self._take_sizes((*self.junction.sizes, *new))
        self.size_numbers = [self.junction.sizes.index(size) for size in sizes]

    def _verdicts(self, touching: list[int]) -> list[Verdict]:
        self.judging = True
        _, threats, roads = self._look()
        self.judging = False
        other, dt = self.settings.table.other, self.settings.table.dt
        outside = [is_outside(roads.paths, threats, i, self.cars[i]) for i in touching]
        return [
            judge_crossing(self.samples[i], self.crossings[i], out, other, dt)
            for i, out in zip(touching, outside, strict=True)
        ]
