"""Intervals against published numbers, hand derivations, and their own promise of coverage."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.eval.stats import MANY, bootstrap_mean, bootstrap_median, clopper_pearson, paired_difference, wilson

# Newcombe (1998), Statistics in Medicine 17:857-872, Table I, method 3 (Wilson, uncorrected).
NEWCOMBE = [
    (81, 263, 0.2553, 0.3662),
    (15, 148, 0.0624, 0.1605),
    (0, 20, 0.0000, 0.1611),
    (1, 29, 0.0061, 0.1718),
]


@pytest.mark.parametrize(("k", "n", "low", "high"), NEWCOMBE)
def test_wilson_gives_the_published_intervals(k, n, low, high):
    interval = wilson(k, n)
    assert interval.value == k / n
    assert interval.n == n
    assert interval.low == pytest.approx(low, abs=5e-5)
    assert interval.high == pytest.approx(high, abs=5e-5)


# the same rows of Newcombe's Table I, method 5 (Clopper-Pearson)
EXACT = [(81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0000, 0.1684), (1, 29, 0.0009, 0.1776)]


@pytest.mark.parametrize(("k", "n", "low", "high"), EXACT)
def test_clopper_pearson_gives_the_published_intervals(k, n, low, high):
    interval = clopper_pearson(k, n)
    assert interval.value == k / n and interval.n == n
    assert interval.low == pytest.approx(low, abs=5e-5)
    assert interval.high == pytest.approx(high, abs=5e-5)


def test_clopper_pearson_of_no_success_solves_its_own_equation():
    # (1 - p)^n = alpha / 2
    assert clopper_pearson(0, 100).high == pytest.approx(1 - 0.025 ** (1 / 100))
    assert clopper_pearson(100, 100).low == pytest.approx(0.025 ** (1 / 100))
    assert (clopper_pearson(0, 0).low, clopper_pearson(0, 0).high) == (0.0, 1.0)
    with pytest.raises(ValueError, match="k = 3"):
        clopper_pearson(3, 2)


def test_wilson_of_no_success_ends_at_z_squared_over_n_plus_z_squared():
    # p = 0: |0 - q| = z sqrt(q (1 - q) / n)  =>  q = z^2 / (n + z^2); z = 1.959964, z^2 = 3.841459
    assert wilson(0, 60).low == 0.0
    assert wilson(0, 60).high == pytest.approx(3.841459 / 63.841459, abs=1e-6)
    assert wilson(60, 60).low == pytest.approx(60 / 63.841459, abs=1e-6)
    assert wilson(60, 60).high == 1.0


def test_wilson_of_no_trials_knows_nothing():
    interval = wilson(0, 0)
    assert math.isnan(interval.value)
    assert (interval.low, interval.high, interval.n) == (0.0, 1.0, 0)


@pytest.mark.parametrize(("k", "n"), [(-1, 5), (6, 5)])
def test_wilson_refuses_impossible_counts(k, n):
    with pytest.raises(ValueError, match=f"k = {k} is out of range: expected 0 <= k <= n = {n}"):
        wilson(k, n)


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
@settings(max_examples=100, deadline=None)
def test_wilson_contains_the_rate_and_mirrors_failures(kn):
    k, n = kn
    interval, mirrored = wilson(k, n), wilson(n - k, n)
    assert 0.0 <= interval.low <= interval.value <= interval.high <= 1.0
    assert interval.low == pytest.approx(1.0 - mirrored.high, abs=1e-12)


@pytest.mark.parametrize("p", [0.05, 0.2, 0.5])
def test_wilson_covers_the_true_rate_about_95_percent_of_the_time(p):
    # exact: sum the binomial probabilities of every k whose interval holds p
    n = 80
    covered = sum(
        math.comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(n + 1) if wilson(k, n).low <= p <= wilson(k, n).high
    )
    assert 0.93 <= covered <= 0.98


def test_the_bootstrap_median_of_three_values_spans_them():
    # A resample of 1, 2, 3 has median 1 when at least two of three draws are 1:
    # (1/3)^3 + 3 (1/3)^2 (2/3) = 7/27 = 26 % > 2.5 %, so both ends of the interval are extremes.
    assert bootstrap_median([1, 2, 3], np.random.default_rng(0)) == (2.0, 1.0, 3.0, 3, "episodes")


def test_the_bootstrap_mean_of_a_large_symmetric_sample_is_the_normal_interval():
    # values -1 and 1, 200 each: s = 1, so mean +- 1.96 / sqrt(400) = +-0.098
    interval = bootstrap_mean([-1] * 200 + [1] * 200, np.random.default_rng(0))
    assert interval.value == 0.0
    assert interval.low == pytest.approx(-0.098, abs=0.006)
    assert interval.high == pytest.approx(0.098, abs=0.006)


def test_the_bootstrap_mean_leans_toward_the_long_tail():
    interval = bootstrap_mean([0] * 30 + [1] * 5 + [10] * 2, np.random.default_rng(0))
    assert interval.high - interval.value > interval.value - interval.low > 0


def test_the_bootstrap_mean_covers_the_true_mean_about_95_percent_of_the_time():
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(100):
        interval = bootstrap_mean(rng.exponential(size=60), rng)
        covered += interval.low <= 1.0 <= interval.high
    assert 88 <= covered <= 100


def test_the_same_generator_gives_the_same_interval():
    sample = [1.0, 2.0, 4.0, 8.0]
    assert bootstrap_mean(sample, np.random.default_rng(3)) == bootstrap_mean(sample, np.random.default_rng(3))


@pytest.mark.parametrize("bootstrap", [bootstrap_mean, bootstrap_median])
def test_small_and_constant_samples_get_honest_intervals(bootstrap):
    rng = np.random.default_rng(0)
    assert bootstrap([2.5, 2.5, 2.5], rng) == (2.5, 2.5, 2.5, 3, "episodes")
    single, empty = bootstrap([2.5], rng), bootstrap([], rng)
    assert (single.value, single.n) == (2.5, 1)
    assert np.isnan(single[1:3]).all()
    assert empty.n == 0
    assert np.isnan(empty[:3]).all()


@pytest.mark.parametrize("n", [2, 3, 60])
def test_one_different_value_still_gets_an_interval(n):
    interval = bootstrap_mean([0.0] * (n - 1) + [1.0], np.random.default_rng(0))
    assert interval.low <= interval.value <= interval.high


@pytest.mark.parametrize("bootstrap", [bootstrap_mean, bootstrap_median])
@pytest.mark.parametrize("sample", [[1.0, math.nan, 2.0], [math.nan], [math.nan] * (MANY + 1)])
def test_what_is_not_known_is_refused(bootstrap, sample):
    with pytest.raises(ValueError, match="= nan: expected numbers"):
        bootstrap(sample, np.random.default_rng(0))


def test_pairing_removes_what_both_samples_share():
    shared = np.random.default_rng(0).normal(0, 100, size=50)
    interval = paired_difference(shared + 1, shared, np.random.default_rng(0))
    assert interval.value == pytest.approx(1.0)
    assert interval.high - interval.low < 1e-6


def test_paired_samples_must_have_one_length():
    with pytest.raises(ValueError, match="differ in length: 2 and 3"):
        paired_difference([1, 2], [1, 2, 3], np.random.default_rng(0))


def test_the_interval_of_very_many_values_is_the_bootstraps():
    values = np.random.default_rng(0).exponential(3.0, MANY + 1)
    many = bootstrap_mean(values, np.random.default_rng(1))
    fewer = bootstrap_mean(values[:-1], np.random.default_rng(1))
    assert many.value == values.mean()
    assert many.n == MANY + 1
    width = fewer.high - fewer.low
    assert abs(many.low - fewer.low) < 0.1 * width
    assert abs(many.high - fewer.high) < 0.1 * width
