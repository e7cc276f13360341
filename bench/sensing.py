"""Where the guarantee holds when the shield does not see what is there, and where it ends.

    python bench/sensing.py                       all sweeps (minutes)
    python bench/sensing.py --write               ... and docs/results/sensing.md with its figure
    python bench/sensing.py --episodes 100        quicker, with wider intervals

Always FASTER on `highway-fast-v0` in the compiled engine, the same episodes for every point. The judge sees what is
there.
"""

import dataclasses
import sys
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
import pandas as pd
import tyro
from gymnasium.vector import AutoresetMode
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from rss_shield import make_vec
from rss_shield.eval.files import atomic
from rss_shield.eval.pages import markdown, spaced, write_page
from rss_shield.eval.plots import STYLE
from rss_shield.eval.rollout import evaluate
from rss_shield.eval.stats import bootstrap_mean, clopper_pearson
from rss_shield.eval.suite.sensing import PacEstimate, pac_estimate, simulate_redundancy
from rss_shield.shield.verdicts import AT_FAULT

PAGE, FIGURE = Path("docs/results/sensing.md"), Path("docs/sensing.png")
ENV, FASTER, ACTIONS = "highway-fast-v0", 3, 5
FIRST_SEED = 930_000
AT_ONCE = 250  # environments side by side
HOLD = 0.6  # an error lasts for three frames [s]
HEADER = """# Results: sensing

Written by `python bench/sensing.py --write`. What the options mean: [Sensing](../sensing.md).

Always FASTER on `highway-fast-v0` (frames of 0.2 s), the same episodes for every row, in the compiled engine.
*At fault*: episodes with a contact that the ego is to blame for, by the judge, who sees what is there. *Broken*: of the
pair-frames in danger, those on which the ego broke a duty. Rates with 95 % intervals of Clopper and Pearson, returns of
the bootstrap over episodes."""


@dataclasses.dataclass(frozen=True)
class Config:
    """Play every sweep."""

    episodes: int = 500  # per point
    decisions: int = 10_000_000  # of the redundant subsystems
    write: bool = False  # write the page and its figure


class Point(NamedTuple):
    """Episodes with one way of sensing."""

    sweep: str
    level: float
    arm: str
    played: pd.DataFrame

    @property
    def at_fault(self) -> int:
        return int(self.played["blame"].isin(AT_FAULT).sum())

    @property
    def broken(self) -> tuple[int, int]:
        """Pair-frames in danger on which the ego broke a duty, and all of them."""
        return int(self.played["broken_duties"].sum()), int(self.played["dangerous_pairs"].sum())


ARMS: dict[str, dict[str, Any]] = {"as seen": {}, "inflated": {"inflate": True}, "2 of 3": {"subsystems": 3}}


def noise(level: float) -> dict[str, Any]:
    """Errors of a sensor whose position along the road is so many metres off at most."""
    across = min(0.25 * level, 0.5)
    return {"along": level, "across": across, "speed": 0.5 * level, "heading": 0.01 * min(level, 2.0), "hold": HOLD}


MODERATE = {**noise(0.5), "misses": 0.1, "miss_duration": 0.2, "latency": 0.2}
SWEEPS: dict[str, dict[float, tuple[dict[str, Any], tuple[str, ...]]]] = {
    "noise": {level: (noise(level), ("as seen", "inflated")) for level in (0.0, 0.5, 1.0, 2.0, 4.0)},
    "misses": {share: ({"misses": share, "miss_duration": 0.4}, tuple(ARMS)) for share in (0.1, 0.2, 0.4)},
    "latency": {age: ({"latency": age}, ("as seen", "inflated")) for age in (0.2, 0.4, 0.8)},
    "response": {
        rho: ({"latency": 0.4, "response_time": rho}, ("as seen", "inflated")) for rho in (0.2, 0.4, 0.6, 0.8)
    },
    "excess": {times: ({**MODERATE, "excess": times}, ("as seen", "inflated")) for times in (1.0, 2.0, 4.0, 6.0)},
    "ghosts": {0.2: ({"ghosts": 0.2}, ("as seen",))},
    "wrong lane": {0.1: ({"wrong_lane": 0.1}, ("as seen", "2 of 3"))},
    "range": {metres: ({"range": metres}, ("as seen",)) for metres in (40.0, 20.0, 10.0)},
}
WORDS = {
    "noise": (
        "Noise",
        "error along [m]",
        "Bounded errors along and, a quarter of that, across the heading (0.5 m at most); of the speed half as many "
        "m/s; of the heading 0.01 rad per metre. Each lasts 0.6 s. Inflation knows the bounds.",
    ),
    "misses": (
        "Misses",
        "share of the time",
        "Nobody is missed for longer than 0.4 s at a time. Inflation remembers for so long; 2 of 3: three independent "
        "subsystems without inflation.",
    ),
    "latency": (
        "Latency",
        "age [s]",
        "Inflation moves on what it has seen, and counts on what drivers may have done since.",
    ),
    "response": (
        "Response time",
        "response time of the ego [s]",
        "A latency of 0.4 s. Drivers of highway-env change lanes more briskly than the table admits; what the ego can "
        "know of it only later it answers in time if the response time that it is held to contains that.",
    ),
    "excess": (
        "Where it ends",
        "times worse than said",
        "A sensor with errors of 0.5 m, 0.125 m, 0.25 m/s and 0.005 rad, 10 % misses of 0.2 s and a latency of 0.2 s, "
        "that is so many times worse than inflation is told.",
    ),
    "ghosts": ("Ghosts", "share of the time", "They make nobody less safe, and cost return."),
    "wrong lane": (
        "Wrong lanes",
        "share of the time",
        "Somebody is put into the next lane for 0.5 s: an error that no bound below the width of a car covers.",
    ),
    "range": ("Range", "[m]", "How far is seen, without any other error."),
}


def play(sensing: dict[str, Any], episodes: int) -> pd.DataFrame:
    """One row per episode, see `rss_shield.eval.rollout.run_episode`.

    Args:
      sensing: fields of `Sensing`; "response_time" is that of the ego instead [s].
      episodes: how many.
    """

    def act(observations: np.ndarray) -> np.ndarray:
        return np.full(len(observations), FASTER)

    errors = {name: value for name, value in sensing.items() if name != "response_time"}
    params = {"ego": {"response_time": sensing["response_time"]}} if "response_time" in sensing else None

    def build(count: int) -> Any:
        return make_vec(ENV, count, params=params, sensing=errors, autoreset_mode=AutoresetMode.DISABLED)

    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    return evaluate(build, act, seeds, n_envs=min(episodes, AT_ONCE), keep_actions=False)


def sweep_all(episodes: int) -> list[Point]:
    found = []
    for sweep, levels in SWEEPS.items():
        for level, (sensing, arms) in levels.items():
            for arm in arms:
                point = Point(sweep, level, arm, play(sensing | ARMS[arm], episodes))
                print(
                    f"{sweep} {level:g}, {arm}: {point.at_fault} of {episodes} at fault, {point.broken} broken",
                    flush=True,
                )
                found.append(point)
    return found


def percent(k: int, n: int) -> str:
    value, low, high, *_ = clopper_pearson(k, n)
    return f"{100 * value:.1f} % [{100 * low:.1f}, {100 * high:.1f}]" if n else "–"


def sweep_part(sweep: str, points: list[Point]) -> str:
    title, unit, words = WORDS[sweep]
    rows: list[Any] = [(unit, "shield", "episodes", "crashes", "at fault", "broken", "return", "overridden")]
    for point in points:
        played, n = point.played, len(point.played)
        earned = bootstrap_mean(played["return"], np.random.default_rng(0))
        rows.append(
            (
                f"{point.level:g}",
                point.arm,
                n,
                percent(int(played["crashed"].sum()), n),
                percent(point.at_fault, n),
                " / ".join(map(spaced, point.broken)),
                f"{earned.value:.1f} [{earned.low:.1f}, {earned.high:.1f}]",
                f"{100 * played['override_share'].mean():.0f} %",
            )
        )
    return "\n\n".join([f"## {title}", words, markdown(rows)])


def plot(points: list[Point], path: Path) -> None:
    """Share of the dangerous pair-frames with a broken duty, and of episodes at fault, against each kind of error."""
    looks = {"as seen": ("#D55E00", "o", "-"), "inflated": ("#0072B2", "s", "--"), "2 of 3": ("#009E73", "^", ":")}
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.5, 4.2))
        panels = figure.subplots(2, 4, sharey="row")
        for column, sweep in enumerate(("noise", "misses", "response", "excess")):
            title, unit, _ = WORDS[sweep]
            for arm, (colour, marker, style) in looks.items():
                line = [point for point in points if (point.sweep, point.arm) == (sweep, arm)]
                if not line:
                    continue
                look = {"color": colour, "marker": marker, "ls": style, "ms": 4, "label": arm}
                x = [point.level for point in line]
                panels[0, column].plot(x, [point.broken[0] / max(point.broken[1], 1) for point in line], **look)
                rates = [clopper_pearson(point.at_fault, len(point.played)) for point in line]
                spread = np.array([(rate.value - rate.low, rate.high - rate.value) for rate in rates]).T
                panels[1, column].errorbar(x, [rate.value for rate in rates], np.maximum(spread, 0.0), **look)
            panels[0, column].set_title(title, loc="left")
            panels[1, column].set_xlabel(unit)
        for row, name in enumerate(("duties broken", "episodes at fault")):
            panels[row, 0].yaxis.set_major_formatter(PercentFormatter(1.0))
            panels[row, 0].set_ylabel(name)
        figure.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=3)
        with atomic(path) as temporary:
            figure.savefig(temporary, format="png", dpi=130)


# ---------------------------------------------------------------- what a policy loses (Def. 28)

EPS = np.array([0.02, 0.1, 0.5])  # of a value in [-1, 1]: mild, medium and gross
SPEEDS = np.array([20.0, 25.0, 30.0])  # that the actions SLOWER, IDLE and FASTER lead to [m/s]
AHEAD = 4.0  # the value looks so far ahead [s]


def values_of(observations: np.ndarray) -> np.ndarray:
    """A value of holding each of three speeds in the own lane, `[E, 3]`, read off an observation `[E, 5, 5]`.

    Mean speed as highway-env rewards it over the next seconds, less 1 if the car ahead would be hit, as if everybody
    kept its speed. It is plain on purpose: what matters is that it is one function of what is observed.
    """
    ego, others = observations[:, 0], observations[:, 1:]
    there = others[..., 0] > 0.5
    # highway-env's scales; this road has three lanes of 4 m
    ahead, aside, slower = 200.0 * others[..., 1], 12.0 * others[..., 2], 80.0 * others[..., 3]
    in_way = there & (ahead > 0.0) & (np.abs(aside) < 2.0)
    values = []
    for speed in SPEEDS:
        closing = speed - (80.0 * ego[:, None, 3] + slower)
        hits = (in_way & (ahead - closing * AHEAD < 5.0)).any(axis=1)
        values.append((speed - SPEEDS[0]) / (SPEEDS[-1] - SPEEDS[0]) * 0.4 - 1.0 * hits)
    return np.stack(values, axis=1)


def loss_of(sensing: dict[str, Any], episodes: int) -> PacEstimate:
    """What the greedy policy loses by what it senses: one decision per episode, so decisions are independent.

    The same episodes twice, watched only: in one the agent observes what is there, in the other what is sensed.
    """
    seen = []
    for agent in (False, True):
        options = {"sensing": sensing | {"agent": agent}, "autoreset_mode": AutoresetMode.DISABLED}
        envs = make_vec(ENV, AT_ONCE, "monitor", **options)
        rows = []
        for first in range(0, episodes, AT_ONCE):
            observations = envs.reset(seed=FIRST_SEED + first)[0]
            for _ in range(3):
                observations, *_ = envs.step(np.full(AT_ONCE, FASTER))
            rows.append(observations)
        envs.close()
        seen.append(values_of(np.concatenate(rows)[:episodes]))
    return pac_estimate(*seen, EPS)


def pac_part(episodes: int) -> str:
    rows: list[Any] = [("sensor", "decisions", "mean loss", *(f"loses more than {eps:g}" for eps in EPS))]
    for name, sensing in (
        ("noise 0.5 m", noise(0.5)),
        ("noise 2 m", noise(2.0)),
        ("misses 20 %", {"misses": 0.2, "miss_duration": 0.2}),
        ("ghosts 20 %", {"ghosts": 0.2}),
        ("wrong lane 10 %", {"wrong_lane": 0.1}),
        ("latency 0.4 s", {"latency": 0.4}),
    ):
        found = loss_of(sensing, episodes)
        print(f"PAC, {name}: {found}", flush=True)
        shares = [f"{100 * s.value:.2f} % [{100 * s.low:.2f}, {100 * s.high:.2f}]" for s in found.beyond]
        rows.append((name, spaced(found.beyond[0].n), f"{found.mean_loss:.4f}", *shares))
    words = (
        "Def. 28 for a policy that is greedy in a plain value: the speed that a lane is worth in the next four "
        "seconds, less 1 if it leads into somebody (`values_of` in the command). One decision of each episode, so that "
        "decisions are independent; intervals are Clopper and Pearson's. A system is PAC for (eps, delta) where the "
        "upper end is at most delta."
    )
    return "\n\n".join(["## What a policy loses by sensing", words, markdown(rows)])


# ---------------------------------------------------------------- redundancy (Corollary 3)


def redundancy_part(decisions: int) -> str:
    rows: list[Any] = [("common causes", "decisions", "p", "c", "measured", "6 c p²", "within")]
    for common in (0.0, 0.2, 0.5):
        found = simulate_redundancy(decisions, 1e-3, 1e-3, common, np.random.default_rng(int(100 * common)))
        print(f"redundancy, common {common}: {found}", flush=True)
        rows.append(
            (
                f"{100 * common:.0f} %",
                spaced(found.decisions),
                f"{found.rate.value:.2e}",
                f"{found.dependence.value:.2f} [{found.dependence.low:.2f}, {found.dependence.high:.2f}]",
                f"{found.joint.value:.2e} [{found.joint.low:.2e}, {found.joint.high:.2e}]",
                f"{found.bound.value:.2e} [{found.bound.low:.2e}, {found.bound.high:.2e}]",
                "yes" if found.holds else "no",
            )
        )
    words = (
        "Corollary 3: three subsystems, of which two have to agree; each misses something that matters, and sees a "
        "ghost that does, once in a thousand decisions. A tenth of the decisions is hard for all three, and a part "
        "of their failures moves there. p is the largest of the six measured rates, c is measured over all pairs and "
        "kinds; intervals of c and of the bound are a bootstrap over decisions."
    )
    return "\n\n".join(["## Redundancy", words, markdown(rows)])


def summary(points: list[Point]) -> str:
    def said(sweep: str, arm: str, least: float = 0.0, most: float = np.inf) -> str:
        chosen = [p for p in points if (p.sweep, p.arm) == (sweep, arm) and least <= p.level <= most]
        faults, episodes = sum(p.at_fault for p in chosen), sum(len(p.played) for p in chosen)
        broken, pairs = (sum(p.broken[k] for p in chosen) for k in range(2))
        return (
            f"{spaced(broken)} of {spaced(pairs)} duties broken and {faults} of {spaced(episodes)} episodes at fault "
            f"{percent(faults, episodes)[percent(faults, episodes).index('[') :]} %"
        )

    lines = [
        f"{WORDS[sweep][0]}, all levels: inflated {said(sweep, 'inflated')}; as seen {said(sweep, 'as seen')}."
        for sweep in ("noise", "misses", "latency")
    ]
    lines.append(
        f"Latency of 0.4 s with a response time of 0.8 s: inflated {said('response', 'inflated', least=0.8)}; as seen "
        f"{said('response', 'as seen', least=0.8)}."
    )
    lines.append(f"All at once, as bad as said: inflated {said('excess', 'inflated', most=1.0)}.")
    lines.append(f"Worse than said: inflated {said('excess', 'inflated', least=1.1)}.")
    return "\n".join(["## What it says", "", *(f"- {line}" for line in lines)])


def main(config: Config) -> int:
    matplotlib.use("Agg")
    points = sweep_all(config.episodes)
    parts = [sweep_part(sweep, [p for p in points if p.sweep == sweep]) for sweep in SWEEPS]
    parts += [pac_part(4 * config.episodes), redundancy_part(config.decisions)]
    if config.write:
        plot(points, FIGURE)
        alt = "Broken duties and episodes at fault against noise, misses, response time and a broken promise"
        picture = f"![{alt}](../sensing.png)"
        write_page(PAGE, [HEADER, summary(points), picture, *parts])
    else:
        print("\n\n".join([summary(points), *parts]))
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config)))
