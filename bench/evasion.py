"""What extra evasive effort avoids: the same episodes with the shield alone and with `evasion=True`, pair by pair.

    python bench/evasion.py                       plays what is not there yet, in the compiled engine
    python bench/evasion.py --write               ... and writes docs/results/evasion.md

Every kind of episode is a file in runs/evasion, and is not played again. The agent's actions depend on the episode's
seed alone, so both runs of a pair differ by nothing but the option until the first manoeuvre.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro

from rss_shield.envs.roads.hostile import HOSTILE
from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.pages import markdown, spaced
from rss_shield.eval.rollout import NO_CONTACT
from rss_shield.eval.stats import clopper_pearson
from rss_shield.eval.suite.scenarios.catalogue import FOREVER, LEFT, MIDDLE, RIGHT, ahead, behind, ego
from rss_shield.eval.suite.scenarios.stage import Car, Scenario
from rss_shield.eval.suite.scenarios.stage import play as stage
from rss_shield.eval.suite.scripted import play
from rss_shield.shield.verdicts import AT_FAULT

PAGE = Path("docs/results/evasion.md")
FIRST_SEED = 3_000_000
ROADS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0")
POLICIES = ("random", "faster", "idle")


@dataclasses.dataclass(frozen=True)
class Config:
    """Play pairs of episodes."""

    episodes: int = 1000  # of each kind
    out: Path = Path("runs/evasion")
    roads: tuple[str, ...] = ROADS
    traffic: tuple[str, ...] = ("stock", *HOSTILE)
    policies: tuple[str, ...] = POLICIES
    offences: int = 100  # scripted ones, of each kind
    write: bool = False  # the page


def offence(kind: str, rng: np.random.Generator) -> Scenario:
    """One driver breaks its duty once, on a straight road of three lanes at 20 m/s; everybody else keeps its own."""
    if kind == "brakes too hard":
        offender = ahead(rng.uniform(43.0, 55.0), 20.0, ((1.0, 0.0), (FOREVER, -rng.uniform(12.0, 40.0))))
    elif kind == "drifts over":
        side = rng.choice([-1.0, 1.0])
        w = ((1.0, 15.0, -side * rng.uniform(0.2, 0.8)),)
        offender = Car("leader", RIGHT if side > 0 else LEFT, rng.uniform(-4.0, 4.0), 20.0, (), w)
    elif kind == "cuts in and brakes":
        lane, sideways = (LEFT, 2.0) if rng.random() < 0.5 else (RIGHT, -2.0)
        phases = ((rng.uniform(1.2, 2.5), 0.0), (FOREVER, -rng.uniform(4.0, 8.0)))
        offender = ahead(rng.uniform(0.5, 8.0), 20.0, phases, ((1.0, 3.0, sideways),), lane)
    else:
        offender = behind(rng.uniform(155.0, 170.0), rng.uniform(27.0, 32.0), name="leader")
    others = []
    if kind != "does not brake" and rng.random() < 0.5:
        others.append(behind(rng.uniform(58.0, 90.0), 20.0))
    if kind in ("brakes too hard", "does not brake") and rng.random() < 0.5:
        lane = LEFT if rng.random() < 0.5 else RIGHT
        others.append(Car("beside", lane, rng.uniform(-30.0, 30.0), 20.0))
    return Scenario(kind, "", (ego(y=MIDDLE), offender, *others), "", "", "leader", seconds=30.0)


KINDS = ("brakes too hard", "drifts over", "cuts in and brakes", "does not brake")


def offences_of(kind: str, count: int) -> dict[str, Any]:
    """Pairs of scripted situations of a kind, as `pairs_of`."""
    rng, pairs, broken = np.random.default_rng(KINDS.index(kind)), [], 0
    for _ in range(count):
        scene = offence(kind, rng)
        results = [stage(scene, True, evasion=on) for on in (False, True)]
        pairs.append([*(result.verdict or NO_CONTACT for result in results), 1])
        broken += results[1].broken
    return {"offence": kind, "pairs": pairs, "broken": broken}


def pairs_of(road: str, policy: str, traffic: str, episodes: int) -> dict[str, Any]:
    """Counts of verdicts by pair: how often the shield alone came to the first and evasion to the second."""
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    alone, evading = (play(road, policy, {"others": traffic, "evasion": on}, seeds) for on in (False, True))
    verdicts = pd.DataFrame({"alone": alone["blame"], "evading": evading["blame"]})
    counts = verdicts.value_counts().reset_index()
    return {
        "road": road,
        "policy": policy,
        "traffic": traffic,
        "pairs": [[a, b, int(n)] for a, b, n in counts.itertuples(index=False)],
        "broken": int(evading["broken_duties"].sum()),
    }


def counted(results: list[dict[str, Any]]) -> dict[str, int]:
    """Pairs, contacts with the shield alone, those that evasion avoids, new ones, and egos at fault with it."""
    found = dict.fromkeys(("pairs", "contacts", "avoided", "new", "at_fault"), 0)
    for one in results:
        for alone, evading, n in one["pairs"]:
            found["pairs"] += n
            found["contacts"] += n * (alone != NO_CONTACT)
            found["avoided"] += n * (alone != NO_CONTACT and evading == NO_CONTACT)
            found["new"] += n * (alone == NO_CONTACT and evading != NO_CONTACT)
            found["at_fault"] += n * (evading in (*AT_FAULT, "none"))
    return found


def row(name: str, results: list[dict[str, Any]]) -> list[str]:
    """One row of a table."""
    found = counted(results)
    share = clopper_pearson(found["avoided"], found["contacts"])
    new = clopper_pearson(found["new"], found["pairs"] - found["contacts"])
    at_fault = clopper_pearson(found["at_fault"], found["pairs"])
    avoided = (
        f"{found['avoided']} ({share.value:.0%} [{share.low:.0%}, {share.high:.0%}])" if found["contacts"] else "-"
    )
    return [
        *(name, spaced(found["pairs"]), spaced(found["contacts"]), avoided),
        f"{found['new']} ({new.value:.2%} [{new.low:.2%}, {new.high:.2%}])" if new.n else "-",
        f"{found['at_fault']} (95 % below {at_fault.high:.1e})",
    ]


HEADER = (
    *("episodes", "contacts, shield alone", "of these avoided [95 %]", "new ones, of the others [95 %]"),
    "ego at fault, or nobody",
)


def page_of(results: list[dict[str, Any]], scripted: list[dict[str, Any]]) -> str:
    """The page of results, of episodes in the engine and of scripted offences."""
    sections = [
        "# Evasion",
        "Written by `python bench/evasion.py --write`. The same episodes twice, with the shield "
        "alone and with `evasion=True` (Defs. 11-13): ordinary and hostile traffic, an agent whose actions depend on "
        "the "
        "seed alone. A pair is the same until the first manoeuvre; from then on everybody else reacts to another "
        "ego, so "
        "a contact that is *new* may be of an episode that would have ended before, or with somebody who would not "
        "have "
        "been met. Intervals are exact (Clopper-Pearson).",
        f"The ego broke {sum(one['broken'] for one in results)} duties while it evaded.",
    ]
    if scripted:
        rows = [row(one["offence"], [one]) for one in scripted]
        sections += [
            "## One offence",
            "A straight road of three lanes at 20 m/s; one driver breaks its duty once, drawn at random "
            "(`bench/evasion.py`, `offence`): brakes with 12 to 40 m/s², drifts over, cuts in so close and brakes, or "
            "does not brake behind the ego. Half of the scenes have a follower, or somebody beside, who keep their "
            "own. "
            "Frames of 0.1 s on highway-env, the table of the scenarios.",
            markdown([["offence", *HEADER], *rows, row("all", scripted)]),
        ]
        sections += [
            "Drivers who go on attacking are another matter: a contact that is avoided may come again, and "
            "elsewhere. How "
            "many are new then is in the tables below."
        ]
    for title, key in (("By road", "road"), ("By traffic", "traffic"), ("By policy", "policy")):
        groups = sorted({one[key] for one in results})
        rows = [row(name, [one for one in results if one[key] == name]) for name in groups]
        table = markdown([[title.split()[1], *HEADER], *rows, row("all", results)])
        sections += [f"## {title}", table]
    return "\n\n".join(sections) + "\n"


def main(config: Config) -> None:
    """Play what is missing, and say or write what came of it."""
    results = []
    for road in config.roads:
        for traffic in config.traffic:
            for policy in config.policies:
                path = config.out / f"{road}_{traffic}_{policy}_{config.episodes}.json"
                if not path.exists():
                    path.parent.mkdir(parents=True, exist_ok=True)
                    write_json(path, pairs_of(road, policy, traffic, config.episodes))
                    print(path.name, counted([json.loads(path.read_text(encoding="utf-8"))]), flush=True)
                results.append(json.loads(path.read_text(encoding="utf-8")))
    scripted = []
    for kind in KINDS if config.offences else ():
        path = config.out / f"{kind.replace(' ', '-')}_{config.offences}.json"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_json(path, offences_of(kind, config.offences))
            print(path.name, counted([json.loads(path.read_text(encoding="utf-8"))]), flush=True)
        scripted.append(json.loads(path.read_text(encoding="utf-8")))
    page = page_of(results, scripted)
    if config.write:
        write_text(PAGE, page)
    else:
        print(page)


if __name__ == "__main__":
    main(tyro.cli(Config))
