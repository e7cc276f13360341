"""The vector environment: seeds, autoreset, infos, threads."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import rss_shield
from rss_shield.envs.fast.config import Unsupported, compile_scenario
from rss_shield.envs.fast.drivers import SLOWER
from rss_shield.envs.stock import LONGEST_EPISODE
from rss_shield.shield.params import Rules

ENV = "highway-fast-v0"


def _rollout(steps=12, num_envs=6, env_id=ENV, **options):
    env = rss_shield.make_vec(env_id, num_envs, **options)
    rng = np.random.default_rng(0)
    seen = [env.reset(seed=7)[0]]
    infos = []
    for _ in range(steps):
        observations, rewards, terminated, truncated, info = env.step(rng.integers(5, size=num_envs))
        seen += [observations, rewards, terminated, truncated]
        infos.append(info)
    env.close()
    return seen, infos


@pytest.mark.parametrize("shield", [None, "override"])
def test_both_backends_return_the_same(shield):
    fast, fast_infos = _rollout(10, 2, shield=shield)
    stock, stock_infos = _rollout(10, 2, shield=shield, backend="highway-env")
    for a, b in zip(fast, stock, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-6)
    for a, b in zip(fast_infos, stock_infos, strict=True):
        np.testing.assert_allclose(a["speed"], b["speed"], atol=1e-8)
        assert ("final_info" in a) == ("final_info" in b)
        if "final_info" in a:
            where = a["_final_info"]
            assert np.array_equal(where, b["_final_info"])
            for e in np.flatnonzero(where):
                np.testing.assert_allclose(a["final_obs"][e], b["final_obs"][e], atol=1e-6)
                assert a["final_info"]["episode"]["r"][e] == pytest.approx(b["final_info"]["episode"]["r"][e], abs=1e-6)
                assert a["final_info"]["episode"]["l"][e] == b["final_info"]["episode"]["l"][e]


def test_results_do_not_depend_on_the_number_of_threads():
    one, _ = _rollout(20, 7, shield="override", threads=1)
    three, _ = _rollout(20, 7, shield="override", threads=3)
    assert all(np.array_equal(a, b) for a, b in zip(one, three, strict=True))


def test_an_environment_does_not_depend_on_its_neighbours():
    many, _ = _rollout(5, 6)
    few = rss_shield.make_vec(ENV, 2)
    observations, _ = few.reset(seed=7)
    assert np.array_equal(observations, many[0][:2])


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_an_episode_that_highway_env_would_never_end_is_truncated(backend):
    creep = {"action": {"type": "DiscreteMetaAction", "target_speeds": [0, 1, 2]}}
    env = rss_shield.make_vec("merge-v0", 1, backend=backend, config=creep)
    env.reset(seed=0)
    ends = [np.concatenate(env.step(np.array([SLOWER]))[2:4]).tolist() for _ in range(LONGEST_EPISODE)]
    assert ends == [[False, False]] * (LONGEST_EPISODE - 1) + [[False, True]]


def test_seeds_may_be_given_one_by_one():
    env = rss_shield.make_vec(ENV, 3, shield=None)
    observations, _ = env.reset(seed=[5, 5, 6])
    assert np.array_equal(observations[0], observations[1])
    assert not np.array_equal(observations[0], observations[2])
    with pytest.raises(ValueError, match="2 seeds"):
        env.reset(seed=[1, 2])


def _until_an_end(env, action=3):
    env.reset(seed=0)
    while True:
        observations, rewards, terminated, truncated, infos = env.step(np.full(env.num_envs, action))
        if (terminated | truncated).any():
            return observations, rewards, terminated | truncated, infos


def test_same_step_autoreset_returns_the_first_observation_of_the_next_episode():
    env = rss_shield.make_vec(ENV, 3, shield=None)
    observations, _, ended, infos = _until_an_end(env)
    e = np.flatnonzero(ended)[0]
    assert env.engine.batch.episodes["steps"][e] == 0
    assert infos["final_info"]["crashed"][e]
    assert not infos["crashed"][e]
    assert not np.array_equal(infos["final_obs"][e], observations[e])
    assert np.array_equal(infos["_final_info"], ended)


def test_next_step_autoreset_spends_a_step_on_the_reset():
    env = rss_shield.make_vec(ENV, 3, shield=None, autoreset_mode=AutoresetMode.NEXT_STEP)
    _, _, ended, infos = _until_an_end(env)
    assert "final_info" not in infos
    _, rewards, terminated, truncated, _ = env.step(np.full(3, 1))
    assert (rewards[ended] == 0.0).all()
    assert not (terminated | truncated)[ended].any()
    assert (env.engine.batch.episodes["steps"][ended] == 0).all()


def test_disabled_autoreset_leaves_resets_to_the_caller():
    env = rss_shield.make_vec(ENV, 3, shield=None, autoreset_mode=AutoresetMode.DISABLED)
    observations, _, ended, _ = _until_an_end(env)
    fresh, _ = env.reset(options={"reset_mask": ended})
    steps = env.engine.batch.episodes["steps"]
    assert (steps[ended] == 0).all()
    assert (steps[~ended] > 0).all()
    assert np.array_equal(fresh[~ended], observations[~ended])


def test_infos_of_one_environment_are_plain_values():
    env = rss_shield.make_vec(ENV, 2)
    env.reset(seed=3)
    env.step(np.array([3, 3]))
    info = env.info(1)
    assert info["blame"] == ""
    assert info["blame_evidence"] == {}
    assert isinstance(info["shield"]["override_fraction"], float)
    assert info["shield"]["proposed_action"] == 3


@pytest.mark.parametrize(
    ("env_id", "config", "named"),
    [
        ("parking-v0", None, "parking-v0"),
        (ENV, {"controlled_vehicles": 2}, "controlled_vehicles"),
        (ENV, {"observation": {"type": "Kinematics", "vehicles_count": 1}}, "vehicles_count = 1"),
        (ENV, {"action": {"type": "ContinuousAction", "dynamical": True}}, "dynamical"),
        ("merge-v0", {"action": {"type": "ContinuousAction"}}, "ContinuousAction"),
    ],
)
def test_an_unsupported_feature_is_named(env_id, config, named):
    with pytest.raises(Unsupported, match=named):
        compile_scenario(env_id, config)


def test_unknown_names_are_errors():
    with pytest.raises(ValueError, match="backend"):
        rss_shield.make_vec(ENV, 1, backend="slow")
    with pytest.raises(ValueError, match="shield"):
        rss_shield.make_vec(ENV, 1, shield="off")
    with pytest.raises(ValueError, match="signalised-intersection-v0"):
        rss_shield.make_vec("signalised-intersection-v0", 1, shield="override")


def test_an_intervention_penalty_is_taken_from_the_reward():
    def total(penalty):
        env = rss_shield.make_vec(ENV, 4, intervention_penalty=penalty, rules=Rules(anticipation=0.0))
        env.reset(seed=0)
        rewards, fractions = 0.0, 0.0
        for _ in range(3):
            _, r, _, _, infos = env.step(np.full(4, 3))
            rewards, fractions = rewards + r, fractions + infos["shield"]["override_fraction"]
        return rewards, fractions

    bare, fractions = total(0.0)
    paid, _ = total(0.5)
    assert fractions.max() > 0
    np.testing.assert_allclose(bare - paid, 0.5 * fractions)


@pytest.mark.parametrize("backend", ["fast", "highway-env"])
def test_a_penalty_may_be_charged_by_the_size_of_the_change(backend):
    def reward(penalty):
        env = rss_shield.make_vec(ENV, 2, intervention_penalty=penalty, penalty_on="change", backend=backend)
        env.reset(seed=0)
        return env.step(np.full(2, 3))

    _, bare, *_, infos = reward(0.0)
    _, paid, *_ = reward(0.25)
    assert infos["shield"]["mean_acceleration_change"].max() > 0
    np.testing.assert_allclose(bare - paid, 0.25 * infos["shield"]["mean_acceleration_change"])


@pytest.mark.parametrize("name", ["num_envs", "threads"])
def test_counts_below_one_are_errors(name):
    with pytest.raises(ValueError, match=f"{name} = 0: expected a whole number >= 1"):
        rss_shield.make_vec(**({"env_id": ENV, "num_envs": 2} | {name: 0}))


def test_a_bad_penalty_is_an_error():
    with pytest.raises(ValueError, match="intervention_penalty"):
        rss_shield.make_vec(ENV, 2, intervention_penalty=-1.0)


@pytest.mark.parametrize("actions", [[1, 5], [-1, 1], [0.5, 1.0]])
def test_actions_outside_the_space_are_errors(actions):
    env = rss_shield.make_vec(ENV, 2, shield=None)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="integers from 0 to 4"):
        env.step(np.array(actions))


@pytest.mark.parametrize("actions", [[[0.0, np.nan], [0.0, 0.0]], [[0.0], [0.0]]])
def test_continuous_actions_must_be_finite_and_of_the_right_shape(actions):
    env = rss_shield.make_vec(ENV, 2, shield=None, config={"action": {"type": "ContinuousAction"}})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="finite numbers"):
        env.step(np.array(actions, np.float32))


@pytest.mark.parametrize(
    ("lane", "lanes"), [(-1, 3), (-2, 4), (-3, 3), (0, 2), (3, 5), (None, 3)], ids=lambda value: str(value)
)
def test_both_backends_start_on_the_same_lane(lane, lanes):
    config = {
        "lanes_count": lanes,
        "initial_lane_id": lane,
        "observation": {"type": "Kinematics", "features": ["x", "y"], "absolute": True, "normalize": False},
    }
    fast, stock = (rss_shield.make_vec(ENV, 2, shield=None, backend=b, config=config) for b in ("fast", "highway-env"))
    for seed in range(3):
        start = fast.reset(seed=seed)[0]
        np.testing.assert_array_equal(start, stock.reset(seed=seed)[0])
        if lane is not None:
            assert (start[:, 0, 1] == 4.0 * (lane % lanes)).all()


def _same_infos(ours, theirs, path="", reset=None):
    """Keys, masks and values, but for what highway-env makes up at a reset and the wall clock."""
    if path == ".blame_evidence":  # the engine's is always complete
        ours = {name: ours[name] for name in theirs}
    names = {name for name in ours if not name.startswith("_")}
    assert names == {name for name in theirs if not name.startswith("_")}
    for name in names - ({"t"} if path.endswith("episode") else set()):
        if isinstance(ours[name], dict):
            _same_infos(ours[name], theirs[name], f"{path}.{name}", reset)
            continue
        where = theirs["_" + name] if path != ".blame_evidence" else theirs["_" + name] & ours["_" + name]
        if path != ".blame_evidence":
            assert np.array_equal(ours["_" + name], where), f"{path}.{name}"
        for e in np.flatnonzero(where).tolist():
            if name in ("action", "lane_change_reward") and reset[e]:
                continue
            a, b = ours[name][e], theirs[name][e]
            assert np.allclose(a, b, atol=1e-6) if np.asarray(b).dtype.kind == "f" else np.all(a == b), f"{path}.{name}"


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(
    ("env_id", "shield", "config"),
    [
        (ENV, "monitor", {"duration": 4}),
        (ENV, "override", {"duration": 3, "action": {"type": "ContinuousAction"}}),
        ("intersection-v0", "monitor", {"duration": 4}),
        ("intersection-v0", None, {"duration": 4}),
        ("exit-v0", None, {"duration": 4}),
        ("exit-v1", "monitor", {"duration": 4}),
        ("merge-v0", "monitor", {"duration": 3}),
        ("roundabout-v0", "override", {"duration": 3}),
    ],
)
def test_both_backends_say_the_same(env_id, shield, config, mode):
    fast, stock = (
        rss_shield.make_vec(env_id, 3, shield=shield, backend=b, config=config, autoreset_mode=mode)
        for b in ("fast", "highway-env")
    )
    begins = np.ones(3, bool)
    _same_infos(fast.reset(seed=1)[1], stock.reset(seed=1)[1], reset=begins)
    fast.action_space.seed(0)
    ended, steps = np.zeros(3, bool), 0
    while steps < 9:
        actions = fast.action_space.sample()
        if mode == AutoresetMode.DISABLED and ended.any():
            infos = [env.reset(options={"reset_mask": ended.copy()})[1] for env in (fast, stock)]
            _same_infos(*infos, reset=begins)
        *_, ours = fast.step(actions)
        *_, terminated, truncated, theirs = stock.step(actions)
        began, ended = ended, terminated | truncated
        same_step = mode == AutoresetMode.SAME_STEP
        now = ended if same_step else began if mode == AutoresetMode.NEXT_STEP else np.zeros(3, bool)
        final = (ours.pop("final_info", {}), theirs.pop("final_info", {}))
        for infos in (ours, theirs):
            for name in ("final_obs", "episode"):
                infos.pop(name, None)
        _same_infos(ours, theirs, reset=now)
        _same_infos(*final, reset=np.zeros(3, bool))
        steps += 1
