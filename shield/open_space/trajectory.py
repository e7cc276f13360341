"""What one car has in mind: a command for one frame, then braking with the wheels as they are, to rest.

A car knows its own trajectory, where of others it only knows the set (Def. 21). The trajectory is one out of that set,
played with the simulator's equations, and written as an occupancy that holds nothing else.
"""

import numpy as np

from rss_shield.shield._numba.compiled import part
from rss_shield.shield.definitions.occupancy import (
    ANEW,
    COS_LEFT,
    COS_RIGHT,
    HI,
    LEFT,
    LO,
    RIGHT,
    SIN_LEFT,
    SIN_RIGHT,
    WIDER,
    Occupancy,
    bounds_of,
)
from rss_shield.shield.open_space.frames import LOOK_AHEAD, mover_of


@part
def braking_of(v, b, dt):
    """Acceleration of one that brakes at `b`, or comes to rest within the frame [m/s^2]; `v` of any sign."""
    return -np.sign(v) * min(b, np.abs(v) / dt)


@part
def intention(user, acceleration, slip, b, dt, rows):
    """The `Occupancy` of a car that carries out one command and then brakes at `b` [m/s^2] to rest.

    Args:
      user: `USER`.
      acceleration, slip: of the frame that begins now [m/s^2], [rad]; the wheels stay as they are.
      rows: `[K, ROW_FIELDS]` to be filled.
    """
    mover = mover_of(user)
    gear = -1.0 if user.speed < 0.0 else 1.0
    v, angle, lag = user.speed, 0.0, user.half_length
    sin, cos = np.sin(slip), np.cos(slip)
    wider = LOOK_AHEAD + 2.0 * np.sin(0.5 * np.abs(slip))
    reach, steps = 0.0, len(rows) + 1
    for k in range(len(rows)):
        row = rows[k]
        if steps < k:
            for field in range(len(row)):
                row[field] = rows[k - 1, field]
            continue
        turn = v * sin / lag * dt
        covered = gear * (v * dt * cos + 0.5 * lag * turn * turn)
        right, left = max(angle, angle + turn), -min(angle, angle + turn)
        row[LO] = row[HI] = covered
        row[RIGHT], row[LEFT] = right, left
        row[COS_RIGHT], row[SIN_RIGHT] = np.cos(right), np.sin(right)
        row[COS_LEFT], row[SIN_LEFT] = np.cos(left), np.sin(left)
        row[ANEW], row[WIDER] = 0.0, wider * np.abs(v) * dt
        reach += np.abs(v) * dt
        angle += turn
        if v == 0.0 and (k > 0 or acceleration == 0.0):
            steps = min(steps, k)
        v += (acceleration if k == 0 else braking_of(v, b, dt)) * dt
        if np.abs(v) < 1e-9:
            v = 0.0
    bounds = bounds_of(mover, steps, 0, reach, 0.0, 0.0, 0.0, False)
    return Occupancy(mover, bounds, rows, rows)
