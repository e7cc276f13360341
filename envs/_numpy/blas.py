"""How numpy rounds dot products of two plane vectors here.

They go to its linear algebra library, which has a routine for each kind of processor: some round both products
and their sum, others fuse a product with the sum. highway-env gets whichever it is, so the engine has to ask.
"""

from fractions import Fraction

import numpy as np

PLAIN, FUSED_SECOND, FUSED_FIRST = "plain", "second product fused", "first product fused"
_TRIALS = 64  # vectors to ask with; the three ways differ in every fourth


def find_rounding() -> str:
    """PLAIN, FUSED_SECOND or FUSED_FIRST, as `np.dot` has it; PLAIN where it is none of them."""
    agree = {PLAIN, FUSED_SECOND, FUSED_FIRST}
    for a, b in np.random.default_rng(0).normal(size=(_TRIALS, 2, 2)):
        first, second = a * b
        ways = {
            PLAIN: first + second,
            FUSED_SECOND: float(Fraction(a[1]) * Fraction(b[1]) + Fraction(first)),
            FUSED_FIRST: float(Fraction(a[0]) * Fraction(b[0]) + Fraction(second)),
        }
        agree &= {way for way, value in ways.items() if value == np.dot(a, b)}
    return min(agree, default=PLAIN)


def three_are_known(rounding: str) -> bool:
    """Does `np.dot` go on with a third product as with the second?"""
    known = rounding != FUSED_FIRST
    for a, b in np.random.default_rng(1).normal(size=(_TRIALS, 2, 3)):
        total = float(a[0] * b[0])
        for x, y in zip(a[1:], b[1:], strict=True):
            total = total + float(x * y) if rounding == PLAIN else float(Fraction(x) * Fraction(y) + Fraction(total))
        known &= total == np.dot(a, b)
    return bool(known)


ROUNDING = find_rounding()
THREE_ARE_KNOWN = three_are_known(ROUNDING)
