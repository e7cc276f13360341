"""Benchmarks: `make bench`. Speed is a ratio measured in one run, because machines differ and drift."""

import time

import numba
import numpy as np
import pytest

from rss_shield import PRESETS, d_min_lateral, d_min_opposite_direction, d_min_same_direction, make
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.shield.definitions.occupancy import ROW_FIELDS, VEHICLE, Mover, Occupancy, occupy
from rss_shield.shield.definitions.unstructured import DANGEROUS, who_brakes
from rss_shield.shield.risk import RiskSettings, marking, road_users, scene_risk

PAIRS = 10_000


class TimedEgo(ShieldedEgo):
    """Counts the time the shield takes on its frames."""

    seconds = 0.0

    def _frame(self) -> None:
        start = time.perf_counter()
        super()._frame()
        TimedEgo.seconds += time.perf_counter() - start


@pytest.mark.parametrize(
    ("env_id", "steps"), [("highway-fast-v0", 60), ("highway-v0", 12)], ids=["20-vehicles", "50-vehicles"]
)
def test_cost_of_the_shield_per_frame(benchmark, env_id, steps, monkeypatch):
    monkeypatch.setattr("rss_shield.envs.highway.step.ShieldedEgo", TimedEgo)
    env = make(env_id)
    env.reset(seed=0)
    env.step(1)

    def drive():
        env.reset(seed=0)
        for _ in range(steps):
            *_, terminated, truncated, _ = env.step(1)
            if terminated or truncated:
                env.reset()

    TimedEgo.seconds = 0.0
    start = time.perf_counter()
    benchmark.pedantic(drive, rounds=3)
    total = time.perf_counter() - start
    share = TimedEgo.seconds / (total - TimedEgo.seconds)
    config = env.unwrapped.config
    frames = 3 * steps * config["simulation_frequency"] // config["policy_frequency"]
    benchmark.extra_info["shield_us_per_frame"] = round(1e6 * TimedEgo.seconds / frames)
    benchmark.extra_info["simulator_us_per_frame"] = round(1e6 * (total - TimedEgo.seconds) / frames)
    benchmark.extra_info["shield_share_percent"] = round(100 * share, 2)
    print(
        f"\n{env_id}: shield {1e6 * TimedEgo.seconds / frames:.0f} us per frame, simulator "
        f"{1e6 * (total - TimedEgo.seconds) / frames:.0f} us, share {100 * share:.2f} %"
    )


@pytest.mark.parametrize(
    "formula", [d_min_same_direction, d_min_opposite_direction, d_min_lateral], ids=lambda formula: formula.__name__
)
def test_batch_evaluation_of_distances(benchmark, formula):
    rng = np.random.default_rng(0)
    first, second = rng.uniform(0.0, 30.0, PAIRS), rng.uniform(0.0, 30.0, PAIRS)
    ego, other = PRESETS["slides"].ego, PRESETS["slides"].other
    formula(first, second, ego, other)
    benchmark(formula, first, second, ego, other)
    if benchmark.stats:
        print(f"\n{formula.__name__}: {1e9 * benchmark.stats.stats.median / PAIRS:.1f} ns per pair")


@pytest.mark.parametrize("lane_change", [False, True], ids=["following", "lane-change"])
@pytest.mark.parametrize("mode", ["iso", "radial"])
def test_risk_of_a_scene_of_50_road_users(benchmark, mode, lane_change):
    rng, settings = np.random.default_rng(0), RiskSettings.validated(mode=mode)
    x, y, vx = rng.uniform(-70.0, 70.0, 50), rng.uniform(-8.0, 8.0, 50), rng.uniform(15.0, 30.0, 50)
    users, ego = road_users(x, y, vx, 0.0), road_users(0.0, 0.0, 25.0, 0.0)[0]
    lines = np.concatenate([marking("striped", 1.5, 0.1, 4.0), marking("edge", 2.5, -0.1, 4.0)])
    scene_risk(ego, users, lines, lane_change, settings)
    benchmark(scene_risk, ego, users, lines, lane_change, settings)
    if benchmark.stats:
        print(f"\nrisk of 50 road users, {mode}: {1e6 * benchmark.stats.stats.median:.1f} us, called from Python")


def test_one_distance_of_ad_rss(benchmark):
    adrss = pytest.importorskip("tests.adrss_objects", reason="install the extra 'oracle'")
    ego, other = PRESETS["ad-rss"].ego, PRESETS["ad-rss"].other
    front, rear = adrss.become(adrss.new_object(), other, lon=20.0), adrss.become(adrss.new_object(), ego, lon=25.0)
    distance = adrss.physics.Distance(0.0)
    formula = adrss.rss.structured.calculateSafeLongitudinalDistanceSameDirection
    benchmark(formula, front, rear, distance)
    assert distance.mDistance == pytest.approx(d_min_same_direction(25.0, 20.0, ego, other), abs=1e-3)
    if benchmark.stats:
        print(f"\nad-rss, one same-direction distance: {1e6 * benchmark.stats.stats.median:.1f} us per call")


def test_one_distance_from_python(benchmark):
    ego, other = PRESETS["ad-rss"].ego, PRESETS["ad-rss"].other
    d_min_same_direction(25.0, 20.0, ego, other)
    benchmark(d_min_same_direction, 25.0, 20.0, ego, other)
    if benchmark.stats:
        print(f"\nd_min_same_direction, one pair from Python: {1e6 * benchmark.stats.stats.median:.1f} us per call")


# from far apart to crossing: pairs whose discs meet, so that directions are looked at; some safe, some not
SCENES = [
    Mover(16.0, 0.0, 0.0, 5.0, 0.0, 2.5, 1.0),
    Mover(33.0, 0.0, 0.0, 5.0, 0.0, 2.5, 1.0),
    Mover(28.0, 3.0, 3.0, 4.0, 0.0, 2.5, 1.0),
    Mover(14.0, 9.0, -2.0, 3.0, 0.0, 2.5, 1.0),
]
EGO = Mover(0.0, 0.0, 0.0, 5.0, 0.0, 2.5, 1.0)


@numba.njit
def open_space_pairs(times, ego, other, driver, steering, rows):
    """From two states to the answer of Def. 22, again and again; how often it was "dangerous"."""
    dangerous = 0
    for k in range(times):
        moved = Mover(ego.x + 1e-9 * k, ego.y, ego.heading, ego.v, ego.yaw_rate, ego.half_length, ego.half_width, 0.0)
        bounds_1 = occupy(moved, driver, steering, 0.1, rows[0], rows[1])
        bounds_2 = occupy(other, driver, steering, 0.1, rows[2], rows[3])
        one = Occupancy(moved, bounds_1, rows[0], rows[1])
        dangerous += who_brakes(one, Occupancy(other, bounds_2, rows[2], rows[3]), 0.0, 1.0) == DANGEROUS
    return dangerous


def test_one_pair_in_open_space(benchmark):
    driver, rows, times = PRESETS["ad-rss"].ego, np.zeros((4, 40, ROW_FIELDS)), 200

    def check():
        return [open_space_pairs(times, EGO, other, driver, VEHICLE, rows) for other in SCENES]

    answers = check()
    assert 0 < sum(answer > 0 for answer in answers) < len(SCENES)
    benchmark(check)
    if benchmark.stats:
        each = 1e6 * benchmark.stats.stats.median / times / len(SCENES)
        print(f"\nopen space, one pair from two states: {each:.1f} us on average of {len(SCENES)} scenes")


def test_one_pair_in_open_space_with_ad_rss(benchmark):
    adrss = pytest.importorskip("tests.adrss_objects", reason="install the extra 'oracle'")
    car = PRESETS["ad-rss"].ego
    pairs = [adrss.open_space_pair(car, EGO, other) for other in SCENES]

    def check():
        return [adrss.judge_open_space(pair) for pair in pairs]

    check()
    benchmark.pedantic(check, rounds=5)
    if benchmark.stats:
        each = 1e6 * benchmark.stats.stats.median / len(SCENES)
        print(f"\nad-rss, the same pairs: {each:.0f} us per call")
