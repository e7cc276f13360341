"""How vehicles move in one frame: a kinematic bicycle, explicit Euler."""

import numpy as np

from rss_shield.envs._numpy.ufuncs import arctan_each, tan_each
from rss_shield.envs.compiled import merged
from rss_shield.envs.fast.state import DIRECT, TRAFFIC


@merged
def set_heading(car, heading):
    """Turn a car, and keep its direction along."""
    car.heading = heading
    car.cos, car.sin = np.cos(heading), np.sin(heading)


@merged
def move(cars, n_vehicles, sight, dt, max_speed, min_speed):
    """Advance all vehicles by one frame.

    Args:
      cars: `[N]` CAR.
      n_vehicles: how many of them move.
      sight: working memory.
      dt: length of a frame [s].
      max_speed, min_speed: range of speeds of a directly driven car [m/s].
    """
    turning, straight = 0, 0
    for i in range(n_vehicles):
        car = cars[i]
        if car.kind == TRAFFIC:
            car.timer += dt
        if car.kind == DIRECT:
            _limit(car, max_speed, min_speed)
        else:
            _limit(car, 40.0, -40.0)
        # who turns cannot be foretold
        sight.some[turning], sight.others[straight] = i, i
        turning += car.steering != 0.0
        straight += car.steering == 0.0
    for b in range(straight):
        car = cars[sight.others[b]]
        _displace(car, car.cos, car.sin, dt)
        car.speed += car.acceleration * dt
    for b in range(turning):
        sight.x[b] = cars[sight.some[b]].steering
    tan_each(sight.x, sight.y, turning)
    for b in range(turning):
        sight.x[b] = 0.5 * sight.y[b]
    arctan_each(sight.x, sight.y, turning)
    for b in range(turning):
        car = cars[sight.some[b]]
        slip = sight.y[b]
        _displace(car, np.cos(car.heading + slip), np.sin(car.heading + slip), dt)
        if slip != 0.0:
            set_heading(car, car.heading + car.speed * np.sin(slip) / (car.length / 2) * dt)
        car.speed += car.acceleration * dt


@merged
def _displace(car, cos, sin, dt):
    """Move a car in a direction, and by the impact if it was hit."""
    car.x += car.speed * cos * dt
    car.y += car.speed * sin * dt
    if car.hit:
        car.x += car.impact_x
        car.y += car.impact_y
        car.crashed, car.hit = True, False


@merged
def _limit(car, max_speed, min_speed):
    """A wreck brakes to a stop; nobody accelerates beyond the range of speeds."""
    if car.crashed:
        car.steering = 0.0
        car.acceleration = -1.0 * car.speed
    if car.speed > max_speed:
        car.acceleration = min(car.acceleration, max_speed - car.speed)
    elif car.speed < min_speed:
        car.acceleration = max(car.acceleration, min_speed - car.speed)
