"""The driving safety field around one ego on highway-env: a measure that changes nothing."""

from typing import Any, NamedTuple

import numpy as np

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import CAR_MASS, LANES
from rss_shield.envs.roads.lines import line_beside
from rss_shield.shield.geometry import make_road
from rss_shield.shield.lanes.frame import to_lane_frame_all
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.risk import (
    MARKING,
    SOURCE,
    STATES,
    RiskSettings,
    band_risk,
    neighbours,
    scene_risk,
    toward_leader,
)
from rss_shield.shield.risk.field import check_speeds
from rss_shield.shield.risk.markings import weight_of
from rss_shield.shield.tally import LONGEST_TTC


class RiskFrame(NamedTuple):
    """Risk of one frame; see `shield.risk.SceneRisk` and `Surrogates`."""

    time: float  # since reset [s]
    rdsi: float  # of the critical source
    lower: float  # its thresholds
    upper: float
    state: int  # its class: index into `STATES`
    partner: int  # its index in `road.vehicles`, static objects after them; -1 = nobody
    largest: float  # largest RDSI of one source
    total: float  # sum of all sources and lane markings
    state_of_total: int
    ttc: float  # toward the leader [s]
    thw: float  # [s]
    drac: float  # [m/s^2]


class RiskMeter:
    """Looks at an ego once per frame, after its shield.

    Along lanes it looks at the nearest road users ahead and behind in the ego's lane and the adjacent ones, where it
    changes lanes at whom that concerns; where roads cross, at everybody in range. All count as cars that no person
    drives, on a dry road.
    """

    def __init__(self, settings: RiskSettings) -> None:
        self.settings = settings
        self.frames: list[RiskFrame] = []
        self.before = 0  # frames before this step
        self.dt = 0.0

    def begin_step(self) -> None:
        """Infos are about the frames from here on."""
        self.before = len(self.frames)

    def look(self, ego: ShieldedEgo) -> None:
        """Take in one frame."""
        self.dt = ego.settings.table.dt
        sources = _sources(ego.poses, self.settings)
        along_lanes = ego.settings.scheme == LANES
        body, users = ego.last if along_lanes else _straight_ahead(ego)
        who, changes_lane = np.arange(len(users)), False
        if along_lanes:
            toward = _lane_change(ego.vehicle)
            changes_lane, width = toward != 0, _lane_width(ego.vehicle)
            around = np.zeros(6, np.intp)
            who = around[: neighbours(users["s"] - body["s"], users["y"] - body["y"], width, toward, around)]
        lines = _lines(ego.vehicle, self.settings)
        risk = scene_risk(sources[-1], sources[:-1], lines, changes_lane, self.settings, who)
        lead = toward_leader(body, users)
        self.frames.append(
            RiskFrame(
                len(self.frames) * self.dt,
                risk.rdsi,
                risk.lower,
                risk.upper,
                risk.state,
                ego._index_on_road(risk.critical) if risk.critical >= 0 else -1,
                risk.largest,
                risk.total,
                risk.state_of_total,
                lead.ttc,
                lead.thw,
                lead.drac,
            )
        )

    def info(self) -> dict[str, Any]:
        """What infos say of this step, and since reset; see `ShieldWrapper`."""
        # after a contact there are no more frames, and the last one counts on
        step = self.frames[self.before :] or self.frames[-1:] or [_NOTHING]
        worst = max(step, key=lambda frame: (frame.state, frame.rdsi / frame.upper))
        times, rdsi, lower, upper, states = np.array(self.frames or [_NOTHING])[:, :5].T
        seconds = np.bincount(states.astype(int), minlength=len(STATES)) * self.dt
        least_stay = self.settings.least_stay
        return {
            "risk": {
                "rdsi": worst.rdsi,
                "lower": worst.lower,
                "upper": worst.upper,
                "state": STATES[worst.state],
                "partner": worst.partner,
                "largest": max(frame.largest for frame in step),
                "total": max(frame.total for frame in step),
                "state_of_total": STATES[max(frame.state_of_total for frame in step)],
                "ttc": min(frame.ttc for frame in step),
                "thw": min(frame.thw for frame in step),
                "drac": max(frame.drac for frame in step),
            },
            "max_rdsi": max((frame.largest for frame in self.frames), default=0.0),
            "max_total_rdsi": max((frame.total for frame in self.frames), default=0.0),
            **{f"time_{name}": float(time) for name, time in zip(STATES, seconds, strict=True)},
            "band_risk": band_risk(times, rdsi, lower, upper, least_stay=least_stay).total,
            "min_thw": min([LONGEST_TTC, *(frame.thw for frame in self.frames)]),
            "max_drac": max((frame.drac for frame in self.frames), default=0.0),
        }


_NOTHING = RiskFrame(0.0, 0.0, 1.0, 1.0, 0, -1, 0.0, 0.0, 0, np.inf, np.inf, 0.0)


def _sources(poses: np.ndarray, settings: RiskSettings) -> np.ndarray:
    """`[N]` `SOURCE` records of x, y, heading, speed `[N, 4]`."""
    check_speeds(np.abs(poses[:, 3]), settings)
    sources = np.zeros(len(poses), SOURCE)
    sources["x"], sources["y"] = poses[:, 0], poses[:, 1]
    sources["vx"], sources["vy"] = poses[:, 3] * np.cos(poses[:, 2]), poses[:, 3] * np.sin(poses[:, 2])
    sources["mass"], sources["type_factor"], sources["road"] = CAR_MASS, 1.0, settings.reference_road
    return sources


def _straight_ahead(ego: ShieldedEgo) -> tuple[np.ndarray, np.ndarray]:
    """The ego and everybody else as `ROAD_USER` records, as if its lane went straight on."""
    users = np.zeros(len(ego.poses), ROAD_USER)
    x, y, heading, _ = ego.poses[-1]
    road = make_road([(x, y, heading, 0.0, 1.0, 0.0)])
    to_lane_frame_all(road, ego.poses, np.full((len(users), 2), np.nan), ego.boxes, ego.settings.table.dt, users)
    return users[-1], users[:-1]


def _lane_change(vehicle: Any) -> int:
    """-1 or 1 if a vehicle is on its way to the lane on its left or right, else 0."""
    target, index = getattr(vehicle, "target_lane_index", None), vehicle.lane_index
    if target is None or index is None or target[:2] != index[:2]:
        return 0
    return int(np.sign(target[2] - index[2]))


def _lane_width(vehicle: Any) -> float:
    return float(vehicle.lane.width_at(vehicle.lane.local_coordinates(vehicle.position)[0]))


def _lines(vehicle: Any, settings: RiskSettings) -> np.ndarray:
    """`[2]` `MARKING` records of the lines on both sides of the lane that a vehicle is on."""
    lane = vehicle.lane
    s, y = lane.local_coordinates(vehicle.position)
    width, speed = lane.width_at(s), vehicle.speed * np.sin(vehicle.heading - lane.heading_at(s))
    lines = np.zeros(2, MARKING)
    for k, side in enumerate((-1, 1)):
        room = 0.5 * width - side * y  # negative beyond the line
        approach = side * speed if room >= 0.0 else -side * speed
        lines[k] = (
            weight_of(line_beside(vehicle.road.network, vehicle.lane_index, side), settings),
            abs(room),
            approach,
            width,
        )
    return lines
