"""Intersections: traffic that comes and goes, and yields."""

import os

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from highway_env.vehicle.behavior import IDMVehicle
from lockstep import compare

import rss_shield
from rss_shield.envs.fast.config import Unsupported, compile_scenario
from rss_shield.envs.fast.engine import DISABLED, Engine

ENV = "intersection-v0"
LONG = int(os.environ.get("PARITY_EPISODES", "2"))  # episodes per case
DENSE = {
    "destination": None,
    "initial_vehicle_count": 16,
    "spawn_probability": 1.0,
    "duration": 20,
    "simulation_frequency": 10,
    "policy_frequency": 2,
    "normalize_reward": True,
    "offroad_terminal": True,
    "observation": {"type": "Kinematics", "vehicles_count": 6, "see_behind": True},
    "action": {"type": "DiscreteMetaAction", "target_speeds": [0, 3, 6, 9]},
}


CASES = [
    ("random", DENSE),
    ("slower", DENSE),
    ("random", {"initial_vehicle_count": 0}),
    ("random", {"destination": "o0"}),
    ("random", {"action": {"type": "ContinuousAction"}}),  # regulation predicts the ego by its steering
    ("faster", {"action": {"type": "ContinuousAction"}}),
]


@pytest.mark.parametrize(("policy", "config"), CASES)
def test_overridden_defaults_agree_to_the_last_bit(policy, config):
    found = compare(ENV, range(LONG), policy, config=config)
    assert found.discrete == []
    assert found.equal == found.episodes == LONG


def test_the_same_seeds_give_the_same_episodes():
    def rollout(threads):
        env = rss_shield.make_vec(ENV, 5, shield=None, threads=threads)
        rng = np.random.default_rng(0)
        seen = [env.reset(seed=3)[0]]
        for _ in range(30):
            seen += env.step(rng.integers(3, size=5))[:4]
        seen.append(env.engine.batch.cars)
        env.close()
        return seen

    assert all(np.array_equal(a, b) for a, b in zip(rollout(1), rollout(2), strict=True))


def test_rows_of_cars_that_left_are_empty():
    engine = Engine(compile_scenario(ENV), 8, autoreset=DISABLED)
    engine.seed(range(8))
    engine.reset()
    for _ in range(13):
        engine.step(np.zeros(8, int))
        lengths = engine.batch.cars["length"]
        assert ((lengths > 0).sum(axis=1) == engine.batch.episodes["cars"]).all()


def test_a_masked_reset_returns_the_last_observation_of_the_others():
    engine = Engine(compile_scenario(ENV), 4, autoreset=DISABLED)
    engine.seed(range(4))
    engine.reset()
    before = engine.step(np.full(4, 1)).observations
    after = engine.reset(np.array([True, False, False, False])).observations
    assert np.array_equal(after[1:], before[1:])
    assert not np.array_equal(after[0], before[0])


def test_too_many_cars_are_an_error():
    engine = Engine(compile_scenario(ENV, capacity=6), 4)
    engine.seed(range(4))
    with pytest.raises(OverflowError, match="more than 6 road users"):
        for _ in range(4):
            engine.reset()


def test_default_capacity_covers_every_car_of_an_episode():
    assert compile_scenario(ENV).capacity >= 9 + 1 + 1 + 13


def test_drivers_elsewhere_keep_their_parameters():
    before = IDMVehicle.DISTANCE_WANTED, IDMVehicle.COMFORT_ACC_MAX, IDMVehicle.COMFORT_ACC_MIN
    compile_scenario(ENV)
    assert before == (IDMVehicle.DISTANCE_WANTED, IDMVehicle.COMFORT_ACC_MAX, IDMVehicle.COMFORT_ACC_MIN)


@pytest.mark.parametrize(
    ("env_id", "config", "named"),
    [
        ("intersection-v1", None, "intersection-v1"),
        (ENV, {"controlled_vehicles": 2}, "controlled_vehicles"),
        (ENV, {"destination": "il2"}, "il2"),
        (ENV, {"other_vehicles_type": "rss_shield.envs.worlds.random_roads.Tailgater"}, "Tailgater"),
    ],
)
def test_an_unsupported_feature_is_named(env_id, config, named):
    with pytest.raises(Unsupported, match=named):
        compile_scenario(env_id, config)


def test_free_steering_under_a_shield_is_left_to_the_original():
    config = {"action": {"type": "ContinuousAction"}}
    with pytest.raises(Unsupported, match="ContinuousAction with a shield where roads cross; expected backend"):
        rss_shield.make_vec(ENV, 1, config=config)
    assert rss_shield.make_vec(ENV, 1, shield=None, config=config).num_envs == 1


@pytest.mark.parametrize(
    ("env_id", "seed", "options", "verdict", "duty"),
    [
        # trapped between a wreck ahead and cars that come: it stands
        (ENV, 1054, {"intent": "known", "config": {"duration": 30}}, "", ""),
        ("roundabout-v0", 3071, {"intent": "known"}, "", ""),
        # a car that has come backwards off its path sets off beside it
        (
            "intersection-v2",
            9898,
            {"intent": "any", "rules": {"anticipation": 0.0}},
            "other",
            "left every path it could take",
        ),
    ],
)
def test_no_contact_is_the_egos_fault_or_unexplained(env_id, seed, options, verdict, duty):
    batch = rss_shield.make_vec(env_id, 1, autoreset_mode=AutoresetMode.DISABLED, **options)
    batch.reset(seed=seed)
    faster, over = np.array([2 if env_id != "roundabout-v0" else 3]), False
    while not over:
        *_, terminated, truncated, infos = batch.step(faster)
        over = bool(terminated[0] or truncated[0])
    assert infos["blame"][0] == verdict
    assert infos["blame_evidence"]["other_duty"][0] == duty


def test_cars_that_come_and_go_keep_their_memory():
    """Indices move when cars leave; a shield that mixed them up would differ from the one on highway-env."""
    comparison = compare(ENV, range(3), "random", shield="override", config={"duration": 20, "spawn_probability": 1.0})
    assert comparison.discrete == []
    assert comparison.state < 1e-6
