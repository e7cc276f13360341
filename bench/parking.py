"""Car parks: is a shielded car ever to blame, does it still park, and what does the shield take in time?

    python bench/parking.py                      every case that has not been played, then docs/results/parking.md
    python bench/parking.py --episodes 20        a quick look, on the screen
    python bench/parking.py --cases shared-random-shield shared-random-bare
    python bench/parking.py --write              the page from all that has been played

Episodes run on highway-env: `shared-parking-v0`, where two to four cars move at once, and highway-env's own
`parking-v0` and `parking-parked-v0` between walls and parked cars. Policies: random actions, full throttle (forward or
back, for 4 s on average) with random steering, and a scripted driver that parks. "bare" is without a shield, watched
and judged all the same. What is in the files in runs/parking/ is not played again: a run that was broken off goes on.
"""

import dataclasses
import importlib.util
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import tyro

from rss_shield import make
from rss_shield.envs.highway import open_ego
from rss_shield.envs.worlds.parking import ParkerPolicy
from rss_shield.eval.files import atomic, write_json
from rss_shield.eval.pages import markdown, spaced, write_page
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.stats import Interval, bootstrap_mean, wilson
from rss_shield.shield.definitions.occupancy import Mover
from rss_shield.shield.geometry import wrap_angle
from rss_shield.shield.open_space.controller import WORK, open_space_frame
from rss_shield.shield.open_space.frames import CAR, LOT
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for
from rss_shield.shield.verdicts import AT_FAULT, BLAMES

POLICIES = {"random": 12, "throttle": 12, "parker": 60}  # and how long an episode of theirs lasts [s]
TURNS = 0.05  # chance per decision that full throttle changes gear
SCENES = {
    "shared": ("shared-parking-v0", {"vehicles_count": 6}),
    "walked": ("shared-parking-v0", {"vehicles_count": 6, "pedestrians": 6}),
    "parking": ("parking-v0", {}),
    "parked": ("parking-v0", {"vehicles_count": 10}),
}
TITLES = {
    "shared": "Two to four cars at once, six parked (`shared-parking-v0`)",
    "walked": "The same, and six people who walk between them",
    "parking": "One car between walls (`parking-v0`)",
    "parked": "One car between walls and ten parked cars (`parking-v0`, `vehicles_count` 10)",
}
AGENTS = (2, 3, 4)  # of seeds 0, 1, 2, and so on
NEAR = 8.0  # from centre to centre [m]
PARTS = 10  # in which cases are played by turns
OUT, PAGE = Path("runs/parking"), Path("docs/results/parking.md")


class Case(NamedTuple):
    """One policy in one scene."""

    scene: str
    policy: str
    shielded: bool

    @property
    def name(self) -> str:
        return f"{self.scene}-{self.policy}-{'shield' if self.shielded else 'bare'}"


CASES = [Case(scene, policy, shielded) for scene in SCENES for policy in POLICIES for shielded in (True, False)]


@dataclasses.dataclass(frozen=True)
class Config:
    """Park, and count who is to blame."""

    cases: tuple[str, ...] = ()  # names such as "shared-random-shield"; none: all
    episodes: int = (
        300  # with several cars, seeds 0 and up; a third of it with people or one car, a fifth with ten parked
    )
    out: Path = OUT  # one CSV per case
    write: bool = False  # play nothing, write the page


# ---------------------------------------------------------------- episodes


def played(case: Case, count: int, out: Path) -> pd.DataFrame:
    """Seeds 0 and up of one case, a row for each agent: those in its file; what is missing is added to it."""
    there = found(case, count, out)
    rows = [] if there is None else there.to_dict("records")
    begun = 0 if there is None else there.seed.nunique()
    if there is not None and begun == count:
        return there
    with progress_bar(count - begun, case.name, "episode") as bar:
        for seed in range(begun, count):
            rows += play(case, seed)
            bar.update(1)
    out.mkdir(parents=True, exist_ok=True)
    with atomic(_path(case, out)) as temporary:
        pd.DataFrame(rows).to_csv(temporary, index=False)
    return pd.DataFrame(rows)


def found(case: Case, count: int, out: Path) -> pd.DataFrame | None:
    """What has been played of a case, of its first `count` seeds."""
    path = _path(case, out)
    if not path.exists():
        return None
    frame = pd.read_csv(path, keep_default_na=False)
    return frame[frame.seed < count]


def _path(case: Case, out: Path) -> Path:
    return out / f"{case.name}.csv"


def share(case: Case, count: int) -> int:
    """Episodes of a case, of so many: fewer where less can happen, or highway-env takes longest."""
    return max(count // {"shared": 1, "walked": 3, "parking": 3, "parked": 5}[case.scene], 1)


def play(case: Case, seed: int) -> list[dict[str, Any]]:
    """One episode; a row for each agent."""
    env_id, config = SCENES[case.scene]
    agents = AGENTS[seed % len(AGENTS)] if env_id == "shared-parking-v0" else 1
    config = config | {"controlled_vehicles": agents, "duration": POLICIES[case.policy]}
    env = make(env_id, "override" if case.shielded else "monitor", config=config)
    observation, info = env.reset(seed=seed)
    act = policy_of(case.policy, env, seed)
    inner: Any = env.unwrapped
    ended, hit, broken = False, np.zeros(agents, bool), np.zeros(agents, int)
    while not ended:
        observation, _, terminated, truncated, info = env.step(act(observation))
        ended = terminated or truncated
        hit |= [vehicle.crashed for vehicle in inner.controlled_vehicles]
    env.close()
    infos = info.get("agents", (info,))
    parked = np.atleast_1d(info["is_success"])
    broken += [one["episode_broken_duties"] for one in infos]
    return [
        {
            "seed": seed,
            "agents": agents,
            "blame": one["blame"],
            "ego_duty": one["blame_evidence"].get("ego_duty", ""),
            "other_duty": one["blame_evidence"].get("other_duty", ""),
            "danger": one["blame_evidence"].get("danger", ""),
            "crashed": bool(hit[k]),
            "parked": bool(parked[k]),
            "time": inner.time,
            "dangerous": one["episode_dangerous_pairs"],
            "broken": int(broken[k]),
            "overridden": one["override_share"],
        }
        for k, one in enumerate(infos)
    ]


def policy_of(name: str, env: Any, seed: int) -> Callable[[Any], Any]:
    """One of POLICIES; every agent draws from the same generator."""
    if name == "parker":
        return ParkerPolicy(env, seed)
    rng = np.random.default_rng(seed)
    agents = len(env.unwrapped.controlled_vehicles)
    gears = rng.choice([-1.0, 1.0], agents)

    def act(_: Any) -> Any:
        if name == "random":
            actions = rng.uniform(-1.0, 1.0, (agents, 2))
        else:
            gears[rng.random(agents) < TURNS] *= -1.0
            actions = np.stack([gears, rng.uniform(-1.0, 1.0, agents)], axis=1)
        actions = actions.astype(np.float32)
        return tuple(actions) if hasattr(env.unwrapped.action_type, "agents_action_types") else actions[0]

    return act


# ---------------------------------------------------------------- tables


COLUMNS = (
    *("policy", "shield", "episodes", "with a contact", "by verdict of the agents", "at fault", "empty"),
    *("broken / dangerous pair-frames", "overridden", "all parked", "cars parked", "after"),
)


def table(scene: str, look: Callable[[Case], pd.DataFrame | None]) -> list[tuple[str, ...]]:
    """Rows of one scene, heading first; without what has not been played."""
    rows: list[tuple[str, ...]] = [COLUMNS]
    for case in CASES:
        frame = look(case) if case.scene == scene else None
        if frame is not None:
            rows.append(row(case, frame))
    return rows


def row(case: Case, frame: pd.DataFrame) -> tuple[str, ...]:
    """One case. Cars in one episode depend on each other, so rates are of episodes."""
    episodes = frame.groupby("seed")
    n = len(episodes)
    verdicts = Counter(frame.blame[frame.blame != ""])
    at_fault, empty = (int(episodes.blame.apply(lambda b, s=s: b.isin(s).any()).sum()) for s in (AT_FAULT, ("none",)))
    everybody = episodes.parked.all()
    parks = case.policy == "parker"
    shares = bootstrap_mean(episodes.parked.mean().to_numpy(float), np.random.default_rng(0))
    return (
        case.policy,
        "yes" if case.shielded else "no",
        str(n),
        str(frame.seed[frame.crashed | (frame.blame != "")].nunique()),  # some are only predicted, at the very end
        ", ".join(f"{verdicts[name]} {name}" for name in BLAMES if verdicts[name]) or "none",
        _count(at_fault, n),
        _count(empty, n),
        f"{spaced(int(frame.broken.sum()))} / {spaced(int(frame.dangerous.sum()))}",
        f"{100 * frame.overridden.mean():.0f} %" if case.shielded else "",
        _percent(wilson(int(everybody.sum()), n)) if parks else "",
        _percent(shares) if parks else "",
        f"{episodes.time.first()[everybody].mean():.1f} s" if parks and everybody.any() else "",
    )


def _count(k: int, n: int) -> str:
    """A number of episodes, and where the interval of its rate ends."""
    highest = 100 * wilson(k, n).high
    return f"{k} (< {highest:.{0 if highest >= 10 else 1}f} %)"


def _percent(rate: Interval) -> str:
    return f"{100 * rate.value:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}] %"


# ---------------------------------------------------------------- time


def scenes_with_cars(count: int, rng: np.random.Generator) -> list[tuple]:
    """Arguments of `open_space_frame` out of shared episodes, every car but the ego driven by an agent."""
    kept: list[tuple] = []
    frame = open_ego.open_space_frame

    def noting(now, before, memory, wish, *rest):
        if (now["kind"] == CAR).all() and rng.random() < 0.1:
            kept.append((now.copy(), before.copy(), memory.copy(), wish))
        return frame(now, before, memory, wish, *rest)

    open_ego.open_space_frame = noting
    try:
        for seed in range(1000):
            config = {"controlled_vehicles": 4, "vehicles_count": 0, "add_walls": False, "duration": 20}
            env = make("shared-parking-v0", config=config)
            observation, _ = env.reset(seed=seed)
            act, ended = policy_of("throttle", env, seed), False
            while not ended:
                observation, _, terminated, truncated, _ = env.step(act(observation))
                ended = terminated or truncated
            if len(kept) >= count:
                return kept[:count]
    finally:
        open_ego.open_space_frame = frame
    return kept


def time_per_pair(count: int = 2000, checked: int = 60) -> dict[str, float]:
    """Microseconds per pair: of the shield's whole frame, of those near each other, and of ad-rss-lib's check [us]."""
    table = table_for(PRESETS["parking"], Rules(), 1 / 15)
    kept = scenes_with_cars(count, np.random.default_rng(0))
    near = [one for one in kept if _distances(one[0]).min() < NEAR]
    work = np.zeros(WORK)
    times = {"pairs": float(sum(len(one[2]) for one in kept)), "near": float(sum(len(one[2]) for one in near))}
    for name, scenes in (("all", kept), ("near each other", near)):
        if not scenes:
            continue
        best = np.inf
        for _ in range(3):
            copies = [(now, before, memory.copy(), wish) for now, before, memory, wish in scenes]
            began = time.process_time()
            for one in copies:
                open_space_frame(*one, table, LOT, True, work)
            best = min(best, time.process_time() - began)
        times[name] = 1e6 * best / sum(len(one[2]) for one in scenes)
    if importlib.util.find_spec("ad_rss") is not None:
        from tests import adrss_objects

        pairs = [
            adrss_objects.open_space_pair(table.other, *(_centred(user) for user in (one[0][-1], one[0][0])))
            for one in kept[:: max(len(kept) // checked, 1)]
        ]
        began = time.process_time()
        for pair in pairs:
            adrss_objects.judge_open_space(pair)
        times["ad-rss"] = 1e6 * (time.process_time() - began) / len(pairs)
    return times


def _centred(user: np.void) -> Mover:
    """A car by the middle of its box, as ad-rss-lib wants it, its heading in [-pi, pi)."""
    heading = wrap_angle(user["heading"] + (np.pi if user["speed"] < 0.0 else 0.0))
    size = user["half_length"], user["half_width"]
    return Mover(*map(float, (user["x"], user["y"], heading, abs(user["speed"]), 0.0, *size)))


def _distances(users: np.ndarray) -> np.ndarray:
    return np.hypot(users["x"][:-1] - users["x"][-1], users["y"][:-1] - users["y"][-1])


# ---------------------------------------------------------------- page


HEADER = """# Car parks

Written by `python bench/parking.py`.

Cars are driven at random, at full throttle (forward or back) with random steering, or by a scripted driver that parks.
Each agent's car has a shield of its own; without a shield it is watched and judged all the same. Contacts are counted
in episodes, verdicts for each agent's car, from its own view: a contact of two agents has two. *At fault* are verdicts
"ego" and "both", *empty* those that charge nobody though somebody must have broken a duty. *Broken*: pair-frames in
danger on which the car broke its duty. *Episodes*: those played so far, of 300, 100 or 60; the command goes on with
the rest. *All parked*: every car is in its place in the end; *after*: how long that took.

Rates are of episodes, with 95 % Wilson intervals or their upper ends; shares of cars parked with 95 % bootstrap
intervals over episodes."""


def write(config: Config, root: Path = Path()) -> None:
    """Write the page of results below `root`; what has not been played is left out."""
    parts = [HEADER]
    for scene, title in TITLES.items():
        rows = table(scene, lambda case: found(case, share(case, config.episodes), root / config.out))
        if len(rows) > 1:
            parts += [f"## {title}", markdown(rows)]
    path = root / config.out / "times.json"
    if path.exists():
        times = pd.read_json(path, typ="series")
        rows = [("one pair of cars", "time"), ("the shield's whole frame, states of 4 cars", f"{times['all']:.1f} us")]
        if "near each other" in times:
            rows.append((f"the same, somebody within {NEAR:g} m", f"{times['near each other']:.1f} us"))
        if "ad-rss" in times:
            rows.append(("ad-rss-lib 5.0.0, its check of such pairs", f"{times['ad-rss']:.0f} us"))
        note = (
            f"Of {spaced(int(times['pairs']))} pairs out of episodes at full throttle ({spaced(int(times['near']))} of "
            "them out of states with somebody near): sets of both, Def. 22, the memory, the judge, and the ways out "
            "that are tried. Processor time, the best of three runs."
        )
        parts += ["## Time", note, markdown(rows)]
    write_page(root / PAGE, parts)


def main(config: Config) -> int:
    known = {case.name: case for case in CASES}
    unknown = [name for name in config.cases if name not in known]
    if unknown:
        print(f"cases = {unknown[0]!r}: expected some of {', '.join(known)}", file=sys.stderr)
        return 2
    chosen = [] if config.write else [known[name] for name in config.cases] or CASES
    frames = {}
    for part in range(1, PARTS + 1):  # all of them grow alike, so a run that is broken off says something of each
        for case in chosen:
            frames[case] = played(case, share(case, part * config.episodes // PARTS), config.out)
    for case, frame in frames.items():
        print(markdown([COLUMNS, row(case, frame)]), flush=True)
    if not config.write and not config.cases:
        write_json(config.out / "times.json", time_per_pair())
    if config.write or not config.cases:
        write(config)
        print(f"written: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
