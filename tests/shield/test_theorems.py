"""Lemma 5, sampled: started safe and among drivers who keep the law, nobody is ever touched.

The drivers use every right they have, as nastily as they can (see `adversary.py`), in four worlds:
frames of 1/15 s and 1/5 s, each with the published table and with a bare one, in which no wobble width, no
standstill gap and almost no box inflation hides a missing margin.
"""

import numpy as np
import pytest
from adversary import CAR, contact, play, world
from highway_env.vehicle.kinematics import Vehicle

WORLDS = [(dt, bare) for dt in (1 / 15, 1 / 5) for bare in (False, True)]
EPISODES = 5000  # in each of four worlds: 20 000 pairs and 20 000 triples


@pytest.mark.parametrize(("dt", "bare"), WORLDS)
@pytest.mark.parametrize("others", [1, 2], ids=["pairs", "triples"])
def test_started_safe_and_among_the_lawful_nobody_is_touched(others, dt, bare):
    w = world(dt=dt, frames=120, bare=bare, others=others)
    episodes = play(EPISODES, w, seed=1)
    assert (episodes["contact"] == -1).all()
    assert episodes["broken"].sum() == 0, "the ego broke a duty"
    assert episodes["heading"].max() <= np.arcsin(w.published.heading_bound) + 1e-9
    # nobody was tame
    assert (episodes["overridden"] > 0).mean() > 0.4
    assert (episodes["danger_lon"] > 0).mean() > 0.1
    assert (episodes["danger_lat"] > 0).mean() > 0.1
    assert (episodes["answered_now"] > 0).any()


def random_car(rng):
    car = np.zeros(1, CAR)
    car["x"], car["y"] = rng.uniform(-6.0, 6.0), rng.uniform(-4.0, 4.0)
    car["heading"], car["speed"] = rng.uniform(-np.pi, np.pi), rng.uniform(-10.0, 40.0)
    car["length"], car["width"] = 5.0, 2.0
    return car[0]


def as_vehicle(car):
    return Vehicle(None, [car["x"], car["y"]], car["heading"], car["speed"])


def test_contact_in_the_adversarial_world_is_highway_envs_own():
    rng = np.random.default_rng(0)
    outcomes = set()
    for _ in range(3000):
        a, b = random_car(rng), random_car(rng)
        one, two = as_vehicle(a), as_vehicle(b)
        both_ways = [
            one._is_colliding(two, 1 / 15),
            two._is_colliding(one, 1 / 15),
        ]  # how far it looks depends on whose
        expected = tuple(any(way[k] for way in both_ways) for k in range(2))
        assert contact(a, b, 1 / 15) == expected
        outcomes.add(expected)
    assert outcomes == {(True, True), (False, True), (False, False)}
