"""Compliant traffic: where everybody keeps their duties there are no crashes (Lemmas 5 and 6)."""

import copy

import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from envs import make
from envs.highway import ShieldedEgo
from envs.junction_ego import JunctionEgo
from shield.junction import CAUTIOUS, PRIORITY


def crashes(env, seeds):
    """How many cars crash."""
    return sum(crashes_of_one(env, seed) for seed in seeds)


def crashes_of_one(env, seed):
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    count = env.action_space.n
    everybody: dict[int, Vehicle] = {}
    done = False
    while not done:
        everybody |= {id(v): v for v in env.unwrapped.road.vehicles}
        *_, terminated, truncated, _ = env.step(int(rng.integers(count)))
        done = terminated or truncated
    return sum(v.crashed for v in everybody.values())


STOCK_CRASHES = (48, 54)  # seeds whose stock traffic crashes within 3 s


def test_nobody_crashes_at_an_intersection_where_everybody_complies():
    short = {"duration": 4}
    assert crashes(make("intersection-v0", traffic="compliant", config=short), STOCK_CRASHES) == 0
    assert crashes(make("intersection-v0", config=short), STOCK_CRASHES) > 0


def test_every_other_car_has_a_shield_and_expects_way_only_of_who_must_give_it():
    env = make("intersection-v0", traffic="compliant", shield="monitor")
    env.reset(seed=0)
    others = [v for v in env.unwrapped.road.vehicles if v is not env.unwrapped.vehicle]
    assert [driver.vehicle for driver in env.drivers] == others
    assert all(isinstance(driver, JunctionEgo) for driver in env.drivers)
    assert all(driver.settings.entry == PRIORITY and driver.settings.overrides for driver in env.drivers)
    assert env.settings.entry == CAUTIOUS
    assert not env.settings.overrides


def test_cars_that_come_later_are_shielded_from_their_first_frame():
    env = make("intersection-v0", traffic="compliant", config={"spawn_probability": 1.0})
    env.reset(seed=0)
    at_reset = [driver.vehicle for driver in env.drivers]
    for _ in range(4):
        before = list(env.unwrapped.road.vehicles)
        env.step(1)
        assert all("act" in vars(vehicle) for vehicle in before)
    late = [driver for driver in env.drivers if driver.vehicle not in at_reset]
    assert late
    assert all(driver.frames % 15 == 0 and driver.frames > 0 for driver in late)


def test_drivers_of_cars_that_have_left_are_dropped():
    env = make("intersection-v0", traffic="compliant")
    env.reset(seed=0)
    gone = env.drivers[0].vehicle
    env.unwrapped.road.vehicles.remove(gone)
    env.step(1)
    assert gone not in [driver.vehicle for driver in env.drivers]


def test_a_driver_decides_itself_and_the_shield_only_restricts_it():
    env = make("highway-fast-v0", traffic="compliant", config={"vehicles_count": 1})
    stock = make("highway-fast-v0", config={"vehicles_count": 1})
    for one in (env, stock):
        one.reset(seed=0)
        far = next(v for v in one.unwrapped.road.vehicles if v is not one.unwrapped.vehicle)
        far.position[0] += 500.0  # nobody around
        far.enable_lane_change = False
        for _ in range(3):
            one.step(1)
    one, other = (next(v for v in e.unwrapped.road.vehicles if isinstance(v, IDMVehicle)) for e in (env, stock))
    np.testing.assert_array_equal(one.position, other.position)
    assert one.speed == other.speed
    assert isinstance(env.drivers[0], ShieldedEgo)


def test_verdicts_of_drivers_are_reported():
    env = make("highway-v0", traffic="compliant", config={"vehicles_count": 5})
    _, info = env.reset(seed=0)
    assert info["traffic_blame"] == ()
    one, other = (driver.vehicle for driver in env.drivers[:2])
    other.position = one.position + np.array([2.0, 0.5])  # on top of each other: nobody's doing
    *_, info = env.step(1)
    assert info["traffic_blame"] == ("inherited", "inherited")
    assert "traffic_blame" not in make("highway-v0").reset(seed=0)[1]


def test_several_agents_drive_among_compliant_traffic():
    env = make("intersection-multi-agent-v1", traffic="compliant")
    env.reset(seed=0)
    agents = env.unwrapped.controlled_vehicles
    assert len(env.drivers) == len(env.unwrapped.road.vehicles) - 2
    assert all(driver.vehicle not in agents for driver in env.drivers)
    *_, info = env.step((2, 2))
    assert info["traffic_blame"] == ()


def test_a_copy_carries_its_drivers_along_and_episodes_repeat():
    env = make("intersection-v0", traffic="compliant")
    env.reset(seed=3)
    env.step(2)
    twin = copy.deepcopy(env)

    def trace(one):
        for _ in range(3):
            one.step(2)
        return [(*v.position, v.speed) for v in one.unwrapped.road.vehicles]

    first = trace(env)
    assert trace(twin) == first
    env.reset(seed=3)
    env.step(2)
    assert trace(env) == first


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"traffic": "polite"}, "traffic = 'polite': expected one of stock, compliant"),
        ({"traffic": "compliant", "shield": None}, "traffic = 'compliant': expected 'stock' without a shield"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        make("highway-fast-v0", **arguments)


def test_a_driver_may_turn_off_a_ring():
    """At seed 2 car 2 leaves by the second exit, ten metres from the lane that it comes from."""
    env = make("roundabout-v0", traffic="compliant")
    env.reset(seed=2)
    car = env.unwrapped.road.vehicles[2]
    for _ in range(5):
        env.step(1)
    exit_roads = [("nx", "nxs"), ("nxs", "nxr")]
    assert car.lane_index[:2] in exit_roads
    assert car.target_lane_index[:2] in exit_roads
