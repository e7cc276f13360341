"""Hostile drivers in the engine drive as they do on highway-env, to the last bit."""

import numpy as np
import pytest
from lockstep import compare

from rss_shield.envs.fast.config import Unsupported, compile_scenario
from rss_shield.envs.roads.hostile import (
    BRAKE_CHECKER,
    HOSTILE,
    MIXED,
    REVERSER,
    SQUEEZER,
    VICES,
    WRONG_WAY,
    harass,
    hostile_command,
    vice_at,
    vice_of,
)

CROWD = {"duration": 10, "vehicles_count": 8, "vehicles_density": 1.5}


@pytest.mark.parametrize("driver", HOSTILE)
def test_on_a_motorway_both_simulators_agree(driver):
    config = CROWD | {"other_vehicles_type": HOSTILE[driver]}
    found = compare("highway-fast-v0", range(1), "random", config=config, shield="override", max_steps=10)
    assert found.discrete == []
    assert found.equal == found.episodes


@pytest.mark.parametrize(
    ("env_id", "driver", "policy"),
    [
        *((env_id, "mixed", "random") for env_id in ("merge-v0", "exit-v0", "two-way-v0")),
        ("merge-v0", "bounded-mixed", "random"),  # seed 1: somebody sees the lane that the ego was given back
        ("two-way-v0", "rammer", "faster"),
        ("exit-v0", "wrongway", "slower"),
    ],
)
def test_on_other_common_roads_too(env_id, driver, policy):
    config = {"other_vehicles_type": HOSTILE[driver]} | ({"duration": 6} if env_id == "exit-v0" else {})
    found = compare(env_id, range(2), policy, config=config, shield="override", max_steps=10)
    assert found.discrete == []
    assert found.equal == found.episodes


@pytest.mark.parametrize("env_id", ["roundabout-v0", "intersection-v0"])
def test_and_where_roads_cross(env_id):
    for driver in ("mixed", "runner"):
        config = {"other_vehicles_type": HOSTILE[driver]}
        found = compare(env_id, range(1), "random", config=config, shield="override", max_steps=6)
        assert found.discrete == []
        assert found.equal == found.episodes


def test_a_mixed_crowd_has_many_vices():
    rng = np.random.default_rng(0)
    drawn = [vice_at(MIXED, *rng.uniform(0.0, 500.0, 2)) for _ in range(400)]
    assert set(drawn) == set(range(len(VICES)))
    assert vice_at(SQUEEZER, 1.0, 2.0) == SQUEEZER


def test_names_say_which_vice_and_whether_it_is_bounded():
    assert vice_of(HOSTILE["wrongway"]) == (WRONG_WAY, False)
    assert vice_of(HOSTILE["bounded-squeezer"]) == (SQUEEZER, True)
    assert vice_of(HOSTILE["bounded-mixed"]) == (MIXED, True)
    assert vice_of("highway_env.vehicle.behavior.IDMVehicle") is None
    with pytest.raises(Unsupported, match="one of HOSTILE"):
        compile_scenario("highway-fast-v0", {"other_vehicles_type": "rss_shield.envs.worlds.random_roads.Tailgater"})


def test_a_brake_checker_brakes_when_it_is_in_the_way():
    assert harass(BRAKE_CHECKER, 20.0, 0.1, 20.0, 20.0, 0.0, 1.0) == (-12.0, 0.0)
    assert harass(BRAKE_CHECKER, 50.0, 0.1, 20.0, 20.0, 0.0, 1.0)[0] == 0.0  # far ahead it waits
    a, aside = harass(BRAKE_CHECKER, 20.0, 3.0, 20.0, 20.0, 0.0, 1.0)
    assert (a, aside) == (0.0, -1.5)  # beside it first moves over, to the left


def test_bounded_drivers_keep_to_the_limits_of_the_table():
    rng = np.random.default_rng(1)
    for _ in range(500):
        v, wanted = rng.uniform(0.0, 40.0), (rng.uniform(-15.0, 15.0), rng.uniform(-5.0, 5.0))
        a, steering = hostile_command(SQUEEZER, True, wanted, v, rng.uniform(-0.3, 0.3), False, rng.uniform(-1.0, 1.0))
        assert -6.0 <= a <= 3.0
        slip = np.arctan(0.5 * np.tan(steering))
        assert v**2 * abs(np.sin(slip)) / 2.5 <= 1.0 + 1e-9 or abs(slip) > 0.5  # m/s^2 across the lane
    # who does not reverse comes to rest and no further
    assert hostile_command(SQUEEZER, False, (-12.0, np.nan), 0.0, 0.0, False, 0.1) == (0.0, 0.1)
    assert hostile_command(REVERSER, False, (-12.0, np.nan), 0.0, 0.0, False, 0.1) == (-12.0, 0.1)


def test_who_moves_over_turns_to_that_side_of_the_victims_lane():
    wanted = (0.0, 1.0)
    assert hostile_command(SQUEEZER, False, wanted, 20.0, 0.0, False, 0.0)[1] > 0.0
    assert hostile_command(SQUEEZER, False, wanted, 20.0, 0.0, True, 0.0)[1] < 0.0  # its own lane runs the other way
    assert hostile_command(SQUEEZER, False, wanted, 20.0, np.pi, False, 0.0)[1] < 0.0  # it drives the wrong way
