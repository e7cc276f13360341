"""The arithmetic of numpy and Python to the last bit, for compiled code."""

from fractions import Fraction
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from rss_shield.envs._numpy.blas import FUSED_FIRST, FUSED_SECOND, ROUNDING
from rss_shield.shield._numba.compiled import INTERPRETED, inner

_intrinsic: Any = intrinsic


@_intrinsic
def _fma(typing_context, a, b, c):
    """a * b + c, rounded once."""
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return signature, generate


def _fma_of_fractions(a, b, c):
    return float(Fraction(a) * Fraction(b) + Fraction(c))


_fused: Any = _fma_of_fractions if INTERPRETED else _fma


@inner
def dot(ax, ay, bx, by):
    """`np.dot` of two plane vectors, rounded as it is here: another rounding would differ in one of four."""
    if ROUNDING == FUSED_SECOND:
        return _fused(ay, by, ax * bx)
    if ROUNDING == FUSED_FIRST:
        return _fused(ax, bx, ay * by)
    return ax * bx + ay * by


@inner
def dot_3(ax, ay, az, bx, by, bz):
    """`np.dot` of two vectors of three, where `blas.THREE_ARE_KNOWN`."""
    if ROUNDING == FUSED_SECOND:
        return _fma(az, bz, _fma(ay, by, ax * bx))
    return ax * bx + ay * by + az * bz


@inner
def norm(x, y):
    """`np.linalg.norm` of a plane vector."""
    return np.sqrt(dot(x, y, x, y))


@inner
def clip(x, low, high):
    """`np.clip` of a float."""
    return min(max(x, low), high)


@inner
def wrap_to_pi(angle):
    """`highway_env.utils.wrap_to_pi`, without the division where the angle is at most one turn out of range [rad].

    Then the remainder is what one addition gives: to subtract 2 pi from less than twice that is exact.
    """
    shifted = angle + np.pi
    if shifted >= 2 * np.pi:
        shifted = shifted - 2 * np.pi if shifted < 4 * np.pi else shifted % (2 * np.pi)
    elif shifted < 0.0:
        shifted = shifted + 2 * np.pi if shifted > -2 * np.pi else shifted % (2 * np.pi)
    return shifted - np.pi


@inner
def not_zero(x):
    """`highway_env.utils.not_zero`: at least 0.01 away from zero."""
    if abs(x) > 1e-2:
        return x
    return 1e-2 if x >= 0.0 else -1e-2


@inner
def lmap(v, x0, x1, y0, y1):
    """`highway_env.utils.lmap`: linear map of [x0, x1] to [y0, y1]."""
    return y0 + (v - x0) * (y1 - y0) / (x1 - x0)
