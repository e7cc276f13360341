"""The road that the shield looks along is the one that the ego drives: rings, forks, short pieces, lanes that end."""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import PRESETS, Rules
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.options import Settings
from rss_shield.envs.roads.lanes import heading_of, reach_of, road_through
from rss_shield.envs.worlds.random_roads import Element, Pose, advance, lane_beside
from rss_shield.shield.definitions.response import NEITHER
from rss_shield.shield.geometry import AROUND, locate, nearest_piece
from rss_shield.shield.params import Table

DT = 1 / 15
TABLE = PRESETS["simulator"]
REACH = reach_of(TABLE.ego, TABLE.other, DT)


def ring(radius, pieces, turn=1, lanes=1):
    """A circle of unequal pieces."""
    network, pose = RoadNetwork(), Pose(3.0, -4.0, 0.7)
    shares = np.arange(1.0, pieces + 1.0)
    for i, share in enumerate(shares / shares.sum()):
        element = Element(turn / radius, 2 * np.pi * radius * share)
        for lane in range(lanes):
            network.add_lane(str(i), str((i + 1) % pieces), lane_beside(pose, element, 4.0 * lane))
        pose = advance(pose, element)
    return network


def chain(elements, names="abcdefghijklmnopqrstuvwxyz", network=None, start=Pose(0.0, 0.0, -0.4), lanes=1):
    network = network or RoadNetwork()
    for origin, end, element in zip(names[:-1], names[1:], elements, strict=False):
        for lane in range(lanes):
            network.add_lane(origin, end, lane_beside(start, element, 4.0 * lane))
        start = advance(start, element)
    return network, start


def fork(order, radius=70.0, before=90.0):
    """A road from a to b, and branches to the left, straight on and to the right in any order."""
    network, end = chain([Element(0.0, before)], "ab")
    for name in order:
        turn = {"l": -1, "s": 0, "r": 1}[name]
        chain([Element(turn / radius, 80.0), Element(0.0, 100.0)], ["b", name, name + name], network, end)
    return network


def road_of(network):
    return Road(network, np_random=np.random.default_rng(0))


def put(road, index, s, speed, kind=Vehicle, **options):
    lane = road.network.get_lane(index)
    car = kind(road, lane.position(s, 0.0), lane.heading_at(s), speed, **options)
    road.vehicles.append(car)
    return car


def shield_on(vehicle, overrides=True, rules=Rules()):
    return ShieldedEgo(vehicle, Settings(Table(TABLE.ego, TABLE.other, rules, DT), overrides), record=True)


def drive(road, ego, frames):
    for _ in range(frames):
        road.act()
        road.step(DT)
        if ego.check_contact():
            break


# ---------------------------------------------------------------- rings


@pytest.mark.parametrize(("radius", "pieces", "turn"), [(60.0, 2, 1), (45.0, 3, -1), (90.0, 7, 1), (150.0, 2, -1)])
def test_a_ring_closes_and_the_way_round_is_its_length(radius, pieces, turn):
    network = ring(radius, pieces, turn)
    for index in network.lanes_dict():
        road = road_through(network, index, 2000.0)
        assert len(road) == pieces
        assert road[:, AROUND] == pytest.approx(np.full(pieces, 2 * np.pi * radius))


@pytest.mark.parametrize(("radius", "pieces", "turn"), [(60.0, 2, 1), (55.0, 3, -1), (120.0, 5, 1), (200.0, 11, -1)])
@pytest.mark.parametrize("ahead", [70.0, 85.0])
def test_the_ego_stops_behind_a_car_parked_across_the_seam_of_a_ring(radius, pieces, turn, ahead):
    road = road_of(ring(radius, pieces, turn))
    index = ("0", str(1 % pieces), 0)
    lane = road.network.get_lane(index)
    vehicle = put(road, index, lane.length - 30.0, 20.0, MDPVehicle)
    ego, place, at = shield_on(vehicle), index, lane.length - 30.0 + ahead
    while at > road.network.get_lane(place).length:
        at -= road.network.get_lane(place).length
        place = (place[1], str((int(place[1]) + 1) % pieces), 0)
    put(road, place, at, 0.0)
    drive(road, ego, 150)
    assert not ego.has_contact and vehicle.speed < 0.05


@pytest.mark.parametrize(("radius", "pieces"), [(50.0, 2), (70.0, 4), (40.0, 6)])
def test_on_a_ring_everybody_is_ahead_or_behind_by_less_than_the_way_round_and_changes_places_only_when_safe(
    radius, pieces
):
    road = road_of(ring(radius, pieces, lanes=2))
    vehicle = put(road, ("0", str(1 % pieces), 0), 5.0, 8.0, MDPVehicle, target_speed=8.0, target_speeds=[8, 12, 16])
    ego = shield_on(vehicle, overrides=False)
    put(road, ("0", str(1 % pieces), 1), 25.0, 22.0, MDPVehicle, target_speed=22.0, target_speeds=[8, 22, 30])
    drive(road, ego, 600)
    gaps = np.array([frame.users["s"][0] - frame.ego["s"] for frame in ego.record])
    steps = np.abs(np.diff(gaps))
    around = np.array([frame.users["around"][0] for frame in ego.record])
    jumps = np.array([frame.jumped[0] for frame in ego.record[1:]]) & (steps > 50.0)
    assert (np.abs(gaps) < around).all()
    assert jumps.any() and (steps[~jumps] < 11.0).all()  # less where the frame moves with the ego to another lane
    assert steps[jumps] == pytest.approx(around[1:][jumps], abs=2.5)


@pytest.mark.parametrize(("radius", "pieces", "turn"), [(40.0, 2, 1), (45.0, 5, -1), (60.0, 3, 1)])
@pytest.mark.parametrize("gap", [-11.0, 11.0])
def test_as_long_as_danger_lasts_who_is_ahead_on_a_ring_stays_ahead(radius, pieces, turn, gap):
    road = road_of(ring(radius, pieces, turn))
    speeds = {"target_speed": 14.0, "target_speeds": [13, 14, 15]}
    vehicle = put(road, ("0", str(1 % pieces), 0), 15.0, 14.0, MDPVehicle, **speeds)
    ego = shield_on(vehicle, overrides=False)
    put(road, ("0", str(1 % pieces), 0), 15.0 + gap, 14.0, MDPVehicle, **speeds)
    drive(road, ego, 600)
    gaps = np.array([frame.users["s"][0] - frame.ego["s"] for frame in ego.record])
    assert len(gaps) == 600 and ego.memory["since"][0] > 500
    assert gaps == pytest.approx(np.full(600, gap), abs=1.0)


@pytest.mark.parametrize(("radius", "pieces", "turn"), [(20.0, 3, 1), (25.0, 2, -1), (30.0, 4, 1)])
def test_in_danger_nobody_is_taken_for_a_follower_who_is_ahead(radius, pieces, turn):
    road = road_of(ring(radius, pieces, turn))
    vehicle = put(road, ("0", str(1 % pieces), 0), 4.0, 9.0, MDPVehicle)
    ego = shield_on(vehicle, overrides=False)
    other = put(road, ("0", str(1 % pieces), 0), 14.0, 3.0)
    drive(road, ego, 2)
    assert ego.memory["since"][0] > 0
    other.speed = 40.0  # all the way round it would not be far enough behind
    drive(road, ego, 1)
    gap = ego.record[-1].users["s"][0] - ego.record[-1].ego["s"]
    assert len(ego.record) == 3 and 0.0 < gap < 15.0


@pytest.mark.parametrize(("radius", "length"), [(70.0, 1.2), (120.0, 1.0), (60.0, 1.3)])
@pytest.mark.parametrize("turn", [-1, 1])
def test_a_danger_that_begins_on_another_piece_of_the_road_is_not_inherited(radius, length, turn):
    """The frame before counts as it is along the new piece, and the ego is on a new one on every frame here."""
    names = [str(i) for i in range(int(130.0 / length) + 1)]
    network, _ = chain([Element(turn / radius, length)] * (len(names) - 1), names)
    road = road_of(network)
    vehicle = put(road, (names[3], names[4], 0), 0.5, 20.0, MDPVehicle, target_speed=20.0)
    ego = shield_on(vehicle, rules=Rules(anticipation=0.0))
    ahead = 3 + int(95.0 / length)
    put(road, (names[ahead], names[ahead + 1], 0), 0.5, 0.0)
    dangers = []
    for _ in range(120):
        drive(road, ego, 1)
        if ego.memory["since"][0] > 0:
            dangers.append(ego.memory["axes"][0])
    assert not ego.has_contact and vehicle.speed < 0.05
    assert dangers and NEITHER not in dangers


# ---------------------------------------------------------------- forks


@pytest.mark.parametrize("order", ["lr", "rl", "slr", "rls", "lsr"])
@pytest.mark.parametrize("after", [8.0, 25.0, 60.0])
def test_the_ego_stops_behind_a_car_that_is_parked_on_its_branch(order, after):
    for branch in order:
        road = road_of(fork(order))
        vehicle = put(road, ("a", "b", 0), 10.0, 20.0, MDPVehicle).plan_route_to(branch + branch)
        ego = shield_on(vehicle)
        put(road, ("b", branch, 0), after, 0.0)
        drive(road, ego, 150)
        assert not ego.has_contact and vehicle.speed < 0.05


@pytest.mark.parametrize("order", ["lr", "rl", "srl"])
def test_a_car_that_is_parked_on_another_branch_is_not_in_the_way(order):
    for branch in order:
        road = road_of(fork(order))
        vehicle = put(road, ("a", "b", 0), 10.0, 20.0, MDPVehicle).plan_route_to(branch + branch)
        ego = shield_on(vehicle)
        for other in set(order) - {branch}:
            put(road, ("b", other, 0), 32.0, 0.0)
        drive(road, ego, 110)
        assert not ego.has_contact and min(frame.ego["speed"] for frame in ego.record) > 18.0


@pytest.mark.parametrize(("order", "branch"), [("lr", "l"), ("lr", "r"), ("srl", "l"), ("lsr", "r")])
def test_who_has_no_route_reckons_with_every_branch(order, branch):
    network = fork(order)
    road = road_through(network, ("a", "b", 0), REACH)
    lane = network.get_lane(("b", branch, 0))
    s, y, *_ = locate(road, *lane.position(50.0, 0.3))
    assert (s, y) == pytest.approx((140.0, 0.3))


@pytest.mark.parametrize(("order", "branch", "along"), [("lr", "l", 4.0), ("rl", "l", 9.0), ("slr", "r", 6.0)])
def test_where_branches_lie_on_top_of_each_other_the_ego_is_on_the_one_that_it_heads_for(order, branch, along):
    network = fork(order)
    road = road_of(network)
    lane = network.get_lane(("b", branch, 0))
    vehicle = put(road, ("a", "b", 0), 10.0, 20.0, MDPVehicle).plan_route_to(branch + branch)
    vehicle.position, vehicle.target_lane_index = lane.position(along, 0.0), ("b", branch, 0)
    for nearest in order:
        vehicle.lane_index = ("b", nearest, 0)
        assert heading_of(vehicle).lane == ("b", branch, 0)
    free = Vehicle(road, lane.position(along, 0.0), lane.heading_at(along), 20.0)
    assert {free.lane_index, *heading_of(free).beside} == {("b", name, 0) for name in order}


@pytest.mark.parametrize(("turn", "lane"), [(1, 0), (1, 1), (-1, 1)])
def test_a_planned_road_that_another_lane_leads_to_takes_a_lane_change(turn, lane):
    """Until then the ego is on its own lane, and the road is what that leads to."""
    network, joint = chain([Element(0.0, 60.0)], "ab", lanes=3)
    chain([Element(0.0, 90.0)], "bc", network, joint, lanes=3)
    first = 2 if turn > 0 else 0
    network.add_lane("b", "d", lane_beside(joint, Element(turn / 80, 70.0), 4.0 * first))
    way = (("b", "d"),)
    own, exiting = (road_through(network, ("a", "b", i), REACH, way) for i in (lane, first))
    x, y = network.get_lane(("b", "d", 0)).position(40.0, 0.0)
    assert abs(locate(own, x, y)[1]) > 4.0 and abs(locate(exiting, x, y)[1]) < 1e-6
    x, y = network.get_lane(("b", "c", lane)).position(40.0, 0.0)
    assert abs(locate(own, x, y)[1]) < 1e-6


def test_who_may_come_from_several_roads_is_measured_along_each():
    network, joint = chain([Element(0.0, 60.0)], "xm")
    chain([Element(1 / 90, 50.0), Element(0.0, 60.0)], "mno", network, joint)
    backward = Pose(joint.x, joint.y, joint.heading + np.pi)
    lane = lane_beside(backward, Element(1 / 70, 60.0), 0.0, reverse=True)
    network.add_lane("y", "m", lane)
    road = road_through(network, ("m", "n", 0), REACH)
    for origin in "xy":
        other = network.get_lane((origin, "m", 0))
        assert locate(road, *other.position(20.0, -0.4))[:2] == pytest.approx((-40.0, -0.4))


# ---------------------------------------------------------------- how far


@pytest.mark.parametrize(("length", "radius"), [(3.0, 200.0), (5.0, 80.0), (11.0, 400.0)])
def test_short_pieces_do_not_shorten_the_road(length, radius):
    count = int(1500 / length)
    names = [str(i) for i in range(count + 1)]
    elements = [Element((1 if i // 10 % 2 else -1) / radius, length) for i in range(count)]
    network, _ = chain(elements, names)
    middle = (names[count // 2], names[count // 2 + 1], 0)
    road = road_through(network, middle, REACH)
    reached = [locate(road, *network.get_lane((names[i], names[i + 1], 0)).position(1.0, 0.0))[0] for i in range(count)]
    expected = (np.arange(count) - count // 2) * length + 1.0
    near = np.abs(expected) < REACH
    assert np.array(reached)[near] == pytest.approx(expected[near], abs=1e-6)


def test_the_reach_is_what_both_need_at_full_speed():
    for preset in PRESETS.values():
        reach = reach_of(preset.ego, preset.other, DT)
        for own in (preset.ego, preset.other):  # at rest long before, even after speeding up for the response time
            fastest = 40.0 + own.a_max_accel * own.response_time
            assert reach > fastest * own.response_time + fastest**2 / (2 * own.a_min_brake_correct)


@pytest.mark.parametrize("turn", [-1, 1])
@pytest.mark.parametrize("lanes", [2, 3])
def test_where_a_lane_ends_the_road_goes_on_beside_the_next_one(turn, lanes):
    network, joint = chain([Element(0.0, 60.0)], "ab", lanes=lanes)
    chain([Element(turn / 80, 70.0)], "bc", network, joint)
    road = road_through(network, ("a", "b", lanes - 1), REACH)
    bend = network.get_lane(("b", "c", 0))
    offset = 4.0 * (lanes - 1)
    _, y, _, curvature = locate(road, *bend.position(35.0, 0.0))
    assert y == pytest.approx(-offset)
    assert curvature == pytest.approx(turn / (80 - turn * offset))


def test_a_lane_that_ends_on_a_straight_road_has_a_free_end():
    network, joint = chain([Element(0.0, 60.0)], "ab", lanes=2)
    chain([Element(0.0, 70.0)], "bc", network, joint)
    assert len(road_through(network, ("a", "b", 1), REACH)) == 1
    assert len(road_through(network, ("a", "b", 0), REACH)) == 2


def test_a_road_that_is_followed_no_farther_does_not_go_on_for_ever():
    """Beyond its end it may lead anywhere: nobody is next to a line that is drawn on from there."""
    network, _ = chain([Element(1 / 40, 20.0)] * 6 + [Element(0.0, 50.0)] * 6)
    road = road_through(network, ("a", "b", 0), 30.0)
    x, y = network.get_lane(("a", "b", 0)).position(10.0, 3.9)
    assert nearest_piece(road, x, y)[0] == pytest.approx(10.0)
    far = network.get_lane(("k", "l", 0)).position(40.0, 0.0)
    assert abs(locate(road, *far)[1]) > 10.0


def test_lanes_of_the_generator_lie_where_the_line_runs():
    for kappa in (0.0, 1 / 60, -1 / 45):
        start, element = Pose(5.0, 7.0, 2.0), Element(kappa, 33.0)
        lane, oncoming = lane_beside(start, element, 4.0), lane_beside(start, element, -4.0, reverse=True)
        assert isinstance(lane, CircularLane if kappa else StraightLane)
        end = advance(start, element)
        assert lane.position(0.0, -4.0) == pytest.approx(start[:2])
        assert lane.position(lane.length, -4.0) == pytest.approx(end[:2])
        assert np.cos(lane.heading_at(lane.length) - end.heading) == pytest.approx(1.0)
        assert oncoming.position(0.0, -4.0) == pytest.approx(end[:2])
        assert oncoming.position(oncoming.length, -4.0) == pytest.approx(start[:2])
