"""Measures of episodes: the same on both simulators, and nothing else changes."""

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.eval.suite.scripted import play

SHARED = (
    "min_thw_ahead",
    "min_ttc_ahead",
    "max_drac_ahead",
    "min_pet",
    "near_misses",
    "standing_free",
    "impact_speed",
    "delta_v",
)
SEEDS = range(10**9, 10**9 + 3)


@pytest.mark.parametrize("environment", ["highway-fast-v0", "intersection-v0"])
@pytest.mark.parametrize("shield", ["override", "monitor"])
def test_both_simulators_measure_the_same(environment, shield):
    options = {"measures": True, "shield": shield}
    fast = play(environment, "random", options, SEEDS)
    stock = play(environment, "random", {**options, "backend": "highway-env"}, SEEDS)
    assert (fast["blame"] == stock["blame"]).all()
    for name in SHARED:
        np.testing.assert_allclose(fast[name], stock[name], rtol=1e-6, atol=1e-6, err_msg=name)
    assert (fast["frozen"] == stock["frozen"]).all()
    crashed = stock["crashed"].astype(bool)
    assert ((stock["impact_speed"] > 0) <= crashed).all()
    if shield == "monitor":
        assert crashed.any() and (stock["impact_speed"][crashed] > 0).all()


def test_measuring_changes_nothing():
    plain, measured = (make("highway-fast-v0", "monitor", measures=measures) for measures in (False, True))
    for env in (plain, measured):
        env.reset(seed=3)
    done = False
    while not done:
        (seen, reward, done, cut, info), (also, again, _, _, more) = plain.step(3), measured.step(3)
        assert np.array_equal(seen, also) and reward == again
        told = more.pop("measures")
        assert more.keys() == info.keys() and more["blame"] == info["blame"]
        done = done or cut
    assert info["blame"] == "ego" and told["violation_ego"] > told["violation_other"] >= 0.0
    assert told["shield_time"] > 0.0 and told["impact_speed"] > 0.0


def test_the_shield_leaves_no_violation_of_the_egos():
    played = play("highway-fast-v0", "faster", {"measures": True, "backend": "highway-env"}, range(3))
    assert (played["violation_ego"] == 0.0).all()


@pytest.mark.parametrize("value", [1, "yes"])
def test_bad_values_are_refused(value):
    with pytest.raises(ValueError, match="measures = "):
        make("highway-fast-v0", measures=value)
    with pytest.raises(ValueError, match="measures = "):
        make_vec("highway-fast-v0", 1, measures=value)
