"""Who is far from the ego is not measured; what the shield makes of a frame must not show it."""

import numba
import numpy as np
import pytest

from rss_shield.envs.fast.config import compile_scenario
from rss_shield.envs.fast.engine import Engine
from rss_shield.envs.fast.frame import survey
from rss_shield.envs.fast.guard import make_watch
from rss_shield.envs.fast.neighbours import Distances, Past, make_past, measure, row_before, start_past
from rss_shield.envs.options import Settings
from rss_shield.shield.lanes.controller import find_danger
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.params import PRESETS, Rules, Table

DT = 0.2
FRAMES = 8


@numba.njit
def _start(episode, past, blank):
    start_past(episode, past, blank)


@numba.njit
def _look(cars, episode, net, sight, frames, past, boxes, settings, chosen, limit, nearest, soonest):
    """One frame, in which `limit` decides who is measured; returns what is found and how many were measured."""
    survey(cars, episode, net, sight, None)
    distances = Distances(frames, past)
    measure(cars, episode, net.lanes, sight, distances, boxes, settings, chosen, limit, soonest, -np.inf)
    danger = find_danger(
        past.ego[episode.turn],
        sight.users,
        past.ego[row_before(episode)],
        sight.users_before,
        past.memory,
        settings.table,
        past.near[: episode.near],
        nearest,
        soonest,
    )
    return danger, episode.near


class Shield:
    """One of two shields on the same road."""

    def __init__(self, engine, settings):
        self.engine, self.settings = engine, settings
        self.episode = engine.batch.episodes[0].copy()
        self.past = Past(*(array[0] for array in make_past(1, engine.batch.cars.shape[1])))
        self.watch = make_watch(settings.table.rules.heading_bound)
        _start(self.episode, self.past, np.zeros(1, MEMORY))

    def look(self, everybody, limit, nearest, soonest):
        engine = self.engine
        world, sight, boxes = engine.world, engine._sights[0], self.watch.boxes
        if everybody:
            self.past.near[:], self.episode["near"] = np.arange(len(self.past.near)), self.episode["cars"] - 1
        limits = everybody, limit, nearest, soonest
        cars = engine.batch.cars[0]
        return _look(cars, self.episode, world.network, sight, world.frames, self.past, boxes, self.settings, *limits)


def scatter(cars, lanes, rng):
    """Cars in any state, most of them as they are on a motorway."""
    n = len(cars)
    cars["x"] = 300.0 + rng.uniform(-120.0, 120.0, n)
    cars["lane"] = rng.integers(len(lanes), size=n)
    cars["y"] = lanes["y"][cars["lane"]] + rng.choice([0.0, 1.0], n) * rng.uniform(-2.0, 2.0, n)
    cars["speed"] = rng.choice([0.0, 1.0], n, p=[0.1, 0.9]) * rng.uniform(-3.0, 40.0, n)
    turn(cars, np.where(rng.random(n) < 0.05, rng.uniform(-np.pi, np.pi, n), rng.uniform(-0.1, 0.1, n)))
    cars["crashed"] = rng.random(n) < 0.05


def turn(cars, headings):
    cars["heading"], cars["cos"], cars["sin"] = headings, np.cos(headings), np.sin(headings)


def move(cars, lanes, rng):
    """One frame on."""
    cars["x"] += cars["speed"] * cars["cos"] * DT
    cars["y"] += cars["speed"] * cars["sin"] * DT
    cars["speed"] += rng.uniform(-8.0, 5.0, len(cars)) * DT
    turn(cars, cars["heading"] + rng.normal(0.0, 0.02, len(cars)))
    cars["crashed"] |= rng.random(len(cars)) < 0.01
    cars["lane"] = np.abs(cars["y"][:, None] - lanes["y"]).argmin(1)


def play(env_id, rules, scenes, measured_up_to=None):
    """Two shields, one of which measures everybody, on random scenes: (differences, shares measured by the other)."""
    settings = Settings(Table(*PRESETS["simulator"][:2], rules, DT), False)
    engine = Engine(compile_scenario(env_id, None), 1, settings)
    engine.seed([0])
    engine.reset()
    lanes, rng = engine.world.network.lanes, np.random.default_rng(0)
    cars = engine.batch.cars[0][: engine.batch.episodes["cars"][0]]
    different, anticipated, shares = 0, 0, []
    for _ in range(scenes):
        scatter(cars, lanes, rng)
        thorough, quick = Shield(engine, settings), Shield(engine, settings)
        nearest = soonest = np.inf
        for frame in range(FRAMES):
            if frame % 4 == 0:
                nearest = np.inf
            full, _ = thorough.look(True, nearest, nearest, soonest)
            found, count = quick.look(False, nearest if measured_up_to is None else measured_up_to, nearest, soonest)
            same = found == full
            anticipated += full.eased != full.bounds
            since = quick.past.memory["since"] == thorough.past.memory["since"]
            in_danger = thorough.past.memory["since"] > 0
            for field in set(MEMORY.names) - {"age"}:
                same &= (quick.past.memory[field] == thorough.past.memory[field])[in_danger].all()
            different += not (same and since.all())
            shares.append(count / (len(cars) - 1))
            nearest, soonest = min(nearest, max(full.margin_lon, full.margin_lat)), full.ttc
            move(cars, lanes, rng)
    engine.close()
    assert (anticipated > 0) == (rules.anticipation > 0.0)
    return different, np.array(shares)


@pytest.mark.parametrize("rules", [Rules(), Rules(heading_bound=1.0), Rules(anticipation=0.0)])
def test_measuring_the_near_ones_comes_to_the_same_as_measuring_everybody(rules):
    different, shares = play("highway-fast-v0", rules, 150)
    assert different == 0
    assert 0.0 < np.median(shares) < 0.6


def test_on_winding_roads_everybody_is_measured():
    different, shares = play("merge-v0", Rules(), 20)
    assert different == 0 and (shares == 1.0).all()


def test_measuring_too_few_would_be_noticed():
    different, _ = play("highway-fast-v0", Rules(anticipation=0.0), 30, measured_up_to=-np.inf)
    assert different > 0
