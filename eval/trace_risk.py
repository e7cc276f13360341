"""Driving safety field and surrogate measures of a trace, frame by frame: of any recording, whoever made it."""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.shield.geometry import box_of, locate, make_road, wrap_angle
from rss_shield.shield.lanes.frame import to_lane_frame_all
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.params import Rules
from rss_shield.shield.risk import MARKING, SOURCE, RiskSettings, neighbours, scene_risk, toward_leader
from rss_shield.shield.risk.factors import type_factor
from rss_shield.shield.risk.field import check_speeds
from rss_shield.shield.risk.markings import weight_of
from rss_shield.shield.trace import Lane, Trace

# mass [kg] and type in the field of each kind of road user; what stands about is a car that stands
CAR = 1500.0, "car"
KINDS = {
    "truck": (10_000.0, "truck"),
    "bus": (10_000.0, "truck"),
    "motorcycle": (300.0, "motorcycle"),
    "bicycle": (90.0, "cyclist"),
    "pedestrian": (75.0, "pedestrian"),
}
_REACH = 150.0  # how far the road is followed ahead and behind [m]
_LINES = ("none", "striped", "continuous")  # from weak to strong


class RiskSeries(NamedTuple):
    """Risk of one road user on every frame, `[T]` each; NaN and -1 where it is not there. See `SceneRisk`."""

    rdsi: np.ndarray  # of the critical source
    lower: np.ndarray  # its thresholds
    upper: np.ndarray
    state: np.ndarray  # its class: index into `shield.risk.STATES`, -1 = not there
    partner: np.ndarray  # index of the user that is the critical source, -1 = nobody
    largest: np.ndarray  # largest RDSI of one source
    total: np.ndarray  # sum over sources and lane markings
    ttc: np.ndarray  # toward the leader [s]
    thw: np.ndarray  # [s]
    drac: np.ndarray  # [m/s^2]


def risk_of_trace(trace: Trace, user: int, settings: RiskSettings = RiskSettings()) -> RiskSeries:
    """Risk of one road user of a trace.

    Along lanes it looks at the nearest road users ahead and behind in its lane and the adjacent ones, and where it is
    known to change lanes at whom that concerns; where roads cross or its lane is not known, at everybody in range.
    All drive on a dry road, and no person drives.

    Args:
      trace: `Trace`.
      user: index of the road user.
      settings: of the field.

    Raises:
      ValueError: no such user, or somebody is as fast as the field's wave.
    """
    users = trace.users
    if not 0 <= user < len(users.ids):
        raise ValueError(f"user = {user}: expected the index of one of {len(users.ids)} users")
    check_speeds(np.abs(users.speed[users.present]), settings)
    look = _Look(trace, user, settings)
    rows = [look.frame(t) for t in range(len(trace.time))]
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return RiskSeries(*columns)


class _Look:
    """What does not change from frame to frame."""

    def __init__(self, trace: Trace, user: int, settings: RiskSettings) -> None:
        self.trace, self.user, self.settings = trace, user, settings
        self.number = {lane.id: i for i, lane in enumerate(trace.lanes)}
        self.along_lanes = trace.meta.get("scheme", "lanes") == "lanes"
        self.toward = _heads_for(trace, user)
        self.roads: dict[tuple[int, int, int], np.ndarray] = {}
        self.lanes: dict[str, np.ndarray] = {}  # each as a road of its own
        lanes = trace.users.lane[:, user]
        self.after, self.before = _changes(lanes), _changes(lanes[::-1])[::-1]
        kinds = [KINDS.get(kind, CAR) for kind in trace.users.kinds]
        self.mass = np.array([mass for mass, _ in kinds])
        self.type_factor = np.array([type_factor(kind) for _, kind in kinds])
        self.boxes = _boxes(trace)

    def frame(self, t: int) -> tuple[Any, ...]:
        users, user, settings = self.trace.users, self.user, self.settings
        if not users.present[t, user]:
            return (*(np.nan,) * 3, -1, -1, *(np.nan,) * 5)
        others = np.flatnonzero(users.present[t])
        others = others[others != user]
        everybody = np.r_[others, user]
        poses = np.column_stack([column[t, everybody] for column in (users.x, users.y, users.heading, users.speed)])
        sources = self._sources(poses, everybody)
        lane = int(users.lane[t, user])
        along = lane >= 0 and self.along_lanes
        road = self._road(lane, t) if along else make_road([(*poses[-1, :3], 0.0, 1.0, 0.0)])
        seen = np.zeros(len(poses), ROAD_USER)
        to_lane_frame_all(road, poses, np.full((len(poses), 2), np.nan), self.boxes[everybody], self.trace.dt, seen)
        body, rest = seen[-1], seen[:-1]
        who, toward, lines = np.arange(len(rest)), 0, np.zeros(0, MARKING)
        if along:
            toward, around = self._side(lane, t), np.zeros(6, np.intp)
            width = _width(self.trace.lanes[lane])
            who = around[: neighbours(rest["s"] - body["s"], rest["y"] - body["y"], width, toward, around)]
        if lane >= 0:
            lines = self._lines(self.trace.lanes[lane], poses[-1])
        risk = scene_risk(sources[-1], sources[:-1], lines, toward != 0, settings, who)
        lead = toward_leader(body, rest)
        partner = int(others[risk.critical]) if risk.critical >= 0 else -1
        field = risk.rdsi, risk.lower, risk.upper, risk.state, partner, risk.largest, risk.total
        return (*field, lead.ttc, lead.thw, lead.drac)

    def _sources(self, poses: np.ndarray, who: np.ndarray) -> np.ndarray:
        sources = np.zeros(len(who), SOURCE)
        sources["x"], sources["y"] = poses[:, 0], poses[:, 1]
        sources["vx"], sources["vy"] = poses[:, 3] * np.cos(poses[:, 2]), poses[:, 3] * np.sin(poses[:, 2])
        sources["mass"], sources["type_factor"] = self.mass[who], self.type_factor[who]
        sources["road"] = self.settings.reference_road
        return sources

    def _road(self, lane: int, t: int) -> np.ndarray:
        """The road through a lane, as it was driven, and on along the first lane that follows."""
        key = lane, int(self.before[t]), int(self.after[t])
        if key not in self.roads:
            self.roads[key] = make_road(self._pieces(*key))
        return self.roads[key]

    def _pieces(self, lane: int, before: int, after: int) -> list[tuple[float, ...]]:
        lanes, number = self.trace.lanes, self.number
        chain, length = [lane], 0.0
        while length < _REACH:
            following = [number[name] for name in lanes[chain[-1]].successors]
            if not following or len(chain) > len(lanes):
                break
            chain.append(after if after in following else following[0])
            length += _length(lanes[chain[-1]])
        behind, length = [lane], 0.0
        while length < _REACH:
            leading = [i for i, one in enumerate(lanes) if lanes[behind[0]].id in one.successors]
            if not leading or len(behind) > len(lanes):
                break
            behind.insert(0, before if before in leading else leading[0])
            length += _length(lanes[behind[0]])
        pieces: list[tuple[float, ...]] = []
        s = -sum(_length(lanes[i]) for i in behind[:-1])
        for i in (*behind, *chain[1:]):
            pieces += _from(lanes[i], s)
            s += _length(lanes[i])
        return pieces

    def _side(self, lane: int, t: int) -> int:
        """-1 or 1 if it is on its way to the lane on its left or right, else 0."""
        here, target = self.trace.lanes[lane], self.toward[t]
        if target == lane or target < 0:
            return 0
        for side in (-1, 1):
            if target in self._beside(here, side):
                return side
        return 0

    def _beside(self, lane: Lane, side: int) -> list[int]:
        """Lanes to the left (-1) or right of one that run its way, the nearest first."""
        found: list[int] = []
        while len(found) < len(self.trace.lanes):
            name, opposite = (
                (lane.left, lane.left_runs_opposite) if side < 0 else (lane.right, lane.right_runs_opposite)
            )
            if not name or opposite:
                break
            found.append(self.number[name])
            lane = self.trace.lanes[found[-1]]
        return found

    def _lines(self, lane: Lane, pose: np.ndarray) -> np.ndarray:
        """`[2]` `MARKING` records of the lines on both sides of a lane, around x, y, heading, speed."""
        lines, width = np.zeros(2, MARKING), _width(lane)
        if lane.id not in self.lanes:
            self.lanes[lane.id] = make_road(_from(lane))
        _, y, heading, _ = locate(self.lanes[lane.id], *pose[:2])
        across = pose[3] * np.sin(pose[2] - heading)
        for k, side in enumerate((-1, 1)):
            room = 0.5 * width - side * y  # negative beyond the line
            approach = side * across if room >= 0.0 else -side * across
            lines[k] = weight_of(self._line(lane, side), self.settings), abs(room), approach, width
        return lines

    def _line(self, lane: Lane, side: int) -> str:
        """Kind of the line on one side of a lane. It may be drawn as that of the lane beside it."""
        drawn = [lane.left_line if side < 0 else lane.right_line]
        beside = self._beside(lane, side)
        if beside:
            other = self.trace.lanes[beside[0]]
            drawn.append(other.right_line if side < 0 else other.left_line)
        strongest = max((_LINES.index(kind) for kind in drawn if kind in _LINES), default=0)
        return ("none", "striped", "solid" if beside else "edge")[strongest]


def _boxes(trace: Trace) -> np.ndarray:
    """`[N, 4]` length, width, and the largest half extents that each driver may use along and across its lane [m].

    As the shield takes them: at the largest angle to the lane that the rules in force allow, or a tight bend asks for.
    """
    users, rules = trace.users, trace.meta.get("rules", {})
    bound = float(rules.get("heading_bound", Rules().heading_bound))
    bend = max((abs(arc[3]) for lane in trace.lanes for arc in _arcs(lane)), default=0.0)
    everybody = zip(users.length, users.width, users.kinds, strict=True)
    return np.array([box_of(length, width, bound, bend, kind != "obstacle") for length, width, kind in everybody])


def _heads_for(trace: Trace, user: int) -> np.ndarray:
    """`[T]` index of the lane that a road user heads for, -1 = not known; traces of our own say so."""
    number = {lane.id: i for i, lane in enumerate(trace.lanes)}
    target = np.full(len(trace.time), -1)
    for t, row, name, *_ in trace.meta.get("routes", ()):
        if row == user:
            target[t:] = number.get(name, -1)
    return target


def _changes(lanes: np.ndarray) -> np.ndarray:
    """`[T]` the next lane that is another one, -1 = none."""
    following = np.full(len(lanes), -1)
    for t in range(len(lanes) - 2, -1, -1):
        following[t] = lanes[t + 1] if lanes[t + 1] != lanes[t] else following[t + 1]
    return following


def _arcs(lane: Lane) -> list[tuple[float, float, float, float, float]]:
    """x, y, heading, curvature, length of each piece of a centre line."""
    found = []
    for (x, y, heading), (x_next, y_next, heading_next) in zip(lane.centre[:-1], lane.centre[1:], strict=True):
        turn = float(wrap_angle(heading_next - heading))
        chord = float(np.hypot(x_next - x, y_next - y))
        length = chord if abs(turn) < 1e-9 else chord * 0.5 * turn / np.sin(0.5 * turn)
        found.append((float(x), float(y), float(heading), turn / length if length else 0.0, float(length)))
    return found


def _from(lane: Lane, s: float = 0.0) -> list[tuple[float, ...]]:
    """Its pieces with the arc length at which each starts, for `make_road`; the first at `s` [m]."""
    arcs = _arcs(lane)
    starts = s + np.cumsum([0.0, *(arc[4] for arc in arcs)])
    return [(*arc, float(start)) for arc, start in zip(arcs, starts, strict=False)]


def _length(lane: Lane) -> float:
    return sum(piece[4] for piece in _arcs(lane))


def _width(lane: Lane) -> float:
    return float(lane.width[0])
