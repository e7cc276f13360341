"""Two cars in open space on highway-env's equations: one under the shield, one that does the worst it may."""

import math
from typing import NamedTuple

import numpy as np
from highway_env.utils import are_polygons_intersecting

from rss_shield.shield.open_space.controller import WORK, Intended, open_space_frame
from rss_shield.shield.open_space.frames import CAR, LOT, USER, WHEELS, fastest, slowest
from rss_shield.shield.open_space.judge import judge_motion, judge_touch
from rss_shield.shield.open_space.pair import GIVES_WAY, HAS_WAY, PAIR, role_of
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for

DT = 1 / 15
TABLE = table_for(PRESETS["parking"], Rules(), DT)


class Duel(NamedTuple):
    """How one ended."""

    touched: bool
    verdict: int  # of the shielded car's view, -1 without a contact
    ego_duty: int
    dangerous: int  # frames
    broken: int
    moved: float  # by the shielded car [m]


def start(rng, apart=14.0):
    """`[2]` USER: two cars that face each other more or less, the shielded one last."""
    users = np.zeros(2, USER)
    users["half_length"], users["half_width"], users["kind"] = 2.5, 1.0, CAR
    users["x"] = 0.0, apart
    users["y"] = rng.uniform(-3.0, 3.0, 2)
    users["heading"] = rng.choice([0.0, np.pi], 2) + rng.uniform(-1.0, 1.0, 2)
    users["first"] = True, False
    return users


def move(user, acceleration, slip):
    """One frame of highway-env's bicycle, in place."""
    v = user["speed"]
    user["x"] += v * math.cos(user["heading"] + slip) * DT
    user["y"] += v * math.sin(user["heading"] + slip) * DT
    user["heading"] += v * math.sin(slip) / user["half_length"] * DT
    speed = v + acceleration * DT
    user["speed"] = 0.0 if abs(speed) < 1e-9 else speed


def box(user):
    """Its corners, closed, as highway-env's test of contact wants them."""
    c, s = math.cos(user["heading"]), math.sin(user["heading"])
    out = []
    for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1)):
        x, y = a * user["half_length"], b * user["half_width"]
        out.append((user["x"] + x * c - y * s, user["y"] + x * s + y * c))
    return np.array(out)


def touch(one, two):
    moves = [u["speed"] * DT * np.array([math.cos(u["heading"]), math.sin(u["heading"])]) for u in (one, two)]
    touching, will_touch, _ = are_polygons_intersecting(box(one), box(two), *moves)
    return touching or will_touch


def toward(user, other, rng):
    """(acceleration, slip) that is mostly out for a collision."""
    angle = math.atan2(other["y"] - user["y"], other["x"] - user["x"]) - user["heading"]
    angle = (angle + math.pi) % (2 * math.pi) - math.pi
    gear = 1.0 if abs(angle) < math.pi / 2 else -1.0
    if rng.random() < 0.1:
        gear = -gear
    turn = angle if gear > 0.0 else (math.pi - abs(angle)) * -np.sign(angle)
    wheels = float(np.clip(2.0 * turn, -WHEELS, WHEELS)) if rng.random() < 0.8 else rng.uniform(-WHEELS, WHEELS)
    return gear * rng.choice([2.5, 5.0]), math.atan(0.5 * math.tan(wheels))


def bounded(user, acceleration, driver):
    """Within what the table says of everybody."""
    gear = -1.0 if user["speed"] < 0.0 or (user["speed"] == 0.0 and acceleration < 0.0) else 1.0
    v = gear * user["speed"]
    wanted = v + gear * acceleration * DT
    return gear * (min(max(wanted, slowest(v, driver, DT)), fastest(v, driver, DT)) - v) / DT


class Worst:
    """Keeps Def. 22 to the letter: whatever it likes until its response time is over, then it brakes just enough.

    Args:
      driver: whose limits and braking it really has.
    """

    def __init__(self, driver, rng):
        self.driver, self.rng = driver, rng
        self.slip = 0.0

    def command(self, own, ego, pair):
        wish, slip = toward(own, ego, self.rng)
        a = bounded(own, wish * self.driver.a_max_accel / TABLE.other.a_max_accel, self.driver)
        role = role_of(int(pair["last"]), True)
        response = round(self.driver.response_time / DT)
        free = pair["since"] == 0 or (pair["since"] < response and not pair["never"])
        if role == HAS_WAY and ego["speed"] != 0.0:
            free = True
        if not free:
            v, b = own["speed"], self.driver.a_min_brake
            a, slip = -np.sign(v) * min(b, abs(v) / DT), self.slip
        self.slip = slip
        return a, slip


class Shielded:
    """Another car under the same shield, which sees the first one as the other."""

    def __init__(self, rng):
        self.rng, self.memory, self.slip, self.before, self.work = rng, np.zeros(1, PAIR), 0.0, None, np.zeros(WORK)

    def command(self, own, ego, pair):
        now = np.array([ego, own], USER)
        now["first"] = not own["first"], False
        wish, slip = toward(own, ego, self.rng)
        before = now if self.before is None else self.before
        intended = Intended(float(wish), float(slip), float(self.slip))
        report = open_space_frame(now, before, self.memory, intended, TABLE, LOT, True, self.work)
        self.before, self.slip = now, report.slip
        assert report.broken == 0
        return report.acceleration, report.slip


def duel(rng, make_other, frames=200, overrides=True, table=TABLE, space=LOT):
    """Play one episode. `make_other(rng)`: whoever drives against the shielded car."""
    users, memory, slip = start(rng), np.zeros(1, PAIR), 0.0
    other, work = make_other(rng), np.zeros(WORK)
    before, dangerous, broken, moved = users.copy(), 0, 0, 0.0
    for _ in range(frames):
        wish = Intended(*map(float, toward(users[1], users[0], rng)), slip)
        report = open_space_frame(users.copy(), before, memory, wish, table, space, overrides, work)
        dangerous, broken = dangerous + report.pairs, broken + report.broken
        command = other.command(users[0], users[1], memory[0])
        before, slip = users.copy(), report.slip
        moved += abs(users[1]["speed"]) * DT
        move(users[0], *command)
        move(users[1], report.acceleration, report.slip)
        if touch(users[0], users[1]):
            judge_motion(before[1], before[0], users[1], users[0], memory[0], table, space, work)
            verdict = judge_touch(users[1], users[0], memory[0])
            return Duel(True, verdict.verdict, verdict.ego_duty, dangerous, broken, moved)
    return Duel(False, -1, 0, dangerous, broken, moved)


__all__ = ["DT", "GIVES_WAY", "TABLE", "Duel", "Shielded", "Worst", "duel"]
