"""Many comparisons at once: adjusted p-values."""

import numpy as np
from numpy.typing import ArrayLike
from statsmodels.stats.multitest import multipletests


def holm(p: ArrayLike) -> np.ndarray:
    """Adjusted p-values `[m]` that bound the chance of any false finding (Holm 1979). p: `[m]`."""
    return _adjusted(p, "holm")


def benjamini_hochberg(p: ArrayLike) -> np.ndarray:
    """Adjusted p-values `[m]` that bound the share of false findings (Benjamini & Hochberg 1995). p: `[m]`."""
    return _adjusted(p, "fdr_bh")


def _adjusted(p: ArrayLike, method: str) -> np.ndarray:
    values = np.asarray(p, float)
    if not ((values >= 0.0) & (values <= 1.0)).all():
        raise ValueError(f"p = {values.tolist()}: expected numbers from 0 to 1")
    return multipletests(values, method=method)[1] if values.size else values
