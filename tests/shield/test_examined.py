"""Whom plans are checked against at a junction: the table spares work and loses nobody."""

from functools import cache

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from junction_world import RULED, arms, crossing_pairs, junction

from rss_shield import make, make_vec
from rss_shield.shield.junctions.conflict_areas import cell_of
from rss_shield.shield.junctions.examined import (
    ALL,
    EXAMINED,
    FIRST,
    FIRST_CONFLICTING,
    GEOFENCE,
    RADIUS,
    WALK,
    count_examined,
    examine,
)
from rss_shield.shield.junctions.examined import TABLE as TABLE_ONLY
from rss_shield.shield.junctions.memory import SAMPLE
from rss_shield.shield.junctions.plans import SLACK, Scene, Track
from rss_shield.shield.junctions.reach import THREAT

ENV_ID, FASTER = "intersection-v0", 2


def scene_of(path, s, v, others):
    """The ego on a path among others, given as (path, s, v); an obstacle has path -1."""
    threats = np.zeros(len(others), THREAT)
    for i, (threat, (other, s_other, v_other)) in enumerate(zip(threats, others, strict=True)):
        threat["user"], threat["path"], threat["s"], threat["v"] = i, other, s_other, v_other
        threat["half_length"] = 2.5
    return Scene(junction().roads.paths, Track(path, s, v, 2.5, -1, 0.0), threats, RULED)


def examined(scene, which, samples=None):
    """Who is examined, as a list of indices."""
    samples = np.zeros(len(scene.threats), SAMPLE) if samples is None else samples
    examine(scene, samples, which, SLACK)
    users = [int(i) for i in scene.threats["user"][~scene.threats["left_out"]]]
    assert count_examined(scene) == len(users)
    return users


def test_a_road_user_counts_once_and_a_light_not_at_all():
    a, b = crossing_pairs()[0]
    scene = scene_of(a, 80.0, 9.0, [(b, 80.0, 9.0), (b, 70.0, 9.0), (-1, 0.0, 0.0)])
    scene.threats["user"] = [3, 3, -1]
    assert count_examined(scene) == 1
    scene.threats["ignored"][:2] = True
    assert count_examined(scene) == 0


def past_the_junction(path):
    """Arc length behind the last cell in which the ego is in anybody's way [m]."""
    paths = junction().roads.paths
    return 0.5 * (np.flatnonzero(paths.crossed[path]).max() + 20)


def test_the_table_leaves_out_whoever_the_ego_has_left_behind():
    paths = junction().roads.paths
    a, b = next(
        (a, b)
        for a, b in crossing_pairs()
        if np.isinf(paths.first[a, b, cell_of(past_the_junction(a), paths.cells[a])])
    )
    assert examined(scene_of(a, 80.0, 9.0, [(b, 80.0, 9.0)]), TABLE_ONLY) == [0]
    scene = scene_of(a, past_the_junction(a), 9.0, [(b, 80.0, 9.0)])
    assert examined(scene, TABLE_ONLY) == []
    assert examined(scene, ALL) == [0]


@pytest.mark.parametrize("which", range(len(EXAMINED)))
def test_obstacles_and_the_leader_are_always_examined(which):
    a, _ = crossing_pairs()[0]
    far = np.zeros(2, SAMPLE)
    far["x"] = 10 * RADIUS
    assert examined(scene_of(a, 60.0, 9.0, [(-1, 0.0, 0.0), (a, 80.0, 9.0)]), which, far) == [0, 1]


def test_the_geofence_leaves_out_who_is_far_from_the_junction():
    a, b = crossing_pairs()[0]
    samples = np.zeros(2, SAMPLE)
    samples["x"] = 0.8 * RADIUS, 1.2 * RADIUS
    scene = scene_of(a, 80.0, 9.0, [(b, 80.0, 9.0), (b, 60.0, 9.0)])
    assert examined(scene, GEOFENCE, samples) == [0]


def test_along_an_approach_the_walk_goes_on_until_somebody_arrives_later():
    """The ego reaches the meeting after about 2 s: the cars at 9 m/s behind the first come 1.1 s apart."""
    a, b = crossing_pairs()[0]
    queue = [(b, 90.0 - 10.0 * i, 9.0) for i in range(6)]
    scene = scene_of(a, 80.0, 9.0, queue)
    walked = examined(scene, WALK)
    assert walked == list(range(len(walked))) and 1 < len(walked) < len(queue)
    assert examined(scene, FIRST_CONFLICTING) == [0]
    assert examined(scene, FIRST) == [0]


def test_the_first_car_hides_the_others_though_it_turns_off():
    """Of two cars on one approach the first does not meet the ego: only `first` stops at it."""
    paths = junction().roads.paths
    a, b, free = next(
        (a, b, p)
        for a, b in crossing_pairs()
        for p in range(len(paths.cells))
        if arms(p)[0] == arms(b)[0] and np.isinf(paths.first[a, p, cell_of(79.0, paths.cells[a])])
    )
    scene = scene_of(a, 80.0, 9.0, [(free, 90.0, 9.0), (b, 80.0, 9.0)])
    assert examined(scene, FIRST_CONFLICTING) == [1]
    assert examined(scene, FIRST) == []


# ---------------------------------------------------------------- in the engine


@cache
def played(name, intent="known", envs=24, decisions=13):
    """Speeds after every decision, contacts at the end, and the pairs examined in the first two decisions."""
    options = {"examine": name, "intent": intent, "autoreset_mode": AutoresetMode.DISABLED}
    env = make_vec(ENV_ID, envs, threads=2, config={"duration": 60}, **options)
    env.reset(seed=0)
    cars, counts = [], []
    for _ in range(decisions):
        infos = env.step(np.full(envs, FASTER))[-1]
        cars.append(env.engine.batch.cars[["x", "y", "heading", "speed"]].copy())
        episodes = env.engine.batch.episodes
        counts.append((episodes["pairs_examined"].sum(), episodes["pairs_possible"].sum()))
    env.close()
    return np.array(cars), infos["blame"].copy(), counts


@pytest.mark.parametrize("intent", ["known", "any"])
def test_the_table_gives_the_same_commands_as_examining_everybody(intent):
    everybody, table = played("all", intent), played("table", intent)
    assert np.array_equal(everybody[0], table[0])
    assert np.array_equal(everybody[1], table[1])
    assert table[2][-1][0] < everybody[2][-1][0] <= everybody[2][-1][1] == table[2][-1][1]


def test_each_filter_examines_fewer_pairs():
    first, conflicting, walk, table, everybody, possible = (
        *(played(name)[2][0][0] for name in ("first", "first-conflicting", "walk", "table", "all")),
        played("all")[2][0][1],
    )
    assert 0 < first <= conflicting <= walk <= table <= everybody <= possible
    assert played("geofence")[2][0][0] <= everybody


def test_both_simulators_count_the_same_pairs():
    env, fast = make(ENV_ID, intent="known"), make_vec(ENV_ID, 1, intent="known")
    env.reset(seed=5)
    fast.reset(seed=5)
    for _ in range(3):
        env.step(FASTER)
        fast.step(np.array([FASTER]))
    episode, ego = fast.engine.batch.episodes[0], env._ego
    assert ego.pairs_possible == episode["pairs_possible"] > 0
    assert ego.pairs_examined == episode["pairs_examined"] > 0


@pytest.mark.parametrize("maker", [make, lambda env_id, **options: make_vec(env_id, 1, **options)])
def test_an_unknown_filter_is_refused(maker):
    with pytest.raises(ValueError, match="examine = 'nobody': expected one of all, table"):
        maker(ENV_ID, examine="nobody")
