"""A car whose tyres slip, along lanes: steering keeps its speed across the lane inside the limits of the shield."""

import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import PRESETS, Rules, make
from rss_shield.envs.highway.sliding_ego import FLUCTUATION, SlidingEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.bicycle import across, frame_across, longest_frame, move, steer_along
from rss_shield.envs.worlds.random_roads import Element, Pose, lane_beside
from rss_shield.shield.geometry import make_road
from rss_shield.shield.table import table_for

HERTZ = 60
DT = 1 / HERTZ
ROAD = make_road([(0.0, 0.0, 0.0, 0.0, 5000.0, 0.0)])
FREELY = np.inf, np.inf, np.inf, np.inf
DYNAMICAL = {"action": {"type": "ContinuousAction", "dynamical": True}, "simulation_frequency": HERTZ}
GOOD = ("", "other", "inherited")


def state_of(speed, psi=0.0, lateral=0.0, rate=0.0):
    return np.array([0.0, 0.0, psi, speed, lateral, rate])


# ---------------------------------------------------------------- steering


@pytest.mark.parametrize("speed", [2.0, 5.0, 12.0, 25.0, 40.0])
@pytest.mark.parametrize("braking", [0.0, 5.0])
def test_a_limit_that_falls_as_in_def_8_is_kept_to_rest(speed, braking):
    """From 0.05 rad off, with the limit w + a rho for 8 frames and then 1.5 m/s less every second, to 0."""
    state = state_of(speed, 0.05)
    w = across(ROAD, state)[0]
    assert w == pytest.approx(speed * np.sin(0.05))
    for n in range(300):
        limit, following = (max(w + 0.13 - max(k - 8, 0) * 1.5 * DT, 0.0) for k in (n, n + 1))
        a = max(-braking, -state[3] / DT)
        steering = steer_along(ROAD, state, a, 0.0, (0.2, limit, 0.2, following), 0.3, DT)
        during, _, _ = frame_across(ROAD, state, a, steering, DT)
        if state[3] > 1.0:  # below that steering has no effect
            assert during <= limit + FLUCTUATION and during >= -0.2 - FLUCTUATION
        assert abs(during) < 0.15 or state[3] > 1.0
        move(state, a, steering, True, DT)


def test_what_keeps_its_limits_is_left_alone():
    state = state_of(20.0, 0.01)
    for wish in (-0.01, 0.0, 0.003):
        assert steer_along(ROAD, state, 0.0, wish, (1.0, 1.0, 1.0, 1.0), 0.3, DT) == wish


@pytest.mark.parametrize("wish", [-0.7, 0.7])
@pytest.mark.parametrize("speed", [3.0, 10.0, 30.0])
def test_whatever_an_agent_steers_its_speed_across_grows_no_faster_than_allowed(speed, wish):
    state = state_of(speed)
    for _ in range(200):
        now = across(ROAD, state)[0]
        left, right = max(-now, 0.0) + DT, max(now, 0.0) + DT
        steering = steer_along(ROAD, state, 0.0, wish, (left, right, left, right), 0.3, DT)
        during, after, psi = frame_across(ROAD, state, 0.0, steering, DT)
        assert -left - 1e-3 <= after <= right + 1e-3 and -left - 1e-3 <= during <= right + 1e-3
        assert abs(np.sin(psi)) < 0.32
        move(state, 0.0, steering, True, DT)
    assert np.sign(state[1]) == np.sign(wish)


def test_a_frame_across_is_what_the_simulator_does():
    lane = RoadNetwork.straight_road_network(1, length=5000.0)
    for speed, psi, slide, rate, steering, a in ((20.0, 0.05, 0.3, -0.1, 0.1, -3.0), (3.0, -0.1, -0.1, 0.2, -0.4, 1.0)):
        car = BicycleVehicle(Road(lane), [10.0, 0.0], psi, speed)
        car.lateral_speed, car.yaw_rate = slide, rate
        state = np.array([10.0, 0.0, psi, speed, slide, rate])
        during, after, turned = frame_across(ROAD, state, a, steering, DT)
        assert state == pytest.approx([10.0, 0.0, psi, speed, slide, rate])
        car.act({"steering": steering, "acceleration": a})
        car.step(DT)
        assert during == pytest.approx(car.position[1] / DT, abs=1e-9)
        assert turned == pytest.approx(car.heading) and state[3] == speed
        assert after == pytest.approx(car.speed * np.sin(car.heading) + car.lateral_speed * np.cos(car.heading))


def test_frames_that_are_too_long_make_a_slow_car_swing():
    """155 v / v^2 dt < 2.785 at 1 m/s: 56 Hz. With longer frames a yaw rate grows there without any steering."""
    assert 1 / longest_frame() == pytest.approx(155 / 2.785, rel=2e-3)
    for hertz, grows in ((50, True), (60, False)):
        state = state_of(1.02, rate=0.01)
        for _ in range(20):
            move(state, 0.0, 0.0, True, 1 / hertz)
        assert (abs(state[5]) > 0.01) == grows


# ---------------------------------------------------------------- the shield


def beside(gap, speed=20.0, toward=0.0):
    """The ego on a wide road, and a car beside it on the right that comes nearer at `toward` [m/s]."""
    network = RoadNetwork()
    network.add_lane("a", "b", lane_beside(Pose(0.0, 0.0, 0.0), Element(0.0, 3000.0), 0.0))
    road = Road(network, np_random=np.random.default_rng(0))
    ego = BicycleVehicle(road, [0.0, 0.0], 0.0, speed)
    other = Vehicle(road, [0.0, gap + 2.0], -np.arcsin(toward / speed), speed)
    road.vehicles += [ego, other]
    table = table_for(PRESETS["simulator"], Rules(anticipation=0.0), DT)
    return road, SlidingEgo(ego, Settings(table, True), record=True), other


@pytest.mark.parametrize("toward", [0.0, 0.3])
def test_an_agent_that_steers_into_who_is_beside_it_does_not_get_there(toward):
    road, ego, other = beside(3.0, toward=toward)
    ego.vehicle.act({"steering": 0.4, "acceleration": 0.0})
    for _ in range(600):
        road.act()
        road.step(DT)
        if toward and other.position[1] - ego.vehicle.position[1] < 2.6:
            other.heading = 0.0  # enough
        if ego.check_contact():
            break
    assert not ego.has_contact and ego.since["broken_duties"] == 0
    assert ego.since["frames_overridden"] > 0
    assert ego.vehicle.position[1] > 0.05, "it was let go as far as there was room"


def test_who_brakes_for_a_wall_with_its_wheels_turned_stays_on_its_lane():
    road, ego, _ = beside(40.0, speed=25.0)
    road.vehicles.append(Vehicle(road, [150.0, 0.0], 0.0, 0.0))
    ego.vehicle.act({"steering": 0.3, "acceleration": 3.0})
    for _ in range(900):
        road.act()
        road.step(DT)
    assert not ego.has_contact and ego.since["broken_duties"] == 0


def test_the_audit_of_the_record_counts_what_the_shield_counted():
    env = make(
        "highway-v0", config=DYNAMICAL | {"vehicles_count": 8, "vehicles_density": 2.5, "duration": 5}, record=True
    )
    env.reset(seed=0)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(np.array([1.0, 0.1]))
        done = terminated or truncated
    assert info["blame"] in GOOD and info["episode_broken_duties"] == 0
    audit = env.audit()
    assert audit.dangerous.sum() == info["episode_dangerous_pairs"] and (audit.duty > 0).sum() == 0


def test_longer_frames_are_refused_where_somebody_is():
    with pytest.raises(ValueError, match=r"dynamical = True with config simulation_frequency = 15: expected >= 56"):
        make("highway-v0", config=DYNAMICAL | {"simulation_frequency": 15})


@pytest.mark.parametrize(("option", "value"), [("filter", "ttc"), ("correction", "response")])
def test_what_steers_by_slip_is_refused(option, value):
    with pytest.raises(ValueError, match=f"{option} = '{value}': expected '(rss|nearest)' with dynamical = True"):
        make("highway-v0", config=DYNAMICAL | {"vehicles_count": 1}, **{option: value})
