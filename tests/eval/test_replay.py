"""Replays on the original simulator: they agree with the engine, and a tampered record shows."""

from functools import partial

import pandas as pd
import pytest
from gymnasium.vector import AutoresetMode

import rss_shield
from rss_shield.eval.replay import chosen, compare, replay, verdict
from rss_shield.eval.rollout import evaluate

ENV = "highway-fast-v0"
CELL = {"train": "off", "test": "off", "train_seed": 0}


def alternate(observations):
    """Faster, or a lane to the left where there is a car close ahead."""
    return [0 if observation[1, 1] < 0.15 else 3 for observation in observations]


@pytest.fixture(scope="module", params=["monitor", "override"])
def played(request):
    """The same episodes in the engine and on highway-env."""
    make_vec = partial(rss_shield.make_vec, ENV, shield=request.param, autoreset_mode=AutoresetMode.DISABLED)
    episodes = evaluate(make_vec, alternate, range(40, 44), n_envs=3).assign(**CELL)
    return episodes, replay(partial(rss_shield.make, ENV, shield=request.param), episodes).assign(**CELL)


def test_every_number_of_a_replay_agrees(played):
    episodes, replays = played
    assert compare(episodes, replays)["agrees"].all()
    assert verdict(compare(episodes, replays)).startswith("Replayed on highway-env with the same actions: 4 of 4")
    expected = episodes[replays.columns].drop(columns="evidence")
    pd.testing.assert_frame_equal(replays.drop(columns="evidence"), expected, rtol=0, atol=1e-6, check_dtype=False)


@pytest.mark.parametrize(
    ("name", "tampered"), [("return", 1e-5), ("length", 1), ("crashed", None), ("blame", "somebody")]
)
def test_a_tampered_episode_is_found_and_named(played, name, tampered):
    episodes, replays = played
    episodes = episodes.copy()
    old = episodes.loc[2, name]
    episodes.loc[2, name] = {"crashed": not old, "blame": tampered}.get(name, old if tampered is None else tampered)
    if name in ("return", "length"):
        episodes.loc[2, name] = old + tampered
    compared = compare(episodes, replays)
    assert compared["agrees"].tolist() == [True, True, False, True]
    text = verdict(compared)
    assert "3 of 4 test episodes agree" in text
    assert "DISAGREES: train off, test off, training seed 0, episode 42: " + name in text


def test_tampered_actions_show_too(played):
    episodes, _ = played
    other = episodes.iloc[:1].assign(actions="4 4 4 4 4")
    replays = replay(partial(rss_shield.make, ENV, shield="monitor"), other).assign(**CELL)
    assert not compare(other, replays)["agrees"].any()


def test_the_seed_chooses_the_sample():
    episodes = pd.DataFrame({"seed": range(100)})
    drawn = chosen(episodes, 5, seed=1)["seed"].tolist()
    assert drawn == chosen(episodes, 5, seed=1)["seed"].tolist() == sorted(set(drawn))
    assert drawn != chosen(episodes, 5, seed=2)["seed"].tolist()
    assert len(chosen(episodes, 500, seed=1)) == 100
