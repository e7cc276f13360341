"""The driving safety field of a log, beside the judge."""

import numpy as np
import pandas as pd
import pytest

from rss_shield import make
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.eval.suite.judge.command import run
from rss_shield.eval.suite.judge.risk import risk_table
from rss_shield.shield.trace import save


@pytest.fixture(scope="module")
def episode():
    """A trace of full throttle without the shield, and the last info of the same episode."""
    env = make("highway-fast-v0", "monitor", risk=True)
    trace = record_trace(env, lambda observation: 3, seed=4)
    env.reset(seed=4)
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(3)
        done = terminated or truncated
    return trace, info


def test_a_log_says_what_infos_said(episode):
    trace, info = episode
    (row,) = risk_table(trace, trace.ego_users).to_dict("records")
    frames = round(sum(info[f"time_{name}"] for name in ("known_safe", "unknown", "known_unsafe")) / trace.dt)
    assert row["max_rdsi"] >= info["max_rdsi"] - 1e-9  # the trace goes on past the contact
    assert sum(row[f"time_{name}"] for name in ("known_safe", "unknown", "known_unsafe")) >= frames * trace.dt - 1e-9
    assert row["min_thw"] <= info["min_thw"] + 1e-9


def test_the_command_says_it_and_writes_it(episode, tmp_path, capsys):
    trace, _ = episode
    save(trace, tmp_path / "a.npz")
    run([str(tmp_path / "a.npz"), "--risk", "--ego", trace.users.ids[trace.ego_users[0]], "--out", str(tmp_path)])
    assert "RDSI up to" in capsys.readouterr().out
    written = pd.read_csv(tmp_path / "a-risk.csv")
    assert len(written) == 1 and np.isfinite(written["max_rdsi"]).all()
