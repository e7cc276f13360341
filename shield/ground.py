"""What the road and the kind of vehicle make of the published table: per place, per road user.

A road that runs along x is cut into pieces of one condition each (`ROADS`). Whoever drives there is held to what
holds where it will be: relied on is the worst grip along its stopping way, feared the best (`on_road`). Other kinds
of vehicles have parameters of their own. Both together are rows of arrays, and a road user's record says which row is
its own (`kind`).
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.kinematics import forward_reach
from rss_shield.shield.params import GRAVITY, ROADS, Road, RSSParams, Table, on_road
from rss_shield.shield.sampling import frames_for

CONDITIONS = tuple(ROADS)  # from the best grip to the worst
STATES = len(CONDITIONS) ** 2  # rows of one vehicle class: index of the worst times 4, and that of the best
MOST = len(CONDITIONS) * (len(CONDITIONS) - 1)  # among these the row of who needs most: worst relied on, best feared


class VehicleClass(NamedTuple):
    """How a kind of vehicle differs from a car."""

    braking: float  # relied on, relative to a car's [1]
    hardest: float  # feared, likewise [1]
    delay: float  # until it brakes, more than a car [s]


# Service brakes by UN Regulations: mean fully developed deceleration 6.43 m/s^2 of cars (13-H), 5.0 of trucks and buses
# (13), 5.1 of motorcycles (78, combined brakes); build-up 0.1 V of cars and motorcycles and 0.15 V of trucks and buses,
# V in km/h: 0.36 and 0.54 s. Trucks and buses are not feared to do better relative to a car; motorcycles may.
CLASSES = {
    "car": VehicleClass(1.0, 1.0, 0.0),
    "motorcycle": VehicleClass(5.1 / 6.43, 1.0, 0.0),
    "truck": VehicleClass(5.0 / 6.43, 5.0 / 6.43, 0.18),
    "bus": VehicleClass(5.0 / 6.43, 5.0 / 6.43, 0.18),
}


class Ground(NamedTuple):
    """K pieces of a road along x."""

    starts: np.ndarray  # `[K]` where each begins, from -inf on [m]
    roads: np.ndarray  # `[K]` index into `CONDITIONS`
    ego: np.ndarray  # `[16, 10]` `RSSParams` of the ego by worst and best
    other: np.ndarray  # `[C * 16, 10]` of everybody else by class, worst and best
    grip: np.ndarray  # `[4]` what tyres hold in fact [m/s^2]
    shares: np.ndarray  # `[C]` of the classes among the others, cumulative


def of_class(params: RSSParams, kind: VehicleClass, dt: float) -> RSSParams:
    """What the driver of another kind of vehicle is assumed to do; response times in whole frames of `dt` [s]."""
    response = float(frames_for(params.response_time + kind.delay, dt) * dt)
    brakes = {name: kind.braking * getattr(params, name) for name in ("a_min_brake", "a_min_brake_correct")}
    return params._replace(response_time=response, a_max_brake=kind.hardest * params.a_max_brake, **brakes)


def make_ground(table: Table, pieces: list[tuple[float, str]], classes: list[str]) -> Ground:
    """The ground of a road.

    Args:
      table: what holds for cars where nothing is wrong with the road.
      pieces: where each begins [m], the first at -inf, and its condition.
      classes: names of the kinds of vehicles, the first of those that are nothing else.
    """
    others = [of_class(table.other, CLASSES[name], table.dt) for name in classes]
    grip = np.array([0.5 * (road.low + road.high) * GRAVITY for road in ROADS.values()])
    return Ground(
        np.array([start for start, _ in pieces], float),
        np.array([CONDITIONS.index(name) for _, name in pieces], np.int64),
        _rows(table.ego),
        np.concatenate([_rows(one) for one in others]),
        grip,
        np.ones(len(classes)),
    )


def _rows(params: RSSParams) -> np.ndarray:
    """`[16, 10]` of one driver."""
    roads = list(ROADS.values())
    rows = []
    for worst in roads:
        for best in roads:
            low, high = min(worst.low, best.low), max(worst.high, best.high)
            rows.append(on_road(params, Road(low, high)))
    return np.array(rows, float)


@compiled
def params_at(rows, k):
    """`RSSParams` of a row."""
    row = rows[k]
    return RSSParams(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9])


@compiled
def state_between(ground, low, high):
    """Worst and best condition between two places [m], as 4 worst + best."""
    worst, best, count = 0, len(CONDITIONS) - 1, len(ground.starts)
    for k in range(count):
        ends = ground.starts[k + 1] if k < count - 1 else np.inf
        if ground.starts[k] <= high and ends > low:
            worst, best = max(worst, ground.roads[k]), min(best, ground.roads[k])
    return len(CONDITIONS) * worst + best


@compiled
def state_along(ground, rows, first, x, cos, speed, half_length):
    """Conditions along the stopping way of somebody, at the parameters that these give, as 4 worst + best.

    Args:
      ground: `Ground`.
      rows: `ground.ego` or `ground.other`.
      first: row of its class.
      x, cos, speed: where it is, cosine of its heading [m], [1], [m/s].
      half_length: of it [m].
    """
    low, high = x - half_length, x + half_length
    state = state_between(ground, low, high)
    for _ in range(STATES):
        own = params_at(rows, first + state)
        way = forward_reach(abs(speed), own.response_time, own.a_max_accel, own.a_min_brake, own.v_cap)
        if speed * cos >= 0.0:
            further = state_between(ground, low, high + way)
        else:
            further = state_between(ground, low - way, high)
        if further == state:
            break
        state = further
    return state


@compiled
def worse_of(state, other):
    """Worst and best of two states together."""
    n = len(CONDITIONS)
    return n * max(state // n, other // n) + min(state % n, other % n)


@inner
def table_of(table, user):
    """The table of a pair: the other's own row, where road users differ."""
    return table_of_kind(table, table.others, user.kind)


@inner
def table_of_kind(table, others, kind):
    """Likewise; `others` is `table.others`, whose type decides whether there is anything to do."""
    if others is None:
        return table
    return Table(table.ego, params_at(others, kind), table.rules, table.dt, others)


@compiled
def table_on(table, ground, state):
    """The table of an ego in a state of the road."""
    return Table(params_at(ground.ego, state), table.other, table.rules, table.dt, ground.other)
