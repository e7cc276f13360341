"""Before there is danger: commands are capped so that margins shrink smoothly and danger is not entered.

While a pair is safe and nobody owes anything, the next sample is to keep a share of today's margin h,

    h(k + 1) >= (1 - kappa dt) (h(k) - eps) + eps

(a discrete control barrier: Agrawal, Sreenath, RSS 2017), as long as the other goes on as it does: a leader with the
braking of its last frame, a neighbour with its lateral speed. Nothing in the proof of Defs. 1-10 moves: an upper
bound of the acceleration and limits of the lateral speed only ever make the ego brake earlier and drift less. Where
the other does worse than that, danger begins, and the proper response answers as ever.
"""

import numpy as np

from rss_shield.shield._numba.compiled import compiled, inner, rare
from rss_shield.shield.definitions.kinematics import reach, stopping_distance
from rss_shield.shield.definitions.longitudinal import d_min_following

ROOM = 0.1  # eps: margin that is left alone [m]


@compiled
def share_kept(margin, rate, dt):
    """What the next sample is to keep of a margin [m], at a rate `kappa` [1/s]."""
    room = min(margin, ROOM)
    return max(1.0 - rate * dt, 0.0) * (margin - room) + room


@compiled
def acceleration_cap(gap, margin, v, v_front, a_front, rear, front, rate, dt):
    """Largest acceleration that keeps the share of the margin of Def. 1 at the next sample [m/s^2].

    The gap after this frame depends on the speeds now, gap' = gap + (v_front - v) dt, and the command only decides the
    speed v' that goes with it. With the leader's next speed v_front', at most v_front, the largest v' with
    d_min(v', v_front') + margins <= gap' - kept solves

        reach(v') + max(v' - v_front', 0) dt/2 <= gap' - kept - lambda - b dt^2/8 + v_front'^2 / (2 b_front)

    Args:
      gap: bumper to bumper [m].
      margin: gap less the distance required now, >= 0 [m].
      v, v_front: speeds along the lane, as the distance assumes them, >= 0 [m/s].
      a_front: the leader's acceleration over the last frame [m/s^2]; no credit is taken for one that speeds up.
      rear, front: `RSSParams`.
      rate: kappa [1/s].
      dt: length of a frame [s].

    Returns:
      Never less than -a_min_brake: that suffices, or the pair is in danger. inf where full throttle is left.
    """
    v_next = max(v_front + max(min(a_front, 0.0), -front.a_max_brake) * dt, 0.0)
    kept = share_kept(margin - speed_cap_credit(v, rear), rate, dt)
    room = gap + (v_front - v) * dt - kept - rear.standstill_gap - rear.a_min_brake * dt**2 / 8
    if room < 0.0:
        return -rear.a_min_brake
    speed = _fastest(room + stopping_distance(v_next, front.a_max_brake), v_next, rear, dt)
    if rear.a_min_brake > front.a_max_brake:
        speed = _checked(speed, room, v_next, rear, front, dt)
    cap = max((speed - v) / dt, -rear.a_min_brake)
    return cap if cap < rear.a_max_accel else np.inf


@compiled
def speed_cap_credit(v, rear):
    """What Def. 1 grants a follower that would else get faster than `v_cap` in its response time [m].

    Anticipation takes none of it: near the highest speed, braking would not make the distance shrink fast enough.
    """
    rho, a, b = rear.response_time, rear.a_max_accel, rear.a_min_brake
    if v + a * rho <= rear.v_cap:
        return 0.0
    return reach(v, rho, a, b, np.inf) - reach(v, rho, a, b, rear.v_cap)


@inner
def _fastest(d, v_front, rear, dt):
    """Largest speed v with reach(v) + max(v - v_front, 0) dt/2 <= d, without `v_cap` [m/s]."""
    rho, a, b = rear.response_time, rear.a_max_accel, rear.a_min_brake
    d += 0.5 * a * rho**2
    slower = _root(b, rho, d) - a * rho
    if slower <= v_front:
        return slower
    return max(_root(b, rho + dt / 2, d + (a * rho + v_front) * dt / 2) - a * rho, v_front)


@inner
def _root(b, r, d):
    """Positive root w of w^2 / (2 b) + w r = d."""
    return np.sqrt((b * r) ** 2 + 2.0 * b * max(d, 0.0)) - b * r


@rare
def _checked(speed, room, v_front, rear, front, dt):
    """A follower that brakes harder than its leader may be closest before both stand (hole H1): search."""
    low, high = 0.0, max(speed, 0.0)
    for _ in range(30):
        middle = 0.5 * (low + high)
        needed = d_min_following(middle, v_front, rear, front) - rear.standstill_gap
        if needed + max(middle - v_front, 0.0) * dt / 2 <= room:
            low = middle
        else:
            high = middle
    return low


@compiled
def lateral_cap(margin, w, w_other, car, rate, dt):
    """Largest lateral speed toward a neighbour that keeps the share of the margin of Def. 6 at the next sample [m/s].

    With the no-credit distance E(w) of one car, w the ego's speed toward the other now and u the one sought,

        E(u) + u dt <= margin + E(w) - w_other dt - kept

    Args:
      margin: lateral gap less the distance required now, >= 0 [m].
      w, w_other: speeds toward each other, >= 0 [m/s].
      car: `RSSParams` of the ego.
      rate: kappa [1/s].
      dt: length of a frame [s].

    Returns:
      At least 0: to stop moving toward somebody is never forbidden.
    """
    rho, a, b = car.response_time, car.a_lat_max_accel, car.a_lat_min_brake
    w_rho = w + a * rho
    d = margin - share_kept(margin, rate, dt) - w_other * dt
    d += w_rho**2 / (2.0 * b) + w * (rho + dt / 2)
    # (u + a rho)^2 / (2 b) + u (rho + 3 dt / 2) = d
    r = rho + 1.5 * dt
    return max(_root(b, r, d + a * rho * r) - a * rho, 0.0)


@compiled
def farthest_bound(v, rear, front, rate, dt):
    """Margin of Def. 1 beyond which `acceleration_cap` leaves full throttle, and how much more per speed of the leader.

    In a second the margin falls by no more than the ego's speed, what it requires more as it speeds up, and what the
    leader's braking takes off its way to rest, which is its speed.

    Returns:
      ([m], [s]); (inf, 0) for a follower that brakes harder than its leader (hole H1).
    """
    if rear.a_min_brake > front.a_max_brake:
        return np.inf, 0.0
    rho, a, b = rear.response_time, rear.a_max_accel, rear.a_min_brake
    fall = v + a * (rho + (v + 2.0 * a * rho) / b + 1.0)
    horizon = max(1.0 / rate, dt)
    return fall * horizon + ROOM + speed_cap_credit(v, rear), horizon
