"""Prove every invariant, find a contact for every condition dropped, and write both down: `make prove`."""

import argparse
import importlib.metadata
import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS))

from counterexamples import Dropped, all_dropped  # noqa: E402
from invariants import INVARIANTS, OPEN, Invariant  # noqa: E402
from prover import PROVED, prove  # noqa: E402

from rss_shield.eval.files import write_text  # noqa: E402
from rss_shield.eval.pages import markdown  # noqa: E402

PAGE = TESTS.parent / "docs" / "results" / "proofs.md"
SUMMARY = ("invariant", "says", "uses", "outcome", "statements", "CPU seconds")
_LIMIT = 60.0  # for each case of a statement [s]


def proved(invariant: Invariant, limit: float) -> list[list[str]]:
    """A row per statement: invariant, part, outcome, seconds."""
    rows = []
    for statement in invariant.statements():
        answer = prove(statement.given, statement.goal, limit)
        if answer.model is not None:
            print(f"{invariant.name}, {statement.part}, does not hold for\n{answer.model}")
        rows.append([invariant.name, statement.part, answer.status, f"{answer.seconds:.1f}"])
        print(" | ".join(rows[-1]), flush=True)
    return rows


def replayed(dropped: Dropped) -> list[str]:
    """A row: condition, what is dropped, start found, smallest gaps without it and with it."""
    began = time.process_time()
    pair = dropped.found()
    seconds = f"{time.process_time() - began:.1f}"
    if pair is None:
        row = [dropped.condition, dropped.what, "none found", "", "", seconds]
    else:
        start = f"{pair.gap:.3f} m, {pair.v_rear:g} and {pair.v_front:g} m/s"
        gaps = [f"{dropped.replay(pair, without):.3f} m" for without in (True, False)]
        row = [dropped.condition, dropped.what, start, *gaps, seconds]
    print(" | ".join(row), flush=True)
    return row


def summed_up(invariant: Invariant, rows: list[list[str]]) -> list[str]:
    """One row per invariant."""
    mine = [row for row in rows if row[0] == invariant.name]
    outcome = PROVED if all(row[2] == PROVED for row in mine) else "open"
    seconds = f"{sum(float(row[3]) for row in mine):.1f}"
    return [invariant.name, invariant.says, invariant.conditions, outcome, str(len(mine)), seconds]


_ABOUT = """\
Written by `make prove` with z3 {version}. The sampled proof of the [guarantee](../guarantee.md) as inductive
invariants over one frame of explicit Euler, for *all* real speeds, gaps, frame lengths and parameters that
`RSSParams.validated` takes, under the conditions C1 to C8 of the
[register](../holes.md#conditions-of-the-sampled-proof-c). The formulas are the product's own functions, run on
unknowns (`tests/proofs/symbolic.py`); `test_encoding.py` compares them with the compiled ones on random numbers.
Every invariant is proved to hold at a safe sample (*start*), to be kept by every *frame* in which duties are kept,
and to keep the pair *apart*.

{settled} of {all} statements are proved."""

_CONTACTS = """\
Without a condition z3 finds a start that the shield would call safe, and highway-env's bicycle drives from there into
a contact: a negative gap. With the condition the same drivers stay apart (where the shield would not have called that
start safe, from one that it does). For C8, *without* is minus the true gap: a contact is reported that never comes
about."""


def page(rows: list[list[str]], contacts: list[list[str]]) -> str:
    """The page of results."""
    names = [summed_up(invariant, rows) for invariant in INVARIANTS]
    settled = sum(row[2] == PROVED for row in rows)
    heading = ("condition", "without it", "start", "smallest gap without", "smallest gap with", "seconds")
    parts = [
        "# Machine-checked induction",
        _ABOUT.format(version=importlib.metadata.version("z3-solver"), settled=settled, all=len(rows)),
        markdown([SUMMARY, *names]),
        "## Each condition is needed",
        _CONTACTS,
        markdown([heading, *contacts]),
        "## What is not proved by a machine",
        markdown([("what", "why"), *OPEN]),
        "## Statement by statement",
        markdown([("invariant", "statement", "outcome", "seconds"), *rows]),
    ]
    return "\n\n".join(parts) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="invariants whose name has this")
    parser.add_argument("--limit", type=float, default=_LIMIT, help="for each case of a statement [s]")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.relative_to(TESTS.parent)}")
    options = parser.parse_args()
    chosen = [invariant for invariant in INVARIANTS if options.only in invariant.name]
    rows = [row for invariant in chosen for row in proved(invariant, options.limit)]
    contacts = [] if options.only else [replayed(dropped) for dropped in all_dropped()]
    print()
    print(markdown([SUMMARY, *(summed_up(invariant, rows) for invariant in chosen)]))
    if options.write and not options.only:
        write_text(PAGE, page(rows, contacts))
    return 0 if all(row[2] == PROVED for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
