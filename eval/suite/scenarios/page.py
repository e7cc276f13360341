"""`rss-shield scenarios`: play all of them, say whether they come out as derived, and write the page of results."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rss_shield.eval.files import folder_for, refuse, write_text
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.eval.suite.judge.pictures import draw
from rss_shield.eval.suite.scenarios.catalogue import SCENARIOS
from rss_shield.eval.suite.scenarios.crossing import Crossed, Crossing, play_crossing
from rss_shield.eval.suite.scenarios.crossings import CROSSINGS
from rss_shield.eval.suite.scenarios.r157_page import write_r157
from rss_shield.eval.suite.scenarios.stage import LITERAL, Result, Scenario, play
from rss_shield.eval.suite.scenarios.typology import TYPES
from rss_shield.shield.trace import save
from rss_shield.shield.verdicts import AT_FAULT

EARLIER, LATER = 0.3, 0.11  # danger may be seen so much before and after the time of the formulas [s]


class Outcome(NamedTuple):
    """One scenario, played without the shield, with it, with evasion besides, and by the letter of Def. 10 where that
    is another thing."""

    scenario: Scenario
    off: Result
    on: Result
    evading: Result
    literal: Result | None
    differences: tuple[str, ...]  # from what is derived; none is as it should be


def outcome_of(scenario: Scenario) -> Outcome:
    """Play a scenario and compare it with what its author has worked out."""
    off, on = play(scenario, False), play(scenario, True)
    evading = play(scenario, True, evasion=True)
    literal = play(scenario, True, LITERAL) if scenario.literal is not None else None
    wrong = []
    for name, found, expected in (
        ("verdict without the shield", off.verdict, scenario.off),
        ("verdict with the shield", on.verdict, scenario.on),
        ("verdict with evasion", evading.verdict, scenario.evading),
        ("verdict by the letter", literal.verdict if literal else None, scenario.literal),
        ("axis", off.axis, scenario.axis),
        ("response", off.response, scenario.response),
        ("duties broken with the shield", on.broken + evading.broken, 0),
    ):
        if found != expected:
            wrong.append(f"{name}: {found!r}, derived {expected!r}")
    if not _is_near(off.danger, scenario.danger):
        wrong.append(f"danger: {off.danger} s, derived {scenario.danger} s")
    return Outcome(scenario, off, on, evading, literal, tuple(wrong))


TOUCHED_WITHIN = 0.3  # a contact may be seen so much before or after the time of the formulas [s]


class Met(NamedTuple):
    """One crossing, played without the shield and with it."""

    crossing: Crossing
    off: Crossed
    on: Crossed
    differences: tuple[str, ...]


def met(crossing: Crossing) -> Met:
    """Play a crossing and compare it with what its author has worked out."""
    off, on = play_crossing(crossing, False), play_crossing(crossing, True)
    wrong = []
    for name, found, expected in (
        ("verdict without the shield", off.verdict, crossing.off),
        ("verdict with the shield", on.verdict, crossing.on),
        ("duties broken with the shield", on.broken, 0),
    ):
        if found != expected:
            wrong.append(f"{name}: {found!r}, derived {expected!r}")
    at, derived = off.touched, crossing.touched
    if (at is None) != (derived is None) or (
        at is not None and derived is not None and abs(at - derived) > TOUCHED_WITHIN
    ):
        wrong.append(f"contact: {at} s, derived {derived} s")
    return Met(crossing, off, on, tuple(wrong))


def _is_near(found: float | None, derived: float | None) -> bool:
    if found is None or derived is None:
        return found is derived
    return derived - EARLIER < found <= derived + LATER


def page_of(outcomes: list[Outcome], meetings: Sequence[Met] = ()) -> str:
    """The page of results."""
    as_derived = sum(not one.differences for one in outcomes)
    contacts = [one for one in outcomes if one.off.verdict]
    left = [one for one in outcomes if one.on.verdict]
    touched = [one for one in outcomes if one.evading.verdict]
    new = sum(not one.on.verdict for one in touched)
    at_fault = sum(result.verdict in AT_FAULT for one in outcomes for result in (one.on, one.evading))
    lines = [
        "# Scenarios",
        "",
        "Written by `rss-shield scenarios --write docs/results`. Scripted situations. What is expected of each is "
        "worked out by hand in `eval/suite/scenarios/catalogue.py`, arithmetic included, and compared here with "
        "what comes out.",
        "",
        f"{as_derived} of {len(outcomes)} come out as derived. Without the shield {len(contacts)} end in a contact, "
        f"with it {len(left)}, with evasive effort (`evasion=True`) {len(touched)}, {new} of them new; {at_fault} of "
        f"these "
        "are the ego's fault. Nothing is drawn at random, so there is no "
        "interval: every scenario is played once and is the same each time.",
        "",
        "*Danger*: as derived, then as seen on frames of 0.1 s; up to 0.3 s earlier is as derived, for what "
        "sampling and boxes that may turn cost. *Def. 10*: the verdict with the shield by the letter of Def. 10, "
        "without the duty to brake for whoever has cut in (hole H6), where that is played. Verdicts are from the "
        "ego's view, by the full table in every column.",
        "",
        "| situation | kind | danger [s] | axis | response | off | on | on + evasion | Def. 10 | speed taken off "
        "[m/s] |",
        "|---" * 10 + "|",
    ]
    for one in outcomes:
        s = one.scenario
        danger = (
            "none"
            if s.danger is None
            else f"{s.danger:.2f}, {one.off.danger:.1f}"
            if one.off.danger is not None
            else "?"
        )
        cells = (
            s.name + (" **differs**" if one.differences else ""),
            *(s.kind, danger, one.off.axis or "-", one.off.response or "-"),
            *(result.verdict or "no contact" for result in (one.off, one.on, one.evading)),
            (one.literal.verdict or "no contact") if one.literal else "",
            f"{max(one.on.speed_lost, 0.0):.1f}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    lines += _crossed(meetings)
    wrong = [f"- {one.crossing.name}: {difference}" for one in meetings for difference in one.differences]
    wrong += [f"- {one.scenario.name}: {difference}" for one in outcomes for difference in one.differences]
    if wrong:
        lines += ["", "Not as derived:", "", *wrong]
    lines += _types()
    lines += ["", "## Derivations", ""]
    lines += [f"**{one.scenario.name[0].upper()}{one.scenario.name[1:]}.** {one.scenario.why}\n" for one in outcomes]
    lines += [f"**{one.crossing.name[0].upper()}{one.crossing.name[1:]}.** {one.crossing.why}\n" for one in meetings]
    return "\n".join(lines).rstrip() + "\n"


def _crossed(meetings: Sequence[Met]) -> list[str]:
    """The table of situations where roads cross."""
    if not meetings:
        return []
    lines = [
        "",
        "## Where roads cross",
        "",
        "The ego is kept safe by plans there, and evasive effort is for common roads. *Touched*: without the shield, "
        "as "
        f"derived, then as seen on frames of 1/15 s; {TOUCHED_WITHIN} s to either side is as derived. *Slowest*: the "
        "ego's least speed with the shield.",
        "",
        "| situation | kind | touched [s] | off | on | slowest [m/s] |",
        "|---" * 6 + "|",
    ]
    for one in meetings:
        c = one.crossing
        touched = "never" if c.touched is None else f"{c.touched:.2f}, {one.off.touched or float('nan'):.2f}"
        cells = (
            c.name + (" **differs**" if one.differences else ""),
            *(c.kind, touched, one.off.verdict or "no contact", one.on.verdict or "no contact", f"{one.on.lowest:.1f}"),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _types() -> list[str]:
    """NHTSA's pre-crash types and what stands for each."""
    expressed = sum(bool(one.scenarios) for one in TYPES)
    lines = [
        "",
        "## NHTSA's pre-crash types",
        "",
        f"{expressed} of the {len(TYPES)} types (Najm, Smith, Yanagisawa, DOT HS 810 767, 2007) are among the "
        f"situations.",
        "",
        "| | type | situations | what is missing |",
        "|---|---|---|---|",
    ]
    lines += [f"| {one.number} | {one.name} | {'; '.join(one.scenarios)} | {one.reason} |" for one in TYPES]
    return lines


def run(arguments: list[str] | None = None) -> None:
    """Play what the command line names."""
    parser = argparse.ArgumentParser(prog="rss-shield scenarios", description="Scripted situations, derived by hand.")
    parser.add_argument("names", nargs="*", help="those whose names contain one of these; none = all")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write scenarios.md there; of all scenarios only")
    parser.add_argument("--traces", type=Path, metavar="FOLDER", help="write trace and picture of each run there")
    parser.add_argument("--r157", type=Path, metavar="FOLDER", help="write only r157.md there: UN R157's situations")
    options = parser.parse_args(arguments)
    if options.r157 is not None:
        try:
            write_r157(folder_for(options.r157, "--r157"))
        except ValueError as error:
            refuse("rss-shield scenarios", error)
        return
    chosen = [s for s in SCENARIOS if _is_asked(s.name, options.names)]
    crossings = [c for c in CROSSINGS if _is_asked(c.name, options.names)]
    count = len(SCENARIOS) + len(CROSSINGS)
    if not chosen and not crossings:
        refuse("rss-shield scenarios", f"no name contains {', '.join(options.names)}; there are {count} scenarios")
    if options.write is not None and len(chosen) + len(crossings) < count:
        refuse("rss-shield scenarios", "--write is for all scenarios: expected no names beside it")
    try:
        for option in ("write", "traces"):
            if getattr(options, option) is not None:
                folder_for(getattr(options, option), f"--{option}")
    except ValueError as error:
        refuse("rss-shield scenarios", error)
    outcomes = []
    for scenario in chosen:
        outcome = outcome_of(scenario)
        outcomes.append(outcome)
        said = "as derived" if not outcome.differences else "; ".join(outcome.differences)
        print(f"{scenario.name}: off {outcome.off.verdict or '-'}, on {outcome.on.verdict or '-'}: {said}")
        if options.traces is not None:
            _keep(outcome, options.traces)
    meetings = []
    for crossing in crossings:
        one = met(crossing)
        meetings.append(one)
        said = "as derived" if not one.differences else "; ".join(one.differences)
        print(f"{crossing.name}: off {one.off.verdict or '-'}, on {one.on.verdict or '-'}: {said}")
        if options.traces is not None:
            for mode, result in (("off", one.off), ("on", one.on)):
                save(result.trace, options.traces / f"{_stem(crossing.name)}_{mode}.npz")
    if options.write is not None:
        write_text(options.write / "scenarios.md", page_of(outcomes, meetings))
    if any(one.differences for one in outcomes) or any(one.differences for one in meetings):
        sys.exit(1)


def _is_asked(name: str, parts: list[str]) -> bool:
    return not parts or any(part in name for part in parts)


def _stem(name: str) -> str:
    return "_".join("".join(c if c.isalnum() else " " for c in name).split())


def _keep(outcome: Outcome, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    stem = _stem(outcome.scenario.name)
    for mode, result in (
        ("off", outcome.off),
        ("on", outcome.on),
        ("evading", outcome.evading),
        ("literal", outcome.literal),
    ):
        if result is None:
            continue
        save(result.trace, folder / f"{stem}_{mode}.npz")
        names = [car.name for car in outcome.scenario.cars]
        pair = (0, names.index(outcome.scenario.partner))
        draw(judge_trace(result.trace), folder / f"{stem}_{mode}.png", pair)
