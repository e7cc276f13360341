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

import pandas as pd
import tyro

from rss_shield.envs.roads.hostile import HOSTILE
from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.pages import markdown, spaced
from rss_shield.eval.rollout import NO_CONTACT
from rss_shield.eval.stats import clopper_pearson
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
    write: bool = False  # the page


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
        "metres": [float((one["time"] * one["speed"]).sum()) for one in (alone, evading)],
        "seconds": [float(one["time"].sum()) for one in (alone, evading)],
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
    speeds = [sum(r["metres"][k] for r in results) / sum(r["seconds"][k] for r in results) for k in (0, 1)]
    avoided = (
        f"{found['avoided']} ({share.value:.0%} [{share.low:.0%}, {share.high:.0%}])" if found["contacts"] else "-"
    )
    return [
        *(name, spaced(found["pairs"]), spaced(found["contacts"]), avoided),
        f"{found['new']} ({new.value:.2%} [{new.low:.2%}, {new.high:.2%}])",
        f"{found['at_fault']} (95 % below {at_fault.high:.1e})",
        f"{speeds[0]:.1f}, {speeds[1]:.1f}",
    ]


HEADER = (
    *("episodes", "contacts, shield alone", "of these avoided [95 %]", "new ones, of the others [95 %]"),
    *("ego at fault, or nobody", "speed without, with [m/s]"),
)


def page_of(results: list[dict[str, Any]]) -> str:
    """The page of results."""
    sections = [
        "# Evasion",
        "Written by `python bench/evasion.py --write`. The same episodes twice in the compiled engine, with the shield "
        "alone and with `evasion=True` (Defs. 11-13): ordinary and hostile traffic, an agent whose actions depend on "
        "the "
        "seed alone. A pair is the same until the first manoeuvre; from then on everybody else reacts to another "
        "ego, so "
        "a contact that is *new* may be of an episode that would have ended before, or with somebody who would not "
        "have "
        "been met. Intervals are exact (Clopper-Pearson).",
        f"The ego broke {sum(one['broken'] for one in results)} duties while it evaded.",
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
    page = page_of(results)
    if config.write:
        write_text(PAGE, page)
    else:
        print(page)


if __name__ == "__main__":
    main(tyro.cli(Config))
