"""A learning curve of training that is cut into blocks shows the truth, however long episodes are."""

import csv
import itertools
from functools import partial

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from hypothesis import given, settings
from hypothesis import strategies as st
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import rss_shield.agents.curve
import rss_shield.agents.ppo
import rss_shield.eval.rollout
from rss_shield.agents.blocks import train_in_blocks
from rss_shield.agents.ppo import learner
from rss_shield.eval.plots import joined_bins
from rss_shield.eval.stats import completion_weights, weighted_mean, weighted_rate, wilson

LONGEST = 20
ENVS = 64


def early(rng: np.random.Generator) -> tuple[int, bool]:
    """30 % crash, sooner than others end."""
    return (int(rng.integers(1, LONGEST)), True) if rng.random() < 0.3 else (LONGEST, False)


def late(rng: np.random.Generator) -> tuple[int, bool]:
    """45 % crash at the very end, the others leave the road on the way."""
    return (LONGEST, True) if rng.random() < 0.45 else (int(rng.integers(1, LONGEST)), False)


def hazard(rng: np.random.Generator) -> tuple[int, bool]:
    """5 % of the decisions end in a crash: 1 - 0.95^20 = 64 % of the episodes."""
    age = int(rng.geometric(0.05))
    return (age, True) if age <= LONGEST else (LONGEST, False)


PROCESSES = [(early, 0.3), (late, 0.45), (hazard, 1 - 0.95**LONGEST)]


def trained(process, blocks: list[int], seed: int) -> pd.DataFrame:
    """Rows of a training of ENVS environments in blocks of so many decisions each; nothing is learned."""
    rng, rows, before = np.random.default_rng(seed), [], 0
    for decisions in blocks:
        for _ in range(ENVS):
            age = 0
            while age < decisions:
                length, crashed = process(rng)
                watched = min(length, decisions - age)
                cut = watched < length
                rows.append(
                    {
                        "started": (before + age) * ENVS,
                        "timesteps": (before + age + watched) * ENVS,
                        "length": watched,
                        "cut": int(cut),
                        "crashed": int(crashed and not cut),
                    }
                )
                age += watched
        before += decisions
    return pd.DataFrame(rows)


def points(curve: pd.DataFrame, bins: int = 10):
    for _, _, inside in joined_bins(curve, np.linspace(0, curve["timesteps"].max(), bins + 1)):
        yield weighted_rate(inside["crashed"], inside["weight"])


BLOCKS = [[48, 48, 48, 16], [30] * 6, [200, 200], [25, 40, 25, 40, 25, 40]]


@pytest.mark.parametrize("blocks", BLOCKS, ids=str)
@pytest.mark.parametrize(("process", "truth"), PROCESSES, ids=["early", "late", "hazard"])
def test_every_point_of_a_curve_is_the_true_crash_rate_within_its_band(process, truth, blocks):
    seen = [point for seed in range(20) for point in points(trained(process, blocks, seed))]
    assert len(seen) >= 20
    assert np.mean([point.value for point in seen]) == pytest.approx(truth, abs=0.02)
    assert np.mean([point.low <= truth <= point.high for point in seen]) > 0.9


def test_finished_episodes_alone_would_lie():
    curve = trained(early, [48, 48, 48, 16], seed=0)
    ends = curve[curve["cut"] == 0]
    tenth = curve["timesteps"].max() / 10
    assert ends.loc[ends["timesteps"] <= tenth, "crashed"].mean() == 1.0
    assert ends.loc[ends["timesteps"] > 9 * tenth, "crashed"].mean() == 1.0


@pytest.mark.parametrize("bins", [1, 3, 10, 40])
@pytest.mark.parametrize("blocks", BLOCKS, ids=str)
def test_every_episode_is_in_one_bin(blocks, bins):
    curve = trained(hazard, blocks, seed=1)
    joined = joined_bins(curve, np.linspace(0, curve["timesteps"].max(), bins + 1))
    assert sorted(index for _, _, inside in joined for index in inside.index) == list(range(len(curve)))
    assert all(before[1] == after[0] for before, after in itertools.pairwise(joined))


def test_where_no_episode_can_be_finished_the_band_says_so():
    curve = trained(early, [5] * 8, seed=0)  # those who crash within 5 decisions of 20 end, nobody else does
    (point,) = points(curve)
    assert point.low < 5 / 19 * 0.3 < 0.3 < 0.99 < point.high


@given(st.lists(st.tuples(st.integers(1, 6), st.booleans()), min_size=1, max_size=40))
@settings(max_examples=100, deadline=None)
def test_the_weight_that_is_missing_is_that_of_episodes_cut_off_later_than_any_other_ended(episodes):
    lengths, cut = (np.array(column) for column in zip(*episodes, strict=True))
    weights = completion_weights(lengths, cut)
    assert (weights[cut] == 0).all()
    longest_cut = lengths[cut].max(initial=0)
    assert weights.sum() < 1 + 1e-12
    assert (abs(weights.sum() - 1) < 1e-12) == (
        lengths[~cut].max(initial=0) > longest_cut or not cut[lengths == longest_cut].any()
    )


def test_a_cut_off_episode_passes_its_weight_on_to_those_that_lasted_longer():
    # redistribution to the right by hand: 1/5 each; the second gives 1/5 in halves to the fourth and fifth
    weights = completion_weights([1, 2, 2, 3, 4], [0, 1, 0, 0, 0])
    assert weights.tolist() == pytest.approx([0.2, 0.0, 0.2, 0.3, 0.3])


def test_equal_weights_give_the_ordinary_statistics():
    sample = [0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert weighted_rate(sample, np.full(10, 0.1))[:4] == pytest.approx(wilson(2, 10)[:4])
    mean = weighted_mean([1.0, 2.0, 3.0, 6.0], np.full(4, 0.25))
    # variance 14 / 4 = 3.5; 1.96 sqrt(3.5 / 4) = 1.833
    assert mean[:4] == pytest.approx((3.0, 1.167, 4.833, 4), abs=1e-3)


def test_the_words_for_no_contact_are_the_same_in_training_and_testing():
    assert rss_shield.agents.curve.NO_CONTACT == rss_shield.eval.rollout.NO_CONTACT


class Process(gym.Env):
    """One of the processes above, whatever the agent does. Every decision is worth 1."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, process):
        self.process = process

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        super().reset(seed=seed)
        self.age, (self.end, self.crash) = 0, self.process(self.np_random)
        return np.zeros(1), self._info()

    def step(self, action):
        self.age += 1
        ended = self.age == self.end
        return np.zeros(1), 1.0, ended and self.crash, ended and not self.crash, self._info()

    def _info(self):
        crashed = self.crash and self.age == self.end
        return {"crashed": crashed, "blame": "ego" if crashed else "", "override_share": 0.25, "episode_cost": 0.5}


def process_vec(process, num_envs: int) -> SyncVectorEnv:
    make = partial(Process, process)
    return SyncVectorEnv([lambda: RecordEpisodeStatistics(make())] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)


@pytest.mark.parametrize(("process", "truth"), PROCESSES, ids=["early", "late", "hazard"])
def test_a_real_training_gives_the_true_crash_rate(process, truth, tmp_path, monkeypatch):
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 512)
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUTS_PER_BLOCK", 3)

    train_in_blocks(
        learner(), partial(process_vec, process), tmp_path, seed=2, total_timesteps=512 * 10, n_envs=32
    )  # blocks of 48, 48, 48, 16 decisions
    curve = pd.read_csv(tmp_path / "learning_curve.csv")
    decisions = curve["length"].sum()
    assert decisions == 512 * 10  # every decision belongs to one episode of the file
    assert (curve["return"] == curve["length"]).all()
    assert (curve["timesteps"] - curve["started"] == 32 * curve["length"]).all()
    assert set(curve.loc[curve["cut"] == 1, "timesteps"]) <= {1536, 3072, 4608, 5120}
    assert (curve["override_share"] == 0.25).all()
    assert set(curve["blame"]) == {"ego", "no contact"}
    whole = completion_weights(curve["length"], curve["cut"])
    assert weighted_rate(curve["crashed"], whole).value == pytest.approx(truth, abs=0.08)
    with open(tmp_path / "learning_curve.csv", newline="") as file:
        assert tuple(next(csv.reader(file))) == rss_shield.agents.curve.COLUMNS


def test_tensorboard_gets_rates_per_decision(tmp_path, monkeypatch):
    monkeypatch.setattr(rss_shield.agents.ppo, "ROLLOUT_STEPS", 512)
    train_in_blocks(learner(), partial(process_vec, hazard), tmp_path, seed=2, total_timesteps=5120, n_envs=32)
    events = EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    crashes = [event.value for event in events.Scalars("decision/crashes")]
    # a crash follows 5 % of the decisions, that at which the episode ends by itself included
    assert np.mean(crashes) == pytest.approx(0.05, abs=0.01)
    assert [event.value for event in events.Scalars("decision/reward")] == [1.0] * len(crashes)
