"""The small pieces that everything else leans on, with numbers by hand."""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.shield._numba.compiled import compiled
from rss_shield.shield.definitions.response import LAT, LON, NEITHER
from rss_shield.shield.geometry import make_road
from rss_shield.shield.junctions.reach import THREAT, farthest, fastest, nearest
from rss_shield.shield.lanes.frame import to_lane_frame
from rss_shield.shield.lanes.judge import judge_contact
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import MEMORY, forget_safe
from rss_shield.shield.lanes.pair import ROAD_USER, leading_speed, toward
from rss_shield.shield.params import PRESETS, Rules, Table
from rss_shield.shield.verdicts import EGO, INHERITED, TOO_WEAK

CAR = PRESETS["simulator"].ego  # accelerates at 3, brakes at 5 to 6 m/s^2; lateral 1 and 1.5; at most 40 m/s
DT = 0.2


def user(**fields):
    record = np.zeros(1, ROAD_USER)[0]
    record["half_length"], record["half_width"], record["cos"], record["in_own_lane"] = 2.5, 1.0, 1.0, True
    for name, value in fields.items():
        record[name] = value
    return record


# ---------------------------------------------------------------- limits that always hold


@pytest.mark.parametrize(
    ("speed", "upper"), [(20.0, 3.0), (39.4, 3.0), (39.5, 2.5), (39.9, 0.5), (40.0, 0.0), (45.0, 0.0)]
)
def test_nobody_speeds_up_beyond_the_speed_cap(speed, upper):
    # within a frame of 0.2 s: (40 - 39.9) / 0.2
    bounds = always_on(user(speed=speed), CAR, Rules(), DT)
    assert bounds.a_upper == pytest.approx(upper)
    assert bounds.a_lower == -6.0


def test_the_lateral_speed_may_grow_by_one_frame_of_acceleration():
    bounds = always_on(user(speed=20.0, u=0.7), CAR, Rules(), DT)
    assert (bounds.left, bounds.right) == pytest.approx((0.2, 0.9))


# ---------------------------------------------------------------- speeds


def test_the_lateral_speed_of_the_last_frame_counts_in_full():
    assert toward(1.0, user(u=0.8)) == 0.8
    assert toward(-1.0, user(u=-0.6)) == 0.6
    # or the one that the heading commits to, where that is more: 20 m/s * 0.05
    assert toward(1.0, user(u=0.8, speed=20.0, sin=0.05)) == pytest.approx(1.0)


def test_the_lateral_speed_is_the_displacement_across_the_lane_over_a_frame():
    road = make_road([(0.0, 0.0, 0.0, 0.0, 100.0, 0.0)])
    record = user()
    # from (10, 1.0) to (14, 1.3) in 0.2 s
    to_lane_frame(road, 14.0, 1.3, 0.0, 20.0, 1.0, 0.0, 10.0, 1.0, np.array([5.0, 2.0, 2.5, 1.2]), DT, record)
    assert record["u"] == pytest.approx(1.5)
    assert record["along"] == pytest.approx(20.0)


def test_a_wreck_ahead_may_stop_on_the_spot():
    assert leading_speed(user(speed=10.0), Rules()) == pytest.approx(10.0 * np.sqrt(0.99))
    assert leading_speed(user(speed=10.0, wreck=True), Rules()) == 0.0
    assert leading_speed(user(speed=-2.0, wreck=True), Rules()) == pytest.approx(-2.0 * np.sqrt(0.99))


# ---------------------------------------------------------------- where others may be on their paths


@compiled
def _least(threat, t, other):
    return nearest(threat, t, other)


@compiled
def _top(threat, t, other):
    return fastest(threat, t, other)


def threat(**fields):
    record = np.zeros(1, THREAT)[0]
    record["s"], record["cap"] = 50.0, 10.0
    for name, value in fields.items():
        record[name] = value
    return record


OTHER = PRESETS["intersection"].other  # accelerates and brakes at 6 m/s^2


def test_who_brakes_gets_no_farther_and_may_cut_its_corners():
    # 9 m/s for 1 s at -6: 6 m; to rest: 81 / 12 m; less a twentieth for corners cut, 1 m at most
    assert _least(threat(v=9.0), 1.0, OTHER) == pytest.approx(50.0 + 6.0 - 0.3)
    assert _least(threat(v=9.0), 8.0, OTHER) == pytest.approx(50.0 + 6.75 * 0.95)
    assert _least(threat(v=20.0), 8.0, OTHER) == pytest.approx(50.0 + 400 / 12 - 1.0)
    assert _least(threat(v=-1.0), 0.5, OTHER) == pytest.approx(49.5)


def test_who_speeds_up_gets_farther_and_may_cut_its_corners_too():
    # from rest at 6 m/s^2: 3 m in 1 s; a twentieth more
    assert farthest(threat(), 1.0, OTHER) == pytest.approx(50.0 + 3.0 * 1.05)
    # 10 m/s after 5/3 s and 25/3 m, then steady
    assert farthest(threat(), 4.0, OTHER) == pytest.approx(50.0 + 25 / 3 + 10.0 * (4 - 5 / 3) + 1.0)


def test_who_waits_at_a_light_stays_behind_its_line_and_then_starts_or_comes_up_to_it():
    # half a second after it may go, 3 m short of the line: (6 + 5) * 0.25 / 2 behind it; without the light 14.25 m
    waits = threat(v=5.0, cap=30.0, red_for=1.0, line=53.0)
    assert farthest(waits, 1.5, OTHER) == pytest.approx(50.0 + (3.0 + 1.375) * 1.05)
    assert farthest(waits, 1.0, OTHER) == pytest.approx(50.0 + 3.0 * 1.05)
    assert farthest(threat(v=5.0, cap=30.0), 1.5, OTHER) == pytest.approx(50.0 + 14.25 * 1.05)


def test_a_wreck_may_stay_or_roll_on():
    # with a = -v it rolls v m in all
    assert _least(threat(v=4.0, wreck=True), 3.0, OTHER) == 50.0
    assert farthest(threat(v=4.0, wreck=True), 0.1, OTHER) == 54.0


def test_who_follows_may_speed_up_to_the_cap():
    assert _top(threat(v=3.0), 0.5, OTHER) == pytest.approx(6.0)
    assert _top(threat(v=3.0), 5.0, OTHER) == pytest.approx(10.0)
    assert _top(threat(v=12.0), 5.0, OTHER) == pytest.approx(12.0)
    # who is counted on to stand for 2 s creeps at 0.5 m/s until then
    assert _top(threat(stands_for=2.0), 1.0, OTHER) == pytest.approx(0.5)
    assert _top(threat(stands_for=2.0), 3.0, OTHER) == pytest.approx(6.5)
    assert farthest(threat(stands_for=2.0), 3.0, OTHER) == pytest.approx(50.0 + (1.0 + 3.5) * 1.05)


# ---------------------------------------------------------------- memory


def test_what_was_safe_before_a_jump_is_forgotten_and_danger_is_not():
    memory = np.zeros(2, MEMORY)
    memory["age"], memory["axes"], memory["since"] = 9, LON | LAT, [0, 4]
    for record in memory:
        forget_safe(record)
    assert list(memory["axes"]) == [NEITHER, LON | LAT]
    assert list(memory["age"]) == [0, 9]


@pytest.mark.parametrize(("broke", "verdict"), [(0, INHERITED), (TOO_WEAK, EGO)])
def test_danger_from_the_start_is_the_egos_fault_where_it_did_not_answer(broke, verdict):
    memory = np.zeros(1, MEMORY)[0]
    memory["age"], memory["since"], memory["axes"], memory["ego_broke"] = 9, 8, NEITHER, broke
    memory["ego_is_rear"], memory["half_width_ego"], memory["half_width_other"] = True, 1.0, 1.0
    memory["half_length_ego"] = memory["half_length_other"] = 2.5
    memory["v_ego"] = 20.0  # its share: farther than it has got
    ego, other = user(speed=5.0), user(s=5.5)
    assert judge_contact(ego, other, memory, Table(CAR, CAR, Rules(), DT)).verdict == verdict


def shielded(network, position, heading=0.0, speed=20.0):
    road = Road(network, np_random=np.random.default_rng(0))
    vehicle = MDPVehicle(road, position, heading=heading, speed=speed)
    road.vehicles.append(vehicle)
    return road, ShieldedEgo(vehicle, Settings(Table(CAR, PRESETS["simulator"].other, Rules(), 1 / 15), True))


@pytest.mark.parametrize("lanes", [2, 3, 4])
def test_a_lane_change_on_a_straight_road_forgets_nobody(lanes):
    road, ego = shielded(RoadNetwork.straight_road_network(lanes, speed_limit=30), [0.0, 0.0])
    road.vehicles.append(Vehicle(road, [150.0, 0.0], speed=20.0))
    ego.act("LANE_RIGHT")
    frames = 0
    while ego.vehicle.lane_index[2] == 0:
        road.act()
        road.step(1 / 15)
        frames += 1
    road.act()
    assert ego.memory[0]["age"] == frames + 1
    assert ego.memory[0]["axes"] & LON


@pytest.mark.parametrize("radius", [60.0, 90.0, 150.0])
def test_where_the_frame_of_measurement_jumps_what_was_safe_is_forgotten(radius):
    # a ramp turns off beside the road: measured along it, everybody is somewhere else
    network = RoadNetwork()
    network.add_lane("a", "b", StraightLane([0, 0], [300, 0]))
    network.add_lane("a", "c", CircularLane([40, 4 + radius], radius, -np.pi / 2, 0.0))
    road, ego = shielded(network, [60.0, 0.0])
    road.vehicles.append(Vehicle(road, [160.0, 0.0], speed=20.0))
    for _ in range(5):
        road.act()
        road.step(1 / 15)
    assert ego.memory[0]["age"] == 5
    lane = network.get_lane(("a", "c", 0))
    ego.vehicle.lane_index, ego.vehicle.lane = ("a", "c", 0), lane
    ego.vehicle.target_lane_index = ("a", "c", 0)
    road.act()
    assert ego.memory[0]["age"] == 2  # the sample before, as it is in the new frame, and this one
