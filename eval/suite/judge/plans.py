"""Contacts where roads cross, judged afterwards by plans, as a shield that only watches judges them.

The road is set up again with a stand-in for everybody, who is put where the log says on every sample, and the shield's
own code looks on. Whether the ego had a plan does not depend on what its shield believed: plans are found anew, from
where everybody was, what the ego's wheels and engine did, and the routes that were announced.
"""

from typing import Any

import numpy as np
from highway_env.road.road import Road
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Obstacle

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.step import attach
from rss_shield.envs.options import PLANS, WAITING, Settings
from rss_shield.envs.worlds.signalised import SignalisedRoad, compile_signal
from rss_shield.eval.suite.judge.contacts import near_pairs, touches
from rss_shield.eval.suite.judge.world import World
from rss_shield.shield.junctions.examined import EXAMINED
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.params import Table
from rss_shield.shield.trace import Trace


def see_junction(
    trace: Trace, table: Table, users: list[int] | None
) -> tuple[dict[tuple[int, int], dict[str, Any]], tuple[str, ...]]:
    """First contacts where roads cross, from the views of some users.

    Args:
      trace: `Trace` of an environment where roads cross.
      table: `Table`.
      users: whose views; None = those of the egos, because plans cost a thousand times what distances cost.

    Returns:
      Views by (user, partner), and what could not be judged.
    """
    notes = ["where roads cross contacts are judged, and not every pair on every sample: duties are plans there"]
    chosen = list(trace.ego_users) if users is None else users
    if "network" not in trace.meta:
        return {}, (*notes, "the trace does not say how its roads are connected: nothing is judged")
    drivable = [i for i in chosen if trace.users.kinds[i] != "obstacle"]
    stage = _Stage(trace, table, drivable)
    stage.play()
    return stage.views, (*notes, *stage.notes)


class _Stage:
    """The road, and a stand-in for everybody on it."""

    def __init__(self, trace: Trace, table: Table, judged: list[int]) -> None:
        self.trace, self.world, self.notes = trace, World(trace), []  # type: tuple[Any, Any, list[str]]
        self.road = _road(trace, self.world)
        conduct = trace.meta.get("conduct", {})
        self.settings = Settings(
            table,
            overrides=False,
            scheme=PLANS,
            entry=ENTRIES.index(conduct.get("entry", "cautious")),
            intent=INTENTS.index(conduct.get("intent", "any")),
            waits_anywhere=conduct.get("waiting", "line") == WAITING[1],
            examine=EXAMINED.index(conduct.get("examine", "table")),
        )
        self.judged, self.stand_ins = set(judged), {}  # type: set[int], dict[int, Any]
        self.shields: dict[int, ShieldedEgo] = {}
        self.views: dict[tuple[int, int], dict[str, Any]] = {}
        self.hits: dict[int, np.ndarray] = {}
        for i, j in near_pairs(trace):
            hit = touches(trace, i, j)
            for one in (i, j):
                self.hits[one] = self.hits.get(one, False) | hit

    def play(self) -> None:
        """Every sample in turn."""
        u = self.trace.users
        for t in range(len(self.trace.time)):
            there = [int(i) for i in np.flatnonzero(u.present[t])]
            for i in there:
                self._place(t, i)
            users = [self.stand_ins[i] for i in there]
            self.road.vehicles = [v for v in users if isinstance(v, Vehicle)]
            self.road.objects = [v for v in users if not isinstance(v, Vehicle)]
            if isinstance(self.road, SignalisedRoad):
                self.road.steps = t
                for vehicle in self.road.vehicles:
                    self.road._see(vehicle)
            for i in sorted(self.judged & set(there)):
                self._judge(t, i)
            if self.judged <= {i for i, _ in self.views}:
                break

    def _judge(self, t: int, i: int) -> None:
        vehicle = self.stand_ins[i]
        if any(one == i for one, _ in self.views):
            return
        if i not in self.shields:
            destination = self.trace.meta.get("config", {}).get("destination") or ""
            try:
                self.shields[i] = attach(vehicle, self.settings, destination=destination)
            except ValueError as error:
                self.judged.discard(i)
                self.notes.append(f"user {self.trace.users.ids[i]} can't be judged: {error}")
                return
        shield = self.shields[i]
        hit = self.hits.get(i)
        vehicle.impact = np.zeros(2) if hit is not None and hit[t] else None
        if shield.check_contact():
            contact = shield.contact or {}
            road = [*self.road.vehicles, *self.road.objects]
            partner = next(j for j, v in self.stand_ins.items() if v is road[contact["partner"]])
            self.views[i, partner] = {"frame": t} | {k: v for k, v in contact.items() if k != "partner"}
        elif t < len(self.trace.time) - 1:
            shield.nominal = dict(vehicle.action)
            shield._frame()

    def _place(self, t: int, i: int) -> None:
        """Put the stand-in of a user where it was, with what it was about to do."""
        u = self.trace.users
        if i not in self.stand_ins:
            self.stand_ins[i] = self._stand_in(t, i)
        v = self.stand_ins[i]
        v.position = np.array([u.x[t, i], u.y[t, i]])
        v.heading, v.speed, v.crashed = float(u.heading[t, i]), float(u.speed[t, i]), bool(u.crashed[t, i])
        if not isinstance(v, Vehicle):
            return
        v.action = {
            "acceleration": float(np.nan_to_num(u.acceleration[t, i])),
            "steering": float(np.nan_to_num(u.steering[t, i])),
        }
        v.lane_index = self.world.indices[self.world.on[t, i]]
        v.lane = self.world.network.get_lane(v.lane_index)
        announced = [one for one in self.world.routes.get(i, []) if one[0] <= t]
        if isinstance(v, ControlledVehicle):
            _, target, route = announced[-1] if announced else (0, None, [])
            v.target_lane_index, v.route = target or v.lane_index, list(route) or None

    def _stand_in(self, t: int, i: int) -> Any:
        u = self.trace.users
        pose = self.road, [u.x[t, i], u.y[t, i]], float(u.heading[t, i]), float(u.speed[t, i])
        if u.kinds[i] == "obstacle":
            v: Any = Obstacle(*pose)
        else:
            freely = any(target is None for _, target, _ in self.world.routes.get(i, []))
            v = (Vehicle if freely else ControlledVehicle)(*pose)
        v.LENGTH, v.WIDTH = float(u.length[i]), float(u.width[i])
        v.diagonal = float(np.hypot(v.LENGTH, v.WIDTH))
        if i in self.trace.meta.get("shielded", []):
            v.act = v.act  # under a shield, which others can tell
        right = {int(k): value for k, value in self.trace.meta.get("rights", {}).items()}.get(i)
        if right:
            v.approach, v.has_right, v.ran_red_light = right
        return v


def _road(trace: Trace, world: World) -> Road:
    if not trace.lights:
        return Road(network=world.network, vehicles=[])
    config = {name: value for name, value in trace.meta["config"]["signal"].items() if name != "offset"}
    plan = compile_signal(config)
    return SignalisedRoad(plan, trace.meta["clock"], trace.dt, network=world.network, vehicles=[])
