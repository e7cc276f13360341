"""Measured: what a policy loses by what it senses, and how often two of three subsystems fail at once."""

import numpy as np
import pytest

from rss_shield.eval.suite.sensing import pac_estimate, simulate_redundancy

EPS = np.array([0.1, 0.5, 1.0])


def test_losses_become_shares_with_exact_intervals():
    # ten decisions: two take the second best action, worth 0.3 less; one the worst, 2 less
    q_true = np.tile([1.0, 0.7, -1.0], (10, 1))
    q_sensed = q_true.copy()
    q_sensed[:2] = [0.0, 1.0, 0.0]
    q_sensed[2] = [0.0, 0.0, 1.0]
    found = pac_estimate(q_true, q_sensed, EPS)
    assert found.mean_loss == pytest.approx((2 * 0.3 + 2.0) / 10)
    assert [share.value for share in found.beyond] == pytest.approx([0.3, 0.1, 0.1])
    # Clopper-Pearson of 1 in 10 at 95 %: 0.0025 to 0.4450
    assert found.beyond[2].low == pytest.approx(0.0025, abs=1e-4)
    assert found.beyond[2].high == pytest.approx(0.4450, abs=1e-4)
    assert found.holds_for([0.7, 0.5, 0.45]) and not found.holds_for([0.7, 0.5, 0.44])


def test_without_errors_nothing_is_lost():
    q = np.random.default_rng(0).random((300, 5))
    found = pac_estimate(q, q, EPS)
    assert found.mean_loss == 0.0 and found.beyond[0].high < 0.0123  # 1 - 0.025^(1/300)


@pytest.mark.parametrize(
    ("shape", "eps", "message"),
    [((3, 5), [0.1, 0.5, 0.5], "three losses"), ((4, 5), EPS, "expected the same"), ((0, 5), EPS, "N > 0")],
)
def test_nonsense_is_refused(shape, eps, message):
    with pytest.raises(ValueError, match=message):
        pac_estimate(np.zeros((3, 5)) if shape[0] else np.zeros((0, 5)), np.zeros(shape), np.array(eps))


def test_independent_subsystems_fail_together_as_the_corollary_says():
    # c = 1: exactly, two of three err with 3 p^2 - 2 p^3 of each kind
    p = 0.01
    found = simulate_redundancy(1_000_000, p, p, 0.0, np.random.default_rng(1))
    assert found.dependence.low < 1.0 < found.dependence.high
    exact = 1.0 - (1.0 - (3 * p**2 - 2 * p**3)) ** 2
    assert found.joint.low < exact < found.joint.high
    # the largest of six measured rates is a little more than p
    assert found.holds and 6 * p**2 < found.bound.value < 1.15 * 6 * p**2


def test_common_causes_are_seen_in_c_and_the_bound_holds_with_it():
    # half of the failures move to a tenth of the decisions: E[f^2] = 0.1 5.5^2 + 0.9 0.5^2 = 3.25
    found = simulate_redundancy(1_000_000, 0.01, 0.01, 0.5, np.random.default_rng(2))
    assert found.dependence.low < 3.25 < found.dependence.high * 1.02
    assert found.joint.low > 6 * 0.01**2 * 1.5  # far more than if they were independent
    assert found.holds


def test_rates_that_are_none_are_refused():
    with pytest.raises(ValueError, match=r"miss = 0\.2: expected"):
        simulate_redundancy(10, 0.2, 0.0, 1.0, np.random.default_rng(0))
