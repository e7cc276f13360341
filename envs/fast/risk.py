"""The driving safety field around one ego in the frame loop: `envs.highway.risk` on the engine's arrays.

Where nobody asked for it there is no meter, and numba leaves all of this out of the kernel.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.fast.boxes import boxes_of
from rss_shield.envs.fast.neighbours import car_of, row_before
from rss_shield.envs.fast.state import META, OBSTACLE
from rss_shield.envs.options import CAR_MASS, Settings
from rss_shield.envs.roads.lanes import tightest
from rss_shield.envs.roads.lines import line_beside
from rss_shield.envs.roads.network import heading_at, local_coordinates
from rss_shield.shield._numba.compiled import inner, part
from rss_shield.shield.geometry import (
    AFTER,
    ARC_START,
    AROUND,
    BEFORE,
    COS,
    CURVATURE,
    FREE,
    HEADING,
    LENGTH,
    SIN,
    X,
    Y,
)
from rss_shield.shield.lanes.frame import to_lane_frame
from rss_shield.shield.risk import KNOWN_SAFE, UNKNOWN, RiskSettings, neighbours, scene_risk, toward_leader
from rss_shield.shield.risk.markings import weight_of

LONGEST_THW = 100.0  # headways are reported up to this [s]

_FRAME = [
    ("rdsi", "f8"),  # of the critical source
    ("lower", "f8"),  # its thresholds
    ("upper", "f8"),
    ("state", "i8"),  # its class: index into `shield.risk.STATES`
    ("partner", "i8"),  # its index among the cars, -1 = nobody
    ("largest", "f8"),  # largest RDSI of one source
    ("total", "f8"),  # sum of all sources and lane markings
    ("state_of_total", "i8"),
    ("ttc", "f8"),  # toward the leader [s]
    ("thw", "f8"),  # [s]
    ("drac", "f8"),  # [m/s^2]
]

# Risk around one ego: of the worst frame of this decision, of the last frame, and since reset.
RISK = np.dtype(
    [
        *_FRAME,
        *[(f"last_{name}", kind) for name, kind in _FRAME],
        ("looks", "i8"),  # frames of this decision
        ("frames", "i8"),  # since reset
        ("max_rdsi", "f8"),
        ("max_total_rdsi", "f8"),
        ("known_safe", "i8"),  # frames in each class
        ("unknown", "i8"),
        ("known_unsafe", "i8"),
        ("min_thw", "f8"),  # [s]
        ("max_drac", "f8"),  # [m/s^2]
        # stays in the unknown band, see `shield.risk.stays`
        ("stays", "?"),  # the last frame is in one
        ("stay_begin", "f8"),  # of the last one [s]
        ("stay_end", "f8"),
        ("stay_risk", "f8"),  # [s]
        ("ended_risk", "f8"),  # of those before it [s]
        ("band_risk", "f8"),  # of all that count [s]
    ],
    align=True,
)


class Field(NamedTuple):
    """What the measure goes by. L lanes."""

    settings: RiskSettings
    eta: np.ndarray  # `[L, 2]` weight of the line on the left and right of each lane
    boxes: np.ndarray  # `[2, 4]` length, width, largest half extents of a car and of an obstacle [m]
    dt: float  # length of a frame [s]


class Meter(NamedTuple):
    """The measure around the ego of one environment."""

    field: Field
    risks: np.ndarray  # `[1]` RISK; compiled functions return no records


def compile_field(network, risk: RiskSettings, settings: Settings) -> Field:
    """What does not change on a `highway_env.road.road.RoadNetwork`."""
    eta = [[weight_of(line_beside(network, index, side), risk) for side in (-1, 1)] for index in network.lanes_dict()]
    boxes = boxes_of(settings.table.rules.heading_bound, tightest(network))
    return Field(risk, np.array(eta), boxes, settings.table.dt)


# The arguments of these are None where nobody asked, and numba leaves out of the kernel what they would need.


@inner
def meter_of(e, field, risks):
    """`Meter` of environment `e` of a batch."""
    if field is None or risks is None:
        return None
    return Meter(field, risks[e : e + 1])


@inner
def start_risk(meter):
    """Forget everything at the start of an episode."""
    if meter is not None:
        _start(meter.risks[0])


@inner
def begin_looks(meter):
    """The step is about the frames from here on."""
    if meter is not None:
        meter.risks[0].looks = 0


@inner
def report_risk(e, meter, out):
    """Put what a step says of environment `e` into `out` `[E]` RISK."""
    if meter is not None:
        _report(meter)
        out[e] = meter.risks[0]


@inner
def look_at_risk(cars, episode, lanes, sight, distances, meter):
    """Take in one frame, after the shield."""
    if meter is not None:
        _place_sources(cars, episode, meter.field.settings, sight)
        _mark(cars[episode.ego], lanes, meter.field.eta, sight)
        _look(cars, episode, lanes, sight, distances, meter)


@inner
def _look(cars, episode, lanes, sight, distances, meter):
    if distances is None:
        _look_around(cars, episode, sight, meter)
    else:
        _look_along_lane(cars, episode, lanes, sight, distances, meter)


# ---------------------------------------------------------------- one frame


@part
def _place_sources(cars, episode, settings, sight):
    """Everybody else as `SOURCE` records, in the order of `car_of`, the ego last."""
    for i in range(episode.cars):
        k = car_of(i, episode) if i < episode.cars - 1 else episode.ego
        car, source = cars[k], sight.sources[i]
        source.x, source.y = car.x, car.y
        source.vx, source.vy = car.speed * np.cos(car.heading), car.speed * np.sin(car.heading)
        source.mass, source.type_factor = CAR_MASS, 1.0
        source.road, source.driver = settings.reference_road, 0.0


@part
def _mark(ego, lanes, eta, sight):
    """`MARKING` records of the lines on both sides of the ego's lane."""
    lane = lanes[ego.lane]
    s, y = local_coordinates(lane, ego.x, ego.y)
    across = ego.speed * np.sin(ego.heading - heading_at(lane, s))
    for k in range(2):
        side, line = 2 * k - 1, sight.lines[k]
        room = 0.5 * lane.width - side * y  # negative beyond the line
        line.eta, line.distance, line.lane_width = eta[ego.lane, k], abs(room), lane.width
        line.approach = side * across if room >= 0.0 else -side * across


@part
def _look_along_lane(cars, episode, lanes, sight, distances, meter):
    """Whoever is nearest ahead and behind in the ego's lane and beside it, or concerns its lane change."""
    ego, frames, past, n = cars[episode.ego], distances.frames, distances.past, episode.cars - 1
    road = frames.pieces[frames.start[episode.frame_road] : frames.start[episode.frame_road + 1]]
    now, before = past.trail[episode.turn], past.trail[row_before(episode)]
    for i in range(n):
        k = car_of(i, episode)
        box = meter.field.boxes[1 if cars[k].kind == OBSTACLE else 0]
        _to_record(road, now[k], before[k].x, before[k].y, box, meter.field.dt, sight.measured[i])
    body = past.ego[episode.turn]
    for i in range(n):
        sight.x[i], sight.y[i] = sight.measured[i].s - body.s, sight.measured[i].y - body.y
    toward = _lane_change(ego, lanes)
    count = neighbours(sight.x[:n], sight.y[:n], lanes[ego.lane].width, toward, sight.around)
    settings = meter.field.settings
    risk = scene_risk(
        sight.sources[n], sight.sources[:n], sight.lines, toward != 0, settings, sight.around[:count]
    )  # fmt: skip
    _take(risk, toward_leader(body, sight.measured[:n]), episode, meter)


@part
def _look_around(cars, episode, sight, meter):
    """Everybody in range; the leader is looked for as if the ego's lane went straight on."""
    ego, n = cars[episode.ego], episode.cars - 1
    road = sight.straight
    road[0, X], road[0, Y], road[0, HEADING] = ego.x, ego.y, ego.heading
    road[0, CURVATURE], road[0, LENGTH], road[0, ARC_START] = 0.0, 1.0, 0.0
    road[0, COS], road[0, SIN] = np.cos(ego.heading), np.sin(ego.heading)
    road[0, BEFORE] = road[0, AFTER] = FREE
    road[0, AROUND] = np.inf
    for i in range(episode.cars):
        car = cars[car_of(i, episode) if i < n else episode.ego]
        box = meter.field.boxes[1 if car.kind == OBSTACLE else 0]
        to_lane_frame(
            road,
            car.x,
            car.y,
            car.heading,
            car.speed,
            np.cos(car.heading),
            np.sin(car.heading),
            np.nan,
            np.nan,
            box,
            meter.field.dt,
            sight.measured[i],
        )
    risk = scene_risk(sight.sources[n], sight.sources[:n], sight.lines, False, meter.field.settings)
    _take(risk, toward_leader(sight.measured[n], sight.measured[:n]), episode, meter)


@inner
def _to_record(road, pose, x_before, y_before, box, dt, user):
    to_lane_frame(road, pose.x, pose.y, pose.heading, pose.speed, pose.cos, pose.sin, x_before, y_before, box, dt, user)


@inner
def _lane_change(ego, lanes):
    """-1 or 1 if the ego is on its way to the lane on its left or right, else 0."""
    here, target = lanes[ego.lane], lanes[ego.target_lane]
    if ego.kind != META or here.road != target.road or here.id == target.id:
        return 0
    return 1 if target.id > here.id else -1


# ---------------------------------------------------------------- since reset


@inner
def _start(risk):
    risk.rdsi = risk.largest = risk.total = risk.drac = 0.0
    risk.lower = risk.upper = 1.0
    risk.state = risk.state_of_total = KNOWN_SAFE
    risk.partner = -1
    risk.ttc = risk.thw = np.inf
    _keep(risk)
    risk.looks = risk.frames = risk.known_safe = risk.unknown = risk.known_unsafe = 0
    risk.max_rdsi = risk.max_total_rdsi = risk.max_drac = 0.0
    risk.min_thw = LONGEST_THW
    risk.stays = False
    risk.stay_begin = risk.stay_end = risk.stay_risk = risk.ended_risk = risk.band_risk = 0.0


@inner
def _keep(risk):
    """What the step says is what the last frame says."""
    risk.last_rdsi, risk.last_lower, risk.last_upper = risk.rdsi, risk.lower, risk.upper
    risk.last_state, risk.last_partner = risk.state, risk.partner
    risk.last_largest, risk.last_total, risk.last_state_of_total = risk.largest, risk.total, risk.state_of_total
    risk.last_ttc, risk.last_thw, risk.last_drac = risk.ttc, risk.thw, risk.drac


@inner
def _take(scene, lead, episode, meter):
    """Add a frame to what is known of the step and of the episode."""
    risk = meter.risks[0]
    _stay(risk, scene, meter.field)
    risk.last_rdsi, risk.last_lower, risk.last_upper = scene.rdsi, scene.lower, scene.upper
    risk.last_state = scene.state
    risk.last_partner = car_of(scene.critical, episode) if scene.critical >= 0 else -1
    risk.last_largest, risk.last_total, risk.last_state_of_total = scene.largest, scene.total, scene.state_of_total
    risk.last_ttc, risk.last_thw, risk.last_drac = lead.ttc, lead.thw, lead.drac
    here, worst = scene.rdsi / scene.upper, risk.rdsi / risk.upper
    if risk.looks == 0 or scene.state > risk.state or (scene.state == risk.state and here > worst):
        risk.rdsi, risk.lower, risk.upper = scene.rdsi, scene.lower, scene.upper
        risk.state, risk.partner = scene.state, risk.last_partner
    if risk.looks == 0:
        risk.largest, risk.total, risk.state_of_total = scene.largest, scene.total, scene.state_of_total
        risk.ttc, risk.thw, risk.drac = lead.ttc, lead.thw, lead.drac
    else:
        risk.largest, risk.total = max(risk.largest, scene.largest), max(risk.total, scene.total)
        risk.state_of_total = max(risk.state_of_total, scene.state_of_total)
        risk.ttc, risk.thw, risk.drac = min(risk.ttc, lead.ttc), min(risk.thw, lead.thw), max(risk.drac, lead.drac)
    risk.looks += 1
    if risk.frames == 0:  # largest values may be negative
        risk.max_rdsi, risk.max_total_rdsi = scene.largest, scene.total
    risk.frames += 1
    risk.max_rdsi, risk.max_total_rdsi = max(risk.max_rdsi, scene.largest), max(risk.max_total_rdsi, scene.total)
    risk.min_thw, risk.max_drac = min(risk.min_thw, lead.thw), max(risk.max_drac, lead.drac)
    risk.known_safe += scene.state == KNOWN_SAFE
    risk.unknown += scene.state == UNKNOWN
    risk.known_unsafe += scene.state > UNKNOWN


@inner
def _stay(risk, scene, field):
    """Take in the way from the last frame to this one, linear, as `shield.risk.stays.band_risk` does."""
    if risk.frames == 0:
        return
    dt, before = field.dt, (risk.frames - 1) * field.dt
    up = _positive_part(risk.last_rdsi - risk.last_lower, scene.rdsi - scene.lower)
    down = _positive_part(risk.last_upper - risk.last_rdsi, scene.upper - scene.rdsi)
    start, end = max(up[0], down[0]), min(up[1], down[1])
    if end <= start:
        risk.stays = False
        return
    if not (risk.stays and start == 0.0):
        _end_stay(risk, field.settings.least_stay)
        risk.stay_begin, risk.stay_risk = before + dt * start, 0.0
    risk.stay_risk += dt * (end - start) * (risk.last_rdsi + (scene.rdsi - risk.last_rdsi) * 0.5 * (start + end))
    risk.stay_end = before + dt * end
    risk.stays = end == 1.0


@inner
def _positive_part(first, second):
    """Where between two samples a series is not negative: from one fraction of the step to another."""
    if first < 0.0 and second < 0.0:
        return 0.0, -1.0
    if first < 0.0:
        return first / (first - second), 1.0
    return 0.0, first / (first - second) if second < 0.0 else 1.0


@inner
def _end_stay(risk, least_stay):
    """Whether a stay counts is known when it has ended."""
    if risk.stay_end - risk.stay_begin >= least_stay - 1e-9:
        risk.ended_risk += risk.stay_risk
    risk.stay_begin = risk.stay_end = risk.stay_risk = 0.0


@part
def _report(meter):
    """Fill in what depends on how the step went on."""
    risk = meter.risks[0]
    if risk.looks == 0:  # after a contact there are no more frames, and the last one counts on
        risk.rdsi, risk.lower, risk.upper = risk.last_rdsi, risk.last_lower, risk.last_upper
        risk.state, risk.partner = risk.last_state, risk.last_partner
        risk.largest, risk.total, risk.state_of_total = risk.last_largest, risk.last_total, risk.last_state_of_total
        risk.ttc, risk.thw, risk.drac = risk.last_ttc, risk.last_thw, risk.last_drac
    counts = risk.stay_end - risk.stay_begin >= meter.field.settings.least_stay - 1e-9
    risk.band_risk = risk.ended_risk + (risk.stay_risk if counts else 0.0)
