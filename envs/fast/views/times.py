"""`TimeToCollision`: predicted times to collision around the ego's speed and lane."""

from typing import Any

import numpy as np

from rss_shield.envs._numpy.floats import clip, dot, not_zero
from rss_shield.envs.fast.drivers import route_length
from rss_shield.envs.fast.sight import locate
from rss_shield.envs.fast.state import UNSEEN
from rss_shield.envs.fast.views.record import TIME_TO_COLLISION, View, empty_view
from rss_shield.envs.roads.network import Network
from rss_shield.shield._numba.compiled import inner, part

_DEPTH = 3  # roads that highway-env looks ahead


def describe(times: int, env: Any, net: Network) -> View:
    """The view of so many moments."""
    network = env.road.network
    view = empty_view(TIME_TO_COLLISION)
    record = view.record
    kind = getattr(env.action_type, "agents_action_types", [env.action_type])[0]
    record["speeds"], record["times"] = len(kind.target_speeds), times
    record["lanes"] = max(len(network.all_side_lanes(index)) for index in network.lanes_dict())
    meets, left = _meetings(network, net, bool(env.vehicle.route))
    return view._replace(meets=meets, left=left)


def _meetings(network: Any, net: Network, routed: bool) -> tuple[np.ndarray, np.ndarray]:
    """`View.meets` and `View.left`; without routes there is one table, for an ego that has none."""
    ways = [(origin, end) for origin, ends in network.graph.items() for end in ends]
    known: dict[tuple[int, ...], int] = {(): 0}
    left = np.zeros((len(net.route_roads), net.route_roads.shape[1] + 1), np.int64)
    for p, roads in enumerate(net.route_roads.tolist() if routed else []):
        roads = [road for road in roads if road >= 0]
        for step in range(len(roads)):
            left[p, step] = known.setdefault(tuple(roads[step:]), len(known))
    tables = []
    for remaining in known:
        route = [(*ways[road], None) for road in remaining]
        tables.append(
            [[network.is_connected_road((*a, 0), (*b, 0), route=route, depth=_DEPTH) for b in ways] for a in ways]
        )
    return np.array(tables, bool), left


@part
def observe_times(cars, episode, net, sight, view, target_speeds, period, out):
    """Arguments as in `views.usual.observe`."""
    record, lanes = view.record[0], net.lanes
    ego = cars[episode.ego]
    n_lanes = lanes[ego.lane].siblings
    locate(ego.lane, episode.ego, cars, lanes, sight)
    for v in range(record.speeds):
        for lane in range(n_lanes):
            for t in range(record.times):
                sight.grid[v, lane, t] = 0.0
    for v in range(record.speeds):
        for j in range(episode.vehicles):
            if j != episode.ego and cars[j].kind != UNSEEN and target_speeds[v] != cars[j].speed:
                locate(ego.lane, j, cars, lanes, sight)
                _mark_collisions(cars, episode, v, j, n_lanes, net, sight, view, target_speeds, period)
    for a in range(3):
        v = int(clip(ego.speed_index - 1 + a, 0, record.speeds - 1))
        for b in range(3):
            lane = lanes[ego.lane].id - 1 + b
            for t in range(record.times):
                value = sight.grid[v, lane, t] if 0 <= lane < n_lanes else 1.0
                out[(a * 3 + b) * record.times + t] = value


@inner
def _may_meet(ego, other, net, view):
    """Does the road ahead of the ego lead to that of another car?"""
    q = 0
    if ego.route >= 0 and ego.route_step < route_length(net, ego.route):
        q = view.left[ego.route, ego.route_step]
    return view.meets[q, net.lanes[ego.lane].road, net.lanes[other.lane].road]


@part
def _mark_collisions(cars, episode, v, j, n_lanes, net, sight, view, target_speeds, period):
    """Mark in the grid when the ego would meet car `j` at target speed `v`."""
    ego, other, lanes = cars[episode.ego], cars[j], net.lanes
    closing = not_zero(target_speeds[v] - other.speed * dot(other.cos, other.sin, ego.cos, ego.sin))
    apart = sight.s[ego.lane, j] - sight.s[ego.lane, episode.ego]
    if not _may_meet(ego, other, net, view):
        return
    same_width = lanes[other.lane].siblings == n_lanes
    first = lanes[other.lane].id if same_width else 0
    last = first + 1 if same_width else n_lanes
    for margin, cost in ((0.0, 1.0), (-5.0, 0.5), (5.0, 0.5)):
        time = (apart + margin) / closing
        if time < 0:
            continue
        for t in (np.floor(time / period), np.ceil(time / period)):
            if t < view.record[0].times:
                for lane in range(first, last):
                    sight.grid[v, lane, int(t)] = max(sight.grid[v, lane, int(t)], cost)
