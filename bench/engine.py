"""Speed of the compiled engine against highway-env, side by side in one run.

    python bench/engine.py [--seconds 5] [--envs highway-fast-v0 highway-v0 ...]

Random actions; observations, infos and autoreset included. Decisions are counted per second of CPU
time of this process, so other load on the machine disturbs them little.
"""

import argparse
import resource
import time

import numpy as np

import envs

SIZES = (1, 64, 1024, 4096)


def decisions_per_cpu_second(env, seconds: float) -> float:
    """Steps of all environments per second of CPU time, after a warm-up."""
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    n = env.num_envs
    actions = rng.integers(env.single_action_space.n, size=(64, n))
    env.step(actions[0])
    start, steps = time.process_time(), 0
    while time.process_time() - start < seconds:
        env.step(actions[steps % 64])
        steps += 1
    return steps * n / (time.process_time() - start)


def against_stock(env_id: str, seconds: float) -> None:
    """One environment id: stock, then the engine at several sizes, then with the shield."""
    stock = decisions_per_cpu_second(envs.make_vec(env_id, 1, shield=None, backend="highway-env"), seconds)
    print(f"{env_id}: highway-env {stock:.1f} decisions/s per core")
    for n in SIZES:
        speed = decisions_per_cpu_second(envs.make_vec(env_id, n, shield=None), seconds)
        gain = speed / stock
        print(f"  {n:5d} environments: {speed:9.0f} decisions/s per core, {1e6 / speed:6.1f} us, {gain:6.0f} x")
    bare = decisions_per_cpu_second(envs.make_vec(env_id, 1024, shield=None), seconds)
    try:
        guarded = decisions_per_cpu_second(envs.make_vec(env_id, 1024, shield="override"), seconds)
    except ValueError as error:
        print(f"  no shield: {error}")
        return
    print(f"  1024 with the shield: {guarded:9.0f} decisions/s per core, {bare / guarded - 1:+.0%} time")


def against_size(seconds: float) -> None:
    """Growth with the number of vehicles at constant density; the exponent is a fit in log-log."""
    counts, times = [20, 50, 100, 200, 400], []
    for count in counts:
        config = {"vehicles_count": count, "duration": 30}
        times.append(1 / decisions_per_cpu_second(envs.make_vec("highway-fast-v0", 64, None, config=config), seconds))
        print(f"  {count:4d} vehicles: {times[-1] * 1e6:7.1f} us per decision")
    print(f"  exponent {np.polyfit(np.log(counts), np.log(times), 1)[0]:.2f}")


def against_threads(seconds: float) -> None:
    """Wall-clock gain of a second thread."""
    speeds = []
    for threads in (1, 2):
        env = envs.make_vec("highway-fast-v0", 1024, None, threads=threads)
        env.reset(seed=0)
        env.step(np.ones(1024, int))
        start, steps = time.perf_counter(), 0
        while time.perf_counter() - start < seconds:
            env.step(np.ones(1024, int))
            steps += 1
        speeds.append(steps * 1024 / (time.perf_counter() - start))
    print(f"  two threads: {speeds[1] / speeds[0]:.2f} x one thread (wall clock, {speeds[0]:.0f} decisions/s)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="CPU seconds per measurement")
    parser.add_argument("--envs", nargs="+", default=["highway-fast-v0", "highway-v0"])
    parser.add_argument("--growth", action="store_true", help="also measure growth with vehicles and threads")
    arguments = parser.parse_args()
    for env_id in arguments.envs:
        against_stock(env_id, arguments.seconds)
    if arguments.growth:
        against_size(arguments.seconds)
        against_threads(arguments.seconds)
    print(f"largest memory of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
