"""The product's own functions on numbers that are not known: z3 expressions in, z3 expressions out.

A compiled function is run as Python, with its helpers (`smaller`, `min`, `np.maximum`, ...) replaced by what they mean
in logic. Where it branches on something that is not known, both branches are run and the results joined by that
condition. So the formulas that are proved are those that the shield computes, not copies of them.
"""

import math
import types
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import z3

from rss_shield.shield.params import RSSParams

# what `np.inf` is in an expression: a number of which nothing is known but what a proof assumes
INFINITY = z3.Real("infinity")


def real(number: float) -> z3.ArithRef:
    """A float as the exact number that it is."""
    if math.isinf(number):
        return INFINITY if number > 0.0 else -INFINITY
    return z3.RealVal(Fraction(number))


def driver(name: str) -> RSSParams:
    """Parameters that are not known."""
    return RSSParams(*(z3.Real(f"{name}.{field}") for field in RSSParams._fields))


def symbolic(function: Callable[..., Any], *assumed: z3.BoolRef, **instead: Any) -> Callable[..., Any]:
    """The same function for z3 expressions.

    Args:
      function: of the product.
      assumed: branches that contradict it are left out.
      instead: by name, what is called instead of some of its helpers, where a statement holds whatever these return.
    """
    run = _rebound(function, instead)

    def call(*arguments: Any) -> Any:
        return _every_path(lambda: run(*arguments), [], list(assumed))

    return call


def roots_in(expression: z3.ExprRef) -> list[z3.BoolRef]:
    """What defines the square roots in an expression."""
    found, seen, left = [], set(), [expression]
    while left:
        one = left.pop()
        if one.get_id() in seen:
            continue
        seen.add(one.get_id())
        left += one.children()
        if one.get_id() in _radicands:
            argument = _radicands[one.get_id()][1]
            found += [one >= 0, one * one == argument]
            left.append(argument)
    return found


# ---------------------------------------------------------------- what the helpers of compiled functions mean


def _value(one: Any) -> Any:
    return one if isinstance(one, z3.ExprRef) else real(one)


def _sign_of_infinity(a: Any) -> int:
    return 0 if isinstance(a, z3.ExprRef) or not math.isinf(a) else (1 if a > 0 else -1)


def smaller(a: Any, b: Any) -> Any:
    if _sign_of_infinity(a) or _sign_of_infinity(b):
        return b if _sign_of_infinity(a) == 1 or _sign_of_infinity(b) == -1 else a
    return z3.If(_value(a) < _value(b), _value(a), _value(b))


def larger(a: Any, b: Any) -> Any:
    if _sign_of_infinity(a) or _sign_of_infinity(b):
        return b if _sign_of_infinity(a) == -1 or _sign_of_infinity(b) == 1 else a
    return z3.If(_value(a) > _value(b), _value(a), _value(b))


def choose(condition: Any, this: Any, that: Any) -> Any:
    return z3.If(condition, _value(this), _value(that))


_radicands: dict[int, tuple[z3.ArithRef, z3.ArithRef]] = {}
_roots: dict[str, z3.ArithRef] = {}


def _root(argument: z3.ArithRef) -> z3.ArithRef:
    text = argument.sexpr()
    if text not in _roots:
        _roots[text] = z3.Real(f"root{len(_roots)}")
        _radicands[_roots[text].get_id()] = _roots[text], argument
    return _roots[text]


class _Numpy:
    """As much of numpy as formulas need."""

    inf = math.inf
    maximum, minimum, where = staticmethod(larger), staticmethod(smaller), staticmethod(choose)
    sqrt = staticmethod(_root)


_MEANING = {
    "smaller": smaller,
    "larger": larger,
    "choose": choose,
    "np": _Numpy,
    "min": smaller,
    "max": larger,
    "abs": lambda a: larger(a, -a),
}


def _rebound(function: Any, instead: dict[str, Any]) -> Callable[..., Any]:
    """A function of the product with every helper that it names replaced."""
    source = getattr(function, "py_func", function)
    names = {}
    for name in source.__code__.co_names:
        if name in instead or name in _MEANING:
            names[name] = instead.get(name, _MEANING.get(name))
        elif name in source.__globals__:
            value = source.__globals__[name]
            value = real(value) if isinstance(value, float) else value
            names[name] = _rebound(value, instead) if hasattr(value, "py_func") else value
    return types.FunctionType(source.__code__, names, source.__name__, source.__defaults__, source.__closure__)


# ---------------------------------------------------------------- branches


class _UndecidedError(Exception):
    pass


def _every_path(run: Callable[[], Any], taken: list[bool], assumed: list[z3.BoolRef]) -> Any:
    """Run with the first decisions given; at the next one run both ways, and join."""
    usual, known, at, undecided = z3.BoolRef.__bool__, list(assumed), iter(taken), []

    def decide(condition: z3.BoolRef) -> bool:
        for outcome in (True, False):
            if _impossible([*known, condition if not outcome else z3.Not(condition)]):
                return outcome
        outcome = next(at, None)
        if outcome is None:
            undecided.append(condition)
            raise _UndecidedError
        known.append(condition if outcome else z3.Not(condition))
        return outcome

    z3.BoolRef.__bool__ = decide
    try:
        return run()
    except _UndecidedError:
        pass
    finally:
        z3.BoolRef.__bool__ = usual
    this, that = (_every_path(run, [*taken, outcome], assumed) for outcome in (True, False))
    return _joined(undecided[0], this, that)


def _impossible(conditions: list[z3.BoolRef]) -> bool:
    usual, z3.BoolRef.__bool__ = z3.BoolRef.__bool__, _plain_bool
    try:
        solver = z3.SolverFor("QF_NRA")
        solver.set("timeout", 1000)
        solver.add(*conditions)
        return solver.check() == z3.unsat
    finally:
        z3.BoolRef.__bool__ = usual


_plain_bool = z3.BoolRef.__bool__


def _joined(condition: Any, this: Any, that: Any) -> Any:
    if isinstance(this, tuple):
        joined = [_joined(condition, a, b) for a, b in zip(this, that, strict=True)]
        return type(this)(*joined) if hasattr(this, "_fields") else tuple(joined)
    if isinstance(this, bool | z3.BoolRef):
        return z3.If(condition, this, that)
    return choose(condition, this, that)


# ---------------------------------------------------------------- numbers out of expressions


def at(expression: Any, values: dict[z3.ExprRef, float]) -> float | bool:
    """An expression where every variable has a value: exactly computed, rounded once."""
    if not isinstance(expression, z3.ExprRef):
        return expression
    pairs = [(variable, real(value)) for variable, value in values.items()]
    for root, argument in reversed(_radicands.values()):
        expression = z3.substitute(expression, (root, argument ** z3.Q(1, 2)))
    result = z3.simplify(z3.substitute(expression, *pairs))
    return z3.is_true(result) if z3.is_bool(result) else number(result)


def number(value: Any) -> float:
    """A z3 number as a float; of an irrational one, to twelve digits."""
    if z3.is_algebraic_value(value):
        value = value.approx(12)
    return float(value.as_fraction())
