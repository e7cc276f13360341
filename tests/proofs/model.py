"""One explicit-Euler frame of two cars, as the proof sees it: what is known of them, what they may do, what they need.

Distances are the product's own functions (`symbolic`). A car has a budget: how far it may still come while it keeps its
response, `s` seconds of its response time being left. The invariants say that the gap holds both budgets.
"""

import z3
from symbolic import driver, real, symbolic

from rss_shield.shield import sampling
from rss_shield.shield.definitions import kinematics, lateral, longitudinal, right_of_way

ZERO = real(0.0)
dt = z3.Real("dt")
rear, front = driver("rear"), driver("front")

forward_reach = symbolic(kinematics.forward_reach)
stopping_distance = symbolic(kinematics.stopping_distance)
euler_margin = symbolic(sampling.euler_margin)
d_min_no_credit = symbolic(lateral.d_min_no_credit)
d_min_of_pair = symbolic(lateral.d_min_of_pair)
lateral_euler_margin = symbolic(sampling.lateral_euler_margin)
sampling_margin = symbolic(sampling.sampling_margin)
is_safe_longitudinally = symbolic(longitudinal.is_safe_longitudinally)
can_stop_before = symbolic(right_of_way.can_stop_before)
with_euler_margin = symbolic(sampling.with_euler_margin)

_TINIEST = 1e-300  # of accelerations: what is smaller counts as none in `kinematics`


def in_range(car) -> list[z3.BoolRef]:
    """Parameters as `RSSParams.validated` takes them, and a response time of a frame at least (C2)."""
    return [
        car.response_time >= dt,
        z3.Or(car.a_max_accel == 0, car.a_max_accel >= real(_TINIEST)),
        car.a_min_brake > 0,
        car.a_max_brake >= car.a_min_brake,
        car.a_min_brake_correct > 0,
        car.a_min_brake_correct <= car.a_min_brake,
        car.a_lat_max_accel >= 0,
        car.a_lat_min_brake > 0,
        car.mu >= 0,
        car.standstill_gap >= 0,
        car.v_cap > 0,
    ]


TABLE = [dt > 0, *in_range(rear), *in_range(front)]
C4 = [rear.a_min_brake <= front.a_max_brake]


def whole_frames(s) -> z3.BoolRef:
    """C2: of the response time nothing is left, or a frame at least."""
    return z3.Or(s == 0, s >= dt)


def after_a_frame(s):
    return z3.If(s >= dt, s - dt, ZERO)


# ---------------------------------------------------------------- along the lane


def way(v, s, car, b):
    """Budget of a car with speed `v` toward the other (Defs. 1, 2, C5): none once it stands and must stay."""
    continuous = forward_reach(v, s, car.a_max_accel, b, car.v_cap)
    return z3.If(z3.And(s == 0, v <= 0), ZERO, continuous + euler_margin(v, b, dt))


def least_way(v, b):
    """What a leader that brakes at `b` from now on still covers at least, frame by frame."""
    return stopping_distance(v, b) + v * dt / 2


def fastest_next(v, s, car, b):
    """Highest speed after a frame of a car that must stop: C1 while it may still respond, C3 afterwards."""
    cap = z3.If(car.v_cap > v, car.v_cap, v)
    free = z3.If(v + car.a_max_accel * dt < cap, v + car.a_max_accel * dt, cap)
    return z3.If(s >= dt, free, z3.If(v > b * dt, v - b * dt, ZERO))


def keeps_its_response(v, v_next, s, car, b) -> z3.BoolRef:
    """A car that must stop, for one frame."""
    return v_next <= fastest_next(v, s, car, b)


def leads(v, v_next, car) -> z3.BoolRef:
    """A car that is followed, for one frame: it brakes no harder than agreed and does not reverse (C1)."""
    return v_next >= z3.If(v > car.a_max_brake * dt, v - car.a_max_brake * dt, ZERO)


# ---------------------------------------------------------------- across the lane


def approach(w, s, car):
    """Budget of a car whose lateral speed acts from the next frame on, as others' does (Def. 6, C5)."""
    continuous = symbolic(lateral.approach_no_credit)(w, car._replace(response_time=s))
    moving = z3.If(w > 0, w, ZERO)
    return z3.If(z3.And(s == 0, w <= 0), ZERO, continuous + sampling_margin(moving, car, dt))


def approach_at_once(limit, s, car):
    """Budget of one whose lateral speed acts in the frame in which it is chosen, as the ego's does.

    Args:
      limit: what Def. 8 allowed in the frame before [m/s].
    """
    whole = car._replace(response_time=s)
    continuous = symbolic(lateral.approach_no_credit)(limit, whole)
    return z3.If(z3.And(s == 0, limit <= 0), ZERO, continuous + lateral_euler_margin(limit, whole, dt))


def keeps_aside(w, w_next, s, car) -> z3.BoolRef:
    """C1y while it may still respond, Def. 8 afterwards. To move away, or to stop that at once, is always free."""
    moving = z3.If(w > 0, w, ZERO)
    slower = moving - car.a_lat_min_brake * dt
    return w_next <= z3.If(s >= dt, moving + car.a_lat_max_accel * dt, z3.If(slower > 0, slower, ZERO))
