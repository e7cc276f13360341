"""Which settings are beaten by no other in everything at once."""

import numpy as np
from numpy.typing import ArrayLike


def pareto_front(points: ArrayLike) -> np.ndarray:
    """Which of N points are on the Pareto front: none other is at least as good in all respects and better in one.

    Args:
      points: `[N, D]`, less is better in each column (negate what should be large). A point with NaN is on no front.

    Returns:
      `[N]` truth values.
    """
    values = np.asarray(points, float)
    if values.ndim != 2:
        raise ValueError(f"points have shape {values.shape}: expected [N, D]")
    known = ~np.isnan(values).any(axis=1)
    others = np.where(known[:, None], values, np.inf)
    no_worse = (others[None, :, :] <= values[:, None, :]).all(axis=2)
    better = (others[None, :, :] < values[:, None, :]).any(axis=2)
    return known & ~(no_worse & better & known[None, :]).any(axis=1)
