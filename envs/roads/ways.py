"""Which paths may each road user take? Routes are shared, assumed straight, or anything the road allows.

known     routes and the lane that each driver heads for are shared (V2X)
straight  everybody is expected to go straight on; wrong whenever somebody turns, for comparison only
any       every path that fits where a car is; the worst counts
"""

from copy import copy
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from rss_shield.envs._numpy.floats import wrap_to_pi
from rss_shield.envs.roads.bits import first_of, without_first
from rss_shield.envs.roads.network import (
    CAR_LENGTH,
    CAR_WIDTH,
    compile_network,
    heading_at,
    is_far,
    local_coordinates,
)
from rss_shield.envs.roads.paths import (
    MARGIN_LON,
    STOCK,
    Size,
    Swept,
    beside,
    join,
    lay_out,
    lead_of,
    meet,
    successors_of,
    sweep,
    walks,
    widened,
)
from rss_shield.shield._numba.compiled import compiled, records
from rss_shield.shield.geometry import wrap_angle
from rss_shield.shield.junctions.conflict_areas import (
    COS,
    HALF_LENGTH,
    HALF_WIDTH,
    SIN,
    Paths,
    X,
    Y,
    cell_of,
    reach_beyond,
    reaches_into,
)
from rss_shield.shield.junctions.obstacles import block
from rss_shield.shield.junctions.plans import ANY, KNOWN, STRAIGHT, Track

_OFF = 2.0  # lateral offset up to which a car may be on a lane [m]
_TURNED = np.pi / 3  # angle to the lane up to which it may be [rad]
_BEYOND = 3.0  # how far after its end, and before its start or where the lane before leads to it [m]
_OFF_KNOWN, _TURNED_KNOWN, _BEYOND_KNOWN = 4.0, 1.4, 12.0  # likewise for a lane that it is known to head for
_BETWEEN = 1.0  # further from the middle of the lane it heads for, a car is on the one beside it too [m]
# Nobody sweeps the lane that it leaves any more when it is `_CLEAR` from the middle of the one that it heads for
# [m]. highway-env's drivers need at most `_SLANT` [m] along the lane for 1 m across when they are slow, and come nearer
# by a factor of e in `_DECAY` [s] when they are fast; to turn the wheels and to straighten up takes them `_TURN_TIME`
# [s] and `_TURN_LENGTH` [m].
# A wider car has to come nearer to it, at most to within `_ALMOST` [m], and a longer one goes further meanwhile.
_ALMOST = 0.2
_CLEAR, _DECAY, _TURN_TIME, _SLANT, _TURN_LENGTH = 1.5, 0.6, 0.4, 2.0, 3.0
# While it changes lanes, a driver comes less far along the new lane than it drives: by at most this share of what is
# left across, less from `_SWIFT` [m/s] on. In a bend it is further out, or in, until it has come nearer (`_DECAY`).
_ASLANT, _SWIFT = 0.55, 4.0
_ALL = -1  # all bits
_MOST_LANES = 63  # sets of lanes are bits
# A car that is longer than stock ones turns with a larger slip: it may be off its lane by this much more
# per metre, and turned by this angle more, but never as if it drove across.
_OFF_LONGER, _TURNED_LONGER, _ACROSS = 0.5, 0.1, 1.4  # [m], [rad], [rad]
_CREEPS = 0.5  # who is slower may stay where it is [m/s]
_ROLL = 1.05  # a wreck rolls to rest in this time at its speed [s]

# One road user in the world, as a simulator says.
CAR_ON_ROAD = records(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("heading", "f8"),
        ("speed", "f8"),
        ("length", "f8"),
        ("width", "f8"),
        ("size", "i8"),  # index into `Junction.sizes`
        ("on", "i8"),  # lane it is on
        ("lane", "i8"),  # lane it heads for, -1 = nobody knows
        ("choice", "i8"),  # row of `Roads.choices`: paths of its route, -1 = nobody knows
        ("wreck", "?"),
        ("alert", "?"),  # is known to wait, not to have broken down
    ]
)


class Roads(NamedTuple):
    """A road network as junction code needs it. L lanes, R rows of choices, P paths of each size of cars."""

    paths: Paths
    lanes: np.ndarray  # `[L]` LANE
    choices: np.ndarray  # `[R, *]` paths, padded with -1
    through: np.ndarray  # `[L]` row of the paths through each lane, one per way to go on
    straight: np.ndarray  # `[L]` row of the straightest of them
    limit: float  # highest speed limit of all lanes [m/s]
    lead: np.ndarray  # `[L]` how far before its start cars come to a lane [m]
    following: np.ndarray  # `[L]` each lane and those that follow, as sets of bits
    beside: np.ndarray  # `[L]` each lane and those beside it, likewise
    reachable: np.ndarray  # `[L]` each lane, those that follow, and those beside any of these, likewise
    alongside: np.ndarray  # `[Q, L]` path through each lane that runs as much as possible like each path
    onward: np.ndarray  # `[P, L]` path of stock cars through each lane that goes on like each; -1 = not by that road


class Junction:
    """Paths of a road network, by the names that highway-env gives to lanes and nodes.

    Args:
      network: the road network.
      room: the ego may be this much further to either side than highway-env's drivers [m].
      dt: length of a frame, in which drivers steer [s].
      sizes: of the cars there may be, that of the ego first.

    Raises:
      ValueError: too many lanes, or one that leads nowhere.
    """

    def __init__(self, network, room: float = 0.0, dt: float = 1 / 15, sizes: tuple[Size, ...] = (STOCK,)) -> None:
        self.number = {index: i for i, index in enumerate(network.lanes_dict())}
        self.walks = walks(network)
        self._check()
        self._rows: list[list[int]] = []
        self._row_of: dict[tuple, int] = {}
        through = [self._row(self._distinct(index)) for index in self.number]
        straight = [self._row(self._straightest(network, index)) for index in self.number]
        self._known: dict[tuple, int] = {}
        lanes = compile_network(network, False).lanes
        self.lead, self.following, self.beside = lead_of(network), successors_of(network), beside(network)
        self.reachable = np.array([_union(int(lanes_after), self.beside) for lanes_after in self.following])
        self.limit = float(lanes["speed_limit"].max())
        self.lanes = lanes
        self._layout, self._dt = lay_out(network), dt
        own = sweep(self._layout, self.limit, dt, sizes[0])
        self._ego = widened(own, room)
        self._swept: list[Swept] = []
        self._choices = np.array(through), np.array(straight)
        self._alongside = np.array([[self._most_alike(walk, index) for index in self.number] for walk in self.walks])
        self._onward = np.array([[self._onward_from(walk, index) for index in self.number] for walk in self.walks])
        self._take_in(sizes)

    def _check(self) -> None:
        if len(self.number) > _MOST_LANES:
            raise ValueError(
                f"road network with {len(self.number)} lanes: expected at most {_MOST_LANES} where roads cross "
                "(at roundabout-generic-v0: roundabout_lanes <= 5)"
            )
        for index in self.number:
            if not any(index in walk for walk in self.walks):
                raise ValueError(f"lane {index} of the road network: expected one that leads to an end of the network")

    def with_size(self, size: Size) -> "Junction":
        """The same junction for cars of one more size."""
        more = copy(self)
        more._swept = list(self._swept)
        more._take_in((*self.sizes, size))
        return more

    def _take_in(self, sizes: tuple[Size, ...]) -> None:
        for size in sizes[len(self._swept) :]:
            self._swept.append(meet(self._layout, self._ego, sweep(self._layout, self.limit, self._dt, size)))
        self.sizes = sizes
        self._paths = join(self._layout, self._ego, self._swept)
        count = len(self.walks)
        self.alongside = np.concatenate([self._alongside + k * count for k in range(len(sizes))])

    def __deepcopy__(self, memo) -> "Junction":
        return self  # what is added later are answers to questions

    @property
    def roads(self) -> Roads:
        """Everything as arrays; rows for routes that were asked about are included."""
        paths, (through, straight) = self._paths, self._choices
        choices = np.full((len(self._rows), max(map(len, self._rows))), -1)
        for row, numbers in enumerate(self._rows):
            choices[row, : len(numbers)] = numbers
        return Roads(
            paths,
            self.lanes,
            choices,
            through,
            straight,
            self.limit,
            self.lead,
            self.following,
            self.beside,
            self.reachable,
            self.alongside,
            self._onward,
        )

    def choice(self, index, route) -> int:
        """Row of the paths of a driver who heads for lane `index` with `route` ahead; a driver without a route: any."""
        key = (index, tuple(step[:2] for step in route or ()))
        if key not in self._known:
            self._known[key] = self._row(self._alike(index, key[1]))
        return self._known[key]

    def _alike(self, index, route) -> list[int]:
        """Of the paths through a lane, those that follow a route the longest."""
        ways = self._distinct(index)
        agreement = [_agreement(self._after(p, index), index, route) for p in ways]
        return [p for p, steps in zip(ways, agreement, strict=True) if steps == max(agreement)]

    def _most_alike(self, walk, index) -> int:
        """Of the paths through a lane, the one most like a walk: it goes on likewise for longest.

        Beside the walk it has come by the same roads, too: who is still short of the lane must not be put on another
        road that leads to it.
        """
        roads = [lane[:2] for lane in walk]
        alike = self._alike(index, roads)
        if index in walk or index[:2] not in roads:
            return alike[0]
        onward = {tuple(self._after(p, index)) for p in alike}
        before = roads[: roads.index(index[:2])][::-1]

        def shared(p: int) -> int:
            come_by = [lane[:2] for lane in self.walks[p][: self.walks[p].index(index)]][::-1]
            return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(come_by, before, strict=False)))

        same = [p for p, other in enumerate(self.walks) if index in other and tuple(self._after(p, index)) in onward]
        return max(same, key=shared)

    def _onward_from(self, walk, index) -> int:
        roads = [lane[:2] for lane in walk]
        return self._alike(index, roads)[0] if index[:2] in roads else -1

    def _after(self, path: int, index) -> list[tuple]:
        walk = self.walks[path]
        return walk[walk.index(index) + 1 :]

    def _distinct(self, index) -> list[int]:
        """Paths through a lane, one per way to go on."""
        found: dict[tuple, int] = {}
        for p, walk in enumerate(self.walks):
            if index in walk:
                found.setdefault(tuple(self._after(p, index)), p)
        return list(found.values())

    def _straightest(self, network, index) -> list[int]:
        def turn(p: int) -> float:
            lanes = [network.get_lane(i) for i in (index, *self._after(p, index))]
            return abs(wrap_angle(lanes[-1].heading_at(lanes[-1].length) - lanes[0].heading_at(0.0)))

        return sorted(self._distinct(index), key=turn)[:1]

    def _row(self, numbers: list[int]) -> int:
        row = self._row_of.setdefault(tuple(numbers), len(self._rows))
        if row == len(self._rows):
            self._rows.append(list(numbers))
        return row


_junctions: dict[tuple, Junction] = {}


def junction_of(network, room: float = 0.0, dt: float = 1 / 15, sizes: tuple[Size, ...] = (STOCK,)) -> Junction:
    """Paths of a road network; the same roads are never measured twice in a process.

    Args:
      network, room, dt, sizes: see `Junction`.
    """
    lanes = [network.get_lane(index) for index in network.lanes_dict()]
    ends = [tuple(lane.position(s, 0.0).round(3)) for lane in lanes for s in (0.0, lane.length)]
    key = (room, dt, sizes, *network.lanes_dict(), *ends, *((lane.priority, lane.speed_limit) for lane in lanes))
    if key not in _junctions:
        # one size more is added to what is there
        fewer = junction_of(network, room, dt, sizes[:-1]) if len(sizes) > 1 else None
        _junctions[key] = fewer.with_size(sizes[-1]) if fewer else Junction(network, room, dt, sizes)
    return _junctions[key]


def _agreement(after, index, route) -> int:
    """How many steps of a route a walk follows after a lane.

    The route counts on from the road of that lane: who drives all around a ring leaves it after the node where it
    came in.
    """
    road = index[:2]
    starts = [k + 1 for k, step in enumerate(route) if step == road] or [
        k for k, s in enumerate(route) if s[0] == road[1]
    ]
    rest = route[starts[0] :] if starts else ()
    apart = (k for k, (lane, step) in enumerate(zip(after, rest, strict=False)) if lane[:2] != step)
    return next(apart, min(len(after), len(rest)))


@compiled
def _lane_left(roads, car, path, s, lateral):
    """Lane that a car has not left yet for the one that it heads for, -1 = none.

    Args:
      path: one that it may take; s, lateral: where on that it is [m].
    """
    if car.on != car.lane and roads.lanes[car.on].road == roads.lanes[car.lane].road and abs(lateral) > _BETWEEN:
        return car.on
    paths, half_length, half_width = roads.paths, 0.5 * car.length, 0.5 * car.width
    box = paths.swept[path, cell_of(s, paths.cells[path])]
    if reach_beyond(box, car.x, car.y, car.heading, half_length, half_width)[1] <= 0.0:
        return -1
    for lane in range(len(roads.lanes)):
        if lane != car.lane and roads.beside[car.lane] >> lane & 1:
            p = roads.alongside[path, lane]
            i = cell_of(_along(roads, p, lane, car), paths.cells[p])
            if reaches_into(paths.swept[p, i], car.x, car.y, car.heading, half_length, half_width):
                return lane
    return -1


@compiled
def _along(roads, path, lane, car):
    """Arc length of a car on a path, by its place beside one of its lanes [m]."""
    return roads.paths.offset[path, lane] + local_coordinates(roads.lanes[lane], car.x, car.y)[0]


@compiled
def track_of(roads, car, path):
    """`Track` of the ego, which heads for a known lane; `path` is the one it was on before, -1 = none.

    It stays on that, because paths that go on in the same way may have come from elsewhere.
    """
    if path < 0 or np.isnan(roads.paths.offset[path, car.lane]):
        path = roads.choices[car.choice, 0]
    s, lateral = local_coordinates(roads.lanes[car.lane], car.x, car.y)
    s += roads.paths.offset[path, car.lane]
    left = _lane_left(roads, car, path, s, lateral)
    if left < 0:
        return Track(path, s, car.speed, 0.5 * car.length, -1, 0.0, 0.0, 0.0)
    beside = roads.alongside[path, left]
    shift = _along(roads, beside, left, car) - s
    clear = max(_CLEAR - 0.5 * max(car.width - CAR_WIDTH, 0.0), _ALMOST)
    longer = max(car.length / CAR_LENGTH, 1.0)
    to_clear = max(abs(lateral), clear)
    after = _DECAY * np.log(to_clear / clear) + _TURN_TIME
    at = s + longer * (_SLANT * (to_clear - clear) + _TURN_LENGTH)
    return Track(path, s, car.speed, 0.5 * car.length, beside, shift, after, at)


@compiled
def drift_of(roads, car, track):
    """How much further, or less far, than a plan says the ego may come because it changes lanes (rule J11) [m]."""
    if track.beside < 0:
        return 0.0
    lane, v = roads.lanes[car.lane], max(car.speed, 0.0)
    s, lateral = local_coordinates(lane, car.x, car.y)
    curvature = abs(wrap_angle(heading_at(lane, s + 1.0) - heading_at(lane, s)))
    longer = max(car.length / CAR_LENGTH, 1.0)
    return longer * abs(lateral) * (_ASLANT * _SWIFT / max(v, _SWIFT) + _DECAY * curvature * v)


@compiled
def list_threats(roads, track, cars, memory, intent, v_cap, samples, threats, box):
    """Ways that everybody else may take.

    Args:
      roads: `Roads`.
      track: `Track` of the ego.
      cars: `[N]` CAR_ON_ROAD, the others.
      memory: `[N]` CROSSING: a car stays on lanes that lead on from where it was, though others fit too where
        they meet.
      intent: KNOWN, STRAIGHT or ANY.
      v_cap: speed above which nobody accelerates, whatever the limit of the lane (rule J13) [m/s].
      samples: `[N]` SAMPLE, overwritten.
      threats: `[M]` THREAT, overwritten.
      box: `[6]`, room for one.

    Returns:
      How many threats there are; more than M if they did not fit.
    """
    count = 0
    for i in range(len(cars)):
        car = cars[i]
        samples[i].x, samples[i].y, samples[i].heading, samples[i].speed = car.x, car.y, car.heading, car.speed
        samples[i].half_length = car.length / 2
        samples[i].wreck, samples[i].astray, samples[i].lanes, samples[i].path = car.wreck, False, 0, -1
        samples[i].alert, samples[i].strays, samples[i].ways = car.alert, False, _ALL
        before = count
        if not car.wreck:
            if intent == KNOWN and car.lane >= 0 and car.choice >= 0:
                path = samples[i].path = _path_kept(roads, car, memory[i].path if memory[i].age > 0 else -1)
                if _fits(roads.lanes[car.lane], car, _BEYOND_KNOWN, _OFF_KNOWN, _TURNED_KNOWN):
                    count = _add(roads, track, car.lane, car.choice, i, car, v_cap, threats, count)
                    samples[i].lanes = 1 << car.lane
                s, lateral = local_coordinates(roads.lanes[car.lane], car.x, car.y)
                if before < count and before < len(threats):  # the first is the one that it keeps to
                    _put_on_path(roads, track, path, s, car.lane, threats[before])
                left = _lane_left(roads, car, path, s + roads.paths.offset[path, car.lane], lateral)
                if left >= 0:
                    count = _add(roads, track, left, roads.through[left], i, car, v_cap, threats, count)
                    samples[i].lanes |= 1 << left
            else:
                lanes = _fitting(roads, car, memory[i].reachable if memory[i].age > 0 else 0)
                samples[i].lanes = lanes
                expected = memory[i].ways if memory[i].age > 0 and intent == ANY else _ALL
                for attempt in (expected, _ALL):
                    samples[i].ways = 0
                    left_over = lanes
                    while left_over != 0:
                        lane = first_of(left_over)
                        left_over = without_first(left_over)
                        row = roads.straight[lane] if intent == STRAIGHT else roads.through[lane]
                        ways = _goes_on(roads, attempt, lane)
                        count = _add(roads, track, lane, row, i, car, v_cap, threats, count, ways)
                        samples[i].ways |= ways
                    if samples[i].ways != 0 or lanes == 0:
                        break
                    samples[i].strays = True
        samples[i].next_lanes = _joined(samples[i].lanes, roads.following)
        samples[i].reachable = _joined(samples[i].lanes, roads.reachable)
        samples[i].astray = count == before and not car.wreck
        if count == before or _stands_out(roads.paths, threats[before:count], i, car):
            if count < len(threats):
                _add_obstacle(roads, track, i, car, threats[count], box)
            count += 1
    return count


@compiled
def _stands_out(paths, ways, i, car):
    """Does a car stand, or nearly, where it reaches beyond what cars sweep on every way? Then it may stay like that."""
    return abs(car.speed) < _CREEPS and is_outside(paths, ways, i, car)


@compiled
def _fitting(roads, car, expected):
    """Lanes that a car may be driving on by its pose, of those expected if there are any; sets of bits."""
    lanes, everywhere = 0, (1 << len(roads.lanes)) - 1
    for among in (expected & everywhere, everywhere):  # `_ALL` has more bits than there are lanes
        if lanes != 0:
            break
        while among != 0:
            lane = first_of(among)
            among = without_first(among)
            if _fits(roads.lanes[lane], car, max(_BEYOND, roads.lead[lane]), _OFF, _TURNED):
                lanes |= 1 << lane
    return lanes


def _union(lanes: int, sets: np.ndarray) -> int:
    """`_joined`, for Python."""
    return int(np.bitwise_or.reduce([int(sets[lane]) for lane in range(len(sets)) if lanes >> lane & 1]))


@compiled
def _joined(lanes, sets):
    """Union of the sets `[L]` of some lanes, all as bits."""
    union = 0
    while lanes != 0:
        union |= sets[first_of(lanes)]
        lanes = without_first(lanes)
    return union


@compiled
def _fits(lane, car, before, off, turned):
    """May a car be driving on a lane?"""
    longer = max(car.length - CAR_LENGTH, 0.0)
    off += _OFF_LONGER * longer
    turned = min(turned + _TURNED_LONGER * longer, max(turned, _ACROSS))
    if is_far(lane, car.x, car.y, off, max(before, _BEYOND)):
        return False
    s, lateral = local_coordinates(lane, car.x, car.y)
    if abs(lateral) > off or s < -before or s > lane.length + _BEYOND:
        return False
    return abs(wrap_to_pi(car.heading - heading_at(lane, s))) < turned


@compiled
def _goes_on(roads, ways, lane):
    """Paths through a lane on which some of a set of paths go on; sets are bits.

    Who is on a ring may leave it at any exit, but is not expected to go around once more (rule J10). Else the ways that
    come up with every lane lead further than those for which plans were made on the frame before.
    """
    count = len(roads.onward)
    if count > _MOST_LANES:  # more than there are bits
        return _ALL
    onward, ways = 0, ways & (1 << count) - 1
    while ways != 0:
        path = first_of(ways)
        ways = without_first(ways)
        if roads.onward[path, lane] >= 0:
            onward |= 1 << roads.onward[path, lane]
    return onward


@compiled
def _add(roads, track, lane, row, i, car, v_cap, threats, count, ways=_ALL):
    s, _ = local_coordinates(roads.lanes[lane], car.x, car.y)
    for m in range(roads.choices.shape[1]):
        path = roads.choices[row, m]
        if path < 0:
            break
        if ways != _ALL and not ways >> path & 1:
            continue
        path += car.size * len(roads.paths.boxes)
        if count < len(threats):
            threat = threats[count]
            threat.user, threat.v = i, car.speed
            threat.cap = v_cap
            threat.half_length, threat.wreck, threat.red_for = 0.5 * car.length, False, 0.0
            _put_on_path(roads, track, path, s, lane, threat)
        count += 1
    return count


@compiled
def _put_on_path(roads, track, path, s, lane, threat):
    """Note that a way leads along a path, with the car at `s` [m] of one of its lanes."""
    threat.path, threat.s = path, roads.paths.offset[path, lane] + s
    threat.priority = roads.paths.priority[track.path, path]


@compiled
def _path_kept(roads, car, before):
    """Path of a car's announced route: the one from `before` while that leads on likewise, -1 = it had none.

    Paths that go on in the same way may have come from elsewhere, and then hold other cars until they have settled.
    """
    path = roads.choices[car.choice, 0] + car.size * len(roads.paths.boxes)
    if before < 0 or np.isnan(roads.paths.offset[before, car.lane]):
        return path
    stock = car.size * len(roads.paths.boxes)  # paths of its size, less those of stock cars
    return before if roads.onward[before - stock, car.lane] + stock == path else path


@compiled
def is_outside(paths, threats, i, car):
    """Does a car reach beyond what cars sweep on every way it may take? Not asked of obstacles."""
    outside = False
    for k in range(len(threats)):
        threat = threats[k]
        if threat.user == i and threat.path >= 0:
            box = paths.swept[threat.path, cell_of(threat.s, paths.cells[threat.path])]
            along, across = reach_beyond(box, car.x, car.y, car.heading, 0.5 * car.length, 0.5 * car.width)
            if along <= 0.0 and across <= 0.0:
                return False
            outside = True
    return outside


@compiled
def _add_obstacle(roads, track, i, car, threat, box):
    """A wreck, or a car that is on no lane: it stays, or goes on straight to rest. Who is no wreck may turn, too."""
    roll = max(car.speed, 0.0) * _ROLL
    length, turning = car.length, np.hypot(car.length, car.width)
    if not car.wreck and turning - length > 2.0 * MARGIN_LON:  # more than the ego's margin has room for
        length = turning
    cos, sin = np.cos(car.heading), np.sin(car.heading)
    box[X], box[Y] = car.x + 0.5 * roll * cos, car.y + 0.5 * roll * sin
    box[COS], box[SIN] = cos, sin
    box[HALF_LENGTH], box[HALF_WIDTH] = 0.5 * (length + roll), 0.5 * car.width
    threat.user, threat.path, threat.s, threat.v = i, -1, 0.0, max(car.speed, 0.0)
    threat.half_length, threat.wreck, threat.cap, threat.priority = 0.5 * car.length, True, 0.0, 0
    threat.arrives, threat.yields = 0.0, False
    block(roads.paths, track, box, threat)
