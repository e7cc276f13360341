"""Masks of meta-actions for a batch: would the coming decision pass without a proper response?

Nothing is decided here, so the state of an environment is copied, and what an action sets on the ego is put back.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.compiled import kernel
from rss_shield.envs.decisions.foresight import Aim, Seen, Stage, first_response, make_stage, within
from rss_shield.envs.decisions.junctions import first_override
from rss_shield.envs.decisions.masks import allow
from rss_shield.envs.fast.crossings import Plans, scene_of
from rss_shield.envs.fast.drivers import take_meta_action
from rss_shield.envs.fast.frame import survey
from rss_shield.envs.fast.lane_changes import is_refused
from rss_shield.envs.fast.neighbours import Distances, Past, make_past, measure, row_before, stand_on
from rss_shield.envs.fast.senses import GHOSTS, aware_of, look
from rss_shield.envs.fast.sight import project
from rss_shield.envs.fast.state import EPISODE
from rss_shield.envs.roads.network import heading_at
from rss_shield.envs.roads.steering import PURSUIT
from rss_shield.shield._numba.compiled import inner, part
from rss_shield.shield.junctions.controller import has_plan
from rss_shield.shield.junctions.memory import CROSSING
from rss_shield.shield.lanes.restriction import Body


class Desk(NamedTuple):
    """Copies of one environment at a time, to think on."""

    episode: np.ndarray  # `[1]` EPISODE
    past: Past  # of one environment
    crossings: np.ndarray  # `[N]` CROSSING
    stage: Stage
    first: np.ndarray  # `[A]` frame on which each action is first answered
    lanes: np.ndarray  # `[A]` that each heads for
    speeds: np.ndarray  # `[A]` likewise [m/s]


class Choice(NamedTuple):
    """What a meta-action sets on the ego."""

    lane: int
    speed: float
    speed_index: int
    route_step: int


def make_desk(n: int, actions: int) -> Desk:
    """Working memory for `n` road users and so many actions."""
    past = Past(*(column[0] for column in make_past(1, n)))
    numbers = np.zeros(actions, np.int64), np.zeros(actions, np.int64), np.zeros(actions)
    return Desk(np.zeros(1, EPISODE), past, np.zeros(n, CROSSING), make_stage(n), *numbers)


@kernel
def foresee(begin, end, sight, desk, world, batch, watch, settings, masks):
    """Masks of the environments `begin` to `end` - 1.

    Args:
      sight, desk: working memory.
      world, batch: `World` and `Batch`; the batch is as before in the end.
      watch, settings: of the shield, without anticipation.
      masks: `[E, A]`, overwritten.
    """
    config, net = world.config[0], world.network
    for e in range(begin, end):
        cars, episode, mask = batch.cars[e], batch.episodes[e], masks[e]
        if episode.ended or episode.blame != 0:
            for a in range(len(mask)):
                mask[a] = True
            continue
        survey(cars, episode, net, sight, world.flow)
        aware = aware_of(e, batch.sensed, world.frames)
        _look(e, cars, episode, sight, desk, world, batch, watch, settings, aware)
        allow(desk.first, config.frames, world.labels, mask)


@inner
def _look(e, cars, episode, sight, desk, world, batch, watch, settings, aware):
    """`_look_ahead` at what is there, or at what is seen; numba leaves out the other."""
    if aware is None:
        _look_ahead(e, world.frames, world.ways, cars, episode, sight, desk, world, batch, watch, settings, None)
    else:
        _look_ahead_as_seen(e, cars, episode, sight, desk, world, batch, watch, settings, aware)


@inner
def _look_ahead_as_seen(e, cars, episode, sight, desk, world, batch, watch, settings, aware):
    """`_look_ahead` at the cars that are seen."""
    n = episode.cars
    look(cars, episode, aware)
    project(aware.cars, n + GHOSTS, world.network, sight)
    episode.cars = n + GHOSTS
    _look_ahead(e, world.frames, world.ways, aware.cars, episode, sight, desk, world, batch, watch, settings, aware)
    episode.cars = n


@inner
def _look_ahead(e, frames, ways, cars, episode, sight, desk, world, batch, watch, settings, aware):
    """Of `frames` and `ways` one is None, and numba leaves out what it would need."""
    if frames is not None:
        _foresee_on_lanes(e, cars, episode, sight, desk, world, batch, watch, settings, aware)
    if ways is not None:
        _foresee_at_junctions(e, cars, episode, sight, desk, world, batch, settings)


@inner
def _chosen(car):
    return Choice(car.target_lane, car.target_speed, car.speed_index, car.route_step)


@inner
def _put_back(car, choice):
    car.target_lane, car.target_speed = choice.lane, choice.speed
    car.speed_index, car.route_step = choice.speed_index, choice.route_step


# ---------------------------------------------------------------- distances along lanes


@part
def _foresee_on_lanes(e, cars, episode, sight, desk, world, batch, watch, settings, aware):
    config, net, lanes, past = world.config[0], world.network, world.network.lanes, desk.past
    _copy_past(past, batch.past, e, episode.cars)
    desk.episode[0] = episode
    copy, car = desk.episode[0], cars[episode.ego]
    distances, near = Distances(world.frames, past), _margin_that_matters(cars, episode, config, settings)
    settings = stand_on(cars, copy, world.frames.ground, past.memory, settings)
    limits = False, -np.inf, -np.inf, near
    bend = measure(cars, copy, lanes, sight, distances, watch.boxes, settings, *limits, aware)
    me = past.ego[copy.turn]
    seen = Seen(me, sight.users, past.ego[row_before(copy)], sight.users_before, past.memory)
    stops = settings.table.ego.a_min_brake
    body = Body(car.length / 2, watch.max_slip, bend.curvature, bend.slack, bend.turned, bend.idle, False, stops)
    who, before = past.near[: copy.near], _chosen(car)
    for a in range(len(world.labels)):
        take_meta_action(cars, episode.ego, world.labels[a], net, lanes, sight, world.target_speeds)
        k = car.target_lane
        desk.lanes[a], desk.speeds[a] = k, car.target_speed
        same = _same_as(a, desk)
        if same >= 0:
            desk.first[a] = desk.first[same]
        elif is_refused(before.lane, car, episode, lanes, sight, settings):
            desk.first[a] = 0
        else:
            ahead = heading_at(lanes[k], sight.s[k, episode.ego] + car.speed * PURSUIT)
            aim = Aim(car.target_speed, sight.lateral[k, episode.ego], ahead - (car.heading - me.heading))
            desk.first[a] = first_response(seen, desk.stage, aim, body, config.frames, settings.table, who)
        _put_back(car, before)


@inner
def _same_as(a, desk):
    """An earlier action that sets the same, -1 = none."""
    for b in range(a):
        if desk.lanes[b] == desk.lanes[a] and desk.speeds[b] == desk.speeds[a]:
            return b
    return -1


@inner
def _copy_past(copy, past, e, n):
    for row in range(len(copy.ego)):
        copy.ego[row] = past.ego[e, row]
        for i in range(n):
            copy.trail[row, i] = past.trail[e, row, i]
    for i in range(n):
        copy.memory[i], copy.near[i] = past.memory[e, i], past.near[e, i]


@inner
def _margin_that_matters(cars, episode, config, settings):
    """Margin of Def. 1 beyond which nobody can be in danger during the decision [m]."""
    ego, slowest, fastest = cars[episode.ego], 0.0, 0.0
    for i in range(episode.cars):
        car = cars[i]
        along = car.speed * (car.cos * ego.cos + car.sin * ego.sin)
        slowest, fastest = (along, along) if i == 0 else (min(slowest, along), max(fastest, car.speed))
    return within(ego.speed, slowest, fastest, config.frames * settings.table.dt, settings.table.ego)


# ---------------------------------------------------------------- plans


@part
def _foresee_at_junctions(e, cars, episode, sight, desk, world, batch, settings):
    net = world.network
    car, at_line = cars[episode.ego], not settings.waits_anywhere
    before = _chosen(car)
    for a in range(len(world.labels)):
        take_meta_action(cars, episode.ego, world.labels[a], net, net.lanes, sight, world.target_speeds)
        desk.lanes[a], desk.speeds[a] = car.target_lane, car.target_speed
        same = _same_as(a, desk)
        if same >= 0:
            desk.first[a] = desk.first[same]
        else:
            desk.first[a] = _first_override(e, before.lane, cars, episode, sight, desk, world, batch, at_line, settings)
        _put_back(car, before)


@inner
def _first_override(e, lane, cars, episode, sight, desk, world, batch, at_line, settings):
    """Frame on which the shield would change the acceleration, if the ego headed for what it heads for now."""
    n, car, roads = episode.cars - 1, cars[episode.ego], world.ways.roads.lanes
    desk.episode[0] = episode
    copy, plans = desk.episode[0], Plans(world.ways, desk.crossings)
    for i in range(n):
        desk.crossings[i] = batch.crossings[e, i]
    scene, memory = scene_of(cars, copy, sight, plans, settings, False), desk.crossings[:n]
    changes = car.target_lane != lane and roads[car.target_lane].road == roads[lane].road
    if changes and not has_plan(scene, memory, settings.entry, at_line):
        return 0
    rules = settings.entry, at_line, settings.examine
    return first_override(scene, sight.samples[:n], memory, copy, car.target_speed, world.config[0].frames, *rules)
