"""Whether a statement about real numbers holds for all of them: z3, after every `if` in it has been decided by hand.

z3's decision procedure for polynomials (nlsat) is complete, but slow on formulas full of case distinctions and quick on
bare polynomials. So a statement is split into its cases first, impossible ones left out, and each case proved alone.
"""

import time
from collections.abc import Iterator
from typing import NamedTuple

import z3
from symbolic import roots_in

PROVED, OPEN, REFUTED = "proved", "open", "refuted"
_GLANCE = 2.0  # time to find out that a case is impossible [s]; one that stays open is proved like the others


class Answer(NamedTuple):
    """What came of a statement."""

    status: str  # PROVED: holds for all real numbers; OPEN: not settled in time; REFUTED: does not hold
    cases: int
    seconds: float  # of the processor
    model: z3.ModelRef | None = None  # numbers for which it does not hold


def prove(given: list[z3.BoolRef], goal: z3.BoolRef, limit: float = 60.0) -> Answer:
    """Do the assumptions imply the goal?

    Args:
      given, goal: about real variables.
      limit: for each case [s].
    """
    began, cases, unsettled = time.process_time(), 0, False
    against = [*given, z3.Not(goal)]
    against += roots_in(z3.And(*against))
    for case in _cases(against):
        cases += 1
        found, model = _solve(case, limit)
        if found == z3.sat:
            return Answer(REFUTED, cases, time.process_time() - began, model)
        unsettled |= found == z3.unknown
    return Answer(OPEN if unsettled else PROVED, cases, time.process_time() - began)


def find(conditions: list[z3.BoolRef], limit: float = 60.0) -> z3.ModelRef | None:
    """Numbers for which all conditions hold, None if none are found."""
    conditions = [*conditions, *roots_in(z3.And(*conditions))]
    for case in _cases(conditions):
        found, model = _solve(case, limit)
        if found == z3.sat:
            return model
    return None


def _solve(conditions: list[z3.BoolRef], limit: float) -> tuple[z3.CheckSatResult, z3.ModelRef | None]:
    solver = z3.SolverFor("QF_NRA")
    solver.set("timeout", int(1000 * limit))
    solver.add(*conditions)
    found = solver.check()
    return found, solver.model() if found == z3.sat else None


def _cases(conditions: list[z3.BoolRef], decided: tuple[z3.BoolRef, ...] = ()) -> Iterator[list[z3.BoolRef]]:
    """Conjunctions without `if` that together say the same; impossible ones are dropped as soon as they show."""
    whole = z3.And(*conditions)
    choice = _first_choice(whole)
    if choice is None:
        yield [*decided, whole]
        return
    condition, this, that = choice.children()
    for known, chosen in ((condition, this), (z3.Not(condition), that)):
        rest = [z3.substitute(one, (choice, chosen)) for one in conditions]
        if not _impossible([*decided, known, *rest]):
            yield from _cases(rest, (*decided, known))


def _impossible(conditions: list[z3.BoolRef]) -> bool:
    """Is there no way, whatever the undecided terms are?"""
    unknown: dict[int, tuple[z3.ExprRef, z3.ExprRef]] = {}
    for one in conditions:
        for choice in _choices(one):
            unknown.setdefault(choice.get_id(), (choice, z3.FreshConst(choice.sort())))
    return _solve([z3.substitute(one, *unknown.values()) for one in conditions], _GLANCE)[0] == z3.unsat


def _choices(expression: z3.ExprRef) -> Iterator[z3.ExprRef]:
    """Every `if` in an expression that is not inside another one."""
    left, seen = [expression], set()
    while left:
        one = left.pop()
        if one.get_id() in seen:
            continue
        seen.add(one.get_id())
        if z3.is_app_of(one, z3.Z3_OP_ITE):
            yield one
        else:
            left += reversed(one.children())


def _first_choice(expression: z3.ExprRef) -> z3.ExprRef | None:
    """The outermost `if` that can be decided: its condition has none."""
    for choice in _choices(expression):
        inside = _first_choice(choice.arg(0))
        return choice if inside is None else inside
    return None
