"""What is permitted: masks of the actions of many environments, from whoever has them."""

from typing import Any

import numpy as np

MASKS = "action_masks"  # the one method that answers for all environments at once


def action_masks(env: Any) -> np.ndarray:
    """`action_masks()` of all environments, `[E, A]`: of the engine at once, of others one after the other."""
    together = getattr(env, MASKS, None)
    return np.stack(env.call(MASKS)) if together is None else together()
