"""Who is near enough to the ego, along its lane, to be measured (Defs. 1-10).

On a straight road the distance along it follows from positions in the world, and so does a bound of the
longitudinal margin. Whoever is safe beyond doubt by that, and not the nearest, is not measured at all. The
engine keeps where everybody was on the last three frames, so that a sample that was left out can be made up for.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.fast.state import OBSTACLE, UNSEEN
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.lanes import reach_on, road_through, turned_round
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, STRAIGHT, heading_at
from rss_shield.envs.sensing import age_of
from rss_shield.shield._numba.compiled import inner, rare
from rss_shield.shield.comfort import gap_in_way
from rss_shield.shield.geometry import COS, SIN, is_straight
from rss_shield.shield.ground import STATES, Ground, state_along, table_of_kind, table_on, worse_of
from rss_shield.shield.lanes.controller import beyond_doubt, may_be_next
from rss_shield.shield.lanes.far_pairs import least_margin, own_share
from rss_shield.shield.lanes.frame import look_ahead, same_frame, to_lane_frame
from rss_shield.shield.lanes.inflation import inflate
from rss_shield.shield.lanes.look_ahead import look_ahead_at, look_ahead_of, may_bind
from rss_shield.shield.lanes.memory import MEMORY, forget_safe, start_over
from rss_shield.shield.lanes.pair import ROAD_USER, leading_speed, least_cosine, slowed

_HALF_DIAGONAL = np.hypot(CAR_LENGTH, CAR_WIDTH) / 2  # no road user is longer, however it is turned [m]
_ROUNDING = 1e-6  # more than world and lane coordinates differ by [m]
_FRAMES = 3  # that the trail goes back

# Where one road user was on one frame.
POSE = np.dtype(
    [
        ("x", "f8"),  # [m]; nan before the first frame
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("speed", "f8"),  # [m/s]
        ("cos", "f8"),  # of the heading
        ("sin", "f8"),
        ("kind", "i8"),  # row of its parameters
        ("wreck", "?"),
        ("in_own_lane", "?"),
    ],
    align=True,
)


class LaneFrames(NamedTuple):
    """What the shield measures by where distances along lanes keep the ego safe. L lanes."""

    pieces: np.ndarray  # `[P, 11]` pieces of the roads through all lanes, then of the same roads turned round
    start: np.ndarray  # `[2 L + 1]` where each road starts among the pieces
    same: np.ndarray  # `[2 L, 2 L]` no gap jumps between the two frames
    ground: Ground | None = None  # where not all of it, or not everybody on it, is alike


class Past(NamedTuple):
    """What the shield remembers on lanes: N road users. A batch has one more axis in front."""

    memory: np.ndarray  # `[N]` MEMORY of everybody but the ego
    trail: np.ndarray  # `[3, N]` POSE; `episode.turn` is the row of the last frame
    ego: np.ndarray  # `[3]` ROAD_USER, the ego likewise
    near: np.ndarray  # `[N]` the first `episode.near` are those of the others who were measured on the last frame


class Distances(NamedTuple):
    """One ego kept safe by distances along its lane (Defs. 1-10)."""

    frames: LaneFrames
    past: Past


def compile_lane_frames(network, settings: Settings, ground: Ground | None = None) -> LaneFrames:
    """Lane frames of all lanes of a `highway_env.road.road.RoadNetwork`: one each, because its lanes do not fork."""
    reach = reach_on(settings.table, ground)
    lanes = [road_through(network, index, reach) for index in network.lanes_dict()]
    roads = lanes + [turned_round(road) for road in lanes]
    same = np.array([[same_frame(a, b) for b in roads] for a in roads])
    return LaneFrames(np.concatenate(roads), np.cumsum([0, *map(len, roads)]), same, ground)


@inner
def road_under(ego, index, lanes, sight):
    """Row of the road that the ego is measured along: that of its lane, or turned round if it drives against that."""
    lane = lanes[ego.lane]
    if lane.kind == STRAIGHT:
        # (ly, -lx) points along the lane
        against = ego.cos * lane.ly - ego.sin * lane.lx < 0.0
    else:
        against = np.cos(ego.heading - heading_at(lane, sight.s[ego.lane, index])) < 0.0
    return ego.lane + len(lanes) if against else ego.lane


def make_past(num_envs: int, n: int) -> Past:
    """Room for what is remembered of `n` road users in each environment."""
    return Past(
        np.zeros((num_envs, n), MEMORY),
        np.zeros((num_envs, _FRAMES, n), POSE),
        np.zeros((num_envs, _FRAMES), ROAD_USER),
        np.zeros((num_envs, n), np.int64),
    )


@inner
def start_past(episode, past, blank):
    """Forget everybody at the start of an episode; `blank`: `[1]` MEMORY of a first sight."""
    for i in range(len(past.memory)):
        past.memory[i] = blank[0]
        past.trail[0, i].x = past.trail[0, i].y = np.nan
    episode.frame_road, episode.turn, episode.near, episode.stands = -1, 0, 0, -1
    if len(past.memory) > 0:  # there is a shield
        _mark_all(episode, past)


@inner
def _mark_all(episode, past):
    """Count everybody among the near ones."""
    episode.near = episode.cars - 1
    for i in range(episode.near):
        past.near[i] = i


@inner
def car_of(user, episode):
    """Index among the cars of an index among the others."""
    return user if user < episode.ego else user + 1


@inner
def measure(cars, episode, lanes, sight, distances, boxes, settings, chosen, nearest, soonest, within, aware=None):
    """Take this frame in, and measure the ego and whoever matters on it in the ego's lane frame.

    Who that is stands in `past.near`. The ego's record is in `past.ego`, theirs are in `sight.users`, and those of
    the frame before, where they were left out on it, in `sight.users_before`.

    Args:
      cars, episode, lanes, sight: of the environment.
      distances: `Distances`.
      boxes: as in `Watch`.
      settings: `envs.options.Settings`.
      chosen: those who matter are in `past.near` already, the first `episode.near`.
      nearest, soonest: as in `shield.lanes.controller.find_danger`.
      within: whose margin is less than this matters, too [m].
      aware: `Aware`, whose cars these are, None = these are the cars that are there. Of those who are seen everybody
        matters.

    Returns:
      `shield.lanes.frame.Bend` under the ego.
    """
    frames, past, ego, dt = distances.frames, distances.past, cars[episode.ego], settings.table.dt
    episode.turn = _row(episode, 1)
    under = road_under(ego, episode.ego, lanes, sight)
    under_before, jumps = _choose_frame(episode, distances, under)
    now, before, earlier = past.trail[episode.turn], past.trail[row_before(episode)], past.trail[_row(episode, 1)]
    road = frames.pieces[frames.start[under] : frames.start[under + 1]]
    road_before = frames.pieces[frames.start[under_before] : frames.start[under_before + 1]]
    if jumps:
        _start_again(episode, past, road, before, earlier, boxes[0], dt)
        road_before = road
    me = past.ego[episode.turn]
    _note(ego, now[episode.ego])
    _to_record(road, now[episode.ego], before[episode.ego], boxes[0], dt, me)
    me.wreck, me.in_own_lane = False, True
    sight.z[0] = np.inf  # gap ahead
    threshold = _look_over(cars, episode, ego, me, road, now, before, boxes, sight, settings, soonest, distances)
    if aware is not None:
        _choose_seen(cars, episode, past, now, before, earlier, aware, dt)
    elif not chosen:
        far = beyond_doubt(me.speed, settings.table.ego, dt)
        _choose_near(episode, past, sight.x, max(min(threshold, nearest), far, within) + _ROUNDING)
    for a in range(episode.near):
        i = past.near[a]
        k = car_of(i, episode)
        car, pose, user = cars[k], now[k], sight.users[i]
        box = boxes[1 if car.kind == OBSTACLE else 0]
        _to_record(road, pose, before[k], box, dt, user)
        pose.in_own_lane = _in_own_lane(k, car, ego, lanes, sight)
        user.wreck, user.in_own_lane, user.kind = pose.wreck, pose.in_own_lane, pose.kind
        if not is_straight(road):
            _note_gap(user.s - me.s, user.y - me.y, box, boxes[0], sight)
        if aware is not None:
            _settle(i, k, me, jumps, past.memory[i], sight, episode, aware, settings)
        if past.memory[i].skipped and (aware is None or jumps):
            _make_up(road_before, before[k], pose.kind, earlier[k], box, dt, sight.users_before[i])
            if aware is not None:
                _inflate(k, past.ego[row_before(episode)], sight.users_before[i], episode, aware, settings)
    return look_ahead(road, ego.x, ego.y, ego.speed, ego.length / 2, dt)


@inner
def _choose_seen(cars, episode, past, now, before, earlier, aware, dt):
    """List whoever is seen, and forget the others. Motion is measured, not how far two measurements are apart."""
    count = 0
    for i in range(episode.cars - 1):
        k = car_of(i, episode)
        if cars[k].kind == UNSEEN:
            past.memory[i] = aware.blank[0]
            continue
        percept = aware.percepts[k]
        if percept.since == episode.frames:  # another ghost than on the frame before
            past.memory[i] = aware.blank[0]
        before[k].x, before[k].y = now[k].x - percept.vx * dt, now[k].y - percept.vy * dt
        earlier[k].x, earlier[k].y = before[k].x - percept.vx * dt, before[k].y - percept.vy * dt
        past.near[count] = i
        count += 1
    episode.near = count


@inner
def _settle(i, k, me, jumps, memory, sight, episode, aware, settings):
    """What is seen of road user `i`, who is car `k`, now and on the frame before."""
    _inflate(k, me, sight.users[i], episode, aware, settings)
    if memory.skipped and not jumps:
        sight.users_before[i] = aware.last[i]
        sight.users_before[i].kind = sight.users[i].kind


@inner
def _inflate(k, me, user, episode, aware, settings):
    sensor = aware.sensor
    if sensor.inflates:
        inflate(user, me, sensor.accuracy, age_of(aware.percepts[k], episode.frames, sensor), settings.table)


@inner
def keep_seen(episode, past, sight, aware):
    """Keep what was seen on this frame for the next."""
    for a in range(episode.near):
        i = past.near[a]
        aware.last[i] = sight.users[i]


@inner
def _note_gap(along, across, box, own, sight):
    """Keep the smallest gap ahead in `sight.z[0]` [m]; `box`, `own`: length and width of the two."""
    sight.z[0] = min(sight.z[0], gap_in_way(along, across, own[0] + box[0], own[1] + box[1]))


@rare
def _make_up(road, pose, kind, earlier, box, dt, user):
    _to_record(road, pose, earlier, box, dt, user)
    user.wreck, user.in_own_lane, user.kind = pose.wreck, pose.in_own_lane, kind


@inner
def _row(episode, frames):
    """Row of the trail so many frames on."""
    row = episode.turn + frames
    return row if row < _FRAMES else row - _FRAMES


@inner
def row_before(episode):
    """Row of the trail of the frame before the last."""
    return _row(episode, _FRAMES - 1)


@inner
def _choose_frame(episode, distances, under):
    """Measure along the road under the ego: (the one before, do gaps jump with it?)."""
    before = episode.frame_road
    episode.frame_road = under
    if before < 0:
        return under, False
    return before, under != before and not distances.frames.same[before, under]


@rare
def _start_again(episode, past, road, before, earlier, box, dt):
    """The lane frame has jumped: take in the frame before as it is in the new one. Danger goes on as it was."""
    for i in range(episode.cars - 1):
        forget_safe(past.memory[i])
    _mark_all(episode, past)
    _to_record(road, before[episode.ego], earlier[episode.ego], box, dt, past.ego[row_before(episode)])


@inner
def _note(car, pose):
    """Keep where a car is."""
    pose.x, pose.y, pose.heading, pose.speed = car.x, car.y, car.heading, car.speed
    pose.cos, pose.sin = car.cos, car.sin
    pose.wreck = car.crashed or car.kind == OBSTACLE
    pose.in_own_lane = True


@inner
def _note_kind(car, pose, before, memory, ground):
    """Keep which row of parameters is its own, and start over with a pair for which that is another one now."""
    pose.kind = 0
    if ground is not None:
        first = STATES * car.group
        pose.kind = first + state_along(ground, ground.other, first, car.x, car.cos, car.speed, car.length / 2)
        if before.kind != pose.kind:
            start_over(memory)


@inner
def stand_on(cars, episode, ground, memory, settings):
    """What the ego runs with where it is. While danger lasts, the road does not get better for it."""
    if ground is None:
        return settings
    ego = cars[episode.ego]
    state = state_along(ground, ground.ego, 0, ego.x, ego.cos, ego.speed, ego.length / 2)
    if episode.stands >= 0:
        for i in range(episode.cars - 1):
            if memory[i].since > 0:
                state = worse_of(state, episode.stands)
                break
        if state != episode.stands:
            for i in range(episode.cars - 1):
                start_over(memory[i])
    episode.stands = state
    return with_table(settings, table_on(settings.table, ground, state))


@inner
def with_table(settings, table):
    """The same settings with another table."""
    return Settings(
        table,
        settings.overrides,
        settings.scheme,
        settings.entry,
        settings.intent,
        settings.waits_anywhere,
        settings.examine,
        settings.filter,
        settings.correction,
        settings.evasion,
    )


@inner
def _to_record(road, pose, before, box, dt, user):
    to_lane_frame(road, pose.x, pose.y, pose.heading, pose.speed, pose.cos, pose.sin, before.x, before.y, box, dt, user)
    user.vague = False  # a judge looks at the same records after a shield that may have inflated them


@inner
def _look_over(cars, episode, ego, me, road, now, before, boxes, sight, settings, soonest, distances):
    """Note where everybody is, and bound the longitudinal margin of each from below in `sight.x` [m].

    Where the bound is -inf nothing is known, or the time to collision may be the shortest.

    Returns:
      A margin [m] that the nearest of all has at most: no required distance is negative.
    """
    straight, bounds, frames, past = is_straight(road), sight.x, distances.frames, distances.past
    cos, sin = road[0, COS], road[0, SIN]
    share = own_share(me.speed, me.cos, settings.table.ego, settings.table.dt)
    lead, least_cos = leading_speed(me, settings.table.rules), least_cosine(settings.table.rules)
    half_lengths, half_widths = me.half_length + _HALF_DIAGONAL, me.half_width + _HALF_DIAGONAL
    nearest = np.inf
    look = look_ahead_of(me, settings.table)
    for i in range(episode.cars - 1):
        k = car_of(i, episode)
        car, pose = cars[k], now[k]
        _note(car, pose)
        _note_kind(car, pose, before[k], past.memory[i], frames.ground)
        if not straight:
            bounds[i] = -np.inf
            continue
        dx, dy = car.x - ego.x, car.y - ego.y
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        slant = car.cos * cos + car.sin * sin
        bound = least_margin(
            along,
            half_lengths,
            car.speed,
            slant,
            pose.wreck,
            share,
            lead,
            least_cos,
            table_of_kind(settings.table, settings.table.others, pose.kind),
        )
        closing = ego.speed - slowed(car.speed, slant, pose.wreck, least_cos)
        gap_lon, gap_lat = along - half_lengths - _ROUNDING, abs(across) - half_widths
        is_next = may_be_next(along >= 0.0, gap_lon, gap_lat, closing, soonest)
        oncoming = car.cos * ego.cos + car.sin * ego.sin <= 0.0
        was = before[k]
        drifts = car.sin * cos != car.cos * sin or (car.y - was.y) * cos != (car.x - was.x) * sin
        _note_gap(along, across, boxes[1 if car.kind == OBSTACLE else 0], boxes[0], sight)
        own_half = boxes[1 if car.kind == OBSTACLE else 0, 3]  # of one that does not drift
        gap_lat = abs(across) - me.half_width - own_half - _ROUNDING
        there = look_ahead_at(look, me, settings.table, settings.table.others, pose.kind)
        binds = may_bind(along >= 0.0, bound, gap_lat, drifts, car.speed, there)
        bounds[i] = -np.inf if is_next or oncoming or binds else bound
        nearest = min(nearest, max(abs(along), abs(across)))
    return nearest


@inner
def _choose_near(episode, past, bounds, threshold):
    """Drop those of the near ones who are far by now, and list whoever is near."""
    for a in range(episode.near):
        i = past.near[a]
        if past.memory[i].since > 0:
            bounds[i] = -np.inf
        elif bounds[i] > threshold:
            past.memory[i].skipped = True
    count = 0
    for i in range(episode.cars - 1):
        past.near[count] = i
        count += not bounds[i] > threshold
    episode.near = count


@inner
def _in_own_lane(k, car, ego, lanes, sight):
    """Is a car inside a lane that runs its way? Only asked of oncoming cars."""
    if car.cos * ego.cos + car.sin * ego.sin > 0.0:
        return True
    lane, s, lateral = lanes[car.lane], sight.s[car.lane, k], sight.lateral[car.lane, k]
    along = np.cos(car.heading - heading_at(lane, s)) > 0.0
    return along and abs(lateral) <= (lane.width - car.width) / 2
