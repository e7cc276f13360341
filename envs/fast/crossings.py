"""Where plans keep the ego safe (Defs. 14-18): its way, the ways of the others, and what is remembered of them."""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.fast.neighbours import car_of
from rss_shield.envs.fast.state import META, OBSTACLE, TRAFFIC
from rss_shield.envs.roads.network import Network
from rss_shield.envs.roads.ways import Junction, Roads, drift_of, junction_of, list_threats, track_of
from rss_shield.shield._numba.compiled import inner, part
from rss_shield.shield.junctions.plans import Scene


class Ways(NamedTuple):
    """What it goes by where plans do. L lanes."""

    roads: Roads  # paths through junctions
    choice: np.ndarray  # `[R + 1, L]` row of the paths of a driver with route R - 1 who heads for lane L; 0: no route


class Plans(NamedTuple):
    """One ego kept safe by plans (Defs. 14-18)."""

    ways: Ways
    crossings: np.ndarray  # `[N]` CROSSING, what is remembered of the others


def compile_ways(network, net: Network, dt: float) -> Ways:
    """The paths through the junctions of a `highway_env.road.road.RoadNetwork`.

    Args:
      network: the road network.
      net: the same as arrays.
      dt: length of a frame [s].
    """
    junction = junction_of(network, dt=dt)
    return Ways(junction.roads, _choices(junction, network, net))


def _choices(junction: Junction, network, net: Network) -> np.ndarray:
    ways = [(origin, end) for origin, ends in network.graph.items() for end in ends]
    routes = [[ways[road] for road in roads if road >= 0] for roads in net.route_roads]
    return np.array([[junction.choice(index, route) for index in network.lanes_dict()] for route in [[], *routes]])


@inner
def plans_of(e, ways, crossings):
    """`Plans` of environment `e` of a batch; None where nobody, or somebody else, remembers crossings."""
    if ways is None or crossings is None:
        return None
    return Plans(ways, crossings[e])


@part
def carry_over(episode, cars, crossings, ego, blank):
    """Cars came and went, as they do at intersections: everybody's past moves along.

    Args:
      ego: index of the ego before.
      blank: `[1]` CROSSING of a first sight.
    """
    for i in range(len(crossings) - 1):
        k = car_of(i, episode)
        was = cars[k].was if k < episode.cars else -1
        # those after a gap move up
        crossings[i] = blank[0] if was < 0 else crossings[was if was < ego else was - 1]


@inner
def scene_of(cars, episode, sight, plans, settings, judging):
    """The ego's track and the ways that the others may take.

    A contact flags both cars at once, so who had crashed is read off the frame before where it is judged.
    """
    n, roads = episode.cars - 1, plans.ways.roads
    for i in range(n):
        other = cars[car_of(i, episode)]
        _describe(other, plans.ways.choice, sight.on_road[i])
        sight.on_road[i].alert = other.kind == META  # another ego, behind a shield of its own
        if judging:
            sight.on_road[i].wreck = plans.crossings[i].wreck
    _describe(cars[episode.ego], plans.ways.choice, sight.on_road[n])
    track = track_of(roads, sight.on_road[n], episode.path)
    episode.path = track.path
    count = list_threats(
        roads,
        track,
        sight.on_road[:n],
        plans.crossings[:n],
        settings.intent,
        settings.table.other.v_cap,
        sight.samples,
        sight.threats,
        sight.box,
    )
    if count > len(sight.threats):
        episode.overflow = True
    count = min(count, len(sight.threats))
    drift = drift_of(roads, sight.on_road[n], track)
    return Scene(roads.paths, track, sight.threats[:count], settings.table, drift)


@inner
def _describe(car, choice, out):
    out.x, out.y, out.heading, out.speed, out.length, out.width = (
        car.x,
        car.y,
        car.heading,
        car.speed,
        car.length,
        car.width,
    )
    out.wreck, out.alert = car.crashed or car.kind == OBSTACLE, False
    out.size, out.on, out.lane, out.choice = 0, car.lane, -1, -1  # all are of one size
    if car.kind == TRAFFIC or car.kind == META:
        out.lane, out.choice = car.target_lane, choice[car.route + 1, car.target_lane]
