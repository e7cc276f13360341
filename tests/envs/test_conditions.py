"""Roads that are slippery in places, and kinds of vehicles, on highway-env and in the engine."""

import copy
import math

import numpy as np
import pytest

from rss_shield import make, make_vec
from rss_shield.envs.conditions import ground_of, group_of, held, pieces_of, shares_of
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.envs.roads.lanes import reach_of, reach_on
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.ground import params_at
from rss_shield.shield.params import GRAVITY, PRESETS, ROADS, Rules
from rss_shield.shield.table import table_for
from rss_shield.shield.trace import load, save

TABLE = table_for(PRESETS["simulator"], Rules(), 0.2)
PATCHES = {(250.0, 330.0): "ice", (400.0, 500.0): "wet"}
MIXED = {"conditions": PATCHES, "classes": {"truck": 0.3, "motorcycle": 0.1}}


def drive(env, seed, steps, action=3):
    env.reset(seed=seed)
    infos = []
    for _ in range(steps):
        *_, terminated, truncated, info = env.step(action)
        infos.append(info)
        if terminated or truncated:
            break
    return infos


def test_what_nobody_names_is_dry():
    dry = -math.inf, "dry"
    assert pieces_of(None) == [dry] and pieces_of("ice") == [(-math.inf, "ice")]
    assert pieces_of(PATCHES) == [dry, (250.0, "ice"), (330.0, "dry"), (400.0, "wet"), (500.0, "dry")]
    assert pieces_of({(0, 5): "ice", (5, math.inf): "snow"}) == [dry, (0.0, "ice"), (5.0, "snow")]
    assert pieces_of({(-math.inf, 3): "wet"}) == [(-math.inf, "wet"), (3.0, "dry")]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"conditions": "mud"}, "conditions = 'mud': expected one of dry, wet, snow, ice"),
        ({"conditions": {(5.0, 5.0): "ice"}}, r"range \(5.0, 5.0\): expected two places in x"),
        ({"conditions": {(0.0, 9.0): "ice", (5.0, 20.0): "wet"}}, "overlaps"),
        ({"conditions": 3}, "conditions = 3: expected None"),
        ({"classes": {"tram": 0.1}}, "classes = 'tram': expected one of car, motorcycle, truck, bus"),
        ({"classes": {"truck": 0.7, "bus": 0.5}}, "add up to at most 1"),
        ({"classes": ["truck"]}, r"classes = \['truck'\]: expected None or a dict"),
    ],
)
def test_nonsense_is_refused_by_name(options, message):
    for build in (make, lambda env_id, **given: make_vec(env_id, 1, **given)):
        with pytest.raises(ValueError, match=message):
            build("highway-fast-v0", **options)


def test_logs_say_that_parameters_changed_and_are_not_audited(tmp_path):
    env = make("highway-fast-v0", "monitor", record=True, **MIXED)
    save(record_trace(env, lambda _: 3, seed=0), tmp_path / "ice.npz")
    with pytest.raises(ValueError, match="without conditions and classes"):
        env.audit()
    trace = load(tmp_path / "ice.npz")
    assert trace.meta["conditions"] == [[[250.0, 330.0], "ice"], [[400.0, 500.0], "wet"]]
    assert any("judged by one table" in note for note in judge_trace(trace).notes)


def test_what_has_no_shield_or_no_lanes_is_refused():
    with pytest.raises(ValueError, match="expected None without a shield"):
        make("highway-fast-v0", None, conditions="ice")
    with pytest.raises(ValueError, match="where roads cross"):
        make("intersection-v0", conditions=PATCHES)
    with pytest.raises(ValueError, match="where roads cross"):
        make_vec("intersection-v0", 1, classes={"bus": 0.5})


def test_classes_are_drawn_by_their_shares():
    assert shares_of({"bus": 0.25, "truck": 0.5}) == {"car": 0.25, "bus": 0.25, "truck": 0.5}
    shares = np.array([0.25, 0.5, 1.0])
    drawn = np.bincount([group_of(np.uint64(3), i, shares) for i in range(4000)])
    assert drawn / 4000 == pytest.approx([0.25, 0.25, 0.5], abs=0.03)


def test_tyres_hold_what_the_road_admits_and_brakes_what_the_class_has():
    ground = ground_of(TABLE, PATCHES, {"truck": 0.5})
    ice = 0.5 * (ROADS["ice"].low + ROADS["ice"].high) * GRAVITY
    assert held(-6.0, ground, 300.0, -1) == pytest.approx(-ice) and held(3.0, ground, 300.0, 1) == pytest.approx(ice)
    assert held(-6.0, ground, 100.0, -1) == -6.0 and held(-6.0, ground, 100.0, 0) == -6.0
    assert held(-6.0, ground, 100.0, 1) == pytest.approx(-6.0 * 5.0 / 6.43)


def test_a_dry_road_with_cars_is_what_it_was():
    # friction of a dry road is above every limit of the simulator
    plain, dry = make("highway-fast-v0"), make("highway-fast-v0", conditions="dry", classes={"car": 1.0})
    for seed in (0, 1):
        for info, other in zip(drive(plain, seed, 20), drive(dry, seed, 20), strict=True):
            assert info["shield"] == other["shield"] and info["speed"] == other["speed"]


def test_on_ice_the_ego_keeps_far_more_distance_and_is_not_at_fault():
    gaps = {}
    for name in ("dry", "ice"):
        env = make("highway-fast-v0", conditions=name, config={"vehicles_count": 8})
        infos = [info for seed in range(3) for info in drive(env, seed, 40)]
        assert not any(info["blame"] in ("ego", "both") for info in infos)
        assert not any(info["shield"]["broken_duties"] for info in infos)
        gaps[name] = np.mean([info["speed"] for info in infos])
    assert gaps["ice"] < gaps["dry"] - 1.0


def test_an_environment_is_copied_with_its_ground():
    env = make("highway-fast-v0", **MIXED)
    drive(env, 2, 3)
    other = copy.deepcopy(env)
    assert [env.step(3)[4]["speed"] for _ in range(6)] == [other.step(3)[4]["speed"] for _ in range(6)]


@pytest.mark.parametrize("sensing", [None, {"along": 0.5, "misses": 0.2, "inflate": True}])
def test_both_simulators_drive_on_the_same_ground(sensing):
    told = []
    for backend in ("fast", "highway-env"):
        envs = make_vec("highway-fast-v0", 2, backend=backend, sensing=sensing, **MIXED)
        rng, rows = np.random.default_rng(0), [envs.reset(seed=21)[0]]
        for _ in range(40):
            observations, rewards, _, _, infos = envs.step(rng.choice([0, 1, 2, 3, 3, 3, 4], 2))
            shield = infos["shield"]
            rows += [observations, rewards, infos["speed"], shield["override_fraction"], shield["dangerous_pairs"]]
            rows.append(infos["blame"])
        told.append(rows)
    for value, other in zip(*told, strict=True):
        assert np.array_equal(value, other)


@pytest.mark.parametrize(
    "classes", [{"truck": 0.3, "motorcycle": 0.1}, {"motorcycle": 0.1, "truck": 0.3}, {"bus": 1.0}]
)
def test_roads_are_known_as_far_as_anybody_anywhere_can_matter(classes):
    ground = ground_of(TABLE, PATCHES, classes)
    needs = [
        reach_of(params_at(ground.ego, i), params_at(ground.other, k), TABLE.dt)
        for i in range(len(ground.ego))
        for k in range(len(ground.other))
    ]
    assert reach_on(TABLE, ground) == max(needs) > reach_on(TABLE, None)
