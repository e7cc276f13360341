"""MultiAgentShield: several egos on one road, each with its own shield and its own view of blame."""

import copy

import gymnasium as gym
import numpy as np
import pytest

from rss_shield import MultiAgentShield, ShieldWrapper, make

KINDS = ["intersection-multi-agent-v0", "intersection-multi-agent-v1", "intersection-multi-agent-v2"]
SLOWER, IDLE, FASTER = range(3)

pytestmark = pytest.mark.filterwarnings("ignore:.*out of date.*")


def play(env, seed, steps=13, action=FASTER):
    """Infos of one episode in which every agent always does the same."""
    _, info = env.reset(seed=seed)
    infos = [info]
    agents = len(info["agents"])
    for _ in range(steps):
        *_, terminated, truncated, info = env.step((action,) * agents)
        infos.append(info)
        if truncated or np.any(terminated):
            break
    return infos


@pytest.mark.parametrize("env_id", KINDS)
def test_make_gives_every_agent_a_shield(env_id):
    env = make(env_id)
    assert isinstance(env, MultiAgentShield)
    infos = play(env, 0, steps=2)
    one = make("intersection-v0")
    for info, keys in ((infos[0], one.reset(seed=0)[1]), (infos[1], one.step(FASTER)[4])):
        assert len(info["agents"]) == 2
        for agent in info["agents"]:
            assert set(agent) == set(keys) - {"speed", "crashed", "action", "rewards", "raw_reward"} - {
                "agents_rewards",
                "agents_terminated",
                "is_success",
                "time",
            }
            assert set(agent["shield"]) == set(keys["shield"])
    assert all("act" in vars(vehicle) for vehicle in env.unwrapped.controlled_vehicles)


@pytest.mark.parametrize("env_id", KINDS[:2])
def test_monitoring_leaves_tuples_and_trajectories_as_they_are(env_id):
    bare, monitored = make(env_id, shield=None), make(env_id, shield="monitor", intent="known")
    expected, _ = bare.reset(seed=1)
    observed, _ = monitored.reset(seed=1)
    np.testing.assert_array_equal(expected, observed)
    for _ in range(6):
        expected, *outcome, _ = bare.step((FASTER, IDLE))
        observed, *outcome_monitored, info = monitored.step((FASTER, IDLE))
        np.testing.assert_array_equal(expected, observed)
        assert outcome == outcome_monitored
        assert info["raw_reward"] == outcome[0]
        assert [agent["shield"]["proposed_action"] for agent in info["agents"]] == [FASTER, IDLE]


def test_shielded_agents_keep_every_duty_and_are_never_to_blame():
    env = make("intersection-multi-agent-v1", config={"controlled_vehicles": 4})
    overridden = 0.0
    for seed in range(6):
        for agent in play(env, seed)[-1]["agents"]:
            assert agent["blame"] in ("", "other", "inherited"), (seed, agent["blame_evidence"])
            overridden += agent["override_share"]
    assert overridden > 1.0, "too tame to show anything"


def test_without_the_shield_the_same_agents_touch_each_other_or_somebody():
    env = make("intersection-multi-agent-v1", shield="monitor", config={"controlled_vehicles": 4})
    verdicts = [agent["blame"] for seed in range(6) for agent in play(env, seed)[-1]["agents"]]
    assert sum(map(bool, verdicts)) >= 4
    assert "ego" in verdicts or "both" in verdicts


def test_the_penalty_of_each_agent_is_its_own():
    env = make("intersection-multi-agent-v1", intervention_penalty=0.5)
    env.reset(seed=0)
    overridden = 0.0
    for _ in range(6):
        _, rewards, _, _, info = env.step((FASTER, FASTER))
        fractions = [agent["shield"]["override_fraction"] for agent in info["agents"]]
        assert rewards == pytest.approx([r - 0.5 * f for r, f in zip(info["raw_reward"], fractions, strict=True)])
        overridden += sum(fractions)
    assert overridden > 0.0


def test_the_penalty_on_one_reward_for_all_is_the_mean():
    env = make("intersection-multi-agent-v0", intervention_penalty=0.5)
    env.reset(seed=0)
    for _ in range(6):
        _, reward, _, _, info = env.step((FASTER, FASTER))
        mean = np.mean([agent["shield"]["override_fraction"] for agent in info["agents"]])
        assert reward == pytest.approx(info["raw_reward"] - 0.5 * mean)


def test_each_agent_is_a_road_user_to_the_other():
    env = make("intersection-multi-agent-v1", record=True)
    env.reset(seed=0)
    start = [tuple(vehicle.position) for vehicle in env.unwrapped.controlled_vehicles]
    others = len(env.unwrapped.road.vehicles) - 1
    env.step((FASTER, FASTER))
    for frames, ego, other in zip(env.frames, start, reversed(start), strict=True):
        assert len(frames) == 15
        assert len(frames[0].keys) == others
        poses = [tuple(pose[:2]) for pose in frames[0].poses]
        assert poses[-1] == ego
        assert other in poses[:-1]


def test_an_episode_repeats_with_its_seed_and_a_copy_carries_its_shields_along():
    env = make("intersection-multi-agent-v1")
    traces = [[agent["override_share"] for info in play(env, 2, 8) for agent in info["agents"]] for _ in range(2)]
    assert traces[0] == traces[1]
    env.reset(seed=2)
    env.step((FASTER, FASTER))
    twin = copy.deepcopy(env)
    shares = [
        [a["override_share"] for a in one.step((FASTER, FASTER))[4]["agents"]] for one in (env, twin) for _ in range(4)
    ]
    assert shares[:4] == shares[4:]


def test_frames_and_audits_must_be_asked_for():
    env = make("intersection-multi-agent-v0")
    with pytest.raises(ValueError, match="record = False: expected True"):
        env.audit()


def test_several_agents_on_a_highway_work_alike():
    config = {
        "controlled_vehicles": 2,
        "action": {"type": "MultiAgentAction", "action_config": {"type": "DiscreteMetaAction"}},
        "observation": {"type": "MultiAgentObservation", "observation_config": {"type": "Kinematics"}},
    }
    env = make("highway-fast-v0", config=config, record=True)
    infos = play(env, 0, steps=4, action=3)
    assert all(agent["blame"] == "" for agent in infos[-1]["agents"])
    assert any(agent["shield"]["intervened"] for info in infos for agent in info["agents"])
    assert len(env.audit()) == 2


FREELY = {"action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}}}


def test_agents_that_steer_themselves_keep_to_a_route_each():
    env = make(KINDS[0], config=FREELY | {"destination": "o3"})
    infos = play(env, 0, steps=6, action=np.array([1.0, -1.0]))
    assert [ego.route[0][0] for ego in env._egos] == ["o0", "o1"]
    assert all(agent["blame"] == "" and not agent["episode_broken_duties"] for agent in infos[-1]["agents"])
    assert all(agent["shield"]["steering_change"] > 0.0 for agent in infos[2]["agents"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"env_id": KINDS[0], "shield": "mask"}, "shield = 'mask'"),
        ({"env_id": KINDS[0], "traffic": "polite"}, "traffic = 'polite': expected one of stock, compliant"),
        ({"env_id": KINDS[0], "intervention_penalty": -1.0}, "intervention_penalty = -1.0"),
        ({"env_id": KINDS[0], "entry": "bold"}, "entry = 'bold'"),
        (
            {"env_id": KINDS[0], "config": FREELY | {"destination": "o1"}},
            "destination = 'o1': expected a node that a car from 'o1' can drive to",
        ),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        make(**arguments)


def test_the_wrong_wrapper_is_refused():
    with pytest.raises(ValueError, match="expected MultiAgentShield"):
        ShieldWrapper(gym.make(KINDS[0]))
    with pytest.raises(ValueError, match="is for one agent; expected MultiAgentAction"):
        MultiAgentShield(gym.make("intersection-v0"))
