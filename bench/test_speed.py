"""Benchmarks: `make bench`. Speed is a ratio measured in one run, because machines differ and drift."""

import time

import numpy as np
import pytest

from envs import make
from envs.highway import ShieldedEgo
from shield import PRESETS, d_min_lateral, d_min_opposite_direction, d_min_same_direction

PAIRS = 100_000


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
    monkeypatch.setattr("envs.wrapper.ShieldedEgo", TimedEgo)
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


def test_one_check_of_ad_rss(benchmark):
    core = pytest.importorskip("ad_rss.core", reason="install the extra 'oracle'", exc_type=ImportError)
    benchmark.extra_info["library"] = core.__name__
