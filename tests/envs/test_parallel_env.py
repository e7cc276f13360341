"""PettingZoo's parallel interface: its own checks, and what happens to an agent that is done."""

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from rss_shield.envs.highway.parallel import parallel_env

KINDS = ["intersection-multi-agent-v0", "intersection-multi-agent-v1", "intersection-multi-agent-v2"]
SLOWER, IDLE, FASTER = range(3)
AGENTS = {
    "controlled_vehicles": 3,
    "action": {"type": "MultiAgentAction", "action_config": {"type": "DiscreteMetaAction"}},
    "observation": {"type": "MultiAgentObservation", "observation_config": {"type": "Kinematics"}},
}
MOTORWAYS = [
    ("highway-fast-v0", {"vehicles_count": 12}),
    ("merge-v0", {}),
    ("exit-v0", {"controlled_vehicles": 4}),
    ("two-way-v0", {"controlled_vehicles": 2}),
]
LANE_LEFT, ON, LANE_RIGHT, FAST = range(4)

pytestmark = pytest.mark.filterwarnings("ignore:.*creation API has been deprecated.*:DeprecationWarning")


def all_do(env, action):
    return env.step(dict.fromkeys(env.agents, action))


@pytest.mark.parametrize("env_id", KINDS[:2])
@pytest.mark.filterwarnings("error::UserWarning")
def test_it_passes_the_check_of_the_interface(env_id):
    parallel_api_test(parallel_env(env_id, config={"duration": 3}), num_cycles=5)


def test_it_passes_the_check_of_seeds():
    parallel_seed_test(lambda: parallel_env(config={"duration": 3}), num_cycles=4)


def test_agents_are_named_and_have_their_own_spaces():
    env = parallel_env(config={"controlled_vehicles": 3})
    assert env.possible_agents == ["agent_0", "agent_1", "agent_2"]
    observations, infos = env.reset(seed=0)
    assert env.agents == env.possible_agents
    for agent in env.agents:
        assert env.action_space(agent).n == 3
        assert env.observation_space(agent).contains(observations[agent])
        assert infos[agent]["blame"] == ""


@pytest.mark.parametrize("env_id", KINDS[:2])
def test_rewards_are_the_agents_own_minus_their_own_penalty(env_id):
    env = parallel_env(env_id, intervention_penalty=0.5)
    env.reset(seed=0)
    overridden = 0.0
    for _ in range(4):
        _, rewards, _, _, infos = all_do(env, FASTER)
        for agent in env.agents:
            fraction = infos[agent]["shield"]["override_fraction"]
            assert rewards[agent] == pytest.approx(infos[agent]["raw_reward"] - 0.5 * fraction)
            overridden += fraction
    assert overridden > 0.0


def test_an_agent_that_has_crashed_leaves_and_the_others_go_on():
    env = parallel_env(shield="monitor", config={"controlled_vehicles": 4})
    for seed in range(10):
        env.reset(seed=seed)
        while len(env.agents) == 4:
            playing = list(env.agents)
            observations, rewards, terminations, truncations, infos = all_do(env, FASTER)
            for values in (observations, rewards, terminations, truncations, infos):
                assert list(values) == playing
        left = [agent for agent in playing if agent not in env.agents]
        assert all(terminations[agent] or truncations[agent] for agent in left)
        if env.agents and infos[left[0]]["blame"]:
            break
    else:
        pytest.fail("nobody crashed alone")
    vehicles = dict(zip(env.possible_agents, env.env.unwrapped.controlled_vehicles, strict=True))
    assert vehicles[left[0]].crashed
    rest = list(env.agents)
    observations, *_ = all_do(env, FASTER)
    assert list(observations) == rest
    assert vehicles[left[0]] in env.env.unwrapped.road.vehicles


def test_the_car_of_an_agent_that_is_done_gets_the_action_idle():
    env = parallel_env()
    env.reset(seed=0)
    env.agents = ["agent_1"]
    taken = []
    step = env.env.step
    env.env.step = lambda action: taken.append(action) or step(action)
    observations, *_ = env.step({"agent_1": FASTER})
    assert taken == [(IDLE, FASTER)]
    assert list(observations) == ["agent_1"]


def test_time_is_up_for_everybody_at_once():
    env = parallel_env(config={"duration": 2})
    env.reset(seed=0)
    all_do(env, SLOWER)
    *_, truncations, _ = all_do(env, SLOWER)
    assert truncations == {"agent_0": True, "agent_1": True}
    assert env.agents == []


def test_actions_are_asked_of_exactly_the_agents_that_are_there():
    env = parallel_env()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions for \['agent_0'\]: expected one for each of"):
        env.step({"agent_0": IDLE})


@pytest.mark.parametrize(
    ("env_id", "options", "message"),
    [
        ("intersection-v0", {}, "env_id = 'intersection-v0' with shield = 'override': expected several agents"),
        (KINDS[0], {"shield": None}, "with shield = None: expected several agents"),
        ("nowhere-v0", {}, "env_id = 'nowhere-v0'"),
        ("merge-v0", {"config": AGENTS | {"controlled_vehicles": 9}}, "controlled_vehicles = 9: expected at most 5"),
        (
            "highway-fast-v0",
            {
                "config": AGENTS
                | {"action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}}}
            },
            "ContinuousAction has no IDLE",
        ),
    ],
)
def test_bad_input_is_named(env_id, options, message):
    with pytest.raises(ValueError, match=message):
        parallel_env(env_id, **options)


def test_observations_are_those_of_each_agents_own_view():
    env = parallel_env()
    observations, _ = env.reset(seed=0)
    for agent, vehicle in zip(env.agents, env.env.unwrapped.controlled_vehicles, strict=True):
        x = float(observations[agent][0][1])
        assert x == pytest.approx(np.clip(vehicle.position[0] / 100, -1, 1), abs=1e-3)


@pytest.mark.parametrize(("env_id", "config"), MOTORWAYS)
@pytest.mark.filterwarnings("error::UserWarning")
def test_a_motorway_passes_the_check_of_the_interface(env_id, config):
    parallel_api_test(parallel_env(env_id, config=AGENTS | config | {"duration": 4}), num_cycles=6)


@pytest.mark.parametrize(("env_id", "config"), MOTORWAYS)
def test_on_a_motorway_each_agent_earns_what_it_would_as_the_only_one(env_id, config):
    """The first agent's reward is the environment's own; so is any other's, once it is the first."""
    env = parallel_env(env_id, shield="monitor", config=AGENTS | config)
    for agent in range(AGENTS["controlled_vehicles"] - 1):
        env.reset(seed=agent)
        base = env.env.unwrapped
        actions = dict(zip(env.agents, [LANE_LEFT, FAST, ON, LANE_RIGHT], strict=False))
        for _ in range(2):
            if len(env.agents) < len(env.possible_agents):
                break
            _, rewards, terminations, *_ = env.step(actions)
        chosen = env.possible_agents[agent]
        base.controlled_vehicles = [base.controlled_vehicles[agent]]
        assert rewards[chosen] == base._reward(actions[chosen])
        assert terminations[chosen] == base._is_terminated()


def test_on_a_motorway_an_agent_that_has_crashed_leaves_and_the_others_go_on():
    alone = 0
    for seed in range(6):
        env = parallel_env("highway-fast-v0", shield="monitor", config=AGENTS | {"vehicles_count": 20})
        env.reset(seed=seed)
        vehicles = dict(zip(env.possible_agents, env.env.unwrapped.controlled_vehicles, strict=True))
        while env.agents:
            playing = list(env.agents)
            *_, terminations, truncations, infos = all_do(env, FAST)
            for agent in playing:
                assert terminations[agent] == vehicles[agent].crashed
                assert (agent in env.agents) == (not vehicles[agent].crashed and not truncations[agent])
                assert not terminations[agent] or infos[agent]["blame"]
            alone += 0 < len(env.agents) < len(playing)
    assert alone >= 3


@pytest.mark.parametrize(("env_id", "config"), MOTORWAYS)
def test_shielded_agents_on_a_motorway_are_never_to_blame(env_id, config):
    env = parallel_env(env_id, config=AGENTS | config)
    changed = 0.0
    for seed in range(3):
        env.reset(seed=seed)
        while env.agents:
            *_, infos = all_do(env, FAST)
            assert all(info["blame"] in ("", "other", "inherited") for info in infos.values())
            assert all(info["episode_broken_duties"] == 0 for info in infos.values())
            changed += sum(info["shield"]["acceleration_change"] for info in infos.values())
    assert changed > 0.0
