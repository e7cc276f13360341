"""Where each semantic action leads under the nominal model, and what that is worth.

The nominal model: everybody else keeps speed and heading, and who drives behind the ego in its lane lets it be. An
action that is about somebody knows that one in the ego's lane frame: where somebody drives the same way, by position;
where ways cross, by what is left to the point in which they do.
"""

from typing import NamedTuple

import numpy as np

from rss_shield.envs.semantic.paths import PCOS, PHEADING, POINTS_APART, PSIN, PX, PY
from rss_shield.shield._numba.compiled import compiled, inner
from rss_shield.shield.definitions.semantics import (
    AHEAD,
    BEHIND,
    LANE,
    NEIGHBOUR,
    NONE,
    PUSH,
    RELATION,
    SPEED,
    A,
    Goals,
    Limits,
    S,
    U,
    V,
    Y,
    rollout,
    value,
)

CAR_FIELDS = 7
X, Y_WORLD, HEADING, PACE, LENGTH, WIDTH, ACCELERATION = range(CAR_FIELDS)  # of everybody
NEAR_FIELDS = 5
AT, ALONG, IN_LANE, FOLLOWS, FAR = range(NEAR_FIELDS)  # s [m], speed along [m/s], lane or -1, follows?, distance [m]

FEATURES = (
    *("valid", "value", "time_to_contact", "end_speed", "mean_speed", "lateral_way", "lane", "braking", "throttle"),
    *("behind", "ahead", "closing_speed", "clearance", "speed"),
)
VALID, VALUE, TIME_TO_CONTACT, END_SPEED, MEAN_SPEED, LATERAL_WAY, WHICH_LANE = range(7)
BRAKING, THROTTLE, IS_BEHIND, IS_AHEAD, CLOSING_SPEED, CLEARANCE, SPEED_NOW = range(7, len(FEATURES))
PLAN_FIELDS = 2
PLANNED_ACCELERATION, DRIFT = range(PLAN_FIELDS)  # [m/s^2]; largest lateral speed toward the middle of the lane [m/s]

_SIGHT = 100.0  # beyond, nobody is looked at                    [m]
_SAME_WAY = 0.6  # headings that differ by less                  [rad]
_REACH = 80.0  # of the search for a point where ways cross      [m]
_IN_PATH = 1.5  # from the middle of a crossing way              [m]
_BESIDE = 2.0  # of the middle of a lane: in it                  [m]
_MARGIN = 1.0  # between two cars, less counts as a contact  [m]
_CENTRED = 0.3  # no lane change is on its way                   [m]
_MOST_CLEARANCE = 20.0  # that is told apart                     [m]


class Rules(NamedTuple):
    """How trajectories are made and looked at."""

    dt: float  # length of a frame                    [s]
    every: int  # frames from one look for contacts to the next
    legal: float  # speed                             [m/s]
    headway: float  # see `SemanticSettings`          [s]
    gap: float  # likewise                            [m]
    spread: bool  # there are several lanes


class Payoff(NamedTuple):
    """The environment's reward, as far as it can be foretold."""

    speed: float  # at `fast` and above
    slow: float  # 0 up to this speed                 [m/s]
    fast: float  # [m/s]
    right: float  # on the rightmost lane
    contact: float  # once
    worst: float  # what is scaled to 0
    best: float  # and to 1
    frames: int  # per reward


class Desk(NamedTuple):
    """Working memory."""

    near: np.ndarray  # `[N, 5]`
    slots: np.ndarray  # `[n]` index of each neighbour, -1 = none
    trajectory: np.ndarray  # `[T, 5]`
    rewards: np.ndarray  # `[T]`


@inner
def _angle(x):
    return (x + np.pi) % (2 * np.pi) - np.pi


@inner
def _locate(points, x, y):
    """Arc length and offset to the right of a point in the world, and the nearest point of the path."""
    nearest, best = 0, np.inf
    for k in range(len(points)):
        far = (x - points[k, PX]) ** 2 + (y - points[k, PY]) ** 2
        if far < best:
            nearest, best = k, far
    dx, dy = x - points[nearest, PX], y - points[nearest, PY]
    cos, sin = points[nearest, PCOS], points[nearest, PSIN]
    return nearest * POINTS_APART + dx * cos + dy * sin, dy * cos - dx * sin, nearest


@inner
def _crossing(points, first, car):
    """Arc length at which the way of a car that goes straight on crosses the path, and what it has left to there.

    Infinite where it does not.
    """
    cos, sin = np.cos(car[HEADING]), np.sin(car[HEADING])
    last = min(len(points), first + int(_REACH / POINTS_APART))
    for k in range(first, last):
        dx, dy = points[k, PX] - car[X], points[k, PY] - car[Y_WORLD]
        ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
        if np.abs(aside) < _IN_PATH and ahead > -0.5 * car[LENGTH]:
            return k * POINTS_APART, max(ahead, 0.0)
    return np.inf, np.inf


@inner
def _nearest_lane(lanes, offset):
    """Lane that an offset lies in, -1 = none."""
    found, best = -1, _BESIDE
    for k in range(len(lanes)):
        if np.abs(offset - lanes[k]) < best:
            found, best = k, np.abs(offset - lanes[k])
    return found


@compiled
def look_around(cars, ego, points, lanes, near, slots):
    """Everybody in the ego's lane frame, and the nearest of those that an action may be about.

    Args:
      cars: `[N, 7]` x, y, heading, speed, length, width, acceleration.
      ego: index of the ego.
      points, lanes: of the ego's `Path`.
      near: `[N, 5]`, overwritten: position and speed along the path, lane (-1: none that an action can be about),
        1.0 for who drives behind the ego in its lane, distance.
      slots: `[n]`, overwritten: their indices, the nearest first, -1 = nobody.
    """
    me = cars[ego]
    s, y, here = _locate(points, me[X], me[Y_WORLD])
    for i in range(len(cars)):
        car = cars[i]
        far = np.sqrt((car[X] - me[X]) ** 2 + (car[Y_WORLD] - me[Y_WORLD]) ** 2)
        near[i, FAR], near[i, IN_LANE], near[i, FOLLOWS] = far, -1.0, 0.0
        near[i, AT], near[i, ALONG] = 0.0, 0.0
        if i == ego or far > _SIGHT:
            continue
        there, offset, k = _locate(points, car[X], car[Y_WORLD])
        turn = _angle(car[HEADING] - points[k, PHEADING])
        lane = _nearest_lane(lanes, offset)
        if np.abs(turn) < _SAME_WAY and lane >= 0:
            near[i, AT], near[i, ALONG], near[i, IN_LANE] = there, car[PACE] * np.cos(turn), lane
            if there < s and np.abs(offset - y) < _BESIDE:
                near[i, FOLLOWS] = 1.0
        elif len(points) > 1:
            place, left = _crossing(points, here, car)
            if place < np.inf:
                near[i, AT], near[i, ALONG], near[i, IN_LANE] = place - left, car[PACE], 0.0
    for j in range(len(slots)):
        slots[j] = -1
        for i in range(len(cars)):
            taken = i == ego or near[i, IN_LANE] < 0.0
            for m in range(j):
                taken |= slots[m] == i
            if not taken and (slots[j] < 0 or near[i, FAR] < near[slots[j], FAR]):
                slots[j] = i


@inner
def _clearance(cars, ego, i, s, y, time, points):
    """Distance between the boxes of the ego at a place of its path and of car `i` after some time [m].

    Both boxes lie in the path's frame there; the other's is the smallest around it.
    """
    k = min(max(int(np.floor(s / POINTS_APART)), 0), len(points) - 1)
    cos, sin, on = points[k, PCOS], points[k, PSIN], s - k * POINTS_APART
    x, y_world = points[k, PX] + on * cos - y * sin, points[k, PY] + on * sin + y * cos
    car = cars[i]
    other_cos, other_sin = np.cos(car[HEADING]), np.sin(car[HEADING])
    dx = car[X] + car[PACE] * other_cos * time - x
    dy = car[Y_WORLD] + car[PACE] * other_sin * time - y_world
    along, across = np.abs(other_cos * cos + other_sin * sin), np.abs(other_sin * cos - other_cos * sin)
    half_length = 0.5 * (car[LENGTH] * along + car[WIDTH] * across + cars[ego, LENGTH])
    half_width = 0.5 * (car[LENGTH] * across + car[WIDTH] * along + cars[ego, WIDTH])
    return max(np.abs(dx * cos + dy * sin) - half_length, np.abs(dy * cos - dx * sin) - half_width)


@inner
def _watch(cars, ego, points, rules, near, trajectory):
    """First step with a contact, the number of steps if there is none, and the smallest distance till then [m]."""
    smallest = np.inf
    for t in range(rules.every - 1, len(trajectory), rules.every):
        for i in range(len(cars)):
            if i == ego or near[i, FAR] > _SIGHT or near[i, FOLLOWS] > 0.0:
                continue
            apart = _clearance(cars, ego, i, trajectory[t, S], trajectory[t, Y], (t + 1) * rules.dt, points)
            smallest = min(smallest, apart)
        if smallest < _MARGIN:
            return t, smallest
    return len(trajectory), smallest


@inner
def _rate(trajectory, contact, right, payoff, rewards):
    """Rewards along a trajectory: fills `rewards`; nothing is earned after a contact."""
    for t in range(len(trajectory)):
        rewards[t] = 0.0
        if t <= contact:
            quick = min(max((trajectory[t, V] - payoff.slow) / (payoff.fast - payoff.slow), 0.0), 1.0)
            earned = payoff.speed * quick + payoff.right * right
            rewards[t] = (earned - payoff.worst) / (payoff.best - payoff.worst)
            if t == contact:
                rewards[t] += payoff.contact / (payoff.best - payoff.worst) * payoff.frames


@inner
def _goals(action, s, near, slots, lanes, rules):
    """Goals of an action, and whether there is somebody whom it is about, in the lane that it is about."""
    lane, relation, slot = int(action[LANE]), int(action[RELATION]), int(action[NEIGHBOUR])
    at, along, valid = 0.0, 0.0, True
    if relation != NONE:
        i = slots[slot]
        valid = i >= 0 and int(near[max(i, 0), IN_LANE]) == lane
        if valid:
            at, along = near[i, AT], near[i, ALONG]
    wanted = action[SPEED] * rules.legal
    return Goals(lanes[lane], wanted, relation, at, along, rules.gap, rules.headway, np.inf, 0.0), valid


@compiled
def look_ahead(cars, ego, points, lanes, actions, limits, rules, payoff, desk, features, plans):
    """Features and plans of all semantic actions, of the situation as it is.

    Args:
      cars: `[N, 7]` x, y, heading, speed, length, width, acceleration.
      ego: index of the ego.
      points, lanes: of the ego's `Path`.
      actions: `[A, 5]`, see `shield.definitions.semantics.semantic_actions`.
      limits: `[P, 4]`, a row of `Limits` for each push.
      rules, payoff: `Rules`, `Payoff`.
      desk: working memory.
      features: `[A, D]`, overwritten, see FEATURES; zeros where an action is not valid.
      plans: `[A, F, 2]`, overwritten: for each frame of the decision the acceleration [m/s^2] and how fast the ego may
        drift toward the middle of its lane, inf = as fast as its steering does [m/s].
    """
    me = cars[ego]
    near, slots, trajectory = desk.near[: len(cars)], desk.slots, desk.trajectory
    look_around(cars, ego, points, lanes, near, slots)
    s, y, k = _locate(points, me[X], me[Y_WORLD])
    turn = _angle(me[HEADING] - points[k, PHEADING])
    v, u = max(me[PACE] * np.cos(turn), 0.0), me[PACE] * np.sin(turn)
    steps = len(trajectory)
    for a in range(len(actions)):
        action, feature = actions[a], features[a]
        for d in range(len(feature)):
            feature[d] = 0.0
        for f in range(plans.shape[1]):
            plans[a, f, PLANNED_ACCELERATION], plans[a, f, DRIFT] = 0.0, np.inf
        goals, valid = _goals(action, s, near, slots, lanes, rules)
        if not valid:
            continue
        row = limits[int(action[PUSH])]
        push = Limits(row[0], row[1], row[2], row[3])
        rollout(s, v, y, u, me[ACCELERATION], goals, push, rules.dt, trajectory)
        contact, smallest = _watch(cars, ego, points, rules, near, trajectory)
        right = action[LANE] / max(len(lanes) - 1, 1)
        _rate(trajectory, contact, right, payoff, desk.rewards)
        speeds, braking, throttle = 0.0, 0.0, 0.0
        for t in range(steps):
            speeds += trajectory[t, V]
            braking, throttle = max(braking, -trajectory[t, A]), max(throttle, trajectory[t, A])
        feature[VALID], feature[VALUE] = 1.0, value(desk.rewards)
        feature[TIME_TO_CONTACT] = contact / steps
        feature[END_SPEED] = trajectory[steps - 1, V] / rules.legal
        feature[MEAN_SPEED] = speeds / steps / rules.legal
        feature[LATERAL_WAY], feature[WHICH_LANE] = (goals.y - y) / 4.0, right
        feature[BRAKING], feature[THROTTLE] = braking / 6.0, throttle / 3.0
        feature[IS_BEHIND], feature[IS_AHEAD] = 1.0 * (goals.relation == BEHIND), 1.0 * (goals.relation == AHEAD)
        if goals.relation != NONE:
            feature[CLOSING_SPEED] = (v - goals.v_other) / 10.0
        feature[CLEARANCE] = min(max(smallest, 0.0), _MOST_CLEARANCE) / _MOST_CLEARANCE
        feature[SPEED_NOW] = v / rules.legal
        changes = rules.spread and np.abs(goals.y - y) > _CENTRED
        for f in range(plans.shape[1]):
            plans[a, f, PLANNED_ACCELERATION] = trajectory[f, A]
            if changes:
                plans[a, f, DRIFT] = np.abs(trajectory[f, U])
