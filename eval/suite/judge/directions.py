"""Which way does the road of a log without lanes run? As most users drive, and at times a doubt is left."""

import numpy as np

from rss_shield.shield.trace import Lane, Trace, straight_lane

_OPEN = 1000.0  # a log without lanes has one along its users, and so much longer at either end [m]
_VOTE = 20.0  # whoever has driven as far has one vote, whoever has driven less a part of it [m]
_ENOUGH = 0.4  # of the votes for another direction leave a doubt: two users of five do, one of three does not
_ALIKE = 1e-4  # directions that differ by less are one: 3 mm/s across at 30 m/s [rad]
_STEPS = 5  # of the search for the headings that agree
_TIED = 1e-9  # of two directions that fit as well as each other [rad]


def directions(trace: Trace) -> tuple[float, ...]:
    """Directions in which the road may run [rad], the most likely one first; one alone if there is no doubt.

    Every user has a vote, spread over its headings by the way driven in them; who drives the other way is on the same
    road. The most likely direction is their median: while more than half of the votes are for driving straight, it does
    not matter how far others swerve. Others are possible, too, if enough votes are for them or for those beyond. Of
    these the outermost are told: what somebody does across the road grows or shrinks all the way from one to the other.

    Args:
      trace: `Trace`.
    """
    u = trace.users
    if not u.present.any():
        return (0.0,)
    ways = np.abs(np.where(u.present, u.speed, 0.0)) * trace.dt
    if not ways.any():
        ways = u.present.astype(float)
    votes = (ways / np.maximum(ways.sum(axis=0), _VOTE))[u.present]
    heading, way = u.heading[u.present], ways[u.present]
    best = _settled(_median(heading, votes), heading, votes)
    if (np.cos(heading - best) * way).sum() < 0.0:
        best += np.pi
    turned = _turned(heading - best)
    ends = -_reached(-turned, votes, _ENOUGH), _reached(turned, votes, _ENOUGH)
    return (best, *(best + end for end in ends if abs(end) > _ALIKE))


def lane_along(trace: Trace, direction: float) -> Lane:
    """One straight lane in a direction [rad], as wide as users of a log are apart across it, and then some."""
    u = trace.users
    x, y = u.x[u.present], u.y[u.present]
    cos, sin = np.cos(direction), np.sin(direction)
    along, across = x * cos + y * sin, -x * sin + y * cos
    middle = 0.5 * (across.min() + across.max())
    ends = [(s * cos - middle * sin, s * sin + middle * cos) for s in (along.min() - _OPEN, along.max() + _OPEN)]
    return straight_lane("road", ends[0], ends[1], width=float(np.ptp(across)) + 4.0)


def roads_of(trace: Trace) -> tuple[Trace, ...]:
    """The log on each road that it may have been on: as it is if it has lanes, else a lane in each of `directions`."""
    if trace.lanes:
        return (trace,)
    meta = {name: value for name, value in trace.meta.items() if name != "network"}  # that of lanes that are not there
    return tuple(trace.replaced(lanes=(lane_along(trace, one),), meta=meta) for one in directions(trace))


def _turned(angle: np.ndarray) -> np.ndarray:
    """Angles between lines that have no front, within a quarter turn [rad]."""
    return (angle + 0.5 * np.pi) % np.pi - 0.5 * np.pi


def _median(heading: np.ndarray, votes: np.ndarray) -> float:
    """Direction of the line from which headings differ least: least mean of absolute angles, weighted [rad].

    Between samples that mean is linear, so its least value is at one of them, or all along between two. Of several
    directions that fit alike the one nearest to the mean is taken: it is the same however a log is turned or mirrored.
    """
    order = np.argsort(heading % np.pi)
    angle, weight = (heading % np.pi)[order], votes[order] / votes.sum()
    round_about = np.concatenate([angle - np.pi, angle, angle + np.pi])
    weights = np.concatenate([[0.0], np.cumsum(np.tile(weight, 3))])
    moments = np.concatenate([[0.0], np.cumsum(np.tile(weight, 3) * round_about)])
    between = 0.5 * (angle + np.append(angle[1:], angle[0] + np.pi)) % np.pi
    tried = np.concatenate([angle, between])
    low, at, high = (np.searchsorted(round_about, tried + by) for by in (-0.5 * np.pi, 0.0, 0.5 * np.pi))
    misfit = tried * (2.0 * weights[at] - weights[low] - weights[high])
    misfit += moments[low] + moments[high] - 2.0 * moments[at]
    best = tried[misfit <= misfit.min() + _TIED]
    # ways that cross at right angles have no mean: then the direction in which all of them together get on
    mean = (votes * np.exp(2j * heading)).sum() / votes.sum()
    mean += 1e-3 * ((votes * np.exp(1j * heading)).sum() / votes.sum()) ** 2
    return float(best[np.abs(_turned(best - 0.5 * np.angle(mean))).argmin()])


def _settled(direction: float, heading: np.ndarray, votes: np.ndarray) -> float:
    """Median of those headings alone that are near it: where all are noisy, who swerves draws the first one aside."""
    for _ in range(_STEPS):
        turned = _turned(heading - direction)
        near = np.abs(turned) <= 2.0 * _reached(np.abs(turned), votes, 0.5) + _TIED
        turned, own = turned[near], votes[near]
        direction += 0.5 * (_reached(turned, own, 0.5) - _reached(-turned, own, 0.5))
    return direction


def _reached(turned: np.ndarray, votes: np.ndarray, share: float) -> float:
    """Largest angle that this share of the votes reaches or exceeds [rad]."""
    order = np.argsort(-turned)
    so_far = np.cumsum(votes[order]) / votes.sum()
    return float(turned[order][np.searchsorted(so_far, share - _TIED)])
