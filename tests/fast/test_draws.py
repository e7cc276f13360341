"""Random numbers are numpy's, bit for bit."""

import numpy as np
import pytest
from numba import njit

from rss_shield.envs.fast.draws import (
    GENERATOR,
    generator_state,
    integers,
    interval,
    load_generator,
    normal,
    random,
    two_of,
    uniform,
)


@njit
def _draw(generators, kinds, out):
    rng = generators[0]
    for i in range(len(kinds)):
        if kinds[i] == 0:
            out[i] = uniform(rng, 0.9, 1.1)
        elif kinds[i] == 1:
            out[i] = integers(rng, 3)
        elif kinds[i] == 2:
            out[i] = normal(rng)
        elif kinds[i] == 3:
            out[i] = integers(rng, 1)
        elif kinds[i] == 4:
            out[i] = random(rng)
        elif kinds[i] == 5:
            first, second = two_of(rng, 4)
            out[i] = 10 * first + second
        else:
            out[i] = integers(rng, 3_000_000_000)


@pytest.mark.parametrize("seed", [0, 1, 2**40])
def test_a_mix_of_draws_is_that_of_numpy(seed):
    kinds = np.random.default_rng(1).integers(7, size=50_000)
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    generator = np.zeros(1, np.dtype(GENERATOR, align=True))
    load_generator(generator[0], rng.bit_generator)
    ours = np.empty(len(kinds))
    _draw(generator, kinds, ours)
    draws = {
        0: lambda: rng.uniform(0.9, 1.1),
        1: lambda: rng.choice(3),
        2: lambda: rng.normal(),
        4: lambda: rng.random(),
        5: lambda: rng.choice(range(4), size=2, replace=False) @ (10, 1),
        6: lambda: rng.integers(3_000_000_000),
    }
    theirs = np.array([0 if kind == 3 else draws[kind]() for kind in kinds], float)
    assert np.array_equal(ours, theirs)
    assert generator_state(generator[0]) == rng.bit_generator.state


@njit
def _shuffle(generators, rows):
    for i in range(len(rows) - 1, 0, -1):
        j = interval(generators[0], i)
        rows[i], rows[j] = rows[j], rows[i]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9, 17])
def test_rows_are_shuffled_as_numpy_shuffles_them(count):
    generator = np.zeros(1, np.dtype(GENERATOR, align=True))
    for seed in range(50):
        rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
        load_generator(generator[0], rng.bit_generator)
        ours, theirs = np.arange(count), np.repeat(np.arange(count)[:, None], 2, axis=1)
        _shuffle(generator, ours)
        rng.shuffle(theirs)
        assert np.array_equal(ours, theirs[:, 0])
        assert generator_state(generator[0]) == rng.bit_generator.state
