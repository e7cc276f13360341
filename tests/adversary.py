"""A compiled world of drivers who mean harm: the ego, and others who use every right that RSS leaves them.

One frame is what highway-env does: everybody chooses a command from one state, then explicit Euler moves
everybody, then contact is tested, also for the next frame. The road is straight and wide, the ego drives
along +x and y points to its right. The others keep the law by their own copy of it, written here from the
definitions: only the table of parameters and margins is shared with the shield.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.shield._numba.compiled import compiled_for_arrays as compiled
from rss_shield.shield.command import Command
from rss_shield.shield.definitions.response import LAT, LON
from rss_shield.shield.geometry import half_extents, largest_half_extents
from rss_shield.shield.lanes.controller import find_danger, respond
from rss_shield.shield.lanes.judge import judge_contact, judge_frame
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import MEMORY, merge, remember
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.lanes.restriction import Body, restrict
from rss_shield.shield.params import PRESETS, RSSParams, Rules, Table
from rss_shield.shield.sampling import frames_for

HALF_WHEELBASE = 2.5  # [m]
MAX_SLIP = float(np.arctan(np.tan(np.pi / 3) / 2))  # of highway-env's steering [rad]
MAX_SPEED = 40.0  # [m/s]
CAR_WIDTH, OBSTACLE_SIZE = 2.0, 2.0  # [m]

CAR = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("heading", "f8"),
        ("speed", "f8"),  # negative in reverse
        ("u", "f8"),  # speed across and along the lane over the last frame, slip included
        ("along", "f8"),
        ("length", "f8"),
        ("width", "f8"),
        ("facing", "f8"),  # +1 drives the ego's way, -1 comes toward it
        ("own_lane", "?"),
        ("wreck", "?"),
        ("vice", "i8"),
        # what it is up to, and for how many frames more
        ("throttle", "i8"),
        ("wheel", "i8"),
        ("hold", "i8"),
    ],
    align=True,
)

# what one other knows of its danger with the ego
LAW = np.dtype(
    [
        ("since", "i8"),  # frames since the last safe sample
        ("lon", "?"),  # was it safe on this axis there?
        ("lat", "?"),
        ("must_brake", "?"),
        ("braking", "f8"),
        ("side", "f8"),  # where the ego was: +1 at larger y
        ("w", "f8"),  # own speed toward it then
    ],
    align=True,
)

EPISODE = np.dtype(
    [
        ("contact", "i8"),  # frame, -1 if none
        ("boxes", "?"),  # the boxes overlapped in truth, not only in prediction
        ("partner", "i8"),
        ("verdict", "i8"),
        ("ego_duty", "i8"),
        ("ego_excess", "f8"),
        ("other_duty", "i8"),
        ("other_excess", "f8"),
        ("broken", "i8"),  # pair-frames on which the ego broke a duty
        ("accused", "i8"),  # ... on which the other has broken one
        ("disputed", "i8"),  # ... on which shield and other disagree whether there is danger
        ("danger_lon", "i8"),  # ... in danger, by the axis to respond on
        ("danger_lat", "i8"),
        ("answered_now", "i8"),  # frames braked for who is ahead by now (hole H23)
        ("overridden", "i8"),  # frames
        ("heading", "f8"),  # largest of the ego [rad]
        ("backed_up", "i8"),  # frames in reverse
        ("fastest_back", "f8"),  # [m/s]
        ("gap_lon", "f8"),  # smallest gap in danger, where this axis has to keep the pair apart [m]
        ("gap_lat", "f8"),
    ],
    align=True,
)


class World(NamedTuple):
    """What an episode is made of, and which part of the shield is broken."""

    ego: RSSParams
    other: RSSParams
    rules: Rules  # of the shield
    steering: Rules  # of its steering
    published: Rules  # of the others and of the judge
    dt: float
    frames: int
    length: float  # of the cars [m]
    others: int = 1
    lawful: bool = True  # the others keep the law
    shielded: bool = True
    start_safe: bool = True
    backs_up: bool = False  # the ego often stands, the others are often slow, and it asks for reverse
    backs_into: bool = False  # the ego backs up whoever is behind
    latency: int = 0  # frames between a command and its effect
    soft_brake: bool = False  # brake by a P controller instead of directly
    free_throttle: bool = False  # outside its duties the ego accelerates and brakes without limit
    free_wheel: bool = False  # ... and its lateral speed may jump
    forgetful: bool = False  # memory wiped on every frame
    one_axis: bool = False  # answers only the longitudinal axis where both were lost
    vice: int = -1  # of everybody; -1 = drawn


def world(
    dt=1 / 15, frames=300, bare=False, ego=None, other=None, rules=None, published=None, steering=None, **fields
) -> World:
    """The default table at frame length `dt`, response times in whole frames.

    `bare` takes out every spare room that hides a missing margin: wobble width, standstill gap and, by very
    short cars, the room that a car needs to turn in. The ego anticipates nothing unless `published` or `rules` say so:
    there would be less danger to tell of.
    """
    base = PRESETS["simulator"]
    spare = dict(mu=0.0, standstill_gap=0.0) if bare else {}
    ego, other = base.ego._replace(**spare | (ego or {})), base.other._replace(**spare | (other or {}))
    ego = ego._replace(response_time=float(frames_for(max(ego.response_time, dt), dt) * dt))
    other = other._replace(response_time=float(frames_for(other.response_time, dt) * dt))
    published = Rules(**{"anticipation": 0.0} | (published or {}))
    rules = published._replace(**rules or {})
    return World(
        ego, other, rules, rules._replace(**steering or {}), published, dt, frames, 0.02 if bare else 5.0, **fields
    )


# ---------------------------------------------------------------- motion and contact, as in highway-env


@compiled
def move(car, acceleration, course, heading, dt):
    """One frame of explicit Euler: drive on `course` (where to, in the world), then point along `heading`."""
    car.u, car.along = car.speed * np.sin(course), car.speed * np.cos(course)
    car.x += car.along * dt
    car.y += car.u * dt
    car.heading = heading
    car.speed += acceleration * dt


@compiled
def turn(car, slip, dt):
    """(course, next heading) of the kinematic bicycle."""
    return car.heading + slip, car.heading + car.speed * np.sin(slip) / HALF_WHEELBASE * dt


@compiled
def contact(a, b, dt):
    """(boxes intersect, are predicted to): `RoadObject.handle_collisions` in whichever order it sees the two."""
    reach = 0.5 * (np.hypot(a.length, a.width) + np.hypot(b.length, b.width)) + max(a.speed, b.speed) * dt
    if np.hypot(a.x - b.x, a.y - b.y) > reach:
        return False, False
    dx = (a.speed * np.cos(a.heading) - b.speed * np.cos(b.heading)) * dt
    dy = (a.speed * np.sin(a.heading) - b.speed * np.sin(b.heading)) * dt
    now = soon = True
    for heading in (a.heading, a.heading + np.pi / 2, b.heading, b.heading + np.pi / 2):
        cos, sin = np.cos(heading), np.sin(heading)
        distance, moved = cos * (a.x - b.x) + sin * (a.y - b.y), cos * dx + sin * dy
        half = _shadow(a, heading) + _shadow(b, heading)
        now = now and abs(distance) <= half
        soon = soon and distance + min(moved, 0.0) <= half and distance + max(moved, 0.0) >= -half
    return now, soon


@compiled
def _shadow(car, heading):
    along, across = abs(np.cos(car.heading - heading)), abs(np.sin(car.heading - heading))
    return 0.5 * (car.length * along + car.width * across)


# ---------------------------------------------------------------- the law, as the others know it


@compiled
def _farthest(v, p, braking):
    """How far a car gets that speeds up for its response time and then brakes: Defs. 1, 2."""
    rho, a = p.response_time, p.a_max_accel
    v_rho = min(v + a * rho, max(p.v_cap, v))
    ramp = (v_rho - v) / a
    return max((v + v_rho) / 2 * ramp + v_rho * (rho - ramp) + max(v_rho, 0.0) ** 2 / (2 * braking), 0.0)


@compiled
def _sideways(car, side):
    """Speed toward `side`: that of the last frame, or the one the heading commits to."""
    return max(side * car.u, side * car.speed * np.sin(car.heading))


@compiled
def _extents(car, w):
    along, across = half_extents(car.length, car.width, car.heading)
    if car.length == OBSTACLE_SIZE:
        return along, across
    largest = largest_half_extents(car.length, car.width, w.published.heading_bound)
    return max(along, largest[0]), max(across, largest[1])


@compiled
def margins(ego, car, w):
    """Longitudinal and lateral gap less what the table asks for: the axis is safe from 0 on (Defs. 1, 2, 6)."""
    e, o, dt = w.ego, w.other, w.dt
    euler = 1.0 if w.published.discretisation_margin else 0.0
    ahead = car.x >= ego.x
    straight = np.sqrt(1.0 - w.published.heading_bound**2)
    if car.facing < 0.0:
        need = 0.0
        v_e = ego.speed if ahead else -ego.speed * min(straight, np.cos(ego.heading))
        v_o = car.speed if ahead else -car.speed
        for v, p, right in ((v_e, e, not car.own_lane), (v_o, o, car.own_lane)):
            b = p.a_min_brake_correct if right else p.a_min_brake
            need += _farthest(v, p, b) + euler * (max(v, 0.0) * dt / 2 + b * dt**2 / 8)
    else:
        back, front, rear, lead = (ego, car, e, o) if ahead else (car, ego, o, e)
        v_back, v_front = back.speed, front.speed * min(straight, np.cos(front.heading))
        if front.wreck:
            v_front = 0.0
        if v_front < 0.0:  # the ego backs up: each comes toward the other
            need = _farthest(v_back, rear, rear.a_min_brake) + _farthest(-v_front, lead, lead.a_min_brake)
            need += euler * ((v_back - v_front) * dt / 2 + (rear.a_min_brake + lead.a_min_brake) * dt**2 / 8)
        else:
            if v_back < 0.0:  # it backs away from the other, which may come after it
                need = _farthest(v_back, rear, rear.a_min_brake) + _farthest(-v_front, lead, lead.a_min_brake)
            else:
                need = max(_farthest(v_back, rear, rear.a_min_brake) - v_front**2 / (2 * lead.a_max_brake), 0.0)
            need += euler * (max(v_back - v_front, 0.0) * dt / 2 + rear.a_min_brake * dt**2 / 8)
    need += max(e.standstill_gap, o.standstill_gap)
    half_e, half_o = _extents(ego, w), _extents(car, w)
    lon = abs(car.x - ego.x) - half_e[0] - half_o[0] - need

    side = 1.0 if car.y >= ego.y else -1.0
    approach = 0.0
    need = (e.mu + o.mu) / 2 + w.published.overlap_margin + euler * e.a_lat_max_accel * e.response_time * dt
    for p, user, to in ((e, ego, side), (o, car, -side)):
        rho, a, b = p.response_time, p.a_lat_max_accel, p.a_lat_min_brake
        speed = _sideways(user, to)
        need += euler * (max(speed, 0.0) * dt / 2 + b * dt**2 / 8)
        speed = max(speed, 0.0) if w.published.no_credit else speed
        approach += speed * rho + a * rho**2 / 2 + max(speed + a * rho, 0.0) ** 2 / (2 * b)
    return lon, abs(car.y - ego.y) - half_e[1] - half_o[1] - need - max(approach, 0.0)


@compiled
def observe(law, ego, car, w):
    """Is the other in danger with the ego, and if so, what does it owe (Defs. 3, 7, 9)?"""
    lon, lat = margins(ego, car, w)
    if lon < 0.0 and lat < 0.0:
        law.since += 1
        return
    law.since, law.lon, law.lat = 0, lon >= 0.0, lat >= 0.0
    law.must_brake = (car.x >= ego.x) == (car.facing < 0.0)
    law.braking = w.other.a_min_brake_correct if car.facing < 0.0 and car.own_lane else w.other.a_min_brake
    law.side = 1.0 if ego.y >= car.y else -1.0
    law.w = max(_sideways(car, law.side), 0.0)


@compiled
def keep_the_law(law, car, acceleration, slip, w):
    """What its bounds, Def. 4 and the one-sided Def. 8 leave of what the other wants.

    Its wheels are free: the law bounds speeds and heading, not how a car comes by them.

    Returns:
      (acceleration, course, next heading).
    """
    p, dt = w.other, w.dt
    tau = law.since * dt
    upper = min(p.a_max_accel, max(p.v_cap - car.speed, 0.0) / dt)
    if law.since > 0 and law.lon and law.must_brake and tau >= p.response_time - 1e-9:
        upper = -law.braking
    a = max(min(max(acceleration, -p.a_max_brake), upper), -car.speed / dt)

    v_next = car.speed + a * dt
    course = heading = _own_heading(car) + slip
    for sign in (-1.0, 1.0):
        now = soon = max(_sideways(car, sign * car.facing), 0.0) + p.a_lat_max_accel * dt
        if law.since > 0 and law.lat and law.side == sign * car.facing:
            now, soon = min(now, _allowed_sideways(tau, law.w, p)), min(soon, _allowed_sideways(tau + dt, law.w, p))
        course = sign * min(sign * course, _angle(now, car.speed, w))
        heading = sign * min(sign * heading, _angle(soon, v_next, w))
    start = 0.0 if car.facing > 0.0 else np.pi
    return a, start + course, start + heading


@compiled
def _angle(u, v, w):
    """Largest angle to the lane at which a car of speed v goes sideways no faster than u."""
    return np.arcsin(min(u / max(v, 1e-3), w.published.heading_bound))


@compiled
def _allowed_sideways(tau, w, p):
    late = max(tau - p.response_time, 0.0)
    return max(w + p.a_lat_max_accel * min(tau, p.response_time) - p.a_lat_min_brake * late, 0.0)


@compiled
def _arcsin(x):
    return np.arcsin(min(max(x, -1.0), 1.0))


@compiled
def _own_heading(car):
    return car.heading if car.facing > 0.0 else car.heading - np.pi


# ---------------------------------------------------------------- what they want


@compiled
def _below(rng, n):
    return int(rng.random() * n)


@compiled
def _between(rng, low, high):
    return low + (high - low) * rng.random()


@compiled
def want(rng, car, target, danger):
    """(acceleration, slip) that a driver wants, in disregard of law and limits: it has its eye on `target`."""
    if car.hold <= 0:
        car.hold = 300 if rng.random() < 0.05 else 1 + _below(rng, 25)
        car.throttle, car.wheel = _below(rng, 6), _below(rng, 6)
    car.hold -= 1
    near = 1.0 if target.y * car.facing >= car.y * car.facing else -1.0
    weave = 1.0 if car.hold % 8 < 4 else -1.0
    at_worst = -30.0 if danger else 30.0
    a = (30.0, -30.0, 0.0, 30.0, _between(rng, -30.0, 30.0), at_worst)[car.throttle]
    slip = (near, near, -near, -_own_heading(car), _between(rng, -1.0, 1.0), weave)[car.wheel]
    return a, min(max(slip, -MAX_SLIP), MAX_SLIP)


ABIDES, BREAKS_DOWN, BRAKES_HARD, NEVER_BRAKES, REVERSES, DRIVES_INTO, SWERVES, DOES_ANYTHING, OVERTAKES = range(9)
VICES = (
    "abides",
    "breaks down",
    "brakes hard",
    "never brakes",
    "reverses",
    "drives into",
    "swerves",
    "does anything",
    "overtakes",
)


@compiled
def misbehave(rng, law, car, ego, a, slip, w):
    """What a reckless driver does instead; it abides by the rest of the law."""
    free_a = min(max(a, (-MAX_SPEED - car.speed) / w.dt), (MAX_SPEED - car.speed) / w.dt)
    if car.wreck or (car.vice == BREAKS_DOWN and rng.random() < 0.01):
        car.wreck = True
        return -car.speed, car.heading, car.heading  # rolls out
    if car.vice == DOES_ANYTHING:
        course, heading = turn(car, slip, w.dt)
        return free_a, course, heading
    if car.vice == OVERTAKES:
        return _overtake(car, ego, w)
    lawful_a, course, heading = keep_the_law(law, car, a, slip, w)
    if car.vice == BRAKES_HARD:
        return max(min(0.4 * a, w.other.a_max_accel), -car.speed / w.dt), course, heading
    if car.vice == NEVER_BRAKES:
        return min(w.other.a_max_accel, (MAX_SPEED - car.speed) / w.dt), course, heading
    if car.vice == REVERSES:
        return max(-w.other.a_max_brake, (-MAX_SPEED - car.speed) / w.dt), course, heading
    if car.vice == DRIVES_INTO or car.vice == SWERVES:
        aim = 0.3 if car.hold % 16 < 8 else -0.3
        if car.vice == DRIVES_INTO:
            near = 1.0 if ego.y * car.facing >= car.y * car.facing else -1.0
            aim = near * np.arcsin(min(4.0 / max(car.speed, 4.0), 0.9))
        slip = _arcsin((aim - _own_heading(car)) / max(car.speed * w.dt / HALF_WHEELBASE, 1e-3))
        course, heading = turn(car, min(max(slip, -MAX_SLIP), MAX_SLIP), w.dt)
    return lawful_a, course, heading


@compiled
def _overtake(car, ego, w):
    """Come from behind with no regard to distance, get ahead, drift into the ego's way, and slow down there for good.

    Once ahead it is gentle: it never brakes harder than 3 m/s^2 nor drifts faster than 1 m/s.
    """
    ahead = car.x - ego.x
    wanted = ego.speed + 4.0 if ahead < w.length + 3.0 else max(ego.speed - 6.0, 0.0)
    if ahead < -w.length and abs(ego.y - car.y) < CAR_WIDTH + 0.2:  # no room to pass, and it rams nobody
        wanted = ego.speed + ahead + w.length + 2.0
    a = min(max((wanted - car.speed) / 0.5, -3.0), w.other.a_max_accel)
    a = max(a, -car.speed / w.dt)
    aside = ego.y - car.y if ahead > w.length + 1.0 else 0.0
    drift = min(max(aside / 0.8, -1.0), 1.0)
    course = _arcsin(drift / max(car.speed, 10.0))
    return a, course, course


# ---------------------------------------------------------------- where they start

ANYWHERE, AHEAD, BEHIND, LEFT, RIGHT = range(5)


@compiled
def _place(rng, car, ego, where, squeeze, w):
    """Put one other near the ego, safe on at least one axis if `w.start_safe`, often by a hair.

    In a squeeze they are side by side, equally fast, and push toward each other for good.
    """
    for _ in range(100):
        car.facing = -1.0 if rng.random() < 0.25 else 1.0
        car.own_lane = rng.random() < 0.5
        car.length, car.width = w.length, CAR_WIDTH
        car.speed = _between(rng, 0.0, MAX_SPEED) if rng.random() < 0.9 else 0.0
        if rng.random() < 0.3:
            car.speed = min(max(ego.speed + _between(rng, -3.0, 3.0), 0.0), MAX_SPEED)
        if w.backs_up and rng.random() < 0.6:
            car.speed = _between(rng, 0.0, 3.0) * rng.random()
        if squeeze or w.vice == OVERTAKES:
            car.facing, car.speed = 1.0, ego.speed
        bound = w.published.heading_bound
        heading = 0.0 if rng.random() < 0.5 else _between(rng, -bound, bound) * rng.random()
        if not w.lawful:
            car.vice = _below(rng, len(VICES)) if w.vice < 0 else w.vice
            heading = _between(rng, -1.5, 1.5) if rng.random() < 0.2 else heading
            car.wreck = rng.random() < 0.1
            if w.vice == OVERTAKES:  # beside or just behind, straight along the road
                heading, car.wreck = 0.0, False
            if car.wreck:  # a box that stands on the road
                car.length = car.width = OBSTACLE_SIZE
                car.speed, heading, car.facing = 0.0, 0.0, 1.0
        car.heading = heading if car.facing > 0.0 else heading + np.pi
        car.u, car.along = car.speed * np.sin(car.heading), car.speed * np.cos(car.heading)

        sign = 1.0 if rng.random() < 0.5 else -1.0
        if where != ANYWHERE:
            sign = 1.0 if where in (AHEAD, RIGHT) else -1.0
        spare = 1e-9 if rng.random() < 0.6 else _between(rng, 0.0, 6.0) * rng.random()
        if not w.start_safe:
            spare = _between(rng, -12.0, 6.0)
        if where in (AHEAD, BEHIND) or (where == ANYWHERE and not squeeze and rng.random() < 0.5):
            car.x, car.y = ego.x + sign * 1e-6, ego.y + _between(rng, -5.0, 5.0)
            car.x += sign * (spare - margins(ego, car, w)[0])
        else:
            car.x, car.y = ego.x + _between(rng, -12.0, 12.0), ego.y + sign * 1e-6
            car.y += sign * (spare - margins(ego, car, w)[1])
        if w.vice == OVERTAKES:
            car.x, car.y = ego.x - _between(rng, 0.5, 12.0), ego.y + sign * _between(rng, 2.2, 3.2)
        lon, lat = margins(ego, car, w)
        now, soon = contact(ego, car, w.dt)
        if (max(lon, lat) >= 0.0) == w.start_safe and not now and not soon:
            return
    car.x = ego.x + 1e4  # nobody, in the end


@compiled
def _as_seen(car, user, w):
    """The `ROAD_USER` record of a car, as the shield gets it."""
    user.s, user.y, user.heading, user.speed = car.x, car.y, car.heading, car.speed
    user.cos, user.sin = np.cos(car.heading), np.sin(car.heading)
    user.u, user.along = car.u, car.along
    user.half_length, user.half_width = _extents(car, w)
    user.in_own_lane, user.wreck = car.own_lane, car.wreck


# ---------------------------------------------------------------- the ego, and an episode


@compiled
def _body(w):
    return Body(HALF_WHEELBASE, MAX_SLIP, 0.0, 0.0, 0.0, 0.0, True, w.ego.a_min_brake)


@compiled
def _shielded(nominal, ego, seen, users, last, memory, w, result):
    """The shield's command, less what `w` takes away from it."""
    if w.forgetful:
        for i in range(w.others):
            memory[i].age = memory[i].since = memory[i].axes = 0
            memory[i].skipped = False
    danger = find_danger(seen, users, last[w.others], last, memory, Table(w.ego, w.other, w.rules, w.dt, None))
    response = respond(nominal, danger, seen, _body(w), w.rules, w.dt)
    result.overridden += response.overridden
    result.answered_now += (danger.response & 4) != 0
    a, slip = response.command
    if w.one_axis:
        for i in range(w.others):
            if memory[i].since == 0 and memory[i].axes == LON | LAT:
                memory[i].axes = LON
    if w.free_throttle and danger.response & 5 == 0:
        a = max(nominal.acceleration, -ego.speed / w.dt)
    if w.backs_into and ego.speed <= 0.0 and nominal.acceleration < 0.0:
        a = max(nominal.acceleration, (-w.published.reverse_speed - ego.speed) / w.dt)
    if w.soft_brake and danger.response & 1 != 0:
        a = max(a, -ego.speed / 0.6)
    if w.free_wheel and danger.response & 2 == 0:
        gain = max(ego.speed * w.dt / HALF_WHEELBASE, 1e-3)
        bound = np.arcsin(w.published.heading_bound)
        low, high = _arcsin((-bound - ego.heading) / gain), _arcsin((bound - ego.heading) / gain)
        slip = min(max(nominal.slip, low), high)
    if w.steering.heading_bound != w.rules.heading_bound:
        bounds = always_on(seen, w.ego, w.rules, w.dt)
        for i in range(w.others):
            bounds = merge(bounds, memory[i], w.ego, w.rules, w.dt)
        a, slip = restrict(nominal, bounds, seen, _body(w), w.steering, w.dt)
    return Command(a, slip)


@compiled
def _judge(command, seen, users, record, law, w, result):
    for i in range(w.others):
        pair = assess(seen, users[i], Table(w.ego, w.other, w.published, w.dt, None))
        remember(record[i], pair, seen, users[i], w.dt)
        if record[i].since > 0 and record[i].axes == LON:
            result.danger_lon += 1
            result.gap_lon = min(result.gap_lon, pair.gap_lon)
        if record[i].since > 0 and record[i].axes == LAT:
            result.danger_lat += 1
            result.gap_lat = min(result.gap_lat, pair.gap_lat)
        result.disputed += record[i].since != law[i].since
    result.broken += judge_frame(seen, users, record, command, 0.0, Table(w.ego, w.other, w.published, w.dt, None))[1]
    for i in range(w.others):
        result.accused += record[i].other_broke != 0


@compiled
def episode(rng, w, result, film):
    """Play one episode until contact.

    Args:
      rng: `np.random.Generator`.
      w: `World`.
      result: `EPISODE` record to fill in.
      film: `[frames + 1, 1 + others]` `CAR` records to fill in, or empty.
    """
    cars = np.zeros(1 + w.others, CAR)
    ego = cars[0]
    ego.length, ego.width, ego.facing = w.length, CAR_WIDTH, 1.0
    ego.speed = _between(rng, 0.0, MAX_SPEED) if rng.random() < 0.95 else 0.0
    bound = w.published.heading_bound
    ego.heading = 0.0 if rng.random() < 0.5 or w.vice == OVERTAKES else _between(rng, -bound, bound) * rng.random()
    if w.backs_up and rng.random() < 0.7:
        ego.speed = 0.0 if rng.random() < 0.8 else -w.published.reverse_speed * rng.random()
    ego.u, ego.along = ego.speed * np.sin(ego.heading), ego.speed * np.cos(ego.heading)
    may_reverse = not w.shielded and rng.random() < 0.3
    squeeze = rng.random() < 0.2
    pair = LEFT if squeeze else (ANYWHERE, AHEAD, LEFT)[_below(rng, 3)]  # where the first is, the second opposite
    for i in range(w.others):
        if w.others == 1:
            pair = ANYWHERE
        _place(rng, cars[1 + i], ego, pair + i if pair != ANYWHERE else ANYWHERE, squeeze, w)
    for i in range(1 + w.others):
        cars[i].hold, cars[i].throttle = w.frames if squeeze else 0, 2

    users, seen, last = np.zeros(w.others, ROAD_USER), np.zeros(1, ROAD_USER), np.zeros(w.others + 1, ROAD_USER)
    memory, record, law = np.zeros(w.others, MEMORY), np.zeros(w.others, MEMORY), np.zeros(w.others, LAW)
    pending = np.zeros((w.latency + 1, 2))
    result.contact, result.gap_lon, result.gap_lat = -1, np.inf, np.inf
    for frame in range(w.frames):
        _as_seen(ego, seen[0], w)
        danger = False
        for i in range(w.others):
            _as_seen(cars[1 + i], users[i], w)
            observe(law[i], ego, cars[1 + i], w)
            danger |= law[i].since > 0
            if frame < len(film):
                film[frame, 0], film[frame, 1 + i] = ego, cars[1 + i]
        a, slip = want(rng, ego, cars[1 + _below(rng, w.others)], danger)
        slowest = -MAX_SPEED if may_reverse or w.backs_up else 0.0
        command = Command(min(max(a, (slowest - ego.speed) / w.dt), (MAX_SPEED - ego.speed) / w.dt), slip)
        if w.shielded:
            command = _shielded(command, ego, seen[0], users, last, memory, w, result)
            for i in range(w.others):
                last[i] = users[i]
            last[w.others] = seen[0]
        pending[frame % len(pending), 0], pending[frame % len(pending), 1] = command
        late = (frame + 1) % len(pending)
        command = Command(max(pending[late, 0], (slowest - ego.speed) / w.dt), pending[late, 1])
        _judge(command, seen[0], users, record, law, w, result)

        for i in range(w.others):
            a, slip = want(rng, cars[1 + i], ego, law[i].since > 0)
            if w.lawful:
                a, course, heading = keep_the_law(law[i], cars[1 + i], a, slip, w)
            else:
                a, course, heading = misbehave(rng, law[i], cars[1 + i], ego, a, slip, w)
            move(cars[1 + i], a, course, heading, w.dt)
        course, heading = turn(ego, command.slip, w.dt)
        move(ego, command.acceleration, course, heading, w.dt)
        result.heading = max(result.heading, abs(ego.heading))
        result.backed_up += ego.speed < 0.0
        result.fastest_back = max(result.fastest_back, -ego.speed)
        for i in range(w.others):
            now, soon = contact(ego, cars[1 + i], w.dt)
            if now or soon:
                _as_seen(ego, seen[0], w)
                _as_seen(cars[1 + i], users[i], w)
                verdict = judge_contact(seen[0], users[i], record[i], Table(w.ego, w.other, w.published, w.dt, None))
                result.contact, result.boxes, result.partner, result.verdict = frame + 1, now, i, verdict.verdict
                result.ego_duty, result.ego_excess = verdict.ego_duty, verdict.ego_excess
                result.other_duty, result.other_excess = verdict.other_duty, verdict.other_excess
                if frame + 1 < len(film):
                    film[frame + 1, 0], film[frame + 1, 1 + i] = ego, cars[1 + i]
                return


@compiled
def _episodes(rng, w, results):
    nothing = np.zeros((0, 1 + w.others), CAR)
    for k in range(len(results)):
        episode(rng, w, results[k], nothing)


def play(n: int, w: World, seed: int = 0) -> np.ndarray:
    """Play `n` episodes; returns `[n]` `EPISODE` records."""
    results = np.zeros(n, EPISODE)
    _episodes(np.random.default_rng(seed), w, results)
    return results


def show(w: World, seed: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Record and film (`[frames + 1, 1 + others]` `CAR`) of episode `k` of `play(n, w, seed)`."""
    rng = np.random.default_rng(seed)
    _episodes(rng, w, np.zeros(k, EPISODE))
    result, film = np.zeros(1, EPISODE), np.zeros((w.frames + 1, 1 + w.others), CAR)
    episode(rng, w, result[0], film)
    return result[0], film
