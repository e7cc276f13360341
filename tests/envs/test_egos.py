"""Whom a wrapper shields: whichever vehicle is the ego, in the original, in copies and in restored states."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle

from rss_shield import MultiAgentShield, ShieldWrapper, make
from rss_shield.envs.highway.step import shield_on

pytestmark = pytest.mark.filterwarnings("ignore:.*out of date.*")
IDLE, FASTER = 1, 3
ROADS = [("highway-fast-v0", FASTER), ("exit-v0", FASTER), ("merge-v0", FASTER), ("intersection-v0", 2)]


def play(env, action, steps=100):
    """The rest of an episode: what infos tell of every step."""
    told = []
    for _ in range(steps):
        *_, terminated, truncated, info = env.step(action)
        told.append((info["shield"]["override_fraction"], info["shield"]["dangerous_pairs"], info["blame"]))
        if terminated or truncated:
            break
    return told, info


def replace_ego(env, kind):
    base = env.unwrapped
    old, new = base.vehicle, kind.create_from(base.vehicle)
    base.road.vehicles[base.road.vehicles.index(old)] = new
    base.controlled_vehicles = [new]
    return new


def wrapper_by_wrapper(env):
    """As planners copy an environment: every wrapper for itself."""
    clone = type(env).__new__(type(env))
    memo = {id(env): clone}
    for name, value in vars(env).items():
        is_inner = isinstance(value, gym.Env)
        setattr(clone, name, wrapper_by_wrapper(value) if is_inner else copy.deepcopy(value, memo))
    return clone


@pytest.mark.parametrize("kind", [MDPVehicle, IDMVehicle])
@pytest.mark.parametrize(("env_id", "action"), ROADS)
def test_a_car_that_takes_the_egos_place_is_shielded(env_id, action, kind):
    env = make(env_id)
    for seed in (4, 11):
        env.reset(seed=seed)
        for _ in range(seed % 4):
            env.step(IDLE)
        new = replace_ego(env, kind)
        _, info = play(env, action)
        assert shield_on(new) is env._ego
        assert info["blame"] in ("", "other", "inherited")
        assert info["episode_broken_duties"] == 0


def test_a_replaced_ego_that_crashes_is_judged_as_the_first_one_would_be():
    env = make("highway-fast-v0", shield="monitor")
    for seed in (2, 3, 5):
        env.reset(seed=seed)
        first = play(env, FASTER)[0]
        env.reset(seed=seed)
        replace_ego(env, MDPVehicle)
        assert play(env, FASTER)[0] == first
        assert first[-1][2] == "ego"


def test_what_counts_since_reset_goes_on_where_an_ego_is_replaced():
    env = make("highway-fast-v0", shield="monitor")
    env.reset(seed=2)
    cost = 0.0
    for _ in range(8):
        replace_ego(env, MDPVehicle)
        *_, info = env.step(FASTER)
        cost += info["cost"]
        assert info["episode_cost"] == cost
    assert cost > 0.0


@pytest.mark.parametrize("traffic", ["stock", "compliant"])
@pytest.mark.parametrize(("env_id", "number"), [("highway-fast-v0", 1), ("highway-fast-v0", 4), ("roundabout-v0", 2)])
def test_the_shield_moves_to_another_car_on_the_road_and_back(env_id, number, traffic):
    env = make(env_id, traffic=traffic)
    env.reset(seed=1)
    base = env.unwrapped
    first, second = base.vehicle, base.road.vehicles[number]
    for ego, other in ((second, first), (first, second)):
        base.controlled_vehicles = [ego]
        *_, info = env.step(IDLE)
        assert env._ego.vehicle is ego
        assert shield_on(ego).is_ego
        assert (shield_on(other) is not None) == (traffic == "compliant")
        assert not (shield_on(other) and shield_on(other).is_ego)
        assert len({id(driver.vehicle) for driver in env.drivers}) == len(env.drivers)
    assert "override_share" in info


@pytest.mark.parametrize("mode", ["override", "monitor"])
@pytest.mark.parametrize(("env_id", "action"), [("highway-fast-v0", FASTER), ("merge-v0", 0), ("intersection-v0", 2)])
def test_copies_and_restored_states_tell_of_their_own_egos(env_id, action, mode):
    env = make(env_id, shield=mode)
    env.reset(seed=6)
    env.step(action)
    clones = [copy.deepcopy(env), wrapper_by_wrapper(env), pickle.loads(pickle.dumps(env))]
    saved = copy.deepcopy(env.unwrapped)
    expected, last = play(env, action)
    for clone in clones:
        told, info = play(clone, action)
        assert told == expected
        assert info["override_share"] == last["override_share"]
    for restore in (copy.deepcopy(saved), copy.deepcopy(saved).__dict__):
        inner = env
        while inner.env is not env.unwrapped:
            inner = inner.env
        if isinstance(restore, dict):
            vars(env.unwrapped).update(restore)
        else:
            inner.env = restore
        if hasattr(inner, "_elapsed_steps"):
            inner._elapsed_steps = 1
        assert play(env, action)[0] == expected


def test_copies_in_compliant_traffic_tell_of_their_own_drivers():
    env = make("intersection-v0", traffic="compliant", shield="monitor")
    env.reset(seed=3)
    clone = wrapper_by_wrapper(env)
    play(clone, 2)
    on_road = {id(shield_on(v)) for v in clone.unwrapped.road.vehicles}
    assert {id(driver) for driver in clone.drivers if not driver.has_contact} <= on_road
    assert not on_road & {id(driver) for driver in env.drivers}


def test_a_shallow_copy_of_a_car_has_not_its_shield():
    env = make("highway-fast-v0", shield="monitor")
    env.reset(seed=2)
    base = env.unwrapped
    new = copy.copy(base.vehicle)
    base.road.vehicles[0] = new
    base.controlled_vehicles = [new]
    env.step(FASTER)
    assert shield_on(new).vehicle is new


def test_highway_envs_own_simplified_copy_goes_on_behind_the_shield():
    env = make("highway-fast-v0")
    env.reset(seed=3)
    env.step(FASTER)
    inner = env
    while inner.env is not env.unwrapped:
        inner = inner.env
    inner.env = env.unwrapped.simplify()
    told, info = play(env, FASTER)
    assert info["blame"] == ""
    assert sum(fraction for fraction, *_ in told) > 0.0


def test_an_environment_that_is_reset_inside_the_shield_is_shielded_anew():
    env = ShieldWrapper(gym.wrappers.Autoreset(gym.make("highway-fast-v0")), mode="monitor")
    env.reset(seed=0)
    verdicts, begins = [], []
    for _ in range(40):
        *_, terminated, truncated, info = env.step(FASTER)
        if terminated or truncated:
            verdicts.append(info["blame"])
        if info["time"] == 0.0:
            begins.append((info["blame"], info["episode_cost"], info["shield"]["dangerous_pairs"]))
    assert set(verdicts) == {"ego"}
    assert set(begins) == {("", 0.0, 0)}
    assert len(begins) >= 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda base: setattr(base, "vehicle", MDPVehicle.create_from(base.vehicle)),
            "is not on the environment's road",
        ),
        (lambda base: setattr(base, "road", copy.deepcopy(base.road)), "is not on the environment's road"),
        (lambda base: base.controlled_vehicles.clear(), "controlled_vehicles = 0: expected exactly 1"),
        (lambda base: base.controlled_vehicles.append(base.road.vehicles[3]), "controlled_vehicles = 2"),
        (lambda base: base.configure({"simulation_frequency": 10}), "a reset after a change of its configuration"),
    ],
)
def test_an_ego_that_cannot_be_shielded_is_an_error(change, message):
    env = make("highway-fast-v0")
    env.reset(seed=0)
    change(env.unwrapped)
    with pytest.raises(ValueError, match=message):
        env.step(IDLE)


class SwapsDuringSteps(gym.Wrapper):
    def step(self, action):
        replace_ego(self.env, MDPVehicle)
        return self.env.step(action)


def test_an_ego_that_is_replaced_behind_the_shields_back_is_an_error():
    env = ShieldWrapper(SwapsDuringSteps(gym.make("highway-fast-v0")))
    env.reset(seed=0)
    with pytest.raises(ValueError, match="changed during a step"):
        env.step(IDLE)


def test_a_wreck_that_becomes_the_ego_has_had_its_contact():
    for env_id in ("highway-fast-v0", "intersection-v0", "exit-v0"):
        env = make(env_id)
        env.reset(seed=1)
        base = env.unwrapped
        wreck = next(vehicle for vehicle in base.road.vehicles if vehicle is not base.vehicle)
        wreck.crashed = True
        base.controlled_vehicles = [wreck]
        *_, info = env.step(IDLE)
        assert info["blame"] == "inherited"
        assert info["cost"] == 0.0


REGISTERED = "behind-a-shield-v0"


@pytest.mark.parametrize(
    "build",
    [
        lambda: ShieldWrapper(make("highway-fast-v0"), mode="monitor"),
        lambda: ShieldWrapper(gym.wrappers.FlattenObservation(make("intersection-v0", shield="monitor"))),
        lambda: ShieldWrapper(make("merge-v0").unwrapped),
        lambda: ShieldWrapper(copy.deepcopy(make("exit-v0").unwrapped)),
        lambda: MultiAgentShield(make("intersection-multi-agent-v1")),
        lambda: make(REGISTERED),
    ],
)
def test_a_second_shield_is_refused(build):
    if REGISTERED not in gym.registry:
        gym.register(REGISTERED, entry_point=lambda **options: make("highway-fast-v0", **options))
    with pytest.raises(ValueError, match="is behind a shield already: expected one that is not"):
        build()


def test_agents_that_are_replaced_are_shielded():
    env = make("intersection-multi-agent-v0", shield="monitor", config={"controlled_vehicles": 3})
    env.reset(seed=0)
    base = env.unwrapped
    env.step((2, 2, 2))
    vehicles = list(base.controlled_vehicles)
    new = IDMVehicle.create_from(vehicles[1])
    base.road.vehicles[base.road.vehicles.index(vehicles[1])] = new
    base.controlled_vehicles = [vehicles[2], new, vehicles[0]]
    *_, info = env.step((2, 2, 2))
    assert [shield.vehicle for shield in env._egos] == [vehicles[2], new, vehicles[0]]
    assert len(info["agents"]) == 3
    assert all(np.isfinite(agent["min_ttc"]) for agent in info["agents"])
    clone = wrapper_by_wrapper(env)
    assert clone.step((2, 2, 2))[4]["agents"] == env.step((2, 2, 2))[4]["agents"]
