"""An episode of the engine as a trace, for the judge: the road and everybody on it, nothing that a shield believed."""

from typing import Any

import numpy as np

from rss_shield.envs.fast.config import Scenario
from rss_shield.envs.fast.recording import Log
from rss_shield.envs.fast.state import DIRECT, META, OBSTACLE
from rss_shield.envs.options import LANES, Settings
from rss_shield.envs.roads.traced import configuration, lane_id, lanes_of
from rss_shield.shield.junctions.examined import EXAMINED
from rss_shield.shield.junctions.memory import ENTRIES
from rss_shield.shield.junctions.plans import INTENTS
from rss_shield.shield.trace import Event, Trace, ego_of, users_of


class Studio:
    """Makes traces of one kind of environment.

    Args:
      scenario: what the engine runs.
      settings: of its shield.
    """

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        self.scenario, self.settings = scenario, settings
        network = scenario.stock.road.network
        self.lanes, self.network = lanes_of(network), configuration(network)
        self.indices = list(network.lanes_dict())

    def develop(self, log: Log) -> Trace:
        """The trace of a whole episode.

        Args:
          log: of `Recording`.
        """
        frames, dt = int(self.scenario.config["frames"][0]), float(self.scenario.config["dt"][0])
        rows = _identities(log, frames)
        samples, count = len(log.cars), 1 + max(max(one) for one in rows)
        state = {name: np.full((samples, count), np.nan) for name in ("x", "y", "heading", "speed")}
        commands = {name: np.full((samples, count), np.nan) for name in ("acceleration", "steering")}
        crashed, lane = np.zeros((samples, count), bool), np.full((samples, count), -1)
        length, width, kinds = np.zeros(count), np.zeros(count), ["car"] * count
        ego, hit = 0, {}  # type: int, dict[int, int]
        routes: list[list[Any]] = []
        announced: dict[int, Any] = {}
        for t, (cars, row) in enumerate(zip(log.cars, rows, strict=True)):
            for i, k in enumerate(row):
                car = cars[i]
                for name, values in state.items():
                    values[t, k] = car[name]
                crashed[t, k], lane[t, k] = car["crashed"], car["lane"]
                length[k], width[k] = car["length"], car["width"]
                if car["crashed"] or car["hit"]:
                    hit.setdefault(k, t)
                if car["kind"] == OBSTACLE:
                    kinds[k] = "obstacle"
                    continue
                if car["kind"] in (META, DIRECT):
                    ego = k
                self._note_route(car, t, k, routes, announced)
            if t > 0:  # what moved everybody on to this sample
                for i, k in enumerate(row):
                    if kinds[k] != "obstacle":
                        for name, values in commands.items():
                            values[t - 1, k] = log.cars[t][name][i]
        users = users_of(
            *([str(k) for k in range(count)], kinds, length, width),
            *(state["x"], state["y"], state["heading"], state["speed"]),
            *(commands["acceleration"], commands["steering"], crashed, lane),
        )
        events = tuple(Event(t * dt, "contact", k) for k, t in hit.items())
        return Trace(
            *(dt, np.arange(samples) * dt, users, self.lanes),
            egos=(ego_of(ego, samples),),
            events=events,
            meta=self._meta() | {"routes": routes, "shielded": [ego]},
        )

    def _note_route(self, car: Any, t: int, k: int, routes: list[list[Any]], announced: dict[int, Any]) -> None:
        """As `envs.highway.recorder.Film._note_route`."""
        target, roads = "", []  # type: str, list[list[str]]
        if car["kind"] != DIRECT:
            target = lane_id(self.indices[car["target_lane"]])
            if car["route"] >= 0:
                steps = self.scenario.network.route_roads[car["route"]]
                firsts = self.scenario.network.roads["first"]
                left = steps[car["route_step"] :]
                roads = [list(self.indices[firsts[road]][:2]) for road in left if road >= 0]
        if announced.get(k) != (target, roads):
            announced[k] = target, roads
            routes.append([t, k, target, roads])

    def _meta(self) -> dict[str, Any]:
        settings, table = self.settings, self.settings.table
        params = {"ego": table.ego._asdict(), "other": table.other._asdict()}
        return {
            "env_id": self.scenario.env_id,
            "config": dict(self.scenario.stock.config),
            "network": self.network,
            "integration": "euler",
            "mode": "override" if settings.overrides else "monitor",
            "scheme": "lanes" if settings.scheme == LANES else "plans",
            "params": params,
            "rules": table.rules._asdict(),
            "judge_params": params,
            "judge_rules": table.rules._asdict(),
            "conduct": {
                "entry": ENTRIES[settings.entry],
                "intent": INTENTS[settings.intent],
                "waiting": "anywhere" if settings.waits_anywhere else "line",
                "examine": EXAMINED[settings.examine],
            },
        }


def _identities(log: Log, frames: int) -> list[list[int]]:
    """Who each record of each sample is, `[T]` lists: numbers in the order of appearance.

    Where traffic comes and goes it does so between two decisions, so the last sample of a decision shows it as it was
    before, and the next one says who was which.
    """
    known = list(range(int(log.present[0])))
    new, rows = len(known), [known]
    for t in range(1, len(log.cars)):
        if t % frames == 1 or frames == 1:  # the first frame of a decision
            cars = log.cars[t][: log.present[t]]
            moved = cars["was"] if t > 1 and _comes_and_goes(log) else np.arange(len(cars))
            known = []
            for i in moved.tolist():
                if i < 0 or i >= len(rows[-1]):
                    known.append(new)
                    new += 1
                else:
                    known.append(rows[-1][i])
        rows.append(known)
    return rows


def _comes_and_goes(log: Log) -> bool:
    return bool((log.cars["was"] != 0).any())
