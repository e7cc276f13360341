"""One record of an episode: what recorder, judge, audit and replay page read.

A trace says what happened, frame by frame, for everybody on the road, and what the shields of the egos made of it. It
is written as one compressed file, a `.npz` of arrays with a JSON text for the rest, and nothing in it is executed when
it is read.

Sample t is the road at `time[t]`, before anybody has moved; commands of sample t are those that move everybody on to
sample t + 1, so the last sample has none. Angles are in the simulator's frame: headings grow to the right of the
driving direction (y points down, or to the right), and so do lateral values. NaN is what is not known, or not there.
"""

import json
import os
import zipfile
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

FORMAT, VERSION = "rss-shield trace", 1

KINDS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "obstacle", "unknown")
LINES = ("none", "striped", "continuous", "unknown")  # how a side of a lane is marked
SIGNALS = ("green", "yellow", "red", "unknown")
CHANGED_BY = ("", "limits", "anticipation", "response")  # what changed an ego's command; "" = nothing did
RESPONSES = ("", "longitudinal", "lateral", "both", "go")  # the proper response that was owed
PLANS = ("", "stop", "go")  # how an ego means to get on where roads cross
SIDES = ("ahead", "behind", "left", "right")  # columns of what was measured around an ego
EVENTS = (
    *("danger begins", "danger ends", "response begins", "response ends"),
    *("lane change refused", "contact", "verdict"),
)


@dataclass(frozen=True)
class Users:
    """Everybody on the road. N users, T samples; a user that is not there has NaN for its position."""

    ids: tuple[str, ...]  # `[N]`, no two alike
    kinds: tuple[str, ...]  # `[N]` among KINDS
    length: np.ndarray  # `[N]` [m]
    width: np.ndarray  # `[N]` [m]
    x: np.ndarray  # `[T, N]` centre [m]
    y: np.ndarray  # `[T, N]` [m]
    heading: np.ndarray  # `[T, N]` [rad]
    speed: np.ndarray  # `[T, N]` along the heading, negative in reverse [m/s]
    acceleration: np.ndarray  # `[T, N]` executed command [m/s^2], NaN = not known
    steering: np.ndarray  # `[T, N]` angle of the front wheels that was executed [rad], NaN = not known
    crashed: np.ndarray  # `[T, N]` bool
    lane: np.ndarray  # `[T, N]` index of the lane that it is on, -1 = not known

    @property
    def present(self) -> np.ndarray:
        """`[T, N]` bool: who is there."""
        return ~np.isnan(self.x)


@dataclass(frozen=True)
class Lane:
    """One lane. Between two points of its centre line it is an arc of constant curvature, or straight."""

    id: str
    centre: np.ndarray  # `[P, 3]` x, y [m], heading [rad]; P >= 2
    width: np.ndarray  # `[P]` [m]
    successors: tuple[str, ...] = ()  # ids of the lanes that go on where it ends
    left: str = ""  # id of the neighbour, "" = none
    right: str = ""
    left_runs_opposite: bool = False
    right_runs_opposite: bool = False
    left_line: str = "unknown"  # among LINES
    right_line: str = "unknown"
    speed_limit: float = np.inf  # [m/s]
    priority: int = 0  # the higher goes first where lanes cross


@dataclass(frozen=True)
class Light:
    """A traffic light at the end of the lanes that it is for."""

    id: str
    lanes: tuple[str, ...]  # ids
    x: float  # of the stop line's middle [m]
    y: float
    heading: float  # of who drives up to it [rad]
    signal: np.ndarray  # `[T]` index into SIGNALS


@dataclass(frozen=True)
class Ego:
    """What the shield of one ego saw and did. T samples; where it looked no more, after a contact, NaN and -1."""

    user: int  # index into `Users`
    wanted_acceleration: np.ndarray  # `[T]` [m/s^2]; what was executed is in `Users`
    wanted_steering: np.ndarray  # `[T]` [rad]
    changed_by: np.ndarray  # `[T]` index into CHANGED_BY
    response: np.ndarray  # `[T]` index into RESPONSES
    partner: np.ndarray  # `[T]` index of the user that it was about, -1 = nobody
    dangerous: np.ndarray  # `[T]` bool: something was owed to somebody
    # the nearest in each direction (SIDES), where distances along lanes keep an ego safe
    gap: np.ndarray  # `[T, 4]` bumper to bumper [m]
    required: np.ndarray  # `[T, 4]` by Defs. 1, 2, 6, margins included [m]
    neighbour: np.ndarray  # `[T, 4]` index of the user, -1 = nobody
    # the plan, where roads cross
    plan: np.ndarray  # `[T]` index into PLANS
    path: np.ndarray  # `[T]` index into `Trace.paths`, -1 = none
    path_s: np.ndarray  # `[T]` arc length of the ego on it [m]
    plan_end: np.ndarray  # `[T]` arc length where the plan comes to rest [m]
    # what others may be in the way of, on the path ahead: at most A stretches, padded with NaN and -1
    area: np.ndarray  # `[T, A, 2]` arc length from, to [m]
    area_user: np.ndarray  # `[T, A]` whose way it is


@dataclass(frozen=True)
class Event:
    """Something that happened at a moment."""

    time: float  # [s]
    kind: str  # among EVENTS
    user: int  # index into `Users`
    partner: int = -1
    text: str = ""


@dataclass(frozen=True)
class Contact:
    """Two road users touched, and who was to blame according to whom was asked."""

    time: float  # [s]
    user: int
    partner: int  # -1 = not known
    verdict: str  # "ego" (the user), "other", "both", "inherited" or "none"
    evidence: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Trace:
    """One episode.

    Raises:
      ValueError: arrays of the wrong shape, or names that are none; the message says which.
    """

    dt: float  # time between two samples [s]
    time: np.ndarray  # `[T]` [s]
    users: Users
    lanes: tuple[Lane, ...] = ()
    lights: tuple[Light, ...] = ()
    paths: tuple[np.ndarray, ...] = ()  # each `[P, 3]` arc length, x, y [m]: ways through junctions that plans refer to
    egos: tuple[Ego, ...] = ()
    events: tuple[Event, ...] = ()
    contacts: tuple[Contact, ...] = ()
    meta: dict[str, Any] = field(default_factory=dict)  # JSON: env_id, seed, config, params, rules, mode, versions ...

    def __post_init__(self) -> None:
        _check(self)

    @property
    def ego_users(self) -> tuple[int, ...]:
        """Indices of the users that are egos."""
        return tuple(ego.user for ego in self.egos)

    def replaced(self, **changes: Any) -> "Trace":
        """The same trace but for some fields."""
        return replace(self, **changes)


def users_of(
    ids, kinds, length, width, x, y, heading, speed, acceleration=None, steering=None, crashed=None, lane=None
) -> Users:
    """`Users` from anything that numpy takes for arrays; what is left out is not known."""
    x = np.asarray(x, float)
    count = x.shape[-1]

    def filled(value: Any, fill: Any, kind: type) -> np.ndarray:
        return np.full(x.shape, fill, kind) if value is None else np.asarray(value, kind)

    return Users(
        tuple(str(i) for i in ids),
        tuple(kinds),
        np.broadcast_to(np.asarray(length, float), (count,)).copy(),
        np.broadcast_to(np.asarray(width, float), (count,)).copy(),
        x,
        np.asarray(y, float),
        np.asarray(heading, float),
        np.asarray(speed, float),
        filled(acceleration, np.nan, float),
        filled(steering, np.nan, float),
        filled(crashed, False, bool),
        filled(lane, -1, int),
    )


def stretches(on: np.ndarray) -> list[tuple[int, int]]:
    """[start, end) of each stretch of a series `[T]` of bool that is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def ego_of(user: int, samples: int, areas: int = 0) -> Ego:
    """An `Ego` of which nothing is known yet; its arrays are there to be filled in."""

    def of(fill: Any, *more: int) -> np.ndarray:
        return np.full((samples, *more), fill)

    return Ego(
        user,
        *(of(np.nan), of(np.nan)),
        *(of(0), of(0), of(-1), of(False)),
        *(of(np.nan, 4), of(np.nan, 4), of(-1, 4)),
        *(of(0), of(-1), of(np.nan), of(np.nan)),
        *(of(np.nan, areas, 2), of(-1, areas)),
    )


def straight_lane(id: str, start, end, width: float = 4.0, **more: Any) -> Lane:
    """A straight lane from one point to another [m]."""
    (x0, y0), (x1, y1) = start, end
    heading = float(np.arctan2(y1 - y0, x1 - x0))
    return Lane(id, np.array([[x0, y0, heading], [x1, y1, heading]], float), np.full(2, float(width)), **more)


# ---------------------------------------------------------------- checks


def _check(trace: Trace) -> None:
    if not (np.isfinite(trace.dt) and trace.dt > 0.0):
        raise ValueError(f"dt = {trace.dt!r}: expected a length of time > 0 [s]")
    samples, users = len(trace.time), trace.users
    count = len(users.ids)
    if len(set(users.ids)) != count:
        twice = next(i for i in users.ids if users.ids.count(i) > 1)
        raise ValueError(f"users.ids: {twice!r} is there twice: expected ids of which no two are alike")
    _names("users.kinds", users.kinds, KINDS)
    for name in ("kinds", "length", "width"):
        _shape(f"users.{name}", getattr(users, name), (count,))
    for name in ("x", "y", "heading", "speed", "acceleration", "steering", "crashed", "lane"):
        _shape(f"users.{name}", getattr(users, name), (samples, count))
    for name in ("y", "heading", "speed"):
        if (np.isnan(getattr(users, name)) & users.present).any():
            raise ValueError(f"users.{name} is NaN where users.x is not: expected both, or neither")
    if not (users.length > 0.0).all() or not (users.width > 0.0).all():
        raise ValueError("users.length, users.width: expected numbers > 0 [m]")
    known = [lane.id for lane in trace.lanes]
    if len(set(known)) != len(known):
        raise ValueError("lanes: two have the same id: expected ids of which no two are alike")
    for lane in trace.lanes:
        points = np.shape(lane.centre)
        if len(points) != 2 or points[0] < 2 or points[1] != 3:
            raise ValueError(f"lane {lane.id!r}: centre of shape {points}: expected (P >= 2, 3)")
        _shape(f"lane {lane.id!r}: width", lane.width, points[:1])
        _names(f"lane {lane.id!r}: lines", (lane.left_line, lane.right_line), LINES)
        _names(f"lane {lane.id!r}: neighbours", (*lane.successors, lane.left, lane.right), (*known, ""))
    for light in trace.lights:
        _shape(f"light {light.id!r}: signal", light.signal, (samples,))
        _names(f"light {light.id!r}: lanes", light.lanes, known)
    for ego in trace.egos:
        _index("ego.user", ego.user, count)
        for column in fields(Ego)[1:]:
            array = getattr(ego, column.name)
            if len(array) != samples:
                raise ValueError(f"ego.{column.name}: {len(array)} samples: expected {samples}")
    for event in trace.events:
        _index("event.user", event.user, count)
    for contact in trace.contacts:
        _index("contact.user", contact.user, count)
    _names("events", tuple(event.kind for event in trace.events), EVENTS)


def _shape(name: str, array: Any, expected: tuple[int, ...]) -> None:
    if np.shape(array) != expected:
        raise ValueError(f"{name}: shape {np.shape(array)}: expected {expected}")


def _names(name: str, given: tuple[str, ...], known: Any) -> None:
    for one in given:
        if one not in known:
            raise ValueError(f"{name}: {one!r}: expected one of {', '.join(map(repr, known))}")


def _index(name: str, index: int, count: int) -> None:
    if not 0 <= index < count:
        raise ValueError(f"{name} = {index}: expected the index of one of {count} users")


# ---------------------------------------------------------------- files


def save(trace: Trace, path: str | Path) -> None:
    """Write a trace. A kill leaves the old file or the new one, never half of one."""
    path = Path(path)
    arrays: dict[str, np.ndarray] = {"time": trace.time}
    text = {
        "format": FORMAT,
        "version": VERSION,
        "dt": float(trace.dt),
        "meta": trace.meta,
        "users": _pack(trace.users, "users", arrays),
        "lanes": [_pack(lane, f"lane{i}", arrays) for i, lane in enumerate(trace.lanes)],
        "lights": [_pack(light, f"light{i}", arrays) for i, light in enumerate(trace.lights)],
        "egos": [_pack(ego, f"ego{i}", arrays) for i, ego in enumerate(trace.egos)],
        "events": [_pack(event, "", arrays) for event in trace.events],
        "contacts": [_pack(contact, "", arrays) for contact in trace.contacts],
        "paths": len(trace.paths),
    }
    arrays |= {f"path{i}": points for i, points in enumerate(trace.paths)}
    arrays["text"] = np.frombuffer(json.dumps(_plain(text)).encode(), np.uint8)
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def load(path: str | Path) -> Trace:
    """Read a trace.

    Raises:
      ValueError: the file is no trace, is damaged, or is of another version; the message names it.
      FileNotFoundError: there is none.
    """
    path = Path(path)
    if path.suffix != ".npz" and path.is_file() and not zipfile.is_zipfile(path):
        raise ValueError(f"{path}: expected a file .npz (a trace; rss-shield judge reads .csv and .xml, too)")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        text = json.loads(arrays["text"].tobytes())
    except FileNotFoundError:
        raise
    except (AttributeError, EOFError, KeyError, OSError, ValueError, zipfile.BadZipFile):
        raise ValueError(f"{path}: expected a file with a trace (.npz), which this is not or is damaged") from None
    if not isinstance(text, dict) or text.get("format") != FORMAT:
        raise ValueError(f"{path}: expected a file with a trace, of format {FORMAT!r}")
    if text["version"] != VERSION:
        raise ValueError(f"{path}: version {text['version']} of the format: expected {VERSION}")
    try:
        return Trace(
            text["dt"],
            arrays["time"],
            _unpack(Users, text["users"], "users", arrays),
            tuple(_unpack(Lane, one, f"lane{i}", arrays) for i, one in enumerate(text["lanes"])),
            tuple(_unpack(Light, one, f"light{i}", arrays) for i, one in enumerate(text["lights"])),
            tuple(arrays[f"path{i}"] for i in range(text["paths"])),
            tuple(_unpack(Ego, one, f"ego{i}", arrays) for i, one in enumerate(text["egos"])),
            tuple(_unpack(Event, one, "", arrays) for one in text["events"]),
            tuple(_unpack(Contact, one, "", arrays) for one in text["contacts"]),
            text["meta"],
        )
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path}: {type(error).__name__} {error}: expected all parts of a trace") from None


def _pack(record: Any, prefix: str, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Arrays of a record into `arrays`, all else as it is."""
    text = {}
    for one in fields(record):
        value = getattr(record, one.name)
        if isinstance(value, np.ndarray):
            arrays[f"{prefix}.{one.name}"] = value
        else:
            text[one.name] = value
    return text


def _unpack(kind: type, text: dict[str, Any], prefix: str, arrays: dict[str, np.ndarray]) -> Any:
    values: dict[str, Any] = {}
    for one in fields(kind):
        value = text[one.name] if one.name in text else arrays[f"{prefix}.{one.name}"]
        values[one.name] = tuple(value) if isinstance(value, list) else value
    if "speed_limit" in values:
        values["speed_limit"] = float(values["speed_limit"])  # "inf" in strict JSON
    return kind(**values)


def _plain(value: Any) -> Any:
    """A value as strict JSON has it: numbers that JSON lacks become null (not a number) or text."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else str(value)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    return str(value)
