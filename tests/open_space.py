"""Road users in open space that do whatever Def. 21 lets them, for the tests of Defs. 20 to 22."""

from typing import NamedTuple

import numpy as np

from rss_shield.shield.definitions.occupancy import ANY_WAY, BACKWARDS, Mover


class Track(NamedTuple):
    """Many motions of one road user. `speed` is along the heading, negative backwards."""

    time: np.ndarray  # [T]
    x: np.ndarray  # [T, N]
    y: np.ndarray
    heading: np.ndarray
    speed: np.ndarray


def bang_bang(rng, shape, low, high):
    """Random values in an interval, more often than not one of its ends."""
    values = rng.uniform(low, high, shape)
    end = rng.random(shape)
    return np.where(end < 0.35, low, np.where(end < 0.7, high, values))


def drive(mover, driver, steering, brakes, rng, n, seconds, dt=0.005):
    """`n` random motions: any acceleration and turn for the response time, then C_b (`brakes`) or C_f.

    Finely integrated. Every driver changes its mind four times while it may, and every 0.4 s afterwards.
    """
    rho, a, b, b_max = driver.response_time, driver.a_max_accel, driver.a_min_brake, driver.a_max_brake
    frames = round(seconds / dt)
    x, y = np.full(n, mover.x), np.full(n, mover.y)
    heading, v = np.full(n, mover.heading), np.full(n, mover.v)
    w = np.full(n, mover.yaw_rate)
    limit = 1.0 / steering.min_radius
    yaw_acceleration = min(steering.yaw_acceleration, 1e6)
    track = [(x, y, heading, v)]
    chooses = max(1, round(rho / dt / 4))
    gear = np.ones(n)  # of one that has come to rest: which way it starts
    for k in range(frames):
        t = k * dt
        if t + dt <= rho + 1e-9:
            if k % chooses == 0:
                push, turn = bang_bang(rng, n, -b_max, a), bang_bang(rng, n, -yaw_acceleration, yaw_acceleration)
                if steering.sets_out == BACKWARDS:
                    gear = np.where(np.abs(v) < 1e-12, rng.choice([-1.0, 1.0], n), np.sign(v))
                if steering.sets_out == ANY_WAY:
                    heading = np.where(np.abs(v) < 1e-12, rng.uniform(-np.pi, np.pi, n), heading)
            w = np.clip(w + turn * dt, -limit * np.abs(v), limit * np.abs(v))
            curvature = None
        else:
            if curvature is None:
                moves = (np.abs(v) > 1e-12) & steering.keeps_turning
                curvature = np.where(moves, np.clip(w / np.where(moves, v, 1.0), -limit, limit), 0.0)
            if brakes:
                push = -b if k % round(0.4 / dt) else bang_bang(rng, n, -b_max, -b)
            elif k % round(0.4 / dt) == 0:
                push = bang_bang(rng, n, -b_max, a)
        gear = np.where(np.abs(v) < 1e-12, gear, np.sign(v))
        size = np.abs(v)
        cap = np.maximum(driver.v_cap, size)
        size_next = np.clip(size + push * dt, 0.0, cap)
        step = gear * 0.5 * (size + size_next) * dt
        turned = w * dt if curvature is None else curvature * step
        x, y = x + step * np.cos(heading + 0.5 * turned), y + step * np.sin(heading + 0.5 * turned)
        heading, v = heading + turned, gear * size_next
        track.append((x, y, heading, v))
    columns = (np.array(column) for column in zip(*track, strict=True))
    return Track(np.arange(frames + 1) * dt, *columns)


def support(track, mover, nx, ny):
    """`[T]` how far all boxes of a track extend in a direction, from where it began."""
    cos, sin = np.cos(track.heading), np.sin(track.heading)
    along, across = np.abs(nx * cos + ny * sin), np.abs(ny * cos - nx * sin)
    centre = (track.x - mover.x) * nx + (track.y - mover.y) * ny
    return (centre + mover.half_length * along + mover.half_width * across).max(axis=1)


def corners(track, mover):
    """`[T, N, 4, 2]`"""
    cos, sin = np.cos(track.heading)[..., None], np.sin(track.heading)[..., None]
    ahead = mover.half_length * np.array([1.0, 1.0, -1.0, -1.0])
    aside = mover.half_width * np.array([1.0, -1.0, -1.0, 1.0])
    x = track.x[..., None] + ahead * cos - aside * sin
    y = track.y[..., None] + ahead * sin + aside * cos
    return np.stack([x, y], axis=-1)


def separation(one, mover_1, two, mover_2):
    """`[T, N]` of two tracks: largest gap along any side of either box, negative where they overlap."""
    corners_1, corners_2 = corners(one, mover_1), corners(two, mover_2)
    gap = np.full(one.x.shape, -np.inf)
    for track in (one, two):
        for angle in (0.0, 0.5 * np.pi):
            axis = np.stack([np.cos(track.heading + angle), np.sin(track.heading + angle)], axis=-1)
            first = np.einsum("tnci,tni->tnc", corners_1, axis)
            second = np.einsum("tnci,tni->tnc", corners_2, axis)
            gap = np.maximum(gap, np.maximum(second.min(2) - first.max(2), first.min(2) - second.max(2)))
    return gap


def random_mover(rng, x=0.0, y=0.0, heading=0.0, v_max=8.0, min_radius=3.5):
    """A car of 4 to 5 m on a turn that its radius allows, now and then at rest."""
    v = rng.choice([0.0, rng.uniform(0.0, v_max)], p=[0.2, 0.8])
    yaw_rate = rng.uniform(-1.0, 1.0) * min(v / min_radius, 0.6)
    return Mover(x, y, heading, v, yaw_rate, rng.uniform(2.0, 2.5), rng.uniform(0.8, 1.1))
