"""The roads of a trace, and everybody on them in the lane frame of one of them."""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from highway_env.road.lane import lane_from_config
from highway_env.road.road import RoadNetwork

from rss_shield.envs.roads.lanes import (
    Heading,
    LaneIndex,
    heading_anywhere,
    heading_toward,
    is_against,
    reach_of,
    roads_along,
    tightest,
)
from rss_shield.envs.roads.traced_lane import TracedLane
from rss_shield.eval.suite.judge.directions import directions, lane_along
from rss_shield.shield.geometry import box_of
from rss_shield.shield.lanes.frame import look_ahead, same_frame, to_lane_frame_all
from rss_shield.shield.lanes.judge import Log
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.params import Table
from rss_shield.shield.trace import Lane, Trace, stretches


class World:
    """The road network of a trace, and where everybody is on it.

    Args:
      trace: `Trace`. Without lanes everybody is taken to drive along one straight road, in the most likely one of
        `directions`.
    """

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.lanes = trace.lanes or (lane_along(trace, directions(trace)[0]),)
        self.network, self.indices = _network(trace, self.lanes)
        self.number = {lane.id: k for k, lane in enumerate(self.lanes)}
        self.bend = tightest(self.network)
        self._roads: dict[tuple, tuple[np.ndarray, np.ndarray]] = {}

    @cached_property
    def on(self) -> np.ndarray:
        """`[T, N]` index of the lane that everybody is on: what the log says, or the nearest with that direction."""
        u = self.trace.users
        on = u.lane.copy() if self.trace.lanes else np.full_like(u.lane, -1)
        known = {index: k for k, index in enumerate(self.indices)}
        if len(self.lanes) == 1:
            on[u.present] = 0
        for t, i in np.argwhere((on < 0) & u.present):
            position = np.array([u.x[t, i], u.y[t, i]])
            on[t, i] = known[self.network.get_closest_lane_index(position, u.heading[t, i])]
        return on

    @cached_property
    def routes(self) -> dict[int, list[tuple[int, LaneIndex | None, list[LaneIndex]]]]:
        """Of each user that announces one: from which sample on, lane that it heads for, None = any; roads after it."""
        found: dict[int, list[Any]] = {}
        for t, user, target, route in self.trace.meta.get("routes", []):
            index = self.indices[self.number[target]] if target in self.number else None
            found.setdefault(int(user), []).append((int(t), index, [(*road, 0) for road in route]))
        return found

    def heading(self, t: int, i: int) -> Heading:
        """Which lane a user drives on and which way it takes from there, as far as the log says."""
        u, index = self.trace.users, self.indices[self.on[t, i]]
        position = np.array([u.x[t, i], u.y[t, i]])
        heading = Heading(index)
        announced = [one for one in self.routes.get(i, []) if one[0] <= t]
        if announced:
            _, target, route = announced[-1]
            if target is None:
                heading = heading_anywhere(self.network, index, position, float(u.width[i]))
            else:
                heading = heading_toward(self.network, index, target, route)
        against = is_against(self.network, heading.lane, position, u.heading[t, i])
        return heading._replace(against=against)

    def roads(self, heading: Heading, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """The road along a heading, and the one with the branches that may still be taken; see `ShieldedEgo`."""
        key = (heading, reach)
        if key not in self._roads:
            self._roads[key] = roads_along(self.network, heading, reach)
        return self._roads[key]

    def is_in_own_lane(self, t: int, j: int) -> bool:
        """Is a user inside a lane that runs its way? Asked of those who come towards somebody."""
        u = self.trace.users
        lane = self.network.get_lane(self.indices[self.on[t, j]])
        s, lateral = lane.local_coordinates(np.array([u.x[t, j], u.y[t, j]]))
        along = np.cos(u.heading[t, j] - lane.heading_at(s)) > 0.0
        return bool(along and abs(lateral) <= (lane.width_at(s) - u.width[j]) / 2)


class View(NamedTuple):
    """What one user sees of all others while it is there."""

    first: int  # sample of the trace at which it appears
    others: np.ndarray  # `[N - 1]` users
    log: Log


def views(world: World, i: int, table: Table, slip: np.ndarray) -> list[View]:
    """Everybody in the lane frame of one user, for each stretch of time that it is there.

    Args:
      world: `World`.
      i: the user.
      table: `Table` in force; how far roads matter depends on it.
      slip: `[T, N]` angle between heading and motion during the frame, NaN = not known [rad].
    """
    return [_view(world, i, a, b, table, slip) for a, b in stretches(world.trace.users.present[:, i])]


def _view(world, i: int, start: int, end: int, table: Table, slip) -> View:
    trace, u = world.trace, world.trace.users
    count, frames, dt = len(u.ids), end - start, trace.dt
    order = [*(j for j in range(count) if j != i), i]  # who looks is the last
    boxes = np.array([_box(trace, j, table.rules.heading_bound, world.bend) for j in order])
    poses = np.stack([u.x, u.y, u.heading, u.speed], axis=-1)[start:end][:, order]
    present = ~np.isnan(poses[..., 0])
    poses = np.where(present[..., None], poses, 0.0)
    wreck = u.crashed[start:end][:, order] | (np.array(u.kinds)[order] == "obstacle")
    wreck[:, -1] = False
    reach = reach_of(table.ego, table.other, dt)
    users, before = np.zeros((2, frames, count), ROAD_USER)
    jumped, curvature = np.zeros((frames, count - 1), bool), np.zeros(frames)
    nowhere = np.full((count, 2), np.nan)
    last: tuple[np.ndarray, np.ndarray] | None = None

    def places(t: int) -> np.ndarray:
        return np.where(present[t][:, None], poses[t, :, :2], np.nan) if t >= 0 else nowhere

    def measure(roads: tuple[np.ndarray, np.ndarray], t: int) -> np.ndarray:
        out = np.zeros(count, ROAD_USER)
        to_lane_frame_all(roads[1], poses[t, :-1], places(t - 1)[:-1], boxes[:-1], dt, out[:-1])
        to_lane_frame_all(roads[0], poses[t, -1:], places(t - 1)[-1:], boxes[-1:], dt, out[-1:])
        out["wreck"] = wreck[t]
        return out

    for t in range(frames):
        roads = world.roads(world.heading(start + t, i), reach)
        users[t] = measure(roads, t)
        users[t]["in_own_lane"] = True
        for k in np.flatnonzero(present[t] & (np.cos(poses[t, :, 2] - poses[t, -1, 2]) <= 0.0)):
            users[t, k]["in_own_lane"] = world.is_in_own_lane(start + t, order[k])
        x, y, _, speed = poses[t, -1]
        curvature[t] = look_ahead(roads[0], x, y, speed, 0.5 * u.length[i], dt)[0]
        if t > 0:
            before[t] = users[t - 1]
            assert last is not None
            if roads is not last and not (same_frame(last[0], roads[0]) and same_frame(last[1], roads[1])):
                jumped[t] = True
                before[t] = measure(roads, t - 1)
                before[t]["in_own_lane"] = users[t - 1]["in_own_lane"]
        last = roads
    log = Log(
        users[:, -1],
        users[:, :-1],
        present[:, :-1],
        u.acceleration[start:end, i],
        slip[start:end, i],
        curvature,
        jumped,
        before[:, -1],
        before[:, :-1],
    )
    return View(start, np.array(order[:-1], int), log)  # of nobody, too


def _box(trace: Trace, j: int, heading_bound: float, curvature: float) -> tuple[float, float, float, float]:
    users = trace.users
    driven = users.kinds[j] != "obstacle"
    return box_of(float(users.length[j]), float(users.width[j]), heading_bound, curvature, driven)


# ---------------------------------------------------------------- road networks


def _network(trace: Trace, lanes: tuple[Lane, ...]) -> tuple[RoadNetwork, list[LaneIndex]]:
    """A road network of highway-env, and where each lane is in it."""
    network = RoadNetwork()
    if trace.meta.get("network") and trace.lanes:
        for start, end, configs in trace.meta["network"]:
            network.graph.setdefault(start, {})[end] = [lane_from_config(config) for config in configs]
        return network, list(network.lanes_dict())
    return network, traced_network(network, lanes)


def traced_network(network: RoadNetwork, lanes: tuple[Lane, ...]) -> list[LaneIndex]:
    """Put lanes of a trace into an empty network. Lanes beside each other are one road, from node to node."""
    node = {(lane.id, end): (lane.id, end) for lane in lanes for end in ("start", "end")}

    def find(key: tuple[str, str]) -> tuple[str, str]:
        while node[key] != key:
            key = node[key]
        return key

    for lane in lanes:
        for following in lane.successors:
            node[find((following, "start"))] = find((lane.id, "end"))
        for beside, opposite in ((lane.left, lane.left_runs_opposite), (lane.right, lane.right_runs_opposite)):
            if beside and not opposite:
                for end in ("start", "end"):
                    node[find((beside, end))] = find((lane.id, end))
    indices = []
    for lane in lanes:
        start, end = (" ".join(find((lane.id, at))) for at in ("start", "end"))
        road = network.graph.setdefault(start, {}).setdefault(end, [])
        road.append(TracedLane(lane))
        indices.append((start, end, len(road) - 1))
    return indices
