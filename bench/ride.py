"""How a ride behind the shield feels: without and with anticipation, beside highway-env's own driver.

    python bench/ride.py                          every road and driver, tables and docs/ride.png, in minutes
    python bench/ride.py --write                  ... and docs/ride.md
    python bench/ride.py --envs highway-fast-v0 --episodes 1000

Drivers are FASTER, IDLE and random actions behind the shield; "monitor" is the same random driver without it, "IDM" is
highway-env's own driver in place of the ego. All play the same seeds.
"""

import dataclasses
import functools
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield import make, make_vec
from rss_shield.envs.fast.config import Unsupported
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.idm_ego import make_idm
from rss_shield.envs.options import Settings
from rss_shield.eval.files import write_text
from rss_shield.eval.pages import markdown
from rss_shield.eval.rollout import evaluate, run_episode
from rss_shield.eval.stats import paired_difference
from rss_shield.shield.lanes.pair import assess
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for
from rss_shield.shield.verdicts import AT_FAULT

ROADS = (
    *("highway-fast-v0", "highway-v0", "merge-v0", "merge-v1", "exit-v0", "two-way-v0", "u-turn-v0"),
    *("roundabout-v0", "intersection-v0"),
)
DRIVERS = ("faster", "idle", "random")
BEFORE, AFTER = "before", "after"
RULES = {BEFORE: Rules(anticipation=0.0, take_back=False), AFTER: Rules()}
LEFT, IDLE, RIGHT, FASTER = range(4)
FIRST_SEED = 800_000
PAGE, PLOT = Path("docs/ride.md"), Path("docs/ride.png")
HEADER = """# How a ride behind the shield feels

Written by `python bench/ride.py --write`. Before: without anticipation and with lane changes that are not taken back
(`Rules(anticipation=0.0, take_back=False)`). After: the default.

![Behind one leader](ride.png)
"""


@dataclasses.dataclass(frozen=True)
class Config:
    """Measure how a ride feels."""

    envs: tuple[str, ...] = ROADS
    episodes: int = 300  # per road, driver and shield
    idm_episodes: int = 30  # of highway-env's own driver
    lane_changes: int = 300  # episodes of random lane changes
    threads: int = 2
    write: bool = False  # docs/ride.md and docs/ride.png


# ---------------------------------------------------------------- episodes


def act(driver: str, rng: np.random.Generator, n: int, actions: int) -> np.ndarray:
    """The next actions of a driver in n environments that have so many meta-actions."""
    if driver == "random":
        return rng.integers(actions, size=n)
    if driver == "lanes":
        return np.where(rng.random(n) < 0.5, LEFT, RIGHT)
    return np.full(n, {"faster": FASTER, "idle": IDLE}[driver] - (0 if actions == 5 else (driver == "faster")))


def play(env_id: str, driver: str, mode: str, rules: Rules, episodes: int, threads: int) -> pd.DataFrame:
    """One row per episode, from the engine or, where it has no such road, from highway-env."""
    seeds, rng = range(FIRST_SEED, FIRST_SEED + episodes), np.random.default_rng(0)
    options: dict[str, Any] = {"rules": rules, "intent": "known"}
    actions = 3 if "intersection" in env_id else 5

    def batch(n: int) -> Any:
        return make_vec(env_id, n, mode, autoreset_mode=AutoresetMode.DISABLED, threads=threads, **options)

    try:
        make_vec(env_id, 1, mode, **options).close()
    except Unsupported:
        few = range(FIRST_SEED, FIRST_SEED + min(episodes, 20))
        rows = [
            run_episode(lambda: make(env_id, mode, **options), lambda _: act(driver, rng, 1, actions)[0], s)
            for s in few
        ]
        return pd.DataFrame(rows)
    return evaluate(batch, lambda seen: act(driver, rng, len(seen), actions), seeds, n_envs=256, keep_actions=False)


def play_idm(env_id: str, episodes: int) -> pd.DataFrame:
    """The same of highway-env's own driver, watched."""
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)

    return pd.DataFrame([run_episode(lambda: make_idm(env_id), lambda _: IDLE, seed) for seed in seeds])


class Row(NamedTuple):
    """One line of the table."""

    driver: str
    shield: str
    n: int
    ret: str
    speed: str
    rms_jerk: str
    p99_jerk: str
    hard: str
    comfortable: str
    response: str
    anticipated: str
    change: str
    danger: str
    fault: str


HEADINGS = Row(
    "driver",
    "shield",
    "n",  # type: ignore[arg-type]
    "return",
    "speed [m/s]",
    "rms jerk [m/s³]",
    "99 % jerk [m/s³]",
    "a < -3 [% of frames]",
    "comfortable [% of frames]",
    "duty [% of frames]",
    "anticipated [% of frames]",
    "mean change [m/s²]",
    "dangerous pair-frames per episode",
    "ego at fault / none / broken duties",
)


def row(driver: str, shield: str, frame: pd.DataFrame) -> Row:
    weight = frame["time"] / frame["time"].sum()

    def share(name: str) -> float:
        return float((frame[name] * weight).sum())

    at_fault, none = frame["blame"].isin(AT_FAULT).sum(), (frame["blame"] == "none").sum()
    return Row(
        driver,
        shield,
        len(frame),
        f"{frame['return'].mean():.2f}",
        f"{frame['speed'].mean():.1f}",
        f"{np.sqrt((frame['rms_jerk'] ** 2 * weight).sum()):.1f}",
        f"{share('p99_jerk'):.0f}",
        f"{100 * share('hard_braking_share'):.1f}",
        f"{100 * share('comfortable_share'):.0f}",
        f"{100 * share('override_share'):.0f}",
        f"{100 * share('anticipation_share'):.0f}",
        f"{share('mean_acceleration_change'):.1f}",
        f"{frame['dangerous_pairs'].mean():.1f}",
        f"{at_fault} / {none} / {frame['broken_duties'].sum()}",
    )


def of_road(env_id: str, config: Config) -> str:
    """The table of one road, and what anticipation did to the return."""
    rows, notes = [HEADINGS], []
    for driver in DRIVERS:
        frames = {
            name: play(env_id, driver, "override", rules, config.episodes, config.threads)
            for name, rules in RULES.items()
        }
        rows += [row(driver.upper(), name, frame) for name, frame in frames.items()]
        returns = frames[AFTER]["return"].to_numpy(), frames[BEFORE]["return"].to_numpy()
        if driver != "random":  # random actions are not paired
            d = paired_difference(*returns, np.random.default_rng(0))
            notes.append(f"{driver.upper()}: {d.value:+.3f} [{d.low:+.3f}, {d.high:+.3f}]")
    rows.append(row("RANDOM", "monitor", play(env_id, "random", "monitor", Rules(), config.episodes, config.threads)))
    if config.idm_episodes:
        rows.append(row("IDM", "monitor", play_idm(env_id, config.idm_episodes)))
    difference = f"Return after minus before, paired, with its 95 % interval: {'; '.join(notes)}.\n"
    return f"## {env_id}\n\n{markdown(rows)}\n\n{difference}"


# ---------------------------------------------------------------- between two lanes


LONG = 1.2  # a stretch between two lanes [s] that asks for an explanation


def off_centre(y: np.ndarray) -> np.ndarray:
    """Is the ego more than 1 m off the centre of every lane, on a road with lanes every 4 m? `[T]` positions."""
    return np.abs((y + 2.0) % 4.0 - 2.0) > 1.0


def longest(off: np.ndarray) -> slice:
    """The longest stretch of frames that are `off` `[T]`."""
    best, start = slice(0, 0), 0
    for t, is_off in enumerate(off):
        if not is_off:
            start = t + 1
        elif t + 1 - start > best.stop - best.start:
            best = slice(start, t + 1)
    return best


def frames_free(seed: int, actions: np.ndarray, rules: Rules) -> tuple[int, int]:
    """The longest stretch of an episode between two lanes, played again on highway-env.

    Args:
      seed: of the episode.
      actions: `[30]` meta-actions.

    Returns:
      (frames, free): its frames, and those of them on which the shield let the ego move sideways as fast as it asked,
      or on which it did not get on toward the side on which it left.
    """
    env = make("highway-fast-v0", rules=rules)
    env.reset(seed=seed)
    ego: Any = env._ego  # type: ignore[attr-defined]
    places, held, inner = [], [], ego._frame

    def watched() -> None:
        wish = ego.vehicle.action["steering"]
        inner()
        places.append(ego.vehicle.position[1])
        # a steering angle nearer to zero or beyond it turns the car less toward where it is asked to go
        held.append(abs(ego.vehicle.action["steering"] - wish) > 1e-9)

    ego._frame = watched
    for action in actions:
        _, _, terminated, truncated, _ = env.step(int(action))
        if terminated or truncated:
            break
    y = np.array(places)
    stretch = longest(off_centre(y))
    steps = np.diff(y, append=y[-1])[stretch]
    gets_on = steps * steps.sum() > 0.0
    return stretch.stop - stretch.start, int((~np.array(held)[stretch] | ~gets_on).sum())


def between_lanes(config: Config) -> str:
    rows: list[Any] = [
        (
            *("actions", "shield", "n", "longest [s]", f"above {LONG} s"),
            *("most of it that is no lane change at the limits [s]", "mean [s]"),
        )
    ]
    n, dt = config.lane_changes, 0.2
    for driver in ("lanes", "random"):
        for name, mode, rules in (
            ("none", "monitor", Rules()),
            (BEFORE, "override", RULES[BEFORE]),
            (AFTER, "override", Rules()),
        ):
            env = make_vec("highway-fast-v0", n, mode, rules=rules, threads=config.threads)
            rng, taken = np.random.default_rng(1), []
            env.reset(seed=FIRST_SEED)
            env.recording.choose(range(n))  # type: ignore[attr-defined]
            for _ in range(30):
                taken.append(act(driver, rng, n, 5))
                env.step(taken[-1])
            finished = {log.env: log for log in reversed(env.recording.finished)}  # type: ignore[attr-defined]
            env.close()
            stretches = {e: longest(off_centre(log.cars[:, 0]["y"])) for e, log in finished.items()}
            seconds = {e: dt * (stretch.stop - stretch.start) for e, stretch in stretches.items()}
            long = [e for e, length in seconds.items() if length > LONG + 1e-9]
            free = "-"
            if mode == "override":
                again = [frames_free(FIRST_SEED + e, np.array(taken)[:, e], rules) for e in long]
                free = f"{max((dt * frames for _, frames in again), default=0.0):.1f}"
            lengths = list(seconds.values())
            rows.append((driver, name, n, f"{max(lengths):.1f}", len(long), free, f"{np.mean(lengths):.2f}"))
    text = f"""Longest stretch more than 1 m off the centre of every lane, highway-fast-v0 (frames of {dt} s). A lane
change crosses 2 m there, and the published limits of lateral speed and heading (C1y, `heading_bound`) let a car at
15 m/s do so in 1.3 s at best. Episodes above {LONG} s are therefore played again on highway-env, and in their longest
stretches those frames are counted on which the shield did *not* hold the steering to such a limit, or the car did not
get on toward the side on which it left: what is not a lane change at the limits."""
    return f"## Between two lanes\n\n{text}\n\n{markdown(rows)}\n"


# ---------------------------------------------------------------- what it costs


def on_highway_env(rules: Rules, seeds: range) -> float:
    """Time of the shield per frame [µs], the measure of the ride included."""
    spent = frames = 0.0
    for seed in seeds:
        env = make("highway-fast-v0", rules=rules)
        env.reset(seed=seed)
        ego: Any = env._ego  # type: ignore[attr-defined]
        inner = ego._frame

        def timed(inner=inner) -> None:
            nonlocal spent, frames
            begin = time.perf_counter()
            inner()
            spent += time.perf_counter() - begin
            frames += 1

        ego._frame = timed
        done = False
        while not done:
            _, _, terminated, truncated, _ = env.step(FASTER)
            done = terminated or truncated
    return 1e6 * spent / frames


def in_engine(shield: str | None, rules: Rules) -> float:
    """Time per frame of the whole engine, one thread [µs]."""
    env = make_vec("highway-fast-v0", 256, shield, rules=rules)
    env.reset(seed=FIRST_SEED)
    actions = np.full(256, FASTER)
    env.step(actions)
    begin = time.process_time()
    for _ in range(20):
        env.step(actions)
    spent = time.process_time() - begin
    env.close()
    return 1e6 * spent / (20 * 256 * 5)


def price() -> str:
    runs: dict[str, list[float]] = {name: [] for name in (*RULES, "engine bare", *(f"engine {name}" for name in RULES))}
    for k in range(5):
        for name, rules in RULES.items():
            runs[name].append(on_highway_env(rules, range(FIRST_SEED + 3 * k, FIRST_SEED + 3 * k + 3)))
            runs[f"engine {name}"].append(in_engine("override", rules))
        runs["engine bare"].append(in_engine(None, Rules()))
    best = {name: float(np.min(times)) for name, times in runs.items()}
    rows: list[Any] = [("where", BEFORE, AFTER)]
    rows.append(("highway-env, shield per frame [µs]", *(f"{best[name]:.0f}" for name in RULES)))
    rows.append(
        ("engine, shield per frame [µs]", *(f"{best[f'engine {name}'] - best['engine bare']:.2f}" for name in RULES))
    )
    bare = f"{best['engine bare']:.2f} µs"
    text = f"The least of five runs in turn, always FASTER on highway-fast-v0. The engine without a shield: {bare}."
    return f"## What it costs\n\n{text}\n\n{markdown(rows)}\n"


# ---------------------------------------------------------------- behind one leader


def behind_a_leader(kind: str, dt: float = 1 / 15, seconds: float = 40.0) -> pd.DataFrame:
    """Speed, acceleration, gap and required gap over time behind a leader that slows down and speeds up again."""
    road = Road(RoadNetwork.straight_road_network(1, speed_limit=30, length=3000), np_random=np.random.default_rng(0))
    ego = (IDMVehicle if kind == "IDM" else MDPVehicle)(road, [0.0, 0.0], heading=0.0, speed=25.0)
    ego.target_speed = 30.0
    leader = Vehicle(road, [70.0, 0.0], speed=22.0)
    road.vehicles += [ego, leader]
    preset, rules = PRESETS["simulator"], RULES.get(kind, Rules())
    table = table_for(preset, rules, dt)
    shield = ShieldedEgo(ego, Settings(table, kind != "IDM"), record=True)
    for k in range(int(seconds / dt)):
        t = k * dt
        leader.action["acceleration"] = -3.0 if 10.0 <= t < 14.0 else 1.0 if 20.0 <= t < 32.0 else 0.0
        road.act()
        road.step(dt)
    frames = shield.record or []
    pairs = [assess(frame.ego, frame.users[0], table) for frame in frames]
    speeds = np.array([frame.poses[-1, 3] for frame in frames])
    return pd.DataFrame(
        {
            "t": np.arange(len(frames)) * dt,
            "speed": speeds,
            "leader": [frame.poses[0, 3] for frame in frames],
            "acceleration": np.append(np.diff(speeds) / dt, np.nan),
            "gap": [pair.gap_lon for pair in pairs],
            "required": [pair.gap_lon - pair.margin_lon for pair in pairs],
        }
    )


def plot(path: Path) -> None:
    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    kinds = ((BEFORE, "shield, no anticipation"), (AFTER, "shield, with anticipation"), ("IDM", "highway-env's driver"))
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    grid = figure.subplots(3, 3, sharex=True, sharey="row")
    for column, (kind, title) in enumerate(kinds):
        rides = behind_a_leader(kind)
        speed, acceleration, gap = grid[:, column]
        speed.set_title(title, loc="left")
        speed.plot(rides["t"], rides["leader"], color="0.6", label="leader")
        speed.plot(rides["t"], rides["speed"], color="#0072B2", label="ego")
        acceleration.plot(rides["t"], rides["acceleration"], color="#D55E00", lw=0.8)
        gap.plot(rides["t"], rides["gap"], color="#0072B2", label="gap")
        gap.plot(rides["t"], rides["required"], color="0.3", ls="--", label="required (Def. 1)")
        gap.set_xlabel("time [s]")
        jerk = np.diff(rides["acceleration"].dropna()) * 15
        acceleration.text(
            0.02, 0.04, f"rms jerk {np.sqrt(np.mean(jerk**2)):.1f} m/s³", transform=acceleration.transAxes
        )
    for axes, label in zip(grid[:, 0], ("speed [m/s]", "acceleration [m/s²]", "gap [m]"), strict=True):
        axes.set_ylabel(label)
    grid[0, 0].legend(frameon=False)
    grid[2, 0].legend(frameon=False)
    figure.savefig(path, dpi=130)


def main(config: Config) -> int:
    unknown = [env_id for env_id in config.envs if env_id not in ROADS]
    if unknown:
        print(f"envs = {unknown[0]!r}: expected some of {', '.join(ROADS)}", file=sys.stderr)
        return 2
    if config.write:
        plot(PLOT)
    parts = [HEADER]
    for part in (
        lambda: between_lanes(config),
        price,
        *(functools.partial(of_road, env, config) for env in config.envs),
    ):
        parts.append(part())
        print(parts[-1], flush=True)
        if config.write:
            write_text(PAGE, "\n".join(parts))
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
