"""What one ego sees of highway-env's road: copies of the road users, as its sensors have them.

The shield reads a copy as it reads a vehicle. A copy stays the same object for as long as its road user is seen,
because the shield knows road users by identity.
"""

import copy
from typing import Any, NamedTuple

import numpy as np
from highway_env.vehicle.objects import Landmark

from rss_shield.envs.sensing import (
    PERCEPT,
    Sensor,
    age_of,
    haunt,
    is_light_wrong,
    meet,
    mixed,
    perceive,
    position_of,
)
from rss_shield.shield.definitions.sensing import lateral_error, longitudinal_error
from rss_shield.shield.definitions.signals import GREEN, RED


class SemanticErrors(NamedTuple):
    """How far off what was seen is, in the units of Defs. 29 and 30; M sightings in T frames."""

    lon: np.ndarray  # `[M]` relative to the distance along the ego's lane, beyond 1 m [1]
    lat: np.ndarray  # `[M]` [lane widths]
    missed: int  # road users of a frame who were not seen, added up
    ghosts: int  # ghosts of a frame, added up
    frames: int  # T


class Senses:
    """The sensors of one ego.

    Args:
      sensor: `Sensor`.
      key: of the episode.
      noted: keep the places of all sightings, for `semantic_errors`.
    """

    def __init__(self, sensor: Sensor, key: np.uint64, noted: bool = False) -> None:
        self.sensor, self.key = sensor, np.uint64(key)
        self.copies: list[Any] = []  # `[K]` of everybody who is there
        self.percepts = np.zeros(0, PERCEPT)  # `[K]`
        self.met = 0
        self.ghost: Any = None
        self.haunted = np.zeros(1, PERCEPT)
        self.haunted["since"] = -1
        self.frame = 0
        self.ages = np.zeros(0)  # `[N]` of what is known of those who are seen [s]
        self.motion = np.zeros((0, 2))  # `[N]` of them [m/s]
        self.sightings: list[tuple[float, float, float, float]] | None = [] if noted else None
        self.missed = self.ghosts = self.frames = 0

    def look(self, others: list[Any], ego: Any, frame: int) -> list[Any]:
        """Whom the ego sees on a frame, as copies; to look twice changes nothing.

        Args:
          others: `[K]` road users who are there.
          ego: its vehicle.
          frame: number of the frame.
        """
        sensor, self.frame = self.sensor, frame
        self._follow(others, frame)
        seen, percepts = [], []
        for one, percept in zip(self.copies, self.percepts, strict=True):
            original = one.original
            vars(one).update(vars(original))
            state = *map(float, original.position), float(original.heading), float(original.speed)
            far = float(np.hypot(*(original.position - ego.position)))
            if perceive(percept, frame, *state, far, sensor):
                self._place(one, percept)
                seen.append(one)
                percepts.append(percept)
        pose = *map(float, ego.position), float(ego.heading), float(ego.speed)
        if haunt(self.haunted[0], self.key, frame, *pose, sensor):
            seen.append(self._ghost_like(ego))
            percepts.append(self.haunted[0])
        else:
            self.ghost = None
        self.ages = np.array([age_of(percept, frame, sensor) for percept in percepts])
        self.motion = np.array([(percept["vx"], percept["vy"]) for percept in percepts]).reshape(-1, 2)
        return seen

    def colour(self, light: int) -> int:
        """The colour that a light is taken to have."""
        swapped = {GREEN: RED, RED: GREEN}
        return swapped.get(light, light) if is_light_wrong(self.key, self.frame, self.sensor) else light

    def note(self, seen: list[Any], ego: Any) -> None:
        """Keep what is seen on this frame beside what is there, if asked to."""
        if self.sightings is None:
            return
        lane = ego.lane
        here, _ = lane.local_coordinates(ego.position)
        for one in seen:
            if one.original is not None:
                there, sensed = (lane.local_coordinates(v.position) for v in (one.original, one))
                widths = lane.width_at(there[0]), lane.width_at(sensed[0])
                self.sightings.append((there[0] - here, there[1] / widths[0], sensed[0] - here, sensed[1] / widths[1]))
        self.ghosts += self.ghost is not None
        self.missed += len(self.copies) - (len(seen) - (self.ghost is not None))
        self.frames += 1

    def _follow(self, others: list[Any], frame: int) -> None:
        """Keep the copies of who is there still, and meet who is new."""
        if len(others) == len(self.copies) and all(a is b.original for a, b in zip(others, self.copies, strict=True)):
            return
        known = {id(one.original): i for i, one in enumerate(self.copies)}
        copies, percepts = [], np.zeros(len(others), PERCEPT)
        for i, other in enumerate(others):
            k = known.get(id(other))
            if k is None:
                state = *map(float, other.position), float(other.heading), float(other.speed)
                meet(percepts[i], np.uint64(mixed(self.key, self.met)), frame, *state, self.sensor.dt)
                self.met += 1
                copies.append(copy.copy(other))
                copies[-1].original = other
            else:
                percepts[i] = self.percepts[k]
                copies.append(self.copies[k])
        self.copies, self.percepts = copies, percepts

    def _place(self, one: Any, percept: Any) -> None:
        one.position = np.array(position_of(percept, self.frame, self.sensor))
        one.heading, one.speed = float(percept["heading"]), float(percept["speed"])

    def _ghost_like(self, ego: Any) -> Any:
        """A car like the ego where the ghost is; another one for every ghost."""
        percept = self.haunted[0]
        if self.ghost is None or self.ghost.since != percept["since"]:
            ghost = copy.copy(ego)
            vars(ghost).pop("act", None)
            ghost.original, ghost.since, ghost.crashed = None, int(percept["since"]), False
            ghost.action = {"steering": 0.0, "acceleration": 0.0}
            self.ghost = ghost
        self._place(self.ghost, percept)
        return self.ghost


def semantic_errors(senses: Senses) -> SemanticErrors:
    """Semantic errors (Defs. 29, 30) of every sighting so far.

    Raises:
      ValueError: nothing was kept.
    """
    if senses.sightings is None:
        raise ValueError("record = False: expected True to keep what was sensed")
    lon, lat, lon_sensed, lat_sensed = np.array(senses.sightings).reshape(-1, 4).T
    return SemanticErrors(
        longitudinal_error(lon, lon_sensed),
        lateral_error(lat, lat_sensed),
        senses.missed,
        senses.ghosts,
        senses.frames,
    )


class Seen:
    """Inside, highway-env's road holds what an ego sees: for its observation.

    Args:
      env: highway-env's environment.
      senses: of the ego.
      ego: its vehicle.
      frame: number of the frame.
    """

    def __init__(self, env: Any, senses: Senses, ego: Any, frame: int) -> None:
        self.road, self.ego = env.road, ego
        self.senses, self.frame = senses, frame

    def __enter__(self) -> None:
        road, ego = self.road, self.ego
        self.there = road.vehicles, road.objects
        others = others_on(road, ego)
        seen = self.senses.look(others, ego, self.frame)
        objects = {id(one) for one in road.objects}
        road.vehicles = [ego, *(one for one in seen if id(one.original) not in objects)]
        road.objects = [one for one in seen if id(one.original) in objects]

    def __exit__(self, *_: Any) -> None:
        self.road.vehicles, self.road.objects = self.there


def others_on(road: Any, ego: Any) -> list[Any]:
    """Everybody on a road whom the ego can touch."""
    users = [*road.vehicles, *(one for one in road.objects if not isinstance(one, Landmark))]
    # who cannot be touched needs no distance
    return [one for one in users if one is not ego and one.collidable and ego.collidable]
