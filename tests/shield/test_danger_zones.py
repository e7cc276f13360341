"""Danger zones: worked numbers, the conflict table, and what each filter may and may not miss.

Junctions are highway-env's intersection: arms 0-3 = S, W, N, E, x east, y south, cars drive on the right.
"""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import DATA

from bench.danger_zones import Config, place, play, position_at, rotated, x_junction
from rss_shield.shield.junctions.danger_zones import (
    CROSS,
    FILTERS,
    MERGE,
    NONE,
    UNKNOWN,
    Cars,
    DangerRules,
    arrival_time,
    assumed_manoeuvres,
    candidates,
    conflict_counts,
    conflict_table,
    crossing_of_rays,
    danger_zones,
    first_crossing,
    is_active,
    occupancy_tau,
    time_difference,
    within_geofence,
)

EXAMPLES = json.loads((DATA / "v2x-examples.json").read_text(encoding="utf-8"))
X = x_junction("RSL")
X_U = x_junction("RSLU")
T = x_junction("RSL", arms=(0, 1, 3))
X_TABLE, X_U_TABLE, T_TABLE = X.table(), X_U.table(), T.table()
JUNCTIONS = {"X": (X, X_TABLE), "X with U-turns": (X_U, X_U_TABLE), "T": (T, T_TABLE)}
WIDE = DangerRules(radius=1000.0)  # a fence that leaves nobody out
THINNED = ("walk", "first-conflicting", "first")


def row(name, junction=X):
    return junction.names.index(name)


def scene(*cars, junction=X, table=X_TABLE):
    """Cars from (manoeuvre name, s, speed)."""
    names, s, speed = zip(*cars, strict=True)
    return place(junction, table, [row(name, junction) for name in names], s, speed)


def random_scene(seed, n=14, junction=X, table=X_TABLE):
    """Cars anywhere before, in and behind the junction, some standing."""
    rng = np.random.default_rng(seed)
    speed = np.where(rng.random(n) < 0.1, 0.0, rng.uniform(3.0, 12.0, n))
    return place(junction, table, rng.integers(len(junction.names), size=n), rng.uniform(-45.0, 25.0, n), speed)


def without(cars, i):
    return Cars(*(np.delete(column, i, axis=0) for column in cars))


def active(filter_name, table, cars, ego, rules=WIDE):
    return danger_zones(table, cars, ego, candidates(filter_name, table, cars, ego, rules), rules).active


# ---------------------------------------------------------------- worked numbers


@pytest.mark.parametrize(("mode", "intent"), [("without_V2X", "straight"), ("with_V2X", "known")])
def test_the_worked_example_comes_out_to_the_last_printed_digit(mode, intent):
    example = EXAMPLES["example"]
    named = {key: (f"{car['arm']}{car['turn']}", car["s"], car["v"]) for key, car in example["cars"].items()}
    cars = scene(*named.values(), junction=X_U, table=X_U_TABLE)
    rules = DangerRules(tau=example["tau_s"], t_sens=example["T_sens_s"], intent=intent)
    zones = danger_zones(X_U_TABLE, cars, 0, candidates("all", X_U_TABLE, cars, 0, rules), rules)
    for other, expected in example[mode].items():
        i = list(named).index(other)
        if expected is None:
            assert zones.kind[i] == NONE and not zones.active[i]
            continue
        assert zones.kind[i] == {"cross": CROSS, "merge": MERGE}[expected["kind"]]
        assert zones.point[i] == pytest.approx(expected["point"], abs=0.0055 if mode == "without_V2X" else 0.00055)
        for name, value in (("t_ego", zones.t_ego), ("t_other", zones.t_other), ("delta", zones.delta)):
            assert value[i] == pytest.approx(expected[name], abs=0.00055)
        assert zones.active[i] == expected["active"]


def test_the_ego_that_crosses_only_leaves_the_merge_out():
    cars = scene(("0L", -25, 9.0), ("3R", -20, 8.0), ("1L", -22, 8.5))
    rules = DangerRules(intent="straight", kinds=("cross",))
    assert active("all", X_TABLE, cars, 0, rules).tolist() == [False, False, True]


def test_the_published_table_comes_out_to_the_last_printed_digit():
    found = {}
    for a in range(X_TABLE.n_manoeuvres):
        for b in range(X_TABLE.n_manoeuvres):
            if X_TABLE.kind[a, b] in (CROSS, MERGE) and X.approaches[a] < X.approaches[b]:
                found[f"{X.names[a]}-{X.names[b]}"] = a, b
    assert set(found) == set(EXAMPLES["table_4arm"])
    for name, expected in EXAMPLES["table_4arm"].items():
        a, b = found[name]
        assert X_TABLE.kind[a, b] == {"cross": CROSS, "merge": MERGE}[expected["kind"]]
        assert X_TABLE.point[a, b] == pytest.approx(expected["point"], abs=0.001)
        assert (X_TABLE.s[a, b], X_TABLE.s[b, a]) == pytest.approx((expected["s_a"], expected["s_b"]), abs=0.001)


# ---------------------------------------------------------------- formulas


def test_two_rays_cross_where_they_do_by_hand():
    # from (0, 0) along x, from (3, -4) along y: 3 m and 4 m
    point, along_a, along_b = crossing_of_rays([0.0, 0.0], [1.0, 0.0], [3.0, -4.0], [0.0, 1.0])
    assert (*point, along_a, along_b) == pytest.approx((3.0, 0.0, 3.0, 4.0))


@pytest.mark.parametrize(
    ("start_b", "direction_b"),
    [((3.0, 4.0), (0.0, 1.0)), ((-3.0, -4.0), (0.0, 1.0)), ((0.0, 2.0), (1.0, 0.0)), ((9.0, 0.0), (-1.0, 0.0))],
    ids=["behind the other", "behind the first", "parallel", "head-on"],
)
def test_rays_do_not_meet_behind_a_car_or_in_parallel(start_b, direction_b):
    point, along_a, along_b = crossing_of_rays([0.0, 0.0], [1.0, 0.0], start_b, direction_b)
    assert np.isinf([*point, along_a, along_b]).all()


def geographic_crossing(a, heading_a, b, heading_b):
    """(4) and (5): crossing of two lines in units of 1e-7 degree; a, b = (latitude, longitude), heading from north."""
    equator, meridian = 40_075_017.0, 20_003_931.5  # O and M [m]
    e_lat, e_lon = meridian / 180 * 1e-7, equator / 360 * 1e-7 * np.cos(np.radians(a[0] * 1e-7))
    tan_a, tan_b = np.tan(heading_a), np.tan(heading_b)
    # offsets from a, which lose no digits: with A_lat = A_lon = 0
    lat, lon = b[0] - a[0], b[1] - a[1]
    x_lat = (lon * e_lon - tan_b * lat * e_lat) / ((tan_a - tan_b) * e_lat)
    x_lon = tan_a * x_lat * e_lat / e_lon
    return np.array([x_lon * e_lon, x_lat * e_lat]), np.array([lon * e_lon, lat * e_lat])  # east, north of a [m]


def test_geographic_formulas_agree_with_cross_products_away_from_90_degrees():
    rng = np.random.default_rng(3)
    checked = 0
    while checked < 300:
        a = np.array([rng.uniform(-60e7, 60e7), rng.uniform(-170e7, 170e7)])
        b = a + rng.uniform(-8000.0, 8000.0, 2)  # up to 90 m
        heading_a, heading_b = rng.uniform(0.0, 2 * np.pi, 2)
        steep = min(abs(np.cos(heading_a)), abs(np.cos(heading_b)))
        if steep < 0.05 or abs(np.sin(heading_a - heading_b)) < 0.05:
            continue
        expected, start_b = geographic_crossing(a, heading_a, b, heading_b)
        directions = [np.array([np.sin(h), np.cos(h)]) for h in (heading_a, heading_b)]
        point, along_a, along_b = crossing_of_rays([0.0, 0.0], directions[0], start_b, directions[1])
        if np.isinf(along_a):
            continue
        assert point == pytest.approx(expected, abs=1e-4)
        # (6): the distance as the crow flies, the geographic way
        assert along_a == pytest.approx(np.hypot(*expected), abs=1e-4)
        assert along_b == pytest.approx(np.hypot(*(expected - start_b)), abs=1e-4)
        checked += 1


def test_at_90_degrees_where_the_tangent_fails_cross_products_do_not():
    point, along_a, along_b = crossing_of_rays([0.0, 0.0], [1.0, 0.0], [20.0, -15.0], [0.0, 1.0])
    assert (*point, along_a, along_b) == (20.0, 0.0, 20.0, 15.0)


@pytest.mark.parametrize(
    ("s", "speed", "time"),
    [(-20.0, 8.0, 4.0), (14.0, 8.0, -0.25), (12.0, 0.0, 0.0), (0.0, 0.0, np.inf), (13.0, 0.0, -np.inf)],
)
def test_arrival_times_along_the_path_by_hand(s, speed, time):
    assert arrival_time(s, 12.0, speed) == time


def test_a_car_that_never_arrives_differs_infinitely():
    assert time_difference([3.0, 3.0, np.inf], [1.0, np.inf, np.inf]).tolist() == [2.0, np.inf, np.inf]


@pytest.mark.parametrize(
    ("t_ego", "t_other", "reading", "result"),
    [
        (4.0, 5.4, "min", True),
        (4.0, 5.5, "min", False),  # tau is excluded
        (6.5, 5.9, "min", True),
        (6.5, 5.9, "ego", False),
        (5.9, 6.5, "ego", True),
        (6.0, 6.1, "min", False),
        (0.2, -0.1, "min", False),
        (-0.1, 0.2, "min", False),
        (np.inf, 3.0, "min", False),
        (np.inf, np.inf, "min", False),
    ],
)
def test_a_zone_is_active_if_both_come_at_once_and_soon(t_ego, t_other, reading, result):
    assert is_active(t_ego, t_other, 1.5, 6.0, reading) == result


@pytest.mark.parametrize(
    ("v_a", "v_b", "tau"), [(9.0, 9.0, 7 / 9 + 0.5), (9.0, 3.5, 2.5), (0.49, 9.0, 1.5), (0.0, 0.0, 1.5)]
)
def test_tau_from_occupancy_is_that_of_the_slower_car(v_a, v_b, tau):
    assert occupancy_tau(v_a, v_b) == pytest.approx(tau)


def test_tau_may_differ_from_car_to_car():
    cars = scene(("0S", -30, 9.0), ("1S", -41, 9.0), ("3S", -37, 9.0))  # differences 15/9 s and 3/9 s
    assert active("walk", X_TABLE, cars, 0, DangerRules(tau=np.array([1.0, 1.7, 0.3]))).tolist() == [0, 1, 0]


def test_polylines_meet_first_where_the_sum_of_both_ways_is_least():
    zigzag = np.array([[0.0, 0.0], [2.0, 2.0], [4.0, 0.0], [6.0, 2.0]])
    line = np.array([[7.0, 1.0], [0.0, 1.0]])
    s_a, s_b, point = first_crossing(zigzag, line)  # crossings at x = 1, 3, 5: each 2 to 2.8 m apart
    assert (s_a, s_b, *point) == pytest.approx((np.sqrt(2.0), 6.0, 1.0, 1.0))
    assert first_crossing(line, zigzag)[:2] == pytest.approx((s_b, s_a))


def test_polylines_meet_at_a_common_corner():
    corner = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    assert first_crossing(corner, np.array([[1.0, -5.0], [1.0, 1.0], [1.0, 9.0]]))[1] == pytest.approx(6.0)


def test_parallel_polylines_do_not_meet():
    assert first_crossing(np.array([[0.0, 0.0], [9.0, 0.0]]), np.array([[9.0, 0.0], [0.0, 0.0]])) is None


# ---------------------------------------------------------------- conflict table


@pytest.mark.parametrize(
    ("table", "published"),
    [(X_TABLE, "counts_4arm"), (T_TABLE, "counts_T"), (X_U_TABLE, "counts_4arm_U")],
    ids=["X", "T", "X with U-turns"],
)
def test_conflicts_of_a_junction_are_as_many_as_published(table, published):
    assert conflict_counts(table) == EXAMPLES[published]


@pytest.mark.parametrize("table", [X_TABLE, T_TABLE, X_U_TABLE])
def test_the_table_is_symmetric(table):
    assert (table.kind == table.kind.T).all()
    assert (table.point == table.point.transpose(1, 0, 2)).all()
    assert (np.diag(table.kind) == NONE).all()


@pytest.mark.parametrize(("junction", "table"), JUNCTIONS.values(), ids=JUNCTIONS.keys())
def test_each_zone_lies_on_both_paths_at_its_arc_lengths(junction, table):
    for a, b in np.argwhere(table.kind[: table.n_manoeuvres, : table.n_manoeuvres] != NONE):
        assert position_at(junction.paths[a], table.s[a, b]) == pytest.approx(table.point[a, b], abs=1e-9)


def test_the_table_turns_with_the_junction():
    quarter = [X_U.names.index(f"{(int(name[0]) + 1) % 4}{name[1]}") for name in X_U.names]
    pairs = np.ix_(quarter, quarter)
    assert (X_U_TABLE.kind[pairs] == X_U_TABLE.kind).all()
    assert X_U_TABLE.s[pairs] == pytest.approx(X_U_TABLE.s, abs=1e-9)
    assert X_U_TABLE.point[pairs] == pytest.approx(rotated(X_U_TABLE.point, 1), abs=1e-9)


def test_the_table_is_the_same_with_y_up():
    mirrored = conflict_table([path * [1.0, -1.0] for path in X.paths], X.approaches, X.exits)
    assert (mirrored.kind == X_TABLE.kind).all()
    assert mirrored.s == pytest.approx(X_TABLE.s)


def test_a_u_turn_of_the_opposite_car_has_nothing_to_do_with_a_left_turn():
    for arm in range(4):
        a, b = row(f"{arm}L", X_U), row(f"{(arm + 2) % 4}U", X_U)
        assert X_U_TABLE.kind[a, b] == NONE


def test_an_approach_without_a_straight_manoeuvre_gets_a_ghost():
    # the stem of the T: straight on, it crosses both streams of the main road
    ghost = T_TABLE.straight[0]
    assert ghost == T_TABLE.n_manoeuvres == len(T.names)
    assert [T_TABLE.kind[ghost, row(name, T)] for name in ("1S", "3S")] == [CROSS, CROSS]
    assert T_TABLE.point[ghost, row("1S", T)] == pytest.approx((2.0, 2.0), abs=0.1)  # along the first 0.1 m of a turn
    assert len(X_TABLE.kind) == X_TABLE.n_manoeuvres  # none at an X


# ---------------------------------------------------------------- two modes


def test_with_straight_intents_headings_and_table_find_the_same_zones():
    straight = [name for name in X.names if name[1] == "S"]
    cars = scene(*((name, -20.0 - 3.0 * k, 8.0) for k, name in enumerate(straight)))
    directions = np.array([X.paths[row(name)][-1] - X.paths[row(name)][0] for name in straight]) / 22.0
    for ego in range(4):
        zones = {
            intent: danger_zones(X_TABLE, cars, ego, np.ones(4, bool), DangerRules(intent=intent))
            for intent in ("known", "straight")
        }
        for name in zones["known"]._fields:
            assert (getattr(zones["known"], name) == getattr(zones["straight"], name)).all()
        point, along, along_other = crossing_of_rays(cars.position[ego], directions[ego], cars.position, directions)
        meets = np.isfinite(along)
        assert (meets == (zones["known"].kind == CROSS)).all() and meets.sum() == 2
        assert zones["known"].point[meets] == pytest.approx(point[meets])
        assert zones["known"].t_ego[meets] == pytest.approx(along[meets] / 8.0)
        assert zones["known"].t_other[meets] == pytest.approx(along_other[meets] / 8.0)


def test_a_car_that_announces_nothing_is_assumed_straight():
    cars = scene(("0L", -25, 9.0), ("2R", -25, 9.0), ("1L", -22, 8.5))
    silent = cars._replace(manoeuvre=np.array([row("0L"), UNKNOWN, row("1L")]))
    assert assumed_manoeuvres(X_TABLE, silent).tolist() == [row("0L"), row("2S"), row("1L")]
    assert assumed_manoeuvres(X_TABLE, silent, "straight").tolist() == [row("0S"), row("2S"), row("1S")]


# ---------------------------------------------------------------- activity


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_zone_behind_a_car_is_never_active(seed):
    cars = random_scene(seed)
    rows = cars.manoeuvre
    for ego in range(len(rows)):
        on = active("all", X_TABLE, cars, ego)
        assert (cars.s[on] <= X_TABLE.s[rows[on], rows[ego]]).all()
        assert (cars.s[ego] <= X_TABLE.s[rows[ego], rows[on]]).all()


def test_a_zone_counts_until_the_car_has_left_it():
    for s, is_on in ((8.9, True), (9.1, False)):  # 0S meets 1S after 9 m
        assert active("all", X_TABLE, scene(("0S", s, 9.0), ("1S", 8.0, 9.0)), 0)[1] == is_on


def test_a_standing_car_short_of_the_zone_forms_none():
    assert not active("all", X_TABLE, scene(("0S", -5.0, 9.0), ("1S", -1.0, 0.0)), 0).any()
    assert not active("all", X_TABLE, scene(("0S", -5.0, 0.0), ("1S", -1.0, 9.0)), 0).any()


# ---------------------------------------------------------------- filters


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), intent=st.sampled_from(["known", "straight"]))
def test_each_filter_examines_a_subset_of_the_one_before(seed, intent):
    cars, rules = random_scene(seed), DangerRules(radius=40.0, intent=intent)
    for ego in range(len(cars.s)):
        masks = [candidates(name, X_TABLE, cars, ego, rules) for name in FILTERS]
        for more, less in pairwise(masks):
            assert (less <= more).all()
        assert not masks[0][ego] and masks[0].sum() == len(cars.s) - 1


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.sampled_from([("cross", "merge"), ("cross",), ("merge",)]),
    reading=st.sampled_from(["min", "ego"]),
    name=st.sampled_from(list(JUNCTIONS)),
)
def test_the_table_misses_nothing_that_brute_force_finds(seed, kinds, reading, name):
    junction, table = JUNCTIONS[name]
    cars, rules = random_scene(seed, junction=junction, table=table), WIDE._replace(kinds=kinds, reading=reading)
    for ego in range(len(cars.s)):
        assert (active("table", table, cars, ego, rules) == active("all", table, cars, ego, rules)).all()


def test_the_table_has_every_pair_of_paths_that_come_near():
    # independent of the table: points 0.05 m apart on both paths, from the south arm and from another one
    fine = [
        np.array([position_at(path, s) for s in np.arange(0.0, length, 0.05)])
        for path, length in zip(X_U.paths, X_U_TABLE.length, strict=True)
    ]
    for a in range(4):
        for b in range(4, 16):
            near = np.linalg.norm(fine[a][:, None] - fine[b], axis=-1).min() < 0.05
            assert near == (X_U_TABLE.kind[a, b] in (CROSS, MERGE)), (X_U.names[a], X_U.names[b])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), filter_name=st.sampled_from(["all", "geofence", "table"]))
def test_removing_a_car_never_adds_a_zone(seed, filter_name):
    cars = random_scene(seed, n=10)
    ego = 0
    before = active(filter_name, X_TABLE, cars, ego)
    for removed in range(1, 10):
        assert (active(filter_name, X_TABLE, without(cars, removed), ego) == np.delete(before, removed)).all()


@pytest.mark.parametrize("filter_name", ["first-conflicting", "first"])
def test_removing_the_first_car_may_reveal_the_one_behind(filter_name):
    cars = scene(("0S", -30.0, 9.0), ("1S", -10.0, 9.0), ("1S", -25.0, 9.0))
    assert not active(filter_name, X_TABLE, cars, 0).any()
    assert active(filter_name, X_TABLE, without(cars, 1), 0).tolist() == [False, True]
    assert active("walk", X_TABLE, cars, 0).tolist() == [False, False, True]


def test_filters_by_hand():
    cars = scene(
        ("0L", -20.0, 9.0),  # the ego
        ("1R", -5.0, 9.0),  # first of its lane, turns off without conflict
        ("1S", -15.0, 9.0),  # the first to conflict, early enough
        ("1L", -40.0, 9.0),  # later than the ego and tau
        ("1S", -45.0, 9.0),  # behind that one
        ("2S", -48.0, 9.0),  # within the fence, late
        ("3S", -70.0, 9.0),  # outside
        ("0S", -35.0, 9.0),  # behind the ego
        ("3R", -10.0, 9.0),  # no conflict
    )
    examined = {name: np.flatnonzero(candidates(name, X_TABLE, cars, 0)).tolist() for name in FILTERS}
    assert examined == {
        "all": [1, 2, 3, 4, 5, 6, 7, 8],
        "geofence": [1, 2, 3, 4, 5, 7, 8],
        "table": [2, 3, 4, 5],
        "walk": [2, 3, 5],
        "first-conflicting": [2, 5],
        "first": [5],
    }


def test_a_car_past_the_zone_does_not_hide_the_next():
    cars = scene(("0S", -2.0, 9.0), ("1S", 14.0, 9.0), ("1S", -2.0, 9.0))  # 1S meets 0S after 13 m
    for name in ("table", "walk", "first-conflicting"):
        assert candidates(name, X_TABLE, cars, 0).tolist() == [False, False, True]
    assert not candidates("first", X_TABLE, cars, 0).any()  # the first still has its path before it
    assert candidates("first", X_TABLE, cars._replace(s=np.array([-2.0, 22.1, -2.0])), 0)[2]


def test_a_zone_that_the_ego_has_left_does_not_stop_the_walk():
    # 12 m along 0L: past the straight stream of W (9.9 m), short of its left turns (13.1 m)
    cars = scene(("0L", 12.0, 9.0), ("1S", -2.0, 9.0), ("1L", -4.0, 9.0))
    assert candidates("walk", X_TABLE, cars, 0).tolist() == [False, False, True]


def test_of_two_cars_side_by_side_neither_hides_the_other():
    cars = scene(("0S", -20.0, 9.0), ("1S", -20.0, 9.0), ("1L", -20.0, 9.0))
    assert candidates("first", X_TABLE, cars, 0).tolist() == [False, True, True]


def test_the_geofence_is_a_circle_around_the_mean_of_the_ends():
    assert X_TABLE.centre == pytest.approx((0.0, 0.0))
    cars = scene(("0S", -48.9, 9.0), ("0S", -49.1, 9.0))  # 2 m beside the axis, 11 m + 49 m from the centre
    assert within_geofence(X_TABLE, cars, 60.0).tolist() == [True, False]


def test_the_centre_of_a_lopsided_junction_is_the_mean_of_its_four_ends():
    across, up = [(0.0, 0.0), (1.0, 0.0), (10.0, 0.0)], [(5.0, -6.0), (5.0, -5.0), (5.0, 8.0)]
    assert conflict_table([across, up], [0, 1], [0, 1]).centre == pytest.approx((5.0, 0.5))


def test_a_single_car_has_no_zones():
    cars = scene(("0L", -20.0, 9.0))
    for name in FILTERS:
        assert not active(name, X_TABLE, cars, 0).any()


# ---------------------------------------------------------------- every piece is needed


def recall(filter_name, table, rules=WIDE, seeds=range(40)):
    """Share of the zones of the true table that a filter on another table finds."""
    found = true = 0
    for seed in seeds:
        cars = random_scene(seed)
        for ego in range(len(cars.s)):
            truth = active("all", X_TABLE, cars, ego)
            found += (truth & active(filter_name, table, cars, ego, rules)).sum()
            true += truth.sum()
    assert true > 100
    return found / true


def test_a_table_without_merges_or_crossings_misses_zones():
    assert recall("table", X_TABLE) == 1.0
    for kind in (CROSS, MERGE):
        assert recall("table", X_TABLE._replace(kind=np.where(X_TABLE.kind == kind, NONE, X_TABLE.kind))) < 0.9


def test_a_table_with_one_pair_less_misses_zones():
    for name_a, name_b in (("0L", "1L"), ("1R", "2S")):
        kind = X_TABLE.kind.copy()
        kind[row(name_a), row(name_b)] = kind[row(name_b), row(name_a)] = NONE
        assert recall("table", X_TABLE._replace(kind=kind)) < 1.0


def test_a_fence_that_is_too_small_misses_zones():
    assert recall("table", X_TABLE, WIDE._replace(radius=20.0)) < 1.0


def test_thinned_filters_and_straight_intents_miss_zones():
    recalls = [recall(name, X_TABLE) for name in THINNED]
    assert 1.0 > recalls[0] > recalls[1] > recalls[2] > 0.2
    assert recall("all", X_TABLE, WIDE._replace(intent="straight")) < 1.0


# ---------------------------------------------------------------- bad input


def good_cars(**changes):
    fields = dict(approach=[0, 1], manoeuvre=[row("0S"), row("1S")], s=[-9.0, -9.0], speed=[8.0, 8.0])
    return Cars.validated(X_TABLE, **(fields | dict(position=np.zeros((2, 2))) | changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(speed=[8.0, -1.0]), "speed = -1 is out of range"),
        (dict(speed=[8.0]), r"speed has shape \(1,\): expected \(2,\)"),
        (dict(s=[0.0, np.nan]), "s has a value that is not finite"),
        (dict(position=np.zeros((2, 3))), r"position has shape \(2, 3\)"),
        (dict(approach=[0, 7]), "approach = 7 is unknown: expected one of 0, 1, 2, 3"),
        (dict(approach=[0.0, 1.0]), "approach has dtype float64: expected integers"),
        (dict(approach=[0]), r"approach has shape \(1,\)"),
        (dict(manoeuvre=[0, 12]), r"manoeuvre: expected -1 \(unknown\) or 0 to 11"),
        (dict(manoeuvre=[0, -2]), r"manoeuvre: expected -1 \(unknown\) or 0 to 11"),
        (dict(manoeuvre=[row("0S"), row("2S")]), "of car 1 does not start on approach 1"),
    ],
)
def test_bad_cars_are_errors(changes, message):
    with pytest.raises(ValueError, match=message):
        good_cars(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(tau=0.0), "tau = 0.0 is out of range: expected a number > 0"),
        (dict(t_sens=-1.0), "t_sens = -1.0 is out of range"),
        (dict(radius=np.nan), "radius = nan is out of range"),
        (dict(reading="max"), "reading = 'max' is unknown: expected one of min, ego"),
        (dict(intent="left"), "intent = 'left' is unknown: expected one of known, straight"),
        (dict(kinds=("diverge",)), "kinds = 'diverge' is unknown: expected one of cross, merge"),
        (dict(kinds="cross"), "kinds = 'cross': expected a tuple"),
        (dict(kinds=()), r"kinds = \(\): expected a tuple"),
    ],
)
def test_bad_rules_are_errors(changes, message):
    rules, cars = DangerRules(**changes), good_cars()
    for use in (
        rules.validated,
        lambda: candidates("all", X_TABLE, cars, 0, rules),
        lambda: danger_zones(X_TABLE, cars, 0, np.ones(2, bool), rules),
    ):
        with pytest.raises(ValueError, match=message):
            use()


def test_an_unknown_filter_lists_the_accepted_ones():
    accepted = "filter = 'nearest' is unknown: expected one of all, geofence, table, walk, first-conflicting, first"
    with pytest.raises(ValueError, match=accepted):
        candidates("nearest", X_TABLE, good_cars(), 0)


def test_a_bad_ego_or_mask_is_an_error():
    cars = good_cars()
    with pytest.raises(ValueError, match="ego = 2 is out of range: expected 0 to 1"):
        candidates("all", X_TABLE, cars, 2)
    with pytest.raises(ValueError, match=r"examined has shape \(3,\)"):
        danger_zones(X_TABLE, cars, 0, np.ones(3, bool))
    with pytest.raises(ValueError, match=r"tau has shape \(3,\): expected a float or \(2,\)"):
        candidates("all", X_TABLE, cars, 0, DangerRules(tau=np.ones(3)))
    with pytest.raises(ValueError, match="manoeuvre of the ego = -1"):
        candidates("all", X_TABLE, good_cars(manoeuvre=[UNKNOWN, row("1S")]), 0)


LINE = [[0.0, 0.0], [5.0, 0.0]]


@pytest.mark.parametrize(
    ("paths", "approaches", "exits", "message"),
    [
        ([], [], [], "paths is empty"),
        ([[[0.0, 0.0]]], [0], [0], r"path of manoeuvre 0 has shape \(1, 2\)"),
        ([[[0.0, np.inf], [1.0, 1.0]]], [0], [0], "coordinate that is not finite"),
        ([[[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]]], [0], [0], "the same point twice"),
        ([LINE], [0, 1], [0], r"approaches has shape \(2,\): expected \(1,\)"),
        ([LINE], ["o0"], [0], "approaches has dtype <U2: expected integers"),
        ([LINE, [[1.0, 0.0], [5.0, 5.0]]], [0, 0], [0, 1], "manoeuvres 0 and 1 share lane 0 of approaches"),
        ([LINE, [[0.0, 9.0], [5.0, 5.0]]], [0, 1], [3, 3], "manoeuvres 0 and 1 share lane 3 of exits"),
        ([LINE, LINE], [0, 0], [3, 3], "manoeuvre 1: there is another one from lane 0 to lane 3"),
    ],
)
def test_bad_junctions_are_errors(paths, approaches, exits, message):
    with pytest.raises(ValueError, match=message):
        conflict_table(paths, approaches, exits)


# ---------------------------------------------------------------- benchmark


def test_a_small_monte_carlo_has_the_published_order():
    tallies = play(2, Config(scenes=20, truth="fence"))
    tests = [tallies[name].tests for name in FILTERS]
    assert tests == sorted(tests, reverse=True)
    assert tallies["table"].found == tallies["table"].zones > 0
    assert tallies["all"].tests == 20 * 8 * 7 and tallies["all"].scene_tests == 20 * 28
    assert 0 < tallies["straight"].scene_found < tallies["straight"].scene_claimed
