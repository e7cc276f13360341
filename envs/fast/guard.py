"""The shield inside the frame loop: `envs.highway.ShieldedEgo` on the engine's arrays.

The formulas are those of `shield/`; here is only what reads the engine's cars, keeps the tally of a
decision and writes the command back.
"""

from typing import NamedTuple

import numpy as np

from envs.fast.collisions import is_near, overlap
from envs.fast.compiled import compiled, merged
from envs.fast.floats import norm
from envs.fast.network import Network, heading_at
from envs.fast.state import CAR_LENGTH, CAR_WIDTH, DIRECT, META, OBSTACLE, OBSTACLE_SIZE, TRAFFIC
from envs.fast.ufuncs import arctan, tan
from envs.highway import MAX_SLIP, road_through
from envs.intent import Junction, Roads, is_outside, list_threats, no_roads, track_of
from envs.junction_ego import junction_of
from shield.blame import BOTH, EGO, NOBODY, OTHER, judge_contact, judge_frame
from shield.command import Command
from shield.controller import Body, shield_frame
from shield.geometry import PIECE_FIELDS, largest_half_extents
from shield.junction import CROSSING, has_plan, judge_crossing, junction_frame
from shield.lane_frame import same_frame, to_lane_frame
from shield.plans import Scene
from shield.response import MEMORY, catch_up, forget_safe

OFF, MONITOR, OVERRIDE = range(3)
_PLANS = 4  # kinds of danger from here on are plans, in `infos`


class LaneFrames(NamedTuple):
    """What the shield measures by where distances along lanes keep the ego safe. L lanes."""

    pieces: np.ndarray  # `[P, 8]` pieces of the roads through all lanes
    start: np.ndarray  # `[L + 1]` where the road through each lane starts among the pieces
    same: np.ndarray  # `[L, L]` no gap jumps between the two frames


class Ways(NamedTuple):
    """What it goes by where plans do. L lanes."""

    roads: Roads  # paths through junctions
    choice: np.ndarray  # `[R + 1, L]` row of the paths of a driver with route R - 1 who heads for lane L; 0: no route


class Past(NamedTuple):
    """What the shield remembers on lanes: N road users, the ego in the last row. A batch has one more axis in front."""

    memory: np.ndarray  # `[N]` MEMORY
    before: np.ndarray  # `[N, 2]` positions one frame ago, nan at first sight [m]
    seen: np.ndarray  # `[2, N]` ROAD_USER of the last two frames; `episode.turn` is the row of the last one


class Distances(NamedTuple):
    """One ego kept safe by distances along its lane (Defs. 1-10)."""

    frames: LaneFrames
    past: Past


class Plans(NamedTuple):
    """One ego kept safe by plans (Defs. 14-18)."""

    ways: Ways
    crossings: np.ndarray  # `[N]` CROSSING, what is remembered of the others


class Watch(NamedTuple):
    """Tables of the shield."""

    boxes: np.ndarray  # `[2, 4]` length, width, largest half extents of a car and of an obstacle [m]
    blank: np.ndarray  # `[1]` MEMORY of a first sight
    blank_crossing: np.ndarray  # `[1]` CROSSING likewise
    max_slip: float  # that the ego can steer [rad]


def compile_lane_frames(network) -> LaneFrames:
    """Lane frames of all lanes of a `highway_env.road.road.RoadNetwork`."""
    lanes = [road_through(network, index) for index in network.lanes_dict()]
    same = np.array([[same_frame(a, b) for b in lanes] for a in lanes])
    return LaneFrames(np.concatenate(lanes), np.cumsum([0, *map(len, lanes)]), same)


def compile_ways(network, net: Network) -> Ways:
    """The paths through the junctions of a `highway_env.road.road.RoadNetwork`; `net`: the same as arrays."""
    junction = junction_of(network)
    return Ways(junction.roads, _choices(junction, network, net))


def _choices(junction: Junction, network, net: Network) -> np.ndarray:
    ways = [(origin, end) for origin, ends in network.graph.items() for end in ends]
    routes = [[ways[road] for road in roads if road >= 0] for roads in net.route_roads]
    return np.array([[junction.choice(index, route) for index in network.lanes_dict()] for route in [[], *routes]])


def no_lane_frames() -> LaneFrames:
    """Stands in where no shield runs."""
    return LaneFrames(np.zeros((0, PIECE_FIELDS)), np.zeros(1, int), np.zeros((0, 0), bool))


def no_ways() -> Ways:
    """Stands in where no shield runs."""
    return Ways(no_roads(), np.zeros((1, 0), np.int64))


def make_watch(heading_bound):
    """Tables for a `heading_bound` as in `Rules`."""
    boxes = np.zeros((2, 4))
    boxes[0, 0], boxes[0, 1] = CAR_LENGTH, CAR_WIDTH
    boxes[0, 2], boxes[0, 3] = largest_half_extents(CAR_LENGTH, CAR_WIDTH, heading_bound)
    boxes[1, 0], boxes[1, 1] = OBSTACLE_SIZE, OBSTACLE_SIZE
    return Watch(boxes, np.zeros(1, MEMORY), np.zeros(1, CROSSING), MAX_SLIP)


# Of the next two one is None, and numba leaves out of the kernel what it would need.


@merged
def distances_of(e, frames, past):
    """`Distances` of environment `e` of a batch."""
    if frames is None:
        return None
    return Distances(frames, Past(past.memory[e], past.before[e], past.seen[e]))


@merged
def plans_of(e, ways, crossings):
    """`Plans` of environment `e` of a batch."""
    if ways is None:
        return None
    return Plans(ways, crossings[e])


@compiled
def start_watch(episode, distances, plans, watch):
    """Forget everything at the start of an episode."""
    if distances is not None:
        past = distances.past
        for i in range(len(past.memory)):
            past.memory[i] = watch.blank[0]
            past.before[i, 0] = past.before[i, 1] = np.nan
    if plans is not None:
        for i in range(len(plans.crossings)):
            plans.crossings[i] = watch.blank_crossing[0]
    episode.frame_lane, episode.turn, episode.go, episode.frames_trapped = -1, 0, -1, 0
    episode.path = -1
    episode.pairs_examined = episode.pairs_possible = 0
    episode.nominal_acceleration = episode.nominal_steering = 0.0
    episode.frames = episode.frames_overridden = 0
    episode.dangerous_pairs = episode.broken_duties = 0
    episode.cost = 0.0
    episode.min_ttc = np.inf
    episode.blame = episode.blame_axes = episode.blame_frames = episode.ego_duty = episode.other_duty = 0
    episode.blame_partner = -1
    episode.ego_excess = episode.other_excess = 0.0


@compiled
def carry_over(episode, cars, crossings, ego, watch):
    """Cars came and went, as they do at intersections: everybody's past moves along.

    Args:
      ego: index of the ego before.
    """
    for i in range(len(crossings) - 1):
        k = _car_of(i, episode)
        was = cars[k].was if k < episode.cars else -1
        # those after a gap move up
        crossings[i] = watch.blank_crossing[0] if was < 0 else crossings[was if was < ego else was - 1]


@merged
def start_tally(step):
    """Nothing has happened in this decision yet."""
    step.frames = step.overridden = step.limited = step.dangerous_pairs = step.broken_duties = 0
    step.acceleration_change = step.steering_change = 0.0
    step.margin_lon = step.margin_lat = np.inf
    step.partner, step.response = -1, 0


@merged
def watch_frame(cars, episode, lanes, sight, distances, plans, watch, settings, step):
    """Restrict the ego's command on one frame, unless it has had its contact.

    Args:
      cars: `[N]` CAR, all commands chosen.
      episode: EPISODE.
      lanes: `[L]` LANE.
      sight: this frame's.
      distances, plans: `Distances` or `Plans`; the other is None.
      watch: `Watch`.
      settings: `envs.highway.Settings`.
      step: STEP, the tally is kept there.
    """
    if check_contact(cars, episode, lanes, sight, distances, plans, watch, settings):
        return
    if plans is not None:
        _keep_plan(cars, episode, sight, plans, settings, step)
    if distances is not None:
        _keep_distances(cars, episode, lanes, sight, distances, watch, settings, step)


@merged
def _keep_distances(cars, episode, lanes, sight, distances, watch, settings, step):
    """Defs. 1-10, along the lane of the ego."""
    car, past = cars[episode.ego], distances.past
    if car.kind == DIRECT:
        acceleration, steering = episode.nominal_acceleration, episode.nominal_steering
    else:
        acceleration, steering = car.acceleration, car.steering
    curvature = _sense(cars, episode, lanes, sight, distances, watch, settings)
    n, last = episode.cars - 1, len(past.memory) - 1
    now, then = past.seen[episode.turn], past.seen[1 - episode.turn]
    ego, users, memory = now[last], now[:n], past.memory[:n]
    wish = Command(acceleration, arctan(0.5 * tan(steering)) if steering != 0.0 else 0.0)
    report = shield_frame(
        ego,
        users,
        then[last],
        then[:n],
        memory,
        wish,
        Body(car.length / 2, watch.max_slip, curvature),
        settings.ego,
        settings.other,
        settings.rules,
        settings.dt,
    )
    command = report.command if settings.overrides else wish
    pairs = broken = 0
    if report.dangerous:
        pairs, broken = judge_frame(ego, users, memory, command, curvature, settings.ego, settings.other, settings.dt)
    steered = steering
    if command.slip != wish.slip:
        steered = arctan(2.0 * tan(command.slip))
    if settings.overrides:
        car.acceleration, car.steering = command.acceleration, steered
    _count(episode, step, report, pairs, broken, settings.overrides)
    step.acceleration_change = max(step.acceleration_change, abs(command.acceleration - acceleration))
    step.steering_change = max(step.steering_change, abs(steered - steering))
    if max(report.margin_lon, report.margin_lat) < max(step.margin_lon, step.margin_lat):
        step.margin_lon, step.margin_lat = report.margin_lon, report.margin_lat
        step.partner = _car_of(report.partner, episode)


@merged
def _keep_plan(cars, episode, sight, plans, settings, step):
    """Defs. 14-18: a plan through the junction ahead."""
    car, n = cars[episode.ego], episode.cars - 1
    scene = _scene(cars, episode, sight, plans, settings)
    report = junction_frame(
        scene,
        sight.samples[:n],
        plans.crossings[:n],
        episode,
        car.acceleration,
        settings.entry,
        not settings.waits_anywhere,
        settings.examine,
        settings.overrides,
    )
    if settings.overrides:
        step.acceleration_change = max(step.acceleration_change, abs(report.acceleration - car.acceleration))
        car.acceleration = report.acceleration
    _count(episode, step, report, report.pairs, report.broken, settings.overrides)
    episode.frames_trapped += report.trapped
    episode.pairs_examined += report.examined
    episode.pairs_possible += report.possible


@merged
def _count(episode, step, report, pairs, broken, overrides):
    """Take what happened on one frame into the tally."""
    overridden = (report.overridden or episode.refused) and overrides
    episode.refused = False
    step.frames += 1
    step.overridden += overridden
    step.limited += report.limited and not overridden and overrides
    step.dangerous_pairs += pairs
    step.broken_duties += broken
    step.response |= report.response
    episode.dangerous_pairs += pairs
    episode.broken_duties += broken
    episode.frames += 1
    episode.frames_overridden += overridden
    episode.min_ttc = min(episode.min_ttc, report.ttc)


@merged
def refuse_lane_change(before, cars, episode, sight, plans, settings):
    """Take back a lane change of this decision that leaves no plan; `before` is the lane the ego headed for."""
    episode.refused = False
    if plans is not None:
        _refuse_lane_change(before, cars, episode, sight, plans, settings)


@compiled
def _refuse_lane_change(before, cars, episode, sight, plans, settings):
    ego = cars[episode.ego]
    if not settings.overrides or episode.blame != 0 or ego.kind != META:
        return
    lanes = plans.ways.roads.lanes
    if ego.target_lane == before or lanes[ego.target_lane].road != lanes[before].road:
        return
    n, path = episode.cars - 1, episode.path
    scene = _scene(cars, episode, sight, plans, settings)
    if not has_plan(scene, plans.crossings[:n], settings.entry, not settings.waits_anywhere):
        ego.target_lane, episode.path = before, path
        episode.refused = True


@merged
def _scene(cars, episode, sight, plans, settings):
    """The ego's track and the ways that the others may take."""
    n, roads = episode.cars - 1, plans.ways.roads
    for i in range(n):
        _describe(cars[_car_of(i, episode)], plans.ways.choice, sight.on_road[i])
    _describe(cars[episode.ego], plans.ways.choice, sight.on_road[n])
    track = track_of(roads, sight.on_road[n], episode.path)
    episode.path = track.path
    count = list_threats(
        roads,
        track,
        sight.on_road[:n],
        plans.crossings[:n],
        settings.intent,
        settings.other.v_cap,
        sight.samples,
        sight.threats,
        sight.box,
    )
    if count > len(sight.threats):
        episode.overflow = True
    count = min(count, len(sight.threats))
    return Scene(roads.paths, track, sight.threats[:count], settings.ego, settings.other, settings.dt, 0.0)


@merged
def _describe(car, choice, out):
    out.x, out.y, out.heading, out.speed, out.length, out.width = (
        car.x,
        car.y,
        car.heading,
        car.speed,
        car.length,
        car.width,
    )
    out.wreck = car.crashed or car.kind == OBSTACLE
    out.on, out.lane, out.choice = car.lane, -1, -1
    if car.kind == TRAFFIC or car.kind == META:
        out.lane, out.choice = car.target_lane, choice[car.route + 1, car.target_lane]


@merged
def _car_of(user, episode):
    """Index among the cars of an index among the others."""
    return user if user < episode.ego else user + 1


@merged
def _sense(cars, episode, lanes, sight, distances, watch, settings):
    """Take in everybody in the ego's lane frame, the ego last; returns the lane's curvature."""
    n, ego, frames, past = episode.cars, cars[episode.ego], distances.frames, distances.past
    episode.turn = 1 - episode.turn
    users, before = past.seen[episode.turn], past.before
    if ego.lane != episode.frame_lane:
        if episode.frame_lane >= 0 and not frames.same[episode.frame_lane, ego.lane]:
            for i in range(n - 1):
                forget_safe(past.memory[i])
        episode.frame_lane = ego.lane
    road = frames.pieces[frames.start[ego.lane] : frames.start[ego.lane + 1]]
    curvature = 0.0
    for row in range(n):
        is_ego = row == n - 1
        k, i = (episode.ego, len(users) - 1) if is_ego else (_car_of(row, episode), row)
        car, user = cars[k], users[i]
        box = watch.boxes[1 if car.kind == OBSTACLE else 0]
        curvature = to_lane_frame(
            road,
            car.x,
            car.y,
            car.heading,
            car.speed,
            car.cos,
            car.sin,
            before[i, 0],
            before[i, 1],
            box,
            settings.dt,
            user,
        )
        user.wreck = not is_ego and (car.crashed or car.kind == OBSTACLE)
        user.in_own_lane = _in_own_lane(k, car, ego, lanes, sight)
        before[i, 0], before[i, 1] = car.x, car.y
    return curvature  # of the lane at the ego, the last one


@merged
def _in_own_lane(k, car, ego, lanes, sight):
    """Is a car inside a lane that runs its way? Only asked of oncoming cars."""
    if car.cos * ego.cos + car.sin * ego.sin > 0.0:
        return True
    lane, s, lateral = lanes[car.lane], sight.s[car.lane, k], sight.lateral[car.lane, k]
    along = np.cos(car.heading - heading_at(lane, s)) > 0.0
    return along and abs(lateral) <= (lane.width - car.width) / 2


@merged
def check_contact(cars, episode, lanes, sight, distances, plans, watch, settings):
    """Has the ego touched somebody, or is it about to? Judged at the first such sample."""
    ego = cars[episode.ego]
    if episode.blame == 0 and (ego.crashed or ego.hit):
        _judge(cars, episode, lanes, sight, distances, plans, watch, settings)
    return episode.blame != 0


@compiled
def _judge(cars, episode, lanes, sight, distances, plans, watch, settings):
    if distances is not None:
        _sense(cars, episode, lanes, sight, distances, watch, settings)
    n, heaviest, touched = episode.cars - 1, -1, False
    for i in range(n):
        touched |= _touches(cars, _car_of(i, episode), episode.ego, sight, settings.dt)
    nearest = _nearest(cars, episode) if not touched else -1
    for i in range(n):
        k = _car_of(i, episode)
        if not (_touches(cars, k, episode.ego, sight, settings.dt) if touched else k == nearest):
            continue
        verdict, axes = _verdict(i, cars, episode, sight, distances, plans, settings)
        weight = _weight(verdict.verdict)
        if weight > heaviest:
            heaviest = weight
            episode.blame, episode.blame_partner = 1 + verdict.verdict, k
            episode.blame_axes, episode.blame_frames = axes, verdict.frames
            episode.ego_duty, episode.ego_excess = verdict.ego_duty, verdict.ego_excess
            episode.other_duty, episode.other_excess = verdict.other_duty, verdict.other_excess


@compiled
def _verdict(i, cars, episode, sight, distances, plans, settings):
    """Who is to blame for the contact with road user `i`, and where the danger came from, as in `infos`."""
    ego, other, rules, dt = settings.ego, settings.other, settings.rules, settings.dt
    if plans is not None:
        scene = _scene(cars, episode, sight, plans, settings)
        outside = is_outside(scene.paths, scene.threats, i, sight.on_road[i])
        verdict = judge_crossing(sight.samples[i], plans.crossings[i], outside, other, dt)
        axes = verdict.axes + _PLANS
    if distances is not None:
        past = distances.past
        memory, last = past.memory[i], len(past.memory) - 1
        now, then = past.seen[episode.turn], past.seen[1 - episode.turn]
        catch_up(memory, then[last], then[i], ego, other, rules, dt)
        verdict = judge_contact(now[last], now[i], memory, ego, other, rules, dt)
        axes = verdict.axes
    return verdict, axes


@compiled
def _weight(verdict):
    """Of several contacts at once, the one that weighs most against the ego counts."""
    if verdict == NOBODY:
        return 4
    if verdict == EGO:
        return 3
    if verdict == BOTH:
        return 2
    return 1 if verdict == OTHER else 0


@compiled
def _touches(cars, k, ego, sight, dt):
    first, second = cars[min(k, ego)], cars[max(k, ego)]
    if not (first.checks or second.checks) or not is_near(first, second, dt):
        return False
    touches, will_touch, _, _ = overlap(first, second, sight.corners, dt)
    return touches or will_touch


@compiled
def _nearest(cars, episode):
    ego, nearest, best = cars[episode.ego], -1, np.inf
    for k in range(episode.cars):
        far = norm(cars[k].x - ego.x, cars[k].y - ego.y)
        if k != episode.ego and far < best:
            nearest, best = k, far
    return nearest


@merged
def is_at_fault(blame):
    """Does a blame code charge the ego?"""
    return blame == 1 + EGO or blame == 1 + BOTH
