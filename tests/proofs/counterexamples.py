"""Each condition of the proof dropped: z3 finds a start that the shield would call safe, and a simulation the contact.

A start is sought from which one frame without the condition leaves the invariant by more than the rounding that it
allows for. Then both cars drive on, as far as their duties let them: on highway-env's bicycle (`envs.roads.bicycle`),
frame by frame, and with the predicates and responses of `shield.definitions`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import z3
from adversary import CAR, contact
from invariants import gap, safe_behind, safe_beside, v_front, v_rear, w_ego, w_other
from model import TABLE, ZERO, approach, d_min_of_pair, dt, forward_reach, front, rear, stopping_distance
from prover import find
from symbolic import number, real, symbolic

from rss_shield.envs.roads.bicycle import SPEED, X, Y, move
from rss_shield.shield.definitions import longitudinal
from rss_shield.shield.definitions.kinematics import speed_envelope
from rss_shield.shield.definitions.lateral import d_min_no_credit
from rss_shield.shield.definitions.lateral import d_min_of_pair as d_min_with_credit
from rss_shield.shield.definitions.longitudinal import d_min_following, is_safe_longitudinally
from rss_shield.shield.definitions.response import REAR, lateral_speed_limit, longitudinal_response, step_threshold
from rss_shield.shield.definitions.right_of_way import Approach, can_stop_before
from rss_shield.shield.params import RSSParams
from rss_shield.shield.sampling import euler_margin, lateral_euler_margin, sampling_margin, with_euler_margin

FRAME = 1 / 5  # [s]
SHORT = real(0.05)  # by how much a start has to be short, so that rounding hides nothing [m]
HORIZON = 600  # frames


class Replay(NamedTuple):
    """A pair that z3 has found, as the simulation takes it."""

    gap: float
    v_rear: float  # on the lateral axis: speed of the ego toward the other
    v_front: float  # on the lateral axis: speed of the other toward the ego
    rear: RSSParams
    front: RSSParams


class Dropped(NamedTuple):
    """A condition of the proof, and what happens without it."""

    condition: str
    what: str
    start: list[z3.BoolRef]
    replay: Callable[[Replay, bool], float]  # smallest gap without the condition (True), or with it (False) [m]

    def found(self) -> Replay | None:
        """Start of a contact by z3."""
        model = find([*_ORDINARY, *self.start])
        return None if model is None else _read(model)


def _ordinary(car, rho) -> list[z3.BoolRef]:
    """Numbers as cars have them, some of them fixed: any counterexample will do."""
    return [
        car.response_time == rho,
        car.a_max_accel >= 1,
        car.a_max_accel <= 4,
        car.a_min_brake >= 3,
        car.a_min_brake <= 9,
        car.a_max_brake >= 3,
        car.a_max_brake <= 9,
        car.a_min_brake_correct == car.a_min_brake,
        car.a_lat_max_accel == 1,
        car.a_lat_min_brake == real(1.5),
        car.mu == 0,
        car.standstill_gap == 0,
        car.v_cap >= 10,
        car.v_cap <= 1000,
    ]


_ORDINARY = [dt == real(FRAME), v_rear >= 0, v_rear <= 30, v_front >= 0, v_front <= 30, gap <= 300]
_WHOLE = [*_ordinary(rear, 2 * dt), *_ordinary(front, 2 * dt)]
_NO_CAP = [rear.v_cap == 1000, front.v_cap == 1000]


def _read(model: z3.ModelRef) -> Replay:
    def value(variable):
        return number(model.eval(variable, model_completion=True))

    cars = [RSSParams(*(value(field) for field in car)) for car in (rear, front)]
    speeds = (w_ego, w_other) if model[w_ego] is not None else (v_rear, v_front)
    return Replay(value(gap), value(speeds[0]), value(speeds[1]), *cars)


# ---------------------------------------------------------------- along the lane


def _bicycle(x: float, speed: float) -> np.ndarray:
    return np.array([x, 0.0, 0.0, speed, 0.0, 0.0])


def follow(
    pair: Replay,
    throttle: float = 1.0,
    leader: float = 1.0,
    reverse: float = 0.0,
    cap: bool = True,
    rho: float | None = None,
    latency: int = 0,
    braking: float = 1.0,
    forgetful: bool = False,
    margin: bool = True,
    answers: bool = True,
    distance: Callable[..., float] = d_min_following,
) -> float:
    """Smallest gap behind a leader that brakes to rest, of a follower that goes as fast as it may [m].

    Args:
      pair: where they start.
      throttle, braking, leader: times the acceleration and braking that each may, must, or may at most use.
      reverse: speed at which the leader backs up once it stands [m/s].
      cap: the follower keeps `v_cap`.
      rho: response time it goes by, if not the agreed one [s].
      latency: frames until its braking acts.
      forgetful: its clock of danger starts anew on every frame.
      margin: it knows of frames (C5).
      answers: it answers this axis at all (C7).
      distance: by which it is safe.
    """
    behind, ahead = _bicycle(0.0, pair.v_rear), _bicycle(pair.gap, pair.v_front)
    car = pair.rear if rho is None else pair.rear._replace(response_time=rho)
    smallest, axes, since = pair.gap, 0, 0
    commands = [np.inf] * latency
    for _ in range(HORIZON):
        room = ahead[X] - behind[X]
        smallest = min(smallest, room)
        if room < 0.0:
            break
        v, v_ahead = behind[SPEED], ahead[SPEED]
        required = distance(v, v_ahead, car, pair.front)
        required += euler_margin(v - v_ahead, car.a_min_brake, FRAME) if margin else 0.0
        axes, since = step_threshold(axes, 0 if forgetful else since, is_safe_longitudinally(room, required), False)
        upper = longitudinal_response(REAR, since * FRAME, v, car)[1] if since and answers else np.inf
        commands.append(braking * upper if upper < 0.0 else upper)
        a = min(commands.pop(0), throttle * car.a_max_accel)
        a = min(a, max((car.v_cap - v) / FRAME, 0.0)) if cap else a
        move(behind, max(a, -v / FRAME), 0.0, False, FRAME)
        slowest = -reverse if v_ahead <= 1e-9 else 0.0
        move(ahead, max(-leader * pair.front.a_max_brake, (slowest - v_ahead) / FRAME), 0.0, False, FRAME)
    return smallest


def _still_needs(v, s, car, b=None, cap=None):
    """What a follower covers at least that uses all its rights: the remainder of the last frame is left out."""
    b = car.a_min_brake if b is None else b
    return forward_reach(v, s, car.a_max_accel, b, car.v_cap if cap is None else cap) + v * dt / 2


def _at_most(v, car):
    """What a leader that brakes as hard as it may covers at most."""
    return stopping_distance(v, car.a_max_brake) + v * dt / 2 + car.a_max_brake * dt * dt / 8


def _short(gap, v, v_ahead, s, **changes):
    """The gap does not hold what is still to come."""
    return gap + SHORT < _still_needs(v, s, rear, **changes) - _at_most(v_ahead, front)


def _frame(gap, v, v_ahead, a, a_ahead):
    """State after a frame in which nobody comes to rest: (state, conditions)."""
    after = gap + (v_ahead - v) * dt, v + a * dt, v_ahead + a_ahead * dt
    return after, [after[1] >= 0, after[2] >= 0, after[0] > 0]


def _along() -> list[Dropped]:
    safe, rho = safe_behind(gap, v_rear, v_front), rear.response_time
    free = [*_WHOLE, *_NO_CAP, *TABLE]
    usual = [*free, safe, v_front >= 10]
    state = gap, v_rear, v_front
    a, b = rear.a_max_accel, front.a_max_brake
    faster, faster_is = _frame(*state, 2 * a, -b)
    harder, harder_is = _frame(*state, a, -2 * b)
    once, once_is = _frame(*state, a, -b)
    twice, twice_is = _frame(*once, a, -b)
    thrice, thrice_is = _frame(*twice, a, -b)
    bare = _safe_without_margin()
    fraction = [rear.response_time == dt / 2, *_WHOLE[1:], *_NO_CAP, *TABLE[:1], *TABLE[2:]]
    still = [v_rear == 0, v_front == 0]
    lemma_2 = [*_WHOLE, *_NO_CAP, *TABLE, safe_behind(gap, v_rear, v_front, longitudinal._d_min_lemma_2)]
    lemma_2 += [rear.a_max_accel == 1, rear.a_min_brake == 9, rear.a_max_brake == 9, front.a_max_brake == 3]
    chain, reached = state, []
    for k in range(6):
        chain, _ = _frame(*chain, rear.a_max_accel if k < 2 else -rear.a_min_brake, -front.a_max_brake)
        reached += [chain[1] > 0, chain[2] > 0]
    return [
        Dropped(
            "C1", "who follows accelerates twice as hard as agreed", [*usual, *faster_is, _short(*faster, rho - dt)],
            lambda pair, dropped: follow(pair, throttle=2.0 if dropped else 1.0),
        ),
        Dropped(
            "C1", "who leads brakes twice as hard as agreed", [*usual, *harder_is, _short(*harder, rho - dt)],
            lambda pair, dropped: follow(pair, leader=2.0 if dropped else 1.0),
        ),
        Dropped(
            "C1", "who leads reverses", [*_WHOLE, *_NO_CAP, *TABLE, safe, *still],
            lambda pair, dropped: follow(pair, reverse=1.5 if dropped else 0.0),
        ),
        Dropped(
            "C1", "who follows accelerates beyond v_cap",
            [*_WHOLE, *TABLE, safe, v_front >= 10, rear.v_cap == v_rear, *once_is,
             _short(*once, rho - dt, cap=real(1000.0))],
            lambda pair, dropped: follow(pair, cap=not dropped),
        ),
        Dropped(
            "C2", "response time of half a frame", [*fraction, safe, v_front >= 10, *once_is, _short(*once, ZERO)],
            lambda pair, dropped: follow(pair) if dropped else follow(pair, rho=FRAME, latency=0),
        ),
        Dropped(
            "C2", "braking acts a frame late", [*usual, *once_is, *twice_is, *thrice_is, _short(*thrice, ZERO)],
            lambda pair, dropped: follow(pair, latency=1 if dropped else 0),
        ),
        Dropped(
            "C3", "half the braking agreed", [*usual, _short(*state, rho, b=rear.a_min_brake / 2)],
            lambda pair, dropped: follow(pair, braking=0.5 if dropped else 1.0),
        ),
        Dropped(
            "C4", "Lemma 2 for who brakes harder than its leader", [*lemma_2, *reached, chain[0] + SHORT < 0],
            lambda pair, dropped: follow(pair, distance=_lemma_2 if dropped else d_min_following),
        ),
        Dropped(
            "C5", "no margin for frames", [*free, bare, v_front >= 10, *once_is, _short(*once, rho - dt)],
            lambda pair, dropped: follow(pair, margin=not dropped),
        ),
        Dropped(
            "C6", "started in danger", [*free, gap > 1, v_front >= 10, z3.Not(safe), _short(*state, ZERO)],
            lambda pair, dropped: follow(pair if dropped else _made_safe(pair)),
        ),
        Dropped(
            "C7", "the clock of danger starts anew on every frame",
            [*usual, *once_is, *twice_is, *thrice_is, _short(*thrice, ZERO)],
            lambda pair, dropped: follow(pair, forgetful=dropped),
        ),
        Dropped(
            "C7", "an axis is answered that was not the safe one", [*usual, _short(*state, rho + 2)],
            lambda pair, dropped: follow(pair, answers=not dropped),
        ),
    ]  # fmt: skip


def _safe_without_margin() -> z3.BoolRef:
    """The predicate of Def. 1 as it is for continuous time."""
    d = symbolic(longitudinal._d_min_lemma_2)(v_rear, v_front, rear, front)
    return z3.And(gap > 0, gap >= d)


def _lemma_2(v_rear, v_front, rear, front):
    return longitudinal.d_min_same_direction(v_rear, v_front, rear, front, "lemma2")


def _made_safe(pair: Replay) -> Replay:
    d = d_min_following(pair.v_rear, pair.v_front, pair.rear, pair.front)
    return pair._replace(gap=d + euler_margin(pair.v_rear - pair.v_front, pair.rear.a_min_brake, FRAME) + 1e-9)


# ---------------------------------------------------------------- across the lane


_ALONG = 30.0  # speed of both along the lane [m/s]


def side_by_side(
    pair: Replay, jump: float = 0.0, distance=d_min_no_credit, halts: bool = False, margin: bool = True
) -> float:
    """Smallest lateral gap of an ego and of another that come as close as they may [m].

    Args:
      pair: where they start.
      jump: what the ego's lateral speed grows by at once, while they are safe [m/s].
      distance: by which they are safe.
      halts: the ego stops at once, for somebody on its other side, instead of moving on.
      margin: both know of frames (C5).
    """
    ego, other = _bicycle(0.0, _ALONG), _bicycle(0.0, _ALONG)
    other[Y] = pair.gap
    w, w_theirs, axes, since, smallest, at_threshold = pair.v_rear, pair.v_front, 0, 0, pair.gap, (0.0, 0.0)
    for _ in range(HORIZON):
        room = other[Y] - ego[Y]
        smallest = min(smallest, room)
        required = distance(w, w_theirs, pair.rear, pair.front)
        if margin:
            required += lateral_euler_margin(max(w, 0.0), pair.rear, FRAME)
            required += sampling_margin(max(w_theirs, 0.0), pair.front, FRAME)
        axes, since = step_threshold(axes, since, False, room >= required)
        if since == 0:
            at_threshold = max(w, 0.0), max(w_theirs, 0.0)
        w = lateral_speed_limit(since, at_threshold[0], pair.rear, FRAME) + (jump if since == 0 else 0.0)
        w = 0.0 if halts else w
        following = speed_envelope((since + 1) * FRAME, at_threshold[1], *_lateral(pair.front))
        _sideways(ego, w)
        _sideways(other, -w_theirs)
        w_theirs = following
    return smallest


def _lateral(car: RSSParams) -> tuple[float, float, float]:
    return car.response_time, car.a_lat_max_accel, car.a_lat_min_brake


def _sideways(car: np.ndarray, u: float) -> None:
    """A frame across the lane at a speed: the bicycle turned to where that leads."""
    car[2] = np.arcsin(u / _ALONG)
    move(car, 0.0, 0.0, False, FRAME)


def _across() -> list[Dropped]:
    ego, other = rear, front
    slow = [w_ego >= -3, w_ego <= 3, w_other >= -3, w_other <= 3]
    usual = [*_WHOLE, *_NO_CAP, *TABLE, *slow]
    rho, jump = ego.response_time, real(1.0)

    def comes(w, s, car):  # at least: the remainder of the last frame is left out
        return approach(w, s, car) - car.a_lat_min_brake * dt * dt / 8

    jumped = w_ego + ego.a_lat_max_accel * dt + jump
    with_jump = gap - (jumped + w_other) * dt
    credited = safe_beside(gap, w_ego, w_other, d_min_of_pair)
    bare = gap >= symbolic(d_min_no_credit)(w_ego, w_other, ego, other)
    grown = w_ego + ego.a_lat_max_accel * dt
    after, theirs = gap - (grown + w_other) * dt, w_other + other.a_lat_max_accel * dt
    both = comes(grown, rho - dt, ego) + ego.a_lat_max_accel * (rho - dt) * dt + comes(theirs, rho - dt, other)
    return [
        Dropped(
            "C1y", "the lateral speed jumps",
            [*usual, w_ego >= 0, w_other >= 0, safe_beside(gap, w_ego, w_other), gap < 8,
             with_jump + SHORT < both],
            lambda pair, dropped: side_by_side(pair, jump=1.0 if dropped else 0.0),
        ),
        Dropped(
            "C4", "credit for moving away, and a third car on the other side",
            [*usual, w_ego <= -1, w_other >= 1, credited, gap + SHORT < comes(w_other, rho, other)],
            lambda pair, dropped: side_by_side(pair, distance=d_min_with_credit, halts=True)
            if dropped else side_by_side(_made_wide(pair), halts=True),
        ),
        Dropped(
            "C5", "no margin for frames, sideways",
            [*usual, w_ego >= 0, w_other >= 0, bare, after + real(0.01) < both],
            lambda pair, dropped: side_by_side(pair if dropped else _made_wide(pair), margin=not dropped),
        ),
    ]  # fmt: skip


def _made_wide(pair: Replay) -> Replay:
    required = d_min_no_credit(pair.v_rear, pair.v_front, pair.rear, pair.front)
    required += lateral_euler_margin(max(pair.v_rear, 0.0), pair.rear, FRAME)
    return pair._replace(gap=required + sampling_margin(max(pair.v_front, 0.0), pair.front, FRAME) + 1e-9)


# ---------------------------------------------------------------- where roads cross, and between samples


def enter(pair: Replay, margin: bool) -> float:
    """Smallest distance to a conflict area of a car without priority that comes as close as it may [m]."""
    car, axes, since, smallest = _bicycle(-pair.gap, pair.v_rear), 0, 0, pair.gap
    for _ in range(HORIZON):
        before = Approach(-car[X], np.inf, 0.0, car[SPEED], 0.0)
        smallest = min(smallest, before.enter)
        before = with_euler_margin(before, pair.rear, FRAME) if margin else before
        axes, since = step_threshold(axes, since, can_stop_before(before.enter, before.v, pair.rear), False)
        upper = longitudinal_response(REAR, since * FRAME, car[SPEED], pair.rear)[1] if since else np.inf
        a = max(min(upper, pair.rear.a_max_accel), -car[SPEED] / FRAME)
        move(car, a, 0.0, False, FRAME)
    return smallest


def _at_areas() -> list[Dropped]:
    reach = forward_reach(v_rear, rear.response_time, rear.a_max_accel, rear.a_min_brake, rear.v_cap)
    v_next = v_rear + rear.a_max_accel * dt
    needs = _still_needs(v_next, rear.response_time - dt, rear)
    bare = [*_WHOLE, *_NO_CAP, *TABLE, v_front == 0, gap >= reach, gap - v_rear * dt + SHORT < needs]
    return [
        Dropped(
            "C5", "no margin for frames, before a conflict area", bare,
            lambda pair, dropped: enter(pair if dropped else _put_before(pair), not dropped),
        )
    ]  # fmt: skip


def _put_before(pair: Replay) -> Replay:
    """The same car, as far back as the sampled distance asks for."""
    car = with_euler_margin(Approach(0.0, np.inf, 0.0, pair.v_rear, 0.0), pair.rear, FRAME)
    return pair._replace(gap=pair.gap - car.enter + 1e-9)


def predicted(pair: Replay, slip_counts: bool) -> float:
    """Smallest lateral gap as a test of contacts sees it: with the way that a heading leads to, or the true way [m]."""
    ego, other = np.zeros(1, CAR)[0], np.zeros(1, CAR)[0]
    for car, y in ((ego, 0.0), (other, pair.gap + 2.0)):
        car["y"], car["length"], car["width"], car["speed"] = y, 5.0, 2.0, _ALONG
    ego["heading"] = np.arcsin(pair.v_rear / _ALONG)
    boxes, soon = contact(ego, other, FRAME)
    assert not boxes
    moved = _bicycle(0.0, _ALONG)
    _sideways(moved, 0.0)  # its slip makes up for its heading
    apart = pair.gap - moved[Y]
    return apart if slip_counts else (-apart if soon else apart)


def _between() -> list[Dropped]:
    turned = [w_ego == 2, w_other == 0, gap >= real(0.3), gap - w_ego * dt < -real(0.01)]
    return [
        Dropped(
            "C8", "contacts predicted along headings, slip left out", [*_WHOLE, *_NO_CAP, *TABLE, *turned],
            lambda pair, dropped: predicted(pair, not dropped),
        )
    ]  # fmt: skip


def all_dropped() -> list[Dropped]:
    """Every condition, some in several ways."""
    return [*_along(), *_across(), *_at_areas(), *_between()]
