"""How do people drive, measured by RSS? Recorded traffic against Lemma 2, the duties and the response times.

    python bench/human_traffic.py --data FOLDER            # CommonRoad scenarios of recorded traffic in FOLDER
    python bench/human_traffic.py --data FOLDER --write    # and write docs/results/human_traffic.md

A follower has somebody ahead in its lane, bumper to bumper along it. Intervals are bootstrapped over followers: samples
of one are no independent draws.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rss_shield.eval.files import write_text
from rss_shield.eval.suite.judge.commonroad import read_commonroad
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.judge.lanes import Table, see_all
from rss_shield.eval.suite.judge.smoothing import SURE, filled_in
from rss_shield.shield import PRESETS, RSSParams, Rules, d_min_same_direction

RECORDED = ("USA_US101-5_1_T-1", "USA_Lanker-1_3_T-1")  # NGSIM: a motorway in a jam, a city street with lights
PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "human_traffic.md"
PLAIN = Rules(heading_bound=1.0, discretisation_margin=False, overlap_margin=0.0)  # Lemma 2 and nothing on top
TABLES = (  # preset, whose parameters, response time [s]
    *(("slides", "ego", rho) for rho in (0.5, 1.0, 1.5, 2.0)),
    ("rodionova-conservative", "ego", None),
    ("rodionova-assertive", "ego", None),
    ("carla", "ego", None),
    ("simulator", "other", None),
    ("simulator", "ego", None),
)
STANDING = 1.0  # slower followers are left out: who stands is at rest behind somebody, not following [m/s]
BRAKES = 0.5  # deceleration from which on somebody has begun to answer [m/s^2]
DRAWS, LEVEL = 2000, 0.95


class Followers(NamedTuple):
    """All samples of all followers."""

    who: np.ndarray  # `[S]` number of the pair of follower and log
    gap: np.ndarray  # `[S]` [m]
    v: np.ndarray  # `[S]` [m/s]
    v_leader: np.ndarray


def followers_of(traces: dict) -> Followers:
    """Who follows whom, in all logs."""
    parts, count = [], 0
    for trace in traces.values():
        params = PRESETS["slides"].other
        for i, seen in see_all(trace, Table(params, params, PLAIN, trace.dt)).items():
            frames = seen.frames
            ahead = frames["present"] & frames["ego_is_rear"] & ~frames["opposite"] & (frames["gap_lat"] < 0.0)
            ahead &= frames["gap_lon"] > 0.0
            gap = np.where(ahead, frames["gap_lon"], np.inf)
            t = np.flatnonzero(ahead.any(axis=1) & (trace.users.speed[:, i] >= STANDING))
            j = gap[t].argmin(axis=1)
            parts.append(np.stack([np.full(len(t), count), gap[t, j], frames["v_ego"][t, j], frames["v_other"][t, j]]))
            count += 1
    return Followers(*np.concatenate(parts, axis=1))


def quantile_with_interval(
    who: np.ndarray, values: np.ndarray, quantile: float | None, rng: np.random.Generator
) -> tuple[float, float, float]:
    """A quantile of samples, None = their mean, and its interval: followers are drawn, with all their samples."""

    def of(chosen: np.ndarray) -> float:
        return float(np.mean(chosen) if quantile is None else np.quantile(chosen, quantile))

    groups = [values[who == k] for k in np.unique(who)]
    drawn = [of(np.concatenate([groups[k] for k in rng.integers(len(groups), size=len(groups))])) for _ in range(DRAWS)]
    low, high = np.quantile(drawn, [0.5 * (1 - LEVEL), 0.5 * (1 + LEVEL)])
    return of(values), float(low), float(high)


def implied_response_time(followers: Followers, params: RSSParams, longest: float = 20.0) -> np.ndarray:
    """Response time with which each gap is just safe by Lemma 2 [s]; 0 where it is not with any."""
    low, high = np.zeros(len(followers.gap)), np.full(len(followers.gap), longest)
    for _ in range(40):
        middle = 0.5 * (low + high)
        needed = np.array(
            [
                d_min_same_direction(v, u, params._replace(response_time=rho), params)
                for v, u, rho in zip(followers.v, followers.v_leader, np.maximum(middle, 1e-6), strict=True)
            ]
        )
        safe = needed <= followers.gap
        low, high = np.where(safe, middle, low), np.where(safe, high, middle)
    return low


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with the scenarios (.xml)")
    parser.add_argument("--seed", type=int, default=0, help="of the bootstrap")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name}")
    options = parser.parse_args()
    paths = {name: options.data / f"{name}.xml" for name in RECORDED}
    missing = [str(path) for path in paths.values() if not path.exists()]
    if missing:
        sys.exit(f"bench/human_traffic.py: no {', '.join(missing)}")
    page = page_of({name: read_commonroad(path) for name, path in paths.items()}, options.seed)
    print(page)
    if options.write:
        write_text(PAGE, page)


def page_of(traces: dict, seed: int) -> str:
    """The page of results."""
    rng = np.random.default_rng(seed)
    smooth = {name: filled_in(trace)[0] for name, trace in traces.items()}
    logs = {name: followers_of({name: trace}) for name, trace in smooth.items()}
    sizes = [f"{name} {len(one.gap)} samples of {len(np.unique(one.who))} followers" for name, one in logs.items()]
    lines = [
        "# Human traffic",
        "",
        "Written by `python bench/human_traffic.py --data FOLDER --write`. Recorded human traffic (NGSIM, as in the "
        "CommonRoad scenarios of these names: a motorway in a jam, and a city street with lights), judged by RSS. "
        f"Samples are of 0.1 s, of followers that move at {STANDING:g} m/s or more: n = {'; '.join(sizes)}. Intervals: "
        f"95 %, bootstrapped over followers ({DRAWS} draws), because samples of one are no independent draws.",
        "",
        "People drive closer than the model asks. That is no near miss: Lemma 2 is about the worst that a leader "
        "may do.",
        "",
        "## Follower time inside the distance of Lemma 2",
        "",
        f"| preset | response time [s] | {' | '.join(logs)} |",
        "|---|---|" + "---|" * len(logs),
    ]
    for name, whose, rho in TABLES:
        params = getattr(PRESETS[name], whose)
        params = params if rho is None else params._replace(response_time=rho)
        cells = []
        for one in logs.values():
            needed = d_min_same_direction(one.v, one.v_leader, params, params)
            share, low, high = quantile_with_interval(one.who, (one.gap < needed).astype(float), None, rng)
            cells.append(f"{share:.0%} ({low:.0%} to {high:.0%})")
        lines.append(f"| {name} | {params.response_time:.2g} | {' | '.join(cells)} |")
    cells = []
    for one in logs.values():
        median, low, high = quantile_with_interval(one.who, one.gap / one.v, 0.5, rng)
        cells.append(f"{median:.1f} s ({low:.1f} to {high:.1f})")
    lines += [f"| median time gap | | {' | '.join(cells)} |", "", "## Which response time fits", ""]
    together = followers_of(smooth)
    lines += _fitting(together, rng)
    lines += _duties(traces, rng)
    return "\n".join(lines) + "\n"


def _fitting(followers: Followers, rng: np.random.Generator) -> list[str]:
    lines = [
        "The response time with which a follower's gap would just be safe, all else as in the preset, both logs "
        "together. A quarter, half and three quarters of the follower time are below; 0 means that it is safe with "
        "none.",
        "",
        "| preset | a quarter below | half | three quarters below |",
        "|---|---|---|---|",
    ]
    for name in ("slides", "rodionova-assertive", "simulator"):
        rho = implied_response_time(followers, PRESETS[name].ego)
        cells = []
        for q in (0.25, 0.5, 0.75):
            value, low, high = quantile_with_interval(followers.who, rho, q, rng)
            cells.append(f"{value:.2f} s ({low:.2f} to {high:.2f})")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def _duties(traces: dict, rng: np.random.Generator) -> list[str]:
    """Who breaks which duty, and how often the proper response is given."""
    lines = [
        "",
        "## Duties",
        "",
        "Stretches of danger of one user with another, from the view of who owes, with the parameters of the preset "
        f"for everybody. *Surely broken*: by more than {SURE:g} standard deviations of what positions and estimates "
        "are worth. *Response given*: of the samples on which braking is owed, after the response time, those on which "
        "the estimated command kept it, with an interval bootstrapped over stretches. *First braking*: median time "
        "from the threshold until who owes brakes with more than 0.5 m/s², of those that did.",
        "",
        "| preset | log | role | stretches | surely broken | of these weak braking | sideways | response given | "
        "first braking [s] |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for preset in ("slides", "rodionova-assertive", "simulator"):
        for name, trace in traces.items():
            judgement = judge_trace(_unknown(trace), preset)
            for role in ("rear", "front"):
                lines.append(_duty_row(preset, name, role, judgement, rng))
    return lines


def _unknown(trace):
    """The trace without accelerations, where it has any: so the judge estimates all of them in one way."""
    return trace.replaced(users=replace(trace.users, acceleration=np.full_like(trace.users.x, np.nan)))


def _duty_row(preset: str, name: str, role: str, judgement, rng: np.random.Generator) -> str:
    dangers = [one for one in judgement.dangers if one.role == role]
    broken = [one for one in dangers if one.duty and one.is_sure]
    weak = sum(one.duty.startswith("braked") for one in broken)
    aside = sum("across the lane" in one.duty for one in broken)
    kept, owed, delays = [], [], []
    trace, rho, dt = judgement.trace, judgement.table.other.response_time, judgement.trace.dt
    for one in dangers:
        frames = judgement.seen[one.user].frames[:, one.partner]
        here = (trace.time >= one.start - 1e-9) & (trace.time < one.end - 1e-9) & frames["dangerous"]
        late = here & frames["owes_braking"] & (frames["since"] * dt >= rho - 1e-9)
        owed.append(int(late.sum()))
        kept.append(int((late & (frames["duty"] == 0)).sum()))
        if frames["owes_braking"][here].any():
            a = trace.users.acceleration[here, one.user]
            first = np.flatnonzero(a < -BRAKES)
            delays += [float(frames["since"][here][first[0]] * dt)] if len(first) else []
    share = _share(np.array(kept), np.array(owed), rng)
    delay = f"{np.median(delays):.1f} (n = {len(delays)})" if delays else "none"
    cells = (preset, name, role, len(dangers), len(broken), weak, aside, share, delay)
    return "| " + " | ".join(map(str, cells)) + " |"


def _share(kept: np.ndarray, owed: np.ndarray, rng: np.random.Generator) -> str:
    """Share of the samples owed, with an interval over stretches of danger."""
    if not owed.sum():
        return "none owed"
    drawn = rng.integers(len(owed), size=(DRAWS, len(owed)))
    shares = kept[drawn].sum(axis=1) / np.maximum(owed[drawn].sum(axis=1), 1)
    low, high = np.quantile(shares, [0.5 * (1 - LEVEL), 0.5 * (1 + LEVEL)])
    return f"{kept.sum() / owed.sum():.0%} ({low:.0%} to {high:.0%}) of {owed.sum()}"


if __name__ == "__main__":
    main()
