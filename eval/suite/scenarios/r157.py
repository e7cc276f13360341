"""UN R157's cut-ins, cut-outs and decelerations: which are avoided, by the shield and by two published drivers.

A case is an ego at constant speed in the middle of its lane, and one other that does what the regulation's appendix
says: comes over from the next lane at constant lateral speed, brakes ahead, or stands where a leader has got out of
the way. Everybody only brakes. Cars are 4.3 m by 1.9 m and 1.6 m apart across the lane, as in the published comparison
of the models (Mattas et al., Accident Analysis & Prevention 174, 2022, 106743).
"""

from typing import NamedTuple

import numpy as np

from rss_shield.eval.suite.scenarios.drivers_of_r157 import (
    DELAY,
    FULL,
    GRAVITY,
    ONSET,
    RELEASED,
    View,
    careful_sees_risk,
    fuzzy_deceleration,
    is_off_centre,
)
from rss_shield.shield._numba.compiled import compiled_for_arrays
from rss_shield.shield.command import Command
from rss_shield.shield.geometry import largest_half_extents
from rss_shield.shield.lanes.controller import find_danger, respond
from rss_shield.shield.lanes.evasion import Room, evade
from rss_shield.shield.lanes.judge import judge_frame
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.params import PRESETS, Preset, Rules
from rss_shield.shield.table import table_for

DT, SECONDS = 0.05, 25.0
LENGTH, WIDTH, ASIDE = 4.3, 1.9, 1.6
LANE = 3.5  # width [m]
DRIVERS = ("nobody brakes", "careful driver", "fuzzy safety model")
# brakes as hard and as late as the careful driver, and relies on no more
_CAREFUL = {"a_min_brake": FULL, "a_max_brake": 0.85 * GRAVITY, "a_min_brake_correct": FULL}
TABLES: dict[str, Preset] = {
    "simulator": PRESETS["simulator"],
    "slides": PRESETS["slides"],
    "careful": Preset(
        PRESETS["slides"].ego._replace(response_time=DELAY, **_CAREFUL),
        PRESETS["slides"].other._replace(**_CAREFUL),
        "slides, but response time and braking of UN R157's careful driver",
    ),
}


class Cases(NamedTuple):
    """What the other does, `[C]` each."""

    v: np.ndarray  # of the ego [m/s]
    v_other: np.ndarray
    gap: np.ndarray  # bumper to bumper at the start [m]
    lateral: np.ndarray  # speed at which the other comes over; 0: it is in the lane from the start [m/s]
    braking: np.ndarray  # of the other, until it stands [m/s^2]
    hidden: np.ndarray  # until then nobody sees it [s]

    def chosen(self, mask: np.ndarray) -> "Cases":
        """Those where `mask` is True."""
        return Cases(*(field[mask] for field in self))


def cut_ins() -> Cases:
    """20 to 130 km/h; the other is 10 km/h or more slower, 1 to 119 m ahead, and comes over with 0.2 to 1.8 m/s."""
    speeds = [(v, u) for v in (20, 40, 60, 90, 110, 130) for u in range(10, v, 10 if v <= 60 else 30)]
    grid = [
        (v, u, d, w) for v, u in speeds for d in range(1, 60 if v <= 60 else 120, 2) for w in np.arange(2, 19, 2) / 10
    ]
    v, u, gap, lateral = np.array(grid).T
    return Cases(v / 3.6, u / 3.6, gap, lateral, np.zeros(len(v)), np.zeros(len(v)))


def decelerations() -> Cases:
    """20 to 130 km/h behind a leader of the same speed, 0.6 to 3 s behind, which brakes with 1 to 8 m/s^2."""
    grid = [(v, t, b) for v in (20, 40, 60, 90, 110, 130) for t in np.arange(6, 31, 2) / 10 for b in range(1, 9)]
    v, time_gap, braking = np.array(grid).T
    v = v / 3.6
    return Cases(v, v.copy(), time_gap * v, np.zeros(len(v)), braking, np.zeros(len(v)))


def cut_outs() -> Cases:
    """A car stands ahead, seen when the leader, 1 to 3 s ahead, is out of its way: 1 to 5 s before the ego is there."""
    times, left = np.arange(10, 31, 5) / 10, np.arange(10, 51, 2) / 10
    grid = [(v, t, s) for v in (20, 40, 60, 90, 110, 130) for t in times for s in left]
    v, ahead, left = np.array(grid).T
    v = v / 3.6
    zeros = np.zeros(len(v))
    return Cases(v, zeros, v * (left + ahead), zeros, zeros, ahead)


def drive(cases: Cases, driver: str) -> np.ndarray:
    """Does a driver touch the other, `[C]`?

    Args:
      cases: `Cases`.
      driver: one of `DRIVERS`.

    Raises:
      ValueError: another one.
    """
    if driver not in DRIVERS:
        raise ValueError(f"driver = {driver!r}: expected one of {', '.join(DRIVERS)}")
    v, u, gap = cases.v.copy(), cases.v_other.copy(), cases.gap.copy()
    count = len(v)
    moved, perceived, a = np.zeros((3, count))
    hit, past = np.zeros((2, count), bool)
    since = np.full(count, np.inf)
    for k in range(round(SECONDS / DT)):
        aside = np.where(cases.lateral > 0.0, np.maximum(ASIDE - moved, -WIDTH), -WIDTH)
        toward = np.where(aside > -WIDTH, cases.lateral, 0.0)
        past |= (gap < -LENGTH) & (aside > 0.0)
        hit |= (gap <= 0.0) & (gap >= -2 * LENGTH) & (aside <= 0.0) & ~past
        seen = (k * DT >= cases.hidden) & ~past
        perceived += DT * ((is_off_centre(moved) | (cases.lateral == 0.0)) & seen)
        view = View(gap, v, a, u, aside, toward, cases.lateral == 0.0, perceived)
        if driver == "careful driver":
            since = np.where(np.isinf(since) & careful_sees_risk(view) & seen, k * DT, since)
            late = k * DT - since - DELAY
            wanted = np.where(late >= 0.0, np.minimum(RELEASED + ONSET * np.maximum(late, 0.0), FULL), RELEASED)
            wanted = np.where(np.isinf(since), 0.0, wanted)
        elif driver == "fuzzy safety model":
            wanted = np.where(seen, fuzzy_deceleration(view), 0.0)
            since = np.where(np.isinf(since) & (wanted > 0.0), k * DT, since)
            wanted = np.where(k * DT - since >= DELAY, np.minimum(wanted, ONSET * DT - np.minimum(a, 0.0)), 0.0)
        else:
            wanted = np.zeros(count)
        a = -np.minimum(wanted, v / DT)
        brakes = np.minimum(cases.braking, u / DT)
        gap += (u - v) * DT - 0.5 * (brakes + a) * DT**2
        v, u = v + a * DT, u - brakes * DT
        moved = moved + cases.lateral * DT
    return hit


def drive_shield(cases: Cases, preset: Preset, evasion: bool = False) -> np.ndarray:
    """The same with a shield on an ego that would go on, `[C]`. What is hidden is not there for it.

    Args:
      cases: `Cases`.
      preset: the table.
      evasion: it makes an evasive effort, along its lane.
    """
    table = table_for(preset, Rules(anticipation=0.0), DT)
    half = largest_half_extents(LENGTH, WIDTH, table.rules.heading_bound)
    return np.array([_is_hit(*map(float, case), *half, evasion, table) for case in zip(*cases, strict=True)], bool)


@compiled_for_arrays
def _is_hit(v, u, gap, lateral, braking, hidden, half_length, half_width, evasion, table):
    ego, users, ego_before, users_before = (
        np.zeros(1, ROAD_USER),
        np.zeros(1, ROAD_USER),
        np.zeros(1, ROAD_USER),
        np.zeros(1, ROAD_USER),
    )
    memory, evading = np.zeros(1, MEMORY), False
    body = Body(0.5 * LENGTH, 0.5, 0.0, 0.0, 0.0, 0.0, False, table.ego.a_min_brake)
    s, s_other, y_other = 0.0, gap + LENGTH, 0.0
    if lateral > 0.0:
        y_other = ASIDE + WIDTH
    for k in range(int(SECONDS / DT)):
        coming = lateral if y_other > 1e-9 else 0.0
        for one, place, side, speed, across in ((ego[0], s, 0.0, v, 0.0), (users[0], s_other, y_other, u, -coming)):
            one.s, one.y, one.speed, one.u = place, side, speed, across
            one.sin = across / max(speed, 1e-9) if abs(across) < speed else 0.0
            one.heading, one.cos = np.arcsin(one.sin), np.sqrt(1.0 - one.sin**2)
            one.along, one.around, one.in_own_lane, one.wreck = speed * one.cos, np.inf, True, False
            one.half_length, one.half_width = half_length, half_width
        a = 0.0
        if k * DT >= hidden:
            danger = find_danger(ego[0], users, ego_before[0], users_before, memory, table)
            wish = Command(0.0, 0.0)
            if evasion:
                effort = evade(wish, evading, ego[0], users, memory, Room(0.0, 0.0), body, danger.bounds, table)
                wish, evading = effort.wish, effort.evading
            command = respond(wish, danger, ego[0], body, table.rules, table.dt).command
            if danger.dangerous:
                judge_frame(ego[0], users, memory, command, 0.0, table)
            a = command.acceleration
            ego_before[0], users_before[0] = ego[0], users[0]
        if abs(s_other - s) <= LENGTH and abs(y_other) <= WIDTH:
            return True
        if s > s_other + LENGTH:
            return False
        a = max(a, -v / DT)
        brakes = min(braking, u / DT)
        s, s_other = s + v * DT + 0.5 * a * DT**2, s_other + u * DT - 0.5 * brakes * DT**2
        v, u = v + a * DT, u - brakes * DT
        y_other = max(y_other - lateral * DT, 0.0)
    return False
