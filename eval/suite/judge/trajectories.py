"""Trajectories in a CSV file, one row per road user and time, as a trace."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pandas as pd

from rss_shield.eval.suite.judge.smoothing import derivative
from rss_shield.eval.suite.judge.units import check_units, factor_of
from rss_shield.shield.trace import KINDS, Lane, Trace, straight_lane, users_of

LENGTH, WIDTH = 4.5, 1.8  # of a user whose size the log does not say [m]
_SLOW = 0.5  # whoever is slower keeps the heading that it had [m/s]
_OFF_GRID = 0.2  # of a time step: samples may be this far from where they should be
MOST = 10_000_000  # poses of all users on all samples that are made of a log ...
MOST_OF_ROW = 40  # ... or as many of each row, if that is more


class Format(NamedTuple):
    """Which columns say what; "" = the log does not say it."""

    id: str = "id"
    t: str = "t"
    x: str = "x"
    y: str = "y"
    heading: str = "heading"  # derived from where a user goes if the column is not there, and so on
    speed: str = "speed"
    length: str = "length"
    width: str = "width"
    kind: str = "kind"
    lane: str = "lane"
    units: Mapping[str, str] = {}  # by field: see `units`; SI where nothing is said
    y_up: bool = True  # y grows to the left of x, as in mathematics
    point: str = "centre"  # what x and y are of: "centre", "front" (its middle) or "corner" (the least x and y)
    frame_rate: float = 0.0  # of times that are counted in frames [Hz]
    kinds: Mapping[Any, str] = {}  # names of kinds


FORMATS = {
    "plain": Format(),
    # Krajewski et al., The highD Dataset, ITSC 2018: a box in the image, whose y grows downwards
    "highd": Format(
        *("id", "frame", "x", "y", "", "", "width", "height", "", "laneId"),
        {"t": "frame"},
        y_up=False,
        point="corner",
        frame_rate=25.0,
    ),
    # Next Generation Simulation, US DOT: middle of the front bumper, along and across the road, in feet
    "ngsim": Format(
        *("Vehicle_ID", "Frame_ID", "Local_Y", "Local_X", "", "v_Vel", "v_Length", "v_Width", "v_Class", "Lane_ID"),
        {"t": "frame", **dict.fromkeys(("x", "y", "length", "width"), "ft"), "speed": "ft/s"},
        y_up=False,
        point="front",
        frame_rate=10.0,
        kinds={1: "motorcycle", 2: "car", 3: "truck"},
    ),
}


def read_csv(
    path: str | Path,
    columns: Format | str = "plain",
    lanes: tuple[Lane, ...] = (),
    dt: float | None = None,
) -> Trace:
    """Read trajectories.

    Args:
      path: of the file, with a header.
      columns: `Format`, or the name of one of FORMATS.
      lanes: of the road; none = one straight road, see `World`.
      dt: time between two samples: positions are interpolated to it [s]; None = as in the file.

    Raises:
      ValueError: a column that is needed is not there, a unit of something else, a value that is no number, a row that
        is there twice, times that are not evenly spaced, or too many samples.
    """
    known = FORMATS.get(columns) if isinstance(columns, str) else columns
    if known is None:
        raise ValueError(f"format = {columns!r}: expected one of {', '.join(FORMATS)}")
    check_units(known.units, known.frame_rate)
    rows = _rows(path)
    for name in ("id", "t", "x", "y"):
        if getattr(known, name) not in rows.columns:
            there = ", ".join(rows.columns)
            hint = " (a file with another separator? expected commas)" if len(rows.columns) == 1 else ""
            raise ValueError(f"{path}: no column {getattr(known, name)!r} for {name}: expected one of {there}{hint}")
    table = pd.DataFrame({name: _column(path, rows, known, name) for name in ("t", "x", "y")})
    table["id"] = rows[known.id]
    if table["id"].isna().any():
        _refuse_value(path, rows, known.id, table["id"].isna(), "a name or number")
    optional = ("heading", "speed", "length", "width")
    for name in optional:
        if getattr(known, name) in rows.columns:
            table[name] = _column(path, rows, known, name)
            if name in ("length", "width") and not (table[name] > 0.0).all():
                _refuse_value(path, rows, getattr(known, name), ~(table[name] > 0.0), "a number > 0")
    if known.frame_rate and known.units.get("t", "frame") == "frame":
        table["t"] /= known.frame_rate
    if known.y_up:
        table["y"] *= -1.0
        if "heading" in table:
            table["heading"] *= -1.0
    twice = table.duplicated(["id", "t"])
    if twice.any():
        user, t = table.loc[twice, "id"].iloc[0], table.loc[twice, "t"].iloc[0]
        raise ValueError(f"{path}: {known.id} = {user} is there twice at {known.t} = {t:g}: expected once")
    ids = list(dict.fromkeys(table["id"]))
    step, time = _samples(path, table["t"].to_numpy(), dt, len(ids))
    state = {name: np.full((len(time), len(ids)), np.nan) for name in ("x", "y", "heading", "speed")}
    length, width = np.full(len(ids), LENGTH), np.full(len(ids), WIDTH)
    for i, (_, own) in enumerate(table.groupby("id", sort=False)):
        own = own.sort_values("t")
        for name, sizes in (("length", length), ("width", width)):
            if name in own:
                sizes[i] = float(own[name].median())
        into = {name: array[:, i] for name, array in state.items()}
        _put(own, time, step, 0.5 * step if dt is None else 0.0, length[i], width[i], known.point, into)
    kinds = ["unknown"] * len(ids)
    if known.kind in rows.columns:
        wrong = ~rows[known.kind].fillna("unknown").isin(KINDS)
        if wrong.any() and not known.kinds:
            _refuse_value(path, rows, known.kind, wrong, f"one of {', '.join(KINDS)}")
        first = rows.drop_duplicates(known.id).set_index(known.id)[known.kind].fillna("unknown")
        kinds = [known.kinds.get(first[i], str(first[i]) if not known.kinds else "unknown") for i in ids]
    users = users_of(
        [str(i) for i in ids], kinds, length, width, state["x"], state["y"], state["heading"], state["speed"]
    )
    return Trace(step, time, users, lanes, meta={"source": Path(path).name})


def _column(path: str | Path, rows: pd.DataFrame, known: Format, name: str) -> pd.Series:
    """A column in SI units."""
    column = getattr(known, name)
    values = pd.to_numeric(rows[column], errors="coerce")
    if not np.isfinite(values).all():
        _refuse_value(path, rows, column, ~np.isfinite(values), "a finite number")
    return values * factor_of(name, known.units.get(name))


def _rows(path: str | Path) -> pd.DataFrame:
    """Of a file with commas."""
    try:
        rows = pd.read_csv(path)
    except pd.errors.EmptyDataError:
        raise ValueError(f"{path}: expected a header and rows; it is empty") from None
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: expected columns separated by commas, the same in every row: {error}") from None
    if not isinstance(rows.index, pd.RangeIndex):  # what is too much in the first row is taken for names of rows
        raise ValueError(f"{path}: row 2 has more values than the header has columns: expected {len(rows.columns)}")
    if not len(rows):
        raise ValueError(f"{path}: expected rows below its header; there are none")
    return rows


def _refuse_value(path: str | Path, rows: pd.DataFrame, column: str, wrong: Any, expected: str) -> NoReturn:
    row = int(np.flatnonzero(wrong)[0])
    value = rows[column].iloc[row]
    if pd.isna(value):
        raise ValueError(f"{path}: row {row + 2} has no {column}: expected {expected}, and {len(rows.columns)} values")
    shown = repr(value) if isinstance(value, str) else value  # no names of types
    raise ValueError(f"{path}: {column} = {shown} in row {row + 2}: expected {expected}")


def _samples(path: str | Path, times: np.ndarray, dt: float | None, users: int) -> tuple[float, np.ndarray]:
    """Time between two samples, given or as in the file, and the times of all `[T]` [s]."""
    step = _step(path, times) if dt is None else dt
    start, long = float(times.min()), float(np.ptp(times))
    most = max(MOST, MOST_OF_ROW * len(times)) // users
    least = float(f"{long / most:.2g}")  # as it is told
    if dt is not None and not least <= dt <= long:
        raise ValueError(
            f"{path}: dt = {dt:g}: expected >= {least:g} s, which makes {most} samples, and <= {long:g} s, "
            "which is how long the log is"
        )
    if long / step > most:
        raise ValueError(f"{path}: {long:g} s in steps of {step:g} s: expected {most} samples at most; give dt")
    return step, start + np.arange(round(long / step) + 1) * step


def _step(path: str | Path, times: np.ndarray) -> float:
    times = np.unique(times)
    if len(times) < 2:
        raise ValueError(f"{path}: all rows have one time: expected two at least")
    step = float(np.median(np.diff(times)))
    off = np.abs((times - times[0]) / step - np.round((times - times[0]) / step))
    if off.max() > _OFF_GRID:
        at = times[int(off.argmax())]
        raise ValueError(f"{path}: t = {at:g} s is no multiple of {step:g} s after the first: give dt to interpolate")
    return step


def _put(
    own: pd.DataFrame,
    time: np.ndarray,
    step: float,
    slack: float,
    length: float,
    width: float,
    point: str,
    into: dict[str, np.ndarray],
) -> None:
    """One user's rows onto the common times; between rows that are farther apart than two steps it is not there.

    Args:
      slack: a sample that is so much before the first row, or after the last, is that row's [s].
    """
    t, x, y = (own[name].to_numpy() for name in ("t", "x", "y"))
    apart = max(step, float(np.median(np.diff(t)))) if len(t) > 1 else step
    for a, b in zip(*_runs(t, 2.0 * apart), strict=True):
        close = slack + 1e-6 * step + 4.0 * float(np.spacing(np.abs(t).max()))  # times may be seconds since 1970
        here = np.flatnonzero((time >= t[a] - close) & (time <= t[b - 1] + close))
        if not len(here):
            continue
        run = slice(a, b)
        px, py = np.interp(time[here], t[run], x[run]), np.interp(time[here], t[run], y[run])
        if point == "corner":
            px, py = px + 0.5 * length, py + 0.5 * width
        vx, vy = derivative(px, step, 1), derivative(py, step, 1)
        if "heading" in own:
            heading = np.interp(time[here], t[run], np.unwrap(own["heading"].to_numpy()[run]))
        else:
            heading = _headings(vx, vy)
        if "speed" in own:
            speed = np.interp(time[here], t[run], own["speed"].to_numpy()[run])
        else:
            speed = vx * np.cos(heading) + vy * np.sin(heading)
        if point == "front":
            px, py = px - 0.5 * length * np.cos(heading), py - 0.5 * length * np.sin(heading)
        for name, values in (("x", px), ("y", py), ("heading", heading), ("speed", speed)):
            into[name][here] = values


def _runs(t: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray]:
    cuts = np.flatnonzero(np.diff(t) > longest) + 1
    return np.concatenate([[0], cuts]), np.concatenate([cuts, [len(t)]])


def _headings(vx: np.ndarray, vy: np.ndarray) -> np.ndarray:
    """Directions of motion; who hardly moves keeps the last one, or has the next one already [rad]."""
    moving = np.flatnonzero(np.hypot(vx, vy) > _SLOW)
    if not len(moving):
        return np.full(len(vx), float(np.arctan2(vy.sum(), vx.sum())) if len(vx) else 0.0)
    last = np.clip(np.searchsorted(moving, np.arange(len(vx)), side="right") - 1, 0, None)
    return np.arctan2(vy, vx)[moving[last]]


# ---------------------------------------------------------------- lanes


def read_lanes(path: str | Path) -> tuple[Lane, ...]:
    """Lanes from a JSON file: {"lanes": [{"id", "centre": [[x, y], ...], "width", "successors", "left", ...}, ...]}.

    Fields are those of `shield.trace.Lane`; `centre` may leave headings out, `width` may be one number.

    Raises:
      ValueError: the file is no JSON, or a lane has no centre line, or a field that is none.
    """
    try:
        given = json.loads(Path(path).read_text(encoding="utf-8"))["lanes"]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: expected JSON with a list 'lanes' ({type(error).__name__}: {error})") from None
    lanes = []
    for one in given:
        if not {"id", "centre"} <= set(one):
            raise ValueError(f"{path}: lane {one!r}: expected the fields id and centre")
        unknown = set(one) - set(Lane.__dataclass_fields__)
        if unknown:
            raise ValueError(
                f"{path}: lane {one['id']!r} has an unknown field {min(unknown)!r}: expected "
                f"{', '.join(Lane.__dataclass_fields__)}"
            )
        centre, width = _line(path, one)
        rest = {k: v for k, v in one.items() if k not in ("id", "centre", "width", "successors")}
        lanes.append(Lane(str(one["id"]), centre, width, tuple(map(str, one.get("successors", ()))), **rest))
    return tuple(lanes)


def _line(path: str | Path, lane: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Centre line with headings and widths of a lane in a file."""
    name = f"{path}: lane {lane['id']!r}"
    try:
        centre = np.array(lane["centre"], float)
        good = centre.ndim == 2 and len(centre) >= 2 and centre.shape[1] in (2, 3) and np.isfinite(centre).all()
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ValueError(f"{name}: centre = {lane['centre']!r}: expected two points [x, y] or more, of finite numbers")
    try:
        width = np.broadcast_to(np.asarray(lane.get("width", 3.5), float), len(centre)).copy()
        good = bool((width > 0.0).all() and np.isfinite(width).all())
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ValueError(f"{name}: width = {lane['width']!r}: expected a number > 0, or one for each point")
    return with_headings(centre), width


def with_headings(centre: np.ndarray) -> np.ndarray:
    """A centre line `[P, 2]` with headings: at inner points halfway between those of the pieces on either side."""
    if centre.shape[1] == 3:
        return centre
    steps = np.diff(centre, axis=0)
    courses = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    heading = np.concatenate([courses[:1], 0.5 * (courses[:-1] + courses[1:]), courses[-1:]])
    return np.column_stack([centre, heading])


def straight_lanes(offsets: list[float], width: float, start: float, end: float, direction: float = 0.0) -> tuple:
    """Straight lanes side by side, from left to right.

    Args:
      offsets: of their middles across the road, positive to the right of its direction [m].
      width: of each [m].
      start, end: along the road [m].
      direction: of the road [rad].
    """
    cos, sin = np.cos(direction), np.sin(direction)

    def point(s: float, y: float) -> tuple[float, float]:
        return s * cos - y * sin, s * sin + y * cos

    names, ordered = [f"lane {k}" for k in range(len(offsets))], sorted(offsets)
    return tuple(
        straight_lane(
            names[k],
            point(start, y),
            point(end, y),
            width,
            left=names[k - 1] if k else "",
            right=names[k + 1] if k + 1 < len(ordered) else "",
        )
        for k, y in enumerate(ordered)
    )
