"""Networks for lists of road users: who is listed where, and how many nobodies, changes nothing."""

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from stable_baselines3 import DQN

from rss_shield import make_vec
from rss_shield.agents.history import with_history
from rss_shield.agents.learner import learner_of
from rss_shield.agents.load import load_policy
from rss_shield.agents.networks import NETWORKS, check_network
from rss_shield.agents.vec_env import VectorEnvAdapter

OURS = [name for name, kind in NETWORKS.items() if kind is not None]


def network(name, shape, seed=0):
    torch.manual_seed(seed)
    return NETWORKS[name](Box(-1, 1, shape)).double().eval()


def rows_of(seed, shape):
    return torch.as_tensor(np.random.default_rng(seed).uniform(-1, 1, shape))


@pytest.mark.parametrize("history", [0, 3])
@pytest.mark.parametrize("name", OURS)
def test_others_may_be_listed_in_any_order_but_the_ego_is_told_apart(name, history):
    shape = (history, 6, 7) if history else (6, 7)
    net, seen = network(name, shape), rows_of(1, (5, *shape))
    others = seen.clone()
    others[..., 1:, :] = seen[..., [3, 1, 5, 2, 4], :]
    ego = seen.clone()
    ego[..., [0, 2], :] = seen[..., [2, 0], :]
    torch.testing.assert_close(net(others), net(seen))
    assert not torch.allclose(net(ego), net(seen))


@pytest.mark.parametrize("name", OURS)
def test_nobodies_at_the_end_of_the_list_change_nothing_and_somebody_does(name):
    short, long = rows_of(2, (4, 3, 7)), torch.zeros(4, 8, 7, dtype=torch.float64)
    long[:, :3] = short
    torch.testing.assert_close(network(name, (8, 7))(long), network(name, (3, 7))(short))
    more = long.clone()
    more[:, 3] = 0.5
    assert not torch.allclose(network(name, (8, 7))(more), network(name, (8, 7))(long))


@pytest.mark.parametrize("name", OURS)
def test_an_empty_list_gives_numbers(name):
    net = network(name, (4, 7))
    seen = torch.zeros(2, 4, 7, dtype=torch.float64, requires_grad=True)
    out = net(seen)
    out.sum().backward()
    assert torch.isfinite(out).all() and torch.isfinite(seen.grad).all()


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("history", [1, 2])
def test_a_saved_agent_acts_as_the_one_that_learnt_however_many_ask(name, history, tmp_path):
    learner = learner_of("ppo").with_network(name)
    env = VectorEnvAdapter(with_history(make_vec("intersection-v0", 8), history))
    model = learner.algorithm("MlpPolicy", env, seed=0, **learner.options(8, 64)).learn(64)
    assert isinstance(model.policy.features_extractor, NETWORKS[name])
    model.save(tmp_path / "model.zip")
    seen = np.random.default_rng(0).uniform(-1, 1, (40, *env.observation_space.shape)).astype(np.float32)
    policy = load_policy(tmp_path / "model.zip")
    together = policy(seen)
    np.testing.assert_array_equal(together, model.predict(seen, deterministic=True)[0])
    np.testing.assert_array_equal(together, np.concatenate([policy(one[None]) for one in seen]))
    env.close()


@pytest.mark.parametrize("name", ["dqn", "maskable-ppo", "lagrangian-ppo", "executed-ppo"])
def test_every_learner_takes_them_and_its_record_names_them(name):
    learner = learner_of(name)
    changed = learner.with_network("sets")
    assert changed.options(4, 64)["policy_kwargs"]["features_extractor_class"] is NETWORKS["sets"]
    assert changed.options(4, 64)["policy_kwargs"]["net_arch"] == learner.options(4, 64)["policy_kwargs"]["net_arch"]
    assert changed.hyperparameters(4, 64)["policy_kwargs"]["features_extractor_class"] == "Sets"
    assert learner.with_network("mlp") is learner


def test_a_dqn_learns_with_one():
    env = VectorEnvAdapter(make_vec("highway-fast-v0", 4))
    kwargs = {"features_extractor_class": NETWORKS["attention"]}
    DQN("MlpPolicy", env, seed=0, learning_starts=8, policy_kwargs=kwargs, device="cpu").learn(64)
    env.close()


def test_what_has_no_rows_is_refused():
    check_network("mlp", (12,))
    for shape in [(12,), (1, 7), (2, 3, 4, 5)]:
        with pytest.raises(ValueError, match=r"network = 'sets': observations are \(.*\); expected rows \[V, F\]"):
            check_network("sets", shape)
