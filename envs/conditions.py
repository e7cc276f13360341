"""Roads that are wet, snowy or icy in places, and kinds of vehicles: what is asked for, checked where it enters."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rss_shield.envs.arguments import number
from rss_shield.envs.sensing import drawn
from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.ground import CLASSES, CONDITIONS, STATES, Ground, make_ground
from rss_shield.shield.params import Table

DRY, CAR = "dry", "car"
GROUP = 12  # what a vehicle's class is drawn for, beside the purposes of `envs.sensing`
_HARDEST = 3  # index of a_max_brake in a row


def pieces_of(conditions: Any) -> list[tuple[float, str]]:
    """Where each piece of a road begins [m], and its condition; what nobody names is dry.

    Args:
      conditions: None, one of `CONDITIONS` for all of the road, or a dict (from, to) -> one of them, in x [m].

    Raises:
      ValueError: an unknown name, a range that is none, or two ranges that overlap.
    """
    if conditions is None:
        return [(-math.inf, DRY)]
    if isinstance(conditions, str):
        return [(-math.inf, _known("conditions", conditions, CONDITIONS))]
    if not isinstance(conditions, Mapping):
        raise ValueError(
            f"conditions = {conditions!r}: expected None, one of {', '.join(CONDITIONS)}, or a dict of ranges in x [m]"
        )
    pieces: list[tuple[float, Any]] = []
    end = -math.inf
    for span, name in sorted(conditions.items(), key=lambda one: _span(one[0])):
        begin, until = _span(span)
        if begin < end:
            raise ValueError(f"conditions: the range {span!r} overlaps with one before it; expected ranges apart")
        if begin > end or not pieces:
            pieces.append((end, DRY))
        pieces.append((begin, _known(f"conditions[{span!r}]", name, CONDITIONS)))
        end = until
    if end < math.inf:
        pieces.append((end, DRY))
    return [piece for k, piece in enumerate(pieces) if k == len(pieces) - 1 or pieces[k + 1][0] > piece[0]]


def shares_of(classes: Any) -> dict[str, float]:
    """Share of each kind of vehicle among the others, cars first; they are what is left.

    Raises:
      ValueError: an unknown kind, a share out of range, or more than all.
    """
    if classes is None:
        return {CAR: 1.0}
    if not isinstance(classes, Mapping):
        raise ValueError(f"classes = {classes!r}: expected None or a dict of shares of {', '.join(CLASSES)}")
    given = {
        _known("classes", name, CLASSES): number(f"classes[{name!r}]", share, 0.0, 1.0)
        for name, share in classes.items()
    }
    rest = 1.0 - sum(share for name, share in given.items() if name != CAR)
    if rest < -1e-9 or (CAR in given and abs(given[CAR] - rest) > 1e-9):
        raise ValueError(f"classes = {dict(classes)!r}: expected shares that add up to at most 1, to 1 with cars")
    return {CAR: max(rest, 0.0)} | {name: share for name, share in given.items() if name != CAR}


def ground_of(table: Table, conditions: Any, classes: Any) -> Ground | None:
    """The ground of a road; None where everything on it is alike and dry."""
    if conditions is None and classes is None:
        return None
    shares = shares_of(classes)
    ground = make_ground(table, pieces_of(conditions), list(shares))
    return ground._replace(shares=np.cumsum(list(shares.values())))


def _known(what: str, name: Any, known: Any) -> str:
    if name not in known:
        raise ValueError(f"{what} = {name!r}: expected one of {', '.join(known)}")
    return str(name)


def _span(given: Any) -> tuple[float, float]:
    try:
        begin, end = (float(x) for x in given)
    except (TypeError, ValueError):
        begin = end = math.nan
    if not begin < end:
        raise ValueError(f"conditions has the range {given!r}: expected two places in x [m], the smaller first")
    return begin, end


@compiled
def group_of(key, i, shares):
    """Vehicle class of road user `i` in an episode: index into the classes of the road.

    Args:
      key: of the episode: the lower half of the state of its generator, once the scene is drawn.
      i: index of the vehicle.
      shares: `[C]` cumulative.
    """
    x, group = drawn(key, GROUP, 0, i), 0
    while group < len(shares) - 1 and x >= shares[group]:
        group += 1
    return group


@compiled
def held(acceleration, ground, x, group):
    """What a vehicle makes of a command: tyres hold it, and its brakes are those of its class [m/s^2].

    Args:
      acceleration: that is asked for [m/s^2].
      ground: `Ground`.
      x: where it is [m].
      group: its class, -1 = it is the ego.
    """
    piece = 0
    while piece < len(ground.starts) - 1 and ground.starts[piece + 1] <= x:
        piece += 1
    most = ground.grip[ground.roads[piece]]
    hardest = most if group < 0 else min(most, ground.other[STATES * group, _HARDEST])
    return min(max(acceleration, -hardest), most)
