"""A policy of your own, tested with the shield and without; a trained model takes the place of its name.

    python examples/drive_and_test.py
    rss-shield test examples.drive_and_test:drive --episodes 200      the same from a command line
    rss-shield test runs/highway-fast-v0/shielded-seed0/model.zip

Observations are a batch, `[B, 5, 5]` on this road: the ego and the four cars nearest to it, relative to the ego.
"""

import sys
import tempfile

import numpy as np

FASTER, SLOWER = 3, 4
PRESENT, X, Y = range(3)
LENGTH, LANES = 200.0, 3  # what x is scaled by [m]; y is scaled by three lanes


def drive(observations: np.ndarray) -> np.ndarray:
    """Slow down where a car in the own lane is less than 40 m ahead, else speed up: actions `[B]`."""
    others = observations[:, 1:]
    ahead = (others[..., PRESENT] > 0) & (others[..., X] > 0) & (others[..., X] * LENGTH < 40.0)
    return np.where((ahead & (np.abs(others[..., Y]) < 0.5 / LANES)).any(axis=1), SLOWER, FASTER)


if __name__ == "__main__":
    from rss_shield.test import main

    sys.path.insert(0, "examples")
    with tempfile.TemporaryDirectory() as folder:
        main(["drive_and_test:drive", "--episodes", "20", "--out", folder])
