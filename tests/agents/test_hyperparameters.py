"""Learners take other arguments of their algorithm, and refuse what it has not or cannot use."""

from types import SimpleNamespace

import pytest

from rss_shield.agents import ppo
from rss_shield.agents.learner import learner_of


def test_changed_arguments_reach_the_algorithm_and_the_record_and_the_rest_stays():
    before = learner_of("ppo")
    after = before.with_hyperparameters({"gamma": 0.95, "learning_rate": 3e-4, "use_sde": True})
    old, new = before.options(128, 200_000), after.options(128, 200_000)
    assert {name for name in new if new[name] != old.get(name)} == {"gamma", "learning_rate", "use_sde"}
    record = after.hyperparameters(128, 200_000)
    assert (record["gamma"], record["learning_rate"], record["use_sde"]) == (0.95, 3e-4, True)
    assert before.options(128, 200_000) == old
    assert after.rounded(128, 200_000) == before.rounded(128, 200_000)


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("ppo", {"gama": 0.9}, "hyperparameters.gama: PPO takes batch_size, "),
        ("dqn", {"clip_range": 0.2}, "hyperparameters.clip_range: SinglyDQN takes batch_size, buffer_size, "),
        ("ppo", {"n_steps": 8}, r"n_steps = 8: not to be chosen here; a rollout .* --total-timesteps decide"),
        ("dqn", {"n_steps": 8}, r"n_steps = 8: not to be chosen here; it is 1, because "),
        ("dqn", {"train_freq": 4}, r"train_freq = 4: not to be chosen here; it is one step of all --n-envs"),
        ("ppo", {"train_freq": 4}, "hyperparameters.train_freq: PPO takes batch_size, "),
        ("ppo", {"policy": "CnnPolicy"}, "policy = 'CnnPolicy': not to be chosen here; it is MlpPolicy, --network"),
        ("ppo", {"seed": 1}, r"hyperparameters.seed = 1: not to be chosen here; --seeds says it"),
        ("sac", {"device": "cuda"}, r"hyperparameters.device = 'cuda': not to be chosen here; --device says it"),
        ("ppo", {"verbose": 1}, "hyperparameters.verbose: PPO takes batch_size, "),
        ("ppo", {"gamma": 1.5}, r"hyperparameters.gamma = 1.5: expected a number >= 0 and <= 1"),
        ("ppo", {"learning_rate": 0.0}, r"hyperparameters.learning_rate = 0.0: expected a number > 0"),
        ("ppo", {"learning_rate": float("nan")}, r"hyperparameters.learning_rate = nan: expected a number > 0"),
        ("ppo", {"learning_rate": "auto"}, r"hyperparameters.learning_rate = 'auto': expected a number > 0"),
        ("ppo", {"n_epochs": 2.5}, r"hyperparameters.n_epochs = 2.5: expected a whole number >= 1"),
        ("ppo", {"n_epochs": True}, r"hyperparameters.n_epochs = True: expected a whole number >= 1"),
        ("ppo", {"max_grad_norm": float("inf")}, r"hyperparameters.max_grad_norm = inf: expected a number > 0"),
        ("sac", {"ent_coef": -1}, r"hyperparameters.ent_coef = -1: expected a number >= 0"),
    ],
)
def test_what_an_algorithm_has_not_or_cannot_use_is_refused_by_name(name, changes, said):
    with pytest.raises(ValueError, match=said):
        learner_of(name).with_hyperparameters(changes)


def test_the_temperature_of_sac_may_find_itself():
    assert learner_of("sac").with_hyperparameters({"ent_coef": "auto_0.1"}).options(1, 1000)["ent_coef"] == "auto_0.1"


def test_a_learning_rate_falls_from_the_one_given_to_nothing():
    model = SimpleNamespace(learning_rate=4e-4, num_timesteps=25)
    ppo.lower_learning_rate(model, 100)
    assert model.lr_schedule(1.0) == pytest.approx(3e-4)
    model.num_timesteps = 100
    ppo.lower_learning_rate(model, 100)
    assert model.lr_schedule(1.0) == 0.0


@pytest.mark.parametrize("name", ["dqn", "qr-dqn", "executed-dqn", "semantic-dqn"])
def test_exploration_falls_as_it_is_told_to_and_as_the_record_says(name):
    told = {"exploration_initial_eps": 0.6, "exploration_final_eps": 0.2, "exploration_fraction": 0.5}
    learner = learner_of(name).with_hyperparameters(told)
    record = learner.hyperparameters(8, 1000)
    assert {key: record[key] for key in told} == told
    options = learner.options(8, 1000)
    model = SimpleNamespace(forget_exploration=lambda: None, **{key: options[key] for key in told})
    rates = []
    for model.num_timesteps in (0, 250, 500, 900):
        learner.begin_block(model, 1000)
        rates.append(model.exploration_rate)
    assert rates == pytest.approx([0.6, 0.4, 0.2, 0.2])


def test_arguments_of_the_policy_that_are_not_named_stay():
    learner = learner_of("qr-dqn").with_hyperparameters({"policy_kwargs": {"net_arch": [64]}})
    kwargs = learner.options(8, 1000)["policy_kwargs"]
    assert kwargs == {**learner_of("qr-dqn").options(8, 1000)["policy_kwargs"], "net_arch": [64]}
    assert "n_quantiles" in kwargs
