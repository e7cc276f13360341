"""The shield inside the frame loop: `envs.highway.ego.ShieldedEgo` on the engine's arrays.

The formulas are those of `shield/`; here is only what reads the engine's cars, keeps the tally of a
decision and writes the command back.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs._numpy.floats import norm
from rss_shield.envs.fast.collisions import is_near, overlap
from rss_shield.envs.fast.drivers import note_change
from rss_shield.envs.fast.neighbours import (
    Distances,
    Past,
    car_of,
    keep_seen,
    measure,
    row_before,
    stand_on,
    start_past,
)
from rss_shield.envs.fast.risk import look_at_risk
from rss_shield.envs.fast.senses import GHOSTS, follow, look, start_senses
from rss_shield.envs.fast.sight import project
from rss_shield.envs.fast.state import DIRECT, META, OBSTACLE, OBSTACLE_SIZE, TRAFFIC
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, Network
from rss_shield.envs.roads.steering import MAX_SLIP, slip_at, steering_for
from rss_shield.envs.roads.ways import (
    Junction,
    Roads,
    drift_of,
    is_outside,
    junction_of,
    list_threats,
    track_of,
)
from rss_shield.shield._numba.compiled import inner, part, rare
from rss_shield.shield.comfort import ride_on
from rss_shield.shield.command import Command
from rss_shield.shield.filters.answer import RSS, Traffic, answer
from rss_shield.shield.geometry import largest_half_extents
from rss_shield.shield.junctions.controller import has_plan, junction_frame
from rss_shield.shield.junctions.held_back import held_by
from rss_shield.shield.junctions.judge import judge_crossing
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.junctions.plans import Scene
from rss_shield.shield.lanes.controller import Response, find_danger, respond
from rss_shield.shield.lanes.correction import RESPONSE, in_full
from rss_shield.shield.lanes.evasion import Room, evade
from rss_shield.shield.lanes.judge import judge_contact, judge_frame
from rss_shield.shield.lanes.lane_changes import OFF_CENTRE, is_blocked, lead_back, turns_back
from rss_shield.shield.lanes.memory import MEMORY, catch_up
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.tally import (
    copy_judgement,
    count_change,
    count_frame,
    end_decision,
    enter_contact,
    note_executed,
    start_decision,
    start_episode,
)
from rss_shield.shield.verdicts import charges_ego, weight_of

_MOST_TURNED = 0.9  # sine of the angle by which a bend may turn a car against its lane


class Ways(NamedTuple):
    """What it goes by where plans do. L lanes."""

    roads: Roads  # paths through junctions
    choice: np.ndarray  # `[R + 1, L]` row of the paths of a driver with route R - 1 who heads for lane L; 0: no route


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


def compile_ways(network, net: Network, dt: float) -> Ways:
    """The paths through the junctions of a `highway_env.road.road.RoadNetwork`.

    Args:
      network: the road network.
      net: the same as arrays.
      dt: length of a frame [s].
    """
    junction = junction_of(network, dt=dt)
    return Ways(junction.roads, _choices(junction, network, net))


def _choices(junction: Junction, network, net: Network) -> np.ndarray:
    ways = [(origin, end) for origin, ends in network.graph.items() for end in ends]
    routes = [[ways[road] for road in roads if road >= 0] for roads in net.route_roads]
    return np.array([[junction.choice(index, route) for index in network.lanes_dict()] for route in [[], *routes]])


def make_watch(heading_bound, curvature=0.0):
    """Tables for a `heading_bound` as in `Rules`, and the tightest bend of the roads [1/m]."""
    bound = max(heading_bound, min(curvature * CAR_LENGTH / 2, _MOST_TURNED))
    boxes = np.zeros((2, 4))
    boxes[0, 0], boxes[0, 1] = CAR_LENGTH, CAR_WIDTH
    boxes[0, 2], boxes[0, 3] = largest_half_extents(CAR_LENGTH, CAR_WIDTH, bound)
    boxes[1, 0], boxes[1, 1] = OBSTACLE_SIZE, OBSTACLE_SIZE
    return Watch(boxes, np.zeros(1, MEMORY), np.zeros(1, CROSSING), MAX_SLIP)


# Of the next two one is None, or all three are, and numba leaves out of the kernel what it would need.


@inner
def distances_of(e, frames, past):
    """`Distances` of environment `e` of a batch."""
    if frames is None:
        return None
    return Distances(frames, Past(past.memory[e], past.trail[e], past.ego[e], past.near[e]))


@inner
def plans_of(e, ways, crossings):
    """`Plans` of environment `e` of a batch; None where nobody, or somebody else, remembers crossings."""
    if ways is None or crossings is None:
        return None
    return Plans(ways, crossings[e])


@inner
def ride_of(e, rides):
    """RIDE of environment `e` of a batch."""
    if rides is None:
        return None
    return rides[e]


@rare
def start_watch(cars, episode, distances, plans, ride, watch, aware):
    """Forget everything at the start of an episode."""
    if distances is not None:
        start_past(episode, distances.past, watch.blank)
    if aware is not None:
        follow(episode, aware)
        start_past(aware.judge[0], aware.distances.past, watch.blank)
        start_senses(cars, episode, aware)
    if plans is not None:
        for i in range(len(plans.crossings)):
            plans.crossings[i] = watch.blank_crossing[0]
    if ride is not None:
        start_ride(ride)
    episode.room_left = episode.room_right = np.inf
    episode.path, episode.go, episode.frames_trapped = -1, -1, 0
    episode.held_at, episode.wronged, episode.answers, episode.evading = np.inf, False, False, False
    episode.pairs_examined = episode.pairs_possible = 0
    episode.nominal_acceleration = episode.nominal_steering = 0.0
    start_episode(episode)


@inner
def guard(cars, episode, changing, net, sight, distances, plans, ride, meter, watch, settings, step, aware):
    """`watch_frame` where there is a shield; returns `changing`, with an ego that was given its lane back."""
    if ride is None:
        return changing
    watch_frame(cars, episode, net, sight, distances, plans, ride, meter, watch, settings, step, aware)
    return note_change(cars, episode.ego, changing, sight)


@inner
def cost_of(cars, episode, lanes, sight, distances, plans, ride, watch, settings, had_contact, step, aware):
    """1.0 if the ego has broken its proper response in a decision, or a contact was its fault."""
    cost = 0.0
    if ride is not None:
        check_contact(cars, episode, lanes, sight, distances, plans, watch, settings, aware)
        if step.broken_duties > 0 or (not had_contact and charges_ego(episode.blame - 1)):
            cost = 1.0
    return cost


@part
def report(cars, episode, ride, cost, step):
    """Fill in what every step says."""
    ego = cars[episode.ego]
    step.speed, step.crashed, step.time = ego.speed, ego.crashed, episode.time
    step.episode_return, step.episode_length = episode.return_, episode.steps
    if ride is not None:
        end_decision(step, episode, ride, cost)


@part
def carry_over(episode, cars, crossings, ego, watch):
    """Cars came and went, as they do at intersections: everybody's past moves along.

    Args:
      ego: index of the ego before.
    """
    for i in range(len(crossings) - 1):
        k = car_of(i, episode)
        was = cars[k].was if k < episode.cars else -1
        # those after a gap move up
        crossings[i] = watch.blank_crossing[0] if was < 0 else crossings[was if was < ego else was - 1]


@inner
def watch_frame(cars, episode, net, sight, distances, plans, ride, meter, watch, settings, step, aware):
    """Restrict the ego's command on one frame, unless it has had its contact.

    Args:
      cars: `[N]` CAR, all commands chosen.
      episode: EPISODE.
      net: `Network`.
      sight: this frame's.
      distances, plans: `Distances` or `Plans`; the other is None.
      ride: RIDE.
      meter: of risk; None = nobody asked.
      watch: `Watch`.
      settings: `envs.options.Settings`.
      step: STEP, the tally is kept there.
      aware: `Aware`; None = the ego sees what is there.
    """
    lanes = net.lanes
    if check_contact(cars, episode, lanes, sight, distances, plans, watch, settings, aware):
        return
    if plans is not None:
        _keep_plan(cars, episode, sight, plans, settings, step)
        gap = np.inf
    if distances is not None:
        if aware is None:
            _keep_distances(cars, episode, lanes, sight, distances, watch, settings, step, None)
        else:
            _keep_distances_of_seen(cars, episode, net, sight, distances, watch, settings, step, aware)
        gap = sight.z[0]
    ego = cars[episode.ego]
    ride_on(ride, ego.speed, ego.heading, gap, settings.table.dt)
    if aware is None:
        look_at_risk(cars, episode, lanes, sight, distances, meter)
    else:
        look_at_risk(cars, aware.judge[0], lanes, sight, aware.distances, meter)


@inner
def _keep_distances_of_seen(cars, episode, net, sight, distances, watch, settings, step, aware):
    """`_keep_distances` of the cars that are seen, and the judge's opinion of it."""
    n, ego, judge, verdict = episode.cars, cars[episode.ego], aware.judge[0], aware.verdict[0]
    look(cars, episode, aware)
    project(aware.cars, n + GHOSTS, net, sight)
    episode.cars = n + GHOSTS
    _keep_distances(aware.cars, episode, net.lanes, sight, distances, watch, settings, step, aware)
    keep_seen(episode, distances.past, sight, aware)
    episode.cars = n
    if step.partner >= n:  # nobody
        step.partner = -1
    seen = aware.cars[episode.ego]
    ego.acceleration, ego.steering, ego.target_lane = seen.acceleration, seen.steering, seen.target_lane
    project(cars, n, net, sight)
    follow(episode, aware)
    judge.nominal_acceleration, judge.nominal_steering = ego.acceleration, ego.steering
    _keep_distances(cars, judge, net.lanes, sight, aware.distances, watch, aware.judging, verdict, None)
    copy_judgement(step, episode, verdict, judge)


@inner
def start_judging(aware):
    """A decision begins."""
    if aware is not None:
        start_decision(aware.verdict[0])


@inner
def _keep_distances(cars, episode, lanes, sight, distances, watch, settings, step, aware):
    """Defs. 1-10, along the lane of the ego."""
    car, past = cars[episode.ego], distances.past
    settings = stand_on(cars, episode, distances.frames.ground, past.memory, settings)
    if car.kind == DIRECT:
        acceleration, steering = episode.nominal_acceleration, episode.nominal_steering
    else:
        acceleration, steering = car.acceleration, car.steering
    # only who is nearer than anybody was before, in this decision or this episode, changes the tally
    nearest, soonest = max(step.margin_lon, step.margin_lat), episode.min_ttc
    others_act = settings.overrides and settings.filter.kind != RSS
    everybody = np.inf if others_act else -np.inf  # other filters look farther
    limits = False, nearest, soonest, everybody
    bend = measure(cars, episode, lanes, sight, distances, watch.boxes, settings, *limits, aware)
    ego, users, memory = past.ego[episode.turn], sight.users, past.memory
    who = past.near[: episode.near]
    danger = find_danger(
        ego,
        users,
        past.ego[row_before(episode)],
        sight.users_before,
        memory,
        settings.table,
        who,
        nearest,
        soonest,
    )
    episode.room_left, episode.room_right = danger.room_left, danger.room_right
    slip = 0.0  # which nobody asks about where nothing is to be changed or judged
    if steering != 0.0 and (settings.overrides or danger.dangerous):
        slip = slip_at(steering)
    wish = Command(acceleration, slip)
    response = Response(wish, False, False, False)
    if settings.overrides:
        body = Body(
            car.length / 2,
            watch.max_slip,
            bend.curvature,
            bend.slack,
            bend.turned,
            bend.idle,
            car.kind == DIRECT,
            settings.table.ego.a_min_brake,
        )
        if others_act:
            response = _answer(wish, car, danger, episode, sight, distances, body, settings, step)
        else:
            wanted, evades = _take_back(wish, car, ego, episode, lanes, sight, body, settings, step), False
            if settings.evasion:
                room = _room(car, episode, lanes, sight)
                wanted, episode.evading, evades = evade(
                    wanted, episode.evading, ego, users, memory, room, body, danger.bounds, settings.table, who
                )
            response = respond(wanted, danger, ego, body, settings.table.rules, settings.table.dt)
            if evades:
                response = Response(response.command, True, False, False)
            if settings.correction == RESPONSE:
                response = in_full(response, danger, ego, body, settings.table.rules, settings.table.dt)
        command, steered = response.command, steering
        if command.slip != wish.slip:
            steered = steering_for(command.slip)
        car.acceleration, car.steering = command.acceleration, steered
        count_change(step, episode, abs(command.acceleration - acceleration), abs(steered - steering))
    note_executed(step, car.acceleration, car.steering)
    pairs = broken = 0
    if danger.dangerous:
        pairs, broken = judge_frame(ego, users, memory, response.command, bend.curvature, settings.table, who)
    _count(episode, step, danger, response, pairs, broken, settings.overrides)
    if danger.partner >= 0:
        step.margin_lon, step.margin_lat = danger.margin_lon, danger.margin_lat
        step.partner = car_of(danger.partner, episode)


@inner
def _room(car, episode, lanes, sight):
    """`envs.highway.ego.ShieldedEgo._room`."""
    lane = lanes[car.lane]
    offset, half = sight.lateral[car.lane, episode.ego], 0.5 * (lane.width - car.width)
    return Room(lane.id * lane.width + half + offset, (lane.siblings - 1 - lane.id) * lane.width + half - offset)


@part
def _answer(wish, car, danger, episode, sight, distances, body, settings, step):
    """What another filter makes of the ego's command."""
    past, who = distances.past, distances.past.near[: episode.near]
    offset = 0.0 if car.kind == DIRECT else sight.lateral[car.target_lane, episode.ego]
    traffic = Traffic(past.ego[episode.turn], sight.users, past.memory, offset, who)
    response, episode.answers = answer(
        settings.filter,
        wish,
        traffic,
        danger.free,
        episode.answers,
        step.frames == 0,
        body,
        settings.table,
    )
    return response


@inner
def _keep_plan(cars, episode, sight, plans, settings, step):
    """Defs. 14-18: a plan through the junction ahead."""
    car, n = cars[episode.ego], episode.cars - 1
    scene = scene_of(cars, episode, sight, plans, settings, False)
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
        settings.table.rules.anticipation,
    )
    if settings.overrides:
        if report.overridden and step.partner < 0:
            held = held_by(scene, car.acceleration, n, not settings.waits_anywhere)
            step.partner = car_of(held, episode) if held >= 0 else -1
        count_change(step, episode, abs(report.acceleration - car.acceleration), 0.0)
        car.acceleration = report.acceleration
    note_executed(step, car.acceleration, car.steering)
    _count(episode, step, report, report, report.pairs, report.broken, settings.overrides)
    episode.frames_trapped += report.trapped
    episode.pairs_examined += report.examined
    episode.pairs_possible += report.possible


@inner
def _count(episode, step, danger, response, pairs, broken, overrides):
    """Take what happened on one frame into the tally."""
    overridden = (response.overridden or episode.refused) and overrides
    anticipated, limited = response.anticipated and overrides, response.limited and overrides
    step.lane_change_refused = step.lane_change_refused or episode.refused
    episode.refused = False
    count_frame(step, episode, overridden, anticipated, limited, pairs, broken, danger.response, danger.ttc)


@inner
def start_ride(ride):
    """Forget how the ride felt."""
    ride.samples = ride.uncomfortable = ride.hard = ride.brakings = ride.gaps = 0
    ride.distance = ride.least_gap = ride.sum_of_gaps = 0.0
    for quantity in range(len(ride.squares)):
        ride.squares[quantity] = 0.0
        ride.bin[quantity] = ride.above[quantity] = 0
        for b in range(ride.counts.shape[1]):
            ride.counts[quantity, b] = 0


# ---------------------------------------------------------------- lane changes


@inner
def refuse_lane_change(before, cars, episode, lanes, sight, distances, plans, settings, step):
    """Ignore a lane change of this decision that leaves no plan, is blocked, or comes half-way through another.

    `before` is the lane the ego headed for.
    """
    episode.refused = False
    if plans is not None:
        _refuse_lane_change(before, cars, episode, sight, plans, settings)
    if distances is not None:
        _refuse_blocked(before, cars, episode, lanes, sight, settings, step)


@part
def _refuse_blocked(before, cars, episode, lanes, sight, settings, step):
    ego = cars[episode.ego]
    if not settings.overrides or not settings.table.rules.take_back or episode.blame != 0 or ego.kind != META:
        return
    if is_refused(before, ego, episode, lanes, sight, settings):
        ego.target_lane = before
        step.lane_change_refused = True


@inner
def is_refused(before, ego, episode, lanes, sight, settings):
    """Is the ego's change from lane `before` to its target blocked, or does it come half-way through another?"""
    k = ego.target_lane
    if not settings.table.rules.take_back or k == before or lanes[k].road != lanes[before].road:
        return False
    offsets = sight.lateral[ego.lane, episode.ego], sight.lateral[before, episode.ego]
    return turns_back(*offsets, k - before) or _is_blocked(k, episode, sight)


@inner
def _is_blocked(k, episode, sight):
    """Is the way to the centre of lane `k` blocked?"""
    return is_blocked(sight.lateral[k, episode.ego], episode.room_left, episode.room_right)


@inner
def _take_back(wish, car, ego, episode, lanes, sight, body, settings, step):
    """`envs.highway.ego.ShieldedEgo._taken_back`: what the agent wants, and the lane that it heads for from now on."""
    slip = wish.slip
    if settings.table.rules.take_back and car.kind == DIRECT:
        rooms = episode.room_left, episode.room_right
        width = lanes[car.lane].width
        slip = lead_back(slip, ego, width, *rooms, body.half_wheelbase, body.curvature, settings.table.dt)
    if settings.table.rules.take_back and car.kind == META:
        lane = _reachable(car.lane, car.target_lane, episode, lanes, sight)
        step.lane_change_refused = step.lane_change_refused or lane != car.target_lane
        car.target_lane = lane
    step.lane_change_refused = step.lane_change_refused or slip != wish.slip
    return Command(wish.acceleration, slip)


@part
def _reachable(here, target, episode, lanes, sight):
    """Lane that the ego can get to: its target, one on the way, the one it is on, or the one it has come from."""
    if lanes[target].road != lanes[here].road:
        return target
    for k in range(target, here, 1 if here > target else -1):
        if not _is_blocked(k, episode, sight):
            return k
    if target != here or not _is_blocked(here, episode, sight):
        return here
    lateral = sight.lateral[here, episode.ego]
    if abs(lateral) <= OFF_CENTRE:
        return target
    step = 1 if lateral > 0.0 else -1
    if not 0 <= lanes[here].id + step < lanes[here].siblings or _is_blocked(here + step, episode, sight):
        return target
    return here + step


@part
def _refuse_lane_change(before, cars, episode, sight, plans, settings):
    ego = cars[episode.ego]
    if not settings.overrides or episode.blame != 0 or ego.kind != META:
        return
    lanes = plans.ways.roads.lanes
    if ego.target_lane == before or lanes[ego.target_lane].road != lanes[before].road:
        return
    n, path = episode.cars - 1, episode.path
    scene = scene_of(cars, episode, sight, plans, settings, False)
    if not has_plan(scene, plans.crossings[:n], settings.entry, not settings.waits_anywhere):
        ego.target_lane, episode.path = before, path
        episode.refused = True


@inner
def scene_of(cars, episode, sight, plans, settings, judging):
    """The ego's track and the ways that the others may take.

    A contact flags both cars at once, so who had crashed is read off the frame before where it is judged.
    """
    n, roads = episode.cars - 1, plans.ways.roads
    for i in range(n):
        other = cars[car_of(i, episode)]
        _describe(other, plans.ways.choice, sight.on_road[i])
        sight.on_road[i].alert = other.kind == META  # another ego, behind a shield of its own
        if judging:
            sight.on_road[i].wreck = plans.crossings[i].wreck
    _describe(cars[episode.ego], plans.ways.choice, sight.on_road[n])
    track = track_of(roads, sight.on_road[n], episode.path)
    episode.path = track.path
    count = list_threats(
        roads,
        track,
        sight.on_road[:n],
        plans.crossings[:n],
        settings.intent,
        settings.table.other.v_cap,
        sight.samples,
        sight.threats,
        sight.box,
    )
    if count > len(sight.threats):
        episode.overflow = True
    count = min(count, len(sight.threats))
    drift = drift_of(roads, sight.on_road[n], track)
    return Scene(roads.paths, track, sight.threats[:count], settings.table, drift)


@inner
def _describe(car, choice, out):
    out.x, out.y, out.heading, out.speed, out.length, out.width = (
        car.x,
        car.y,
        car.heading,
        car.speed,
        car.length,
        car.width,
    )
    out.wreck, out.alert = car.crashed or car.kind == OBSTACLE, False
    out.size, out.on, out.lane, out.choice = 0, car.lane, -1, -1  # all are of one size
    if car.kind == TRAFFIC or car.kind == META:
        out.lane, out.choice = car.target_lane, choice[car.route + 1, car.target_lane]


@inner
def check_contact(cars, episode, lanes, sight, distances, plans, watch, settings, aware):
    """Has the ego touched somebody, or is it about to? Judged at the first such sample, by what is there."""
    if aware is None:
        return _check_contact(cars, episode, lanes, sight, distances, plans, watch, settings)
    follow(episode, aware)
    judge, verdict = aware.judge[0], aware.verdict[0]
    touches = _check_contact(cars, judge, lanes, sight, aware.distances, plans, watch, aware.judging)
    if touches and episode.blame == 0:
        copy_judgement(verdict, episode, verdict, judge)
    return touches


@inner
def _check_contact(cars, episode, lanes, sight, distances, plans, watch, settings):
    ego = cars[episode.ego]
    if episode.blame == 0 and (ego.crashed or ego.hit):
        _judge(cars, episode, lanes, sight, distances, plans, watch, settings)
    return episode.blame != 0


@rare
def _judge(cars, episode, lanes, sight, distances, plans, watch, settings):
    count, heaviest = _list_partners(cars, episode, sight, settings.table.dt), -1
    if distances is not None:
        episode.near, past = count, distances.past
        settings = stand_on(cars, episode, distances.frames.ground, past.memory, settings)
        for a in range(count):
            past.near[a] = sight.some[a]
        measure(cars, episode, lanes, sight, distances, watch.boxes, settings, True, np.inf, np.inf, -np.inf)
    for a in range(count):
        i = sight.some[a]
        verdict = _verdict(i, cars, episode, sight, distances, plans, settings)
        weight = weight_of(verdict.verdict)
        if weight > heaviest:
            heaviest = weight
            enter_contact(episode, verdict, car_of(i, episode), plans is not None)


@part
def _list_partners(cars, episode, sight, dt):
    """Put those in touch with the ego, or else the nearest, into `sight.some`; returns how many."""
    count, nearest, best = 0, -1, np.inf
    ego = cars[episode.ego]
    for i in range(episode.cars - 1):
        k = car_of(i, episode)
        if _touches(cars, k, episode.ego, sight, dt):
            sight.some[count] = i
            count += 1
        far = norm(cars[k].x - ego.x, cars[k].y - ego.y)
        if far < best:
            nearest, best = i, far
    if count == 0 and nearest >= 0:
        sight.some[0], count = nearest, 1
    return count


@rare
def _verdict(i, cars, episode, sight, distances, plans, settings):
    """Who is to blame for the contact with road user `i`."""
    table = settings.table
    if plans is not None:
        scene = scene_of(cars, episode, sight, plans, settings, True)
        outside = is_outside(scene.paths, scene.threats, i, sight.on_road[i])
        verdict = judge_crossing(sight.samples[i], plans.crossings[i], outside, table.other, table.dt)
    if distances is not None:
        past = distances.past
        memory, me = past.memory[i], past.ego[episode.turn]
        catch_up(memory, past.ego[row_before(episode)], sight.users_before[i], table)
        verdict = judge_contact(me, sight.users[i], memory, table)
    return verdict


@part
def _touches(cars, k, ego, sight, dt):
    first, second = cars[min(k, ego)], cars[max(k, ego)]
    if not (first.checks or second.checks) or not is_near(first, second, dt):
        return False
    touches, will_touch, _, _ = overlap(first, second, sight.corners, dt)
    return touches or will_touch
