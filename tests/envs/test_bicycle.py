"""The equations of motion that futures are played with, and the law that keeps a car on its lane."""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane
from highway_env.road.road import RoadNetwork
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle
from numba import njit

from rss_shield.envs.highway.free_ego import ROOM
from rss_shield.envs.roads.bicycle import HEADING, SPEED, lane_keeping, move
from rss_shield.envs.roads.network import CAR_LENGTH, compile_network, local_coordinates
from rss_shield.envs.roads.steering import steering_angle
from rss_shield.shield.geometry import wrap_angle

DT, RADIUS = 1 / 15, 9.0


@pytest.mark.parametrize("kind", [Vehicle, BicycleVehicle])
def test_a_frame_is_the_simulators(kind):
    rng = np.random.default_rng(0)
    dynamical = kind is BicycleVehicle
    for _ in range(500):
        vehicle = kind(None, rng.normal(size=2), rng.uniform(-3.0, 3.0), rng.uniform(0.0, 12.0))
        if dynamical:
            vehicle.lateral_speed, vehicle.yaw_rate = rng.normal(0.0, (1.0, 4.0))
        state = state_of(vehicle)
        acceleration, steering = rng.uniform(-8.0, 6.0), rng.uniform(-1.6, 1.6)
        vehicle.act({"acceleration": acceleration, "steering": steering})
        vehicle.step(DT)
        move(state, acceleration, steering, dynamical, DT)
        np.testing.assert_allclose(state, state_of(vehicle), rtol=0.0, atol=1e-12)
        assert state[SPEED] == vehicle.speed


def state_of(vehicle):
    slide = (vehicle.lateral_speed, vehicle.yaw_rate) if isinstance(vehicle, BicycleVehicle) else (0.0, 0.0)
    return np.array([*vehicle.position, vehicle.heading, vehicle.speed, *slide], float)


@pytest.fixture(scope="module")
def turn():
    network = RoadNetwork()
    network.add_lane("a", "b", CircularLane((0.0, 0.0), RADIUS, 0.0, 3 * np.pi, speed_limit=10.0))
    return compile_network(network, False).lanes[0]


def stop_and_go(lane, law, speed):
    """Largest distance from the lane and angle to it [m, rad] of a dynamical bicycle that stops twice in a turn."""
    state = np.array([RADIUS, 0.0, np.pi / 2, speed, 0.0, 0.0])
    off = angle = 0.0
    for _ in range(2):
        for a in [0.0] * 20 + [-5.0] * 60 + [5.0] * int(speed / 5.0 / DT):
            acceleration = max(a, -state[SPEED] / DT) if a < 0.0 else min(a, (speed - state[SPEED]) / DT)
            move(state, acceleration, law(lane, state, acceleration), True, DT)
            off = max(off, abs(local_coordinates(lane, state[0], state[1])[1]))
            tangent = np.arctan2(state[1], state[0]) + np.pi / 2
            angle = max(angle, abs(wrap_angle(state[HEADING] - tangent)))
    return off, angle


def own(lane, state, acceleration):
    return lane_keeping(lane, state, acceleration, True, DT)


@njit
def of_drivers(lane, state, acceleration):
    s, lateral = local_coordinates(lane, state[0], state[1])
    return steering_angle(lane, s, lateral, state[HEADING], state[SPEED], CAR_LENGTH)


@pytest.mark.parametrize("speed", [5.0, 7.0, 9.0])
def test_a_bicycle_that_slides_stops_and_starts_on_its_lane(turn, speed):
    off, angle = stop_and_go(turn, own, speed)
    assert off < ROOM
    assert angle < 0.6


def test_the_law_of_kinematic_drivers_would_not_do(turn):
    """Between 1 and 3.7 m/s the simulator's step is too long for the tyres, and its cars turn by themselves."""
    worse = [stop_and_go(turn, of_drivers, speed) for speed in (5.0, 7.0, 9.0)]
    better = [stop_and_go(turn, own, speed) for speed in (5.0, 7.0, 9.0)]
    assert max(angle for _, angle in worse) > 1.5 * max(angle for _, angle in better)
