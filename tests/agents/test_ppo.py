"""Training: what is written, and that a kill at any point changes nothing."""

import csv
import functools

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

import rss_shield
import rss_shield.agents.ppo
from rss_shield.agents.blocks import block_seed, train_in_blocks
from rss_shield.agents.curve import COLUMNS, truncate_curve
from rss_shield.agents.load import load_policy
from rss_shield.agents.ppo import learner, rollout_steps
from tests.fake_env import BRAKE, FakeEnv, fake_vec


@pytest.fixture(autouse=True)
def small_rollouts(monkeypatch):
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 64)
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUTS_PER_BLOCK", 1)


class Killed(Exception):
    pass


def train(make_vec, folder, **options):
    return train_in_blocks(learner(), make_vec, folder, **options)


def weights(path) -> torch.Tensor:
    return torch.cat([w.flatten() for w in PPO.load(path, device="cpu").policy.parameters()])


def rows_of(folder) -> list[dict[str, str]]:
    with open(folder / "learning_curve.csv", newline="") as file:
        return list(csv.DictReader(file))


def train_until(folder, stop_at: int, **options):
    def progress(timesteps):
        if timesteps >= stop_at:
            raise Killed

    return train(fake_vec, folder, seed=3, total_timesteps=256, progress=progress, **options)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uninterrupted")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 64)
        patch.setattr(rss_shield.agents.ppo, "ROLLOUTS_PER_BLOCK", 1)
        train(fake_vec, folder, seed=3, total_timesteps=256)
    return folder


def test_training_leaves_a_model_a_curve_and_tensorboard_events(uninterrupted):
    assert PPO.load(uninterrupted / "model.zip", device="cpu").num_timesteps == 256
    rows = rows_of(uninterrupted)
    assert len(rows) > 20
    assert tuple(rows[0]) == COLUMNS
    assert all(int(row["crashed"]) == (row["blame"] != "no contact") for row in rows)
    assert list((uninterrupted / "tensorboard").iterdir())
    assert not (uninterrupted / "checkpoint.zip").exists()


@pytest.mark.parametrize("stop_at", [1, 64, 100, 192, 256])
def test_a_killed_and_resumed_training_gives_the_same_result_bit_for_bit(uninterrupted, tmp_path, stop_at):
    with pytest.raises(Killed):
        train_until(tmp_path, stop_at)
    train(fake_vec, tmp_path, seed=3, total_timesteps=256)
    assert torch.equal(weights(tmp_path / "model.zip"), weights(uninterrupted / "model.zip"))
    assert rows_of(tmp_path) == rows_of(uninterrupted)


def test_a_training_on_the_engine_that_was_killed_goes_on_as_if_nothing_had_been(tmp_path):
    make_vec = functools.partial(rss_shield.make_vec, "highway-fast-v0", shield="override")
    options = dict(seed=5, total_timesteps=512, n_envs=2)
    train(make_vec, tmp_path / "left alone", **options)

    def kill(timesteps):
        if timesteps >= 100:
            raise Killed

    with pytest.raises(Killed):
        train(make_vec, tmp_path / "killed", progress=kill, **options)
    assert (tmp_path / "killed" / "checkpoint.zip").exists()
    train(make_vec, tmp_path / "killed", **options)
    assert torch.equal(weights(tmp_path / "killed" / "model.zip"), weights(tmp_path / "left alone" / "model.zip"))
    assert rows_of(tmp_path / "killed") == rows_of(tmp_path / "left alone") != []


def test_parallel_environments_give_the_same_result_twice(tmp_path):
    for name in ("first", "second"):
        train(fake_vec, tmp_path / name, seed=1, total_timesteps=64, n_envs=2)
    assert torch.equal(weights(tmp_path / "first" / "model.zip"), weights(tmp_path / "second" / "model.zip"))


def test_another_seed_gives_another_result(uninterrupted, tmp_path):
    train(fake_vec, tmp_path, seed=4, total_timesteps=256)
    assert not torch.equal(weights(tmp_path / "model.zip"), weights(uninterrupted / "model.zip"))


def test_a_finished_training_is_not_repeated(uninterrupted):
    before = (uninterrupted / "model.zip").stat().st_mtime_ns
    done = []
    train(fake_vec, uninterrupted, seed=3, total_timesteps=256, progress=done.append)
    assert (uninterrupted / "model.zip").stat().st_mtime_ns == before
    assert done == [256]


def test_a_loaded_policy_is_greedy_and_repeats_itself(uninterrupted):
    policy = load_policy(uninterrupted / "model.zip")
    observation = FakeEnv().reset(seed=0)[0]
    actions = {int(policy(observation[None])[0]) for _ in range(20)}
    assert len(actions) == 1
    assert actions <= {0, BRAKE}


def test_a_loaded_policy_acts_as_stable_baselines3_would(uninterrupted):
    observations = np.random.default_rng(0).uniform(-10, 10, (500, 2))
    expected, _ = PPO.load(uninterrupted / "model.zip", device="cpu").predict(observations, deterministic=True)
    assert np.array_equal(load_policy(uninterrupted / "model.zip")(observations), expected)


def test_a_loaded_policy_does_not_depend_on_the_size_of_the_batch(uninterrupted):
    policy = load_policy(uninterrupted / "model.zip")
    observations = np.random.default_rng(0).uniform(-10, 10, (300, 2)).astype(np.float32)
    alone = [policy(observation[None])[0] for observation in observations]
    assert np.array_equal(policy(observations), alone)


def test_a_row_cut_short_by_a_kill_is_dropped(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text(",".join(COLUMNS) + "\n10,0,0,1.0,5,0,ego,0.0,0.0\n30,0,1,1.0,5,0,ego,0.0,0.0\n1")
    truncate_curve(path, 20)
    assert path.read_text().split() == [",".join(COLUMNS), "10,0,0,1.0,5,0,ego,0.0,0.0"]


@pytest.mark.parametrize("n_envs", [1, 2, 3, 5, 6, 16, 100])
@pytest.mark.parametrize("total", [1, 64, 50_000])
def test_batches_are_equal_and_totals_are_whole_rollouts(monkeypatch, n_envs, total):
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 8192)
    rollout = n_envs * rollout_steps(n_envs, total)
    assert rollout % rss_shield.agents.ppo.BATCHES == 0
    assert rollout <= max(8192, rss_shield.agents.ppo.BATCHES * n_envs)
    assert total <= learner().rounded(n_envs, total) < total + rollout


def test_blocks_have_different_seeds_that_leave_room_for_test_seeds():
    seeds = {block_seed(seed, timesteps) for seed in range(20) for timesteps in range(0, 76800, 768)}
    assert len(seeds) == 2000
    assert max(seeds) < 2**29 < 10**9
