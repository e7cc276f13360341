"""What each filter of danger zones costs and misses, on random scenes of an X junction.

    python bench/danger_zones.py                      300 scenes with 1, 2, 4 and 8 cars per arm (20 s)
    python bench/danger_zones.py --scenes 3000        narrower intervals
    python bench/danger_zones.py --egos first         only egos that are first on their lane
    python bench/danger_zones.py --truth fence        forgive what the geofence itself misses

One lane per arm; every car turns left, goes straight or turns right with equal chance. Each car inside
the geofence is the ego in turn. The truth is brute force over all cars with known intents: *recall* is
the share of its active zones that a filter examines, *alarms* the share of its egos with any active zone
that keep one. Beside each value stands the published one (tests/data/v2x-examples.json), whose scenes
are described only by what is above: first distances, gaps and speeds are options, chosen such that the
number of cars inside the geofence and the share of active zones come out like the published ones.
"""

import dataclasses
import json
import sys
import time
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from rss_shield.eval.stats import wilson
from rss_shield.shield.junctions.danger_zones import (
    FILTERS,
    NONE,
    Cars,
    ConflictTable,
    DangerRules,
    candidates,
    conflict_table,
    danger_zones,
)
from rss_shield.shield.junctions.danger_zones import within_geofence as inside_fence

PUBLISHED = Path(__file__).parent.parent / "tests" / "data" / "v2x-examples.json"
PUBLISHED_NAMES = {
    "all": "all",
    "geofence": "geofence",
    "table": "table",
    "walk": "walk",
    "first-conflicting": "leader_conf",
    "first": "leader_any",
}
STOP_LINE = 11.0  # distance from the centre [m]
HALF_LANE = 2.0  # [m]
TURNS = {"R": -1, "S": 2, "L": 1, "U": 0}  # exit arm minus approach arm
STEP = 0.1  # between points of a centre line [m]


class Junction(NamedTuple):
    """Manoeuvres of a junction: approach lanes 0-3 of the arms S, W, N, E; exit lanes likewise."""

    names: list[str]  # arm and turn, like "0L"
    paths: list[np.ndarray]  # [P, 2] each; x east, y south [m]
    approaches: list[int]
    exits: list[int]

    def table(self) -> ConflictTable:
        return conflict_table(self.paths, self.approaches, self.exits)


def x_junction(turns: str = "RSL", arms: tuple[int, ...] = (0, 1, 2, 3)) -> Junction:
    """highway-env's intersection (right turns of radius 9 m, left ones of 13 m); three arms make a T."""
    junction = Junction([], [], [], [])
    for arm in arms:
        for turn in turns:
            exit_arm = (arm + TURNS[turn]) % 4
            if exit_arm in arms:
                junction.names.append(f"{arm}{turn}")
                junction.paths.append(rotated(path_from_south(turn), arm))
                junction.approaches.append(arm)
                junction.exits.append(exit_arm)
    return junction


def path_from_south(turn: str) -> np.ndarray:
    """Centre line of one manoeuvre of the south arm, [P, 2]."""
    inner, outer = HALF_LANE, STOP_LINE
    match turn:
        case "S":
            return np.column_stack([np.full(2, inner), [outer, -outer]])
        case "R":
            return arc((outer, outer), outer - inner, np.pi, 1.5 * np.pi)
        case "L":
            return arc((-outer, outer), outer + inner, 0.0, -0.5 * np.pi)
        case "U":
            return arc((0.0, outer), inner, 0.0, -np.pi)
    raise ValueError(f"turn = {turn!r} is unknown: expected one of {', '.join(TURNS)}")


def arc(centre: tuple[float, float], radius: float, start: float, end: float) -> np.ndarray:
    angle = np.linspace(start, end, int(np.ceil(radius * abs(end - start) / STEP)) + 1)
    return np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def rotated(points: np.ndarray, quarters: int) -> np.ndarray:
    """Points [..., 2] turned by so many quarters, from x toward y."""
    for _ in range(quarters % 4):
        points = np.stack([-points[..., 1], points[..., 0]], axis=-1)
    return points


def position_at(path: np.ndarray, s: float) -> np.ndarray:
    """Point [2] at path coordinate s; before the beginning and past the end the road goes on straight."""
    ways = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=-1).cumsum()])
    k = int(np.clip(np.searchsorted(ways, s, side="right") - 1, 0, len(path) - 2))
    return path[k] + (s - ways[k]) / (ways[k + 1] - ways[k]) * (path[k + 1] - path[k])


def place(junction: Junction, table: ConflictTable, manoeuvre: Any, s: Any, speed: Any) -> Cars:
    """Cars on their paths."""
    positions = [position_at(junction.paths[m], si) for m, si in zip(manoeuvre, s, strict=True)]
    approach = np.array(junction.approaches)[np.asarray(manoeuvre)]
    return Cars.validated(table, approach, manoeuvre, s, speed, positions)


# ---------------------------------------------------------------- Monte Carlo


@dataclasses.dataclass(frozen=True)
class Config:
    """Count pair tests, and what they miss."""

    cars_per_arm: tuple[int, ...] = (1, 2, 4, 8)
    scenes: int = 300  # per row
    seed: int = 0
    egos: Literal["any", "first"] = "any"  # every car inside the geofence, or those first on their lane
    truth: Literal["all", "fence"] = "all"  # zones with every car, or with those inside the geofence
    first_distance: tuple[float, float] = (5.0, 20.0)  # of the first car to the stop line, uniform [m]
    gap: tuple[float, float] = (8.0, 14.0)  # between cars of one arm, centre to centre, uniform [m]
    speed: tuple[float, float] = (6.0, 10.0)  # uniform [m/s]
    tau: float = 1.5  # [s]
    t_sens: float = 6.0  # [s]
    radius: float = 60.0  # of the geofence [m]


@dataclasses.dataclass
class Tally:
    """Sums over all egos of all scenes, for one filter or for assuming straight."""

    egos: int = 0
    tests: int = 0  # cars examined
    zones: int = 0  # truly active zones
    found: int = 0  # of these, examined and active
    claimed: int = 0  # zones called active
    alarms: int = 0  # egos with a truly active zone
    kept: int = 0  # of these, egos that know of one
    scene_tests: int = 0  # pairs that either car examines
    scene_arms: int = 0  # of these, pairs from different arms
    scene_zones: int = 0  # pairs with an active zone, inside the fence
    scene_found: int = 0
    scene_claimed: int = 0
    scene_apart: int = 0  # of the pairs claimed, those whose paths have no conflict
    calls: int = 0  # egos played, and the time it took [s]
    seconds: float = 0.0

    def add_ego(self, examined: np.ndarray, claimed: np.ndarray, truth: np.ndarray) -> None:
        self.egos += 1
        self.tests += int(examined.sum())
        self.zones += int(truth.sum())
        self.found += int((claimed & truth).sum())
        self.claimed += int(claimed.sum())
        self.alarms += bool(truth.any())
        self.kept += bool((claimed & truth).any())

    def add_scene(
        self, examined: np.ndarray, claimed: np.ndarray, truth: np.ndarray, conflict: np.ndarray, other_arm: np.ndarray
    ) -> None:
        """Pairs of one scene: [N, N], row = ego."""
        self.scene_tests += pairs(examined)
        self.scene_arms += pairs(examined & other_arm)
        self.scene_zones += pairs(truth)
        self.scene_found += pairs(claimed & (truth | truth.T))
        self.scene_claimed += pairs(claimed)
        self.scene_apart += pairs(claimed & ~conflict)


def pairs(matrix: np.ndarray) -> int:
    """Unordered pairs of which at least one side is marked."""
    return int(np.triu(matrix | matrix.T, 1).sum())


def random_cars(
    junction: Junction, table: ConflictTable, cars_per_arm: int, config: Config, rng: np.random.Generator
) -> Cars:
    """One scene: so many cars before the stop line of each arm."""
    arms = len(set(junction.approaches))
    distance = rng.uniform(*config.first_distance, (arms, 1))
    gaps = rng.uniform(*config.gap, (arms, cars_per_arm))
    s = -(distance + np.cumsum(gaps, axis=1) - gaps[:, :1])
    manoeuvre = np.concatenate(
        [rng.choice(np.flatnonzero(np.array(junction.approaches) == arm), cars_per_arm) for arm in range(arms)]
    )
    return place(junction, table, manoeuvre, s.ravel(), rng.uniform(*config.speed, s.size))


def play(cars_per_arm: int, config: Config) -> dict[str, Tally]:
    """Tallies of every filter, and of "straight", over all scenes with so many cars per arm."""
    junction = x_junction()
    table = junction.table()
    rng = np.random.default_rng([config.seed, cars_per_arm])
    tallies = {name: Tally() for name in (*FILTERS, "straight")}
    for _ in range(config.scenes):
        cars = random_cars(junction, table, cars_per_arm, config, rng)
        tally_scene(tallies, table, cars, config)
    return tallies


def tally_scene(tallies: dict[str, Tally], table: ConflictTable, cars: Cars, config: Config) -> None:
    known = DangerRules(tau=config.tau, t_sens=config.t_sens, radius=config.radius).validated()
    straight = known._replace(intent="straight")
    inside = inside_fence(table, cars, config.radius)
    n = len(cars.s)
    truth, conflict = np.zeros((n, n), bool), np.zeros((n, n), bool)
    reference = "all" if config.truth == "all" else "geofence"
    for ego in np.flatnonzero(inside).tolist():
        zones = danger_zones(table, cars, ego, candidates(reference, table, cars, ego, known), known)
        truth[ego], conflict[ego] = zones.active, zones.kind != NONE
    for name, tally in tallies.items():
        filter_name, rules = ("geofence", straight) if name == "straight" else (name, known)
        examined, claimed = np.zeros((n, n), bool), np.zeros((n, n), bool)
        egos = range(n) if name == "all" else np.flatnonzero(inside).tolist()
        start = time.perf_counter()
        for ego in egos:
            examined[ego] = candidates(filter_name, table, cars, ego, rules)
            claimed[ego] = danger_zones(table, cars, ego, examined[ego], rules).active
        tally.seconds += time.perf_counter() - start
        tally.calls += len(egos)
        for ego in np.flatnonzero(inside & is_ego(cars, config.egos)).tolist():
            tally.add_ego(examined[ego], claimed[ego], truth[ego])
        tally.add_scene(examined, claimed, truth, conflict, cars.approach[:, None] != cars.approach)


def is_ego(cars: Cars, egos: str) -> np.ndarray:
    """[N] bool: every car, or those first on their lane."""
    if egos == "any":
        return np.ones(len(cars.s), bool)
    same_lane = cars.approach[:, None] == cars.approach
    return ~(same_lane & (cars.s[None] > cars.s[:, None])).any(axis=1)


# ---------------------------------------------------------------- tables


def share(k: int, n: int) -> str:
    rate = wilson(k, n)
    return f"{rate.value:.3f} [{rate.low:.3f}, {rate.high:.3f}]"


def per_ego(results: dict[int, dict[str, Tally]], config: Config, published: dict[str, Any]) -> Table:
    columns = ("cars per arm", "filter", "tests", "published", "recall", "published", "alarms", "published", "µs")
    table = Table(*columns, title=f"Per ego ({config.egos}); µs: choosing and testing, one ego, this machine")
    for q, tallies in results.items():
        for name in FILTERS:
            tally = tallies[name]
            told = published["per_ego"].get(f"{q}/{config.egos}", {}).get(PUBLISHED_NAMES[name], {})
            table.add_row(
                str(q),
                name,
                f"{tally.tests / tally.egos:.2f}",
                text(told.get("evals")),
                share(tally.found, tally.zones),
                text(told.get("recall")),
                share(tally.kept, tally.alarms),
                text(told.get("alarm_recall")),
                f"{1e6 * tally.seconds / tally.calls:.0f}",
            )
        table.add_section()
    return table


def per_scene(results: dict[int, dict[str, Tally]], config: Config, published: dict[str, Any]) -> Table:
    columns = ("cars per arm", "filter", "pair tests", "of other arms", "published", "recall of pairs", "published")
    table = Table(*columns, title="Per scene")
    for q, tallies in results.items():
        told = published["monte_carlo"].get(str(q), {})
        for name in FILTERS:
            tally, key = tallies[name], PUBLISHED_NAMES[name]
            table.add_row(
                str(q),
                name,
                f"{tally.scene_tests / config.scenes:.2f}",
                f"{tally.scene_arms / config.scenes:.2f}",
                text(told.get("all_pairs" if name == "all" else key)),
                share(tally.scene_found, tally.scene_zones),
                text(told.get(f"recall_{key}")),
            )
        table.add_section()
    return table


def straight_table(results: dict[int, dict[str, Tally]], config: Config, published: dict[str, Any]) -> Table:
    columns = ("cars per arm", "true", "publ.", "found", "publ.", "paths apart", "publ.", "times apart")
    title = "All others assumed straight: zones per scene that are found, or false because paths or times are apart"
    table = Table(*columns, "recall", "publ.", "precision", "but for times", "publ.", title=title)
    for q, tallies in results.items():
        tally, told = tallies["straight"], published["monte_carlo"].get(str(q), {})
        hits, wrong = told.get("hit_straight"), told.get("false_straight")
        table.add_row(
            str(q),
            f"{tally.scene_zones / config.scenes:.2f}",
            text(told.get("true")),
            f"{tally.scene_found / config.scenes:.2f}",
            text(hits),
            f"{tally.scene_apart / config.scenes:.2f}",
            text(wrong),
            f"{(tally.scene_claimed - tally.scene_found - tally.scene_apart) / config.scenes:.2f}",
            share(tally.scene_found, tally.scene_zones),
            text(told.get("recall_straight")),
            share(tally.scene_found, tally.scene_claimed),
            share(tally.scene_found, tally.scene_found + tally.scene_apart),
            text(hits / (hits + wrong) if told else None),
        )
    return table


def text(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if value < 1 else f"{value:.2f}"


def main(config: Config) -> int:
    published = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    play(1, dataclasses.replace(config, scenes=1))  # warm
    results = {q: play(q, config) for q in config.cars_per_arm}
    console = Console(width=170)
    for make_table in (per_ego, per_scene, straight_table):
        console.print(make_table(results, config, published))
    print(f"{config.scenes} scenes per row, seed {config.seed}; brackets: 95 % Wilson intervals, which take zones and")
    print('egos of one scene for independent. Published pairs are those of other arms, except for "all".')
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
