"""What `make` adds to highway-env: ends, frequencies, agents, and traffic that other environments leave alone."""

import copy
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield import MultiAgentShield, ShieldWrapper, make, make_vec
from rss_shield.envs.highway.drivers import RecklessVehicle
from rss_shield.envs.stock import AT_INTERSECTIONS, ELSEWHERE, drivers_unchanged

pytestmark = pytest.mark.filterwarnings("ignore:.*out of date.*")
IDLE = 1
AGENTS = {
    "action": {"type": "MultiAgentAction", "action_config": {"type": "DiscreteMetaAction"}},
    "observation": {"type": "MultiAgentObservation", "observation_config": {"type": "Kinematics"}},
}
RECKLESS = "rss_shield.envs.highway.drivers.RecklessVehicle"


def roll(env, seed, steps=8):
    observations = [env.reset(seed=seed)[0]]
    for _ in range(steps):
        observation, _, terminated, truncated, _ = env.step(IDLE)
        observations.append(observation)
        if terminated or truncated:
            break
    return observations


def bare(env_id, seed, **options):
    """In a process that no intersection has touched."""
    with drivers_unchanged(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return roll(gym.make(env_id, **options), seed)


def equal(a, b):
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


# ---------------------------------------------------------------- traffic


@pytest.mark.parametrize(
    "disturb",
    [
        lambda: make("intersection-v0"),
        lambda: make("intersection-multi-agent-v1").reset(seed=3),
        lambda: make("signalised-intersection-v0", shield=None).reset(seed=3),
        lambda: make_vec("intersection-v2", 2, backend="highway-env").reset(seed=3),
        lambda: make_vec("intersection-v0", 2).reset(seed=3),
        lambda: gym.make("intersection-v0"),
    ],
)
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "exit-v0", "u-turn-v0"])
def test_an_intersection_leaves_the_traffic_of_others_alone(env_id, disturb):
    expected = bare(env_id, 5)
    env = make(env_id, shield="monitor")
    env.reset(seed=1)
    disturb()
    assert equal(roll(env, 5), expected)
    assert equal(roll(make(env_id, shield="monitor"), 5), expected)


def test_what_intersections_write_is_what_the_constants_say():
    assert {name: getattr(IDMVehicle, name) for name in ELSEWHERE} == ELSEWHERE
    gym.make("intersection-v0")
    assert {name: getattr(IDMVehicle, name) for name in AT_INTERSECTIONS} == AT_INTERSECTIONS


@pytest.mark.parametrize("env_id", ["intersection-v0", "intersection-v2", "signalised-intersection-v0"])
def test_an_intersection_keeps_its_own_traffic(env_id):
    for seed in (0, 8):
        expected = bare(env_id, seed)
        assert equal(roll(make(env_id, shield="monitor"), seed), expected)
        env = make(env_id, shield="monitor")
        env.reset(seed=seed)
        make("highway-fast-v0").reset(seed=0)
        for clone in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
            assert equal([clone.step(IDLE)[0] for _ in expected[1:]], expected[1:])
    assert {name: getattr(IDMVehicle, name) for name in ELSEWHERE} == ELSEWHERE


def test_other_classes_of_drivers_are_left_as_they_are():
    config = {"other_vehicles_type": RECKLESS}
    env = make("intersection-v0", config=config)
    env.reset(seed=0)
    assert not set(ELSEWHERE) & set(vars(RecklessVehicle))
    reckless = [v for v in env.unwrapped.road.vehicles if isinstance(v, RecklessVehicle)]
    assert {v.DISTANCE_WANTED for v in reckless} == {7.0}
    assert equal(
        roll(make("highway-fast-v0", shield="monitor", config=config), 2), bare("highway-fast-v0", 2, config=config)
    )


def test_drivers_that_a_user_has_changed_stay_changed_on_both_backends():
    with drivers_unchanged():
        IDMVehicle.COMFORT_ACC_MAX = 1.5
        starts = []
        for backend in ("fast", "highway-env"):
            env = make_vec("highway-fast-v0", 1, shield="monitor", backend=backend)
            env.reset(seed=4)
            starts.append([env.step(np.array([IDLE]))[0] for _ in range(6)])
    assert equal(*starts)
    assert not equal(starts[1], bare("highway-fast-v0", 4)[1:7])


def test_drivers_in_a_planners_copy_are_those_of_the_intersection():
    base = make("intersection-v0").unwrapped
    changed = base.change_vehicles("highway_env.vehicle.behavior.IDMVehicle")
    others = [v for v in changed.road.vehicles if v is not changed.vehicle]
    assert others
    assert {v.COMFORT_ACC_MIN for v in others} == {-3}


# ---------------------------------------------------------------- ends


def length_of(env, action, most=300):
    env.reset(seed=3)
    for n in range(1, most):
        *_, terminated, truncated, _ = env.step(action)
        if np.any(terminated) or np.any(truncated):
            return n
    return None


@pytest.mark.parametrize(
    ("env_id", "config"),
    [
        ("merge-v0", {"duration": 3}),
        ("merge-v0", {"duration": 7, "policy_frequency": 3}),
        ("merge-v1", {"duration": 40, "policy_frequency": 5}),
        ("merge-v0", {"policy_frequency": 15}),
        ("merge-v1", {}),
        ("two-way-v0", {"duration": 6}),
        ("two-way-v0", {"duration": 60}),
        ("two-way-v0", {"policy_frequency": 3}),
        ("exit-v0", {"duration": 4, "policy_frequency": 5}),
        ("roundabout-v0", {"duration": 4, "policy_frequency": 3}),
    ],
)
def test_episodes_end_alike_on_both_backends(env_id, config):
    slow = {"action": {"type": "DiscreteMetaAction", "target_speeds": [0, 1, 2]}}
    lengths = [
        length_of(make_vec(env_id, 1, shield="monitor", backend=backend, config=config | slow), np.array([4]))
        for backend in ("fast", "highway-env")
    ]
    assert lengths[0] == lengths[1] is not None


@pytest.mark.parametrize(
    ("config", "length"),
    [
        ({}, 100),
        ({"duration": 30}, 30),
        ({"duration": 30, "policy_frequency": 2}, 60),
        ({"duration": 30, "policy_frequency": 5}, 100),
    ],
)
@pytest.mark.parametrize("env_id", ["merge-v1", "merge-generic-v0"])
def test_a_merge_ends_after_its_duration_or_a_hundred_decisions(env_id, config, length):
    still = {"action": {"type": "DiscreteMetaAction", "target_speeds": [0, 1]}}
    assert length_of(make(env_id, shield=None, config=config | still), 4) == length


def test_a_duration_given_at_reset_counts():
    env = make("merge-v0", shield="monitor")
    env.reset(seed=0, options={"config": {"duration": 4}})
    ends = [env.step(IDLE)[3] for _ in range(4)]
    assert ends == [False, False, False, True]


# ---------------------------------------------------------------- frequencies


@pytest.mark.parametrize(
    ("simulation", "policy"),
    [(15, 30), (5, 6), (10, 10.5), (0.25, 0.5), (15, 0), (15, -1), (0, 0), (15, float("nan")), (1e9, 1)],
)
def test_more_decisions_than_frames_are_refused_wherever_they_enter(simulation, policy):
    bad = {"simulation_frequency": simulation, "policy_frequency": policy}
    several = AGENTS | {"controlled_vehicles": 2}
    for build in (
        lambda: make("highway-fast-v0", config=bad),
        lambda: make("merge-v0", shield=None, config=bad),
        lambda: make("highway-fast-v0", shield="monitor", config=bad | several),
        lambda: make_vec("highway-fast-v0", 1, config=bad),
        lambda: make_vec("exit-v0", 2, backend="highway-env", shield=None, config=bad),
        lambda: ShieldWrapper(gym.make("highway-fast-v0", config=bad)),
        lambda: MultiAgentShield(gym.make("highway-fast-v0", config=bad | several)),
        lambda: make("roundabout-v0").reset(options={"config": bad}),
        lambda: make("highway-fast-v0", config=several).reset(options={"config": bad}),
        lambda: make("highway-fast-v0", shield=None).reset(options={"config": bad}),
    ):
        with pytest.raises(ValueError, match=r"(policy|simulation)_frequency = .*: expected"):
            build()


def test_a_refused_reset_leaves_the_environment_as_it_was():
    env = make("exit-v0")
    with pytest.raises(ValueError, match="policy_frequency = 16 with simulation_frequency = 5"):
        env.reset(options={"config": {"policy_frequency": 16}})
    env.reset(seed=0)
    assert env.step(IDLE)[4]["time"] == 1.0


def test_frequencies_that_are_configured_by_hand_are_checked_at_reset_and_at_every_step():
    for build in (lambda: make("highway-fast-v0"), lambda: ShieldWrapper(gym.make("merge-v0"))):
        env = build()
        env.reset(seed=0)
        env.unwrapped.configure({"policy_frequency": 20})
        with pytest.raises(ValueError, match="policy_frequency = 20"):
            env.step(IDLE)
        with pytest.raises(ValueError, match="policy_frequency = 20"):
            env.reset()


def test_as_many_decisions_as_frames_are_accepted():
    for env_id in ("highway-fast-v0", "two-way-v0"):
        env = make(env_id, config={"simulation_frequency": 10, "policy_frequency": 10})
        env.reset(seed=0)
        x = env.unwrapped.vehicle.position[0]
        env.step(IDLE)
        assert env.unwrapped.vehicle.position[0] > x + 1.0


# ---------------------------------------------------------------- agents


@pytest.mark.parametrize(("env_id", "count"), [("merge-v0", 2), ("merge-v1", 5), ("two-way-v0", 4), ("exit-v0", 3)])
def test_there_are_as_many_agents_as_asked_for(env_id, count):
    env = make(env_id, config=AGENTS | {"controlled_vehicles": count})
    env.reset(seed=0)
    base = env.unwrapped
    assert len(base.controlled_vehicles) == len(env.action_space) == count
    assert all(vehicle in base.road.vehicles for vehicle in base.controlled_vehicles)
    *_, info = env.step((IDLE,) * count)
    assert len(info["agents"]) == count


def test_more_agents_than_cars_are_refused():
    with pytest.raises(ValueError, match="controlled_vehicles = 6: expected at most 5"):
        make("merge-v0", config=AGENTS | {"controlled_vehicles": 6})


def test_a_road_without_a_version_is_made_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make("highway-fast").close()
