"""What drivers who mean harm do, in both simulators: each is an IDM driver but for one vice, aimed at a victim.

Bounded ones use no more than the limits of the table "simulator" leaves anybody, along the lane and across, but owe
nobody anything; the others use what highway-env's cars can do. None can be kept from running into others; what a
shield can do is not to be the one at fault, and to avoid what can be avoided.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.params import PRESETS

VICES = (
    *("tailgater", "brakechecker", "overtaker", "companion", "squeezer", "swerver", "stopper", "reverser", "rammer"),
    *("runner", "wrongway"),
)
TAILGATER, BRAKE_CHECKER, OVERTAKER, COMPANION, SQUEEZER, SWERVER, STOPPER, REVERSER, RAMMER, RUNNER, WRONG_WAY = range(
    len(VICES)
)
MIXED = len(VICES)  # everybody has one of them
NO_VICE = -1

_BOUNDS = PRESETS["simulator"].other
_BEFORE = 12.0  # [m] ahead of the victim, centre to centre, from where a hostile driver cuts in
_WHEELBASE = 2.5  # half of it [m]
_FASTEST, _HARDEST = 5.0, 12.0  # accelerations of who is not bounded [m/s^2]
_TURN = 0.4  # largest angle of the wheels [rad]


@compiled
def vice_at(vice, x, y):
    """The vice of a driver who starts at a place [m]: the given one, or among `MIXED` one that the place decides."""
    return int(np.floor(abs(7.3 * x + 3.1 * y))) % MIXED if vice == MIXED else vice


@compiled
def _match(speed, v):
    return (speed - v) / 0.6


@compiled
def _clip(x, low, high):
    return min(max(x, low), high)


@compiled
def harass(vice, ahead, aside, v, v_victim, timer, acceleration):
    """What a vice wants: (acceleration [m/s^2], lateral speed to the right of the victim's lane [m/s], nan = any).

    Args:
      vice: one of the above.
      ahead, aside: how far the driver is ahead of the victim and to its right, centre to centre [m].
      v, v_victim: speeds [m/s].
      timer: since the last thought about a lane change [s].
      acceleration: of an IDM driver in its place [m/s^2].
    """
    if vice == TAILGATER:  # close behind, and stays there
        return _match(v_victim + _clip(-ahead - 7.0, -4.0, 4.0), v), -aside
    if vice == BRAKE_CHECKER:  # gets ahead, into the way, and brakes as hard as it can
        if ahead < _BEFORE:
            return _match(v_victim + 5.0, v), np.nan
        if abs(aside) > 0.5:
            return _match(v_victim, v), -_clip(aside, -1.5, 1.5)
        return -_HARDEST if ahead < 3 * _BEFORE else 0.0, 0.0
    if vice == OVERTAKER:  # passes without distance, moves in ahead, and slows down gently, for good
        if ahead < 8.0:
            return _match(v_victim + 4.0, v), 0.0 if abs(aside) > 2.2 else np.sign(aside) * 1.0
        return max(_match(v_victim - 6.0, v), -3.0), -_clip(aside / 0.8, -1.0, 1.0)
    if vice == COMPANION:  # comes up in the gap between two lanes and stays beside
        side = 1.0 if aside >= 0.0 else -1.0
        return _match(v_victim + _clip(-ahead, -4.0, 9.0), v), _clip(side * 3.0 - aside, -1.0, 1.0)
    if vice == SQUEEZER:  # comes beside and pushes
        toward = -np.sign(aside) * 1.5 if abs(ahead) < 5.0 else 0.0
        return _match(v_victim + _clip(-ahead, -4.0, 4.0), v), toward
    if vice == SWERVER:  # from side to side, wherever it is
        return acceleration, 4.0 if (timer * 1.3) % 2.0 < 1.0 else -4.0
    if vice == STOPPER:  # stops for good in the way
        return -6.0 if 0.0 < ahead < 60.0 and v > 0.0 else _match(20.0, v), np.nan
    if vice == REVERSER:  # stops ahead and drives backwards
        return _match(-6.0, v) if 0.0 < ahead < 50.0 else _match(v_victim + 3.0, v), np.nan
    if vice == RAMMER:  # at the victim, from wherever it is
        return _match(v_victim + _clip(-ahead, -6.0, 6.0), v), -_clip(aside * 1.5, -4.0, 4.0)
    if vice == RUNNER:  # neither lights, lines, priority nor anybody ahead count
        return _match(14.0, v), np.nan
    return _match(20.0, v), -_clip(aside, -1.5, 1.5)  # the wrong way, toward the victim


@compiled
def hostile_command(vice, bounded, wanted, v, turn, mirrored, steering):
    """(acceleration [m/s^2], steering [rad]) of a hostile driver.

    Args:
      vice: one of the above.
      bounded: it keeps to the limits of the table.
      wanted: what `harass` says.
      v: speed [m/s].
      turn: heading relative to its own lane, where it is [rad].
      mirrored: the victim's lane runs against its own.
      steering: of an IDM driver in its place [rad].
    """
    a, sideways = wanted
    if vice != REVERSER:
        a = max(a, -5.0 * max(v, 0.0))
    a = _clip(a, -_HARDEST, _FASTEST)
    if bounded:
        a = _clip(a, -_BOUNDS.a_max_brake, _BOUNDS.a_max_accel)
    if not np.isnan(sideways):
        speed = max(v, 3.0)
        angle = np.arcsin(_clip((-sideways if mirrored else sideways) / speed, -0.5, 0.5))
        course = angle if np.cos(turn) >= 0.0 else np.pi - angle
        off = (course - turn + np.pi) % (2.0 * np.pi) - np.pi
        steering = _clip(np.arctan(2.0 * off * _WHEELBASE / speed * 5.0), -_TURN, _TURN)
    if bounded:  # lateral acceleration v^2 sin(slip) / half wheelbase
        most = np.arctan(2.0 * np.tan(np.arcsin(min(_BOUNDS.a_lat_max_accel * _WHEELBASE / max(v * v, 1e-6), 0.5))))
        steering = _clip(steering, -most, most)
    return a, steering


def _class_of(vice: str) -> str:
    return f"rss_shield.envs.highway.hostile.{vice.title()}"


# names of drivers -> paths of their classes, as `other_vehicles_type` takes them
HOSTILE = {vice: _class_of(vice) for vice in (*VICES, "mixed")}
HOSTILE |= {f"bounded-{vice}": _class_of(vice) + "Bounded" for vice in (*VICES, "mixed")}
_NUMBERS = {
    path: ((*VICES, "mixed").index(name.removeprefix("bounded-")), "-" in name) for name, path in HOSTILE.items()
}


def vice_of(path: str) -> tuple[int, bool] | None:
    """(vice, bounded) of a class of drivers, None = it is not hostile."""
    return _NUMBERS.get(path)
