"""Lane changes that the shield allows: which are refused, and to which lane a car may still get."""

from rss_shield.shield.lanes.lane_changes import OFF_CENTRE, is_blocked, turns_back


def offset_from(vehicle, index) -> float:
    """Offset of a vehicle from the centre of a lane, positive to the right [m]."""
    return float(vehicle.road.network.get_lane(index).local_coordinates(vehicle.position)[1])


def offset_from_target(vehicle) -> float:
    """Likewise of the lane that it heads for; 0 if it heads for none."""
    target = getattr(vehicle, "target_lane_index", None)
    return 0.0 if target is None else offset_from(vehicle, target)


def is_way_blocked(vehicle, index, rooms: tuple[float, float]) -> bool:
    """Is the way to the centre of a lane blocked?

    Args:
      vehicle: the ego.
      index: of the lane.
      rooms: to the left and to the right of the ego, beside who is alongside [m].
    """
    return bool(is_blocked(offset_from(vehicle, index), *rooms))


def is_refused(vehicle, before, target, rooms: tuple[float, float]) -> bool:
    """Is a change from one lane to another blocked, or does it come half-way through another?"""
    if target == before or target[:2] != before[:2]:
        return False
    offsets = offset_from(vehicle, vehicle.lane_index), offset_from(vehicle, before)
    return bool(turns_back(*offsets, target[2] - before[2]) or is_way_blocked(vehicle, target, rooms))


def reachable(vehicle, rooms: tuple[float, float]):
    """Lane that a car can get to: its target, one on the way, the one it is on, or the one it has come from."""
    here, target = vehicle.lane_index, vehicle.target_lane_index
    if target[:2] != here[:2]:
        return target
    for i in range(target[2], here[2], 1 if here[2] > target[2] else -1):
        if not is_way_blocked(vehicle, (*here[:2], i), rooms):
            return (*here[:2], i)
    if target != here or not is_way_blocked(vehicle, here, rooms):
        return here
    offset = offset_from(vehicle, here)
    if abs(offset) <= OFF_CENTRE:
        return target
    start, end, i = here
    i += 1 if offset > 0.0 else -1
    if not 0 <= i < len(vehicle.road.network.graph[start][end]) or is_way_blocked(vehicle, (start, end, i), rooms):
        return target
    return start, end, i
