"""The page of results about UN R157's situations, with its picture."""

from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from rss_shield.eval.files import write_text
from rss_shield.eval.pages import markdown, spaced
from rss_shield.eval.suite.scenarios.r157 import (
    DRIVERS,
    TABLES,
    Cases,
    cut_ins,
    cut_outs,
    decelerations,
    drive,
    drive_shield,
)

_KINDS: tuple[tuple[str, Callable[[], Cases]], ...] = (
    ("cut-in", cut_ins),
    ("deceleration", decelerations),
    ("cut-out", cut_outs),
)
_SHOWN = ((60, 20), (130, 70))  # km/h of ego and other in the picture
_COLOURS = ("0.8", "tab:orange", "tab:blue", "tab:green", "tab:olive", "tab:red", "tab:purple")


def contacts_of(cases: Cases) -> dict[str, np.ndarray]:
    """Who touches the other, by driver: `[C]` each."""
    return {name: drive(cases, name) for name in DRIVERS} | {
        f"shield, {name}{' + evasion' * evasion}": drive_shield(cases, preset, evasion)
        for name, preset in TABLES.items()
        for evasion in ((False, True) if name == "careful" else (False,))
    }


def write_r157(folder: Path) -> None:
    """Write r157.md and r157.png."""
    kinds = {name: made() for name, made in _KINDS}
    found = {name: contacts_of(cases) for name, cases in kinds.items()}
    folder.mkdir(parents=True, exist_ok=True)
    _draw(kinds["cut-in"], found["cut-in"], folder / "r157.png")
    write_text(folder / "r157.md", page_of(found))


def page_of(found: dict[str, dict[str, np.ndarray]]) -> str:
    """The page: contacts by driver and kind of situation, and who avoids what the other does not."""
    sections = [
        "# UN R157",
        "Written by `rss-shield scenarios --r157 docs/results`. Cut-ins, decelerations and cut-outs as UN Regulation "
        "No. 157 describes them, on a grid of speeds, distances, lateral speeds and decelerations "
        "(`eval/suite/scenarios/r157.py`). Everybody only brakes, nothing is drawn at random: shares are of the grid "
        "and have no interval.",
        "The *careful driver* is the regulation's careful and competent driver, the *fuzzy safety model* that of "
        "Mattas et al. (2020), both from their published formulas (`drivers_of_r157.py`). They brake with up to "
        "0.774 g "
        "(7.6 m/s²) after 0.75 s. The shield is on an ego that would go on at its speed: with the table *simulator* "
        "(reacts in 0.15 s, relies on 5 m/s²), *slides* (1 s, 4 m/s²), and *careful*: as slides, but with the careful "
        "driver's delay and braking. *+ evasion*: with evasive effort along the lane. A shield that begins nearer "
        "than its table asks brakes at once.",
    ]
    for kind, by in found.items():
        count = len(by["careful driver"])
        rows: list[list[str]] = [
            ["driver", "contacts", "avoided, unlike the careful driver", "not avoided, unlike the careful driver"]
        ]
        careful = by["careful driver"]
        for name, hit in by.items():
            both = "-" if name == "careful driver" else spaced(int((careful & ~hit).sum()))
            worse = "-" if name == "careful driver" else spaced(int((hit & ~careful).sum()))
            rows.append([name, f"{spaced(int(hit.sum()))} ({hit.mean():.1%})", both, worse])
        sections += [f"## {kind[0].upper()}{kind[1:]}: {spaced(count)} cases", markdown(rows)]
    cut = found["cut-in"]
    passes = ~cut["nobody brakes"]
    shield = np.all([cut[name] for name in cut if name.startswith("shield")], axis=0)
    evades = cut["shield, careful + evasion"]
    early = cut["shield, careful"] & ~cut["careful driver"]
    sections += [
        f"Of the {spaced(int(early.sum()))} cut-ins that the careful driver avoids and a shield with its braking does "
        f"not, {spaced(int((early & passes).sum()))} are avoided by doing nothing: the ego would have been past before "
        "the other came over, and a shield that brakes for it is beside it then. Whoever comes over is to blame. With "
        "[evasive effort](../adversaries.md#evasive-effort), which may speed up but not go against the duty to brake, "
        f"{spaced(int((early & ~evades).sum()))} of these are avoided. {spaced(int((shield & ~passes).sum()))} "
        f"cut-ins no shield avoids.",
        "![Which cut-ins end in a contact](r157.png)",
    ]
    return "\n\n".join(sections) + "\n"


def _draw(cases: Cases, by: dict[str, np.ndarray], path: Path) -> None:
    """Where in the plane of distance and lateral speed each driver touches the other."""
    figure, axes = plt.subplots(len(_SHOWN), len(by), figsize=(13, 5), sharex="row", sharey=True, layout="constrained")
    for row, (v, u) in enumerate(_SHOWN):
        chosen = (np.round(cases.v * 3.6) == v) & (np.round(cases.v_other * 3.6) == u)
        for ax, (name, hit), colour in zip(axes[row], by.items(), _COLOURS, strict=True):
            ax.scatter(cases.gap[chosen], cases.lateral[chosen], s=3, c="0.93")
            touching = chosen & hit
            ax.scatter(cases.gap[touching], cases.lateral[touching], s=9, c=colour)
            ax.set_title(f"{name}\n{v} behind {u} km/h", fontsize=8)
        axes[row][0].set_ylabel("lateral speed [m/s]")
    figure.supxlabel("distance when it comes over [m]; coloured: contact")
    figure.savefig(path, dpi=110)
    plt.close(figure)
