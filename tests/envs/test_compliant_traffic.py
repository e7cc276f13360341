"""Compliant traffic: where everybody keeps their duties there are no crashes (Lemmas 5 and 6)."""

import copy

import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make
from rss_shield.envs.highway.compliant import GAP, CompliantDriver, TurnTaker, shield_of
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.shield.junctions.conflict_areas import CELL
from rss_shield.shield.junctions.memory import ASSERTIVE, CAUTIOUS, PRIORITY
from rss_shield.shield.junctions.plans import ANY, KNOWN
from rss_shield.shield.verdicts import OTHER


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


def heeded(shield):
    """Whom a driver's plans stay clear of."""
    return [shield.others[threat["user"]] for threat in shield._look()[1] if threat["user"] >= 0]


def all_get_through(env, seed):
    """Is the agent alone after 24 s, if nobody comes any more?"""
    env.reset(seed=seed)
    for _ in range(24):
        env.step(2)
    return env.unwrapped.road.vehicles == [env.unwrapped.vehicle]


def test_traffic_flows_and_locks_up_if_nobody_takes_turns(monkeypatch):
    env = make("intersection-v0", traffic="compliant", config={"spawn_probability": 0.0})
    assert all_get_through(env, 1)
    monkeypatch.setattr(TurnTaker, "_may_rely_on", lambda *_: False)
    assert not all_get_through(env, 1)


def test_an_agent_that_relies_on_nobody_is_left_a_gap():
    """At seed 4 it would wait for more than 40 s: somebody always comes."""
    env = make("intersection-v0", traffic="compliant", config={"duration": 20})
    env.reset(seed=4)
    waited, done = 0, False
    while not done:
        *_, terminated, truncated, info = env.step(2)
        done = terminated or truncated
        waiting = [driver for driver in env.drivers if driver.holds]
        waited += len(waiting)
        assert all(driver.to_junction >= GAP - CELL for driver in waiting)
    assert waited
    assert info["is_success"]


def test_turns_are_a_lasting_order_and_of_two_cars_one_stays_clear_of_the_other():
    env = make("intersection-v0", traffic="compliant")
    env.reset(seed=2)
    first_seen = {}
    for _ in range(8):
        shields = [shield for shield in map(shield_of, env.unwrapped.road.vehicles) if shield]
        turns = {id(shield): shield.turn for shield in shields if shield.turn > 0}
        assert len({*turns.values()}) == len(turns) > 0
        assert first_seen.items() <= {**first_seen, **turns}.items()
        first_seen |= turns
        for one in shields:
            for other in shields:
                if other.turn > one.turn and {one.vehicle, other.vehicle} <= {*one.others, *other.others}:
                    assert one.vehicle in heeded(other) or other.vehicle in heeded(one)
                    same_lane = one.vehicle.lane_index == other.vehicle.lane_index
                    assert not same_lane or one.turn == 0 or one.vehicle.lane_distance_to(other.vehicle) < 0.0
        env.step(2)


def test_who_queues_behind_an_agent_that_lets_everybody_go_first_has_no_turn_before_it_has_gone():
    """At seed 116 everybody would wait: the agent for cars at their lines, these for the one behind the agent."""
    env = make("intersection-v0", traffic="compliant")
    env.reset(seed=116)
    agent = env.unwrapped.vehicle
    for _ in range(8):
        env.step(2)
    behind = min((d for d in env.drivers if d.vehicle.lane_index[0] == "o0"), key=lambda d: -d.progress())
    assert behind.vehicle.lane_index == ("o0", "ir0", 0)
    assert behind.turn == 0
    assert agent in heeded(behind)
    assert all(behind.vehicle not in heeded(d) for d in env.drivers if d.turn and behind.vehicle in d.others)


def test_nobody_relies_on_who_has_no_plan_or_does_not_wait_for_its_turn():
    env = make("intersection-v0", traffic="compliant")
    env.reset(seed=2)
    env.step(2)
    last = max((d for d in env.drivers if d.since["frames"]), key=lambda driver: driver.turn)
    first = next(d for d in env.drivers if last.vehicle in d.others and last.vehicle not in heeded(d))
    for change in ("trapped", "assertive", "contact"):
        settings = last.settings
        if change == "trapped":
            last.trapped = True
        elif change == "assertive":
            last.settings = settings._replace(entry=ASSERTIVE)
        else:
            last.since["blame"] = 1 + OTHER
        assert last.vehicle in heeded(first)
        last.trapped, last.settings, last.since["blame"] = False, settings, 0
        assert last.vehicle not in heeded(first)


def test_an_agent_takes_its_turn_unless_it_is_cautious():
    for entry in ("cautious", "priority"):
        env = make("intersection-v0", traffic="compliant", entry=entry)
        env.reset(seed=2)
        env.step(2)
        agent = shield_of(env.unwrapped.vehicle)
        later = {driver.vehicle for driver in env.drivers if driver.turn > agent.turn} & {*agent.others}
        assert later
        assert later <= {*heeded(agent)} if entry == "cautious" else not later <= {*heeded(agent)}


def test_every_other_car_has_a_shield_and_expects_way_only_of_who_must_give_it():
    env = make("intersection-v0", traffic="compliant", shield="monitor")
    env.reset(seed=0)
    others = [v for v in env.unwrapped.road.vehicles if v is not env.unwrapped.vehicle]
    assert [driver.vehicle for driver in env.drivers] == others
    assert all(isinstance(driver, CompliantDriver) for driver in env.drivers)
    assert all(driver.settings.intent == KNOWN for driver in env.drivers)
    assert all(driver.settings.entry == PRIORITY and driver.settings.overrides for driver in env.drivers)
    assert env.settings.entry == CAUTIOUS
    assert env.settings.intent == ANY
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
    assert all(driver.since["frames"] % 15 == 0 and driver.since["frames"] > 0 for driver in late)


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
