"""The page of results of a campaign, from the files that it has left."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rss_shield.eval.files import write_text
from rss_shield.eval.provenance import provenance
from rss_shield.eval.rollout import NO_CONTACT
from rss_shield.eval.stats import clopper_pearson
from rss_shield.shield.verdicts import AT_FAULT, VERDICTS

Result = dict[str, Any]  # what a block has left
_KINDS: tuple[tuple[str, Callable[[dict[str, Any]], str]], ...] = (
    ("environment", lambda block: f"`{block['env_id']}`"),
    ("traffic", lambda block: block["traffic"]),
    ("policy", lambda block: block["policy"]),
    ("table", lambda block: block["params"] or "the environment's own"),
)
_COLUMNS = (
    *("episodes", "hours", "ego at fault", "nobody's", "95 % below", "others' contacts", "inherited"),
    *("duties broken", "overridden", "worst margin [m]", "smallest TTC [s]"),
)


def found_in(folder: Path) -> list[Result]:
    """What the blocks of a campaign have left, in the order of their names."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def page_of(results: list[Result], command: str) -> str:
    """The page.

    Args:
      results: `found_in`.
      command: that writes it.

    Raises:
      ValueError: there is nothing, or nothing with a shield.
    """
    shielded = [one for one in results if one["block"]["shield"] == "override"]
    if not shielded:
        raise ValueError("no block of a campaign with the shield: expected at least one")
    total = _sum(shielded)
    lines = [
        "# Stress",
        "",
        f"Written by `{command}` from the files of the campaign. Episodes in the engine, each with a seed of its own "
        "per kind; the ego's policy and everybody else try to find a fault of the shield: hostile drivers with one "
        "vice each (`envs/roads/hostile.py`; *bounded* ones keep to the limits of the table but owe nobody anything), "
        "policies that steer without sense or always come as near to danger as one decision can "
        "(`eval/suite/assault.py`).",
        "",
        f"**{_number(total['episodes'])} episodes, {_number(round(total['seconds'] / 3600))} hours of driving: "
        f"{_at_fault(total)} with the ego at fault, {total['verdicts']['none']} contacts that are nobody's fault.** "
        f"Upper end of the exact two-sided 95 % interval of none in so many: {_upper(0, total['episodes'])}.",
        "",
        f"Others' contacts: {_number(total['verdicts']['other'])}; danger from the start, nobody's doing: "
        f"{_number(total['verdicts']['inherited'])}. The ego broke {total['broken_duties']} duties in "
        f"{_number(total['dangerous_pairs'])} pair-frames in danger.",
    ]
    lines += _judged(results)
    for name, kind in _KINDS:
        lines += ["", f"## By {name}", "", *_table(shielded, name, kind)]
    watched = [one for one in results if one["block"]["shield"] == "monitor"]
    if watched:
        lines += ["", "## Without the shield", "", *_beside(shielded, watched)]
    lines += [
        "",
        "*Worst margin*: smallest over all frames of the larger of the margins along and across the lane, of the pair",
        "nearest to danger, contacts that others cause included; where roads cross plans have none. *Overridden*:",
        "share of the time in which a duty changed the command.",
        "",
    ]
    foot = provenance(results)
    return "\n".join([*lines, foot, ""] if foot else lines)


def write_page(folder: Path, out: Path, command: str) -> None:
    """Write the page of the campaign in `folder` to `out`/stress.md."""
    write_text(out / "stress.md", page_of(found_in(folder), command))


def _sum(results: list[Result]) -> Result:
    total: Result = {name: sum(one[name] for one in results) for name in _ADDED}
    total["verdicts"] = {name: sum(one["verdicts"][name] for one in results) for name in (*VERDICTS, NO_CONTACT)}
    for name in ("min_ttc", "worst_margin"):
        total[name] = min(float(one[name]) for one in results)  # JSON has texts for what is infinite
    return total


_ADDED = ("episodes", "seconds", "metres", "overridden", "broken_duties", "dangerous_pairs")


def _at_fault(total: Result) -> int:
    return sum(total["verdicts"][name] for name in AT_FAULT)


def _upper(k: int, n: int) -> str:
    return f"{clopper_pearson(k, n).high:.1e}"


def _number(n: int) -> str:
    return f"{n:,}".replace(",", " ")


def _table(results: list[Result], name: str, kind: Callable[[dict[str, Any]], str]) -> list[str]:
    groups: dict[str, list[Result]] = {}
    for one in results:
        groups.setdefault(kind(one["block"]), []).append(one)
    lines = ["| " + " | ".join((name, *_COLUMNS)) + " |", "|---" * (1 + len(_COLUMNS)) + "|"]
    for key, group in sorted(groups.items()):
        total = _sum(group)
        said, n = total["verdicts"], total["episodes"]
        margin = f"{total['worst_margin']:.2f}" if abs(total["worst_margin"]) < 1e6 else "-"
        row = (
            *(key, _number(n), f"{total['seconds'] / 3600:.0f}", _at_fault(total), said["none"]),
            *(_upper(_at_fault(total) + said["none"], n), f"{_number(said['other'])} ({said['other'] / n:.1%})"),
            *(_number(said["inherited"]), total["broken_duties"], f"{total['overridden'] / total['seconds']:.0%}"),
            *(margin, f"{total['min_ttc']:.2f}"),
        )
        lines.append("| " + " | ".join(map(str, row)) + " |")
    return lines


def _judged(results: list[Result]) -> list[str]:
    """What the judge says of contacts that it has seen, by kind of road."""
    lines = []
    for roads, crossing in (("common roads", False), ("roads that cross", True)):
        some = [one for one in results if "judged" in one and _crosses(one["block"]["env_id"]) == crossing]
        n = sum(one["judged"]["contacts"] for one in some)
        k = sum(len(one["judged"]["different"]) for one in some)
        if some:
            lines.append(
                f"On {roads} `rss-shield judge` looked at {_number(n)} contacts of "
                f"{_number(sum(one['episodes'] for one in some))} episodes from the outside: the same verdict as the "
                f"shield's in {_number(n - k)}, another in {k} (95 % below {_upper(k, n)})."
            )
    return ["", "## The judge beside the shield", "", *lines] if lines else []


def _crosses(env_id: str) -> bool:
    return env_id.startswith(("roundabout", "intersection"))


def _beside(shielded: list[Result], watched: list[Result]) -> list[str]:
    """Kinds that were played with the shield and without: who is at fault, and the speeds."""
    lines = [
        "The same kinds of episodes with a shield that only watches. *Lost*: what a kilometre takes longer with it.",
        "",
        "| environment | traffic | episodes without | ego at fault without | with | m/s without | with | lost [s/km] |",
        "|---" * 8 + "|",
    ]
    for kind in sorted({_place(one) for one in watched}):
        on, off = ([one for one in some if _place(one) == kind] for some in (shielded, watched))
        if not on:
            continue
        mine, bare = _sum(on), _sum(off)
        slow, fast = (total["metres"] / total["seconds"] for total in (mine, bare))
        row = (
            *(f"`{kind[0]}`", kind[1], _number(bare["episodes"]), f"{_at_fault(bare) / bare['episodes']:.0%}"),
            *(_at_fault(mine), f"{fast:.1f}", f"{slow:.1f}", f"{1000 / slow - 1000 / fast:.1f}"),
        )
        lines.append("| " + " | ".join(map(str, row)) + " |")
    return lines


def _place(one: Result) -> tuple[str, str]:
    return one["block"]["env_id"], one["block"]["traffic"]
