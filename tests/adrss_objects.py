"""Road users of Intel's ad-rss-lib with our parameters, for the oracle and the benchmark."""

import warnings

import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it registers one converter twice
    pytest.importorskip("ad_rss", exc_type=ImportError)
    from ad_rss import physics, rss


rss.core.setLogLevel("critical")


def new_object():
    """A road user with everything set that the library wants to see, whether it is used or not."""
    one = rss.core.RelativeObjectState()
    one.object_type = rss.world.ObjectType.OtherVehicle
    settings = one.dynamics.unstructured_settings
    settings.pedestrian_turning_radius = settings.vehicle_min_radius = physics.Distance(3.5)
    settings.drive_away_max_angle = physics.Angle(2.4)
    settings.vehicle_yaw_rate_change = physics.AngularAcceleration(0.3)
    settings.vehicle_trajectory_calculation_step = physics.Duration(0.2)
    box = one.unstructured_object_state
    box.yaw = box.steering_angle = physics.Angle(0.0)
    box.yaw_rate = physics.AngularVelocity(0.0)
    box.dimension.length, box.dimension.width = physics.Distance(5.0), physics.Distance(2.0)
    box.center_point.x = box.center_point.y = physics.Distance(0.0)
    box.speed_range.minimum = box.speed_range.maximum = physics.Speed(0.0)
    one.structured_object_state.is_in_correct_lane = True
    one.structured_object_state.distance_to_enter_intersection = physics.Distance(1000.0)
    one.structured_object_state.distance_to_leave_intersection = physics.Distance(1000.0)
    return one


def become(one, params, lon=0.0, lat=0.0):
    """Give one of the library's objects our parameters and a velocity."""
    dynamics, velocity = one.dynamics, one.structured_object_state.velocity
    dynamics.response_time = physics.Duration(params.response_time)
    dynamics.max_speed_on_acceleration = physics.Speed(params.v_cap)
    dynamics.min_longitudinal_safety_distance = physics.Distance(params.standstill_gap)
    dynamics.lateral_fluctuation_margin = physics.Distance(params.mu)
    dynamics.alpha_lon.accel_max = physics.Acceleration(params.a_max_accel)
    dynamics.alpha_lon.brake_max = physics.Acceleration(-params.a_max_brake)
    dynamics.alpha_lon.brake_min = physics.Acceleration(-params.a_min_brake)
    dynamics.alpha_lon.brake_min_correct = physics.Acceleration(-params.a_min_brake_correct)
    dynamics.alpha_lat.accel_max = physics.Acceleration(params.a_lat_max_accel)
    dynamics.alpha_lat.brake_min = physics.Acceleration(-params.a_lat_min_brake)
    velocity.speed_lon_min = velocity.speed_lon_max = physics.Speed(lon)
    velocity.speed_lat_min = velocity.speed_lat_max = physics.Speed(lat)
    return one


def open_space_pair(params, ego, other):
    """A pair of road users in open space (of `shield.definitions.occupancy.Mover`) as the library wants it."""
    pair = rss.core.RelativeConstellation()
    pair.constellation_id, pair.ego_id, pair.object_id = 1, 1, 2
    pair.constellation_type = rss.world.ConstellationType.Unstructured
    states = []
    for mover, kind in ((ego, rss.world.ObjectType.EgoVehicle), (other, rss.world.ObjectType.OtherVehicle)):
        one = become(new_object(), params, lon=mover.v)
        one.object_type = kind
        box = one.unstructured_object_state
        box.yaw, box.steering_angle = physics.Angle(mover.heading), physics.Angle(0.0)
        box.yaw_rate = physics.AngularVelocity(mover.yaw_rate)
        box.dimension.length = physics.Distance(2 * mover.half_length)
        box.dimension.width = physics.Distance(2 * mover.half_width)
        box.center_point.x, box.center_point.y = physics.Distance(mover.x), physics.Distance(mover.y)
        box.speed_range.minimum = box.speed_range.maximum = physics.Speed(mover.v)
        states.append(one)
    pair.ego_state, pair.other_state = states
    return pair


def judge_open_space(pair):
    """Whether the library calls a pair in open space safe, looked at for the first time."""
    state = rss.state.RssState()
    checker = rss.unstructured.RssUnstructuredConstellationChecker()
    information = rss.state.UnstructuredConstellationStateInformation()
    assert checker.calculateRssStateUnstructured(1, pair, information, state)
    return state.unstructured_constellation_state.is_safe
