"""How episodes are begun, and what has to come before: options of a reset, steps without one, copies, action spaces."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import ClipAction, TransformAction

from rss_shield import ShieldWrapper, make, make_vec

ENV, AGENTS = "highway-fast-v0", "intersection-multi-agent-v0"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([1], r"options = \[1\]: expected a dict"),
        (5, "options = 5: expected a dict"),
        ({"config": [1]}, r"config = \[1\]: expected keys with values"),
        ({"config": {"lanes_count": "four"}}, "config.lanes_count = 'four': expected a whole number >= 1"),
        ({"config": {"policy_frequency": 50}}, "policy_frequency = 50 with simulation_frequency = 5: expected"),
    ],
)
def test_a_reset_takes_what_making_takes(options, message):
    for env in (make(ENV), ShieldWrapper(gym.make(ENV)), make_vec(ENV, 1, backend="highway-env")):
        with pytest.raises(ValueError, match=message):
            env.reset(seed=0, options=options)
    if isinstance(options, dict):  # compiled code is for one configuration
        message = "config = .* at a reset; expected it as an argument of make_vec"
    with pytest.raises(ValueError, match=message):
        make_vec(ENV, 1).reset(seed=0, options=options)


def test_a_bare_environment_takes_the_same_configurations():
    env = make(ENV, shield=None)
    with pytest.raises(ValueError, match=r"config\.lanes_count = 0: expected a whole number >= 1"):
        env.reset(options={"config": {"lanes_count": 0}})
    with pytest.warns(UserWarning, match=r"the nearest is config\.lanes_count, and it is ignored"):
        env.reset(options={"config": {"lane_count": 4}})
    env.reset(options={"config": {"lanes_count": 2}})
    assert len(env.unwrapped.road.network.lanes_list()) == 2


def test_options_of_other_wrappers_are_theirs():
    make(ENV).reset(seed=0, options={"somebody": "else", "config": {"lanes_count": 2}})
    make(AGENTS).reset(seed=0, options={"somebody": "else"})
    with pytest.raises(ValueError, match=r"options = \[1\]: expected a dict"):
        make(AGENTS).reset(options=[1])


@pytest.mark.parametrize("mask", ["a", [True], [2.5, 1]])
def test_a_mask_has_a_truth_value_for_each_environment(mask):
    with pytest.raises(ValueError, match=r"reset_mask = .*: expected 2 truth values"):
        make_vec(ENV, 2).reset(options={"reset_mask": mask})


@pytest.mark.parametrize("semantic", [False, True])
@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_nobody_steps_before_a_reset(backend, semantic):
    env = make_vec(ENV, 2, backend=backend, semantic_actions=semantic)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2, int))


def test_everybody_has_to_be_reset_once():
    env = make_vec(ENV, 2)
    with pytest.raises(ResetNeeded, match="action_masks before reset"):
        env.action_masks()
    env.reset(seed=0, options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded, match="expected reset\\(\\) first, in every environment"):
        env.step([3, 3])
    env.reset(options={"reset_mask": np.array([False, True])})
    env.step([3, 3])


@pytest.mark.parametrize("threads", [1, 2])
def test_an_engine_can_be_copied_but_not_pickled(threads):
    env = make_vec(ENV, 2, threads=threads)
    for _ in range(2):
        with pytest.raises(TypeError, match=r"an engine cannot be pickled.*expected copy\.deepcopy .* or make_vec"):
            pickle.dumps(env)
        env.reset(seed=0)
    twin = copy.deepcopy(env)
    for actions in ([3, 3], [4, 0]):
        np.testing.assert_array_equal(twin.step(actions)[0], env.step(actions)[0])
    env.close()
    twin.step([1, 1])
    twin.close()


def test_the_shield_knows_the_actions_of_the_environment_only():
    fewer = TransformAction(gym.make(ENV), lambda action: 3 * action, gym.spaces.Discrete(2))
    with pytest.raises(ValueError, match=r"action_space = Discrete\(2\): expected Discrete\(5\), that of High"):
        ShieldWrapper(fewer)
    around = TransformAction(make(ENV), lambda action: 3 * action, gym.spaces.Discrete(2))
    around.reset(seed=0)
    around.step(1)
    ShieldWrapper(ClipAction(gym.make(ENV, config={"action": {"type": "ContinuousAction"}})))


def test_roads_drawn_at_random_are_there_by_name():
    env = make("random-roads-v0")
    env.reset(seed=0)
    assert env.step(1)[4]["blame"] == ""
