"""Def. 28: a sensing system is good enough if the policy loses little by it; near enough is another matter."""

import numpy as np
import pytest

from rss_shield.eval.stats import clopper_pearson
from rss_shield.shield.definitions.sensing import (
    GROSS,
    MEDIUM,
    MILD,
    braking_before,
    is_pac,
    losses_beyond,
    policy_losses,
    relative_error,
)

EPS = np.array([0.1, 1.0, 10.0])


def test_a_policy_that_sees_the_truth_loses_nothing():
    q = np.random.default_rng(1).normal(size=(50, 6))
    assert np.all(policy_losses(q, q) == 0.0)
    # nor does one whose errors change no decision
    assert np.all(policy_losses(q, 3.0 * q - 7.0) == 0.0)


def test_a_loss_is_what_the_wrong_action_costs_in_the_true_state():
    q_true = np.array([[1.0, 5.0, 2.0], [0.0, -1.0, 3.0]])
    q_sensed = np.array([[9.0, 5.0, 2.0], [0.0, 8.0, 3.0]])
    np.testing.assert_allclose(policy_losses(q_true, q_sensed), [4.0, 4.0])
    assert np.all(policy_losses(q_true, -q_sensed) >= 0.0)


def test_losses_are_counted_beyond_each_level():
    losses = np.array([0.0, 0.1, 0.5, 2.0, 50.0])
    counts = losses_beyond(losses, EPS)
    assert list(counts[[MILD, MEDIUM, GROSS]]) == [3, 2, 1]


def test_it_is_pac_if_no_share_is_above_what_is_admitted():
    delta = np.array([0.1, 0.01, 0.001])
    assert is_pac(np.array([0.1, 0.01, 0.001]), delta)
    assert not is_pac(np.array([0.0, 0.0, 0.002]), delta)


@pytest.mark.slow
def test_its_estimate_covers_the_true_shares_as_often_as_it_says():
    # decisions lose 0.5, 2 or 20 in 5, 1 and 0.2 per cent of cases: beyond the levels in 6.2, 1.2 and 0.2 per cent
    rng = np.random.default_rng(2)
    truth, n, runs = np.array([0.062, 0.012, 0.002]), 2000, 300
    covered = np.zeros(3)
    for _ in range(runs):
        losses = rng.choice([0.0, 0.5, 2.0, 20.0], n, p=[0.938, 0.05, 0.01, 0.002])
        bounds = [clopper_pearson(int(k), n, 0.9) for k in losses_beyond(losses, EPS)]
        covered += [bound.low <= p <= bound.high for bound, p in zip(bounds, truth, strict=True)]
    assert np.all(covered / runs >= 0.9 - 3 * np.sqrt(0.09 / runs))


def test_a_small_relative_error_may_cost_a_great_deal():
    # at 30 m/s a car stands on the shoulder 150 m ahead; measured 5 m to the side, 3.3 per cent, it stands in the lane
    assert relative_error(5.0, 150.0) < 0.034
    needed = braking_before(30.0, 150.0)
    assert needed == pytest.approx(3.0)
    go_on, brake = 0.0, -needed  # values of both actions on a free road, by comfort
    q_true = np.array([[go_on, brake]])
    q_sensed = np.array([[-1000.0, brake]])  # as if one would hit it
    assert policy_losses(q_true, q_sensed)[0] == pytest.approx(3.0)
    # the same error a little less far to the side changes nothing
    assert policy_losses(q_true, q_true)[0] == 0.0
