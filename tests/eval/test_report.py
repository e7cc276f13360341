"""What a run writes is read back as it was, by our code and by pandas without options."""

import numpy as np
import pandas as pd
import pytest

from rss_shield.eval.report import read_cell, write_cell
from rss_shield.eval.rollout import NO_CONTACT, evaluate
from tests.fake_env import brake, go, untouched_vec


@pytest.mark.parametrize("policy", [go, brake])
def test_episodes_come_back_from_their_file_as_they_were(policy, tmp_path):
    episodes = evaluate(untouched_vec, policy, range(50, 62), n_envs=4).drop(columns="actions")
    episodes["return"] = np.random.default_rng(0).normal(0, 30, len(episodes))
    write_cell(tmp_path / "episodes" / "a.csv", episodes, "shielded", 3, "off")
    expected = episodes.assign(train="on", test="off", train_seed=3)
    pd.testing.assert_frame_equal(read_cell(tmp_path / "episodes" / "a.csv"), expected, check_exact=True)
    plain = pd.read_csv(tmp_path / "episodes" / "a.csv")
    assert not plain.isna().any(axis=None)
    assert (NO_CONTACT in set(plain["blame"])) == (policy is brake)
