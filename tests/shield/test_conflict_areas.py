"""Conflict areas: what two paths have in common, measured on highway-env's own cars."""

import numpy as np
import pytest
from highway_env import utils
from junction_world import arms, crossing_pairs, junction

from rss_shield.envs.roads.network import position
from rss_shield.envs.roads.paths import _starts, drive
from rss_shield.shield.junctions.conflict_areas import CELL, cell_of, in_conflict
from rss_shield.shield.junctions.danger_zones import CROSS, conflict_counts, conflict_table


def corners(x, y, heading):
    """Outline of a car, closed, as highway-env's collision test wants it."""
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    signs = [(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)]
    return np.array([(x, y) + 2.5 * i * along + 1.0 * j * across for i, j in signs])


def _touch(a, b) -> bool:
    return bool(utils.are_polygons_intersecting(a, b, np.zeros(2), np.zeros(2))[0])


def polyline(index):
    """Points on the middle of a lane."""
    roads = junction().roads
    lane = roads.lanes[junction().number[index]]
    return np.array([position(lane, s, 0.0) for s in np.linspace(0.0, lane["length"], 60)])


@pytest.fixture(scope="module")
def paths():
    return junction().roads.paths


def test_an_intersection_has_twelve_manoeuvres_and_the_classical_conflicts(paths):
    count = len(paths.cells)
    together = [(a, b) for a in range(count) for b in range(a)]
    merging = [(a, b) for a, b in together if arms(a)[0] != arms(b)[0] and arms(a)[1] == arms(b)[1]]
    diverging = [(a, b) for a, b in together if arms(a)[0] == arms(b)[0]]
    assert count == 12
    assert (len(merging), len(diverging)) == (12, 12)
    assert all(np.isfinite(paths.conflicts[a, b, :, 0]).any() for a, b in merging + diverging)
    middles = [polyline(walk[1]) for walk in junction().walks]
    table = conflict_table(middles, [int(arms(p)[0][1]) for p in range(12)], [int(arms(p)[1][1]) for p in range(12)])
    assert conflict_counts(table) == {"cross": 16, "merge": 12, "diverge": 12}
    crossing = [(a, b) for a, b in together if table.kind[a, b] == CROSS]
    # every crossing of lane middles is a conflict; the widths of cars add eight pairs that pass close by
    assert set(crossing) <= set(crossing_pairs())
    assert len(crossing_pairs()) == 2 * (16 + 8)


def test_conflicts_are_mutual(paths):
    rng = np.random.default_rng(0)
    for a, b in crossing_pairs():
        for i in rng.integers(180, 260, 20):
            low, high = paths.conflicts[a, b, i, :2]
            if np.isfinite(low):
                k = cell_of((low + high) / 2, paths.cells[b])
                assert in_conflict(paths, b, k, a, i * CELL, (i + 1) * CELL)


def test_the_right_of_way_is_one_sided(paths):
    assert (paths.priority == -paths.priority.T).all()


def test_the_ego_gives_way_on_its_left_turn_but_not_to_the_opposite_one(paths):
    turn = next(p for p in range(12) if arms(p) == ("o0", "o1"))
    others = {arms(p): int(paths.priority[turn, p]) for p in range(12)}
    assert others["o1", "o3"] == others["o3", "o1"] == others["o2", "o0"] == -1
    assert others["o2", "o3"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("speeds", [(3.0, 9.5), (8.0, 5.5)])
def test_cars_that_overlap_are_in_conflict(paths, speeds):
    """Two cars are driven along every pair of paths at speeds that the tables were not made with."""
    roads = junction().roads
    number = junction().number
    tracks = []
    for walk in junction().walks:
        way = np.array([number[index] for index in walk])
        both = []
        for speed in speeds:
            track = np.zeros((4000, 4))
            drive(roads.lanes, way, _starts(roads.lanes, way), speed, 1 / 15, track)
            both.append(track[(track[:, 0] > 85.0) & (track[:, 0] < 135.0)][::3])
        tracks.append(both)
    overlaps = 0
    for a in range(12):
        for b in range(a):
            for s, x, y, heading in tracks[a][0]:
                near = np.hypot(tracks[b][1][:, 1] - x, tracks[b][1][:, 2] - y) < 5.5
                for s_b, x_b, y_b, heading_b in tracks[b][1][near]:
                    if _touch(corners(x, y, heading), corners(x_b, y_b, heading_b)):
                        overlaps += 1
                        assert in_conflict(paths, a, cell_of(s, paths.cells[a]), b, s_b, s_b)
    assert overlaps > 500


def test_tracked_cars_leave_the_middle_of_their_lane(paths):
    """That is why the widths are swept: a table of lane centres would miss half a metre."""
    left = next(p for p in range(12) if arms(p) == ("o0", "o1"))
    assert paths.boxes[left, 190:240, 5].max() > 1.5  # half width: the car's 1 m, 0.15 m margin, and the tracking


def test_a_car_may_wait_only_before_the_first_path_it_would_block(paths):
    left = next(p for p in range(12) if arms(p) == ("o0", "o1"))
    crossed = np.flatnonzero(paths.crossed[left]) * CELL
    assert 97.5 < crossed.min() < 104.0 and 115.0 < crossed.max() < 125.0


def test_the_next_place_where_nobody_may_wait_is_the_first_one_ahead(paths):
    ends = 0
    for p, crossed in enumerate(paths.crossed):
        ahead = [np.flatnonzero(crossed[c:]) for c in range(len(crossed))]
        expected = [c + found[0] if len(found) else len(crossed) for c, found in enumerate(ahead)]
        assert paths.line[p].tolist() == expected
        ends += expected.count(len(crossed))
    assert ends > 0


@pytest.mark.slow
def test_ring_roads_are_left_at_every_exit_and_have_the_right_of_way():
    ring = junction("roundabout-v0")
    sinks = {walk[-1][1] for walk in ring.walks}
    assert sinks == {"sxr", "exr", "nxr", "wxr"}
    paths = ring.roads.paths
    entry = [p for p, walk in enumerate(ring.walks) if walk[0][0] == "ser"]
    inside = [p for p, walk in enumerate(ring.walks) if not walk[0][0].endswith("r")]
    assert entry and inside
    ranks = [int(paths.priority[a, b]) for a in entry for b in inside]
    assert -1 in ranks and 1 not in ranks


def test_lanes_count_on_where_highway_env_has_a_gap():
    roads, ring = junction("roundabout-v0").roads, junction("roundabout-v0")
    walk = next(w for w in ring.walks if w[0][0] == "ser")
    way = [ring.number[index] for index in walk]
    starts = _starts(roads.lanes, way)
    for k in range(len(way) - 1):
        switch = roads.lanes[way[k]]["length"] - 2.5
        here = np.array(position(roads.lanes[way[k]], switch, 0.0))
        there = np.array(position(roads.lanes[way[k + 1]], starts[k] + switch - starts[k + 1], 0.0))
        assert np.hypot(*(here - there)) < 5.0  # sideways
