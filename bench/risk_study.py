"""Field risk beside RSS and TTC: who reacts first, which SOTIF areas policies drive in, and does one imply the other?

    python bench/risk_study.py                                  tables and figures of everything, in half an hour
    python bench/risk_study.py --write                          ... and docs/results/risk.md
    python bench/risk_study.py --runs runs/highway-fast-v0      with the trained agents of a run of train.py as well

Six situations after the tests of emergency braking are played to the contact, with nobody braking. Then scripted
policies, and trained ones, drive with the shield watching and with it acting, all on the same seeds.
"""

import dataclasses
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
import pandas as pd
import tyro
from matplotlib.figure import Figure

from rss_shield import d_min_same_direction, make
from rss_shield.envs.highway.recorder import record_trace
from rss_shield.eval.files import atomic
from rss_shield.eval.pages import markdown, spaced, write_page
from rss_shield.eval.plots import STYLE
from rss_shield.eval.stats import Interval, bootstrap_mean
from rss_shield.shield.geometry import make_road
from rss_shield.shield.lanes.frame import to_lane_frame_all
from rss_shield.shield.lanes.pair import ROAD_USER, assess
from rss_shield.shield.params import PRESETS, Rules, Table
from rss_shield.shield.risk import RiskSettings, band_risk, risk_of, road_users, toward_leader

ROADS = ("highway-fast-v0", "merge-v0", "intersection-v0")
POLICIES = ("random", "faster", "idle")
SHIELDS = ("monitor", "override")
AREAS = ("known safe", "unknown", "known unsafe")
FIRST_SEED = 900_000
PAGE, FIGURE, AREA_FIGURE = Path("docs/results/risk.md"), Path("docs/risk.png"), Path("docs/sotif.png")
HEADER = f"""# Field risk beside RSS

Written by `python bench/risk_study.py --write`. Risk is RDSI of the driving safety field: of each road user around
the ego, what it adds to the ego's potential energy and how fast that grows, relative to a standard scene (headway 1 s
and time to collision 4 s at once). Up to RDSI1* driving is *known safe*, up to RDSI2* *unknown*, above
*known unsafe*: the areas of SOTIF (ISO 21448). Values that the literature has lost are settings
(`rss_shield.shield.risk.assumed()` lists them), and what stands here is about their defaults:
{len(RiskSettings._fields)} settings of `RiskSettings()`, mode "iso" unless it says "radial".
"""


@dataclasses.dataclass(frozen=True)
class Config:
    """Compare field risk with RSS and TTC."""

    envs: tuple[str, ...] = ROADS
    episodes: int = 60  # per road, policy and shield
    runs: Path | None = None  # folder of a run of train.py, for its trained agents
    write: bool = False  # docs/results/risk.md and its figures


# ---------------------------------------------------------------- six situations


class Situation(NamedTuple):
    """The ego drives straight on and meets somebody at t = 0; nobody reacts."""

    name: str
    kind: str  # of road user in the field
    mass: float  # [kg]
    length: float  # [m]
    width: float
    speed: float  # [m/s]
    crosses: bool  # from the right, to the middle of the ego's front; else drives ahead the same way
    cuts_in: bool = False  # from the lane on the right


KMH = 1 / 3.6
SITUATIONS = (
    Situation("car ahead, 20 km/h", "car", 1500.0, 5.0, 2.0, 20 * KMH, False),
    Situation("car cuts in, 20 km/h", "car", 1500.0, 5.0, 2.0, 20 * KMH, False, True),
    Situation("car crosses, 20 km/h", "car", 1500.0, 5.0, 2.0, 20 * KMH, True),
    Situation("bicycle ahead, 15 km/h", "cyclist", 90.0, 1.8, 0.6, 15 * KMH, False),
    Situation("bicycle crosses, 15 km/h", "cyclist", 90.0, 1.8, 0.6, 15 * KMH, True),
    Situation("pedestrian crosses, 5 km/h", "pedestrian", 75.0, 0.6, 0.6, 5 * KMH, True),
)
EGO_SPEEDS = (30, 40, 50, 60, 70, 80)  # [km/h]
SHOWN = 50  # the one in the figure and first in the table
LENGTH, WIDTH = 5.0, 2.0  # of the ego [m]
LANE, SIDEWAYS = 3.5, 1.0  # a cut-in is across a lane [m] at this speed [m/s], and over
IN_LANE = 1.5  # so long before the contact [s]
DT, BEFORE = 0.02, 10.0  # [s]
HARD = 6.0  # braking that would still avoid the contact [m/s^2]
TABLES = ("slides", "simulator")  # RSS parameters


def play_to_contact(situation: Situation, v: float, mode: str = "iso") -> pd.DataFrame:
    """All measures over time, the contact at t = 0; v [m/s] is the ego's speed."""
    t = np.arange(-BEFORE, DT / 2, DT)
    x, y = v * t, np.zeros(len(t))
    if situation.crosses:
        other_x, other_y = np.full(len(t), (LENGTH + situation.width) / 2), -situation.speed * t
        heading = np.full(len(t), -np.pi / 2)
    else:
        other_x, other_y = (LENGTH + situation.length) / 2 + situation.speed * t, np.zeros(len(t))
        heading = np.zeros(len(t))
        if situation.cuts_in:
            other_y = np.clip(-SIDEWAYS * (t + IN_LANE), 0.0, LANE)
            sideways = (other_y > 0.0) & (other_y < LANE)
            heading = np.where(sideways, -np.arcsin(SIDEWAYS / situation.speed), 0.0)
            other_x = (LENGTH + situation.length) / 2 - np.cumsum((situation.speed * np.cos(heading) * DT)[::-1])[::-1]
    settings = RiskSettings.validated(mode=mode)
    egos = road_users(x, y, v, 0.0)
    others = road_users(
        *(other_x, other_y, situation.speed * np.cos(heading), situation.speed * np.sin(heading)),
        mass=situation.mass,
        kind=situation.kind,
    )
    road = make_road([(0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
    boxes = np.array(
        [
            (situation.length, situation.width, *_half_extents(situation)),
            (LENGTH, WIDTH, LENGTH / 2, WIDTH / 2),
        ]
    )
    rows, before = [], np.full((2, 2), np.nan)
    for k in range(len(t)):
        risk = risk_of(egos[k], others[k], False, settings)
        poses = np.array([(other_x[k], other_y[k], heading[k], situation.speed), (x[k], y[k], 0.0, v)])
        users = np.zeros(2, ROAD_USER)
        users["in_own_lane"] = True
        to_lane_frame_all(road, poses, before, boxes, DT, users)
        before = poses[:, :2]
        other, ego = users
        row = {
            "t": t[k],
            "rdsi": risk.rdsi,
            "lower": risk.lower,
            "upper": risk.upper,
            "ttc": toward_leader(ego, users[:1]).ttc,
        }
        for name in TABLES:
            preset = PRESETS[name]
            pair = assess(ego, other, Table(preset.ego, preset.other, Rules(), DT))
            row[f"{name} margin"] = max(pair.margin_lon, pair.margin_lat)
        rows.append(row)
    return pd.DataFrame(rows)


def _half_extents(situation: Situation) -> tuple[float, float]:
    """Half extents along and across the ego's lane [m]."""
    along, across = situation.length / 2, situation.width / 2
    return (across, along) if situation.crosses else (along, across)


def _is_too_near(table: str, rows: pd.DataFrame) -> Any:
    return rows[f"{table} margin"] < 0.0


# name in the table -> from when on it holds
REACTIONS: dict[str, Callable[[pd.DataFrame], Any]] = {
    "RDSI unknown": lambda rows: rows["rdsi"] >= rows["lower"],
    "RDSI known unsafe": lambda rows: rows["rdsi"] > rows["upper"],
    "TTC < 4 s": lambda rows: rows["ttc"] < 4.0,
    **{f'RSS "{name}"': partial(_is_too_near, name) for name in TABLES},
}


def reaction_time(rows: pd.DataFrame, holds: Any) -> float:
    """How long before the contact something begins to hold for good [s]; 0 = never."""
    fails = np.flatnonzero(~np.asarray(holds)[:-1])  # the contact itself is no warning
    first = fails[-1] + 1 if len(fails) else 0
    return float(-rows["t"].iloc[first]) if first < len(rows) - 1 else 0.0


def last_moment(situation: Situation, v: float) -> float:
    """Time before the contact at which braking at `HARD` just avoids it [s]: to the other's speed, or to rest."""
    closing = v - (0.0 if situation.crosses else situation.speed)
    return closing / (2 * HARD)


def reactions(mode: str = "iso") -> pd.DataFrame:
    """One row per situation and speed of the ego: seconds before the contact."""
    rows = []
    for situation in SITUATIONS:
        for kmh in EGO_SPEEDS:
            seen = play_to_contact(situation, kmh * KMH, mode)
            found = {name: reaction_time(seen, holds(seen)) for name, holds in REACTIONS.items()}
            moment = last_moment(situation, kmh * KMH)
            rows.append({"situation": situation.name, "kmh": kmh, **found, "last moment": moment})
    return pd.DataFrame(rows)


def reaction_part(frame: pd.DataFrame, radial: pd.DataFrame) -> str:
    names = [*REACTIONS, "last moment"]
    rows: list[Any] = [("situation", *names)]
    for situation in SITUATIONS:
        here = frame[frame["situation"] == situation.name]
        shown = here[here["kmh"] == SHOWN].iloc[0]
        cells = [f"{shown[name]:.1f} ({here[name].min():.1f} to {here[name].max():.1f})" for name in names]
        rows.append((situation.name, *cells))
    return "\n\n".join(
        [
            "## Who reacts first",
            f"Six situations after the tests of emergency braking, at constant speeds up to the contact. Seconds "
            f"before it at which each measure begins to warn for good, the ego at {SHOWN} km/h, and in brackets from "
            f"the least to the most over {EGO_SPEEDS[0]} to {EGO_SPEEDS[-1]} km/h in steps of 10 (n = "
            f"{len(EGO_SPEEDS)}, no chance in it). Observed from {BEFORE:g} s before the contact on, so {BEFORE:.1f} "
            f"means all along. Last moment: when braking at {HARD:g} m/s² still avoids it. TTC: toward whoever is in "
            f"the ego's way. RSS: longitudinally and laterally too near, by the parameters of a preset.",
            markdown(rows),
            "![Risk, TTC and RSS before a contact](../risk.png)",
            _first_words(frame, radial),
        ]
    )


def _first_words(frame: pd.DataFrame, radial: pd.DataFrame) -> str:
    """The table in words, counted."""
    crossing = frame["situation"].str.contains("cross|cuts")
    parts = []
    for where, name in ((crossing, "crossing and cut-in"), (~crossing, "following")):
        part = frame[where]
        ahead = part["RDSI unknown"] - part["TTC < 4 s"]
        parts.append(
            f"{name}: RDSI is in the unknown band before TTC falls below 4 s in {(ahead > 1e-9).sum()} of {len(part)} "
            f"runs, by {ahead.median():.1f} s in the median ({ahead.min():.1f} to {ahead.max():.1f} s)"
        )
    text = [f"- {part[0].upper()}{part[1:]}." for part in parts]
    for table in TABLES:
        lead = frame["RDSI unknown"] - frame[f'RSS "{table}"']
        unsafe = frame[f'RSS "{table}"'] - frame["RDSI known unsafe"]
        text.append(
            f'- RSS "{table}": RDSI becomes unknown earlier in {(lead > 1e-9).sum()} of {len(frame)} runs (median '
            f"{lead.median():+.1f} s); RSS is dangerous before RDSI is known unsafe in {(unsafe > 1e-9).sum()} (median "
            f"{unsafe.median():+.1f} s)."
        )
    late = {name: int((frame[name] < frame["last moment"]).sum()) for name in REACTIONS}
    never = {name: int((frame[name] == 0.0).sum()) for name in REACTIONS}
    text.append(
        f"- Later than the last moment for braking, of {len(frame)} runs: "
        + "; ".join(
            f"{name} {count}" + (f", {never[name]} of them never" if never[name] else "")
            for name, count in late.items()
        )
        + "."
    )
    change = radial["RDSI unknown"] - frame["RDSI unknown"]
    text.append(
        f'- In mode "radial" the unknown band begins {change.median():+.1f} s earlier in the median '
        f"({change.min():+.1f} to {change.max():+.1f} s)."
    )
    return "\n".join(text)


def plot_reactions(path: Path) -> None:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.5, 5.6))
        grid = figure.subplots(2, 3, sharex=True, sharey=True)
        for axes, situation in zip(grid.flat, SITUATIONS, strict=True):
            rows = play_to_contact(situation, SHOWN * KMH)
            t = -rows["t"]
            axes.axhspan(0.0, rows["lower"].median(), color="#009E73", alpha=0.08, lw=0)
            axes.axhspan(1.0, 3.0, color="#D55E00", alpha=0.08, lw=0)
            axes.plot(t, rows["rdsi"], color="#0072B2", lw=1.8, label="RDSI")
            axes.plot(t, rows["lower"], color="#0072B2", lw=0.9, ls=":", label="RDSI1*, RDSI2*")
            axes.plot(t, rows["upper"], color="#0072B2", lw=0.9, ls=":")
            with np.errstate(divide="ignore"):
                axes.plot(t, 4.0 / rows["ttc"], color="#E69F00", lw=1.4, ls="--", label="4 s / TTC")
            for height, table, colour in zip((0.06, 0.18), TABLES, ("#CC79A7", "#D55E00"), strict=True):
                axes.fill_between(
                    *(t, height, height + 0.1),
                    where=rows[f"{table} margin"] < 0.0,
                    color=colour,
                    lw=0,
                    label=f'dangerous, RSS "{table}"',
                )
            axes.axvline(
                last_moment(situation, SHOWN * KMH), color="0.3", lw=0.9, ls="-.", label="last moment to brake"
            )
            axes.set_title(situation.name, loc="left")
            axes.set_xlim(6.0, 0.0)
            axes.set_ylim(0.0, 2.5)
        for axes in grid[-1]:
            axes.set_xlabel("time before the contact [s]")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        figure.suptitle(f"The ego at {SHOWN} km/h; green: known safe, red: known unsafe", size=9)
        with atomic(path) as temporary:
            figure.savefig(temporary, format="png", dpi=130)


# ---------------------------------------------------------------- policies


def act(policy: str, actions: int, rng: np.random.Generator) -> Callable[[Any], int]:
    """A scripted policy in an environment with so many meta-actions."""
    if policy == "random":
        return lambda _: int(rng.integers(actions))
    faster = 2 if actions == 3 else 3
    return lambda _: faster if policy == "faster" else 1


class Frames(NamedTuple):
    """What both measures say on the frames of one episode, `[T]`."""

    state: np.ndarray  # class by the field
    sum_state: np.ndarray  # class of the sum of all sources
    dangerous: np.ndarray  # RSS: something is owed to somebody
    seconds: float  # length of a frame
    band_risk: float  # [s]


def play(env_id: str, shield: str, episodes: int, driver: Callable[[int, int], Callable[[Any], int]]) -> list[Frames]:
    """One entry per episode; `driver` takes the number of meta-actions and a seed, and returns a policy."""
    played = []
    for seed in range(FIRST_SEED, FIRST_SEED + episodes):
        env: Any = make(env_id, shield, risk=True)
        trace = record_trace(env, driver(int(env.action_space.n), seed), seed)
        looks = env.risk_frames
        (ego,) = trace.egos
        played.append(
            Frames(
                np.array([look.state for look in looks], int),
                np.array([look.state_of_total for look in looks], int),
                ego.dangerous[: len(looks)].astype(bool),
                trace.dt,
                _band(looks),
            )
        )
        env.close()
    return played


def _band(looks: list[Any]) -> float:
    """Risk of an episode [s]: RDSI over the time in the unknown band."""
    if not looks:  # a contact at once
        return 0.0
    times, rdsi, lower, upper = np.array([(look.time, look.rdsi, look.lower, look.upper) for look in looks]).T
    return band_risk(times, rdsi, lower, upper).total


def trained(path: Path) -> Callable[[int, int], Callable[[Any], int]]:
    """A model of train.py as a driver."""
    from rss_shield.agents.load import load_policy  # takes seconds to import

    policy = load_policy(path)
    return lambda actions, seed: lambda observation: int(policy(observation[None])[0])


def drivers(env_id: str, runs: Path | None) -> dict[str, list[Callable[[int, int], Callable[[Any], int]]]]:
    """Name -> drivers that share the episodes among themselves."""
    found: dict[str, list[Any]] = {
        policy: [lambda actions, seed, policy=policy: act(policy, actions, np.random.default_rng(seed))]
        for policy in POLICIES
    }
    if runs is not None and runs.name == env_id:
        for arm in ("unshielded", "shielded"):
            models = sorted(runs.glob(f"{arm}-seed*/model.zip"))
            if models:
                found[f"PPO, trained {arm}"] = [trained(model) for model in models]
    return found


def ratio(above: Iterable[float], below: Iterable[float], rng: np.random.Generator, resamples: int = 2000) -> Interval:
    """Sum over sum with a 95 % interval of the bootstrap over episodes; frames of one episode go together.

    Args:
      above, below: `[n]` one pair per episode.
      rng: draws the resamples.
    """
    a, b = np.asarray(above, float), np.asarray(below, float)
    if b.sum() == 0.0:
        return Interval(np.nan, np.nan, np.nan, len(b))
    draws = rng.integers(len(b), size=(resamples, len(b)))
    sums = b[draws].sum(axis=1)
    values = a[draws].sum(axis=1)[sums > 0.0] / sums[sums > 0.0]
    low, high = np.quantile(values, (0.025, 0.975))
    return Interval(float(a.sum() / b.sum()), float(low), float(high), len(b))


def percent(interval: Interval) -> str:
    if np.isnan(interval.value):
        return "–"
    value, low, high = (100 * part for part in interval[:3])
    return f"{value:.1f} % [{low:.1f}, {high:.1f}]"


class Case(NamedTuple):
    """Episodes of one driver on one road under one shield."""

    road: str
    driver: str
    shield: str
    played: list[Frames]


def cases(config: Config) -> list[Case]:
    found = []
    for env_id in config.envs:
        for driver, several in drivers(env_id, config.runs).items():
            for shield in SHIELDS:
                share = -(-config.episodes // len(several))
                played = [frames for one in several for frames in play(env_id, shield, share, one)]
                found.append(Case(env_id, driver, shield, played))
                print(f"{env_id}, {driver}, {shield}: {len(played)} episodes", flush=True)
    return found


def areas_part(found: list[Case], rng: np.random.Generator) -> str:
    rows: list[Any] = [("road", "driver", "shield", "episodes", *AREAS, "band risk [s per episode]", "RSS dangerous")]
    for case in found:
        lengths = [len(frames.state) for frames in case.played]
        shares = [
            percent(ratio([(frames.state == k).sum() for frames in case.played], lengths, rng))
            for k in range(len(AREAS))
        ]
        band = bootstrap_mean([frames.band_risk for frames in case.played], rng)
        dangerous = percent(ratio([frames.dangerous.sum() for frames in case.played], lengths, rng))
        shield = {"monitor": "off", "override": "on"}[case.shield]
        bands = f"{band.value:.1f} [{band.low:.1f}, {band.high:.1f}]"
        rows.append((f"`{case.road}`", case.driver, shield, len(case.played), *shares, bands, dangerous))
    return "\n\n".join(
        [
            "## SOTIF areas",
            "Share of the frames in each area by the critical source, with 95 % intervals of the bootstrap over "
            "episodes. Off: the shield watches only. Episodes end at a contact. In `merge-v0` and `intersection-v0` "
            "the ego begins at its top speed, so FASTER and IDLE ask for the same.",
            markdown(rows),
            "![SOTIF areas](../sotif.png)",
            _areas_words(found),
        ]
    )


def _areas_words(found: list[Case]) -> str:
    text = []
    for case in found:
        if case.shield == "monitor":
            other = next(one for one in found if one[:2] == case[:2] and one.shield == "override")
            unsafe = [
                np.concatenate([frames.state for frames in one.played]) == len(AREAS) - 1 for one in (case, other)
            ]
            off, on = (100 * part.mean() for part in unsafe)
            text.append(f"`{case.road}`, {case.driver}: {off:.1f} % → {on:.1f} %")
    return f"Known unsafe, shield off → on: {'; '.join(text)}."


def plot_areas(found: list[Case], path: Path) -> None:
    colours = ("#009E73", "#F0E442", "#D55E00")
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.5, 0.26 * len(found) + 1.3))
        axes = figure.subplots()
        left = np.zeros(len(found))
        for k, area in enumerate(AREAS):
            width = [100 * (np.concatenate([f.state for f in case.played]) == k).mean() for case in found]
            hatch = ("", "..", "//")[k]
            axes.barh(range(len(found)), width, left=left, color=colours[k], edgecolor="white", hatch=hatch, label=area)
            left += width
        names = [f"{c.road}, {c.driver}, shield {'off' if c.shield == 'monitor' else 'on'}" for c in found]
        axes.set_yticks(range(len(found)), names)
        axes.invert_yaxis()
        axes.set_xlim(0, 100)
        axes.set_xlabel("share of the frames [%]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=len(AREAS))
        with atomic(path) as temporary:
            figure.savefig(temporary, format="png", dpi=130)


# ---------------------------------------------------------------- does one imply the other?


def confusion_part(found: list[Case], rng: np.random.Generator) -> str:
    """RSS danger against classes of the field, per road, of unshielded and shielded policies together and apart."""
    parts = ["## Does one imply the other?"]
    parts.append(
        "Frames by class of the field and by RSS: dangerous is a frame on which the ego owes somebody a proper "
        "response, or where roads cross has no plan that is clear of everybody. Shares of the row, with 95 % "
        "intervals of the bootstrap over episodes."
    )
    rows: list[Any] = [("road", "shield", "RSS", "frames", *AREAS)]
    words = []
    for road in dict.fromkeys(case.road for case in found):
        for shield in SHIELDS:
            played = [frames for case in found if case.road == road and case.shield == shield for frames in case.played]
            for dangerous in (True, False):
                count = [(frames.dangerous == dangerous).sum() for frames in played]
                cells = [
                    percent(ratio([((f.dangerous == dangerous) & (f.state == k)).sum() for f in played], count, rng))
                    for k in range(len(AREAS))
                ]
                name = "dangerous" if dangerous else "safe"
                off = {"monitor": "off", "override": "on"}[shield]
                rows.append((f"`{road}`", off, name, spaced(int(sum(count))), *cells))
            words.append(_implications(road, shield, played, rng))
    return "\n\n".join([*parts, markdown(rows), "\n".join(words), _overlap_words(found)])


def _is_dangerous(frames: Frames) -> np.ndarray:
    return frames.dangerous


def _is_risky(frames: Frames) -> np.ndarray:
    return frames.state > 0


def _is_unsafe(frames: Frames) -> np.ndarray:
    return frames.state == len(AREAS) - 1


def _is_any(frames: Frames) -> np.ndarray:
    return frames.state >= 0


def _implications(road: str, shield: str, played: list[Frames], rng: np.random.Generator) -> str:
    def share(of: Callable[[Frames], Any], among: Callable[[Frames], Any]) -> str:
        return percent(ratio([(of(f) & among(f)).sum() for f in played], [among(f).sum() for f in played], rng))

    off = {"monitor": "off", "override": "on"}[shield]
    return (
        f"- `{road}`, shield {off} ({len(played)} episodes): of RSS-dangerous frames "
        f"{share(_is_risky, _is_dangerous)} are unknown or known unsafe; of unknown or unsafe frames "
        f"{share(_is_dangerous, _is_risky)} are RSS-dangerous, of known unsafe ones "
        f"{share(_is_dangerous, _is_unsafe)}."
    )


def _overlap_words(found: list[Case]) -> str:
    frames = [one for case in found if case.shield == "monitor" for one in case.played]
    dangerous = np.concatenate([one.dangerous for one in frames])
    state = np.concatenate([one.state for one in frames])
    total = np.concatenate([one.sum_state for one in frames])
    missed = int((dangerous & (state == 0)).sum())
    by_sum, by_one = (f"{100 * (which > 0).mean():.0f} %" for which in (total, state))
    return (
        f"Of all {spaced(int(dangerous.sum()))} RSS-dangerous frames without the shield's action the field calls "
        f"{spaced(missed)} known safe by the critical source. By the sum of all sources {by_sum} of all frames are "
        f"unknown or known unsafe, and {by_one} by the critical one: sums saturate in traffic that is in no danger."
    )


# ---------------------------------------------------------------- the page


def summary(found: list[Case]) -> str:
    """What it says, in words."""
    off, on = ([case for case in found if case.shield == shield] for shield in SHIELDS)
    unsafe = [[_share(_is_unsafe, _is_any, [case]) for case in cases] for cases in (off, on)]
    fewer = sum(after < before for before, after in zip(*unsafe, strict=True))
    by_road = [[[case for case in cases if case.road == road] for road in _roads(found)] for cases in (off, on)]
    implied = [[_share(_is_risky, _is_dangerous, cases) for cases in roads] for roads in by_road]
    back = [[_share(_is_dangerous, _is_unsafe, cases) for cases in roads] for roads in by_road]
    ego, other = PRESETS["simulator"][:2]
    needed = float(d_min_same_direction(25.0, 25.0, ego, other))
    lines = [
        f"RSS danger implies risk, mostly: with the shield off {_span(implied[0])} of the RSS-dangerous frames are "
        f"unknown or known unsafe, by road; with it on {_span(implied[1])}.",
        f"Risk does not imply RSS danger: of the known unsafe frames {_span(back[0])} are RSS-dangerous with the "
        f"shield off, and {_span(back[1])} with it on. The field's standard is a headway of 1 s, which at 25 m/s is "
        f'25 m between centres; the table of motorways ("simulator") asks for {needed:.1f} m between bumpers behind '
        f"somebody as fast.",
        f"With the shield on there is less time in the known unsafe area in {fewer} of {len(off)} comparisons: "
        f"{_span(unsafe[0])} of the frames become {_span(unsafe[1])}.",
    ]
    return "\n".join(["## What it says", "", *(f"- {line}" for line in lines)])


def _roads(found: list[Case]) -> list[str]:
    return list(dict.fromkeys(case.road for case in found))


def _span(shares: list[float]) -> str:
    return f"{100 * min(shares):.1f} to {100 * max(shares):.1f} %"


def _share(of: Callable[[Frames], Any], among: Callable[[Frames], Any], cases: list[Case]) -> float:
    """Share of frames; NaN where there are none."""
    frames = [one for case in cases for one in case.played]
    count = sum(int(among(one).sum()) for one in frames)
    return sum(int((of(one) & among(one)).sum()) for one in frames) / count if count else float("nan")


def main(config: Config) -> int:
    unknown = [env_id for env_id in config.envs if env_id not in ROADS]
    if unknown:
        print(f"envs = {unknown[0]!r}: expected some of {', '.join(ROADS)}", file=sys.stderr)
        return 2
    matplotlib.use("Agg")
    first = reaction_part(reactions(), reactions("radial"))
    print(first, flush=True)
    found = cases(config)
    rng = np.random.default_rng(0)
    areas, confusion = areas_part(found, rng), confusion_part(found, rng)
    print(areas, confusion, sep="\n\n", flush=True)
    if config.write:
        plot_reactions(FIGURE)
        plot_areas(found, AREA_FIGURE)
        write_page(PAGE, [HEADER, summary(found), first, areas, confusion])
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Config)))
