"""Several agents at an intersection: in the engine as on highway-env, to the last bit."""

import numpy as np
import pytest
from lockstep import compare

import rss_shield
from rss_shield.envs.fast.config import Unsupported

ENV = "intersection-multi-agent-v0"
APART = "intersection-multi-agent-v1"  # each agent has a reward of its own
FOUR = {"controlled_vehicles": 4, "destination": None, "initial_vehicle_count": 14, "spawn_probability": 1.0}
FREELY = {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}}
SLOWER, IDLE, FASTER = range(3)

pytestmark = pytest.mark.filterwarnings("ignore:.*out of date.*")


@pytest.mark.parametrize(
    ("env_id", "shield", "policy", "config", "options"),
    [
        (ENV, "override", "random", FOUR, {}),
        (APART, "monitor", "faster", None, {"intent": "known"}),
        (ENV, None, "random", {"action": FREELY, "observation": {"type": "Kinematics", "order": "shuffled"}}, {}),
    ],
)
def test_episodes_agree_to_the_last_bit(env_id, shield, policy, config, options):
    found = compare(env_id, range(2), policy, config=config, shield=shield, **options)
    assert found.discrete == []
    assert found.equal == found.episodes == 2


def played(env, actions, steps=14):
    """Everything that a batch returns over some decisions."""
    seen = [env.reset(seed=3)]
    seen += [env.step(actions) for _ in range(steps)]
    env.close()
    return seen


def test_both_backends_return_the_same_spaces_infos_and_numbers():
    config = {"duration": 4}  # so that episodes end
    envs = [rss_shield.make_vec(ENV, 2, backend=backend, config=config) for backend in ("fast", "highway-env")]
    assert envs[0].observation_space == envs[1].observation_space
    assert envs[0].action_space == envs[1].action_space
    fast, stock = (played(env, (np.array([FASTER, IDLE]), np.array([FASTER, FASTER])), 6) for env in envs)
    ended = 0
    for ours, theirs in zip(fast[1:], stock[1:], strict=True):
        assert len(ours[0]) == 2
        for one, other in zip(ours[0], theirs[0], strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(ours[1:4], theirs[1:4], strict=True):
            np.testing.assert_array_equal(one, other)
        ended += (ours[2] | ours[3]).sum()
        for one, other in zip(ours[4]["agents"], theirs[4]["agents"], strict=True):
            assert set(one) - {"_blame_evidence"} == set(other) - {"_blame_evidence"}
            assert set(one["shield"]) == set(other["shield"])
            for name in ("override_share", "episode_dangerous_pairs", "min_ttc"):
                np.testing.assert_array_equal(one[name], other[name])
    assert ended >= 2


def test_each_agent_pays_for_its_own_interventions():
    env = rss_shield.make_vec(APART, 8, intervention_penalty=0.5)
    env.reset(seed=0)
    paid = 0.0
    for _ in range(6):
        _, rewards, *_, infos = env.step((np.full(8, FASTER), np.full(8, FASTER)))
        decided = infos["_raw_reward"]
        raw = np.array([*infos["raw_reward"][decided]])
        fractions = np.stack([agent["shield"]["override_fraction"] for agent in infos["agents"]], axis=1)[decided]
        assert rewards.shape == (8, 2)
        np.testing.assert_array_equal(rewards[decided], raw - 0.5 * fractions)
        paid += fractions.sum()
    assert paid > 0.0


def test_one_reward_for_all_is_the_mean_of_the_agents():
    env = rss_shield.make_vec(ENV, 8, shield=None)
    env.reset(seed=0)
    for _ in range(5):
        _, rewards, *_, infos = env.step((np.full(8, FASTER), np.full(8, SLOWER)))
        assert rewards == pytest.approx(np.mean([*infos["agents_rewards"]], axis=1))


def test_results_do_not_depend_on_threads():
    actions = np.full(24, FASTER), np.full(24, IDLE)
    one, two = (played(rss_shield.make_vec(ENV, 24, threads=threads), actions, 5) for threads in (1, 2))
    for a, b in zip(one[1:], two[1:], strict=True):
        np.testing.assert_array_equal(a[1], b[1])
        np.testing.assert_array_equal(a[0][1], b[0][1])
        np.testing.assert_array_equal(a[4]["agents"][1]["override_share"], b[4]["agents"][1]["override_share"])


def test_a_picture_is_the_one_that_highway_env_draws():
    fast = rss_shield.make_vec(ENV, 1, shield=None, render_mode="rgb_array")
    stock = rss_shield.make(ENV, shield=None, render_mode="rgb_array")
    fast.reset(seed=6)
    stock.reset(seed=6)
    for _ in range(2):
        fast.step((np.array([FASTER]), np.array([IDLE])))
        stock.step((FASTER, IDLE))
    np.testing.assert_array_equal(fast.picture(0), stock.render())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"semantic_actions": True}, "semantic_actions of several agents"),
        ({"replace": "decision"}, "replace = 'decision': expected 'frame' for several agents"),
        ({"config": {"action": FREELY}}, "ContinuousAction with a shield where roads cross"),
        ({"config": {"other_vehicles_type": "rss_shield.envs.highway.hostile.Tailgater"}}, "with several agents"),
        ({"env_id": APART, "backend": "highway-env"}, "each agent has a reward of its own"),
    ],
)
def test_what_there_is_not_is_named(options, message):
    with pytest.raises((Unsupported, ValueError), match=message):
        rss_shield.make_vec(**({"env_id": ENV, "num_envs": 1} | options))


def test_bad_actions_are_named():
    env = rss_shield.make_vec(ENV, 3)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="a tuple with those of each of 2 agents"):
        env.step((np.ones(3, int),))
    with pytest.raises(ValueError, match="expected integers from 0 to 2"):
        env.step((np.ones(3, int), np.full(3, 7)))
    with pytest.raises(ValueError, match="expected DiscreteMetaAction, not MultiAgentAction"):
        env.action_masks()
