"""What a shield gets to see may differ from what is there: errors of a sensing system (Defs. 28-32).

`Sensing` says what goes wrong, in SI units; `Sensor` is the same in frames, for compiled code. Both simulators
measure road users with `perceive`, so the same seed has the same errors on either.

Every random number is a hash of (the episode's key, the road user, what it is for, when), so no generator has a
state: errors don't depend on who else is there, on the order in which somebody asks, or on how often. The hash is
SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from rss_shield.envs.arguments import number, whole
from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.lanes.inflation import LARGEST_ACROSS, Accuracy
from rss_shield.shield.sampling import frames_for

NOISES = ("bounded", "gaussian")
SUBSYSTEMS = (1, 3)
DEVIATIONS = 3.0  # standard deviations that inflation counts on where noise is gaussian
HISTORY = 32  # frames that are kept of a road user
NEVER = -(10**9)
LANE_WIDTH = 4.0  # highway-env's [m]
NEAREST_GHOST, FARTHEST_GHOST = 10.0, 60.0  # centre to centre, ahead of the ego [m]


@dataclass(frozen=True)
class Sensing:
    """What goes wrong between the world and the shield; nothing by default.

    The ego knows its own state. Errors of position, speed and heading last for `hold` and are drawn anew then, for
    each road user on its own. The judge sees what is there, always.

    Args:
      along, across: error of a position along and across the road user's heading [m]: a bound, or where noise is
        gaussian a standard deviation.
      speed: of the speed [m/s], likewise.
      heading: of the heading [rad], likewise.
      noise: "bounded", uniform within the bounds, or "gaussian".
      hold: how long an error lasts [s]; 0: one frame.
      misses: share of the time for which a road user is not seen, from 0 to 0.5 [1].
      miss_duration: how long it is not, at a time [s]. Somebody new is seen first, and twice in a row nobody is missed.
      ghosts: share of the time for which somebody is seen ahead who is not there, within one lane and 60 m [1].
      ghost_duration: of each [s].
      wrong_lane: share of the time for which a road user is put into the lane beside its own [1].
      wrong_light: share of the time for which red is taken for green and green for red [1].
      semantics_duration: how long a wrong lane or light lasts [s].
      latency: age of everything that is seen [s].
      range: how far is seen [m].
      subsystems: 1, or 3 independent ones: what two of three say counts (Corollary 3), and of numbers the middle one.
      agent: the agent observes what is sensed, too; else what is there.
      inflate: the shield goes by the worst within the bounds (`rss_shield.shield.lanes.inflation`), and remembers
        whoever is not seen for `miss_duration`. Gaussian noise is taken to be within 3 standard deviations. Along
        lanes only.
      excess: how many times worse errors, misses and latency are than is said here, to break the promise that inflation
        relies on [1].
      seed: of the errors, beside that of the environment.

    Raises:
      ValueError: names the field, its value and what is expected.
    """

    along: float = 0.0
    across: float = 0.0
    speed: float = 0.0
    heading: float = 0.0
    noise: str = "bounded"
    hold: float = 0.0
    misses: float = 0.0
    miss_duration: float = 0.2
    ghosts: float = 0.0
    ghost_duration: float = 0.5
    wrong_lane: float = 0.0
    wrong_light: float = 0.0
    semantics_duration: float = 0.5
    latency: float = 0.0
    range: float = math.inf
    subsystems: int = 1
    agent: bool = False
    inflate: bool = False
    excess: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, most in _LIMITS.items():
            number(f"sensing.{name}", getattr(self, name), 0.0, most)
        if math.isnan(self.range) or self.range <= 0.0:
            raise ValueError(f"sensing.range = {self.range!r}: expected a number > 0, inf = no limit")
        for name in ("agent", "inflate"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"sensing.{name} = {getattr(self, name)!r}: expected True or False")
        for name, known in (("noise", NOISES), ("subsystems", SUBSYSTEMS)):
            if getattr(self, name) not in known:
                raise ValueError(
                    f"sensing.{name} = {getattr(self, name)!r}: expected one of {', '.join(map(str, known))}"
                )
        whole("sensing.seed", self.seed, 0)
        if self.inflate and self.accuracy.across > LARGEST_ACROSS:
            raise ValueError(
                f"sensing.across = {self.across!r} with inflate: expected errors across the lane <= "
                f"{LARGEST_ACROSS:g} m, or nobody knows who is on which side"
            )

    @classmethod
    def of(cls, given: Any) -> "Sensing | None":
        """Sensing as such or as a dict of what goes wrong; None = nothing."""
        if given is None or isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(f"sensing = {given!r}: expected Sensing, a dict of its fields or None")
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                raise ValueError(f"sensing has an unknown field {name!r}: expected {', '.join(known)}")
        return cls(**given)

    @property
    def accuracy(self) -> Accuracy:
        """What inflation counts on."""
        widely = DEVIATIONS if self.noise == "gaussian" else 1.0
        return Accuracy(widely * self.along, widely * self.across, widely * self.speed, widely * self.heading)

    def sensor(self, dt: float) -> "Sensor":
        """The same for frames of `dt` [s]; durations are rounded up to whole ones.

        Raises:
          ValueError: what is seen is older than what is kept.
        """

        def frames(duration: float) -> int:
            return int(frames_for(duration, dt))

        delay = frames(self.latency * self.excess)
        if delay > HISTORY - 2:
            longest = (HISTORY - 2) * dt
            raise ValueError(
                f"sensing.latency = {self.latency!r} with excess = {self.excess!r}: expected <= {longest:g} s in all"
            )
        numbers = (self.along, self.across, self.speed, self.heading)
        return Sensor(
            Accuracy(*(float(self.excess * value) for value in numbers)),
            self.accuracy,
            self.noise == "gaussian",
            max(frames(self.hold), 1),
            float(self.misses),
            max(frames(self.miss_duration * self.excess), 1),
            max(frames(self.miss_duration), 1) if self.inflate and self.misses > 0.0 else 0,
            float(self.ghosts),
            max(frames(self.ghost_duration), 1),
            float(self.wrong_lane),
            float(self.wrong_light),
            max(frames(self.semantics_duration), 1),
            frames(self.latency),
            delay,
            float(self.range),
            self.subsystems,
            self.inflate,
            self.agent,
            dt,
        )

    def keys(self, seed: int | None) -> np.uint64:
        """Key of the first episode after a reset with a seed; None: any."""
        entropy = None if seed is None else [self.seed, seed]
        return np.random.SeedSequence(entropy).generate_state(1, np.uint64)[0]


_LIMITS = {
    **{"along": 100.0, "across": 10.0, "speed": 100.0, "heading": 1.0, "hold": 60.0},
    **{"misses": 0.5, "miss_duration": 60.0, "ghosts": 1.0, "ghost_duration": 60.0},
    **{"wrong_lane": 1.0, "wrong_light": 1.0, "semantics_duration": 60.0, "latency": 10.0, "excess": 100.0},
}


class Sensor(NamedTuple):
    """`Sensing` in frames."""

    errors: Accuracy  # that are drawn
    accuracy: Accuracy  # that inflation counts on
    gaussian: bool
    hold: int  # frames that an error lasts
    misses: float
    miss_frames: int
    kept_frames: int  # for which somebody is remembered who is not seen
    ghosts: float
    ghost_frames: int
    wrong_lane: float
    wrong_light: float
    semantics_frames: int
    said_delay: int  # age of what is seen, as it is said to be, in frames ...
    delay: int  # ... and as it is
    range: float  # [m]
    subsystems: int
    inflates: bool
    to_agent: bool
    dt: float  # [s]


# What a sensor knows of one road user.
PERCEPT = np.dtype(
    [
        ("key", "u8"),
        ("since", "i8"),  # frame of the first sight
        ("stamp", "i8"),  # frame that the last measurement is said to be of, NEVER = there was none
        ("x", "f8"),  # that measurement [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("speed", "f8"),  # [m/s]
        ("vx", "f8"),  # motion over the frame before [m/s]
        ("vy", "f8"),
        # what was there, by frame modulo HISTORY
        ("x_was", "f8", (HISTORY,)),
        ("y_was", "f8", (HISTORY,)),
        ("heading_was", "f8", (HISTORY,)),
        ("speed_was", "f8", (HISTORY,)),
    ],
    align=True,
)

# what a number is drawn for; each of three subsystems has a number of its own
ALONG, ACROSS, SPEED, HEADING, MISS, LANE, SIDE, GHOST, PLACE, BESIDE, PACE, LIGHT = range(12)
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_TO_UNIT = 1.0 / 9007199254740992.0
_TURN = np.uint64(11)


@compiled
def mixed(key, number):
    """A key made of a key and a whole number >= 0 (SplitMix64)."""
    z = key + (np.uint64(number) + np.uint64(1)) * _GOLDEN
    z = (z ^ (z >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    return z ^ (z >> np.uint64(31))


@compiled
def drawn(key, purpose, subsystem, block):
    """A number uniform in [0, 1).

    Args:
      key: of a road user, or of an episode.
      purpose: ALONG, ACROSS, ...
      subsystem: 0, 1 or 2.
      block: which of the intervals that it lasts for.
    """
    return float(mixed(mixed(key, 3 * purpose + subsystem), block) >> _TURN) * _TO_UNIT


@inner
def _deviation(key, purpose, subsystem, block, gaussian):
    """An error of size 1: uniform in [-1, 1), or standard normal (Box, Muller 1958)."""
    first = drawn(key, purpose, subsystem, block)
    if not gaussian:
        return 2.0 * first - 1.0
    second = drawn(mixed(key, block), purpose, subsystem, block)
    return np.sqrt(-2.0 * np.log(1.0 - first)) * np.cos(2.0 * np.pi * second)


@inner
def _error(key, purpose, block, size, sensor):
    """An error; the middle one of three subsystems."""
    if size == 0.0:
        return 0.0
    a = _deviation(key, purpose, 0, block, sensor.gaussian)
    if sensor.subsystems == 3:
        b = _deviation(key, purpose, 1, block, sensor.gaussian)
        c = _deviation(key, purpose, 2, block, sensor.gaussian)
        a = max(min(a, b), min(max(a, b), c))
    return size * a


@compiled
def goes_wrong(key, purpose, block, rate, subsystems):
    """Does something go wrong that does at a rate? With three subsystems: in two of them (Corollary 3)."""
    if rate == 0.0:
        return False
    if subsystems == 1:
        return drawn(key, purpose, 0, block) < rate
    wrong = 0
    for k in range(subsystems):
        wrong += drawn(key, purpose, k, block) < rate
    return wrong >= 2


# ---------------------------------------------------------------- one road user


@compiled
def meet(percept, key, frame, x, y, heading, speed, dt):
    """Somebody is there for the first time; before, it drove as it does now.

    Args:
      percept: PERCEPT record, overwritten.
      key: of the road user in this episode.
      frame: number of the frame.
      x, y, heading, speed: what is there [m], [rad], [m/s].
      dt: length of a frame [s].
    """
    percept.key, percept.since, percept.stamp = key, frame, NEVER
    percept.x = percept.y = percept.heading = percept.speed = percept.vx = percept.vy = 0.0
    dx, dy = speed * np.cos(heading) * dt, speed * np.sin(heading) * dt
    for back in range(HISTORY):
        k = (frame - back) % HISTORY
        percept.x_was[k], percept.y_was[k] = x - back * dx, y - back * dy
        percept.heading_was[k], percept.speed_was[k] = heading, speed


@compiled
def perceive(percept, frame, x, y, heading, speed, far, sensor):
    """Take in what is there, and measure it. To do so twice on a frame changes nothing.

    Args:
      percept: PERCEPT record, changed.
      frame, x, y, heading, speed: as in `meet`.
      far: distance from the ego [m].
      sensor: `Sensor`.

    Returns:
      Is anything known of this road user?
    """
    k = frame % HISTORY
    percept.x_was[k], percept.y_was[k] = x, y
    percept.heading_was[k], percept.speed_was[k] = heading, speed
    if far <= sensor.range and not _is_missed(percept, frame, sensor):
        percept.stamp = frame - sensor.said_delay
        _measure(percept, frame - sensor.delay, sensor)
        return True
    return frame - percept.stamp - sensor.said_delay <= sensor.kept_frames


@inner
def _is_missed(percept, frame, sensor):
    if sensor.misses == 0.0:
        return False
    block = (frame - percept.since) // sensor.miss_frames
    return block % 2 == 1 and goes_wrong(percept.key, MISS, block, 2.0 * sensor.misses, sensor.subsystems)


@inner
def _measure(percept, then, sensor):
    """Measure what was there on a frame, with errors."""
    k, before = then % HISTORY, (then - 1) % HISTORY
    x, y, heading, speed = percept.x_was[k], percept.y_was[k], percept.heading_was[k], percept.speed_was[k]
    cos, sin = np.cos(heading), np.sin(heading)
    key, errors, block = percept.key, sensor.errors, (then + HISTORY) // sensor.hold
    along, across = (
        _error(key, ALONG, block, errors.along, sensor),
        _error(key, ACROSS, block, errors.across, sensor),
    )
    if sensor.wrong_lane > 0.0:
        across += _lanes_off(percept, then, sensor) * LANE_WIDTH
    faster = _error(key, SPEED, block, errors.speed, sensor)
    percept.x, percept.y = x + along * cos - across * sin, y + along * sin + across * cos
    percept.heading = heading + _error(key, HEADING, block, errors.heading, sensor)
    percept.speed = speed + faster
    percept.vx = (x - percept.x_was[before]) / sensor.dt + faster * cos
    percept.vy = (y - percept.y_was[before]) / sensor.dt + faster * sin


@inner
def _lanes_off(percept, then, sensor):
    """By how many lanes it is put wrong: -1, 0 or 1."""
    block = (then + HISTORY) // sensor.semantics_frames
    if not goes_wrong(percept.key, LANE, block, sensor.wrong_lane, sensor.subsystems):
        return 0.0
    return 1.0 if drawn(percept.key, SIDE, 0, block) < 0.5 else -1.0


@compiled
def age_of(percept, frame, sensor):
    """Age that what is known of a road user is said to have [s]."""
    return (frame - percept.stamp) * sensor.dt


@compiled
def position_of(percept, frame, sensor):
    """Where a road user is taken to be now [m]: where it was seen, or if the shield inflates, moved on from there."""
    if not sensor.inflates:
        return percept.x, percept.y
    way = percept.speed * age_of(percept, frame, sensor)
    return percept.x + way * np.cos(percept.heading), percept.y + way * np.sin(percept.heading)


# ---------------------------------------------------------------- who is not there, and lights


@compiled
def haunt(percept, key, frame, x, y, heading, speed, sensor):
    """Is somebody seen who is not there? Then `percept` is where, and how fast it drives on from there.

    Args:
      percept: PERCEPT record of the ghost, changed.
      key: of the episode.
      frame: number of the frame.
      x, y, heading, speed: of the ego.
      sensor: `Sensor`.
    """
    block = frame // sensor.ghost_frames
    if not goes_wrong(key, GHOST, block, sensor.ghosts, sensor.subsystems):
        percept.since = -1
        return False
    cos, sin = np.cos(heading), np.sin(heading)
    if percept.since < 0 or percept.since // sensor.ghost_frames != block:
        ahead = NEAREST_GHOST + (FARTHEST_GHOST - NEAREST_GHOST) * drawn(key, PLACE, 0, block)
        aside = LANE_WIDTH * (np.floor(3.0 * drawn(key, BESIDE, 0, block)) - 1.0)
        percept.key, percept.since = mixed(key, block), frame
        percept.x_was[0], percept.y_was[0] = x + ahead * cos - aside * sin, y + ahead * sin + aside * cos
        percept.heading, percept.speed = heading, max(speed, 0.0) * drawn(key, PACE, 0, block)
    percept.vx, percept.vy = percept.speed * np.cos(percept.heading), percept.speed * np.sin(percept.heading)
    later = (frame - percept.since) * sensor.dt
    percept.x, percept.y = percept.x_was[0] + percept.vx * later, percept.y_was[0] + percept.vy * later
    percept.stamp = frame
    return True


@compiled
def is_light_wrong(key, frame, sensor):
    """Is the colour of a light taken for the other?"""
    return goes_wrong(key, LIGHT, frame // sensor.semantics_frames, sensor.wrong_light, sensor.subsystems)
