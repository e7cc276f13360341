"""What a car sees past boxes, and who must be expected behind them."""

from types import SimpleNamespace

import numpy as np
import pytest
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork
from hypothesis import given, settings
from hypothesis import strategies as st

from rss_shield.envs.roads.visibility import Box, Columns, HiddenLane, hidden_people, sees, walls_of
from rss_shield.shield.definitions.occlusion import REASONABLE

PLACE = ("pedestrian", "parked cars")
NO_CROSSINGS = np.zeros((0, 2))


def car(x=0.0, y=0.0):
    return SimpleNamespace(position=np.array([x, y]), direction=np.array([1.0, 0.0]), LENGTH=5.0)


def person(x, y):
    return SimpleNamespace(position=np.array([x, y]), LENGTH=0.5, WIDTH=0.5, heading=0.0)


def columns(xs, depths=(3.0, 3.5, 4.0, 5.0, 6.0)):
    points = np.stack(np.meshgrid(xs, depths, indexing="ij"), axis=-1)
    return Columns(points, np.full(len(xs), -np.pi / 2), PLACE)


def test_walls_go_around_a_box():
    walls = walls_of([Box(10.0, 0.0, 4.0, 2.0)])
    assert walls.shape == (4, 4)
    assert sorted(map(tuple, walls[:, :2])) == [(8.0, -1.0), (8.0, 1.0), (12.0, -1.0), (12.0, 1.0)]
    np.testing.assert_array_equal(walls[:, 2:], np.roll(walls[:, :2], -1, axis=0))


def test_a_person_is_seen_by_a_corner():
    walls = walls_of([Box(10.0, 3.0, 4.0, 2.0)])  # from (8, 2) to (12, 4)
    eye_line = 2.0 / 6.0  # from the eye at (2, 0) past the corner (8, 2)
    assert not sees(car(), person(14.0, 12.0 * eye_line), walls)
    assert sees(car(), person(14.0, 0.5), walls)
    # (12, 2) hides what is behind its line, 2 / 10 per metre: at 14 m from 2.4 m on; the near corner is at 2.35 m
    assert sees(car(), person(14.25, 2.6), walls)


def test_whoever_is_very_near_is_felt():
    assert sees(car(), person(4.0, 2.5), walls_of([Box(3.2, 1.8, 0.5, 0.5)]))


def test_a_ghost_stands_where_nothing_is_seen_and_runs_to_the_road():
    walls = walls_of([Box(10.0, 4.0, 4.6, 2.0)])  # a parked car, y from 3 to 5
    (ghost,) = hidden_people(car(), columns(np.array([13.0])), walls, 0.4, NO_CROSSINGS)
    # the line from (2, 0) past (12.3, 3) is at 3.204 m where x = 13: 3.0 m is seen and 3.5 m is not
    assert (ghost["x"], ghost["y"]) == (13.0, 3.5)
    assert ghost["heading"] == -np.pi / 2 and ghost["user"] == -1 and np.isnan(ghost["route_from"])
    assert ghost["v"] == ghost["v_high"] == REASONABLE[PLACE].v_high


def test_who_has_passed_or_sees_everything_expects_nobody():
    walls = walls_of([Box(10.0, 4.0, 4.6, 2.0)])
    assert len(hidden_people(car(14.0), columns(np.array([13.0])), walls, 0.4, NO_CROSSINGS)) == 0
    assert len(hidden_people(car(), columns(np.array([13.0])), walls_of([]), 0.4, NO_CROSSINGS)) == 0


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(6.0, 35.0), min_size=1, max_size=5, unique=True), st.floats(-5.0, 20.0), st.data())
def test_removing_an_occluder_brings_nobody_nearer(places, x, data):
    boxes = [Box(place, 4.2, 4.6, 2.0) for place in places]
    fewer = list(boxes)
    fewer.pop(data.draw(st.integers(0, len(boxes) - 1)))
    where = columns(np.arange(5.0, 40.0, 0.7))

    def nearest(some):
        ghosts = hidden_people(car(x), where, walls_of(some), 0.4, NO_CROSSINGS)
        return {float(g["x"]): float(g["y"]) for g in ghosts}

    before, after = nearest(boxes), nearest(fewer)
    assert set(after) <= set(before)
    assert all(after[k] >= before[k] for k in after)


def test_a_hidden_car_comes_no_sooner_than_from_where_it_was():
    network = RoadNetwork()
    network.add_lane("a", "b", StraightLane([100.0, -50.0], [0.0, -50.0]))
    hidden = HiddenLane(network, ("a", "b", 0), 10.0)
    viewer, wall = car(-2.0, 0.0), walls_of([Box(30.0, -20.0, 20.0, 1.0)])  # hides x from 39 to 102 or so
    assert hidden.look(viewer, walls_of([]), 0, 0.1) == 0.0  # all of it is seen: nobody is nearer than its far end
    assert hidden.look(viewer, wall, 1, 0.1) == pytest.approx(1.0)  # 10 m/s for 0.1 s
    assert hidden.look(viewer, wall, 1, 0.1) == pytest.approx(1.0)  # asked again on the same frame
    front = hidden.look(viewer, wall, 200, 0.1)
    # then the hidden place nearest to the end: the eye at (0, 0), the wall's near corner at (20, -19.5): 51.3 m
    assert 100.0 - front == pytest.approx(20.0 * 50.0 / 20.5, abs=3.0)
