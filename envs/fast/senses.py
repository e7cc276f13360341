"""What egos see in the engine: cars as their sensors have them, and a judge beside the shield who sees what is there.

Where nothing goes wrong there is none of this: `Aware` is None then, and numba compiles the kernel without what it
would need.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs._numpy.floats import norm
from rss_shield.envs.fast.motion import set_heading
from rss_shield.envs.fast.neighbours import Distances, Past, make_past
from rss_shield.envs.fast.state import CAR, EPISODE, STEP, TRAFFIC, UNSEEN
from rss_shield.envs.options import Settings
from rss_shield.envs.sensing import PERCEPT, Sensing, Sensor, haunt, meet, mixed, perceive, position_of
from rss_shield.shield._numba.compiled import inner, rare
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.tally import start_episode

GHOSTS = 1  # that there is room for


class Sensed(NamedTuple):
    """Sensors and judges of E egos, with N road users."""

    sensor: Sensor
    judging: Settings  # of the judge
    keys: np.ndarray  # `[E]` of the episode after a seed, ...
    begun: np.ndarray  # `[E]` ... and how many have begun since
    key: np.ndarray  # `[E]` of this episode
    cars: np.ndarray  # `[E, N + 1]` CAR as they are seen, the ghost last
    percepts: np.ndarray  # `[E, N + 1]` PERCEPT
    last: np.ndarray  # `[E, N + 1]` ROAD_USER, everybody else on the frame before
    judges: np.ndarray  # `[E]` EPISODE, of which a judge keeps what is its own
    verdicts: np.ndarray  # `[E]` STEP likewise
    past: Past  # of the judge
    blank: np.ndarray  # `[1]` MEMORY of a first sight


class Aware(NamedTuple):
    """`Sensed` of one ego."""

    sensor: Sensor
    judging: Settings
    key: np.uint64
    cars: np.ndarray  # `[N + 1]`
    percepts: np.ndarray
    last: np.ndarray
    judge: np.ndarray  # `[1]`
    verdict: np.ndarray  # `[1]`
    distances: Distances  # of the judge
    blank: np.ndarray


def make_sensed(sensing: Sensing, settings: Settings, num_envs: int, n: int) -> Sensed:
    """Nothing seen yet."""
    return Sensed(
        sensing.sensor(settings.table.dt),
        settings._replace(overrides=False),
        np.zeros(num_envs, np.uint64),
        np.zeros(num_envs, np.int64),
        np.zeros(num_envs, np.uint64),
        np.zeros((num_envs, n + GHOSTS), CAR),
        np.zeros((num_envs, n + GHOSTS), PERCEPT),
        np.zeros((num_envs, n + GHOSTS), ROAD_USER),
        np.zeros(num_envs, EPISODE),
        np.zeros(num_envs, STEP),
        make_past(num_envs, n),
        np.zeros(1, MEMORY),
    )


@inner
def aware_of(e, sensed, frames):
    """`Aware` of environment `e` of a batch; None where everything is seen as it is."""
    if sensed is None or frames is None:
        return None
    past = sensed.past
    return Aware(
        sensed.sensor,
        sensed.judging,
        sensed.key[e],
        sensed.cars[e],
        sensed.percepts[e],
        sensed.last[e],
        sensed.judges[e : e + 1],
        sensed.verdicts[e : e + 1],
        Distances(frames, Past(past.memory[e], past.trail[e], past.ego[e], past.near[e])),
        sensed.blank,
    )


@inner
def begin_episode(e, sensed):
    """Errors of the next episode have a key of their own."""
    if sensed is not None:
        sensed.key[e] = mixed(mixed(sensed.keys[e], sensed.begun[e]), 0)
        sensed.begun[e] += 1


@rare
def start_senses(cars, episode, aware):
    """Meet everybody at the start of an episode."""
    if aware is not None:
        met = 0
        for k in range(episode.cars):
            if k != episode.ego:
                car = cars[k]
                key = mixed(aware.key, met)
                meet(aware.percepts[k], key, 0, car.x, car.y, car.heading, car.speed, aware.sensor.dt)
                met += 1
        aware.percepts[episode.cars].since = -1
        start_episode(aware.judge[0])


@inner
def follow(episode, aware):
    """Let the judge know who is there."""
    judge = aware.judge[0]
    judge.ego, judge.cars, judge.vehicles = episode.ego, episode.cars, episode.vehicles


@inner
def look(cars, episode, aware):
    """Fill in `aware.cars` with what is seen of this frame, the ghost behind all others.

    To look twice changes nothing.
    """
    n, ego, sensor, frame = episode.cars, cars[episode.ego], aware.sensor, episode.frames
    for k in range(n):
        aware.cars[k] = cars[k]
        if k == episode.ego:
            continue
        car, seen, percept = cars[k], aware.cars[k], aware.percepts[k]
        far = norm(car.x - ego.x, car.y - ego.y)
        if perceive(percept, frame, car.x, car.y, car.heading, car.speed, far, sensor):
            _place(seen, percept, frame, sensor)
        else:
            seen.kind = UNSEEN
    ghost, percept = aware.cars[n], aware.percepts[n]
    ghost.kind = UNSEEN
    if haunt(percept, aware.key, frame, ego.x, ego.y, ego.heading, ego.speed, sensor):
        aware.cars[n] = ego
        ghost.kind, ghost.crashed, ghost.route = TRAFFIC, False, -1
        _place(ghost, percept, frame, sensor)


@inner
def _place(seen, percept, frame, sensor):
    seen.x, seen.y = position_of(percept, frame, sensor)
    seen.speed = percept.speed
    set_heading(seen, percept.heading)
