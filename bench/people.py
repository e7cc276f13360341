"""Among pedestrians and behind occluders: who is to blame, and what does caution cost?

    python bench/people.py --minutes 30            plays episodes in turn, one line each in runs/people.jsonl
    python bench/people.py --write                 ... and writes docs/results/people.md from all lines
    python bench/people.py --episodes 0 --write    writes the page only

Episodes that are in the file are not played again. The roads are `crosswalk-v0`, `parked-row-v0` and
`occluded-intersection-v0`, policies always FASTER and random. Beside the shield as it is each road is played without
occluders, with occluders and a shield that is not shown who may be hidden, and without a shield.
"""

import dataclasses
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import tyro

from rss_shield import make
from rss_shield.envs.highway.step import shield_on
from rss_shield.envs.worlds.walkers import ERRANDS, Walker
from rss_shield.eval.mean_speed_rule import is_exonerated
from rss_shield.eval.pages import markdown, write_page
from rss_shield.eval.stats import paired_difference, wilson
from rss_shield.shield.definitions.occlusion import REASONABLE
from rss_shield.shield.verdicts import AT_FAULT

ROADS = ("crosswalk-v0", "parked-row-v0", "occluded-intersection-v0")
SHIELD, OPEN, BLIND, NONE = "shield", "no occluders", "no ghosts", "no shield"
ARMS: dict[str, tuple[str, dict[str, Any]]] = {
    SHIELD: ("override", {}),
    OPEN: ("override", {"occluders": False}),
    BLIND: ("override", {"ghosts": False}),
    NONE: ("monitor", {"ghosts": False}),
}
POLICIES = ("faster", "random")
FIRST_SEED = 900_000
EVERY = 4  # comparisons are played on every so many seeds
RAW, PAGE = Path("runs/people.jsonl"), Path("docs/results/people.md")
FASTER = 2


@dataclasses.dataclass(frozen=True)
class Config:
    """Measure driving among pedestrians and behind occluders."""

    envs: tuple[str, ...] = ROADS
    episodes: int = 1000  # per road and policy
    minutes: float = float("inf")  # stop after so long
    write: bool = False  # docs/results/people.md


class Case(NamedTuple):
    """What is played."""

    env: str
    policy: str
    arm: str
    seed: int


def cases(config: Config) -> Iterator[Case]:
    """All of them, seed by seed, so that a run that is stopped has played as many of each."""
    for k in range(config.episodes):
        for env in config.envs:
            for policy in POLICIES:
                yield Case(env, policy, SHIELD, FIRST_SEED + k)
            if k % EVERY == 0:
                for arm in (OPEN, BLIND, NONE):
                    yield Case(env, "faster", arm, FIRST_SEED + k)


def play(env: Any, case: Case) -> dict[str, Any]:
    """One episode."""
    rng, inner, done = np.random.default_rng(case.seed), env.unwrapped, False
    env.reset(seed=case.seed)
    start, way, info = inner.vehicle.position.copy(), 0.0, {}
    while not done:
        action = FASTER if case.policy == "faster" else int(rng.integers(3))
        _, _, terminated, truncated, info = env.step(action)
        way, start = way + float(np.hypot(*(inner.vehicle.position - start))), inner.vehicle.position.copy()
        done = terminated or truncated
    row = case._asdict() | {"time": info["time"], "way": way, "success": bool(info["is_success"])}
    row |= {"blame": info["blame"], "broken": info["episode_broken_duties"], "pairs": info["episode_dangerous_pairs"]}
    return row | (contact_of(env, info["blame_evidence"]) if info["blame"] else {})


def contact_of(env: Any, evidence: dict[str, Any]) -> dict[str, Any]:
    """With whom, how, and what the older rule says."""
    road, ego = env.unwrapped.road, shield_on(env.unwrapped.vehicle)
    everybody = [*road.vehicles, *road.objects]
    partner = everybody[evidence["partner"]] if evidence["partner"] >= 0 else None
    poses = np.array([frame.poses[-1] for frame in ego.record])
    commands = np.array([frame.command.acceleration for frame in ego.record])
    row = {"with": "car", "duty": evidence["other_duty"], "excess": evidence["other_excess"]}
    row |= {"own_duty": evidence["ego_duty"], "impact": float(poses[-1, 3])}
    if isinstance(partner, Walker):
        seen = min(getattr(partner, "first_seen", len(poses) - 1), len(poses) - 1)
        driver, dt = ego.settings.table.ego, ego.settings.table.dt
        frames = poses[seen:, 3], commands[seen:], dt
        row |= {"with": "pedestrian", "errand": ERRANDS[partner.errand.kind], "reasonable": partner.is_reasonable}
        row |= {"walks": partner.speed, "seen_for": (len(poses) - seen) * dt}
        row["exonerated"] = is_exonerated(*frames, driver.response_time, driver.a_min_brake, partner.speed)
    return row


def play_all(config: Config) -> None:
    """Append a line for each episode that is not in the file yet."""
    begin, envs = time.monotonic(), {}
    done = {(row["env"], row["policy"], row["arm"], row["seed"]) for row in rows()}
    RAW.parent.mkdir(parents=True, exist_ok=True)
    for case in cases(config):
        if time.monotonic() - begin > 60.0 * config.minutes:
            return
        if tuple(case) in done:
            continue
        mode, changes = ARMS[case.arm]
        key = case.env, case.arm
        if key not in envs:
            envs[key] = make(case.env, mode, record=True, config=changes)
        line = json.dumps(play(envs[key], case))
        with RAW.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def rows() -> list[dict[str, Any]]:
    """All episodes that have been played, each once; a line that a kill has cut off is not one."""
    lines = RAW.read_text(encoding="utf-8").splitlines() if RAW.exists() else []
    found = [json.loads(line) for line in lines if line.endswith("}")]
    return list({(row["env"], row["policy"], row["arm"], row["seed"]): row for row in found}.values())


# ---------------------------------------------------------------- the page


HEADER = """# Pedestrians and limited visibility

Written by `python bench/people.py --write`. What the shield does there: [Pedestrians and ghosts](../people.md).
Intervals are of 95 %, over episodes: Wilson's for rates."""


def counted(frame: pd.DataFrame, arm: str) -> list[list[Any]]:
    """One line per road and policy of an arm, and one for all of them."""
    heading = ["road", "policy", "n", "arrived", "contacts", "with reasonable pedestrians", "with unreasonable ones"]
    table: list[list[Any]] = [[*heading, "with cars", "ego at fault", "unexplained", "mean speed [m/s]"]]
    played = frame[frame["arm"] == arm]
    for (env, policy), some in [*played.groupby(["env", "policy"], sort=False), (("all", "all"), played)]:
        hits = some[some["blame"] != ""]
        people = hits[hits["with"] == "pedestrian"]
        fault, n = int(hits["blame"].isin(AT_FAULT).sum()), len(some)
        table.append(
            [
                *(env, policy, n, f"{100 * some['success'].mean():.0f} %", len(hits)),
                *(int((people["reasonable"] == True).sum()), int((people["reasonable"] == False).sum())),  # noqa: E712
                int((hits["with"] == "car").sum()),
                rate(fault, n),
                int((hits["blame"] == "none").sum()),
                f"{some['way'].sum() / some['time'].sum():.2f}",
            ]
        )
    return table


def rate(k: int, n: int) -> str:
    found = wilson(k, n)
    return f"{k} ({100 * found.low:.1f} to {100 * found.high:.1f} %)"


def explained(frame: pd.DataFrame) -> list[list[Any]]:
    """Every contact behind the shield."""
    table: list[list[Any]] = [["road", "policy", "seed", "with", "verdict", "what it did", "ego's speed [m/s]"]]
    for hit in frame[(frame["arm"] == SHIELD) & (frame["blame"] != "")].to_dict("records"):
        who = f"pedestrian, {hit['errand']}" if hit["with"] == "pedestrian" else "car"
        what = hit["duty"] or hit["own_duty"] or "-"
        table.append([hit["env"], hit["policy"], hit["seed"], who, hit["blame"], what, f"{hit['impact']:.1f}"])
    return table


def paired(frame: pd.DataFrame) -> list[list[Any]]:
    """What occluders cost, and what is saved by not caring."""
    table: list[list[Any]] = [["road", "beside the shield", "n", "mean speed with it", "without", "difference [m/s]"]]
    frame = frame.assign(speed=frame["way"] / frame["time"])
    for env in frame["env"].unique():
        own = frame[(frame["env"] == env) & (frame["arm"] == SHIELD) & (frame["policy"] == "faster")]
        for arm in (OPEN, BLIND, NONE):
            other = frame[(frame["env"] == env) & (frame["arm"] == arm)]
            both = own.merge(other, on="seed", suffixes=("", "_other"))
            if len(both) < 2:
                continue
            first, second = both["speed_other"].to_numpy(), both["speed"].to_numpy()
            d = paired_difference(first, second, np.random.default_rng(0))
            means = f"{second.mean():.2f}", f"{first.mean():.2f}"
            table.append([env, arm, len(both), *means, f"{d.value:+.2f} [{d.low:+.2f}, {d.high:+.2f}]"])
    return table


def older_rule(frame: pd.DataFrame) -> list[list[Any]]:
    """What an older rule says of contacts with pedestrians."""
    heading = ["arm", "contacts with pedestrians", "ego at fault", "exonerated by the older rule", "both"]
    table: list[list[Any]] = [heading]
    people = frame[frame["with"] == "pedestrian"]
    for arm in ARMS:
        some = people[people["arm"] == arm]
        fault, exonerated = some["blame"].isin(AT_FAULT), some["exonerated"] == True  # noqa: E712
        table.append([arm, len(some), int(fault.sum()), int(exonerated.sum()), int((fault & exonerated).sum())])
    return table


def published() -> list[list[Any]]:
    table: list[list[Any]] = [["class", "place", "at least [km/h]", "at most [km/h]", "source"]]
    for (kind, place), known in REASONABLE.items():
        table.append([kind, place, f"{3.6 * known.v_low:.0f}", f"{3.6 * known.v_high:.0f}", known.source])
    return table


def page() -> list[str]:
    frame = pd.DataFrame(rows())
    for name in ("with", "reasonable", "exonerated", "errand", "duty", "own_duty", "impact"):
        if name not in frame:
            frame[name] = None
    frame = frame.astype({"seed": int})
    return [
        HEADER,
        "## Behind the shield",
        markdown(counted(frame, SHIELD)),
        "## Every contact behind the shield",
        markdown(explained(frame)),
        "## What occluders cost, and caution",
        "Always FASTER, the same seeds. *No ghosts*: the shield is not shown who may be hidden.",
        markdown(paired(frame)),
        "## Without caution, and without a shield",
        markdown(counted(frame, BLIND)),
        markdown(counted(frame, NONE)),
        "## An older rule",
        "The version of the paper that the article describes exonerated a car that brakes from the moment of exposure "
        "and is slower on average than the pedestrian (`eval/mean_speed_rule.py`). A score only.",
        markdown(older_rule(frame)),
        "## Speeds that are reasonable",
        "Defs. 24 to 26 are about as strict as this table (`shield/definitions/occlusion.py`).",
        markdown(published()),
    ]


def main(config: Config) -> int:
    play_all(config)
    text = page() if rows() else []
    print("\n\n".join(text))
    if config.write and text:
        write_page(PAGE, text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Config, description=__doc__)))
