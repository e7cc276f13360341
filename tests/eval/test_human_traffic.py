"""The page about recorded traffic, from logs that were made up: it needs no library that reads the recorded ones."""

import numpy as np

from bench.human_traffic import followers_of, page_of
from rss_shield.eval.suite.judge.smoothing import filled_in
from rss_shield.shield.trace import Trace, straight_lane, users_of

DT = 0.1


def recorded(gap, noise=0.0):
    """Two cars one behind the other at 20 m/s, bumper to bumper [m], positions and nothing of commands."""
    rng, time = np.random.default_rng(0), np.arange(101) * DT
    x = np.column_stack([20.0 * time, 20.0 * time + gap + 5.0])
    x, y = x + rng.normal(0.0, noise, x.shape), rng.normal(0.0, noise, x.shape)
    still = np.zeros_like(x)
    users = users_of(["follower", "leader"], ["car"] * 2, 5.0, 2.0, x, y, still, still + 20.0)
    return Trace(DT, time, users, lanes=(straight_lane("a", (-50.0, 0.0), (600.0, 0.0)),))


def test_a_follower_has_its_gap_and_a_leader_follows_nobody():
    followers = followers_of({"log": filled_in(recorded(30.0))[0]})
    assert len(followers.gap) == 101 and set(followers.v) == {20.0}
    np.testing.assert_allclose(followers.gap, 30.0)


def test_the_page_says_who_is_too_near_and_does_not_brake():
    page = page_of({"near": recorded(12.0), "far": recorded(200.0, noise=0.05)}, 0)
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines()]
    shares = next(cells for cells in lines if cells[:2] == ["slides", "1"])
    assert shares[2].startswith("100%") and shares[3].startswith("0%")
    duties = {tuple(cells[:3]): cells[3:] for cells in lines if cells[0] == "slides" and cells[1] in ("near", "far")}
    assert duties["slides", "near", "rear"][:4] == ["1", "1", "1", "0"]  # 36 m are needed at least, by braking alone
    assert duties["slides", "far", "rear"][0] == "0"
