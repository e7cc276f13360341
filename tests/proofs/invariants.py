"""The sampled-data theorem as inductive invariants over one explicit-Euler frame, for all real numbers.

Every invariant has the same three parts. *Start*: a pair that the shield calls safe satisfies it. *Frame*: whatever
both do in a frame that their duties permit, it holds after the frame. *Apart*: where it holds, the two do not touch. A
safe sample starts it anew with the whole response time, so by induction nobody is touched at any sample of any length.
"""

from collections.abc import Callable
from typing import NamedTuple

import z3
from model import (
    C4,
    TABLE,
    ZERO,
    after_a_frame,
    approach,
    approach_at_once,
    can_stop_before,
    d_min_no_credit,
    dt,
    euler_margin,
    fastest_next,
    forward_reach,
    front,
    in_range,
    is_safe_longitudinally,
    keeps_aside,
    keeps_its_response,
    lateral_euler_margin,
    leads,
    least_way,
    rear,
    sampling_margin,
    stopping_distance,
    way,
    whole_frames,
    with_euler_margin,
)
from symbolic import INFINITY, driver, real, symbolic

from rss_shield.shield.definitions import longitudinal, response
from rss_shield.shield.definitions.right_of_way import Approach
from rss_shield.shield.lanes import anticipation


class Statement(NamedTuple):
    """An implication between real numbers."""

    part: str
    given: list[z3.BoolRef]
    goal: z3.BoolRef


class Invariant(NamedTuple):
    """What is proved of one kind of pair."""

    name: str
    says: str
    conditions: str  # which conditions of the proof it uses
    statements: Callable[[], list[Statement]]
    quick: bool = False  # settled in a second or so


gap, gap_next, v_rear, v_front, u_rear, u_front = z3.Reals("gap gap_next v_rear v_front u_rear u_front")
s, s_other = z3.Reals("s s_other")


# ---------------------------------------------------------------- one car


def _uses_no_more(v, u, s, car, b) -> tuple[list[Statement], z3.BoolRef]:
    """A car that keeps its response uses no more of its budget than it drives: (statements, what they say)."""
    table = [dt > 0, *in_range(car), b > 0, s >= 0, whole_frames(s)]
    fastest, slower, w = fastest_next(v, s, car, b), z3.Real("slower"), z3.Real("w")
    worst = way(fastest, after_a_frame(s), car, b) <= way(v, s, car, b) - v * dt
    less = way(slower, w, car, b) <= way(u, w, car, b)
    goal = way(u, after_a_frame(s), car, b) <= way(v, s, car, b) - v * dt
    anyhow = [dt > 0, *in_range(car), b > 0, w >= 0, slower <= u]
    left = after_a_frame(s)
    terms = [way(fastest, left, car, b), way(u, left, car, b), way(v, s, car, b)]
    both = [worst, way(u, left, car, b) <= way(fastest, left, car, b)]
    return [
        Statement("frame, at its fastest, coming", [*table, v >= 0], worst),
        Statement("frame, at its fastest, backing away", [*table, v < 0], worst),
        Statement("frame, slower needs less", anyhow, less),
        _without(terms, Statement("frame", both, goal)),
    ], goal


def _leaves_no_less(v, u, car) -> tuple[list[Statement], z3.BoolRef]:
    """A leader that brakes no harder than agreed still covers what it was counted on for."""
    b = car.a_max_brake
    goal = least_way(u, b) >= least_way(v, b) - v * dt
    return [Statement("frame, leading", [dt > 0, *in_range(car), v >= 0, leads(v, u, car)], goal)], goal


def _one_car() -> list[Statement]:
    car, b, v, u = driver("car"), *z3.Reals("b v u")
    table = [dt > 0, *in_range(car), b > 0, s >= 0]
    return [
        *_uses_no_more(v, u, s, car, b)[0],
        *_leaves_no_less(v, u, car)[0],
        Statement("apart", table, way(v, s, car, b) >= 0),
    ]


# ---------------------------------------------------------------- same direction: Def. 1


def following(gap, v_rear, v_front, s, rear=rear, front=front) -> z3.BoolRef:
    """The gap, and the way that the leader still goes at least, hold the way that the follower may still go."""
    return z3.And(gap >= 0, gap >= way(v_rear, s, rear, rear.a_min_brake) - least_way(v_front, front.a_max_brake))


def safe_behind(gap, v_rear, v_front, distance=longitudinal.d_min_following) -> z3.BoolRef:
    """The predicate of the shield (`assess`) for two cars that drive the same way."""
    d = symbolic(distance, *TABLE, *C4)(v_rear, v_front, rear, front)
    return is_safe_longitudinally(gap, d + euler_margin(v_rear - v_front, rear.a_min_brake, dt))


FORWARD = [v_rear >= 0, v_front >= 0, u_rear >= 0, u_front >= 0]
MOVES = gap_next == gap + (v_front - v_rear) * dt


def _following() -> list[Statement]:
    table = [*TABLE, *C4, *FORWARD]
    kept = keeps_its_response(v_rear, u_rear, s, rear, rear.a_min_brake)
    led = leads(v_front, u_front, front)
    times = [s >= 0, whole_frames(s)]
    before = following(gap, v_rear, v_front, s)
    after = following(gap_next, u_rear, u_front, after_a_frame(s))
    needs, needs_next = (way(v, left, rear, rear.a_min_brake) for v, left in ((v_rear, s), (u_rear, after_a_frame(s))))
    gets, gets_next = least_way(v_front, front.a_max_brake), least_way(u_front, front.a_max_brake)
    _, used = _uses_no_more(v_rear, u_rear, s, rear, rear.a_min_brake)  # of one car
    _, left = _leaves_no_less(v_front, u_front, front)
    start = following(gap, v_rear, v_front, rear.response_time)
    return [
        Statement("start", [*table, safe_behind(gap, v_rear, v_front)], start),
        _without([needs, needs_next, gets, gets_next], Statement("frame", [before, MOVES, used, left], after.arg(1))),
        Statement("frame, the gap", [*table, before, MOVES, kept, led, *times], after.arg(0)),
        _without([needs, gets], Statement("apart", [before], gap >= 0)),
    ]


def _without(terms: list[z3.ExprRef], statement: Statement) -> Statement:
    """A statement that does not know what some of its terms are: it says more, and is easier to prove."""
    pairs = [(term, z3.Real(f"term{k}")) for k, term in enumerate(terms)]
    given = [z3.substitute(one, *pairs) for one in statement.given]
    return Statement(statement.part, given, z3.substitute(statement.goal, *pairs))


# ---------------------------------------------------------------- toward each other: Def. 2 and its totals


def facing(gap, v_one, v_two, s_one, s_two, b_one, b_two) -> z3.BoolRef:
    """The gap holds the ways that both may still come toward each other."""
    return gap >= way(v_one, s_one, rear, b_one) + way(v_two, s_two, front, b_two)


def _facing() -> list[Statement]:
    b_one, b_two, away, away_next = z3.Reals("b_one b_two away away_next")
    v_two, u_two = -away, -away_next  # `d_min_longitudinal` measures both speeds in one direction
    table = [*TABLE, b_one > 0, b_two > 0]
    reaches = [
        forward_reach(v, car.response_time, car.a_max_accel, b, car.v_cap)
        for v, car, b in ((v_rear, rear, b_one), (v_two, front, b_two))
    ]
    d = symbolic(longitudinal.d_min_longitudinal)(v_rear, away, True, rear, front, b_one, b_two)
    d += euler_margin(v_rear, b_one, dt) + euler_margin(v_two, b_two, dt)
    terms, used = [], []
    for v, u, left, car, b in ((v_rear, u_rear, s, rear, b_one), (v_two, u_two, s_other, front, b_two)):
        used.append(_uses_no_more(v, u, left, car, b)[1])  # of one car
        terms += [way(v, left, car, b), way(u, after_a_frame(left), car, b)]
    before = facing(gap, v_rear, v_two, s, s_other, b_one, b_two)
    after = facing(gap_next, u_rear, u_two, after_a_frame(s), after_a_frame(s_other), b_one, b_two)
    moved = gap_next == gap - (v_rear + v_two) * dt
    start = facing(gap, v_rear, v_two, rear.response_time, front.response_time, b_one, b_two)
    not_negative = [term >= 0 for term in terms]  # of one car
    return [
        _without(reaches, Statement("start", [*table, is_safe_longitudinally(gap, d)], start)),
        _without(terms, Statement("frame", [before, moved, *used], after)),
        _without(terms, Statement("apart", [before, *not_negative], gap >= 0)),
    ]


# ---------------------------------------------------------------- side by side: Def. 6 without credit


w_ego, w_other, u_ego, u_other, limit = z3.Reals("w_ego w_other u_ego u_other limit")
ego, other = rear, front
MU = (ego.mu + other.mu) / 2


def beside(gap, limit, w_other, s, s_other) -> z3.BoolRef:
    """The lateral gap holds what both may still come closer, and mu."""
    return gap >= MU + approach_at_once(limit, s, ego) + approach(w_other, s_other, other)


def safe_beside(gap, w_ego, w_other, distance=d_min_no_credit) -> z3.BoolRef:
    """The predicate of the shield (`assess`), without the room for predicted contacts."""
    d = distance(w_ego, w_other, ego, other)
    forward = z3.If(w_ego > 0, w_ego, ZERO), z3.If(w_other > 0, w_other, ZERO)
    return gap >= d + lateral_euler_margin(forward[0], ego, dt) + sampling_margin(forward[1], other, dt)


def limited(limit, u, limit_next, s) -> z3.BoolRef:
    """Def. 8 for the ego (`lateral_speed_limit`): the frame's own lateral speed, and the limit of the next."""
    grown = limit + ego.a_lat_max_accel * dt
    slower = limit - ego.a_lat_min_brake * dt
    return z3.And(
        u <= z3.If(s >= dt, grown, limit),
        limit_next == z3.If(s >= dt, grown, z3.If(slower > 0, slower, ZERO)),
    )


def _beside() -> list[Statement]:
    limit_next = z3.Real("limit_next")
    table = [*TABLE, limit >= 0]
    times = [s >= 0, s_other >= 0, whole_frames(s), whole_frames(s_other)]
    needs, needs_next = approach_at_once(limit, s, ego), approach_at_once(limit_next, after_a_frame(s), ego)
    theirs, theirs_next = approach(w_other, s_other, other), approach(u_other, after_a_frame(s_other), other)
    obeyed = limited(limit, u_ego, limit_next, s)
    kept = keeps_aside(w_other, u_other, s_other, other)
    used = [
        Statement("frame, the ego", [*table, *times, obeyed], needs_next <= needs - u_ego * dt),
        Statement("frame, the other", [*table, *times, kept], theirs_next <= theirs - w_other * dt),
    ]
    before = beside(gap, limit, w_other, s, s_other)
    after = beside(gap_next, limit_next, u_other, after_a_frame(s), after_a_frame(s_other))
    moved = gap_next == gap - (u_ego + w_other) * dt
    start = beside(gap, z3.If(w_ego > 0, w_ego, ZERO), w_other, ego.response_time, other.response_time)
    terms = [needs, needs_next, theirs, theirs_next]
    not_negative = [
        Statement("apart, the ego", [*table, *times], needs >= 0),
        Statement("apart, the other", [*table, *times], theirs >= 0),
    ]
    return [
        Statement("start", [*table, safe_beside(gap, w_ego, w_other)], start),
        *used,
        _without(terms, Statement("frame, both", [before, moved, *(one.goal for one in used)], after)),
        *not_negative,
        _without(terms, Statement("apart", [*table, before, *(one.goal for one in not_negative)], gap >= 0)),
    ]


# ---------------------------------------------------------------- where roads cross: item 1 of Def. 17


def stays_out(enter, v, s) -> z3.BoolRef:
    """A car without priority needs no more than its distance to the conflict area."""
    return enter >= way(v, s, rear, rear.a_min_brake)


def safe_before(enter, v) -> z3.BoolRef:
    """Item 1 of Def. 17, sampled: `can_stop_before` from where `with_euler_margin` puts the car."""
    length, leave = z3.Reals("length leave")
    car = with_euler_margin(Approach(enter, leave, length, v, ZERO), rear, dt)
    return can_stop_before(car.enter, car.v, rear)


def _stays_out() -> list[Statement]:
    enter, enter_next = z3.Reals("enter enter_next")
    table = [*TABLE, v_rear >= 0, u_rear >= 0]
    _, used = _uses_no_more(v_rear, u_rear, s, rear, rear.a_min_brake)  # of one car
    needs, needs_next = (way(v, left, rear, rear.a_min_brake) for v, left in ((v_rear, s), (u_rear, after_a_frame(s))))
    before, after = stays_out(enter, v_rear, s), stays_out(enter_next, u_rear, after_a_frame(s))
    moved = enter_next == enter - v_rear * dt
    return [
        Statement("start", [*table, safe_before(enter, v_rear)], stays_out(enter, v_rear, rear.response_time)),
        _without([needs, needs_next], Statement("frame", [before, moved, used], after)),
        _without([needs], Statement("apart", [needs >= 0, before], enter >= 0)),
    ]


# ---------------------------------------------------------------- both axes: Defs. 9, 10 and C7


def _both_axes() -> list[Statement]:
    """Which axis is answered: the one that was safe last. Each axis counts as its own invariant, proved above."""
    lon, lat, safe_lon, safe_lat, lon_after, lat_after = z3.Bools("lon lat safe_lon safe_lat lon_after lat_after")
    axes, since = z3.Ints("axes since")
    axes_after, _ = symbolic(response.step_threshold)(axes, since, safe_lon, safe_lat)

    def answers(axes, axis):
        return z3.Or(axes == axis, axes == response.LON | response.LAT)

    def holds(axes, lon, lat):
        remembered = [z3.Implies(answers(axes, axis), one) for axis, one in ((response.LON, lon), (response.LAT, lat))]
        return z3.And(axes >= 1, axes <= 3, *remembered)

    kept = [
        z3.Implies(z3.And(answers(axes, response.LON), lon), lon_after),  # by its response, while it is remembered
        z3.Implies(z3.And(answers(axes, response.LAT), lat), lat_after),
        z3.Implies(safe_lon, lon_after),  # a safe sample starts an invariant anew
        z3.Implies(safe_lat, lat_after),
    ]
    return [
        Statement("frame", [holds(axes, lon, lat), *kept], holds(axes_after, lon_after, lat_after)),
        Statement("apart", [holds(axes, lon, lat)], z3.Or(lon, lat)),
    ]


# ---------------------------------------------------------------- feasibility, sampling, anticipation


def _never_contradict() -> list[Statement]:
    """What two neighbours ask of one driver at once can be done (Def. 4, C4)."""
    tau, tau_two, v = z3.Reals("tau tau_two v")
    roles = {"front": response.FRONT, "rear": response.REAR, "correct": response.CORRECT, "wrong": response.WRONG}
    table = [*TABLE, v >= 0, tau >= 0, tau_two >= 0, rear.a_max_accel <= INFINITY]
    statements = []
    for one, role in roles.items():
        for two, role_two in roles.items():
            if role > role_two:
                continue
            low, high = symbolic(response.longitudinal_response)(role, tau, v, rear)
            low_two, high_two = symbolic(response.longitudinal_response)(role_two, tau_two, v, rear)
            highest = [_value(end) for end in (high, high_two)]
            statements += [
                Statement(f"{one} and {two}", table, low_end <= high_end)
                for low_end in (low, low_two)
                for high_end in highest
            ]
    return statements


def _value(number):
    return number if isinstance(number, z3.ExprRef) else real(number)


def _between_samples() -> list[Statement]:
    """Cars apart at two samples are apart between them: in a frame of explicit Euler speeds are constant (C8)."""
    t = z3.Real("t")
    frame = [gap_next == gap + (v_front - v_rear) * dt, t >= 0, t <= dt, dt > 0]
    return [Statement("frame", [*frame, gap >= 0, gap_next >= 0], gap + (v_front - v_rear) * t >= 0)]


a_front, margin, rate, nominal = z3.Reals("a_front margin rate nominal")


def _capped(cap, upper):
    """What `merge` and anticipation leave of a nominal acceleration (`restrict`)."""
    highest = z3.If(cap < upper, cap, upper)
    lowest = -rear.a_max_brake
    at_least = z3.If(nominal > lowest, nominal, lowest)
    return z3.If(at_least < highest, at_least, highest)


def _anticipation() -> list[Statement]:
    """Its caps come last, on top of what duties leave: accelerate less, move sideways more slowly, both possible."""
    anything, upper, some_cap = z3.Reals("anything upper some_cap")
    table = [*TABLE, *C4, v_rear >= 0, v_front >= 0, margin >= 0, rate > 0, rear.a_max_accel <= INFINITY]
    helpers = dict(_fastest=_is(anything), speed_cap_credit=_is(anything), share_kept=_is(anything))
    acceleration = symbolic(anticipation.acceleration_cap, *table, **helpers)
    cap = acceleration(gap, margin, v_rear, v_front, a_front, rear, front, rate, dt)
    sideways = symbolic(anticipation.lateral_cap, _root=_is(anything), share_kept=_is(anything))
    lateral = sideways(margin, w_ego, w_other, ego, rate, dt)
    duties = z3.Or(upper == rear.a_max_accel, upper == -rear.a_min_brake, upper == -rear.a_max_brake)
    capped, free = _capped(some_cap, upper), _capped(INFINITY, upper)
    given = [*table, duties, some_cap >= -rear.a_min_brake]
    return [
        Statement("asks for no more than a_min_brake", table, cap >= -rear.a_min_brake),
        Statement("never forbids to stop moving sideways", table, lateral >= 0),
        Statement("accelerates no more", given, capped <= free),
        Statement("brakes no harder than a leader may", given, capped >= -rear.a_max_brake),
        Statement("changes nothing where braking is owed", [*given, upper < 0], capped == free),
    ]


def _is(value):
    return lambda *_: value


def _keeps_a_share() -> list[Statement]:
    """Who obeys the cap behind a leader that goes on as it does is safe at the next sample, with the share left.

    Where `v_cap` is out of reach, and the cap is less than what danger would ask for.
    """
    speed, v_next, d, kept = z3.Reals("speed v_next d kept")
    car = rear._replace(v_cap=v_next + rear.a_max_accel * rear.response_time)
    table = [*TABLE, *C4, v_next >= 0, v_front >= 0, v_rear >= 0, d >= 0]
    fastest = symbolic(anticipation._fastest)(d, v_front, car, dt)
    reached = forward_reach(v_next, car.response_time, car.a_max_accel, car.a_min_brake, car.v_cap)
    closing = z3.If(v_next > v_front, v_next - v_front, ZERO)
    lemma = Statement("frame, the speed", [*table, v_next <= fastest], reached + closing * dt / 2 <= d)

    braking = z3.If(a_front < 0, a_front, ZERO)
    braking = z3.If(braking > -front.a_max_brake, braking, -front.a_max_brake)
    expected = z3.If(v_front + braking * dt > 0, v_front + braking * dt, ZERO)
    helpers = dict(_fastest=_is(speed), speed_cap_credit=_is(ZERO), share_kept=_is(kept))
    acceleration = symbolic(anticipation.acceleration_cap, *table, *TABLE, *C4, **helpers)
    cap = acceleration(gap, margin, v_rear, v_front, a_front, rear, front, rate, dt)
    obeyed = [v_next <= v_rear + cap * dt, v_next <= v_rear + rear.a_max_accel * dt, cap > -rear.a_min_brake]
    u = z3.Real("u")  # of the leader at the next sample
    room = gap_next - kept - rear.standstill_gap - rear.a_min_brake * dt**2 / 8
    reached_next = z3.Real("reached_next")
    slower = z3.If(v_next > u, v_next - u, ZERO)
    known = [
        z3.Implies(v_next <= speed, reached_next + slower * dt / 2 <= room + stopping_distance(u, front.a_max_brake)),
        reached_next >= stopping_distance(v_next, rear.a_min_brake),
        u >= 0,
    ]
    beyond = z3.If(
        reached_next > stopping_distance(u, front.a_max_brake),
        reached_next - stopping_distance(u, front.a_max_brake),
        ZERO,
    )
    required = beyond + rear.standstill_gap + euler_margin(v_next - u, rear.a_min_brake, dt)
    return [
        lemma,
        Statement("frame, at least its way to rest", table, reached >= stopping_distance(v_next, car.a_min_brake)),
        Statement("frame, the cap", [*table, rear.a_max_accel <= INFINITY, *obeyed], v_next <= speed),
        Statement("frame, the leader", table, expected >= 0),
        Statement("frame", [*table, *known, room >= 0, v_next <= speed], gap_next - required >= kept),
    ]


INVARIANTS = (
    Invariant("one car", "who keeps its response uses no more than its share", "C1 C2 C3 C5", _one_car, quick=True),
    Invariant("same direction", "who follows does not touch who leads", "C1 C2 C3 C4 C5 C6", _following),
    Invariant(
        "head-on",
        "cars that come toward each other stop apart, whatever the signs of their speeds",
        "C1 C2 C3 C5 C6",
        _facing,
        quick=True,
    ),
    Invariant("side by side", "without credit nobody comes sideways into a neighbour", "C1y C2 C4 C5 C6", _beside),
    Invariant("conflict area, item 1", "a car without priority stays out", "C1 C2 C3 C5 C6", _stays_out, quick=True),
    Invariant("two axes", "the axis that was safe last keeps a pair apart", "C7", _both_axes, quick=True),
    Invariant("duties together", "what any two neighbours ask for can be done at once", "C4", _never_contradict),
    Invariant("between samples", "who is apart at samples is apart between them", "C8", _between_samples, quick=True),
    Invariant("anticipation", "weakens none of the above", "C4", _anticipation, quick=True),
    Invariant(
        "anticipation, share",
        "keeps a share of the margin behind a leader that goes on as it does",
        "C4 C5",
        _keeps_a_share,
        quick=True,
    ),
)

# what is not proved by a machine, and why
OPEN = (
    (
        "the exact distance, where who follows brakes harder than who leads (H1)",
        "the largest of three cases, one of them in the middle of braking: its invariant is not written down; "
        "`test_def01_same_direction.py` compares it with simulation",
    ),
    (
        "items 2 and 3 of Def. 17, and plans",
        "arrival times are roots of polynomials that depend on the path, and plans are loops over cells",
    ),
    (
        "steering: that the lateral speed stays within its limit, and boxes that turn",
        "sines and arcsines, for which z3 decides nothing; `test_theorems.py` plays adversaries",
    ),
    (
        "the growth of the lateral speed that a judge allows others on their first frame, a_lat_max_accel dt^2",
        "the distance does not have it: `mu` stands in, so it is a matter of numbers, not of formulas",
    ),
    ("backing up (H12)", "its share is granted twice, before and after it begins; not encoded"),
    ("rounding", "the proofs are about real numbers, the shield computes with floats of 64 bits"),
)
