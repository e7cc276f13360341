"""Benchmarks: `make bench`. Speed is a ratio measured in one run, because machines differ and drift."""

import time

import numpy as np
import pytest

from envs import make
from envs.highway import ShieldedEgo
from shield import PRESETS, d_min_lateral, d_min_opposite_direction, d_min_same_direction
from shield.risk import RiskSettings, marking, road_users, scene_risk

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
    monkeypatch.setattr("envs.shielding.ShieldedEgo", TimedEgo)
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
