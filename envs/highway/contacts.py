"""Who touches the ego, as highway-env sees it."""


def touches(vehicle, other, dt: float) -> bool:
    """highway-env's own collision test of two on one road, in its own order, without its effects."""
    vehicles = vehicle.road.vehicles
    first, second = vehicle, other
    if other in vehicles and vehicles.index(other) < vehicles.index(vehicle):
        first, second = other, vehicle
    if not (first.check_collisions or second.check_collisions):
        return False
    touching, will_touch, _ = first._is_colliding(second, dt)
    return bool(touching or will_touch)
