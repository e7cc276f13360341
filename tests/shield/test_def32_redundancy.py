"""Def. 32, Corollary 3: two of three subsystems are seldom wrong at once."""

import itertools

import numpy as np
import pytest

from rss_shield.shield.definitions.sensing import (
    decisions_to_see,
    dependence,
    failure_rate_for,
    joint_failure_bound,
    joint_miss_bound,
    majority,
)

DECISIONS = 1_000_000


def failures(rng, p, common, n=DECISIONS):
    """`[3, n]` bool: each subsystem fails with probability about `p`, a part of it at times when all have it hard."""
    hard = rng.random(n) < 0.1
    rate = np.where(hard, p * (1 + 9 * common), p * (1 - common))
    return rng.random((3, n)) < rate


def measured_dependence(events):
    """Largest c over pairs of subsystems."""
    n = events.shape[1]
    pairs = itertools.combinations(events, 2)
    return max(dependence(float((a & b).sum()) * n, float(a.sum()), float(b.sum())) for a, b in pairs)


def test_the_majority_is_what_at_least_two_say():
    for votes in itertools.product([False, True], repeat=3):
        assert majority(*votes) == (sum(votes) >= 2)
    rng = np.random.default_rng(1)
    votes = rng.random((3, 1000)) < 0.5
    np.testing.assert_array_equal(majority(*votes), votes.sum(axis=0) >= 2)


@pytest.mark.parametrize("common", [0.0, 0.3, 1.0])
def test_corollary_3_bounds_the_joint_failures_of_a_million_decisions(common):
    rng = np.random.default_rng(2)
    p = 0.01
    misses, ghosts = failures(rng, p, common), failures(rng, p, common)
    largest = max(misses.mean(axis=1).max(), ghosts.mean(axis=1).max())
    c = max(measured_dependence(misses), measured_dependence(ghosts))
    joint = majority(*misses) | majority(*ghosts)
    assert joint.mean() <= joint_failure_bound(largest, c)
    assert majority(*misses).mean() <= joint_miss_bound(largest, c)
    # and no bound of another kind: it is used up to a good part, whatever the dependence
    assert joint.mean() > 0.6 * joint_failure_bound(largest, c)


def test_independent_subsystems_have_a_dependence_of_one_and_common_causes_more():
    rng = np.random.default_rng(3)
    assert measured_dependence(failures(rng, 0.02, 0.0)) == pytest.approx(1.0, abs=0.2)
    # all failures in a tenth of the time: 0.1 (10 p)^2 / p^2
    assert measured_dependence(failures(rng, 0.02, 1.0)) == pytest.approx(10.0, rel=0.2)


def test_the_bound_of_independent_subsystems_does_not_hold_for_dependent_ones():
    rng = np.random.default_rng(4)
    misses, ghosts = failures(rng, 0.01, 1.0), failures(rng, 0.01, 1.0)
    joint = (majority(*misses) | majority(*ghosts)).mean()
    assert joint > 3 * joint_failure_bound(0.01, 1.0)


def test_two_failures_that_never_meet_have_no_dependence():
    assert dependence(0.0, 0.1, 0.2) == 0.0
    assert dependence(0.0, 0.0, 0.2) == 0.0
    assert dependence(0.02, 0.1, 0.2) == pytest.approx(1.0)
    np.testing.assert_allclose(dependence(np.array([0.0, 0.1]), 0.2, 0.5), [0.0, 1.0])


def test_the_rate_for_a_target_inverts_the_bound():
    for c in (1.0, 2.5, 10.0):
        for target in (1e-9, 1e-6, 1e-3):
            p = failure_rate_for(target, c)
            assert joint_failure_bound(p, c) == pytest.approx(target, rel=1e-12)
            assert decisions_to_see(p) == pytest.approx((6 * c / target) ** 0.5, rel=1e-12)
