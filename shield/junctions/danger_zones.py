"""Danger zones of a junction: where two paths meet, and whether both cars are there at the same time.

A car is a point on its path with a speed. The danger zone of two cars is the point where their paths
cross (or merge); it is active if both can be in it at once at unchanged motion and soon. Which paths
meet, and where, is computed once per junction and looked up ever after.

After Kaligin, Uvaysov, Chernoverskaya, "Vestnik NovSU" 1(130), 2023, 108-118,
doi 10.34680/2076-8052.2023.1(130).108-118, whose formulas (1)-(7) are meant below, in the plane. Axes are
free: vectors only, so y may point up or down.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

NONE, CROSS, MERGE, DIVERGE = range(4)
KINDS = {"cross": CROSS, "merge": MERGE}  # the kinds that are conflicts
FILTERS = ("all", "geofence", "table", "walk", "first-conflicting", "first")
INTENTS = ("known", "straight")
READINGS = ("min", "ego")
UNKNOWN = -1  # manoeuvre of a car that announces none

_PARALLEL = 1e-6  # sine of the angle below which two directions are parallel [1]
_SAME_POINT = 0.01  # ends of paths that share a lane lie at most this far apart [m]
_STRAIGHT = 0.9  # least cosine of the angle between both ends of a straight manoeuvre [1]


class DangerRules(NamedTuple):
    """When a danger zone counts, and which cars can form one."""

    tau: float | np.ndarray = 1.5  # arrivals closer than this are simultaneous [s]; a float or one per car
    t_sens: float = 6.0  # T_sens, arrivals later than this do not matter yet [s]
    reading: str = "min"  # whose arrival T_sens is about: "min" (whoever is first, cautious) or "ego"
    radius: float = 60.0  # d, radius of the geofence around the centre of the junction [m]
    kinds: tuple[str, ...] = ("cross", "merge")  # which conflicts count; the paper counts ("cross",)
    intent: str = "known"  # "known" (V2X: announced manoeuvres) or "straight" (assumed of all but the ego)

    def validated(self) -> "DangerRules":
        """The same rules, checked.

        Raises:
          ValueError: names the field, its value and what is accepted.
        """
        for name in ("tau", "t_sens", "radius"):
            value = np.asarray(getattr(self, name), float)
            if np.isnan(value).any() or (value <= 0.0).any():
                raise ValueError(f"{name} = {getattr(self, name)!r} is out of range: expected a number > 0")
        _check_name("reading", self.reading, READINGS)
        _check_name("intent", self.intent, INTENTS)
        if isinstance(self.kinds, str) or not self.kinds:
            raise ValueError(f"kinds = {self.kinds!r}: expected a tuple of some of {', '.join(KINDS)}")
        for kind in self.kinds:
            _check_name("kinds", kind, KINDS)
        return self


DEFAULT_RULES = DangerRules()


class Cars(NamedTuple):
    """What is known of N cars at or before one junction. `Cars.validated(...)` checks it."""

    approach: np.ndarray  # [N] int, lane on which a car entered or will enter the junction
    manoeuvre: np.ndarray  # [N] int, row of the conflict table; UNKNOWN where nothing is announced
    s: np.ndarray  # [N] path coordinate [m]: 0 at the stop line, negative before it
    speed: np.ndarray  # [N] along the path, >= 0 [m/s]
    position: np.ndarray  # [N, 2] [m]

    @classmethod
    def validated(
        cls,
        table: "ConflictTable",
        approach: ArrayLike,
        manoeuvre: ArrayLike,
        s: ArrayLike,
        speed: ArrayLike,
        position: ArrayLike,
    ) -> "Cars":
        """Cars from anything array-like, checked against the table of their junction.

        Raises:
          ValueError: shapes differ, a number is not finite, a speed is negative, a lane or manoeuvre
            is not in the table, or a manoeuvre does not start on the car's approach lane.
        """
        n = np.asarray(s, float).size
        cars = cls(
            _integers("approach", approach),
            _integers("manoeuvre", manoeuvre),
            _finite("s", s, (n,)),
            _finite("speed", speed, (n,)),
            _finite("position", position, (n, 2)),
        )
        for name in ("approach", "manoeuvre"):
            if getattr(cars, name).shape != (n,):
                raise ValueError(f"{name} has shape {getattr(cars, name).shape}: expected ({n},)")
        if (cars.speed < 0.0).any():
            raise ValueError(f"speed = {cars.speed.min():g} is out of range: expected >= 0 m/s along the path")
        for lane in cars.approach:
            _check_name("approach", int(lane), tuple(table.approaches.tolist()))
        if n and not (cars.manoeuvre.min() >= UNKNOWN and cars.manoeuvre.max() < table.n_manoeuvres):
            raise ValueError(f"manoeuvre: expected {UNKNOWN} (unknown) or 0 to {table.n_manoeuvres - 1}")
        known = cars.manoeuvre != UNKNOWN
        wrong = known & (table.approach[cars.manoeuvre] != cars.approach)
        if wrong.any():
            i = int(wrong.argmax())
            raise ValueError(f"manoeuvre {cars.manoeuvre[i]} of car {i} does not start on approach {cars.approach[i]}")
        return cars


class ConflictTable(NamedTuple):
    """All pairs of manoeuvres of one junction. Row a, column b: what a meets of b.

    The first `n_manoeuvres` of the K rows are the manoeuvres given. An approach without a straight one has a
    ghost after them: straight on across the junction, for cars whose intent nobody knows.
    """

    n_manoeuvres: int  # M, manoeuvres given
    approach: np.ndarray  # [K] int, lane that a manoeuvre leaves
    exit: np.ndarray  # [K] int, lane that it enters
    length: np.ndarray  # [K] [m]
    kind: np.ndarray  # [K, K] NONE, CROSS, MERGE or DIVERGE
    point: np.ndarray  # [K, K, 2] zone point [m], 0 where there is none
    s: np.ndarray  # [K, K] arc length along a to its zone with b [m], 0 where there is none
    centre: np.ndarray  # [2] mean of all ends of manoeuvres [m]
    approaches: np.ndarray  # [A] int, every approach lane once, ascending
    straight: np.ndarray  # [A] row of the manoeuvre assumed of a car of unknown intent


class Zones(NamedTuple):
    """The ego's danger zone with each of N cars; NONE, 0 and inf where there is none."""

    kind: np.ndarray  # [N]
    point: np.ndarray  # [N, 2] [m]
    t_ego: np.ndarray  # [N] arrival of the ego, negative once it has left the zone [s]
    t_other: np.ndarray  # [N] arrival of the other car [s]
    delta: np.ndarray  # [N] difference of both [s]
    active: np.ndarray  # [N] bool


# ---------------------------------------------------------------- formulas


def crossing_of_rays(
    start_a: ArrayLike, direction_a: ArrayLike, start_b: ArrayLike, direction_b: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where two headings meet: (4), (5) by cross products, at any angle.

    Args:
      start_a, start_b: [..., 2] positions [m].
      direction_a, direction_b: [..., 2] unit vectors.

    Returns:
      (point [..., 2], distance along a, distance along b) [m]; inf where the headings are parallel or
      the point lies behind a car.
    """
    a, u = np.asarray(start_a, float), np.asarray(direction_a, float)
    b, w = np.asarray(start_b, float), np.asarray(direction_b, float)
    sine = _cross(u, w)
    meets = np.abs(sine) >= _PARALLEL
    divisor = np.where(meets, sine, 1.0)
    along_a, along_b = _cross(b - a, w) / divisor, _cross(b - a, u) / divisor
    meets &= (along_a >= 0.0) & (along_b >= 0.0)
    point = np.where(meets[..., None], a + along_a[..., None] * u, np.inf)
    return point, np.where(meets, along_a, np.inf), np.where(meets, along_b, np.inf)


def arrival_time(s: ArrayLike, s_zone: ArrayLike, speed: ArrayLike) -> np.ndarray:
    """Time to a zone along the path (6) [s]: negative past it, infinite for a standing car.

    Args:
      s, s_zone: path coordinates of car and zone [m].
      speed: >= 0 [m/s].
    """
    distance, v = np.subtract(s_zone, s), np.asarray(speed, float)
    moving = v > 0.0
    standing = np.where(distance > 0.0, np.inf, np.where(distance < 0.0, -np.inf, 0.0))
    return np.where(moving, distance / np.where(moving, v, 1.0), standing)


def time_difference(t_a: ArrayLike, t_b: ArrayLike) -> np.ndarray:
    """Delta = |t_a - t_b| (7) [s]; infinite if either car never arrives."""
    t_a, t_b = np.asarray(t_a, float), np.asarray(t_b, float)
    finite = np.isfinite(t_a) & np.isfinite(t_b)
    return np.where(finite, np.abs(np.where(finite, t_a, 0.0) - np.where(finite, t_b, 0.0)), np.inf)


def is_active(
    t_ego: ArrayLike, t_other: ArrayLike, tau: ArrayLike = 1.5, t_sens: float = 6.0, reading: str = "min"
) -> np.ndarray:
    """Both cars reach the zone within `tau` of each other and soon, and neither has left it.

    Args:
      t_ego, t_other: arrival times [s].
      tau: arrivals closer than this are simultaneous [s].
      t_sens: T_sens [s].
      reading: "min": the first of both arrives before T_sens; "ego": the ego does.
    """
    _check_name("reading", reading, READINGS)
    t_ego, t_other = np.asarray(t_ego, float), np.asarray(t_other, float)
    soonest = np.minimum(t_ego, t_other) if reading == "min" else t_ego
    ahead = (t_ego >= 0.0) & (t_other >= 0.0)
    return ahead & (time_difference(t_ego, t_other) < tau) & (soonest < t_sens)


def occupancy_tau(
    v_a: ArrayLike, v_b: ArrayLike, length: float = 5.0, width: float = 2.0, margin: float = 0.5, fixed: float = 1.5
) -> np.ndarray:
    """tau from how long a car covers the zone [s]: the larger (length + width)/v of both, and a margin.

    Where either car is slower than 0.5 m/s, `fixed` counts.
    """
    slower = np.minimum(v_a, v_b)
    rolling = slower >= 0.5
    return np.where(rolling, (length + width) / np.where(rolling, slower, 1.0) + margin, fixed)


# ---------------------------------------------------------------- conflict table


def first_crossing(path_a: np.ndarray, path_b: np.ndarray) -> tuple[float, float, np.ndarray] | None:
    """First point that two polylines have in common, by the sum of both ways there.

    Args:
      path_a, path_b: [P, 2] and [Q, 2] [m]. Parallel segments do not cross.

    Returns:
      (arc length along a, arc length along b, point) or None.
    """
    step_a, step_b = np.diff(path_a, axis=0)[:, None], np.diff(path_b, axis=0)[None]
    length_a, length_b = np.linalg.norm(step_a, axis=-1), np.linalg.norm(step_b, axis=-1)
    sine = _cross(step_a, step_b)
    meets = np.abs(sine) >= _PARALLEL * length_a * length_b
    divisor = np.where(meets, sine, 1.0)
    offset = path_b[None, :-1] - path_a[:-1, None]
    part_a, part_b = _cross(offset, step_b) / divisor, _cross(offset, step_a) / divisor
    for part in (part_a, part_b):
        meets &= (part >= -_PARALLEL) & (part <= 1.0 + _PARALLEL)
    if not meets.any():
        return None
    s_a = _arc_lengths(path_a)[:-1, None] + part_a * length_a
    s_b = _arc_lengths(path_b)[None, :-1] + part_b * length_b
    i, j = np.unravel_index(np.where(meets, s_a + s_b, np.inf).argmin(), meets.shape)
    return float(s_a[i, j]), float(s_b[i, j]), path_a[i] + part_a[i, j] * step_a[i, 0]


def conflict_table(paths: Sequence[ArrayLike], approaches: ArrayLike, exits: ArrayLike) -> ConflictTable:
    """Conflicts of all pairs of manoeuvres of a junction, once for its lifetime.

    Pairs from one approach diverge at its end, pairs into one exit merge at its beginning, all others
    cross or have nothing to do with each other.

    Args:
      paths: M centre lines, polylines [P, 2] from the end of the approach lane to the beginning of
        the exit lane [m]. Points every 0.2 m give arc lengths of a 10 m arc to a millimetre.
      approaches, exits: [M] int, lanes at both ends.

    Raises:
      ValueError: names the manoeuvre and what is wrong with it.
    """
    lines = [_polyline(k, path) for k, path in enumerate(paths)]
    approach, exit_ = _integers("approaches", approaches), _integers("exits", exits)
    _check_lanes(lines, approach, exit_)
    n_manoeuvres = len(lines)
    centre = np.mean([end for line in lines for end in (line[0], line[-1])], axis=0)
    lanes, straight = np.unique(approach), []
    for lane in lanes:
        row = _straightest(lines, np.flatnonzero(approach == lane))
        if row is None:
            row = len(lines)
            lines.append(_ghost(lines, int(np.argmax(approach == lane))))
            approach, exit_ = np.append(approach, lane), np.append(exit_, exit_.max() + 1)
        straight.append(row)
    kind, point, s = _all_pairs(lines, approach, exit_)
    length = np.array([_arc_lengths(line)[-1] for line in lines])
    return ConflictTable(n_manoeuvres, approach, exit_, length, kind, point, s, centre, lanes, np.array(straight))


def conflict_counts(table: ConflictTable) -> dict[str, int]:
    """Number of pairs of each kind, ghosts left out."""
    upper = np.triu(table.kind[: table.n_manoeuvres, : table.n_manoeuvres])
    return {name: int((upper == kind).sum()) for name, kind in (*KINDS.items(), ("diverge", DIVERGE))}


def _all_pairs(
    lines: list[np.ndarray], approach: np.ndarray, exit_: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    k = len(lines)
    kind, point, s = np.zeros((k, k), np.int8), np.zeros((k, k, 2)), np.zeros((k, k))
    for a in range(k):
        for b in range(a + 1, k):
            if approach[a] == approach[b]:
                found, zone = DIVERGE, (0.0, 0.0, lines[a][0])
            elif exit_[a] == exit_[b]:
                found, zone = MERGE, (_arc_lengths(lines[a])[-1], _arc_lengths(lines[b])[-1], lines[a][-1])
            else:
                crossing = first_crossing(lines[a], lines[b])
                if crossing is None:
                    continue
                found, zone = CROSS, crossing
            kind[a, b] = kind[b, a] = found
            s[a, b], s[b, a], point[a, b] = zone
            point[b, a] = point[a, b]
    return kind, point, s


def _straightest(lines: list[np.ndarray], rows: np.ndarray) -> int | None:
    """The straight manoeuvre among those of one approach, if there is one."""
    cosines = [float(_direction(lines[k], 0) @ _direction(lines[k], -1)) for k in rows]
    best = int(np.argmax(cosines))
    return int(rows[best]) if cosines[best] >= _STRAIGHT else None


def _ghost(lines: list[np.ndarray], row: int) -> np.ndarray:
    """Straight on from the beginning of a manoeuvre, as far as the junction is wide."""
    start, points = lines[row][0], np.concatenate(lines)
    return np.array([start, start + np.ptp(points, axis=0).max() * _direction(lines[row], 0)])


# ---------------------------------------------------------------- filters


def candidates(
    filter_name: str, table: ConflictTable, cars: Cars, ego: int, rules: DangerRules = DEFAULT_RULES
) -> np.ndarray:
    """Which other cars are examined for one ego: `[N]` bool, never the ego itself.

    "all": every other car. "geofence": those within `radius` of the centre of the junction (1).
    "table": of these, those whose manoeuvre conflicts with the ego's at a point that both still have
    before them. The others thin these out, lane by lane from the junction backwards:
    "walk" stops after the first that arrives later than the ego and `tau`, "first-conflicting" after
    the first, and "first" looks at the first car of the lane alone, whether it conflicts or not.

    Each is a subset of the one before. Nothing is lost up to "table" (inside the fence); each of the
    last three may miss a car behind the one at which it stops.

    Raises:
      ValueError: unknown filter, rules out of range, or no such ego.
    """
    _check_name("filter", filter_name, FILTERS)
    _check_scene(table, cars, ego, rules)
    others = np.arange(len(cars.s)) != ego
    if filter_name == "all":
        return others
    inside = others & within_geofence(table, cars, rules.radius)
    if filter_name == "geofence":
        return inside
    row, rows, is_conflict = _conflicts(table, cars, ego, rules)
    left = (cars.s > table.s[rows, row]) | (cars.s[ego] > table.s[row, rows])
    relevant = inside & is_conflict & ~left
    if filter_name == "table":
        return relevant
    if filter_name == "walk":
        t_ego = arrival_time(cars.s[ego], table.s[row, rows], cars.speed[ego])
        t_other = arrival_time(cars.s, table.s[rows, row], cars.speed)
        last = relevant & (t_other > t_ego + rules.tau)
    elif filter_name == "first-conflicting":
        last = relevant
    else:
        last = inside & (cars.s <= table.length[rows])
    return relevant & ~_is_behind(cars, last)


def within_geofence(table: ConflictTable, cars: Cars, radius: float) -> np.ndarray:
    """Cars nearer than `radius` [m] to the centre of the junction (1), `[N]` bool."""
    offset = cars.position - table.centre
    return np.hypot(offset[:, 0], offset[:, 1]) < radius


def danger_zones(
    table: ConflictTable, cars: Cars, ego: int, examined: np.ndarray, rules: DangerRules = DEFAULT_RULES
) -> Zones:
    """The ego's danger zones with the cars examined.

    Args:
      examined: [N] bool, from `candidates`.

    Raises:
      ValueError: `examined` has another shape, rules out of range, or no such ego.
    """
    _check_scene(table, cars, ego, rules)
    if np.shape(examined) != cars.s.shape:
        raise ValueError(f"examined has shape {np.shape(examined)}: expected {cars.s.shape}")
    row, rows, is_conflict = _conflicts(table, cars, ego, rules)
    is_zone = is_conflict & examined
    t_ego = np.where(is_zone, arrival_time(cars.s[ego], table.s[row, rows], cars.speed[ego]), np.inf)
    t_other = np.where(is_zone, arrival_time(cars.s, table.s[rows, row], cars.speed), np.inf)
    return Zones(
        kind=np.where(is_zone, table.kind[row, rows], NONE),
        point=np.where(is_zone[:, None], table.point[row, rows], 0.0),
        t_ego=t_ego,
        t_other=t_other,
        delta=time_difference(t_ego, t_other),
        active=is_zone & is_active(t_ego, t_other, rules.tau, rules.t_sens, rules.reading),
    )


def assumed_manoeuvres(table: ConflictTable, cars: Cars, intent: str = "known") -> np.ndarray:
    """Row of the table that each car is taken to follow, `[N]`.

    "known": what it announces, straight on where it announces nothing; "straight": straight on for all.
    A car that turns already is taken to be as far along the straight path: sense its heading instead.
    """
    straight = table.straight[np.searchsorted(table.approaches, cars.approach)]
    return straight if intent == "straight" else np.where(cars.manoeuvre == UNKNOWN, straight, cars.manoeuvre)


def _conflicts(table: ConflictTable, cars: Cars, ego: int, rules: DangerRules) -> tuple[int, np.ndarray, np.ndarray]:
    """Row of the ego, rows [N] of all cars, and who may conflict with the ego [N]."""
    row, rows = int(cars.manoeuvre[ego]), assumed_manoeuvres(table, cars, rules.intent)
    counts = np.array([name in rules.kinds for name in ("none", *KINDS, "diverge")])  # by kind
    is_conflict = counts[table.kind[row, rows]]
    is_conflict[ego] = False
    return row, rows, is_conflict


def _is_behind(cars: Cars, last: np.ndarray) -> np.ndarray:
    """Cars with one of the `last` [N] between them and the junction, on their own approach lane [N]."""
    nearer = (cars.s[:, None] > cars.s) & (cars.approach[:, None] == cars.approach)
    return (nearer & last[:, None]).any(axis=0)


# ---------------------------------------------------------------- polylines and checks


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _arc_lengths(path: np.ndarray) -> np.ndarray:
    """Arc length [P] from the beginning of a polyline to each of its points [m]."""
    return np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=-1).cumsum()])


def _direction(path: np.ndarray, segment: int) -> np.ndarray:
    step = np.diff(path, axis=0)[segment]
    return step / np.linalg.norm(step)


def _polyline(k: int, path: ArrayLike) -> np.ndarray:
    line = np.asarray(path, float)
    if line.ndim != 2 or line.shape[1] != 2 or len(line) < 2:
        raise ValueError(f"path of manoeuvre {k} has shape {line.shape}: expected (P, 2) with P >= 2")
    if not np.isfinite(line).all():
        raise ValueError(f"path of manoeuvre {k} has a coordinate that is not finite")
    if (np.linalg.norm(np.diff(line, axis=0), axis=-1) == 0.0).any():
        raise ValueError(f"path of manoeuvre {k} has the same point twice in a row")
    return line


def _check_lanes(lines: list[np.ndarray], approach: np.ndarray, exit_: np.ndarray) -> None:
    if not lines:
        raise ValueError("paths is empty: expected one polyline per manoeuvre")
    for name, lanes, end in (("approaches", approach, 0), ("exits", exit_, -1)):
        if lanes.shape != (len(lines),):
            raise ValueError(f"{name} has shape {lanes.shape}: expected ({len(lines)},), one lane per path")
        for lane in np.unique(lanes):
            rows = np.flatnonzero(lanes == lane)
            ends = np.array([lines[k][end] for k in rows])
            apart = np.linalg.norm(ends - ends[0], axis=-1)
            if apart.max() > _SAME_POINT:
                k = rows[apart.argmax()]
                raise ValueError(f"manoeuvres {rows[0]} and {k} share lane {lane} of {name} but no point there")
    pairs, first = np.unique(np.column_stack([approach, exit_]), axis=0, return_index=True)
    if len(pairs) < len(lines):
        k = np.setdiff1d(np.arange(len(lines)), first)[0]
        raise ValueError(f"manoeuvre {k}: there is another one from lane {approach[k]} to lane {exit_[k]}")


def _check_scene(table: ConflictTable, cars: Cars, ego: int, rules: DangerRules) -> None:
    rules.validated()
    if np.shape(rules.tau) not in ((), cars.s.shape):
        raise ValueError(f"tau has shape {np.shape(rules.tau)}: expected a float or {cars.s.shape}")
    if not 0 <= ego < len(cars.s):
        raise ValueError(f"ego = {ego} is out of range: expected 0 to {len(cars.s) - 1}")
    if not 0 <= cars.manoeuvre[ego] < table.n_manoeuvres:
        raise ValueError(f"manoeuvre of the ego = {cars.manoeuvre[ego]}: expected 0 to {table.n_manoeuvres - 1}")


def _check_name(field: str, value: object, accepted: Sequence[object] | Mapping[str, int]) -> None:
    if value not in accepted:
        raise ValueError(f"{field} = {value!r} is unknown: expected one of {', '.join(map(str, accepted))}")


def _integers(name: str, values: ArrayLike) -> np.ndarray:
    array = np.asarray(values)
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"{name} has dtype {array.dtype}: expected integers")
    return array.astype(np.int64)


def _finite(name: str, values: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(values, float)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}: expected {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has a value that is not finite")
    return array
