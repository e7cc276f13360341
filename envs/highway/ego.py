"""highway-env objects to shield arrays and back: the only reader of highway-env's internals."""

from time import perf_counter
from typing import Any

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle

from rss_shield.envs.highway.contacts import touches
from rss_shield.envs.highway.frames import Frame, Look
from rss_shield.envs.highway.lane_changes import is_refused, offset_from, offset_from_target, reachable
from rss_shield.envs.highway.senses import Senses, others_on
from rss_shield.envs.options import LANES, OPEN_SPACE, PLANS, Settings
from rss_shield.envs.roads.lanes import Heading, heading_of, reach_on, roads_along, tightest
from rss_shield.envs.roads.slip import slip_of, steering_of
from rss_shield.envs.roads.steering import MAX_SLIP
from rss_shield.shield._numba.compiled import records
from rss_shield.shield.comfort import RIDE, gap_ahead, ride_on
from rss_shield.shield.command import Command
from rss_shield.shield.filters.answer import RSS, Traffic, answer
from rss_shield.shield.geometry import PIECE_FIELDS, box_of
from rss_shield.shield.ground import STATES, Ground, state_along, table_on, worse_of
from rss_shield.shield.lanes.closed_roads import go_around, keep_place
from rss_shield.shield.lanes.controller import Response, find_danger, respond
from rss_shield.shield.lanes.correction import RESPONSE, in_full
from rss_shield.shield.lanes.evasion import Room, evade
from rss_shield.shield.lanes.frame import Bend, look_ahead, same_frame, to_lane_frame_all
from rss_shield.shield.lanes.inflation import inflate
from rss_shield.shield.lanes.judge import judge_contact, judge_frame
from rss_shield.shield.lanes.lane_changes import lead_back
from rss_shield.shield.lanes.memory import MEMORY, catch_up, forget_safe, start_over
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.tally import (
    CONTACT,
    COUNTED,
    DECISION_FIELDS,
    EPISODE_FIELDS,
    IN_OPEN_SPACE,
    count_change,
    count_frame,
    enter_contact,
    evidence,
    info_at,
    note_executed,
    start_decision,
    start_episode,
)
from rss_shield.shield.verdicts import INHERITED, KEPT, VERDICTS, Verdict, weight_of

# ---------------------------------------------------------------- one ego under the shield


# what is counted of one ego, see `shield.tally`
DECISION, EPISODE = records(DECISION_FIELDS), records(EPISODE_FIELDS)


def carried_over(rows: np.ndarray, before: list, now: list) -> np.ndarray:
    """Records `[N]` of everybody who is there now: those of before, by identity, and zeros of who is new."""
    known = {id(other): i for i, other in enumerate(before)}
    result = np.zeros(len(now), rows.dtype)
    for i, other in enumerate(now):
        if id(other) in known:
            result[i] = rows[known[id(other)]]
    return result


def _living(value: Any) -> Any:
    """A record that can be written to, of one that comes from a pickle; anything else as it is."""
    if isinstance(value, np.void):
        return np.array([value], value.dtype)[0]
    return tuple(map(_living, value)) if type(value) is tuple else value


class ShieldedEgo:
    """The shield on one controlled vehicle. It takes the place of the vehicle's `act`.

    highway-env calls `act()` without an argument once per frame, when every vehicle chooses its
    command and none has moved: the state is consistent. The bound method lives in the vehicle's
    own `__dict__`, so a deep copy or a pickle of the environment carries its own shield along.
    """

    is_ego = False  # of a wrapper, which reads its infos; else of a car of compliant traffic

    def __init__(self, vehicle, settings: Settings, record: bool = False) -> None:
        self.vehicle = vehicle
        self.settings = self.given = settings
        self.ground: Ground | None = None  # where not all of the road, or not everybody on it, is alike
        self.stands = -1  # state of the road that the ego's parameters are for
        self.kinds = np.zeros(0, np.int64)  # `[N]` rows of parameters of the others
        self.body = (vehicle.LENGTH / 2, MAX_SLIP)
        self.backs_up = not isinstance(vehicle, ControlledVehicle)  # drivers that keep a speed never ask for it
        self.nominal = dict(vehicle.action)
        self.others: list = []
        self.keys: list[int] = []
        self.seen = 0
        self.memory = np.zeros(0, MEMORY)
        self.poses = np.zeros((0, 4))
        self.poses_before = np.zeros((0, 4))  # one frame ago
        self.before = np.zeros((0, 2))  # positions one frame before `poses`
        self.earlier = np.zeros((0, 2))  # and before `poses_before`
        self.sizes: list[tuple[float, float, bool]] = []  # length, width [m], does it drive; the ego last
        self.boxes = np.zeros((0, 4))
        self.last = (np.zeros(1, ROAD_USER)[0], np.zeros(0, ROAD_USER))  # ego and others on the frame before
        self.roads: dict = {}
        self.heading: Heading | None = None
        self.road = np.zeros((0, PIECE_FIELDS))  # that the ego is measured along
        self.branches = self.road  # and everybody else
        self.jumped = np.zeros(0, bool)
        self.rooms = (float("inf"), float("inf"))  # to the left and to the right, beside who is alongside [m]
        self.ride = np.zeros(1, RIDE)[0]
        self.tally, self.since = np.zeros(1, DECISION)[0], np.zeros(1, EPISODE)[0]  # this decision, and since reset
        start_decision(self.tally)
        start_episode(self.since)
        self.record: list[Frame] | None = [] if record else None
        self.look: Look | None = None
        self.meter: Any = None  # `RiskMeter` that looks on after each frame
        self.measured: Any = None  # `EgoMeter` likewise
        self.judge = self  # or another, which watches by a table of its own
        self.evading = False  # a manoeuvre has begun, and the danger lasts
        self.answers = False  # does a filter that looks once per decision respond in this one?
        self.cruise: float | None = None  # speed to go back to after braking, where the agent has no say in it [m/s]
        self.senses: Senses | None = None  # what it sees is what is there; else `judge` sees that
        vehicle.act = self.act

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Of a pickle, whose records would say that they take what is written to them, and forget it."""
        self.__dict__ = {name: _living(value) for name, value in state.items()}

    def go_on_from(self, former: "ShieldedEgo") -> None:
        """Take the place of another car: what counts since reset goes on."""
        for name in COUNTED:
            self.since[name] = former.since[name]
        if self.judge is not self:
            self.judge.go_on_from(former.judge)

    # -- called by highway-env

    def act(self, action=None) -> None:
        vehicle = self.vehicle
        before = getattr(vehicle, "target_lane_index", None)
        type(vehicle).act(vehicle, action)
        if action is not None:
            self.nominal = dict(vehicle.action)
            self._refuse_lane_change(before)
        elif not self.check_contact():
            began = perf_counter()
            self._frame()
            spent = perf_counter() - began
            if self.judge is not self:
                self.judge.watch()
            if self.senses is not None:
                self.senses.note(self.others, self.vehicle)
            if self.measured is not None:
                self.measured.look(self, spent)
            if self.meter is not None:
                self.meter.look(self.witness)

    @property
    def witness(self) -> "ShieldedEgo":
        """Whoever sees what is there."""
        return self if self.senses is None else self.judge

    def watch(self) -> None:
        """Take in a frame on which another shield has decided."""
        self.nominal = dict(self.vehicle.action)
        self._frame()

    def _frame(self) -> None:
        vehicle = self.vehicle
        # meta-actions compute a new command on every frame, a continuous one persists
        nominal = vehicle.action if isinstance(vehicle, ControlledVehicle) else self.nominal
        steering = float(nominal["steering"])  # single precision where the agent's action is
        self._meet()
        settings = self.settings  # of this place
        users, ego, bend = self._sense()
        wish = self._command(self._throttle(nominal), steering)
        danger = find_danger(ego, users, *self.last, self.memory, settings.table)
        self.rooms = danger.room_left, danger.room_right
        response = Response(wish, False, False, False)
        if settings.overrides:
            body = Body(
                *self.body,
                bend.curvature,
                bend.slack,
                bend.turned,
                bend.idle,
                self.backs_up,
                settings.table.ego.a_min_brake,
            )
            response = self._respond(wish, danger, ego, users, body)
        command = response.command
        pairs, broken = judge_frame(ego, users, self.memory, command, bend.curvature, settings.table)
        steered = steering
        if command != wish:
            if command.slip != wish.slip:
                steered = self._steering_for(command)
            vehicle.action = {"steering": steered, "acceleration": command.acceleration}
        elif vehicle.action is not nominal and settings.overrides:
            vehicle.action = dict(nominal)
        before, self.last = self.last, (ego, users)
        count_change(
            self.tally, self.since, abs(command.acceleration - wish.acceleration), abs(float(steered - steering))
        )
        note_executed(self.tally, command.acceleration, steered)
        self.look = Look(wish, command, *response[1:], danger.response, danger.partner, pairs > 0)
        self._count(danger, response, pairs, broken)
        ride_on(self.ride, self.poses[-1, 3], self.poses[-1, 2], gap_ahead(ego, users, self.boxes), settings.table.dt)
        tally = self.tally
        if max(danger.margin_lon, danger.margin_lat) < max(tally["margin_lon"], tally["margin_lat"]):
            tally["margin_lon"], tally["margin_lat"] = danger.margin_lon, danger.margin_lat
            tally["partner"] = self._index_on_road(danger.partner)
        if self.record is not None:
            seen = ego, users, bend.curvature, tuple(self.jumped), *before
            self.record.append(Frame(tuple(self.keys), self.poses, command, *seen))

    def _command(self, acceleration: float, steering: float) -> Command:
        """What the lane frame sees of a command: the slip acts at once."""
        return Command(acceleration, float(slip_of(steering)))

    def _steering_for(self, command: Command) -> float:
        """Steering angle that a command takes [rad]."""
        return float(steering_of(command.slip))

    def _throttle(self, nominal) -> float:
        """What the agent's own controller asks for [m/s^2]; where it has none, the speed of the environment again."""
        if self.cruise is None:
            return float(nominal["acceleration"])
        return float(ControlledVehicle.KP_A * (self.cruise - self.vehicle.speed))

    def _respond(self, wish: Command, danger, ego, users, body: Body) -> Response:
        """What the filter in force makes of a command."""
        settings, table = self.settings, self.settings.table
        if settings.filter.kind != RSS:
            traffic = Traffic(ego, users, self.memory, offset_from_target(self.vehicle), None)
            state = self.answers, bool(self.tally["frames"] == 0)
            response, self.answers = answer(settings.filter, wish, traffic, danger.free, *state, body, table)
            return response
        wanted, evades = self._taken_back(wish, ego, body), False
        if settings.evasion:
            seen = ego, users, self.memory, self._room()
            wanted, self.evading, evades = evade(wanted, self.evading, *seen, body, danger.bounds, table, None)
        response = respond(wanted, danger, ego, body, table.rules, table.dt)
        if evades:
            response = Response(response.command, True, False, False)
        if settings.correction == RESPONSE:
            response = in_full(response, danger, ego, body, table.rules, table.dt)
        return response

    def _room(self) -> Room:
        """How far the vehicle may move to either side on its road."""
        vehicle = self.vehicle
        start, end, lane = vehicle.lane_index
        lanes, width = len(vehicle.road.network.graph[start][end]), float(vehicle.lane.width_at(0.0))
        offset, half = offset_from(vehicle, vehicle.lane_index), 0.5 * (width - vehicle.WIDTH)
        return Room(lane * width + half + offset, (lanes - 1 - lane) * width + half - offset)

    def _count(self, danger, response, pairs: int, broken: int) -> None:
        on = self.settings.overrides
        what = response.overridden and on, response.anticipated and on, response.limited and on
        count_frame(self.tally, self.since, *what, pairs, broken, danger.response, danger.ttc)

    def _index_on_road(self, i: int) -> int:
        """Index in `road.vehicles`; static objects follow after the vehicles."""
        road = self.vehicle.road
        everybody = [*road.vehicles, *road.objects]
        who = self.others[i] if self.senses is None else self.others[i].original
        return next((k for k, other in enumerate(everybody) if other is who), -1)

    # -- lane changes

    @property
    def _takes_back(self) -> bool:
        return self.settings.overrides and self.settings.table.rules.take_back and self.settings.scheme == LANES

    def _refuse_lane_change(self, before) -> None:
        """Ignore the lane change that the agent asks for, if it is blocked or comes half-way through another."""
        vehicle = self.vehicle
        if not self._takes_back or not isinstance(vehicle, MDPVehicle) or self.has_contact:
            return
        if self.is_refused(before, vehicle.target_lane_index):
            vehicle.target_lane_index = before
            self.tally["lane_change_refused"] = True

    def is_refused(self, before, target) -> bool:
        """Is a change from one lane to another blocked, or does it come half-way through another?"""
        return self.settings.table.rules.take_back and is_refused(self.vehicle, before, target, self.rooms)

    def _taken_back(self, wish: Command, ego, body: Body) -> Command:
        """What the agent wants, unless it is stuck between two lanes; and the lane that it heads for from now on."""
        vehicle = self.vehicle
        if not self._takes_back:
            return wish
        if not isinstance(vehicle, ControlledVehicle):
            width = vehicle.lane.width_at(0.0)
            slip = lead_back(
                wish.slip, ego, width, *self.rooms, body.half_wheelbase, body.curvature, self.settings.table.dt
            )
            if slip != wish.slip:
                self.tally["lane_change_refused"] = True
            return Command(wish.acceleration, float(slip))
        if isinstance(vehicle, MDPVehicle):
            target = reachable(vehicle, self.rooms)
            if target != vehicle.target_lane_index:
                vehicle.target_lane_index = target
                self.tally["lane_change_refused"] = True
        return wish

    # -- reading the road

    def _sense(self):
        """Everybody else `[N]` and the ego as `ROAD_USER` records in the lane frame of the ego, and its `Bend`."""
        self._choose_frame()
        users, ego = self._measure(self.poses, self.before)
        self._go_around(users, ego)
        (x, y, _, speed), dt = self.poses[-1], self.settings.table.dt
        bend = look_ahead(self.road, x, y, speed, self.body[0], dt)
        self.poses_before, self.earlier, self.before = self.poses, self.before, self.poses[:, :2]
        return users, ego, Bend(*bend)

    def _measure(self, poses, before):
        """Everybody else `[N]` and the ego as `ROAD_USER` records."""
        out = np.zeros(len(poses), ROAD_USER)
        out["wreck"][:-1] = [v.crashed or not hasattr(v, "action") for v in self.others]
        out["in_own_lane"] = [self._in_own_lane(v) for v in [*self.others, self.vehicle]]
        if self.ground is not None:
            out["kind"][:-1] = self.kinds
        dt = self.settings.table.dt
        to_lane_frame_all(self.branches, poses[:-1], before[:-1], self.boxes[:-1], dt, out[:-1])
        to_lane_frame_all(self.road, poses[-1:], before[-1:], self.boxes[-1:], dt, out[-1:])
        if self.senses is not None and self.senses.sensor.inflates:
            for user, age in zip(out[:-1], self.senses.ages, strict=True):
                inflate(user, out[-1], self.senses.sensor.accuracy, age, self.settings.table)
        return out[:-1], out[-1]

    def _go_around(self, users, ego) -> None:
        """On a closed road everybody is ahead and behind: count where the margin is smaller."""
        ego_before, users_before = self.last[0], self.last[1].copy()
        for i in np.flatnonzero(np.isfinite(users["around"])):
            around = ego, users[i], ego_before, users_before[i], self.memory[i], self.settings.table
            self.jumped[i] |= go_around(*around)
        self.last = (ego_before, users_before)

    def _meet(self) -> None:
        """Find out who is on the road, and where."""
        vehicle = self.vehicle
        others = others_on(vehicle.road, vehicle)
        if self.senses is not None:
            others = self.senses.look(others, vehicle, int(self.since["frames"]))
        if others != self.others or len(self.before) != len(others) + 1:
            self._follow(others)
        sizes = [(v.LENGTH, v.WIDTH, hasattr(v, "action")) for v in [*others, vehicle]]
        if sizes != self.sizes:  # few ever change
            self._take_boxes(sizes)
        self.poses = np.array([(*v.position, v.heading, v.speed) for v in [*others, vehicle]], dtype=float)
        if self.senses is not None:  # motion is measured, not how far two measurements are apart
            self.before[:-1] = self.poses[:-1, :2] - self.senses.motion * self.settings.table.dt
        if self.ground is not None:
            self._stand_on(self.ground)

    def _stand_on(self, ground: Ground) -> None:
        """Which parameters count where everybody is. While danger lasts, the road does not get better for the ego."""
        along = np.column_stack([self.poses[:, 0], np.cos(self.poses[:, 2]), self.poses[:, 3]])
        first = [STATES * getattr(v, "rss_group", 0) for v in self.others]
        self.kinds = np.array(
            [
                row + state_along(ground, ground.other, row, *map(float, place), v.LENGTH / 2)
                for row, place, v in zip(first, along[:-1], self.others, strict=True)
            ],
            np.int64,
        )
        state = state_along(ground, ground.ego, 0, *map(float, along[-1]), self.vehicle.LENGTH / 2)
        if self.stands >= 0 and (self.memory["since"] > 0).any():
            state = worse_of(state, self.stands)
        moved_on = self.stands >= 0 and state != self.stands
        ego_before, users_before = self.last
        for memory, other in zip(self.memory, self.kinds != users_before["kind"], strict=True):
            if other or moved_on:
                start_over(memory)
        users_before = users_before.copy()
        users_before["kind"] = self.kinds
        self.last, self.stands = (ego_before, users_before), state
        self.settings = self.settings._replace(table=table_on(self.settings.table, ground, state))

    def _follow(self, others: list) -> None:
        """Carry the memory over to a new set of road users, by identity."""
        old = {id(other): i for i, other in enumerate(self.others)}
        memory = np.zeros(len(others), MEMORY)
        poses, before, earlier = (np.full((len(others) + 1, width), np.nan) for width in (4, 2, 2))
        last = np.zeros(len(others), ROAD_USER)
        keys = []
        for i, other in enumerate(others):
            k = old.get(id(other))
            if k is None:
                keys.append(self.seen)
                self.seen += 1
            else:
                memory[i], last[i] = self.memory[k], self.last[1][k]
                poses[i], before[i], earlier[i] = self.poses_before[k], self.before[k], self.earlier[k]
                keys.append(self.keys[k])
        if len(self.before):
            poses[-1], before[-1], earlier[-1] = self.poses_before[-1], self.before[-1], self.earlier[-1]
        self.others, self.memory, self.keys = others, memory, keys
        self.poses_before, self.before, self.earlier = poses, before, earlier
        self.last = (self.last[0], last)

    def _take_boxes(self, sizes: list) -> None:
        """How far everybody reaches in the lane frame."""
        bound, bend = self.settings.table.rules.heading_bound, tightest(self.vehicle.road.network)
        self.sizes = sizes
        self.boxes = np.array([box_of(length, width, bound, bend, driven) for length, width, driven in sizes])

    def _choose_frame(self) -> None:
        """Measure along the road that the ego drives. Where that jumps, so does the sample before."""
        self.jumped = np.zeros(len(self.others), bool)
        heading = heading_of(self.vehicle)
        if heading == self.heading:
            return
        if heading not in self.roads:
            self.roads[heading] = self._roads_along(heading)
        road, branches = self.roads[heading]
        jumps = self.heading is not None and not (same_frame(self.road, road) and same_frame(self.branches, branches))
        self.heading, self.road, self.branches = heading, road, branches
        if jumps:
            self.jumped[:] = True
            self.last = self._measure_again(*self.last)
            for memory in self.memory:
                forget_safe(memory)

    def _measure_again(self, ego_before, users_before):
        """The ego and everybody else `[N]` on the frame before, in the lane frame of this one."""
        users, ego = self._measure(self.poses_before, self.earlier)
        for flag in ("wreck", "in_own_lane"):
            users[flag], ego[flag] = users_before[flag], ego_before[flag]
        for user, s in zip(users, users_before["s"], strict=True):
            keep_place(ego, user, s - ego_before["s"])
        return ego, users

    def _roads_along(self, heading: Heading):
        """The road that the ego is measured along, and the one with the branches that it may still take."""
        return roads_along(self.vehicle.road.network, heading, reach_on(self.settings.table, self.ground))

    def _in_own_lane(self, other) -> bool:
        """Is a car inside a lane that runs its way? Only asked of oncoming cars."""
        if other.lane is None or np.cos(other.heading - self.vehicle.heading) > 0.0:
            return True
        s, lateral = other.lane.local_coordinates(other.position)
        along = np.cos(other.heading - other.lane.heading_at(s)) > 0.0
        return bool(along and abs(lateral) <= (other.lane.width_at(s) - other.WIDTH) / 2)

    # -- contacts

    @property
    def has_contact(self) -> bool:
        return bool(self.since["blame"])

    @property
    def blame(self) -> str:
        """The verdict of the ego's contact, "" before one."""
        return VERDICTS[self.since["blame"] - 1] if self.has_contact else ""

    @property
    def contact(self) -> dict[str, Any] | None:
        """The contact of the ego: verdict, partner (index on the road), kind of danger, duties broken."""
        return info_at(evidence(np.array([self.since]), self.settings.table.dt), 0) if self.has_contact else None

    def had_contact_before(self) -> None:
        """The vehicle had its contact before there was a shield on it."""
        nobody = Verdict(INHERITED, 0, 0, KEPT, 0.0, KEPT, 0.0)
        enter_contact(self.since, nobody, -1, False)

    def check_contact(self) -> bool:
        """Has the ego touched somebody, or does highway-env predict it for the next frame?

        Judged at the first such sample, before the impact displaces anybody.
        """
        vehicle = self.vehicle
        if not self.has_contact and (vehicle.crashed or vehicle.impact is not None):
            if self.senses is None:
                self._judge_contact()
            if self.judge is not self:
                self.judge.check_contact()
            if self.senses is not None:
                for name in CONTACT:
                    self.since[name] = self.judge.since[name]
        return self.has_contact

    def _judge_contact(self) -> None:
        self._meet()
        if not self.others:  # the flag was not raised by a contact
            return
        dt = self.settings.table.dt
        touching = [i for i, other in enumerate(self.others) if touches(self.vehicle, other, dt)]
        if not touching:  # the flag came from elsewhere; the nearest road user is the likeliest partner
            touching = [int(np.argmin(np.hypot(*(self.poses[:-1, :2] - self.poses[-1, :2]).T)))]
        # several at once: the one that weighs most against the ego counts
        pairs = zip(touching, self._verdicts(touching), strict=True)
        i, verdict = max(pairs, key=lambda pair: weight_of(pair[1].verdict))
        if self.settings.scheme == OPEN_SPACE:
            verdict = verdict._replace(kind=verdict.kind + IN_OPEN_SPACE)
        enter_contact(self.since, verdict, self._index_on_road(i), self.settings.scheme == PLANS)

    def _verdicts(self, touching: list[int]) -> list[Verdict]:
        settings, memory = self.settings, self.memory
        users, ego, _ = self._sense()
        for i in touching:
            catch_up(memory[i], self.last[0], self.last[1][i], settings.table)
        return [judge_contact(ego, users[i], memory[i], settings.table) for i in touching]
