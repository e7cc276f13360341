"""Where every car is on every lane, and who is ahead of whom.

Positions do not change while cars decide, so each car is projected on each lane once per frame.
Every lane keeps the cars on it sorted by arc length; neighbours are then next to each other.

Intersections have many short lanes, most of them circles that few cars are near. There `place` leaves
out what nobody will ask for, and neighbours are searched among all cars.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs._numpy.floats import wrap_to_pi
from rss_shield.envs._numpy.ufuncs import arctan2_each
from rss_shield.envs.fast.state import CAR, LINEAR_CAR
from rss_shield.envs.roads.network import (
    CAR_LENGTH,
    CIRCULAR,
    around,
    beside,
    distance,
    heading_at,
    is_far,
    is_on_lane,
    local_coordinates,
)
from rss_shield.envs.roads.ways import CAR_ON_ROAD
from rss_shield.shield._numba.compiled import inner
from rss_shield.shield.geometry import PIECE_FIELDS
from rss_shield.shield.junctions.memory import SAMPLE
from rss_shield.shield.junctions.reach import THREAT
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.risk import MARKING, SOURCE

_WAYS = 8  # ways of one road user that there is room for
MOMENTS = 11  # at which a regulated road looks ahead


class Sight(NamedTuple):
    """Working memory of one environment at a time, for N road users and L lanes."""

    s: np.ndarray  # `[L, N]` arc length of each car on each lane [m]
    lateral: np.ndarray  # `[L, N]` signed offset [m]
    members: np.ndarray  # `[L, N]` cars on each lane, sorted by (arc length, index)
    crowd: np.ndarray  # `[L]` how many
    rank: np.ndarray  # `[L, N]` place of a car among the members, or the one it would take; -1 = not known
    changing: np.ndarray  # `[N]` cars that head for another lane
    some: np.ndarray  # `[N]` cars that the step at hand has more to do with
    others: np.ndarray  # `[N]` the others
    free: np.ndarray  # `[N]` accelerations on a free road [m/s^2]
    wanted: np.ndarray  # `[N]` accelerations decided on [m/s^2]
    x: np.ndarray  # `[N]` numbers of the step at hand
    y: np.ndarray  # `[N]`
    z: np.ndarray  # `[N]`
    pairs: np.ndarray  # `[N (N - 1) / 2]` pairs that may collide
    corners: np.ndarray  # `[2, 4, 2]` of two boxes [m]
    nearest: np.ndarray  # `[N]` observed cars
    grid: np.ndarray  # `[speeds, lanes, times]` time-to-collision grid
    on: np.ndarray  # `[N]` lanes each car may be on, as a set of bits
    futures: np.ndarray  # `[N, MOMENTS + 2, 3]` predicted x, y, heading; then the smallest and the largest
    ghost: np.ndarray  # `[1]` CAR, a copy to predict with
    on_road: np.ndarray  # `[N]` CAR_ON_ROAD, what the shield reads at junctions
    samples: np.ndarray  # `[N]` SAMPLE
    threats: np.ndarray  # `[M]` THREAT, ways that others may take
    box: np.ndarray  # `[6]` swept box of an obstacle
    users: np.ndarray  # `[N]` ROAD_USER, what it measures elsewhere
    users_before: np.ndarray  # `[N]` ROAD_USER, the same on the frame before
    measured: np.ndarray  # `[N]` ROAD_USER, what the measure of risk measures
    sources: np.ndarray  # `[N]` SOURCE of its field
    lines: np.ndarray  # `[2]` MARKING
    around: np.ndarray  # `[6]` the nearest of the others
    straight: np.ndarray  # `[1, 11]` a road of one piece
    linear: np.ndarray | None  # as in `World`


def make_sight(n_lanes, n, grid=(0, 0, 0), linear=None):
    """Fresh working memory.

    Args:
      n_lanes: of the roads.
      n: road users.
      grid: speeds, lanes and times of a time-to-collision grid.
      linear: of the `Scenario`.
    """
    return Sight(
        np.empty((n_lanes, n)),
        np.empty((n_lanes, n)),
        np.empty((n_lanes, n), np.int64),
        np.empty(n_lanes, np.int64),
        np.empty((n_lanes, n), np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(max(n * (n - 1) // 2, 1), np.int64),
        np.empty((2, 4, 2)),
        np.empty(n, np.int64),
        np.empty(tuple(grid)),
        np.full(n, -1, np.int64),
        np.empty((n, MOMENTS + 2, 3)),
        np.empty(1, CAR if linear is None else LINEAR_CAR),
        np.zeros(n, CAR_ON_ROAD),
        np.zeros(n, SAMPLE),
        np.zeros(_WAYS * n + 64, THREAT),
        np.zeros(6),
        np.zeros(n, ROAD_USER),
        np.zeros(n, ROAD_USER),
        np.zeros(n, ROAD_USER),
        np.zeros(n, SOURCE),
        np.zeros(2, MARKING),
        np.zeros(6, np.int64),
        np.zeros((1, PIECE_FIELDS)),
        linear,
    )


@inner
def project(cars, n, net, sight):
    """Lane coordinates of all cars on all lanes."""
    if net.spacing > 0.0:
        for k in range(len(net.lanes)):
            s, lateral, y = sight.s[k], sight.lateral[k], net.lanes[k].y
            for i in range(n):
                s[i], lateral[i] = cars[i].x, cars[i].y - y
        return
    for k in range(len(net.lanes)):
        lane, s, lateral, x, y = net.lanes[k], sight.s[k], sight.lateral[k], sight.x, sight.y
        if lane.kind == CIRCULAR:
            for i in range(n):
                x[i], y[i] = cars[i].x - lane.x, cars[i].y - lane.y
            arctan2_each(y, x, sight.z, n)
            for i in range(n):
                s[i], lateral[i] = around(lane, x[i], y[i], sight.z[i])
        else:
            for i in range(n):
                s[i], lateral[i] = beside(lane, cars[i].x - lane.x, cars[i].y - lane.y)


@inner
def update_lanes(cars, n, net, sight):
    """Put every vehicle on the lane that is nearest in position and heading."""
    lanes = net.lanes
    for i in range(n):
        car = cars[i]
        if 2.0 * abs(sight.lateral[car.lane, i]) + abs(car.heading) < net.spacing - 1e-6:
            continue  # all other lanes are farther away in position alone
        bound = _far_from(car, i, car.lane, lanes, sight)
        near = 0
        for k in range(len(lanes)):
            near += not _is_beyond(bound, i, k, lanes, sight)
        if near == 1:
            continue
        best, nearest = np.inf, 0
        for k in range(len(lanes)):
            if _is_beyond(bound, i, k, lanes, sight):
                continue
            far = _far_from(car, i, k, lanes, sight)
            if far < best:
                best, nearest = far, k
        car.lane = nearest


@inner
def _is_beyond(bound, i, k, lanes, sight):
    """Is a car farther than `bound` from lane `k`, in position alone [m]? The angle only adds to it."""
    return distance(lanes[k], sight.s[k, i], sight.lateral[k, i]) > bound


@inner
def _far_from(car, i, k, lanes, sight):
    """How far a car is from lane `k` in position [m] and heading [rad], added up."""
    lane, s = lanes[k], sight.s[k, i]
    return distance(lane, s, sight.lateral[k, i]) + abs(wrap_to_pi(car.heading - heading_at(lane, s)))


@inner
def place(cars, n, lanes, sight):
    """`project` and `update_lanes` at once, for many short lanes.

    Arc lengths stay unknown (nan) where a car is neither on a lane nor could be nearest to it; `locate`
    finds them when asked. Fills `sight.on` as well.
    """
    for i in range(n):
        car = cars[i]
        x, y = car.x, car.y
        lane = lanes[car.lane]
        here, aside = local_coordinates(lane, x, y)
        # no lane farther away than the one of before can be the nearest
        bound = distance(lane, here, aside) + abs(wrap_to_pi(car.heading - heading_at(lane, here)))
        best, nearest, on = np.inf, 0, 0
        for k in range(len(lanes)):
            lane = lanes[k]
            if is_far(lane, x, y, max(bound, lane.width / 2 + 1.0), CAR_LENGTH):
                sight.s[k, i] = np.nan
                continue
            if k != car.lane:
                s, lateral = local_coordinates(lane, x, y)
            else:
                s, lateral = here, aside
            sight.s[k, i], sight.lateral[k, i] = s, lateral
            if is_on_lane(lane, s, lateral, 1.0):
                on |= 1 << k
            far = distance(lane, s, lateral)
            if far <= bound and far < best:
                far += abs(wrap_to_pi(car.heading - heading_at(lane, s)))
                if far < best:
                    best, nearest = far, k
        car.lane = nearest
        sight.on[i] = on


@inner
def locate(k, i, cars, lanes, sight):
    """Make sure that the lane coordinates of car `i` on lane `k` are known."""
    if np.isnan(sight.s[k, i]):
        sight.s[k, i], sight.lateral[k, i] = local_coordinates(lanes[k], cars[i].x, cars[i].y)


@inner
def sort_along_x(cars, n, order):
    """Keep `order` `[N]` sorted by x, ties by index; it changes little from frame to frame."""
    for a in range(1, n):
        i = order[a]
        b = a - 1
        while b >= 0 and (cars[order[b]].x > cars[i].x or (cars[order[b]].x == cars[i].x and order[b] > i)):
            order[b + 1] = order[b]
            b -= 1
        order[b + 1] = i


@inner
def line_up(n, net, order, sight):
    """Sort the cars on each lane by arc length, ties by index."""
    for k in range(len(net.lanes)):
        if net.spacing > 0.0:
            sight.crowd[k] = _line_up_along_x(k, n, net.lanes[k], order, sight)
        else:
            sight.crowd[k] = _line_up_along(k, n, net.lanes[k], order, sight)


# Which cars are on a lane cannot be foretold, so the next two have no branches that ask for it.


@inner
def _line_up_along_x(k, n, lane, order, sight):
    """`line_up` on a lane along the x-axis; returns how many cars are on it."""
    s, lateral, members, rank = sight.s[k], sight.lateral[k], sight.members[k], sight.rank[k]
    for i in range(n):
        rank[i] = is_on_lane(lane, s[i], lateral[i], 1.0)
    count = 0
    for a in range(n):
        i = order[a]
        on_lane = rank[i]
        members[count], rank[i] = i, count
        count += on_lane
    return count


@inner
def _line_up_along(k, n, lane, order, sight):
    """`line_up` on any lane; who is not on it gets no rank."""
    s, lateral, members, rank = sight.s[k], sight.lateral[k], sight.members[k], sight.rank[k]
    for i in range(n):
        rank[i] = 0 if is_on_lane(lane, s[i], lateral[i], 1.0) else -1
    count = 0
    for a in range(n):
        members[count] = order[a]
        count += rank[order[a]] + 1
    for a in range(1, count):  # nearly in order already
        i = members[a]
        b = a - 1
        while b >= 0 and (s[members[b]] > s[i] or (s[members[b]] == s[i] and members[b] > i)):
            members[b + 1] = members[b]
            b -= 1
        members[b + 1] = i
    for b in range(count):
        rank[members[b]] = b
    return count


@inner
def _place(k, i, sight):
    """Place of car `i` among the members of lane `k`, or the one that it would take."""
    place = sight.rank[k, i]
    if place >= 0:
        return place
    s, members = sight.s[k], sight.members[k]
    low, high = 0, sight.crowd[k]
    while low < high:
        middle = (low + high) // 2
        if s[members[middle]] < s[i]:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def car_ahead(k, i, n, net, lanes, sight):
    """Nearest car ahead of car `i` on lane `k`, -1 = none. Of several side by side the last one."""
    if net.links.shape[1] > 1:
        return _car_ahead_connected(k, i, n, net, lanes, sight)
    s, members, count = sight.s[k], sight.members[k], sight.crowd[k]
    place = _place(k, i, sight)
    ahead = place
    if ahead < count and members[ahead] == i:
        ahead += 1
    if ahead < count:
        while ahead + 1 < count and s[members[ahead + 1]] == s[members[ahead]]:
            ahead += 1
        if s[members[ahead]] == s[i] or place == 0 or s[members[place - 1]] != s[i]:
            return members[ahead]
    if place > 0 and s[members[place - 1]] == s[i]:
        return members[place - 1]  # side by side with a lower index
    return -1


@inner
def car_behind(k, i, n, net, lanes, sight):
    """Nearest car behind car `i` on lane `k`, -1 = none. Of several side by side the first one."""
    if net.links.shape[1] > 1:
        return _car_behind_connected(k, i, n, net, lanes, sight)
    s, members = sight.s[k], sight.members[k]
    behind = _place(k, i, sight) - 1
    while behind >= 0 and s[members[behind]] == s[i]:
        behind -= 1
    if behind < 0:
        return -1
    while behind > 0 and s[members[behind - 1]] == s[members[behind]]:
        behind -= 1
    return members[behind]


@inner
def _along(k, j, net, lanes, sight):
    """Arc length of car `j` seen from lane `k` through its connected lanes, and whether it is on one."""
    for m in range(net.links.shape[1]):
        link = net.links[k, m]
        if link < 0:
            break
        if is_on_lane(lanes[link], sight.s[link, j], sight.lateral[link, j], 1.0):
            return sight.s[link, j] + net.link_offsets[k, m], True
    return 0.0, False


@inner
def _car_ahead_connected(k, i, n, net, lanes, sight):
    nearest, ahead = np.inf, -1
    bits = net.link_bits[k]
    for j in range(n):
        if j != i and sight.on[j] & bits != 0:
            s, found = _along(k, j, net, lanes, sight)
            if found and s >= sight.s[k, i] and s <= nearest:
                nearest, ahead = s, j
    return ahead


@inner
def _car_behind_connected(k, i, n, net, lanes, sight):
    nearest, behind = -np.inf, -1
    bits = net.link_bits[k]
    for j in range(n):
        if j != i and sight.on[j] & bits != 0:
            s, found = _along(k, j, net, lanes, sight)
            if found and s < sight.s[k, i] and s > nearest:
                nearest, behind = s, j
    return behind
