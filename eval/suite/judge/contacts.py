"""When do two road users touch? Boxes that overlap, now or within the next frame at constant velocity."""

import numpy as np

from rss_shield.shield.trace import Trace


def box_gaps(trace: Trace, i: int, j: int, ahead: float = 0.0) -> np.ndarray:
    """Largest gap between the boxes of two users along any side of either, `[T]` [m]; negative where they overlap.

    Args:
      trace: `Trace`.
      i, j: indices of the users.
      ahead: the boxes sweep on along their headings at their speeds for this long [s].

    Returns:
      NaN where one of them is not there.
    """
    u = trace.users
    x, y = u.x[:, j] - u.x[:, i], u.y[:, j] - u.y[:, i]
    cos, sin = (np.array([f(u.heading[:, i]), f(u.heading[:, j])]) for f in (np.cos, np.sin))
    move_x = (u.speed[:, i] * cos[0] - u.speed[:, j] * cos[1]) * ahead
    move_y = (u.speed[:, i] * sin[0] - u.speed[:, j] * sin[1]) * ahead
    turn_cos, turn_sin = np.abs(cos[0] * cos[1] + sin[0] * sin[1]), np.abs(sin[0] * cos[1] - cos[0] * sin[1])
    gaps = []
    for own, other, k in ((i, j, 0), (j, i, 1)):
        along = 0.5 * (u.length[own] + u.length[other] * turn_cos + u.width[other] * turn_sin)
        across = 0.5 * (u.width[own] + u.length[other] * turn_sin + u.width[other] * turn_cos)
        for nx, ny, half in ((cos[k], sin[k], along), (-sin[k], cos[k], across)):
            far, step = x * nx + y * ny, move_x * nx + move_y * ny
            gaps.append(np.maximum(far - np.maximum(step, 0.0), np.minimum(step, 0.0) - far) - half)
    return np.max(gaps, axis=0)


def touches(trace: Trace, i: int, j: int) -> np.ndarray:
    """`[T]` bool: two users touch, or will on the next sample, and then do.

    A contact that is only predicted counts if the boxes do overlap a sample later, or if the log says of both that they
    have crashed by then: a simulator may push cars apart before they overlap. Where a simulator has said when it saw a
    contact coming there is none before.
    """
    now = box_gaps(trace, i, j) <= 0.0
    soon = box_gaps(trace, i, j, trace.dt) <= 0.0
    crashed = trace.users.crashed[:, i] & trace.users.crashed[:, j]
    happens = now | crashed
    happens[:-1] |= now[1:] | crashed[1:]
    noted = [_first_contact(trace, one) for one in (i, j)]
    if np.isfinite(noted).all():
        return (now | soon) & (trace.time > max(noted) - 0.5 * trace.dt)
    return now | (soon & happens)


def _first_contact(trace: Trace, i: int) -> float:
    """When a simulator has said of a user that it touches somebody, or will; inf if it has not [s]."""
    return min((event.time for event in trace.events if event.kind == "contact" and event.user == i), default=np.inf)


def near_pairs(trace: Trace) -> list[tuple[int, int]]:
    """Pairs whose boxes come so near to each other that it is worth while to look for contacts."""
    u = trace.users
    fastest = np.nanmax(np.abs(u.speed), initial=0.0) * trace.dt * 2.0
    reach = 0.5 * np.hypot(u.length, u.width)
    pairs = []
    for i in range(len(u.ids)):
        distance = np.hypot(u.x - u.x[:, [i]], u.y - u.y[:, [i]])
        near = (distance <= reach + reach[i] + fastest).any(axis=0)
        pairs += [(i, int(j)) for j in np.flatnonzero(near) if j > i]
    return pairs
