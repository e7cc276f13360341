"""Compiled code rounds as numpy does on this machine."""

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from highway_env import utils
from llvmlite.binding import get_host_cpu_features

from rss_shield.envs._numpy.floats import dot, norm, wrap_to_pi

KERNELS = {"": "", "Haswell": "avx2", "SkylakeX": "avx512f"}  # of numpy's linear algebra library: what they need
VECTORS = np.random.default_rng(1).normal(size=(1000, 2, 2)) * 10.0
COMPARE = """
from test_floats import *
assert (compiled_dots() == [np.dot(a, b) for a, b in VECTORS]).all()
assert (compiled_norms() == [np.linalg.norm(a) for a, _ in VECTORS]).all()
"""


def compiled_dots():
    call = numba.njit(lambda a, b: dot(a[0], a[1], b[0], b[1]))
    return np.array([call(a, b) for a, b in VECTORS])


def compiled_norms():
    call = numba.njit(lambda a: norm(a[0], a[1]))
    return np.array([call(a) for a, _ in VECTORS])


@pytest.mark.parametrize("kernel", KERNELS)
def test_dot_products_and_norms_are_those_of_numpy(kernel):
    here = Path(__file__).parent
    environment = os.environ | {"PYTHONPATH": f"{here}{os.pathsep}{here.parent.parent}"}
    if kernel:
        if not get_host_cpu_features().get(KERNELS[kernel]):
            pytest.skip(f"a processor without {KERNELS[kernel]}")
        environment["OPENBLAS_CORETYPE"] = kernel
    done = subprocess.run([sys.executable, "-c", COMPARE], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_another_rounding_would_be_noticed():
    fused = np.array([float(Fraction(a[1]) * Fraction(b[1]) + Fraction(a[0] * b[0])) for a, b in VECTORS])
    plain = (VECTORS[:, 0] * VECTORS[:, 1]).sum(axis=1)
    assert (fused != plain).sum() > 100


def test_angles_are_wrapped_as_highway_env_does_to_the_last_bit():
    """In range, up to a turn out of it, further out, and at the edges and their neighbours."""
    edges = np.arange(-8, 9) * np.pi
    edges = np.concatenate([edges, np.nextafter(edges, np.inf), np.nextafter(edges, -np.inf)])
    angles = np.concatenate([np.random.default_rng(0).uniform(-30.0, 30.0, 20_000), edges, edges - np.pi])
    wrap = numba.njit(lambda angle: wrap_to_pi(angle))
    assert np.array([wrap(angle) for angle in angles]).tobytes() == utils.wrap_to_pi(angles).tobytes()
