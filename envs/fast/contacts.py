"""Contacts of the ego, judged at the first sample on which there is one, or one is predicted (Def. 27)."""

import numpy as np

from rss_shield.envs._numpy.floats import norm
from rss_shield.envs.fast.collisions import is_near, overlap
from rss_shield.envs.fast.crossings import scene_of
from rss_shield.envs.fast.neighbours import car_of, measure, row_before, stand_on
from rss_shield.envs.fast.senses import follow
from rss_shield.envs.roads.ways import is_outside
from rss_shield.shield._numba.compiled import inner, part, rare
from rss_shield.shield.junctions.judge import judge_crossing
from rss_shield.shield.lanes.judge import judge_contact
from rss_shield.shield.lanes.memory import catch_up
from rss_shield.shield.tally import copy_judgement, enter_contact
from rss_shield.shield.verdicts import weight_of


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
