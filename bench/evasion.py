"""What extra evasive effort avoids: the same episodes with the shield alone and with `evasion=True`, pair by pair.

    python bench/evasion.py                       plays what is not there yet, in the compiled engine
    python bench/evasion.py --write               ... and writes docs/results/evasion.md

Every kind of episode is a file in runs/evasion, and is not played again. The agent's actions depend on the episode's
seed alone, so both runs of a pair differ by nothing but the option until the first manoeuvre. What becomes of a pair
after that is partly chance: so it is played a third time, with the shield alone and one other action of the agent at
the decision in which the manoeuvre begins.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode

from rss_shield.envs.make_vec import make_vec
from rss_shield.envs.roads.hostile import HOSTILE
from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.pages import markdown, spaced
from rss_shield.eval.rollout import NO_CONTACT, evaluate
from rss_shield.eval.stats import clopper_pearson
from rss_shield.eval.suite.policies import Scripted
from rss_shield.eval.suite.scenarios.catalogue import FOREVER, LEFT, MIDDLE, RIGHT, ahead, behind, ego
from rss_shield.eval.suite.scenarios.stage import Car, Scenario
from rss_shield.eval.suite.scenarios.stage import play as stage
from rss_shield.eval.suite.setup import setup_of
from rss_shield.shield.verdicts import AT_FAULT

PAGE = Path("docs/results/evasion.md")
FIRST_SEED = 3_000_000
ROADS = ("highway-fast-v0", "merge-v0", "exit-v0", "two-way-v0")
POLICIES = ("random", "faster", "idle")
SIDE_BY_SIDE = 256  # episodes in the engine
ACTIONS = 5  # of meta-actions


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


class Followed:
    """A batch of the engine that remembers where each ego was after every decision.

    Args:
      env: `FastVectorEnv` without autoreset, one episode each.
    """

    def __init__(self, env: Any) -> None:
        self.env, self.paths = env, []  # type: Any, list[np.ndarray]

    def reset(self, *, seed: Any = None, options: dict | None = None) -> Any:
        """Begin the episodes."""
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: np.ndarray) -> Any:
        """One decision."""
        result = self.env.step(actions)
        cars, egos = self.env.engine.batch.cars, self.env.engine.batch.episodes["ego"]
        own = cars[np.arange(len(cars)), egos]
        self.paths.append(np.stack([own["x"], own["y"], own["speed"]], axis=-1))
        return result

    def close(self) -> None:
        """Close the batch."""
        self.env.close()

    def columns(self, e: int) -> dict[str, Any]:
        """Of environment `e`, whose episode has just ended: `path`, `[decisions, 3]`."""
        return {"path": np.array([one[e] for one in self.paths])}


def play(
    road: str, policy: str, options: dict[str, Any], seeds: Any, other: dict[int, tuple[int, int]]
) -> pd.DataFrame:
    """Episodes side by side, with their paths.

    Args:
      other: of some seeds, a decision and by how much the number of its action is shifted.
    """
    arguments = setup_of(road, options)
    arguments.pop("backend")
    frames = []
    for first in range(0, len(seeds), SIDE_BY_SIDE):
        chunk = seeds[first : first + SIDE_BY_SIDE]
        env = make_vec(road, len(chunk), autoreset_mode=AutoresetMode.DISABLED, **arguments)
        batch, space = Followed(env), env.single_action_space
        each = [Scripted(policy, space, int(seed)) for seed in chunk]

        def act(seen: Any, batch=batch, space=space, each=each, chunk=chunk) -> np.ndarray:
            actions = np.array([act() for act in each])
            for e, seed in enumerate(chunk):
                decision, shift = other.get(int(seed), (-1, 0))
                if decision == len(batch.paths):
                    actions[e] = (actions[e] + shift) % space.n
            return actions

        made = lambda n, batch=batch: batch  # noqa: E731
        more = lambda env, e: env.columns(e)  # noqa: E731
        frames.append(evaluate(made, act, chunk, n_envs=len(chunk), keep_actions=False, more=more))
    return pd.concat(frames, ignore_index=True)


def parts_at(one: np.ndarray, other: np.ndarray) -> int:
    """First decision after which two paths differ, -1 = none."""
    both = min(len(one), len(other))
    differ = np.flatnonzero((one[:both] != other[:both]).any(axis=1))
    return int(differ[0]) if len(differ) else -1 if len(one) == len(other) else both


def pairs_of(road: str, policy: str, traffic: str, episodes: int) -> dict[str, Any]:
    """Counts of verdicts by pair: how often the shield alone came to the first and evasion to the second.

    "chance" counts those pairs in which a manoeuvre made a difference and another action does so as well: the verdicts
    with the shield alone, with evasion, and with the other action.
    """
    seeds = np.arange(FIRST_SEED, FIRST_SEED + episodes)
    alone, evading = (play(road, policy, {"others": traffic, "evasion": on}, seeds, {}) for on in (False, True))
    parts = np.array([parts_at(one, two) for one, two in zip(alone["path"], evading["path"], strict=True)])
    chance: list[tuple[str, str, str]] = []
    left, rng = np.flatnonzero(parts >= 0), np.random.default_rng([FIRST_SEED, episodes])
    for shift in rng.permutation(np.arange(1, ACTIONS)).tolist():
        if len(left) == 0:
            break
        swapped = {int(seeds[i]): (int(parts[i]), shift) for i in left}
        other = play(road, policy, {"others": traffic, "evasion": False}, seeds[left], swapped)
        for i, blame, path in zip(left.tolist(), other["blame"], other["path"], strict=True):
            if parts_at(alone["path"][i], path) >= 0:
                chance.append((alone["blame"][i], evading["blame"][i], blame))
                parts[i] = -1
        left = np.flatnonzero(parts >= 0)
    verdicts = pd.DataFrame({"alone": alone["blame"], "evading": evading["blame"]})
    by_chance = pd.DataFrame(chance, columns=["alone", "evading", "other"])
    return {
        "road": road,
        "policy": policy,
        "traffic": traffic,
        "pairs": [[*kinds, int(n)] for kinds, n in verdicts.value_counts().items()],
        "chance": [[*kinds, int(n)] for kinds, n in by_chance.value_counts().items()],
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


def chance_row(name: str, results: list[dict[str, Any]]) -> list[str]:
    """One row of the table that compares manoeuvres with another action."""
    cells = [name]
    counts = [(a != NO_CONTACT, b != NO_CONTACT, c != NO_CONTACT, n) for one in results for a, b, c, n in one["chance"]]
    for had in (True, False):
        of = sum(n for a, _, _, n in counts if a == had)
        for which in (1, 2):
            k = sum(one[3] for one in counts if one[0] == had and one[which] != had)
            share = clopper_pearson(k, of) if of else None
            cells.append(f"{k} of {of} ({share.value:.0%} [{share.low:.0%}, {share.high:.0%}])" if share else "-")
    return cells


CHANCE_HEADER = (
    *("contacts avoided by a manoeuvre", "by another action", "new contacts by a manoeuvre", "by another action"),
)
HEADER = (
    *("episodes", "contacts, shield alone", "of these avoided [95 %]", "new ones, of the others [95 %]"),
    "ego at fault, or nobody",
)


def traffics(results: list[dict[str, Any]]) -> list[str]:
    """Kinds of drivers among which a manoeuvre made a difference."""
    return sorted({one["traffic"] for one in results if one["chance"]})


def page_of(results: list[dict[str, Any]], scripted: list[dict[str, Any]]) -> str:
    """The page of results, of episodes in the engine and of scripted offences."""
    sections = [
        "# Evasion",
        "Written by `python bench/evasion.py --write`. The same episodes twice, with the shield alone and with "
        "`evasion=True` (Defs. 11-13): ordinary and hostile traffic, an agent whose actions depend on the seed alone. "
        "A pair is the same until the first manoeuvre; from then on everybody else reacts to another ego. *Avoided*: "
        "there was a contact with the shield alone, and none with evasion; *new*: the other way round. Intervals are "
        "exact (Clopper-Pearson).",
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
    rows = [chance_row(name, [one for one in results if one["traffic"] == name]) for name in traffics(results)]
    sections += [
        "## How much of that is chance",
        "Hostile drivers aim at the ego all the time, so whatever changes its path changes which attack succeeds. "
        "Those pairs in which a manoeuvre made a difference were played once more, with the shield alone and *another "
        "action* of the agent at the decision in which the manoeuvre begins; counted are those in which that makes a "
        "difference, too. As often as a harmless change brings a contact that would not have been, or spares one, that "
        "is chance and not the manoeuvre's doing.",
        markdown([["traffic", *CHANCE_HEADER], *rows, chance_row("all", results)]),
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
