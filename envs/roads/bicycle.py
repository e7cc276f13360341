"""A car as the simulator moves it, kinematic or dynamical, and laws of steering that keep it on its lane.

highway-env's `Vehicle` is a kinematic bicycle, `BicycleVehicle` one whose tyres slip. Its integration step of 1/15 s is
too long for it between 1 and 3.7 m/s: its yaw rate, of time constant v / 155, grows from frame to frame there whatever
the driver does, and below 1 m/s steering has no effect. So whoever brakes it to rest in a turn, by a law made for the
kinematic one, ends up across the lane. `lane_keeping` computes the steering angle that gives it the yaw rate it
should have one frame later.
"""

import numpy as np
from highway_env.vehicle.dynamics import BicycleVehicle

from rss_shield.envs.roads.network import CAR_LENGTH, heading_at, local_coordinates
from rss_shield.envs.roads.slip import slip_of
from rss_shield.envs.roads.steering import steering_angle
from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.geometry import follow, nearest_piece, wrap_angle

X, Y, HEADING, SPEED, LATERAL_SPEED, YAW_RATE = range(6)  # of a state, SI units

_FRONT, _REAR = BicycleVehicle.LENGTH_A, BicycleVehicle.LENGTH_B  # axles from the centre [m]
_STIFFNESS_FRONT = 2 * BicycleVehicle.FRICTION_FRONT / BicycleVehicle.MASS  # [m/s^2 per rad]
_STIFFNESS_REAR = 2 * BicycleVehicle.FRICTION_REAR / BicycleVehicle.MASS
_INERTIA = BicycleVehicle.INERTIA_Z / BicycleVehicle.MASS  # [m^2]
_MAX_YAW_RATE = BicycleVehicle.MAX_ANGULAR_SPEED  # [rad/s]
_MAX_STEERING = np.pi / 2  # [rad]
_CREEP = 1.0  # below this speed its tyres only damp, and steering has no effect [m/s]

# of `lane_keeping`; among the values tried, these kept stops and starts in turns closest to the lane
_KP_COURSE = 5.0  # yaw rate per angle between the course and where it should lead [1/s]
_KP_OFFSET = 0.6  # speed back to the middle of the lane per distance from it [1/s]
_SLOW = 4.0  # such a correction turns the car no more than at this speed [m/s]
_SHARPEST = 0.3  # yaw rate per speed, at most [rad/m]
_STEEPEST = 0.5  # angle to the lane, at most [rad]
_STEER = np.pi / 3  # steering angle, at most [rad]
_PROBE = 0.02  # steering angle from which the effect of steering is measured [rad]
_NO_EFFECT = 0.05  # yaw rate per steering angle below which it counts as none [1/s]
_LOOK = 0.5  # the lane's curvature is measured over this distance [m]

# of `steer_along`
_ENOUGH = 1e-9  # as near to a speed across the lane as is asked for [m/s]


@compiled
def lane_keeping(lane, state, acceleration, dynamical, dt):
    """Steering angle that follows a lane [rad]: for a kinematic bicycle that of highway-env's own drivers.

    Args:
      lane: LANE.
      state: `[6]` x, y, heading, speed, lateral speed, yaw rate.
      acceleration: of the same command [m/s^2].
      dynamical: the bicycle is `BicycleVehicle`, not `Vehicle`.
      dt: length of a frame [s].
    """
    s, lateral = local_coordinates(lane, state[X], state[Y])
    if not dynamical:
        return steering_angle(lane, s, lateral, state[HEADING], state[SPEED], CAR_LENGTH)
    v, tangent = max(state[SPEED], _CREEP), heading_at(lane, s)
    back = np.arcsin(min(max(-_KP_OFFSET * lateral / max(v, _SLOW), -1.0), 1.0))
    back = min(max(back, -_STEEPEST), _STEEPEST)
    drift = np.arctan2(state[LATERAL_SPEED], v) if v > _SLOW else 0.0
    curvature = wrap_angle(heading_at(lane, s + _LOOK) - tangent) / _LOOK
    rate = _KP_COURSE * wrap_angle(tangent + back - state[HEADING] - drift) + curvature * state[SPEED]
    most = _SHARPEST * state[SPEED]
    rate = min(max(rate, -most), most)
    straight, effect = _next_yaw_rate(state, acceleration, dt)
    if abs(effect) < _NO_EFFECT:
        return min(max(rate * CAR_LENGTH / v, -1.0), 1.0)
    return min(max((rate - straight) / effect, -_STEER), _STEER)


@compiled
def _next_yaw_rate(state, acceleration, dt):
    """Yaw rate after one frame without steering [rad/s], and how much more per steering angle [1/s]."""
    before = state[X], state[Y], state[HEADING], state[SPEED], state[LATERAL_SPEED], state[YAW_RATE]
    _slide(state, acceleration, 0.0, dt)
    straight = state[YAW_RATE]
    _put(state, before)
    _slide(state, acceleration, _PROBE, dt)
    turned = state[YAW_RATE]
    _put(state, before)
    return straight, (turned - straight) / _PROBE


@compiled
def _put(state, values):
    for i in range(len(values)):
        state[i] = values[i]


@compiled
def move(state, acceleration, steering, dynamical, dt):
    """One frame of highway-env's equations of motion."""
    if dynamical:
        _slide(state, acceleration, steering, dt)
        return
    slip = slip_of(steering)
    v, heading = state[SPEED], state[HEADING]
    state[X] += v * np.cos(heading + slip) * dt
    state[Y] += v * np.sin(heading + slip) * dt
    state[HEADING] += v * np.sin(slip) / (CAR_LENGTH / 2) * dt
    state[SPEED] += acceleration * dt


@compiled
def _slide(state, acceleration, steering, dt):
    """One step of Runge and Kutta for `BicycleVehicle`: a bicycle whose tyres slip.

    Speeds are computed in its own order: they fall on `_CREEP` exactly, and their last bit decides on which side.
    """
    steering = min(max(steering, -_MAX_STEERING), _MAX_STEERING)
    heading, v, w, a = state[HEADING], state[SPEED], state[LATERAL_SPEED], acceleration
    r1 = min(max(state[YAW_RATE], -_MAX_YAW_RATE), _MAX_YAW_RATE)
    half = dt / 2
    x1, y1, dw1, dr1 = _slopes(heading, v, w, r1, steering)
    r2 = r1 + dr1 * half
    x2, y2, dw2, dr2 = _slopes(heading + r1 * half, v + a * half, w + dw1 * half, r2, steering)
    r3 = r1 + dr2 * half
    x3, y3, dw3, dr3 = _slopes(heading + r2 * half, v + a * half, w + dw2 * half, r3, steering)
    r4 = r1 + dr3 * dt
    x4, y4, dw4, dr4 = _slopes(heading + r3 * dt, v + a * dt, w + dw3 * dt, r4, steering)
    state[X] += dt / 6 * (x1 + 2 * x2 + 2 * x3 + x4)
    state[Y] += dt / 6 * (y1 + 2 * y2 + 2 * y3 + y4)
    state[HEADING] += dt / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    state[SPEED] = v + dt / 6 * (a + 2 * a + 2 * a + a)
    state[LATERAL_SPEED] = w + dt / 6 * (dw1 + 2 * dw2 + 2 * dw3 + dw4)
    state[YAW_RATE] = r1 + dt / 6 * (dr1 + 2 * dr2 + 2 * dr3 + dr4)


@compiled
def _slopes(heading, v, w, rate, steering):
    """Derivatives of x, y, lateral speed and yaw rate (Rajamani 2011, chapter 2, as `BicycleVehicle` has them)."""
    if abs(v) < _CREEP:
        front = -w - _INERTIA / _FRONT * rate
        rear = -w + _INERTIA / _FRONT * rate
    else:
        front = _STIFFNESS_FRONT * (steering - np.arctan2(w + _FRONT * rate, v))
        rear = -_STIFFNESS_REAR * np.arctan2(w - _REAR * rate, v)
    cos, sin = np.cos(heading), np.sin(heading)
    return (
        v * cos - w * sin,
        v * sin + w * cos,
        front + rear - rate * v,
        (_FRONT * front - _REAR * rear) / _INERTIA,
    )


# ---------------------------------------------------------------- a bicycle whose tyres slip, along a road


def longest_frame() -> float:
    """Above this, the integration step grows a yaw rate at some speed from `_CREEP` on, whatever the driver does [s].

    Runge and Kutta's step of fourth order keeps z' = -c z stable while c dt < 2.785.
    """
    fastest = (_FRONT**2 * _STIFFNESS_FRONT + _REAR**2 * _STIFFNESS_REAR) / _INERTIA / _CREEP
    return 2.785 / fastest


@compiled
def across(road, state):
    """Speed across a road now [m/s], and the angle to it [rad].

    Args:
      road: `[K, 11]` pieces.
      state: `[6]`, as in `lane_keeping`.
    """
    _, _, _, tangent = nearest_piece(road, state[X], state[Y])
    psi = wrap_angle(state[HEADING] - tangent)
    return state[SPEED] * np.sin(psi) + state[LATERAL_SPEED] * np.cos(psi), psi


@compiled
def frame_across(road, state, acceleration, steering, dt):
    """What one frame does: (speed across the road meanwhile, and after it [m/s]; angle to the road after it [rad])."""
    before = state[X], state[Y], state[HEADING], state[SPEED], state[LATERAL_SPEED], state[YAW_RATE]
    _, lateral, k, _ = nearest_piece(road, state[X], state[Y])
    _slide(state, acceleration, steering, dt)
    lateral_next, tangent = follow(road, k, state[X], state[Y])
    psi = wrap_angle(state[HEADING] - tangent)
    after = state[SPEED] * np.sin(psi) + state[LATERAL_SPEED] * np.cos(psi)
    _put(state, before)
    return (lateral_next - lateral) / dt, after, psi


@compiled
def steer_along(road, state, acceleration, wish, limits, heading_bound, dt):
    """Steering angle nearest to a wish that keeps the speed across a road inside its limits [rad].

    The tyres' lateral force is the acceleration across the road: 30 m/s^2 per steering angle, less 60 times the angle
    of the slip. So the angle is chosen by the speed across the road that it leads to after a frame; heading and yaw
    rate swing meanwhile, and settle by themselves where frames are short enough (`longest_frame`). Below 1 m/s steering
    has no effect, and lateral speed and yaw rate die down.

    Args:
      road: `[K, 11]` pieces.
      state: `[6]`, as in `lane_keeping`.
      acceleration: of the same command [m/s^2].
      wish: what the agent asks for [rad].
      limits: to the left and to the right during this frame, and after it [m/s], none negative.
      heading_bound: sine of the largest angle to the road.
      dt: length of a frame [s].
    """
    left, right, left_next, right_next = limits
    during, after, psi = frame_across(road, state, acceleration, wish, dt)
    now, psi_now = across(road, state)
    turned = abs(np.sin(psi)) > max(heading_bound, abs(np.sin(psi_now)))
    if -left <= during <= right and -left_next <= after <= right_next and not turned:
        return wish
    if abs(state[SPEED]) < _CREEP:
        return wish
    target = min(max(0.0 if turned else after, -left_next), right_next)
    target = min(max(target, -2.0 * left - now), 2.0 * right - now)  # about half of a change comes in the frame itself
    target = min(max(target, -left_next), right_next)
    return _steering_to(road, state, acceleration, target, dt)


@compiled
def _steering_to(road, state, acceleration, target, dt):
    """Steering angle after which a frame ends at a speed across the road [m/s]."""
    a, b = 0.0, _PROBE
    _, at_a, _ = frame_across(road, state, acceleration, a, dt)
    for _ in range(4):
        _, at_b, _ = frame_across(road, state, acceleration, b, dt)
        if abs(at_b - target) < _ENOUGH or at_b == at_a:
            break
        a, b, at_a = b, min(max(b + (target - at_b) * (b - a) / (at_b - at_a), -_STEER), _STEER), at_b
    return b
