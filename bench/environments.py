"""Every environment of highway-env behind the shield: what works, and whether the ego is ever to blame.

    python bench/environments.py --table             docs/environments.md: every environment is tried
    python bench/environments.py                     every case, with the shield and without; runs/environments/
    python bench/environments.py --cases merge-v0 --episodes 20
    python bench/environments.py --write             nothing is played: docs/results/environments.md from all that was

Seeds 0, 1, ... with random actions, and with whatever drives fastest: always FASTER; with continuous actions full
throttle and steering along the lane. Where the engine has an environment it plays it, and highway-env the others. A
case whose file is there already is not played again.
"""

import dataclasses
import sys
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode
from highway_env.vehicle.controller import ControlledVehicle

from rss_shield import make, make_vec
from rss_shield.envs import supported
from rss_shield.envs.stock import make_stock
from rss_shield.eval.files import atomic
from rss_shield.eval.pages import markdown, spaced, write_page
from rss_shield.eval.progress import progress_bar
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.stats import wilson
from rss_shield.shield.verdicts import AT_FAULT

TABLE, PAGE = Path("docs/environments.md"), Path("docs/results/environments.md")
MODES = ("override", "monitor")
POLICIES = ("random", "fast")
HEAVIEST = ("none", "ego", "both", "other", "inherited", "")  # of several agents' verdicts the first one counts
SIDE_BY_SIDE = 100  # environments in the engine
CONTINUOUS = {"action": {"type": "ContinuousAction"}}
AGENTS = {
    "controlled_vehicles": 3,
    "action": {"type": "MultiAgentAction", "action_config": {"type": "DiscreteMetaAction"}},
    "observation": {"type": "MultiAgentObservation", "observation_config": {"type": "Kinematics"}},
}
# scripted drivers see nothing, so whatever is quick to compute is observed; 300 s on a racetrack are 1500 decisions
TRACK = {"observation": {"type": "Kinematics"}, "duration": 12}
BUSY = {"other_vehicles": 8}
SLIPPING = {
    "action": {"type": "ContinuousAction", "dynamical": True},
    **{"simulation_frequency": 60, "duration": 10, "vehicles_count": 12, "vehicles_density": 2},
}


class Case(NamedTuple):
    """One environment."""

    env_id: str
    config: dict[str, Any] = {}  # noqa: RUF012  never changed
    words: str = ""  # what is not as it is


def _cases() -> dict[str, Case]:
    cases = {}
    for env_id in supported.environments():
        if env_id.startswith("racetrack"):
            cases[env_id] = Case(env_id, TRACK, "12 s")
            if env_id.endswith("v0"):
                cases[f"{env_id}-busy"] = Case(env_id, TRACK | BUSY, "12 s, up to 8 others")
        else:
            cases[env_id] = Case(env_id)
    blocked = {"block_lane": True, "force_decision": True}
    cases["racetrack-oval-v0-blocked"] = Case("racetrack-oval-v0", TRACK | BUSY | blocked, "12 s, lanes blocked")
    cases["racetrack-v0-throttle"] = Case("racetrack-v0", TRACK | BUSY | CONTINUOUS, "12 s, throttle and steering")
    cases["highway-v0-slipping"] = Case("highway-v0", SLIPPING, "tyres that slip, 12 cars, 60 Hz, 10 s")
    for env_id in ("roundabout-v0", "signalised-intersection-v0"):
        cases[f"{env_id}-continuous"] = Case(env_id, CONTINUOUS, "continuous actions")
    cases["highway-v0-agents"] = Case("highway-v0", AGENTS | {"vehicles_count": 15}, "three agents among 15 cars")
    cases["merge-v0-agents"] = Case("merge-v0", AGENTS, "three agents")
    return cases


CASES = _cases()


@dataclasses.dataclass(frozen=True)
class Config:
    """Try and play every environment of highway-env."""

    cases: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()  # to play; all, or none with --write
    policies: tuple[str, ...] = POLICIES
    modes: tuple[str, ...] = MODES
    episodes: int = 100  # seeds per case, policy and mode
    engine: bool = True  # play in the engine what it has
    out: Path = Path("runs/environments")  # one CSV per case, policy and mode
    table: bool = False  # only docs/environments.md
    write: bool = False  # docs/results/environments.md, from every file in `out`


# ---------------------------------------------------------------- what works


HEADER = """# Environments

Written by `python bench/environments.py --table`, which tries every environment that highway-env registers: one
decision behind the shield on highway-env, and the engine. *As it is*: with the configuration that it comes with. What
these agents may do is a `config`: `action` is

{actions}

(*tyres that slip* with `simulation_frequency` 60: along lanes frames longer than 1/56 s are refused), and *two
agents* have `controlled_vehicles` 2 and the environment's own action for each. Which of them are driven without
blame: [results](results/environments.md). A road of your own: [how-to](howtos.md#a-road-of-your-own).

On racetracks an agent that only steers has no say in its speed: the shield brakes for it, and brings it back to the
speed of the environment when nothing forbids that. `lane-keeping-v0` has nobody else on the road, so nothing is owed
to anybody there. A car that is steered freely on a roundabout has to declare its route: `config={{"destination":
"exr"}}`; it is that of highway-env's own ego, `"nxs"`, if nothing is said. Rewards of merges and roundabouts know
meta-actions only; with throttle and steering no lane change is counted."""


def cell(reason: str) -> str:
    return "no" if reason else "yes"


def heading() -> list[str]:
    tried = [supported.DEFAULT, *supported.ACTIONS, supported.AGENTS]
    return ["environment", *tried, "engine", "engine sees"]


def line(row: supported.Row) -> list[str]:
    """One environment in the table."""
    able = [name for name, reason in row.engine.items() if not reason and name != supported.DEFAULT]
    seen = [name for name, reason in row.observations.items() if not reason]
    return [f"`{row.env_id}`", *map(cell, row.shield.values()), ", ".join(able) or "–", ", ".join(seen) or "–"]


def reasons(row: supported.Row) -> dict[str, list[str]]:
    """Why something does not work: reason -> what."""
    found: dict[str, list[str]] = {}
    for name, reason in row.shield.items():
        if reason:
            found.setdefault(reason, []).append(name)
    tried = {name: reason for name, reason in (row.engine | row.observations).items() if name != supported.DEFAULT}
    if all(tried.values()) and len({*tried.values()}) == 1:
        tried = {"the engine": next(iter(tried.values()))}
    for name, reason in tried.items():
        if reason:
            found.setdefault(reason, []).append(name)
    return found


def table_page(rows: list[supported.Row]) -> list[str]:
    """The parts of the page of what works."""
    actions = "\n".join(f"- *{name}*: `{config}`" for name, config in supported.ACTIONS.items())
    grouped: dict[str, dict[str, list[str]]] = {}
    for row in rows:
        for reason, names in reasons(row).items():
            grouped.setdefault(reason, {})[row.env_id] = names
    why = []
    for reason, where in grouped.items():
        whats: dict[str, list[str]] = {}
        for env_id, names in where.items():
            whats.setdefault(", ".join(names), []).append(f"`{env_id}`")
        why.append(f"- {reason}:\n" + "\n".join(f"  - {what}: {', '.join(ids)}" for what, ids in whats.items()))
    return [
        HEADER.format(actions=actions),
        markdown([heading(), *map(line, rows)]),
        "## Why not",
        "\n".join(why),
    ]


# ---------------------------------------------------------------- episodes


def along_lane(vehicle: Any) -> float:
    """Steering angle of highway-env's own drivers along the lane that a vehicle is on [rad]."""
    network, index = vehicle.road.network, vehicle.lane_index
    lane = network.get_lane(index)
    driver = ControlledVehicle(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed)
    if lane.after_end(vehicle.position):
        index = network.next_lane(index, None, vehicle.position, np.random.default_rng(0))
    return float(driver.steering_control(index))


def act(policy: str, kind: Any, vehicle: Any, space: Any, rng: np.random.Generator) -> Any:
    """The next action of one agent."""
    if policy == "random":
        return int(rng.integers(space.n)) if hasattr(space, "n") else rng.uniform(-1.0, 1.0, space.shape)
    if hasattr(space, "n"):
        return kind.actions_indexes.get("FASTER", kind.actions_indexes["IDLE"])
    steering = np.clip(along_lane(vehicle) / kind.steering_range[1], -1.0, 1.0)
    return np.array([1.0] * kind.longitudinal + [steering] * kind.lateral)


def play(case: Case, policy: str, mode: str, seed: int) -> dict[str, Any]:
    """One episode on highway-env."""
    env: Any = make(case.env_id, mode, config=dict(case.config)) if case.config else make(case.env_id, mode)
    rng, base = np.random.default_rng(seed), env.unwrapped
    env.reset(seed=seed)
    done, steps = False, 0
    while not done:
        kinds = getattr(base.action_type, "agents_action_types", None)
        if kinds is None:
            action = act(policy, base.action_type, base.vehicle, env.action_space, rng)
        else:
            everybody = zip(kinds, base.controlled_vehicles, env.action_space, strict=True)
            action = tuple(act(policy, *one, rng) for one in everybody)
        *_, terminated, truncated, info = env.step(action)
        done, steps = bool(np.any(terminated) or truncated), steps + 1
    env.close()
    agents = info.get("agents", (info,))
    blames = [agent["blame"] for agent in agents]
    return {
        "seed": seed,
        "blame": min(blames, key=HEAVIEST.index),
        "contact": any(blames),
        "broken_duties": sum(agent["episode_broken_duties"] for agent in agents),
        "dangerous_pairs": sum(agent["episode_dangerous_pairs"] for agent in agents),
        "override_share": float(np.mean([agent["override_share"] for agent in agents])),
        "decisions": steps,
        "backend": "highway-env",
    }


def in_engine(case: Case, policy: str, mode: str, count: int) -> pd.DataFrame:
    """All episodes of one case in the engine; random actions come from one generator for all."""
    rng = np.random.default_rng(0)

    def make_batch(n: int) -> Any:
        return make_vec(case.env_id, n, mode, config=dict(case.config), autoreset_mode=AutoresetMode.DISABLED)

    one: Any = make_batch(1)
    stock: Any = make_stock(case.env_id, config=dict(case.config)).unwrapped
    actions, faster = one.single_action_space.n, stock.action_type.actions_indexes["FASTER"]
    frame = evaluate(
        make_batch,
        lambda seen: rng.integers(actions, size=len(seen)) if policy == "random" else np.full(len(seen), faster),
        range(count),
        n_envs=min(SIDE_BY_SIDE, count),
        keep_actions=False,
    )
    columns = ["seed", "broken_duties", "dangerous_pairs", "override_share"]
    blame = frame["blame"].where(frame["blame"] != "no contact", "")
    return frame[columns].assign(blame=blame, contact=frame["crashed"], decisions=frame["length"], backend="the engine")


def has_engine(case: Case) -> bool:
    """Does the engine have an environment, with one agent that takes meta-actions?"""
    try:
        envs = make_vec(case.env_id, 1, config=dict(case.config))
    except ValueError:
        return False
    return hasattr(envs.single_action_space, "n") and "action" not in case.config


def played(name: str, policy: str, mode: str, config: Config) -> pd.DataFrame:
    """All episodes of one case, from its file if that is there already."""
    path = config.out / f"{name}-{policy}-{mode}-{config.episodes}.csv"
    if path.exists():
        return pd.read_csv(path, keep_default_na=False)
    case = CASES[name]
    if config.engine and has_engine(case):
        frame = in_engine(case, policy, mode, config.episodes)
    else:
        rows = []
        with progress_bar(config.episodes, f"{name} {policy} {mode}", "episode") as bar:
            for seed in range(config.episodes):
                rows.append(play(case, policy, mode, seed))
                bar.update()
        frame = pd.DataFrame(rows)
    config.out.mkdir(parents=True, exist_ok=True)
    with atomic(path) as temporary:
        frame.to_csv(temporary, index=False)
    return frame


# ---------------------------------------------------------------- the page of results


RESULTS = """# Every environment

Written by `python bench/environments.py --write` from what its other calls have played.

Seeds 0, 1, ... of every environment of highway-env that the shield is on ([which](../environments.md)), with random
actions and with whatever drives fastest: always FASTER; with continuous actions full throttle, and steering along the
lane. *Ego at fault* and *contacts* count episodes; with several agents an episode counts if it is so for one of them.
*None* would be a contact that nobody's duty explains, a bug. *Broken / pair-frames*: frames on which somebody and the
ego were in danger, and those on which the ego broke its duty. In brackets: the upper end of the 95 % Wilson interval.
*Without*: the same seeds with a shield that only watches."""
HEADINGS = (
    *("environment", "driver", "n", "ego at fault (95 % below)", "none", "contacts", "broken / pair-frames"),
    *("frames overridden", "without: ego at fault", "contacts", "played in"),
)


def result(name: str, policy: str, frame: pd.DataFrame, bare: pd.DataFrame | None) -> list[str]:
    """One line of the page."""
    case, n = CASES[name], len(frame)
    at_fault = int(frame["blame"].isin(AT_FAULT).sum())
    bound = 100 * wilson(at_fault, n).high
    return [
        f"`{case.env_id}`" + (f", {case.words}" if case.words else ""),
        policy,
        str(n),
        f"{at_fault} ({bound:.2g} %)",
        str(int((frame["blame"] == "none").sum())),
        str(int(frame["contact"].sum())),
        f"{spaced(int(frame['broken_duties'].sum()))} / {spaced(int(frame['dangerous_pairs'].sum()))}",
        f"{100 * frame['override_share'].mean():.0f} %",
        "–" if bare is None else _count(bare["blame"].isin(AT_FAULT), n),
        "–" if bare is None else _count(bare["contact"], n),
        str(frame["backend"].iloc[0]),
    ]


def _count(flags: pd.Series, n: int) -> str:
    """How many episodes; of how many, where that is not `n`."""
    return f"{int(flags.sum())}" if len(flags) == n else f"{int(flags.sum())} of {len(flags)}"


def found(name: str, policy: str, mode: str, out: Path) -> pd.DataFrame | None:
    """What has been played of one case; of several files the one with most episodes."""
    files = [path for path in out.glob(f"{name}-{policy}-{mode}-*.csv") if path.stem.rsplit("-", 1)[-1].isdigit()]
    if not files:
        return None
    return pd.read_csv(max(files, key=lambda path: int(path.stem.rsplit("-", 1)[-1])), keep_default_na=False)


def results_page(out: Path) -> list[str]:
    """The parts of the page."""
    rows: list[Any] = [HEADINGS]
    for name in CASES:
        for policy in POLICIES:
            frame = found(name, policy, "override", out)
            if frame is not None:
                rows.append(result(name, policy, frame, found(name, policy, "monitor", out)))
    return [RESULTS, markdown(rows)]


# ---------------------------------------------------------------- main


def main(config: Config) -> int:
    unknown = [name for name in config.cases if name not in CASES]
    if unknown:
        print(f"cases = {unknown[0]!r}: expected some of {', '.join(CASES)}", file=sys.stderr)
        return 2
    if config.table:
        write_page(TABLE, table_page([supported.probe(env_id) for env_id in supported.environments()]))
        print(f"written: {TABLE}")
        return 0
    bad = 0
    names = config.cases or (() if config.write else tuple(CASES))
    for name in names:
        reason = supported.refused(CASES[name].env_id, CASES[name].config)
        if reason:
            print(f"{name}: {reason}", flush=True)
            continue
        for policy in config.policies:
            for mode in config.modes:
                frame = played(name, policy, mode, config)
                if mode == "override":
                    bare = found(name, policy, "monitor", config.out)
                    print(" | ".join(result(name, policy, frame, bare)), flush=True)
                    bad += int((frame["broken_duties"] > 0).sum() + frame["blame"].isin((*AT_FAULT, "none")).sum())
    if config.write:
        write_page(PAGE, results_page(config.out))
        print(f"written: {PAGE}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config, description=__doc__)))
