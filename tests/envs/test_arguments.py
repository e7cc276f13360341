"""What users hand over: forms that mean the same do the same, and what is wrong is named where it enters."""

import json
import math

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import FlattenObservation, NormalizeObservation
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor

from rss_shield import PRESETS, Rules, ShieldWrapper, make, make_vec
from rss_shield.envs.fast.config import Unsupported
from rss_shield.envs.highway.parallel import parallel_env

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
SLIDES = PRESETS["slides"]
AGENTS = "intersection-multi-agent-v0"


# ---------------------------------------------------------------- the published table


def _settings(env_id, where, **arguments):
    """Settings of an environment, however it is made."""
    if where == "make_vec":
        return make_vec(env_id, 1, **arguments).settings
    if where == "the original in make_vec":
        return make_vec(env_id, 1, backend="highway-env", **arguments).envs[0].get_wrapper_attr("settings")
    if where == "ShieldWrapper":
        return ShieldWrapper(gym.make(env_id), **arguments).settings
    return make(env_id, **arguments).settings


FORMS = {
    "its name": "slides",
    "a pair": (SLIDES.ego, SLIDES.other),
    "a list": [SLIDES.ego, SLIDES.other],
    "two dicts": {"ego": SLIDES.ego._asdict(), "other": SLIDES.other._asdict()},
    "a dict and a table": {"ego": SLIDES.ego, "other": SLIDES.other._asdict()},
    "numbers of numpy": tuple({k: np.float64(v) for k, v in side._asdict().items()} for side in SLIDES[:2]),
}


@pytest.mark.parametrize("where", ["make", "make_vec", "the original in make_vec", "ShieldWrapper"])
@pytest.mark.parametrize("form", FORMS)
def test_a_table_may_be_given_in_many_forms(where, form):
    assert _settings("highway-fast-v0", where, params=FORMS[form]) == _settings("highway-fast-v0", where, params=SLIDES)


@pytest.mark.parametrize("form", FORMS)
def test_agents_take_the_same_forms(form):
    assert make(AGENTS, params=FORMS[form]).settings == make(AGENTS, params=SLIDES).settings
    assert parallel_env(AGENTS, params=FORMS[form]).env.settings == make(AGENTS, params=SLIDES).settings


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0"])
def test_the_values_of_a_preset_are_the_preset_also_at_five_frames_a_second(env_id, name):
    preset = PRESETS[name]
    for same in (tuple(preset[:2]), {"ego": preset.ego._asdict(), "other": preset.other._asdict()}):
        config = {"simulation_frequency": 5}
        given, named = (make(env_id, params=params, config=config) for params in (same, name))
        assert given.settings == named.settings
        assert given.params._replace(source=preset.source) == preset  # of two presets with the same values, the first


def test_what_a_dict_leaves_out_is_that_of_the_environment():
    env = make("intersection-v0", params={"ego": {"a_max_brake": 7.0}, "other": {"response_time": 0.6}})
    default = PRESETS["intersection"]
    assert env.params.ego == default.ego._replace(a_max_brake=7.0)
    assert env.params.other == default.other._replace(response_time=0.6)
    assert make("highway-v0", params={"mu": 0.3}).params[:2] == tuple(
        side._replace(mu=0.3) for side in PRESETS["simulator"][:2]
    )


def test_a_response_time_that_was_asked_for_is_not_raised_silently():
    with pytest.raises(ValueError, match=r"response_time = 0\.1 s .* expected >= 0\.2 s"):
        make("highway-fast-v0", params={"ego": {"response_time": 0.1}})
    assert make("highway-fast-v0", params={"ego": {"a_max_accel": 2.0}}).settings.table.ego.response_time == 0.2


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("slide", r"params = 'slide': expected one of simulator, intersection, parking, slides"),
        (7.5, r"params = 7.5: expected a Preset, a pair of RSSParams"),
        ((SLIDES.ego,), r"expected a Preset, a pair of RSSParams"),
        ((SLIDES.ego, "slides"), r"params\[1\] = 'slides': expected RSSParams or a dict of them"),
        ({"ego": {"a_max_brake": -1}}, r"params\.ego: a_max_brake = -1 is out of range: expected a finite number > 0"),
        ({"rho": 1.0}, r"params has 'rho': expected RSS parameters \(response_time, "),
        ({"mu": 0.1, "ego": {}}, r"params has 'mu', 'ego': expected RSS parameters"),
        ({"other": {"reaction": 2.0}}, r"params\.other: unknown RSS parameter 'reaction'"),
        (SLIDES._replace(ego=SLIDES.ego._replace(mu=math.nan)), r"params\.ego: mu = nan is out of range"),
        ((SLIDES.ego, SLIDES.other._replace(a_min_brake="4")), None),
    ],
)
@pytest.mark.parametrize("build", [make, lambda env_id, **o: make_vec(env_id, 2, **o)], ids=["make", "make_vec"])
def test_a_wrong_table_is_named(build, params, message):
    if message is None:
        assert build("highway-fast-v0", params=params).settings.table.other.a_min_brake == 4.0
    else:
        with pytest.raises(ValueError, match=message):
            build("highway-fast-v0", params=params)


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        ({"memry": False}, "rules has an unknown field 'memry'; expected longitudinal, "),
        ({"memory": 0.5}, r"rules\.memory = 0\.5: expected True or False"),
        ({"heading_bound": 2.0}, r"rules\.heading_bound = 2\.0: expected a finite number >= 0 and <= 1"),
        ({"overlap_margin": "wide"}, r"rules\.overlap_margin = 'wide': expected a finite number"),
        ("none", "rules = 'none': expected Rules or a dict of"),
    ],
)
def test_wrong_rules_are_named(rules, message):
    for build in (make, lambda env_id, **options: make_vec(env_id, 1, **options)):
        with pytest.raises(ValueError, match=message):
            build("highway-fast-v0", rules=rules)


@pytest.mark.parametrize(
    "rules", [{"limits": False}, {"heading_bound": 1}, {"memory": np.False_, "overlap_margin": np.float32(0)}]
)
def test_rules_may_be_those_that_differ(rules):
    expected = Rules(**{name: type(Rules._field_defaults[name])(value) for name, value in rules.items()})
    assert make("highway-fast-v0", rules=rules).settings.table.rules == expected
    assert make_vec("highway-fast-v0", 1, rules=rules).settings.table.rules == expected


# ---------------------------------------------------------------- specifications


def _numbers(env, seed):
    observation, _ = env.reset(seed=seed)
    rows = [np.asarray(observation).sum()]
    for _ in range(3):
        action = tuple([1] * len(env.action_space)) if isinstance(env.action_space, gym.spaces.Tuple) else 2
        observation, reward, terminated, truncated, _ = env.step(action)
        rows += [np.asarray(observation).sum(), np.sum(reward)]
        if terminated or truncated:
            break
    return rows


@pytest.mark.parametrize(
    ("env_id", "options"),
    [
        ("highway-fast-v0", {}),
        ("highway-fast-v0", {"params": SLIDES, "rules": Rules(limits=False), "intervention_penalty": np.float32(0.5)}),
        ("merge-v0", {"params": "carla", "shield": "monitor", "config": {"simulation_frequency": 10}}),
        ("exit-v0", {"params": (SLIDES.ego, SLIDES.other._replace(response_time=1.4)), "record": True}),
        ("intersection-v0", {"params": {"ego": {"response_time": 0.4}}, "entry": "priority", "traffic": "compliant"}),
        (AGENTS, {"params": PRESETS["intersection"], "rules": {"memory": False}, "waiting": "anywhere"}),
    ],
)
def test_a_specification_goes_through_json_and_back(env_id, options):
    env = make(env_id, **options)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.settings == env.settings
    assert (again.params[:2], again.rules, again.mode) == (env.params[:2], env.rules, env.mode)
    assert again.options.intervention_penalty == env.options.intervention_penalty
    assert _numbers(gym.make(env.spec), 4) == _numbers(again, 4) == _numbers(env, 4)
    assert json.loads(again.spec.to_json()) == json.loads(env.spec.to_json())


# ---------------------------------------------------------------- stable-baselines3's Monitor inside the shield


@pytest.mark.parametrize(
    ("env_id", "action", "wrapper"),
    [
        ("highway-fast-v0", 3, {"mode": "monitor"}),
        ("merge-v0", 3, {"mode": "override", "intervention_penalty": 1.0}),
        ("intersection-v0", 2, {"mode": "monitor", "params": "slides"}),
        ("roundabout-v0", 1, {}),
    ],
)
def test_a_monitor_inside_the_shield_logs_its_verdict(env_id, action, wrapper):
    keywords = ("blame", "override_share", "episode_cost", "min_ttc", "raw_reward", "time")
    env = make_vec_env(
        env_id,
        n_envs=1,
        seed=3,
        wrapper_class=ShieldWrapper,
        wrapper_kwargs=wrapper,
        env_kwargs={"config": {"duration": 8}} if "merge" not in env_id else {},
        monitor_kwargs={"info_keywords": keywords},
    )
    env.reset()
    plain = make(
        env_id,
        wrapper.get("mode", "override"),
        **{k: v for k, v in wrapper.items() if k != "mode"},
        config=env.unwrapped.envs[0].unwrapped.config,
    )
    plain.reset(seed=3)
    done = False
    while not done:
        _, rewards, dones, infos = env.step([action])
        *_, reward, terminated, _, info = plain.step(action)
        assert rewards[0] == np.float32(reward)
        assert {key: infos[0][key] for key in keywords} == {key: info[key] for key in keywords}
        assert infos[0]["shield"] == info["shield"]
        done = dones[0] or terminated
    assert {key: infos[0]["episode"][key] for key in keywords} == {key: info[key] for key in keywords}


def test_a_monitor_between_other_wrappers_reads_the_shield_of_any():
    inner = gym.wrappers.TimeLimit(gym.make("highway-fast-v0"), 3)
    env = ShieldWrapper(gym.wrappers.ClipReward(Monitor(inner, info_keywords=("cost", "blame")), 0.0, 1.0))
    for seed in (0, 5, 9):
        env.reset(seed=seed)
        costs = 0.0
        for _ in range(3):
            *_, info = env.step(4)
            costs += info["cost"]
        assert (info["episode_cost"], info["override_share"] >= 0.0) == (costs, True)


# ---------------------------------------------------------------- numbers of numpy, and arguments of gymnasium


@pytest.mark.parametrize("kind", [int, np.int64, np.int32, np.uint8])
@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_whole_numbers_may_be_numpys(backend, kind):
    env = make_vec("highway-fast-v0", kind(2), backend=backend, threads=kind(1), max_episode_steps=kind(2))
    first, _ = env.reset(seed=kind(7))
    again, _ = env.reset(seed=np.array([7, 8], np.int64))
    np.testing.assert_array_equal(first, again)
    assert not env.step([kind(1), kind(3)])[3].any()
    assert env.step(np.array([1, 3], kind))[3].all()
    one = make("highway-fast-v0")
    np.testing.assert_array_equal(one.reset(seed=kind(7))[0], first[0])
    assert one.step(kind(3))[4]["shield"]["proposed_action"] == 3


@pytest.mark.parametrize("penalty", [np.float32(0.25), np.int64(1), 1, np.float64(0.5)])
def test_penalties_may_be_numpys(penalty):
    assert make("highway-fast-v0", intervention_penalty=penalty).options.intervention_penalty == penalty
    assert make_vec("highway-fast-v0", 1, intervention_penalty=penalty).engine.penalty == penalty


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
@pytest.mark.parametrize("seed", [-1, 1.5, "1"])
def test_a_wrong_seed_is_named(backend, seed):
    for env in (make_vec("highway-fast-v0", 1, backend=backend), make("highway-fast-v0"), make(AGENTS)):
        with pytest.raises(ValueError, match=f"seed = {seed!r}: expected a whole number >= 0"):
            env.reset(seed=seed)


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0", "merge-v1"])
@pytest.mark.parametrize("limit", [1, 3, 5])
def test_both_backends_cut_an_episode_off_where_they_are_told_to(env_id, limit):
    for backend in ("fast", "highway-env"):
        env = make_vec(env_id, 2, backend=backend, max_episode_steps=limit)
        env.reset(seed=1)
        truncated = [env.step(np.zeros(2, int) + 1)[3].all() for _ in range(limit)]
        assert truncated == [False] * (limit - 1) + [True]


def test_compliant_traffic_side_by_side_is_that_of_one_environment():
    many = make_vec("intersection-v0", 2, backend="highway-env", traffic="compliant")
    many.reset(seed=11)
    one = make("intersection-v0", traffic="compliant")
    one.reset(seed=12)
    for _ in range(4):
        observations, *_, infos = many.step([1, 1])
        observation, *_, info = one.step(1)
        np.testing.assert_array_equal(observations[1], observation)
        assert infos["traffic_blame"][1] == info["traffic_blame"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"traffic": "compliant"}, r"does not support traffic = 'compliant'; expected backend = 'highway-env'"),
        ({"record": True}, r"does not support record = True"),
    ],
)
def test_what_the_engine_does_not_do_is_named(arguments, message):
    with pytest.raises(Unsupported, match=message):
        make_vec("highway-fast-v0", 1, **arguments)
    make_vec("highway-fast-v0", 1, backend="highway-env", **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"traffic": "tame"}, "traffic = 'tame': expected one of stock, compliant"),
        (
            {"vectorization_mode": "async"},
            "vectorization_mode = 'async': make_vec does not support it; expected backend",
        ),
        ({"wrappers": gym.Wrapper}, "wrappers = .*Wrapper.*: expected a list of wrappers"),
        ({"autoreset_mode": "never"}, r"autoreset_mode = 'never': expected one of AutoresetMode\.NEXT_STEP, "),
        ({"max_episode_steps": 0}, "max_episode_steps = 0: expected a whole number >= 1"),
        ({"max_episode_steps": 2.5}, r"max_episode_steps = 2\.5: expected a whole number >= 1"),
        ({"num_envs": 2.0}, r"num_envs = 2\.0: expected a whole number >= 1"),
        ({"num_envs": np.int64(0)}, "num_envs = .*0.*: expected a whole number >= 1"),
    ],
)
@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_wrong_arguments_are_named(backend, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_vec("highway-fast-v0", **({"num_envs": 1} | arguments), backend=backend)


def test_an_unknown_argument_of_an_environment_is_named():
    for build in (make, lambda *a, **o: make_vec(*a, 1, backend="highway-env", **o)):
        with pytest.raises(ValueError, match=r"lanes = 3: unknown here; expected config, render_mode or"):
            build("highway-fast-v0", lanes=3)


@pytest.mark.parametrize("mode", [*AutoresetMode, "NextStep", "SameStep"])
@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_autoreset_modes_may_be_given_by_value(backend, mode):
    env = make_vec("highway-fast-v0", 1, backend=backend, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] == AutoresetMode(mode)


# ---------------------------------------------------------------- actions


@pytest.mark.parametrize("action", [5, -1, 2.5, math.nan, "FASTER", [0, 1], {}])
def test_an_action_that_is_none_is_named(action):
    env = make("highway-fast-v0")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected a whole number from 0 to 4"):
        env.step(action)
    assert env.unwrapped.time == 0


@pytest.mark.parametrize("action", [3, 3.0, np.int64(3), np.array(3), np.array([3])])
def test_an_action_may_be_any_kind_of_number(action):
    env = make("highway-fast-v0")
    env.reset(seed=0)
    assert env.step(action)[1] == pytest.approx(_reward_of_faster(), abs=0)


def _reward_of_faster():
    env = make("highway-fast-v0")
    env.reset(seed=0)
    return env.step(3)[1]


WRONG = [[0.0, math.nan], [math.inf, 0.0], [0.1], [0.1, 0.2, 0.3], 0.1, ["a", "b"]]


@pytest.mark.parametrize("action", WRONG)
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v1"])
def test_continuous_actions_must_be_finite_and_as_many_as_the_space_has(env_id, action):
    env = (
        make(env_id, config=CONTINUOUS | {"destination": "o1"})
        if "inter" not in env_id
        else make(env_id, config={"destination": "o1"})
    )
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"expected finite numbers, shape \(2,\)"):
        env.step(action)


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
@pytest.mark.parametrize("action", WRONG[:2])
def test_continuous_actions_must_be_finite_on_both_backends(backend, action):
    env = make_vec("highway-fast-v0", 2, backend=backend, config=CONTINUOUS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="expected finite numbers"):
        env.step(np.array([[0.0, 0.0], action]))


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ((1,), "expected a tuple of 2 actions, one for each agent"),
        ((1, 1, 1), "expected a tuple of 2 actions"),
        (1, "action = 1: expected a tuple of 2 actions"),
        (None, "action = None: expected a tuple of 2 actions"),
        ({"agent_0": 1, "agent_1": 1}, "expected a tuple of 2 actions"),
        ((1, 9), r"action\[1\] = 9: expected a whole number from 0 to 2"),
        (("SLOWER", 1), r"action\[0\] = 'SLOWER': expected a whole number from 0 to 2"),
        ((1, math.nan), r"action\[1\] = nan: expected a whole number"),
    ],
)
def test_a_wrong_joint_action_is_named_before_anybody_moves(joint, message):
    env = make(AGENTS)
    env.reset(seed=0)
    places = [tuple(v.position) for v in env.unwrapped.road.vehicles]
    with pytest.raises(ValueError, match=message):
        env.step(joint)
    assert [tuple(v.position) for v in env.unwrapped.road.vehicles] == places


@pytest.mark.parametrize("joint", [[1, 2], np.array([1, 2]), (np.int64(1), 2.0)])
def test_joint_actions_may_come_in_any_row(joint):
    rewards = []
    for one in ((1, 2), joint):
        env = make(AGENTS)
        env.reset(seed=2)
        rewards.append([env.step(one)[1] for _ in range(2)])
    assert rewards[0] == rewards[1]


def test_a_wrong_action_of_one_of_several_agents_is_named():
    env = parallel_env(AGENTS)
    env.reset(seed=0)
    for wrong in (7, "x", math.inf):
        with pytest.raises(ValueError, match=r"action of agent_1 = .*: expected a whole number from 0 to 2"):
            env.step({"agent_0": 1, "agent_1": wrong})


@pytest.mark.parametrize(
    ("env_id", "config"),
    [
        (AGENTS, {"observation": {"type": "Kinematics"}, "controlled_vehicles": 3}),
        ("intersection-multi-agent-v1", {"observation": {"type": "OccupancyGrid"}}),
        ("intersection-multi-agent-v2", {"observation": {"type": "TimeToCollision"}, "controlled_vehicles": 1}),
    ],
)
def test_one_observation_for_all_agents_is_refused_by_name(env_id, config):
    with pytest.raises(ValueError, match="is one observation for all; expected type MultiAgentObservation"):
        parallel_env(env_id, config=config)


# ---------------------------------------------------------------- gymnasium's wrappers of vector environments


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0", "roundabout-v0"])
def test_gymnasiums_wrappers_take_the_next_step(env_id, backend):
    env = make_vec(env_id, 3, backend=backend, autoreset_mode=AutoresetMode.NEXT_STEP, max_episode_steps=4)
    env = NormalizeObservation(FlattenObservation(env))
    env.reset(seed=0)
    for _ in range(6):
        observations, *_ = env.step(np.ones(3, int))
        assert observations.shape == (3, *env.single_observation_space.shape)
        assert np.isfinite(observations).all()


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(("env_id", "duration"), [("highway-fast-v0", 4), ("intersection-v0", 6), ("exit-v0", 5)])
def test_both_backends_say_the_same_of_a_finished_episode(env_id, duration, mode):
    rng = np.random.default_rng(2)
    fast, original = (
        make_vec(
            env_id, 3, "monitor", backend, config={"duration": duration}, autoreset_mode=mode, intervention_penalty=0.5
        )
        for backend in ("fast", "highway-env")
    )
    fast.reset(seed=5)
    original.reset(seed=5)
    seen = 0
    for _ in range(2 * duration + 3):
        actions = rng.integers(3, size=3)
        (*_, dones, cuts, infos), (*_, infos_original) = fast.step(actions), original.step(actions)
        ended = dones | cuts
        if mode == AutoresetMode.SAME_STEP:
            assert ("final_info" in infos) == ("final_info" in infos_original) == ended.any()
            infos, infos_original = (each.get("final_info", {}) for each in (infos, infos_original))
        assert ("episode" in infos) == ("episode" in infos_original) == ended.any()
        if ended.any():
            episode, episode_original = infos["episode"], infos_original["episode"]
            np.testing.assert_array_equal(infos["_episode"], infos_original["_episode"])
            assert set(episode) == set(episode_original)
            for name in ("l", "r"):
                np.testing.assert_allclose(episode[name][ended], episode_original[name][ended], rtol=1e-12)
            assert (episode["t"][ended] > 0.0).all()
            seen += ended.sum()
            if mode == AutoresetMode.DISABLED:
                for env in (fast, original):
                    env.reset(options={"reset_mask": ended})
    assert seen >= 6
