"""Many sources at once."""

import numpy as np
import pytest
from examples import EXAMPLES, MODES, rounded, user

from rss_shield.shield.risk import STATES, RiskSettings, marking, neighbours, risk_of, road_users, scene_risk

RISK = {mode: RiskSettings.validated(mode=mode, farthest=250.0) for mode in MODES}
NO_LINES = marking("none", 0.0, 0.0, 4.0)[:0]
AROUND = {
    "lead 50 m": (50.0, 0.0),
    "left 10 m ahead": (10.0, 4.0),
    "right 10 m ahead": (10.0, -4.0),
    "abreast left": (0.0, 4.0),
    "rear 40 m": (-40.0, 0.0),
    "far lead 200 m": (200.0, 0.0),
}


def around():
    x, y = np.array(list(AROUND.values())).T
    return road_users(x, y, 25.0, 0.0)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("weight", "suffix"), [(0.0, ""), (1.0, "_H")])
def test_six_cars_around_the_ego_have_the_digits_given(mode, weight, suffix):
    expected, each = EXAMPLES[f"neighbours_{mode}"], np.zeros(6)
    settings = RISK[mode]._replace(lateral_exponent=weight)
    scene = scene_risk(user(0.0, 0.0, 25.0), around(), NO_LINES, False, settings, None, each)
    assert dict(zip(AROUND, map(rounded, each), strict=True)) == {
        name: row[f"RDSI{suffix}"] for name, row in expected["rows"].items()
    }
    assert rounded(scene.total) == expected[f"sum{suffix}"]
    assert rounded(scene.largest) == expected[f"max{suffix}"]
    assert scene.critical == 3
    assert scene.rdsi == scene.largest


@pytest.mark.parametrize("lane_change", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_a_scene_is_the_sum_of_its_sources_and_its_worst_one(mode, lane_change):
    rng, settings = np.random.default_rng(3), RISK[mode]
    for _ in range(20):
        n = int(rng.integers(1, 12))
        ego = user(0.0, 0.0, rng.uniform(5.0, 35.0), rng.uniform(-1.0, 1.0))
        users = road_users(
            rng.uniform(-90, 90, n), rng.uniform(-9, 9, n), rng.uniform(0, 38, n), rng.uniform(-1, 1, n)
        ).view(np.recarray)
        each = [risk_of(ego, one, lane_change, settings) for one in users]
        scene = scene_risk(ego, users, NO_LINES, lane_change, settings)
        assert scene.total == pytest.approx(sum(one.rdsi for one in each), rel=1e-9, abs=1e-9)
        assert scene.energy == pytest.approx(sum(one.energy for one in each), rel=1e-9)
        assert scene.rate == pytest.approx(sum(one.rate for one in each), rel=1e-9)
        assert scene.dsi == pytest.approx(sum(one.dsi for one in each), rel=1e-9)
        assert scene.largest == max(one.rdsi for one in each)
        classes = [2 if one.rdsi > one.upper else int(one.rdsi >= one.lower) for one in each]
        assert scene.state == max(classes) == classes[scene.critical]
        critical = each[scene.critical]
        assert (scene.rdsi, scene.lower, scene.upper) == critical[:3]
        ranks = [(state, one.rdsi / one.upper) for state, one in zip(classes, each, strict=True)]
        assert ranks[scene.critical] == max(ranks)


def test_the_critical_source_need_not_be_that_of_the_largest_risk():
    # iso thresholds depend on the source: 0.67 behind a car at 25 m/s, 0.47 before a standing one
    settings, ego = RISK["iso"], user(0.0, 0.0, 25.0)
    users = road_users([29.0, 105.0], [0.0, 0.0], [25.0, 0.0], 0.0)
    moving, standing = (risk_of(ego, one, False, settings) for one in users.view(np.recarray))
    assert moving.lower > moving.rdsi > standing.rdsi > standing.lower
    scene = scene_risk(ego, users, NO_LINES, False, settings)
    assert (STATES[scene.state], scene.critical, scene.largest) == ("unknown", 1, moving.rdsi)


def test_an_empty_road_is_safe():
    for users in (around()[:0], road_users([150.0, -101.0], 0.0, 0.0, 0.0)):
        scene = scene_risk(user(0.0, 0.0, 25.0), users, NO_LINES, False, RiskSettings())
        assert scene == (0.0, 1.0, 1.0, 0, -1, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0)


def test_lines_count_in_the_sum_alone():
    lines = np.concatenate([marking("solid", 0.0, 1.0, 4.0), marking("edge", 1.0, 0.0, 4.0), marking("edge", 3, 1, 4)])
    ego, settings = user(0.0, 0.0, 25.0), RISK["iso"]
    without = scene_risk(ego, around()[:1], NO_LINES, False, settings)
    scene = scene_risk(ego, around()[:1], lines, False, settings)
    assert scene.markings == pytest.approx(1.0 + 0.3 * 0.25)
    assert scene.total == pytest.approx(without.total + scene.markings)
    assert STATES[scene.state_of_total] == "known_unsafe"
    assert scene[:6] == without[:6]


def test_only_those_on_a_list_are_looked_at():
    ego, settings, each = user(0.0, 0.0, 25.0), RISK["radial"], np.zeros(6)
    scene = scene_risk(ego, around(), NO_LINES, False, settings, np.array([0, 4]), each)
    assert np.flatnonzero(~np.isnan(each)).tolist() == [0, 4]
    assert scene.total == each[0] + each[4]
    assert scene.critical == 4


def chosen(ahead, beside, toward=0):
    out = np.zeros(6, int)
    count = neighbours(np.array(ahead, float), np.array(beside, float), 4.0, toward, out)
    return sorted(out[:count].tolist())


def test_neighbours_are_the_nearest_ahead_and_behind_in_three_lanes():
    ahead = [50, 20, -30, -10, 5, 70, -80, 12, -1, 3, -4]
    beside = [0, 0, 1, -1, 4, 4.4, 3.0, -4, -5, 8, -9]
    assert chosen(ahead, beside) == [1, 3, 4, 6, 7, 8]
    assert chosen(ahead, beside, toward=1) == [1, 4, 6]
    assert chosen(ahead, beside, toward=-1) == [1, 7, 8]
    assert chosen([], []) == []


def test_nobody_is_in_two_lanes():
    for offset in (-6.0, -2.0, 2.0, 6.0):
        assert len(chosen([10.0], [offset])) <= 1
    assert chosen([10.0, 12.0], [2.0, -2.0]) == [0, 1]
