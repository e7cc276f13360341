"""Every learner: what it learns from, and that a kill changes nothing."""

import csv
import functools
import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.save_util import load_from_zip_file

import rss_shield
import rss_shield.agents.off_policy
import rss_shield.agents.ppo
from rss_shield.agents import off_policy
from rss_shield.agents.baselines.adaptive_ppo import SIGNALS
from rss_shield.agents.baselines.executed_dqn import ExecutedDQN
from rss_shield.agents.baselines.executed_ppo import ExecutedPPO
from rss_shield.agents.baselines.lagrangian_ppo import LagrangianPPO
from rss_shield.agents.baselines.sailr_ppo import CHANGE, EndsAtIntervention
from rss_shield.agents.baselines.shaped_ppo import Shaping
from rss_shield.agents.blocks import train_in_blocks
from rss_shield.agents.learner import LEARNERS, learner_of
from rss_shield.agents.load import algorithm_in, load_policy
from rss_shield.agents.multiplier import Meter, Pid
from rss_shield.agents.vec_env import VectorEnvAdapter

ENV = "highway-fast-v0"
FASTER = 3
FEW = {"vehicles_count": 10, "duration": 8}
BEFORE = {"replace": "decision"}
# learner -> its settings, the options of its environments
CASES = {
    "adaptive-ppo": ({"target": 0.5, "penalty_on": "change"}, {}),
    "shaped-ppo": ({}, {"shield": "monitor"}),
    "maskable-ppo": ({}, {}),
    "sailr-ppo": ({}, {}),
    "lagrangian-ppo": ({"cost_limit": 0.01}, {"shield": "monitor"}),
    "executed-ppo": ({}, BEFORE),
    "dqn": ({"explore_for": 4}, {}),
    "executed-dqn": ({}, BEFORE),
    "qr-dqn": ({}, {}),
    "semantic-dqn": ({}, {"semantic_actions": {"features": True}}),
    "sac": ({}, {"config": {**FEW, "action": {"type": "ContinuousAction"}}}),
}
TOTAL = 192


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 64)
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUTS_PER_BLOCK", 1)
    monkeypatch.setattr(rss_shield.agents.off_policy, "BLOCK", 64)


class Killed(Exception):
    pass


def environments(options):
    return functools.partial(rss_shield.make_vec, ENV, **{"config": FEW, "shield": "override", **options})


def weights(path) -> torch.Tensor:
    _, parameters, _ = load_from_zip_file(path, device="cpu")
    states = [state for name, state in sorted(parameters.items()) if "optimizer" not in name]
    return torch.cat([value.double().flatten() for state in states for value in state.values()])


def test_every_learner_is_tested_here():
    assert set(CASES) | {"ppo"} == set(LEARNERS)


def test_a_learner_that_there_is_not_is_an_error():
    with pytest.raises(ValueError, match="learner = 'td4': expected one of ppo, "):
        learner_of("td4")


@pytest.mark.parametrize("name", CASES)
def test_a_killed_training_goes_on_as_if_nothing_had_been_and_its_model_drives(name, tmp_path):
    settings, options = CASES[name]
    learner = learner_of(name, **settings)
    arguments = dict(seed=5, total_timesteps=TOTAL, n_envs=4)

    def kill(timesteps):
        if timesteps >= 100:
            raise Killed

    train_in_blocks(learner, environments(options), tmp_path / "left alone", **arguments)
    with pytest.raises(Killed):
        train_in_blocks(learner, environments(options), tmp_path / "killed", progress=kill, **arguments)
    assert (tmp_path / "killed" / "checkpoint.zip").exists()
    train_in_blocks(learner, environments(options), tmp_path / "killed", **arguments)
    left_alone, killed = (tmp_path / folder / "model.zip" for folder in ("left alone", "killed"))
    assert torch.equal(weights(killed), weights(left_alone))
    for file in ("learning_curve.csv", "multiplier.csv"):
        paths = [tmp_path / folder / file for folder in ("left alone", "killed")]
        assert paths[0].exists() == paths[1].exists()
        if paths[0].exists():
            assert paths[0].read_text() == paths[1].read_text()
    assert not list((tmp_path / "killed").glob("replay-buffer-*"))

    assert algorithm_in(killed) is learner.algorithm
    policy = load_policy(killed)
    env = environments(options)(3, autoreset_mode=AutoresetMode.DISABLED)
    observations, _ = env.reset(seed=0)
    masks = [env.action_masks()] if getattr(policy, "masked", False) else []
    actions = policy(observations, *masks)
    assert len(actions) == 3
    assert env.action_space.contains(np.asarray(actions, env.action_space.dtype))
    assert not masks or masks[0][np.arange(3), actions].all()
    env.close()


def test_hyperparameters_name_everything_that_a_training_depends_on():
    told = learner_of("lagrangian-ppo", cost_limit=0.02).hyperparameters(4, 128)
    assert (told["algorithm"], told["cost_limit"], told["gae_lambda"], told["timesteps"]) == (
        "rss_shield.LagrangianPPO",
        0.02,
        0.95,
        128,
    )
    assert learner_of("dqn").hyperparameters(4, 128)["max_grad_norm"] == 10


# ---------------------------------------------------------------- the price


def test_the_price_rises_while_too_much_is_measured_and_falls_afterwards():
    pid = Pid(target=0.5, scale=0.5, kp=0.0, ki=0.1, kd=0.0, largest=1.0)
    # errors (2.5 - 0.5) / 0.5 = 4, counted as 1; (0.75 - 0.5) / 0.5 = 0.5; (0 - 0.5) / 0.5 = -1
    assert [round(pid.update(measured), 3) for measured in (2.5, 2.5, 0.75, 0.0, 0.0)] == [0.1, 0.2, 0.25, 0.15, 0.05]
    assert pid.update(0.0) == pid.update(0.0) == 0.0
    for _ in range(100):
        pid.update(9.0)
    assert pid.multiplier == pid.integral == 1.0  # nothing winds up
    assert pid.update(0.0) == pytest.approx(0.9)


def test_the_proportional_and_the_differential_part():
    pid = Pid(target=0.0, scale=1.0, kp=2.0, ki=0.0, kd=3.0, largest=100.0)
    assert pid.update(0.25) == 0.5
    assert pid.update(0.5) == pytest.approx(2 * 0.5 + 3 * 0.25)
    assert pid.update(0.25) == 0.5  # what falls is not hurried


def test_a_meter_charges_what_it_measures_also_where_an_episode_ends():
    env = VectorEnvAdapter(environments({})(8), Meter("shield", "mean_acceleration_change"))
    free = VectorEnvAdapter(environments({})(8))
    env.charge.multiplier = 0.25
    measured = ends = 0.0
    for one in (env, free):
        one.seed(3)
        one.reset()
    for _ in range(20):
        _, rewards, ended, _ = env.step(np.full(8, FASTER))
        _, raw, _, _ = free.step(np.full(8, FASTER))
        change = free.told("shield", "mean_acceleration_change")
        np.testing.assert_allclose(rewards, raw - 0.25 * change, rtol=1e-5)
        measured += float(change.mean())
        ends += ended.sum()
    assert ends > 0
    assert env.charge.read() == pytest.approx(measured / 20, rel=1e-5)
    assert set(SIGNALS) == {"response", "change"}


def test_the_multiplier_is_written_down_once_a_rollout(tmp_path):
    learner = learner_of("adaptive-ppo", target=0.5, penalty_on="change")
    train_in_blocks(learner, environments({}), tmp_path, seed=0, total_timesteps=TOTAL, n_envs=4)
    with open(tmp_path / "multiplier.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["timesteps"]) for row in rows] == [32, 64, 96, 128, 160, 192]
    assert all(float(row["target"]) == 0.5 for row in rows)


# ---------------------------------------------------------------- rewards and ends


class Told:
    """What an adapter says, by hand."""

    def __init__(self, ended, **values):
        self.ended, self.values = np.array(ended), values

    def told(self, name):
        return np.array(self.values[name], object if name == "blame" else float)


def test_shaping_charges_each_new_closest_approach_once_and_a_contact():
    shaping = Shaping(2, crash=5.0, short=2.0, horizon=4.0)
    shaping.begin()
    # 2 * (1 - 3 / 4) = 0.5 and nothing; then 2 * (1 - 1 / 4) = 1.5, of which 0.5 is paid; then the contact at 1 s
    calls = [([3.0, 9.0], ["", ""]), ([1.0, 9.0], ["", ""]), ([1.0, 9.0], ["ego", ""])]
    charges = [shaping(Told([blame[0] != "", False], min_ttc=ttc, blame=blame)) for ttc, blame in calls]
    np.testing.assert_allclose(charges, [[0.5, 0.0], [1.0, 0.0], [5.0, 0.0]])
    np.testing.assert_allclose(shaping(Told([False, False], min_ttc=[3.0, 9.0], blame=["", ""])), [0.5, 0.0])


def test_returns_of_the_learning_curve_are_the_environments_whatever_is_charged(tmp_path):
    """1000 for a contact, and no row shows it: neither whole episodes, nor those that the end of a block cuts off."""
    learner = learner_of("shaped-ppo", crash=1000.0, short=500.0)
    train_in_blocks(learner, environments({"shield": "monitor"}), tmp_path, seed=0, total_timesteps=1024, n_envs=8)
    with open(tmp_path / "learning_curve.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["cut"] for row in rows} == {"0", "1"}
    assert any(row["crashed"] == "1" for row in rows)
    assert all(0.0 <= float(row["return"]) <= int(row["length"]) for row in rows)  # rewards are from 0 to 1


def test_an_intervention_ends_the_episode_and_costs():
    env = EndsAtIntervention(rss_shield.make_vec(ENV, 32, "override"), penalty=2.0)
    free = VectorEnvAdapter(rss_shield.make_vec(ENV, 32, "override"))
    for one in (env, free):
        one.seed(1)
        one.reset()
    going = np.ones(32, bool)  # the same episode in both so far
    stopped = 0
    for _ in range(12):
        observations, rewards, ended, infos = env.step(np.full(32, FASTER))
        _, raw, ended_free, _ = free.step(np.full(32, FASTER))
        change = free.told("shield", "mean_acceleration_change")
        intervened = (free.told("shield", "override_fraction") > 0) | (change > CHANGE)
        assert (ended == (ended_free | intervened))[going].all()
        np.testing.assert_allclose(rewards[going], (raw - 2.0 * intervened)[going], rtol=1e-6)
        for e in np.flatnonzero(going & ended & ~ended_free):
            assert infos[e]["TimeLimit.truncated"] is False
            assert infos[e]["episode"]["l"] >= 1
            assert not np.array_equal(infos[e]["terminal_observation"], observations[e])
            stopped += 1
        going &= ~ended
    assert stopped > 3


def test_nothing_is_hoped_for_after_an_intervention_in_the_last_decision():
    """The time runs out, and the shield intervenes in that very decision: PPO must not add a value of the future."""
    env = EndsAtIntervention(rss_shield.make_vec(ENV, 32, "override", config={"duration": 4}), penalty=1.0)
    env.seed(0)
    env.reset()
    at_the_end = 0
    for _ in range(40):
        actions = np.where(env.lengths >= 3, FASTER, 4)  # 4: SLOWER
        *_, infos = env.step(actions)
        change = env.told("shield", "mean_acceleration_change")
        intervened = (env.told("shield", "override_fraction") > 0) | (change > CHANGE)
        for e in np.flatnonzero(env.ended):
            assert infos[e]["TimeLimit.truncated"] == (env.truncated[e] and not intervened[e])
            at_the_end += int(intervened[e])
    assert at_the_end > 10


def test_returns_of_episodes_that_an_intervention_ends_are_of_that_episode_alone():
    """With a reward of 1 a decision, and the penalty left out, a return is a length."""
    env = EndsAtIntervention(rss_shield.make_vec(ENV, 16, "override", config={"duration": 10}), penalty=2.0)
    env.reward = lambda decision: np.ones(len(decision.reward))
    env.seed(0)
    env.reset()
    rng = np.random.default_rng(0)
    stopped = finished = 0
    for _ in range(100):
        *_, over, infos = env.step(np.where(rng.random(16) < 0.1, FASTER, 4))
        for e in np.flatnonzero(over):
            assert infos[e]["episode"]["r"] == infos[e]["episode"]["l"]
            stopped, finished = stopped + int(not env.ended[e]), finished + int(env.ended[e])
    assert stopped > 10 and finished > 10


def test_costs_are_followed_to_the_end_of_an_episode():
    """Advantages by hand where the critic says nothing: discounted sums of what is still to come, up to an end."""
    make_vec = environments({"shield": "monitor"})
    model = LagrangianPPO(
        "MlpPolicy", VectorEnvAdapter(make_vec(2)), n_steps=4, batch_size=8, gamma=0.5, gae_lambda=1.0
    )
    torch.nn.init.zeros_(model.cost_critic[-1].weight)
    torch.nn.init.zeros_(model.cost_critic[-1].bias)
    buffer = model.rollout_buffer
    buffer.costs = np.array([[1, 0], [0, 0], [0, 1], [1, 0]], np.float32)
    buffer.cut = []
    buffer.episode_starts = np.array([[1, 1], [0, 0], [1, 0], [0, 0]], np.float32)  # the first ends after two decisions
    model._last_obs = np.zeros((2, *model.observation_space.shape), np.float32)
    model._last_episode_starts = np.zeros(2)
    advantages, returns = model._of_costs(buffer)
    expected = [[1, 0.25], [0, 0.5], [0.5, 1], [1, 0]]
    np.testing.assert_allclose(advantages, expected)
    np.testing.assert_allclose(returns, expected)


def test_the_agent_with_a_cost_limit_learns_to_break_fewer_duties(tmp_path):
    make_vec = environments({"shield": "monitor"})
    train_in_blocks(
        learner_of("lagrangian-ppo", cost_limit=0.0), make_vec, tmp_path, seed=1, total_timesteps=64 * 30, n_envs=16
    )
    with open(tmp_path / "multiplier.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    costs = [float(row["measured"]) for row in rows]
    assert float(rows[-1]["multiplier"]) > 1.0
    assert np.mean(costs[-5:]) < np.mean(costs[:5])


# ---------------------------------------------------------------- what is remembered


def replacing(count):
    env = VectorEnvAdapter(rss_shield.make_vec(ENV, count, "override", replace="decision"))
    env.seed(2)
    return env


def test_a_rollout_holds_executed_actions_and_their_probabilities():
    model = ExecutedPPO("MlpPolicy", replacing(16), seed=0, **learner_of("executed-ppo").options(16, 512))
    model.learn(model.n_steps * 16)
    buffer = model.rollout_buffer
    assert buffer.replaced.any() and not buffer.replaced.all()
    fresh = ExecutedPPO("MlpPolicy", replacing(16), seed=0, **learner_of("executed-ppo").options(16, 512))
    seen = torch.as_tensor(buffer.observations).reshape(-1, 5, 5)  # as they were before the update
    actions = torch.as_tensor(buffer.actions).long().reshape(-1)
    with torch.no_grad():
        _, log_probs, _ = fresh.policy.evaluate_actions(seen, actions)
    np.testing.assert_allclose(np.asarray(buffer.log_probs).reshape(-1), log_probs, atol=1e-5)


def test_a_replay_buffer_holds_executed_actions():
    options = learner_of("executed-dqn").options(8, 256) | {"learning_starts": 1000}
    model = ExecutedDQN("MlpPolicy", replacing(8), seed=0, **options)
    told = []
    store = model._store_transition

    def watched(*arguments):
        told.append((arguments[1].copy(), np.array(model.env.told("shield", "executed_action"))))
        store(*arguments)

    model._store_transition = watched
    model.learn(256)
    held = model.replay_buffer.actions[: len(told), :, 0]
    np.testing.assert_array_equal(held, [executed for _, executed in told])
    assert any((proposed != executed).any() for proposed, executed in told)


def test_environments_explore_one_by_one():
    options = learner_of("dqn").options(64, 256)
    model = learner_of("dqn").algorithm("MlpPolicy", VectorEnvAdapter(environments({})(64)), seed=0, **options)
    observations = np.zeros((64, *model.observation_space.shape), np.float32)
    greedy, _ = model.predict(observations, deterministic=True)
    model.exploration_rate = 0.5
    explored = np.mean(model.predict(observations)[0] != greedy)
    assert 0.15 < explored < 0.65  # half of them explore, and one in five of these finds the greedy action
    model.exploration_rate = 0.0
    assert np.array_equal(model.predict(observations)[0], greedy)


@pytest.mark.parametrize("longest", [1, 4, 9])
@pytest.mark.parametrize("share", [0.05, 0.4, 0.9])
def test_exploration_lasts_as_long_as_asked_and_is_as_frequent(longest, share):
    """Against a network that always chooses 0, what is drawn is seen wherever it is not 0."""

    class Greedy:
        def predict(self, observation, state, episode_start, deterministic):
            return np.full(len(observation), -1), state

    class Explorer(off_policy.ExploresSingly, Greedy):
        explore_for, exploration_rate, env = longest, share, None
        action_space = SimpleNamespace(n=10**6)  # nothing is drawn twice

    torch.manual_seed(0)
    explorer = Explorer()
    chosen = np.array([explorer.predict(np.zeros((500, 1)))[0] for _ in range(400)])
    assert np.mean(chosen >= 0) == pytest.approx(share, abs=0.02)
    runs = [(drawn, len(list(run))) for column in chosen.T for drawn, run in itertools.groupby(column)]
    lengths = [length for drawn, length in runs if drawn >= 0]
    assert max(lengths) == longest
    assert np.mean(lengths) == pytest.approx((1 + longest) / 2, rel=0.05)
    explorer.exploration_rate = 0.0
    explorer.env = SimpleNamespace(ended=np.arange(500) < 250)
    assert (explorer.predict(np.zeros((500, 1)))[0][:250] == -1).all()  # an episode begins without what was begun
    explorer.forget_exploration()
    assert (explorer.predict(np.zeros((500, 1)))[0] == -1).all()


# ---------------------------------------------------------------- masks


def test_masks_are_asked_for_once_a_step():
    env = VectorEnvAdapter(environments({})(6))
    env.reset()
    calls = []
    masks = env.env.action_masks
    env.env.action_masks = lambda: calls.append(1) or masks()
    answered = env.env_method("action_masks")
    assert len(calls) == 1
    np.testing.assert_array_equal(np.stack(answered), masks())
    assert [len(mask) for mask in env.env_method("action_masks", indices=[1, 2])] == [5, 5]


def test_masks_of_the_original_simulator_are_the_same():
    options = {"config": FEW, "shield": "override"}
    original = VectorEnvAdapter(rss_shield.make_vec(ENV, 2, backend="highway-env", **options))
    engine = VectorEnvAdapter(rss_shield.make_vec(ENV, 2, **options))
    for env in (original, engine):
        env.seed(0)
        env.reset()
        env.step(np.array([FASTER, 1]))
    np.testing.assert_array_equal(*(np.stack(env.env_method("action_masks")) for env in (original, engine)))
