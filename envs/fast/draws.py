"""numpy's PCG64 generator and the distributions that the environments draw from, bit for bit.

A generator is a record with the fields of `GENERATOR`; each environment owns one.
"""

import numpy as np
from numba.np.random._constants import (
    fi_double,
    ki_double,
    wi_double,
    ziggurat_nor_inv_r,
    ziggurat_nor_r,
)

from rss_shield.shield._numba.compiled import part

GENERATOR = [
    ("state_high", "u8"),
    ("state_low", "u8"),
    ("increment_high", "u8"),
    ("increment_low", "u8"),
    ("spare", "u4"),  # second half of the last 64 bits, if `has_spare`
    ("has_spare", "u4"),
]

_MULTIPLIER_HIGH = np.uint64(2549297995355413924)
_MULTIPLIER_LOW = np.uint64(4865540595714422341)
_LOW_HALF = np.uint64(0xFFFFFFFF)
_SHIFT_32 = np.uint64(32)
_TO_UNIT = 1.0 / 9007199254740992.0


def load_generator(record, bit_generator: np.random.PCG64) -> None:
    """Copy the state of a numpy bit generator into a record."""
    state = bit_generator.state
    low = (1 << 64) - 1
    record["state_high"], record["state_low"] = state["state"]["state"] >> 64, state["state"]["state"] & low
    record["increment_high"], record["increment_low"] = state["state"]["inc"] >> 64, state["state"]["inc"] & low
    record["has_spare"], record["spare"] = state["has_uint32"], state["uinteger"]


def generator_state(record) -> dict:
    """The state of a record as `np.random.PCG64.state` expects it."""
    return {
        "bit_generator": "PCG64",
        "state": {
            "state": (int(record["state_high"]) << 64) | int(record["state_low"]),
            "inc": (int(record["increment_high"]) << 64) | int(record["increment_low"]),
        },
        "has_uint32": int(record["has_spare"]),
        "uinteger": int(record["spare"]),
    }


@part
def _high_product(a, b):
    """Upper 64 bits of the product of two 64-bit numbers."""
    a_low, a_high = a & _LOW_HALF, a >> _SHIFT_32
    b_low, b_high = b & _LOW_HALF, b >> _SHIFT_32
    middle = a_high * b_low + (a_low * b_low >> _SHIFT_32)
    cross = (middle & _LOW_HALF) + a_low * b_high
    return a_high * b_high + (middle >> _SHIFT_32) + (cross >> _SHIFT_32)


@part
def next_64(rng):
    """Next 64 random bits."""
    high, low = rng.state_high, rng.state_low
    product_low = low * _MULTIPLIER_LOW
    product_high = _high_product(low, _MULTIPLIER_LOW) + high * _MULTIPLIER_LOW + low * _MULTIPLIER_HIGH
    low = product_low + rng.increment_low
    high = product_high + rng.increment_high + np.uint64(low < product_low)
    rng.state_high, rng.state_low = high, low
    turn = high >> np.uint64(58)
    bits = high ^ low
    return (bits >> turn) | (bits << ((np.uint64(64) - turn) & np.uint64(63)))


@part
def next_32(rng):
    """Next 32 random bits; half of every 64 is kept for the next call."""
    if rng.has_spare != 0:
        rng.has_spare = np.uint32(0)
        return np.uint64(rng.spare)
    bits = next_64(rng)
    rng.has_spare = np.uint32(1)
    rng.spare = np.uint32(bits >> _SHIFT_32)
    return bits & _LOW_HALF


@part
def random(rng):
    """`Generator.random()`: uniform in [0, 1)."""
    return np.float64(next_64(rng) >> np.uint64(11)) * _TO_UNIT


@part
def uniform(rng, low, high):
    """`Generator.uniform(low, high)`."""
    return low + (high - low) * random(rng)


@part
def integers(rng, n):
    """`Generator.integers(n)`, also `choice` of n things. Draws nothing for n = 1."""
    if n == 1:
        return 0
    count = np.uint64(n)
    product = next_32(rng) * count
    if product & _LOW_HALF < count:
        threshold = (_LOW_HALF - (count - np.uint64(1))) % count
        while product & _LOW_HALF < threshold:
            product = next_32(rng) * count
    return np.int64(product >> _SHIFT_32)


@part
def interval(rng, most):
    """A whole number from 0 to `most` as `Generator.shuffle` draws it: masked bits until they fit."""
    if most == 0:
        return 0
    mask = np.uint64(most)
    for shift in (1, 2, 4, 8, 16):
        mask |= mask >> np.uint64(shift)
    drawn = next_32(rng) & mask
    while drawn > np.uint64(most):
        drawn = next_32(rng) & mask
    return np.int64(drawn)


@part
def two_of(rng, n):
    """`Generator.choice(n, 2, replace=False)` of up to 10 000 things: Floyd's algorithm, then a shuffle."""
    first, second = integers(rng, n - 1), integers(rng, n)
    if second == first:
        second = n - 1
    if integers(rng, 2) == 0:
        first, second = second, first
    return first, second


@part
def normal(rng):
    """`Generator.normal()`: standard normal, by the ziggurat."""
    while True:
        bits = next_64(rng)
        layer = bits & np.uint64(0xFF)
        bits >>= np.uint64(8)
        negative = bits & np.uint64(1)
        mantissa = (bits >> np.uint64(1)) & np.uint64(0x000FFFFFFFFFFFFF)
        x = np.float64(mantissa) * wi_double[layer]
        if negative:
            x = -x
        if mantissa < ki_double[layer]:
            return x
        if layer == 0:
            while True:
                far = -ziggurat_nor_inv_r * np.log1p(-random(rng))
                density = -np.log1p(-random(rng))
                if density + density > far * far:
                    left = (mantissa >> np.uint64(8)) & np.uint64(1)
                    return -(ziggurat_nor_r + far) if left else ziggurat_nor_r + far
        else:
            upper, lower = fi_double[layer - np.uint64(1)], fi_double[layer]
            if (upper - lower) * random(rng) + lower < np.exp(-0.5 * x * x):
                return x
