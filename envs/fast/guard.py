"""The shield inside the frame loop: `envs.highway.ego.ShieldedEgo` on the engine's arrays.

The formulas are those of `shield/`; here is only what reads the engine's cars, keeps the tally of a
decision and writes the command back.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.fast.boxes import boxes_of
from rss_shield.envs.fast.contacts import check_contact
from rss_shield.envs.fast.crossings import scene_of
from rss_shield.envs.fast.drivers import note_change
from rss_shield.envs.fast.lane_changes import take_back
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
from rss_shield.envs.fast.state import DIRECT
from rss_shield.envs.roads.steering import MAX_SLIP, slip_at, steering_for
from rss_shield.shield._numba.compiled import inner, part, rare
from rss_shield.shield.comfort import ride_on, start_ride
from rss_shield.shield.command import Command
from rss_shield.shield.filters.answer import RSS, Traffic, answer
from rss_shield.shield.junctions.controller import junction_frame
from rss_shield.shield.junctions.held_back import held_by
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.lanes.controller import Response, find_danger, respond
from rss_shield.shield.lanes.correction import RESPONSE, in_full
from rss_shield.shield.lanes.evasion import Room, evade
from rss_shield.shield.lanes.judge import judge_frame
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.tally import (
    copy_judgement,
    count_change,
    count_frame,
    end_decision,
    note_executed,
    start_decision,
    start_episode,
)
from rss_shield.shield.verdicts import charges_ego


class Watch(NamedTuple):
    """Tables of the shield."""

    boxes: np.ndarray  # `[2, 4]` length, width, largest half extents of a car and of an obstacle [m]
    blank: np.ndarray  # `[1]` MEMORY of a first sight
    blank_crossing: np.ndarray  # `[1]` CROSSING likewise
    max_slip: float  # that the ego can steer [rad]


def make_watch(heading_bound, curvature=0.0):
    """Tables for a `heading_bound` as in `Rules`, and the tightest bend of the roads [1/m]."""
    return Watch(boxes_of(heading_bound, curvature), np.zeros(1, MEMORY), np.zeros(1, CROSSING), MAX_SLIP)


# Of the next two one is None, or all three are, and numba leaves out of the kernel what it would need.


@inner
def distances_of(e, frames, past):
    """`Distances` of environment `e` of a batch."""
    if frames is None:
        return None
    return Distances(frames, Past(past.memory[e], past.trail[e], past.ego[e], past.near[e]))


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
            wanted, evades = take_back(wish, car, ego, episode, lanes, sight, body, settings, step), False
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
