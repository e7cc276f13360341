"""What may go wrong between the world and the policy: sensing systems. Defs. 28-32, Lemma 7, Corollary 3.

A sensing system is good enough if what the policy loses by it is small, with high probability; how near it measures
is not the point. Confidence intervals of the estimates are the caller's: here are the counts.
"""

import numpy as np

from rss_shield.shield._numba.compiled import choose, compiled_for_arrays, larger

MILD, MEDIUM, GROSS = range(3)  # levels of eps in Def. 28


# ---------------------------------------------------------------- Def. 28: probably approximately correct


@compiled_for_arrays
def policy_losses(q_true, q_sensed):
    """What a policy loses by acting on what is sensed: Q(s, pi(s)) - Q(s, pi(s^)) for each decision, >= 0.

    Args:
      q_true: `[N, A]` value of each action in the true state.
      q_sensed: `[N, A]` value of each action in the sensed state; the policy takes the best, the first of equals.
    """
    losses = np.empty(len(q_true))
    for n in range(len(q_true)):
        losses[n] = np.max(q_true[n]) - q_true[n, np.argmax(q_sensed[n])]
    return losses


@compiled_for_arrays
def losses_beyond(losses, eps):
    """How many of the losses `[N]` are beyond each level of `eps` `[3]`: the counts that estimate delta, `[3]` ints."""
    counts = np.zeros(len(eps), np.int64)
    for k in range(len(eps)):
        counts[k] = np.sum(losses > eps[k])
    return counts


@compiled_for_arrays
def is_pac(share, delta):
    """Def. 28: is a sensing system PAC, if at most these shares `[3]` of losses are beyond mild, medium and gross eps?

    Pass upper confidence bounds to be sure of it. delta: `[3]` admitted shares, decreasing.
    """
    return bool(np.all(share <= delta))


@compiled_for_arrays
def relative_error(error, distance):
    """eps-ego-accuracy: error of a position relative to the distance from the ego [1]. Small values don't imply PAC."""
    return np.abs(error) / np.abs(distance)


@compiled_for_arrays
def braking_before(v, distance):
    """Constant braking that stops a car of speed `v` within a distance [m/s^2]: what a lane error may call for."""
    return v**2 / (2 * distance)


# ---------------------------------------------------------------- Defs. 29-31, Lemma 7: semantic units


@compiled_for_arrays
def semantic_position(s, offset, width):
    """Def. 29: (longitudinal [m], lateral [lane widths]) position of a point, by its offset from the lane's centre.

    The published formula divides the curve point by the width; the offset is meant.

    Args:
      s, offset: along and across the lane's centre [m].
      width: of the lane there [m].
    """
    return s, offset / width


@compiled_for_arrays
def semantic_velocity(v, u, offset, width, widening=0.0):
    """Def. 29: derivatives of the semantic position: ([m/s], [lane widths/s]).

    Args:
      v, u: speeds along and across the lane's centre [m/s].
      widening: change of the lane's width per metre of the centre [1].
    """
    return v, (u - offset / width * widening * v) / width


@compiled_for_arrays
def longitudinal_error(p, p_sensed):
    """Def. 30: longitudinal semantic error, relative beyond 1 m [1]."""
    return np.abs(p - p_sensed) / larger(np.abs(p), 1.0)


@compiled_for_arrays
def lateral_error(p, p_sensed):
    """Def. 30: lateral semantic error [lane widths]."""
    return np.abs(p - p_sensed)


@compiled_for_arrays
def semantic_error(lon, lat, lon_sensed, lat_sensed):
    """Def. 30: largest semantic error over relevant objects and lanes; all arguments `[N]`, none: 0."""
    largest = 0.0
    for n in range(len(lon)):
        largest = max(largest, longitudinal_error(lon[n], lon_sensed[n]), lateral_error(lat[n], lat_sensed[n]))
    return largest


@compiled_for_arrays
def lipschitz_constant(q_true, q_sensed, errors):
    """Def. 31: smallest L with |Q(s, a) - Q(s^, a)| <= L semantic error, for all `[N]` states and `[A]` actions seen.

    Args:
      q_true, q_sensed: `[N, A]`.
      errors: `[N]` semantic errors; inf where a state without error has another value.
    """
    largest = 0.0
    for n in range(len(errors)):
        change = np.max(np.abs(q_true[n] - q_sensed[n]))
        if change > 0.0:
            largest = max(largest, change / errors[n] if errors[n] > 0.0 else np.inf)
    return largest


@compiled_for_arrays
def accuracy_for(eps, lipschitz):
    """Lemma 7: semantic accuracy that keeps the loss within `eps` if Q is `lipschitz`-semantic-Lipschitz."""
    return eps / (2 * lipschitz)


# ---------------------------------------------------------------- Def. 32, Corollary 3: redundancy


@compiled_for_arrays
def dependence(p_both, p_1, p_2):
    """Def. 32: smallest c for which two failures are one-sided c-approximately independent: P[both] <= c P[1] P[2].

    Args:
      p_both, p_1, p_2: rates, floats or arrays; from n trials that is n k_both / (k_1 k_2).

    Returns:
      c; 0 where both never fail at once.
    """
    return p_both / choose(p_both > 0.0, p_1 * p_2, 1.0)


@compiled_for_arrays
def majority(first, second, third):
    """What two of three subsystems say: bools or arrays of bools."""
    return (first & second) | (first & third) | (second & third)


@compiled_for_arrays
def joint_failure_bound(p, c):
    """Corollary 3: bound of the rate at which two of three subsystems miss, or see a ghost, at once: 6 c p^2.

    Args:
      p: rate of safety-critical misses, and of safety-critical ghosts, of each subsystem; per decision or per hour.
      c: dependence of any two of them within each kind.
    """
    return 6 * c * p**2


@compiled_for_arrays
def joint_miss_bound(p, c):
    """The same for one kind of failure alone: 3 c p^2."""
    return 3 * c * p**2


@compiled_for_arrays
def failure_rate_for(target, c):
    """Corollary 3 the other way round: rate per subsystem whose joint failure bound is `target`."""
    return np.sqrt(target / (6 * c))


@compiled_for_arrays
def decisions_to_see(rate):
    """How many decisions see one failure of a rate on average: what validation of one subsystem costs."""
    return 1.0 / rate
