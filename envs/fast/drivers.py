"""What each vehicle decides on a frame: speed and steering controllers, IDM, MOBIL, route following.

Vehicles decide one after the other, and later ones see the target lanes of earlier ones. So does a shield that goes by
plans, in the ego's turn.
"""

import numpy as np
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield.envs._numpy.floats import clip, dot, not_zero
from rss_shield.envs._numpy.ufuncs import power, power_each
from rss_shield.envs.fast.linear_drivers import linear_acceleration, linear_steering
from rss_shield.envs.fast.sight import car_ahead, car_behind, locate
from rss_shield.envs.fast.state import DIRECT, META, OBSTACLE, TRAFFIC
from rss_shield.envs.roads.hostile import NO_VICE, harass, hostile_command
from rss_shield.envs.roads.network import distance, heading_at, is_after_end, is_reachable, local_coordinates, position
from rss_shield.envs.roads.steering import is_aligned, steer
from rss_shield.shield._numba.compiled import inner, part

LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER = range(5)  # as in `DiscreteMetaAction.ACTIONS_ALL`

_KP_ACCELERATION = ControlledVehicle.KP_A  # [1/s]


@inner
def list_changing(cars, n, sight):
    """Fill `sight.changing` with the cars that head for another lane; returns how many."""
    changing = np.int64(0)
    for i in range(n):
        sight.changing[changing] = i
        changing += cars[i].target_lane != cars[i].lane
    return changing


@inner
def note_change(cars, i, changing, sight):
    """Take car `i` into the list of `list_changing`, if it heads for another lane by now; returns how many do."""
    if cars[i].target_lane == cars[i].lane:
        return changing
    for b in range(changing):
        if sight.changing[b] == i:
            return changing
    sight.changing[changing] = i
    return changing + 1


@inner
def decide(cars, first, last, n, ego, changing, net, lanes, sight, idm):
    """Commands of the vehicles `first` to `last` - 1 for one frame.

    In four passes, each with little to foretell for the processor. Only the third sees what others decided. Whoever is
    hostile then does something else.

    Args:
      cars: `[N]` CAR.
      n: road users.
      ego: index of the controlled vehicle, if there is one yet.
      changing: how many cars change lanes, see `list_changing`.
      net, lanes: the network and its LANE records.
      sight: this frame's, with the cars lined up.
      idm: CONFIG, parameters of the traffic.

    Returns:
      `changing`, with those that have just begun.
    """
    _speed_up(cars, first, last, lanes, sight, idm, sight.linear)
    busy = _follow(cars, first, last, n, net, lanes, sight, idm)
    changing = _change_lanes(cars, busy, n, changing, net, lanes, sight, idm)
    _carry_out(cars, first, last, lanes, sight, idm, sight.linear)
    if idm.vice != NO_VICE:
        _do_harm(cars, first, last, ego, lanes, idm)
    return changing


@inner
def _speed_up(cars, first, last, lanes, sight, idm, linear):
    """Accelerations on a free road, which linear drivers do not ask for."""
    if linear is None:
        _speed_up_idm(cars, first, last, lanes, sight, idm)


@inner
def _speed_up_idm(cars, first, last, lanes, sight, idm):
    count = 0
    for i in range(first, last):
        sight.some[count] = i
        count += _is_in_traffic(cars[i])
    for b in range(count):
        car = cars[sight.some[b]]
        sight.x[b], sight.y[b] = _speed_ratio(car, lanes), car.delta
    power_each(sight.x, sight.y, sight.z, count)
    for b in range(count):
        sight.free[sight.some[b]] = idm.comfort_acc_max * (1 - sight.z[b])


@inner
def _follow(cars, first, last, n, net, lanes, sight, idm):
    """Accelerate behind the car ahead; returns how many may do more than that, listed in `sight.some`."""
    busy = 0
    for i in range(first, last):
        car, k = cars[i], cars[i].target_lane
        if _is_in_traffic(car):
            locate(k, i, cars, lanes, sight)
            ahead = car_ahead(car.lane, i, n, net, lanes, sight)
            sight.wanted[i] = _behind(cars, i, ahead, sight.free[i], lanes, sight.s, idm, sight.linear)
            sight.some[busy] = i
            thinks = car.changes_lane & (idm.lane_change_delay < car.timer)
            busy += thinks | (k != car.lane) | is_after_end(lanes[k], sight.s[k, i])
        elif car.kind == META:
            sight.some[busy] = i
            busy += 1
    return busy


@inner
def _change_lanes(cars, busy, n, changing, net, lanes, sight, idm):
    """Follow roads, and begin, go on with or give up lane changes, one car after the other; returns `changing`."""
    for b in range(busy):
        i = sight.some[b]
        car = cars[i]
        settled = car.target_lane == car.lane
        follow_road(cars, i, net, lanes, sight)
        if car.kind == META:
            sight.wanted[i] = _KP_ACCELERATION * (car.target_speed - car.speed)
            continue
        # who changes its mind asks for accelerations more than once, on which only the car ahead differs
        free = sight.free[i]
        if car.changes_lane:
            _change_lane(cars, i, n, changing, free, sight.wanted[i], net, lanes, sight, idm)
        if car.lane != car.target_lane:
            ahead = car_ahead(car.target_lane, i, n, net, lanes, sight)
            there = _behind(cars, i, ahead, free, lanes, sight.s, idm, sight.linear)
            sight.wanted[i] = min(sight.wanted[i], there)
            if settled:
                sight.changing[changing] = i
                changing += 1
    return changing


@inner
def _carry_out(cars, first, last, lanes, sight, idm, linear):
    """Commands for what was decided."""
    turning = 0
    for i in range(first, last):
        car, k = cars[i], cars[i].target_lane
        in_traffic = _is_in_traffic(car)
        if in_traffic or car.kind == META:
            a = sight.wanted[i]
            car.acceleration = clip(a, -idm.acc_max, idm.acc_max) if in_traffic else a
            car.steering = 0.0
            sight.some[turning] = i
            turning += not is_aligned(lanes[k], sight.s[k, i], sight.lateral[k, i], car.heading, car.speed)
    steer(cars, turning, lanes, sight)
    if linear is not None:
        _steer_linear(cars, first, last, lanes, sight, linear)


@part
def _steer_linear(cars, first, last, lanes, sight, linear):
    for i in range(first, last):
        car, k = cars[i], cars[i].target_lane
        if _is_in_traffic(car):
            car.steering = linear_steering(car, lanes[k], sight.s[k, i], sight.lateral[k, i], linear[5])


@part
def _do_harm(cars, first, last, ego, lanes, idm):
    """What hostile drivers do instead: `envs.highway.hostile.HostileVehicle.act`."""
    victim = cars[ego]
    if victim.kind != META and victim.kind != DIRECT:
        return
    its = lanes[victim.lane]
    s, y = local_coordinates(its, victim.x, victim.y)
    for i in range(first, last):
        car = cars[i]
        if car.vice == NO_VICE or not _is_in_traffic(car):
            continue
        s_own, y_own = local_coordinates(its, car.x, car.y)
        here = heading_at(lanes[car.lane], local_coordinates(lanes[car.lane], car.x, car.y)[0])
        mirrored = np.cos(heading_at(its, s) - here) < 0.0
        wanted = harass(car.vice, s_own - s, y_own - y, car.speed, victim.speed, car.timer, car.acceleration)
        command = hostile_command(car.vice, idm.bounded, wanted, car.speed, car.heading - here, mirrored, car.steering)
        car.acceleration, car.steering = command


@inner
def _is_in_traffic(car):
    """Is it driven by IDM and MOBIL, and not a wreck?"""
    return (car.kind == TRAFFIC) & (not car.crashed)


# ---------------------------------------------------------------- the controlled vehicle


@part
def take_meta_action(cars, i, action, net, lanes, sight, target_speeds):
    """Change the target speed or lane of the car, as `MDPVehicle.act` does with a label."""
    car = cars[i]
    last = len(target_speeds) - 1
    if action in (FASTER, SLOWER):
        change = 1 if action == FASTER else -1
        car.speed_index = int(clip(speed_to_index(car.speed, target_speeds) + change, 0, last))
        car.target_speed = target_speeds[car.speed_index]
    follow_road(cars, i, net, lanes, sight)
    if action in (LANE_LEFT, LANE_RIGHT):
        target = lanes[car.target_lane]
        step = 1 if action == LANE_RIGHT else -1
        lane = car.target_lane + int(clip(target.id + step, 0, target.siblings - 1)) - target.id
        if is_reachable(lanes[lane], sight.s[lane, i], sight.lateral[lane, i]):
            car.target_lane = lane


@inner
def speed_to_index(speed, target_speeds):
    """Index of the target speed nearest to `speed`, the speeds being evenly spaced."""
    last = len(target_speeds) - 1
    x = (speed - target_speeds[0]) / (target_speeds[last] - target_speeds[0])
    return int(clip(np.rint(x * last), 0, last))


# ---------------------------------------------------------------- routes


@inner
def follow_road(cars, i, net, lanes, sight):
    """At the end of the target lane, head for the next one."""
    car = cars[i]
    k = car.target_lane
    locate(k, i, cars, lanes, sight)
    if is_after_end(lanes[k], sight.s[k, i]):
        k = _next_lane(car, sight.s[k, i], net, lanes)
        car.target_lane = k
        locate(k, i, cars, lanes, sight)


@inner
def route_length(net, route):
    """Number of steps of a route."""
    length = 0
    while length < net.route_roads.shape[1] and net.route_roads[route, length] >= 0:
        length += 1
    return length


@inner
def _next_lane(car, s, net, lanes):
    """Lane that continues the target lane: along the route, else the nearest one."""
    k = car.target_lane
    road = lanes[k].road
    next_road, next_id = -1, -1
    if car.route >= 0:
        length = route_length(net, car.route)
        if car.route_step < length and net.route_roads[car.route, car.route_step] == road:
            car.route_step += 1
        if car.route_step < length:
            step = net.route_roads[car.route, car.route_step]
            if net.roads[step].origin == net.roads[road].end:
                next_road, next_id = step, net.route_lanes[car.route, car.route_step]
    x, y = position(lanes[k], s, 0.0)
    if next_road >= 0:
        lane, _ = _lane_on(next_road, next_id, k, x, y, net, lanes)
        return lane
    nearest, best = k, np.inf
    for m in range(net.next_roads.shape[1]):
        if net.next_roads[road, m] < 0:
            break
        lane, far = _lane_on(net.next_roads[road, m], -1, k, x, y, net, lanes)
        if far < best:
            nearest, best = lane, far
    return nearest


@inner
def _lane_on(road, lane_id, k, x, y, net, lanes):
    """Lane of the next road to take from lane `k`, and its distance to a point [m]."""
    first = net.roads[road].first
    if net.roads[road].lanes == lanes[k].siblings:
        lane = first + (lane_id if lane_id >= 0 else lanes[k].id)
        s, lateral = local_coordinates(lanes[lane], x, y)
        return lane, distance(lanes[lane], s, lateral)
    nearest, best = first, np.inf
    for lane in range(first, first + net.roads[road].lanes):
        s, lateral = local_coordinates(lanes[lane], x, y)
        far = distance(lanes[lane], s, lateral)
        if far < best:
            nearest, best = lane, far
    return nearest, best


# ---------------------------------------------------------------- traffic: IDM and MOBIL


@inner
def _behind(cars, i, ahead, free, lanes, s, idm, linear):
    """Acceleration of car `i` behind another, -1 = none; `free` is IDM's on a free road [m/s^2]."""
    if linear is None:
        wanted = free - _interaction(cars, i, ahead, lanes, s, idm)
    else:
        wanted = linear_acceleration(cars[i], cars, i, ahead, lanes, s, idm)
    return wanted


@inner
def _speed_ratio(car, lanes):
    """Speed over the speed that a car wants on its lane."""
    target = 0.0 if car.kind == DIRECT else car.target_speed
    target = clip(target, 0.0, lanes[car.lane].speed_limit)
    return max(car.speed, 0.0) / abs(not_zero(target))


@inner
def _interaction(cars, i, ahead, lanes, s, idm):
    """What car `ahead`, -1 = none, takes from the acceleration of car `i` on a free road (IDM) [m/s^2]."""
    if ahead < 0:
        return 0.0
    car = cars[i]
    there = s[car.lane, ahead]
    if np.isnan(there):
        there, _ = local_coordinates(lanes[car.lane], cars[ahead].x, cars[ahead].y)
    gap = there - s[car.lane, i]
    ratio = desired_gap(cars, i, ahead, idm) / not_zero(gap)
    return idm.comfort_acc_max * (ratio * ratio)


@inner
def _has_to_brake(cars, i, ahead, lanes, s, idm, linear):
    """Would car `i`, -1 = none, brake harder behind car `ahead`, who asks, than a change of lanes may impose on it?"""
    if linear is None:
        brakes = _has_to_brake_idm(cars, i, ahead, cars[ahead].delta, lanes, s, idm)
    else:
        brakes = linear_acceleration(cars[ahead], cars, i, ahead, lanes, s, idm) < -idm.max_braking_imposed
    return brakes


@inner
def _has_to_brake_idm(cars, i, ahead, delta, lanes, s, idm):
    """Would car `i`, -1 = none, brake harder behind car `ahead` than a change of lanes may impose on it?

    `delta` is the exponent of whoever asks. The power is left out where the answer does not depend on it.
    """
    if i < 0 or cars[i].kind == OBSTACLE:
        return -idm.max_braking_imposed > 0.0
    taken, ratio = _interaction(cars, i, ahead, lanes, s, idm), _speed_ratio(cars[i], lanes)
    if idm.comfort_acc_max - taken < -idm.max_braking_imposed:
        return True
    if ratio <= 1.0 and -taken >= -idm.max_braking_imposed:
        return False
    return idm.comfort_acc_max * (1 - power(ratio, delta)) - taken < -idm.max_braking_imposed


@inner
def desired_gap(cars, i, ahead, idm):
    """Distance that car `i` wants to the car ahead, centre to centre [m]."""
    car, front = cars[i], cars[ahead]
    approach = dot(
        car.speed * car.cos - front.speed * front.cos,
        car.speed * car.sin - front.speed * front.sin,
        car.cos,
        car.sin,
    )
    return idm.distance_wanted + car.speed * idm.time_wanted + car.speed * approach / idm.gap_braking


@inner
def _change_lane(cars, i, n, changing, free, a, net, lanes, sight, idm):
    """Start a lane change, or give one up.

    Args:
      changing: how many cars change lanes.
      free: the car's acceleration on a free road, a: on its lane [m/s^2].
    """
    car = cars[i]
    if car.lane != car.target_lane:
        if lanes[car.lane].road == lanes[car.target_lane].road:
            _give_way(cars, i, changing, sight, idm)
        return
    if not idm.lane_change_delay < car.timer:
        return
    car.timer = 0.0
    here = car.lane
    for side in (-1, 1):
        k = here + side
        if not 0 <= lanes[here].id + side < lanes[here].siblings:
            continue
        if not is_reachable(lanes[k], sight.s[k, i], sight.lateral[k, i]) or abs(car.speed) < 1:
            continue
        if _is_change_worthwhile(cars, i, k, n, free, a, net, lanes, sight, idm):
            car.target_lane = k


@inner
def _give_way(cars, i, changing, sight, idm):
    """Abort a lane change if somebody close ahead is already changing to the same lane."""
    car = cars[i]
    for m in range(changing):
        j = sight.changing[m]
        other = cars[j]
        if j == i or other.lane == car.target_lane or other.target_lane != car.target_lane:
            continue
        if other.kind != TRAFFIC and other.kind != META:
            continue
        gap = sight.s[car.lane, j] - sight.s[car.lane, i]
        if 0 < gap < desired_gap(cars, i, j, idm):
            car.target_lane = car.lane
            return


@inner
def _is_change_worthwhile(cars, i, k, n, free, a, net, lanes, sight, idm):
    """MOBIL for drivers without politeness: does a change to lane `k` help, and harm nobody?

    `free` and `a` as in `_change_lane`. Most changes do not help, so that is asked first.
    """
    car = cars[i]
    ahead = car_ahead(k, i, n, net, lanes, sight)
    there = _behind(cars, i, ahead, free, lanes, sight.s, idm, sight.linear)
    helps = there - a >= idm.min_acc_gain
    if car.route >= 0 and car.route_step < route_length(net, car.route):
        lane_id = net.route_lanes[car.route, car.route_step]
        if lane_id >= 0:
            here = lanes[car.target_lane].id
            helps = np.sign(lanes[k].id - here) == np.sign(lane_id - here) and there >= -idm.max_braking_imposed
    if not helps:
        return False
    behind = car_behind(k, i, n, net, lanes, sight)
    return not _has_to_brake(cars, behind, i, lanes, sight.s, idm, sight.linear)
