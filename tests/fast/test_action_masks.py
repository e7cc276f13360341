"""Masks and replacement on both simulators: the same values, and nothing changes by looking ahead."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
from stable_baselines3.common.vec_env import DummyVecEnv

import rss_shield
from rss_shield.envs.decisions.masks import FASTER, LANE_LEFT, SLOWER
from rss_shield.shield.filters.answer import FILTERS

MOTORWAYS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0")
JUNCTIONS = ("intersection-v0", "roundabout-v0")
FEW = {"highway-fast-v0": {"vehicles_count": 12}, "exit-v0": {"vehicles_count": 12}}
CONTINUOUS = {"action": {"type": "ContinuousAction"}}
E = 24


def both(env_id, mode="override", **options):
    config = FEW.get(env_id)
    engine = rss_shield.make_vec(env_id, 1, mode, config=config, autoreset_mode=AutoresetMode.DISABLED, **options)
    return rss_shield.make(env_id, mode, config=config, **options), engine


def seen_by_both(env_id, episodes, decisions, **options):
    """Masks, observations and infos of both after every decision."""
    stock, engine = both(env_id, **options)
    for seed in range(episodes):
        stock.reset(seed=seed)
        engine.reset(seed=seed)
        rng, ended, count = np.random.default_rng(seed), False, 0
        while not ended and count < decisions:
            yield stock.action_masks(), engine.action_masks()[0], None
            eager = rng.random() < 0.5
            count_of = int(stock.action_space.n)
            action = (FASTER if count_of == 5 else 2) if eager else int(rng.integers(count_of))
            observation, _, terminated, truncated, info = stock.step(action)
            observations, *_ = engine.step(np.array([action]))
            yield observation, observations[0], (info, engine.info(0))
            ended, count = terminated or truncated, count + 1


@pytest.mark.parametrize("env_id", MOTORWAYS + JUNCTIONS)
def test_masks_agree_on_both_simulators(env_id):
    masks = 0
    for first, second, infos in seen_by_both(env_id, 20, 6):
        if infos is None:
            assert first.tolist() == second.tolist()
            assert first.any()
            masks += not first.all()
        else:
            np.testing.assert_allclose(first, second, atol=1e-6)
    assert masks > 10


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "intersection-v0"])
def test_replaced_actions_agree_on_both_simulators(env_id):
    replaced = 0
    for first, second, infos in seen_by_both(env_id, 6, 8, replace="decision"):
        if infos is None:
            continue
        np.testing.assert_allclose(first, second, atol=1e-6)
        for name in ("proposed_action", "executed_action", "action_replaced", "override_fraction"):
            assert infos[0]["shield"][name] == infos[1]["shield"][name]
        assert infos[0]["action"] == infos[1]["action"]
        replaced += infos[0]["shield"]["action_replaced"]
    assert replaced > 5


def test_the_mask_is_the_same_where_the_shield_only_watches():
    stock, engine = both("highway-fast-v0", "monitor")
    acting = rss_shield.make("highway-fast-v0", config=FEW["highway-fast-v0"])
    for env in (stock, acting):
        env.reset(seed=3)
    engine.reset(seed=3)
    assert stock.action_masks().tolist() == acting.action_masks().tolist() == engine.action_masks()[0].tolist()


# ---------------------------------------------------------------- looking ahead changes nothing


@pytest.mark.parametrize("env_id", ["highway-fast-v0", "exit-v0", "intersection-v0"])
def test_looking_ahead_leaves_the_engine_as_it_is(env_id):
    looked, blind = (rss_shield.make_vec(env_id, E) for _ in range(2))
    for env in (looked, blind):
        env.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(15):
        before = [part.tobytes() for part in _arrays(looked.engine.batch)]
        looked.action_masks()
        assert before == [part.tobytes() for part in _arrays(looked.engine.batch)]
        actions = rng.integers(looked.single_action_space.n, size=E)
        first, second = looked.step(actions), blind.step(actions)
        for a, b in zip(first[:4], second[:4], strict=True):
            assert a.tobytes() == b.tobytes()


def _arrays(batch):
    for part in batch:
        if isinstance(part, np.ndarray):
            yield part
        elif part is not None:
            yield from _arrays(part)


@pytest.mark.parametrize("env_id", ["merge-v0", "roundabout-v0"])
def test_looking_ahead_leaves_highway_env_as_it_is(env_id):
    looked, blind = (rss_shield.make(env_id) for _ in range(2))
    rng = np.random.default_rng(0)
    for env in (looked, blind):
        env.reset(seed=2)
    ended = False
    while not ended:
        looked.action_masks()
        action = int(rng.integers(looked.action_space.n))
        first, second = looked.step(action), blind.step(action)
        assert first[0].tobytes() == second[0].tobytes()
        assert first[1:4] == second[1:4]
        assert first[4]["shield"] == second[4]["shield"]
        ended = first[2] or first[3]


def test_masks_do_not_depend_on_the_number_of_threads():
    masks = []
    for threads in (1, 3):
        env = rss_shield.make_vec("highway-fast-v0", E, threads=threads)
        env.reset(seed=0)
        env.step(np.full(E, FASTER))
        masks.append(env.action_masks())
        env.close()
    assert np.array_equal(*masks)


# ---------------------------------------------------------------- what the shield then does


def test_a_masked_action_is_answered_and_another_hardly_ever():
    """Without anticipation, and with traffic that does not go on as it did: the mask says what the shield will do."""
    env = rss_shield.make_vec("highway-fast-v0", 100, rules={"anticipation": 0.0})
    env.reset(seed=5)
    rng, counts = np.random.default_rng(1), np.zeros((2, 2))
    for _ in range(40):
        masks = env.action_masks()
        actions = rng.integers(5, size=100)
        _, _, terminated, truncated, infos = env.step(actions)
        answered = infos["shield"]["intervened"] | infos["shield"]["lane_change_refused"]
        allowed = masks[np.arange(100), actions]
        # SLOWER is allowed for want of anything better, too
        counted = ~(terminated | truncated) & (actions != SLOWER)
        for a, b in zip(allowed[counted], answered[counted], strict=True):
            counts[int(a), int(b)] += 1
    assert counts[0, 1] > 0.97 * counts[0].sum() > 400
    assert counts[1, 1] < 0.04 * counts[1].sum()


def test_who_obeys_the_mask_needs_the_shield_less():
    shares = []
    for obeys in (False, True):
        env = rss_shield.make_vec("highway-fast-v0", 100, rules={"anticipation": 0.0})
        env.reset(seed=5)
        rng, frames = np.random.default_rng(1), []
        for _ in range(30):
            odds = rng.random((100, 5)) * (env.action_masks() if obeys else 1.0)
            frames.append(env.step(odds.argmax(axis=1))[4]["shield"]["override_fraction"].mean())
        shares.append(np.mean(frames))
    assert shares[1] < 0.5 * shares[0]


def test_after_a_contact_everything_is_allowed():
    env, engine = both("highway-fast-v0", "monitor")
    env.reset(seed=0)
    engine.reset(seed=0)
    ended = False
    while not ended:
        _, _, terminated, truncated, info = env.step(FASTER)
        engine.step(np.array([FASTER]))
        ended = terminated or truncated
    assert info["crashed"]
    assert env.action_masks().all()
    assert engine.action_masks().all()


# ---------------------------------------------------------------- replacement and other filters


def test_an_unmasked_action_is_executed_as_proposed_and_a_masked_one_is_not():
    env = rss_shield.make_vec("highway-fast-v0", E, replace="decision")
    env.reset(seed=0)
    for _ in range(10):
        masks, actions = env.action_masks(), np.full(E, FASTER)
        infos = env.step(actions)[4]
        told = infos["shield"]
        decided = infos["_raw_reward"]  # not where an episode has just begun
        assert np.array_equal(told["action_replaced"][decided], ~masks[decided, FASTER])
        executed = infos["action"][decided]
        assert masks[decided, executed].all()
        assert (told["proposed_action"][decided] == FASTER).all()
    assert (executed != FASTER).any()


@pytest.mark.parametrize(
    "options", [*({"filter": name} for name in FILTERS), {"replace": "decision"}, {"correction": "response"}]
)
def test_a_monitor_changes_nothing_whatever_it_would_do(options):
    plain, other = (rss_shield.make_vec("highway-fast-v0", E, "monitor", **given) for given in ({}, options))
    rng = np.random.default_rng(0)
    for env in (plain, other):
        env.reset(seed=1)
    for _ in range(15):
        actions = rng.integers(5, size=E)
        first, second = plain.step(actions), other.step(actions)
        for a, b in zip(first[:4], second[:4], strict=True):
            assert a.tobytes() == b.tobytes()
        assert np.array_equal(first[4]["blame"], second[4]["blame"])


@pytest.mark.parametrize("options", [{}, CONTINUOUS], ids=["meta", "continuous"])
@pytest.mark.parametrize("name", FILTERS[1:])
def test_other_filters_agree_on_both_simulators(name, options):
    config = FEW["highway-fast-v0"] | options
    stock = rss_shield.make("highway-fast-v0", filter=name, config=config)
    engine = rss_shield.make_vec(
        "highway-fast-v0", 1, filter=name, config=config, autoreset_mode=AutoresetMode.DISABLED
    )
    rng, changed = np.random.default_rng(0), 0.0  # spaces are made anew, without a seed, on every reset
    for seed in range(3):
        stock.reset(seed=seed)
        engine.reset(seed=seed)
        for _ in range(10):
            action = np.array([1.0, rng.uniform(-0.05, 0.05)], np.float32) if options else FASTER
            observation, reward, terminated, truncated, info = stock.step(action)
            observations, rewards, *_ = engine.step(np.array([action]))
            np.testing.assert_allclose(observation, observations[0], atol=1e-6)
            assert reward == pytest.approx(rewards[0], abs=1e-9)
            ours = engine.info(0)
            assert info["blame"] == ours["blame"]
            assert info["episode_broken_duties"] == ours["episode_broken_duties"]
            assert info["shield"]["override_fraction"] == ours["shield"]["override_fraction"]
            for name in ("proposed_action", "executed_action"):
                np.testing.assert_allclose(info["shield"][name], ours["shield"][name], atol=1e-6)
            changed += info["shield"]["mean_acceleration_change"]
            if terminated or truncated:
                break
    assert changed > 0.0


# ---------------------------------------------------------------- stable-baselines3, and what is refused


def test_maskable_algorithms_find_the_masks():
    env = rss_shield.make("merge-v0")
    env.reset(seed=0)
    assert is_masking_supported(env)
    assert get_action_masks(env).tolist() == env.action_masks().tolist()
    vector = DummyVecEnv([lambda: rss_shield.make("merge-v0")] * 2)
    vector.seed(0)
    vector.reset()
    assert is_masking_supported(vector)
    assert get_action_masks(vector).shape == (2, 5)


def test_masks_need_a_shield_and_meta_actions():
    with pytest.raises(ValueError, match="shield = None"):
        rss_shield.make_vec("highway-fast-v0", 1, None).action_masks()
    for env in (rss_shield.make, lambda *a, **k: rss_shield.make_vec(a[0], 1, **k)):
        with pytest.raises(ValueError, match="ContinuousAction"):
            env("highway-fast-v0", config=CONTINUOUS).action_masks()
        with pytest.raises(ValueError, match=r"replace = 'decision'.*ContinuousAction"):
            env("highway-fast-v0", config=CONTINUOUS, replace="decision")
        with pytest.raises(ValueError, match=r"filter = 'cbf'.*where roads cross"):
            env("intersection-v0", filter="cbf")
        with pytest.raises(ValueError, match=r"correction = 'response'.*where roads cross"):
            env("intersection-v0", correction="response")
        with pytest.raises(ValueError, match="filter = 'nothing'"):
            env("highway-fast-v0", filter="nothing")
        with pytest.raises(ValueError, match=r"filter_at = 3.*filter = 'limits'"):
            env("highway-fast-v0", filter="limits", filter_at=3)
    with pytest.raises(ValueError, match=r"replace = 'decision'.*several agents"):
        rss_shield.make("intersection-multi-agent-v0", replace="decision")


def test_wrappers_around_the_shield_do_not_hide_the_masks():
    shielded = rss_shield.make("merge-v0")
    env = gym.wrappers.RecordEpisodeStatistics(shielded)
    env.reset(seed=0)
    env.step(LANE_LEFT)
    assert get_action_masks(env).tolist() == shielded.action_masks().tolist()
