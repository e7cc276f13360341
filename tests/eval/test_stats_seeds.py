"""Seeds and episodes, pairs, runs, many comparisons: against numbers worked by hand and against other libraries."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from rss_shield.eval.stats import (
    RUNS,
    SEEDS,
    benjamini_hochberg,
    cluster_bootstrap,
    cluster_difference,
    holm,
    interquartile_mean,
    mcnemar,
    pareto_front,
    performance_profile,
    pooled_bootstrap,
    probability_of_improvement,
    student,
)


def generator(seed=0):
    return np.random.default_rng(seed)


# ---------------------------------------------------------------- seeds x episodes


def test_seeds_without_spread_in_their_episodes_give_students_interval_of_their_values():
    # episodes of a seed are all alike, so a resample is one of the seeds' values alone: its standard error is
    # sqrt((S-1)/S) s / sqrt(S), which sqrt(S/(S-1)) turns into s / sqrt(S), Student's
    values = [1.0, 2.0, 4.0, 7.0]
    interval = cluster_bootstrap([[v] * 10 for v in values], generator(), resamples=200_000)
    expected = student(values)
    assert interval.value == 3.5 and interval.n == 4 and interval.over == SEEDS
    assert interval.low == pytest.approx(expected.low, abs=0.05)
    assert interval.high == pytest.approx(expected.high, abs=0.05)


def test_seeds_that_agree_are_known_no_better_than_their_episodes():
    # two seeds, episodes -1 and 1 in equal parts, K = 100: the standard error over 200 episodes is 1 / sqrt(200); the
    # bootstrap's, sqrt(2/1) wider, is 0.1; t(1 degree) = 12.706
    sample = [-1.0, 1.0] * 50
    interval = cluster_bootstrap([sample, sample], generator(), resamples=200_000)
    assert interval.value == 0.0
    assert interval.high == pytest.approx(12.706 * 0.1, rel=0.02)


def test_every_seed_weighs_the_same_however_many_episodes_it_has():
    assert cluster_bootstrap([[0.0], [1.0] * 9], generator()).value == 0.5


def test_a_statistic_of_the_episodes_may_be_any():
    interval = cluster_bootstrap([[0, 1, 9], [2, 3, 99]], generator(), np.median)
    assert interval.value == 2.0


def test_pooled_every_episode_weighs_the_same_whichever_seed_it_is_of():
    assert pooled_bootstrap([[0.0], [1.0] * 9], generator()).value == 0.9
    interval = pooled_bootstrap([[0, 1, 9], [2, 3, 99]], generator(), np.median)
    assert interval.value == 2.5  # of 0, 1, 2, 3, 9, 99
    assert interval.low < 2.5 < interval.high and interval.n == 2 and interval.over == SEEDS


def test_pooled_means_of_equally_many_episodes_are_those_of_the_seeds():
    seeds = generator(1).normal(0, 1, (4, 30))
    assert pooled_bootstrap(seeds, generator()) == cluster_bootstrap(seeds, generator())


def test_pooled_seeds_that_are_each_of_one_value_have_the_scatter_of_the_draws():
    # 1 and 3 episodes of values 0 and 1: of 0-0, 0-1, 1-0, 1-1 the pooled means are 0, 3/4, 3/4, 1, whose standard
    # deviation is sqrt(17/32 - 25/64) = 3/8; sqrt(2/1) wider, times t(1 degree) = 12.706
    interval = pooled_bootstrap([[0.0], [1.0] * 3], generator(), resamples=20_000)
    assert interval.value == 0.75
    assert interval.high - 0.75 == pytest.approx(12.706 * math.sqrt(2) * 0.375, rel=0.02)


def test_one_seed_says_nothing_about_others():
    interval = cluster_bootstrap([[1.0, 2.0]], generator())
    assert interval.value == 1.5 and math.isnan(interval.low) and math.isnan(interval.high)
    assert math.isnan(cluster_bootstrap([], generator()).value)


def test_a_seed_without_episodes_is_refused():
    with pytest.raises(ValueError, match=r"episodes per seed = \[1, 0\]"):
        cluster_bootstrap([[1.0], []], generator())


def test_what_arms_share_on_an_episode_cancels():
    shared = generator(1).normal(0, 50, (3, 40))
    interval = cluster_difference(shared + 2.0, shared, generator())
    assert interval.value == pytest.approx(2.0) and interval.high - interval.low < 1e-9
    with pytest.raises(ValueError, match="differ in shape"):
        cluster_difference([[1.0, 2.0]], [[1.0]], generator())


# ---------------------------------------------------------------- pairs


def test_mcnemar_counts_what_only_one_has():
    # 10 discordant, 9 to 1: two-sided exact p = 2 (C(10,0) + C(10,1)) / 2^10 = 22 / 1024
    first = [1] * 9 + [0] + [1] * 5 + [0] * 5
    second = [0] * 9 + [1] + [1] * 5 + [0] * 5
    assert mcnemar(first, second) == (9, 1, 20, pytest.approx(22 / 1024))
    assert mcnemar([1, 0], [1, 0]).p == 1.0
    with pytest.raises(ValueError, match="differ in length: 2 and 1"):
        mcnemar([1, 0], [1])


# ---------------------------------------------------------------- many comparisons


def test_holm_and_benjamini_hochberg_by_hand():
    p = [0.01, 0.04, 0.03, 0.005]
    # Holm: 4 x 0.005, 3 x 0.01, 2 x 0.03, then max(0.06, 1 x 0.04)
    np.testing.assert_allclose(holm(p), [0.03, 0.06, 0.06, 0.02])
    # BH: 4/1 x 0.005 = 0.02, 4/2 x 0.01 = 0.02, 4/3 x 0.03 = 0.04, 4/4 x 0.04 = 0.04
    np.testing.assert_allclose(benjamini_hochberg(p), [0.02, 0.04, 0.04, 0.02])
    assert holm([]).size == 0
    with pytest.raises(ValueError, match="from 0 to 1"):
        holm([1.2])


# ---------------------------------------------------------------- runs x environments


def test_the_interquartile_mean_is_that_of_the_middle_half():
    # 8 scores; a quarter of them, 2, goes at each end: (2 + 3 + 4 + 5) / 4
    interval = interquartile_mean([[0, 1], [2, 3], [4, 5], [6, 1000]], generator())
    assert interval.value == 3.5 and interval.n == 4 and interval.over == RUNS
    assert interval.low <= 3.5 <= interval.high


def test_the_probability_of_improvement_counts_wins_and_halves_of_ties():
    # environment 1: {1, 3} against {0, 3}: 1>0, 1<3, 3>0, 3=3: 2.5 of 4; environment 2: always higher
    interval = probability_of_improvement([[1, 9], [3, 9]], [[0, 2], [3, 2]], generator())
    assert interval.value == pytest.approx((2.5 / 4 + 1.0) / 2)
    with pytest.raises(ValueError, match="environments differ: 2 and 1"):
        probability_of_improvement([[1, 2]], [[1]], generator())


def test_a_performance_profile_falls_from_everybody_to_nobody():
    profile = performance_profile([[1, 2], [3, 4]], [0, 1, 2.5, 4], generator())
    np.testing.assert_allclose(profile.value, [1.0, 0.75, 0.5, 0.0])
    assert (profile.low <= profile.value).all() and (profile.value <= profile.high).all()


@pytest.mark.parametrize("scores", [[], [1.0], [[np.nan]]])
def test_scores_are_a_full_table(scores):
    with pytest.raises(ValueError, match="scores have shape"):
        interquartile_mean(scores, generator())


def test_the_published_formulas_have_the_same_values():
    """Agarwal et al. (2021): the interquartile mean by sorting, P(X > Y) by the statistic of Mann and Whitney."""
    rng = generator(5)
    ours, theirs = rng.normal(1.0, 1.0, (8, 3)), rng.normal(0.5, 1.0, (5, 3)).round(1)
    middle = np.sort(ours.ravel())[6:18]
    assert interquartile_mean(ours, generator()).value == pytest.approx(middle.mean())
    u = [stats.mannwhitneyu(ours[:, t], theirs[:, t]).statistic / (8 * 5) for t in range(3)]
    assert probability_of_improvement(ours, theirs, generator()).value == pytest.approx(np.mean(u))
    taus = np.linspace(-1, 3, 9)
    shares = [np.mean([stats.ecdf(ours[:, t]).sf.evaluate(tau) for t in range(3)]) for tau in taus]
    np.testing.assert_allclose(performance_profile(ours, taus, generator()).value, shares)


# ---------------------------------------------------------------- Pareto front


def test_the_front_is_what_nothing_beats_in_everything():
    #         A       B       C: worse than B   D: as A   E: unknown
    points = [(0, 9), (1, 5), (2, 5), (0, 9), (np.nan, 0)]
    assert pareto_front(points).tolist() == [True, True, False, True, False]
    with pytest.raises(ValueError, match="shape"):
        pareto_front([1, 2])


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=20))
@settings(max_examples=60, deadline=None)
def test_everybody_is_on_the_front_or_beaten_by_somebody_on_it(points):
    front = pareto_front(points)
    assert front.any()
    for (x, y), on in zip(points, front, strict=True):
        beaten = any(a <= x and b <= y and (a, b) != (x, y) for (a, b), f in zip(points, front, strict=True) if f)
        assert on != beaten
