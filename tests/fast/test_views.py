"""What agents see and do in the engine is what they see and do in highway-env, to the last bit."""

import os
import warnings

import numpy as np
import pytest
from lockstep import compare

import rss_shield
from rss_shield.envs.fast.config import Unsupported, compile_scenario

LONG = int(os.environ.get("PARITY_EPISODES", "2"))  # episodes per case
ROWS = ["presence", "x", "y", "vx", "vy", "cos_h", "sin_h", "cos_d", "sin_d", "long_off", "lat_off", "ang_off"]
KINEMATICS = {"type": "Kinematics", "features": ROWS, "vehicles_count": 7, "include_obstacles": False}
GRID = {
    "type": "OccupancyGrid",
    "features": ["presence", "on_road", "x", "vx", "vy", "cos_h", "sin_d", "lat_off", "unheard-of"],
    "features_range": {"x": [-90, 110], "y": [-30, 50], "vx": [-35, 35]},
    "grid_size": [[-30, 60], [-20, 20]],
    "grid_step": [4, 2.5],
}
SEEN = {
    "all features": KINEMATICS,
    "absolute, everybody, not scaled": {**KINEMATICS, "absolute": True, "see_behind": True, "normalize": False},
    "ranges given": {**KINEMATICS, "features_range": {"x": [-50, 80], "lat_off": [-3, 3]}, "clip": False},
    "where others are bound for": {**KINEMATICS, "observe_intentions": True},
    "shuffled": {"type": "Kinematics", "order": "shuffled", "vehicles_count": 4, "see_behind": True},
    "grid": {"type": "OccupancyGrid"},
    "grid with all options": GRID,
    "grid along the ego": {**GRID, "align_to_vehicle_axes": True, "clip": False},
    "grid as a picture": {"type": "OccupancyGrid", "as_image": True, "features": ["presence", "vx", "vy"]},
    "lidar": {"type": "LidarObservation"},
    "lidar in metres": {"type": "LidarObservation", "cells": 37, "maximum_range": 45, "normalize": False},
    "several": {
        "type": "TupleObservation",
        "observation_configs": [
            {"type": "Kinematics", "order": "shuffled"},
            {"type": "OccupancyGrid", "features": ["presence", "on_road"]},
            {"type": "TimeToCollision", "horizon": 7},
            {"type": "LidarObservation", "cells": 8},
        ],
    },
    "one agent of several": {"type": "MultiAgentObservation", "observation_config": {"type": "LidarObservation"}},
}
ROADS = ("highway-fast-v0", "merge-v0", "exit-v1", "roundabout-v0", "intersection-v0", "u-turn-v0")


def agree(env_id, policy="random", **options):
    """Both simulators play some episodes alike."""
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):  # a picture of nothing, in highway-env
        warnings.filterwarnings("ignore", "invalid value encountered in cast", RuntimeWarning)
        found = compare(env_id, range(LONG), policy, max_steps=40, **options)
    assert found.discrete == []
    assert found.equal == found.episodes == LONG


@pytest.mark.parametrize("env_id", ROADS)
@pytest.mark.parametrize("name", SEEN)
def test_observations_agree(env_id, name):
    agree(env_id, config={"observation": SEEN[name]})


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v1", "exit-v0", "roundabout-v1", "intersection-v0"])
def test_times_to_collision_agree_on_every_road(env_id):
    agree(env_id, config={"observation": {"type": "TimeToCollision", "horizon": 9}})


@pytest.mark.parametrize("kind", ["DiscreteAction", "ContinuousAction"])
@pytest.mark.parametrize("axis", ["longitudinal", "lateral"])
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-v0", "exit-v0", "roundabout-v0", "intersection-v0"])
def test_actions_on_one_axis_agree(env_id, kind, axis):
    both = {"longitudinal": axis == "longitudinal", "lateral": axis == "lateral"}
    seen = {"type": "Kinematics"}
    agree(env_id, config={"observation": seen, "action": {"type": kind, **both}})


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "merge-generic-v0", "exit-v0", "roundabout-v0", "u-turn-v0"])
@pytest.mark.parametrize("policy", ["random", "faster"])
def test_discrete_actions_agree(env_id, policy):
    agree(env_id, policy, config={"observation": {"type": "Kinematics"}, "action": {"type": "DiscreteAction"}})


@pytest.mark.parametrize("longitudinal", [True, False])
def test_meta_actions_on_one_axis_agree(longitudinal):
    kind = {"type": "DiscreteMetaAction", "longitudinal": longitudinal, "lateral": not longitudinal}
    agree("highway-fast-v0", config={"action": kind}, shield="override")


@pytest.mark.parametrize("shield", ["override", "monitor"])
def test_a_shield_on_discrete_actions_agrees(shield):
    agree("highway-fast-v0", "random", config={"action": {"type": "DiscreteAction"}}, shield=shield)


def test_a_merge_of_any_shape_agrees():
    sections = {"before_merge_length": 100, "converge_merge_length": 60, "parallel_merge_length": 90}
    for lanes in (1, 3):
        agree("merge-generic-v0", config={"lanes_count": lanes, "vehicles_count": 12, **sections})


@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
@pytest.mark.parametrize("observation", [SEEN["several"], SEEN["grid as a picture"]], ids=["several", "picture"])
def test_the_vector_environment_returns_them_in_their_spaces(mode, observation):
    """Both backends, through the ends of episodes: the last observation of one and the first of the next."""
    config = {"observation": observation, "duration": 3}
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.filterwarnings("ignore", "invalid value encountered in cast", RuntimeWarning)
        fast, stock = (
            rss_shield.make_vec("highway-fast-v0", 3, None, backend, config=config, autoreset_mode=mode)
            for backend in ("fast", "highway-env")
        )
        assert fast.observation_space == stock.observation_space
        _same(fast.reset(seed=5)[0], stock.reset(seed=5)[0])
        fast.action_space.seed(0)
        for _ in range(9):
            actions = fast.action_space.sample()
            (ours, *mine), (theirs, *its) = fast.step(actions), stock.step(actions)
            ended = mine[1] | mine[2]
            _same(ours, theirs)
            assert np.array_equal(mine[0], its[0])
            if mode == "SameStep" and ended.any():
                _same_finals(mine[3]["final_obs"], its[3]["final_obs"], ended)
            if mode == "Disabled" and ended.any():
                options = {"reset_mask": ended}
                _same(fast.reset(options=dict(options))[0], stock.reset(options=dict(options))[0])


def _same(ours, theirs):
    for a, b in zip(*((x if isinstance(x, tuple) else (x,)) for x in (ours, theirs)), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)


def _same_finals(ours, theirs, ended):
    for e in np.flatnonzero(ended):
        one = tuple(part[e] for part in ours) if isinstance(ours, tuple) else ours[e]
        _same(one, theirs[e])


@pytest.mark.parametrize(
    ("env_id", "config", "named"),
    [
        ("highway-fast-v0", {"observation": {"type": "GrayscaleObservation", "observation_shape": (8, 8),
                                             "stack_size": 2, "weights": [0.3, 0.6, 0.1], "scaling": 2}}, "Grayscale"),
        ("merge-v0", {"observation": {**KINEMATICS, "include_obstacles": True}}, "'long_off' of obstacles"),
        ("highway-fast-v0", {"observation": {"type": "TimeToCollision"}, "action": {"type": "DiscreteAction"}},
         "TimeToCollision with DiscreteAction"),
        ("merge-v0", {"action": {"type": "ContinuousAction"}}, "ContinuousAction in merge-v0"),
        ("two-way-v0", {"action": {"type": "DiscreteAction"}}, "DiscreteAction in two-way-v0"),
    ],
)  # fmt: skip
def test_what_the_engine_does_not_have_is_named(env_id, config, named):
    with pytest.raises(Unsupported, match=named):
        compile_scenario(env_id, config)
