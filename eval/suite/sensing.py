"""How good a sensing system is, measured: what a policy loses by it (Def. 28), and how redundant subsystems are (Def.
32).

Counts become rates with exact intervals here; the definitions are in `rss_shield.shield.definitions.sensing`.
"""

import itertools
from typing import NamedTuple

import numpy as np

from rss_shield.eval.stats import Interval, clopper_pearson
from rss_shield.shield.definitions.sensing import (
    dependence,
    is_pac,
    joint_failure_bound,
    losses_beyond,
    majority,
    policy_losses,
)

CHUNK = 1_000_000  # decisions at a time
RESAMPLES = 2000
DECISIONS = "decisions"  # what intervals are over


class PacEstimate(NamedTuple):
    """What a policy loses by acting on what is sensed (Def. 28)."""

    mean_loss: float
    eps: np.ndarray  # `[3]` mild, medium and gross
    beyond: tuple[Interval, ...]  # share of decisions that lose more, for each level; exact, Clopper-Pearson

    def holds_for(self, delta: np.ndarray) -> bool:
        """Is the system PAC for admitted shares `[3]`, with the confidence of the intervals for each level?"""
        return bool(is_pac(np.array([share.high for share in self.beyond]), np.asarray(delta, float)))


def pac_estimate(q_true: np.ndarray, q_sensed: np.ndarray, eps: np.ndarray, confidence: float = 0.95) -> PacEstimate:
    """Estimate of Def. 28 from independent decisions.

    Args:
      q_true: `[N, A]` value of each action in the true state.
      q_sensed: `[N, A]` in the sensed state.
      eps: `[3]` losses, increasing.
      confidence: of each interval.

    Raises:
      ValueError: other shapes, or eps that doesn't increase.
    """
    q_true, q_sensed, eps = (np.ascontiguousarray(values, float) for values in (q_true, q_sensed, eps))
    if q_true.ndim != 2 or q_true.shape != q_sensed.shape or not len(q_true):
        raise ValueError(f"q_true {q_true.shape}, q_sensed {q_sensed.shape}: expected the same [N, A] with N > 0")
    if eps.shape != (3,) or not (eps[0] >= 0.0 and (np.diff(eps) > 0.0).all()):
        raise ValueError(f"eps = {eps.tolist()}: expected three losses >= 0 that increase")
    losses = policy_losses(q_true, q_sensed)
    counts = losses_beyond(losses, eps)
    beyond = tuple(clopper_pearson(int(count), len(losses), confidence) for count in counts)
    return PacEstimate(float(losses.mean()), eps, beyond)


class Redundancy(NamedTuple):
    """Three subsystems, of which two have to agree (Corollary 3)."""

    decisions: int
    rate: Interval  # p: the largest of the six rates of single failures
    dependence: Interval  # c, over all pairs and kinds together: sum of P[both] / sum of P[one] P[other]
    joint: Interval  # share of decisions on which the majority misses something or sees a ghost
    bound: Interval  # 6 c p^2, from the same counts; its interval is a bootstrap over decisions

    @property
    def holds(self) -> bool:
        """Is what was measured within the bound, both by their counts?"""
        return self.joint.value <= self.bound.value


def simulate_redundancy(
    decisions: int, miss: float, ghost: float, common: float, rng: np.random.Generator, hard: float = 0.1
) -> Redundancy:
    """Safety-critical misses and ghosts of three subsystems with common causes.

    A share `hard` of the decisions is hard for all three at once (fog, spray, low sun). Single failures are as
    frequent as said on average, and `common` of what is the others' share moves there: 0 = independent, 1 = they fail
    only there.

    Args:
      decisions: how many.
      miss, ghost: rate of safety-critical misses and of safety-critical ghosts of each subsystem, per decision.
      common: from 0 to 1.
      rng: all numbers are drawn from it.
      hard: share of hard decisions.

    Raises:
      ValueError: rates that are none.
    """
    harder = 1.0 + common * (1.0 / hard - 1.0)
    for name, rate in (("miss", miss), ("ghost", ghost), ("common", common)):
        if not 0.0 <= rate <= 1.0 or (name != "common" and rate * harder > 1.0):
            raise ValueError(f"{name} = {rate!r}: expected a share from 0 to 1, and at most 1 when it is hard")
    patterns = np.zeros((2, 8), np.int64)  # of which subsystems fail, misses and ghosts
    joint = 0
    for first in range(0, decisions, CHUNK):
        n = min(CHUNK, decisions - first)
        times = np.where(rng.random(n) < hard, harder, 1.0 - common)
        wrong = np.zeros(n, bool)
        for kind, rate in enumerate((miss, ghost)):
            events = rng.random((3, n)) < rate * times
            patterns[kind] += np.bincount(events[0] + 2 * events[1] + 4 * events[2], minlength=8)
            wrong |= majority(*events)
        joint += int(wrong.sum())
    return _summed_up(decisions, patterns, joint, rng)


def _summed_up(n: int, patterns: np.ndarray, joint: int, rng: np.random.Generator) -> Redundancy:
    singles, c, bound = _rates(n, patterns)
    drawn = [_rates(n, np.array([rng.multinomial(n, one / n) for one in patterns])) for _ in range(RESAMPLES)]
    intervals = []
    for value, values in ((c, [one[1] for one in drawn]), (bound, [one[2] for one in drawn])):
        low, high = np.quantile(values, (0.025, 0.975))
        intervals.append(Interval(value, float(low), float(high), n, DECISIONS))
    rate, both = (clopper_pearson(int(k), n)._replace(over=DECISIONS) for k in (singles.max(), joint))
    return Redundancy(n, rate, intervals[0], both, intervals[1])


def _rates(n: int, patterns: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Single failures `[2, 3]`, c and 6 c p^2, of counts `[2, 8]` of which subsystems fail."""
    fails = np.array([[(pattern >> k) & 1 for pattern in range(8)] for k in range(3)])
    singles = patterns @ fails.T
    both = expected = 0.0
    for i, j in itertools.combinations(range(3), 2):
        both += float((patterns @ (fails[i] * fails[j])).sum())
        expected += float(singles[:, i] @ singles[:, j])
    c = float(dependence(both * n, expected, 1.0))
    return singles, c, float(joint_failure_bound(singles.max() / n, c))
