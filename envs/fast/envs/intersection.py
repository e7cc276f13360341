"""`intersection-v0/-v2` and several agents there: four arms, traffic that comes and goes, and yields.

Random numbers are drawn in highway-env's order.
"""

from typing import Any

import numpy as np

from rss_shield.envs._numpy.floats import clip, norm
from rss_shield.envs.fast.draws import integers, normal, random, two_of
from rss_shield.envs.fast.frame import act, look_around, survey, think
from rss_shield.envs.fast.linear_drivers import randomize
from rss_shield.envs.fast.rating import normalized, scaled, weigh
from rss_shield.envs.fast.record import FLOW, Unsupported, set_scale, set_weights
from rss_shield.envs.fast.sight import sort_along_x
from rss_shield.envs.fast.spawning import add_ego, add_on_lane
from rss_shield.envs.fast.state import TRAFFIC
from rss_shield.envs.roads.network import heading_at, local_coordinates, position
from rss_shield.envs.stock import AT_INTERSECTIONS
from rss_shield.shield._numba.compiled import inner, part

REWARDS = ("collision_reward", "high_speed_reward", "arrived_reward", "on_road_reward")
DESTINATIONS = ("o0", "o1", "o2", "o3")  # the arms
# Room at an intersection, at most. Behind an ego that stands still for 150 s, with a new car tried every
# second, the fullest of 256 environments held 58.
MOST_CARS = 64
_EXIT_DISTANCE = 25.0  # beyond an intersection [m]
_CLEARANCE = 15.0  # of a new car to all others [m]
_EGO_CLEARANCE = 20.0  # others are removed within it [m]
_ANYWHERE, _STRAIGHT_ON = np.int64(0), np.int64(1)  # where cars are bound for
_LEAVING = 20.0  # cars vanish that far before the end of the world [m]


def describe(record: Any, given: dict, env: Any, number: dict) -> None:
    """Enter a configuration; `number` is that of each lane of `env`."""
    for name, value in AT_INTERSECTIONS.items():
        record[name.lower()] = value
    record["main_lane"] = number["o0", "ir0", 0]
    record["traffic"] = given["initial_vehicle_count"]
    record["offroad_terminal"] = given["offroad_terminal"]
    set_scale(record, given, given["collision_reward"], given["arrived_reward"])
    set_weights(record, given, REWARDS)


def flow_of(dt: float, given: dict, env: Any, number: dict) -> np.ndarray:
    """How traffic comes, goes and yields, `[1]` FLOW; frames of `dt` [s]."""
    flow = np.zeros(1, FLOW)
    entries = [number[f"o{k}", f"ir{k}", 0] for k in range(4)]
    flow["arm"] = entries[1] - entries[0]
    assert entries == list(range(entries[0], entries[3] + 1, entries[1] - entries[0]))
    asked = given["destination"]
    if asked and asked not in DESTINATIONS:
        raise Unsupported(f"destination = {asked!r}", f"None or one of {', '.join(DESTINATIONS)}")
    flow["destination"] = DESTINATIONS.index(asked) if asked else -1
    flow["warm_up_frames"] = 3 * given["simulation_frequency"]
    flow["regulation_period"] = int(1 / dt / env.road.REGULATION_FREQUENCY)
    flow["spawn_probability"] = given["spawn_probability"]
    return flow


def room_for(record: Any, given: dict) -> int:
    """As many road users as can appear in an episode, at most `MOST_CARS`."""
    decisions = record["duration"][0] / record["period"][0] + 2
    agents = record["agents"][0]
    return int(min(MOST_CARS, max(given["initial_vehicle_count"], 1) + agents + np.ceil(decisions)))


@inner
def has_arrived(cars, i, lanes, sight):
    """Has a car left the intersection?"""
    k = cars[i].lane
    return lanes[k].exits and sight.s[k, i] >= _EXIT_DISTANCE


@inner
def is_over(cars, egos, lanes, sight):
    """Has one of several agents crashed, or have all arrived? egos: `[A]` EPISODE."""
    crashed, arrived = False, True
    for a in range(len(egos)):
        crashed = crashed or cars[egos[a].ego].crashed
        arrived = arrived and has_arrived(cars, egos[a].ego, lanes, sight)
    return crashed or arrived


@inner
def rate(cars, episode, ego, on_road, lanes, sight, config, step):
    """Arguments as in `tasks.rate`."""
    arrived = has_arrived(cars, episode.ego, lanes, sight)
    step.success = arrived
    step.reward_1 = clip(scaled(ego.speed, config), 0.0, 1.0)
    step.reward_2 = 1.0 if arrived else 0.0
    step.reward_3 = on_road
    reward = config.weight_2 if arrived else weigh(step, config)
    return normalized(reward * on_road, config)


@part
def open_intersection(cars, episode, order, net, sight, config, flow, target_speeds, linear):
    """Populate the roads, let the traffic run for three seconds, then add the egos.

    Args:
      cars: `[N]` CAR, overwritten.
      episode: EPISODE, its generator is advanced.
      order: `[N]` indices, overwritten.
      net: the network.
      sight: working memory.
      config: CONFIG.
      flow: `[1]` FLOW.
      target_speeds: `[K]` of meta-actions [m/s].
      linear: of the `Scenario`.
    """
    lanes = net.lanes
    episode.ego = episode.cars = episode.vehicles = episode.road_frames = 0
    for i in range(len(cars)):
        cars[i].length = 0.0
    n = config.traffic
    for t in range(n - 1):
        _arrive(cars, episode, t * (80.0 / (n - 1)), 1.0, 1.0, 0.6, _ANYWHERE, net, config, flow[0], linear)
    _renumber(cars, episode, order)
    survey(cars, episode, net, sight, flow)
    for _ in range(flow[0].warm_up_frames):
        changing = look_around(cars, episode, order, net, sight, flow)
        think(cars, episode, 0, episode.vehicles, changing, net, sight, config)
        act(cars, episode, order, net, sight, config, flow)
    _arrive(cars, episode, 60.0, 0.1, 0.0, 1.0, _STRAIGHT_ON, net, config, flow[0], linear)
    for k in range(config.agents):
        _add_ego_on_its_way(k, cars, episode, net, config, flow[0], target_speeds)
    episode.ego = 0
    while episode.ego < episode.cars - 1 and cars[episode.ego].kind == TRAFFIC:
        episode.ego += 1
    _renumber(cars, episode, order)
    episode.observed_lanes = lanes[cars[episode.ego].lane].siblings


@part
def let_traffic_flow(cars, episode, order, net, config, flow, linear):
    """After each decision: cars that leave are gone, and a new one may come."""
    for i in range(len(cars)):
        cars[i].was = i if i < episode.cars else -1
    i = 0
    while i < episode.cars:
        lane = net.lanes[cars[i].lane]
        if cars[i].kind == TRAFFIC and lane.exits and _arc_length(lane, cars[i]) >= lane.length - _LEAVING:
            _remove(cars, episode, i)
        else:
            i += 1
    _arrive(cars, episode, 0.0, 1.0, 1.0, flow.spawn_probability, _ANYWHERE, net, config, flow, linear)
    _renumber(cars, episode, order)


@part
def _arc_length(lane, car):
    s, _ = local_coordinates(lane, car.x, car.y)
    return s


@part
def _arrive(cars, episode, s, deviation, speed_deviation, probability, bound, net, config, flow, linear):
    """Perhaps put a new car on one of the entries, around arc length `s` [m], bound for another arm."""
    if random(episode) > probability:
        return
    origin, destination = two_of(episode, 4)
    if bound == _STRAIGHT_ON:
        destination = (origin + 2) % 4
    lane = net.lanes[config.main_lane + origin * flow.arm]
    s = s + 5.0 + normal(episode) * deviation
    speed = 8.0 + normal(episode) * speed_deviation
    x, y = position(lane, s, 0.0)
    for i in range(episode.cars):
        if norm(cars[i].x - x, cars[i].y - y) < _CLEARANCE:
            return
    if _is_full(cars, episode):
        return
    i = add_on_lane(cars, episode, lane, s, speed, net.lanes, config)
    cars[i].was = -1
    cars[i].route = net.plans[cars[i].lane, destination]
    randomize(cars, episode, i, config, linear)


@part
def _add_ego_on_its_way(k, cars, episode, net, config, flow, target_speeds):
    """Put an ego on entry `k`, the first one on the southern, and clear its surroundings of traffic."""
    destination = flow.destination
    if destination < 0:
        destination = 1 + integers(episode, 3)
    lane = net.lanes[config.main_lane + k % 4 * flow.arm]
    x, y = position(lane, 60.0 + 5.0 * (1.0 + normal(episode)), 0.0)
    if _is_full(cars, episode):
        return
    ego = add_ego(cars, episode, x, y, heading_at(lane, 60.0), lane.speed_limit, net.lanes, config, target_speeds)
    if config.meta_actions:
        cars[ego].route = net.plans[cars[ego].lane, destination]
    i = 0
    while i < episode.ego:
        if cars[i].kind == TRAFFIC and norm(cars[i].x - x, cars[i].y - y) < _EGO_CLEARANCE:
            _remove(cars, episode, i)
        else:
            i += 1


@part
def _is_full(cars, episode):
    """Is there no room for another car? The engine tells the user."""
    episode.overflow = episode.overflow or episode.cars == len(cars)
    return episode.cars == len(cars)


@part
def _remove(cars, episode, i):
    """Take a car off the road; those after it move up."""
    for j in range(i, episode.cars - 1):
        cars[j] = cars[j + 1]
    episode.cars -= 1
    episode.vehicles -= 1
    if episode.ego > i:
        episode.ego -= 1
    cars[episode.cars].length = 0.0


@part
def _renumber(cars, episode, order):
    """Sort afresh after cars came or went."""
    for i in range(episode.cars):
        order[i] = i
    sort_along_x(cars, episode.cars, order)
