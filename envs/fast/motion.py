"""How vehicles move in one frame: a kinematic bicycle, explicit Euler."""

import numpy as np

from envs.fast.compiled import compiled, merged
from envs.fast.state import DIRECT, TRAFFIC


@compiled
def set_heading(car, heading):
    """Turn a car, and keep its direction along."""
    car.heading = heading
    car.cos, car.sin = np.cos(heading), np.sin(heading)


@merged
def move(cars, n_vehicles, dt, max_speed, min_speed):
    """Advance all vehicles by one frame.

    Args:
      cars: `[N]` CAR.
      n_vehicles: how many of them move.
      dt: length of a frame [s].
      max_speed, min_speed: range of speeds of a directly driven car [m/s].
    """
    for i in range(n_vehicles):
        car = cars[i]
        if car.kind == TRAFFIC:
            car.timer += dt
        if car.kind == DIRECT:
            _limit(car, max_speed, min_speed)
        else:
            _limit(car, 40.0, -40.0)
        speed, heading = car.speed, car.heading
        slip = 0.0
        if car.steering != 0.0:
            slip = np.arctan(0.5 * np.tan(car.steering))
            car.x += speed * np.cos(heading + slip) * dt
            car.y += speed * np.sin(heading + slip) * dt
        else:
            car.x += speed * car.cos * dt
            car.y += speed * car.sin * dt
        if car.hit:
            car.x += car.impact_x
            car.y += car.impact_y
            car.crashed, car.hit = True, False
        if slip != 0.0:
            set_heading(car, heading + speed * np.sin(slip) / (car.length / 2) * dt)
        car.speed += car.acceleration * dt


@compiled
def _limit(car, max_speed, min_speed):
    """A wreck brakes to a stop; nobody accelerates beyond the range of speeds."""
    if car.crashed:
        car.steering = 0.0
        car.acceleration = -1.0 * car.speed
    if car.speed > max_speed:
        car.acceleration = min(car.acceleration, max_speed - car.speed)
    elif car.speed < min_speed:
        car.acceleration = max(car.acceleration, min_speed - car.speed)
