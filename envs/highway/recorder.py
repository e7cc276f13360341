"""An episode of any environment as a trace: who was where on every frame, and what the shields made of it."""

from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.vehicle.objects import Landmark

from rss_shield.envs.highway.around import around
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.egos import EgoShields
from rss_shield.envs.highway.frames import Look
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.highway.step import shield_on
from rss_shield.envs.options import LANES, OPEN_SPACE
from rss_shield.envs.options import PLANS as BY_PLANS
from rss_shield.envs.roads.slip import steering_of
from rss_shield.envs.roads.traced import configuration, lane_id, lanes_of
from rss_shield.envs.worlds.signalised import LINE, SignalisedRoad
from rss_shield.envs.worlds.walkers import ERRANDS, Walker
from rss_shield.shield.definitions.kinematics import stopping_distance
from rss_shield.shield.definitions.signals import GREEN, RED, YELLOW
from rss_shield.shield.junctions.conflict_areas import CELL, X, Y, cell_of
from rss_shield.shield.junctions.held_back import held_by
from rss_shield.shield.junctions.plans import throttle
from rss_shield.shield.lanes.responses import response_name
from rss_shield.shield.trace import (
    CHANGED_BY,
    PLANS,
    RESPONSES,
    SIGNALS,
    Contact,
    Ego,
    Event,
    Light,
    Trace,
    ego_of,
    stretches,
    users_of,
)
from rss_shield.shield.verdicts import VERDICTS

AREAS = 8  # stretches of an ego's path that others may be in the way of: so many are kept, the nearest
_SCHEMES = {LANES: "lanes", BY_PLANS: "plans", OPEN_SPACE: "open space"}  # what kept the ego safe
_SEEN_AHEAD = 80.0  # of its path [m]
_TRUCK = 7.5  # longer vehicles are trucks [m]
_SIGNALS = {GREEN: SIGNALS.index("green"), YELLOW: SIGNALS.index("yellow"), RED: SIGNALS.index("red")}


def record_trace(env: gym.Env, policy: Callable[[Any], Any], seed: int | None = None) -> Trace:
    """Play one episode and write down everything.

    Args:
      env: any environment of highway-env, with a shield (`make`) or without.
      policy: takes an observation, returns an action.
      seed: of the episode.
    """
    observation, info = env.reset(seed=seed)
    film = Film(env, seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy(observation))
        film.look_for_contacts()
        ended = terminated or truncated
    return film.develop(info)


class Film:
    """Films an episode that has just begun. `develop` makes a trace of what has been seen so far.

    It looks on when everybody has chosen a command and nobody has moved: it stands in for `road.step`, in the road's
    own `__dict__`, and changes nothing.
    """

    def __init__(self, env: gym.Env, seed: int | None = None) -> None:
        self.env, self.seed = env, seed
        inner: Any = env.unwrapped
        self.road = inner.road
        self.dt = 1.0 / inner.config["simulation_frequency"]
        self.lanes = lanes_of(self.road.network)
        self.lane_number = {index: i for i, index in enumerate(self.road.network.lanes_dict())}
        self.users: list[Any] = []
        self.row: dict[int, int] = {}  # by identity; `users` keeps them alive
        self.samples: list[dict[int, tuple[float, ...]]] = []
        self.commands: list[dict[int, tuple[float, float]]] = []
        self.signals: list[tuple[int, ...]] = []
        self.egos: dict[int, _EgoFilm] = {}  # by row
        self.paths: list[np.ndarray] = []
        self.path_number: dict[tuple[int, int], int] = {}
        self.routes: list[list[Any]] = []
        self.announced: dict[int, Any] = {}  # the last of them, by row
        self.rights: dict[int, list[Any]] = {}  # by row
        self.hit: dict[int, int] = {}  # sample at which the simulator says first that there is contact, or will be
        self.clock = float(getattr(self.road, "clock", 0.0))  # of the lights
        self.events: list[Event] = []
        self.contacts: dict[int, Contact] = {}
        for ego in inner.controlled_vehicles:
            self._film_of(ego)
        self.road.step = self._step

    @property
    def time(self) -> float:
        return len(self.samples) * self.dt

    # -- called by highway-env

    def _step(self, dt: float) -> None:
        self._take_sample()
        env: Any = self.env.unwrapped
        for vehicle in env.controlled_vehicles:
            self._film_of(vehicle).look(self)
        self._note_contacts(len(self.samples) - 1)
        type(self.road).step(self.road, dt)
        self.commands.append(
            {
                self.row[id(v)]: (float(v.action["acceleration"]), float(v.action["steering"]))
                for v in self.road.vehicles
                if id(v) in self.row
            }
        )

    def _take_sample(self) -> None:
        self.samples.append({self._row_of(v): self._state(v) for v in self._everybody()})
        for vehicle in self.road.vehicles:
            self._note_route(vehicle)
            self._note_right(vehicle)
        for user in self._everybody():
            if user.crashed or getattr(user, "impact", None) is not None:
                self.hit.setdefault(self._row_of(user), len(self.samples) - 1)
        if isinstance(self.road, SignalisedRoad):
            self.signals.append(tuple(_SIGNALS[self.road.signal(k)] for k in range(4)))

    def _everybody(self) -> list[Any]:
        return [*self.road.vehicles, *(o for o in self.road.objects if not isinstance(o, Landmark))]

    def _row_of(self, user: Any) -> int:
        if id(user) not in self.row:
            self.row[id(user)] = len(self.users)
            self.users.append(user)
        return self.row[id(user)]

    def _state(self, v: Any) -> tuple[float, ...]:
        lane = self.lane_number.get(getattr(v, "lane_index", None) or (), -1)
        return (*map(float, v.position), float(v.heading), float(v.speed), float(v.crashed), lane)

    def _note_right(self, vehicle: Any) -> None:
        """May a vehicle that has just been seen first pass its line? That depends on what was before."""
        row = self._row_of(vehicle)
        if row not in self.rights and hasattr(vehicle, "has_right"):
            self.rights[row] = [int(vehicle.approach), bool(vehicle.has_right), bool(vehicle.ran_red_light)]

    def _note_route(self, vehicle: Any) -> None:
        """Lane that a driver heads for, "" = it is steered freely, and the roads of its route, when they change."""
        row, target = self._row_of(vehicle), getattr(vehicle, "target_lane_index", None)
        announced = target, tuple(step[:2] for step in getattr(vehicle, "route", None) or [])
        if self.announced.get(row) != announced:
            self.announced[row] = announced
            route = [list(road) for road in announced[1]]
            self.routes.append([len(self.samples) - 1, row, lane_id(target) if target else "", route])

    def _film_of(self, vehicle: Any) -> "_EgoFilm":
        return self.egos.setdefault(self._row_of(vehicle), _EgoFilm(vehicle))

    def look_for_contacts(self) -> None:
        """Note the verdicts that have been reached since the last time. Partners are indices on the road as it is now.

        To be called after each decision: a shield judges a contact at the end of it at the latest.
        """
        self._note_contacts(len(self.samples))

    def _note_contacts(self, sample: int) -> None:
        road = [*self.road.vehicles, *self.road.objects]
        for row, film in self.egos.items():
            shield = shield_on(film.vehicle)
            if shield is None or row in self.contacts or shield.judge.contact is None:
                continue
            found = dict(shield.judge.contact)
            k = found.pop("partner")
            partner = self._row_of(road[k]) if 0 <= k < len(road) else -1
            self.contacts[row] = Contact(sample * self.dt, row, partner, found.pop("verdict"), found)

    # -- afterwards

    def develop(self, info: dict[str, Any] | None = None) -> Trace:
        """The trace of what has been filmed.

        Args:
          info: of the last step, for what it says about blame.
        """
        self._take_sample()  # where everybody has got to
        try:
            return self._trace(info or {})
        finally:
            self.samples.pop()
            del self.signals[len(self.samples) :]

    def _trace(self, info: dict[str, Any]) -> Trace:
        states = np.full((len(self.samples), len(self.users), 6), np.nan)
        for t, sample in enumerate(self.samples):
            for row, state in sample.items():
                states[t, row] = state
        commands = np.full((len(self.samples), len(self.users), 2), np.nan)
        for t, chosen in enumerate(self.commands):
            for row, command in chosen.items():
                commands[t, row] = command
        x, y, heading, speed, crashed, lane = np.moveaxis(states, -1, 0)
        users = users_of(
            [f"{row}" for row in range(len(self.users))],
            [_kind(v) for v in self.users],
            [v.LENGTH for v in self.users],
            [v.WIDTH for v in self.users],
            *(x, y, heading, speed, commands[..., 0], commands[..., 1]),
            np.nan_to_num(crashed) > 0.5,
            np.nan_to_num(lane, nan=-1.0),
        )
        egos = tuple(film.ego(row, self) for row, film in sorted(self.egos.items()))
        trace = Trace(
            self.dt,
            np.arange(len(self.samples)) * self.dt,
            users,
            self.lanes,
            self._lights(),
            tuple(self.paths),
            egos,
            (),
            tuple(self.contacts.values()),
            self._meta(info),
        )
        return trace.replaced(events=_events(trace, self.events, self.hit))

    def _lights(self) -> tuple[Light, ...]:
        lights = []
        for k in range(4) if self.signals else ():
            index = next(i for i in self.lane_number if i[0] == f"o{k}" and i[1][:2] == "ir")
            lane = self.road.network.get_lane(index)
            x, y = lane.position(LINE, 0.0)
            signal = np.array([signals[k] for signals in self.signals])
            lights.append(Light(f"o{k}", (lane_id(index),), float(x), float(y), float(lane.heading_at(LINE)), signal))
        return tuple(lights)

    def _meta(self, info: dict[str, Any]) -> dict[str, Any]:
        env: Any = self.env.unwrapped
        shield = _shield_around(self.env)
        meta: dict[str, Any] = {
            "env_id": env.spec.id if env.spec else type(env).__name__,
            "seed": self.seed,
            "config": dict(env.config),
            "versions": {name: _version(name) for name in ("rss-shield", "highway-env", "numpy", "numba")},
            "network": configuration(self.road.network),
            "routes": self.routes,
            "shielded": [row for row, user in enumerate(self.users) if "act" in vars(user)],
            "mode": "off",
            "integration": "euler",
        }
        walkers = [(row, user) for row, user in enumerate(self.users) if isinstance(user, Walker)]
        if walkers:  # who they are, and on which sample the ego saw them first; -1 = never
            meta["pedestrians"] = [
                {
                    "row": row,
                    "errand": ERRANDS[walker.errand.kind],
                    "place": list(walker.place),
                    "reasonable": walker.is_reasonable,
                    "first_seen": int(getattr(walker, "first_seen", -1)),
                }
                for row, walker in walkers
            ]
        if isinstance(self.road, SignalisedRoad):
            meta |= {"clock": self.clock, "rights": self.rights}
        if shield is not None:
            table, judge = shield.settings.table, (shield._judge or shield.settings).table
            meta |= {
                "mode": shield.mode,
                "scheme": _SCHEMES[shield.settings.scheme],
                "params": {"ego": table.ego._asdict(), "other": table.other._asdict()},
                "rules": table.rules._asdict(),
                "judge_params": {"ego": judge.ego._asdict(), "other": judge.other._asdict()},
                "judge_rules": judge.rules._asdict(),
                "conduct": {name: getattr(shield.options, name) for name in ("entry", "intent", "waiting", "examine")},
                "traffic": shield.options.traffic,
                "conditions": _written(shield.options.conditions),
                "classes": _written(shield.options.classes),
                "blame": info.get("blame", ""),
                "dangerous_pairs": info.get("episode_dangerous_pairs", 0),
                "broken_duties": info.get("episode_broken_duties", 0),
            }
        return meta


def _written(option: Any) -> Any:
    """An option as JSON has it: of a mapping whose keys may be intervals a list of pairs."""
    return [[key, value] for key, value in option.items()] if isinstance(option, Mapping) else option


class _EgoFilm:
    """What one ego's shield saw, frame by frame."""

    def __init__(self, vehicle: Any) -> None:
        self.vehicle = vehicle
        self.frames = -1  # that its shield had counted by the last look
        self.seen: dict[int, dict[str, Any]] = {}  # by sample
        self.refused = -1  # frames before the decision of which a refusal has been noted

    def look(self, film: Film) -> None:
        """To be called on a frame on which the shield has decided, before anybody moves."""
        t = len(film.samples) - 1
        shield = shield_on(self.vehicle)
        if shield is None or shield.look is None or shield.since["frames"] == self.frames:
            return
        self.frames = int(shield.since["frames"])
        look = shield.look
        name = response_name(look.response)
        seen: dict[str, Any] = {
            "wanted_acceleration": look.wish.acceleration,
            "wanted_steering": float(steering_of(look.wish.slip)),
            "changed_by": CHANGED_BY.index(_changed_by(look)),
            "response": 0 if name == "none" else RESPONSES.index(name),
            "dangerous": look.dangerous,
        }
        partner = look.partner
        if isinstance(shield, JunctionEgo):
            partner = _see_plan(seen, shield, look, film)
        elif shield.settings.scheme == LANES:
            _see_neighbours(seen, shield, film)
        seen["partner"] = film._row_of(shield.others[partner]) if partner >= 0 else -1
        self.seen[t] = seen
        decision = self.frames - int(shield.tally["frames"])  # frames before it
        if shield.tally["lane_change_refused"] and self.refused != decision:
            self.refused = decision
            film.events.append(Event(t * film.dt, "lane change refused", film._row_of(self.vehicle)))

    def ego(self, row: int, film: Film) -> Ego:
        """Everything as arrays."""
        ego = ego_of(row, len(film.samples), AREAS)
        for t, seen in self.seen.items():
            for name, value in seen.items():
                getattr(ego, name)[t] = value
        return ego


def _changed_by(look: Look) -> str:
    if look.overridden:
        return "response"
    return "anticipation" if look.anticipated else "limits" if look.limited else ""


def _see_neighbours(seen: dict[str, Any], shield: ShieldedEgo, film: Film) -> None:
    """Gap and required gap to the nearest in each direction."""
    gap, required, nearest = around(shield)
    neighbour = np.array([film._row_of(shield.others[i]) if i >= 0 else -1 for i in nearest])
    seen.update(gap=gap, required=required, neighbour=neighbour)


def _see_plan(seen: dict[str, Any], shield: JunctionEgo, look: Look, film: Film) -> int:
    """The plan in force and what is in the way; returns the index of who holds the ego back, -1 = nobody."""
    track, roads = shield.track, shield.junction.roads
    assert track is not None
    scene = shield._scene_of(track, shield.room[: shield.ways], roads)
    paths = roads.paths
    go = int(shield.plan["go"]) if shield.settings.overrides else -1
    number = film.path_number.setdefault((id(shield.junction), track.path), len(film.paths))
    if number == len(film.paths):
        boxes = paths.boxes[track.path, : paths.cells[track.path]]
        along = (np.arange(len(boxes)) + 0.5) * CELL
        film.paths.append(np.column_stack([along, boxes[:, X], boxes[:, Y]]))
    s, v = track.s, track.v
    a = look.command.acceleration
    for _ in range(go):
        s, v = s + v * scene.table.dt, max(v + a * scene.table.dt, 0.0)
        a = throttle(scene, s, v)
    s += stopping_distance(v, scene.table.ego.a_min_brake)
    (area, area_user), known = _areas(scene), shield.others  # who may be hidden is nobody who is known
    seen |= {
        "plan": PLANS.index("go" if go > 0 else "stop") if go >= 0 else 0,
        "path": number,
        "path_s": track.s,
        "plan_end": s if go >= 0 else np.nan,
        "area": area,
        "area_user": np.array([film._row_of(known[i]) if 0 <= i < len(known) else -1 for i in area_user]),
    }
    if not look.overridden:
        return -1
    return int(held_by(scene, look.wish.acceleration, len(shield.others), not shield.settings.waits_anywhere))


def _areas(scene: Any) -> tuple[np.ndarray, list[int]]:
    """Stretches of the ego's path that lie in the ways of others, the nearest first."""
    paths, track = scene.paths, scene.track
    count = paths.cells[track.path]
    first = cell_of(track.s, count)
    last = min(first + int(_SEEN_AHEAD / CELL), count)
    found: dict[tuple[float, float, int], None] = {}
    for threat in scene.threats:
        if threat["path"] < 0:
            hit = np.zeros(last - first, bool)
            hit[max(threat["from_cell"] - first, 0) : max(threat["to_cell"] + 1 - first, 0)] = True
        elif threat["follows"]:
            continue
        else:
            low, high, low_2, high_2 = paths.conflicts[track.path, threat["path"], first:last].T
            at = threat["s"] - threat["half_length"]
            hit = (np.isfinite(low) & (high >= at)) | (np.isfinite(low_2) & (high_2 >= at))
        for a, b in stretches(hit):
            found[float((first + a) * CELL), float((first + b) * CELL), int(threat["user"])] = None
    area, users = np.full((AREAS, 2), np.nan), [-1] * AREAS
    for k, (start, end, user) in enumerate(sorted(found)[:AREAS]):
        area[k], users[k] = (start, end), user
    return area, users


def _events(trace: Trace, noted: list[Event], hit: dict[int, int]) -> tuple[Event, ...]:
    """What happened when, in order."""
    events = list(noted)
    for ego in trace.egos:
        for name, on, text in (
            ("danger", ego.dangerous, ego.response),
            ("response", ego.changed_by == CHANGED_BY.index("response"), ego.response),
        ):
            for start, end in stretches(on):
                partner = int(ego.partner[start])
                events.append(
                    Event(float(trace.time[start]), f"{name} begins", ego.user, partner, RESPONSES[text[start]])
                )
                if end < len(on):
                    events.append(Event(float(trace.time[end]), f"{name} ends", ego.user, partner))
    users = trace.users
    for row, t in hit.items():
        distance = np.hypot(users.x[t] - users.x[t, row], users.y[t] - users.y[t, row])
        others = [other for other, at in hit.items() if other != row and at <= t]
        events.append(Event(float(trace.time[t]), "contact", row, min(others, key=lambda i: distance[i], default=-1)))
    for contact in trace.contacts:
        assert contact.verdict in VERDICTS
        events.append(Event(contact.time, "verdict", contact.user, contact.partner, contact.verdict))
    return tuple(sorted(events, key=lambda event: event.time))


def _kind(user: Any) -> str:
    if isinstance(user, Walker):
        return "pedestrian"
    if not hasattr(user, "action"):
        return "obstacle"
    if getattr(user, "WALKS", False):
        return "pedestrian"
    return "truck" if user.LENGTH > _TRUCK else "car"


def _shield_around(env: gym.Env) -> EgoShields | None:
    while isinstance(env, gym.Wrapper):
        if isinstance(env, EgoShields):
            return env
        env = env.env
    return None


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
