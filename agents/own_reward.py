"""A reward of one's own: what it is made of, and how an agent is paid by it."""

import copy
import reprlib
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np


class RewardFailed(ValueError):
    """A reward of a user's own is none; the message is one line."""


Told = Callable[..., np.ndarray]


class Decision(NamedTuple):
    """The last decision of E environments side by side."""

    reward: np.ndarray  # [E] the environment's own
    actions: np.ndarray  # [E] or [E, A]
    ended: np.ndarray  # [E] did its episode end with it?
    told: Told  # told("speed"), told("shield", "override_fraction"): [E] what infos say, also where an episode ended


Reward = Callable[[Decision], Any]  # -> [E]


def told_by(infos: dict, ended: np.ndarray) -> Told:
    """What infos say about the last decision of every environment, by keys.

    Args:
      infos: of a vector environment, with autoreset in the same step or without any.
      ended: `[E]`.
    """

    def told(*keys: str) -> np.ndarray:
        if not ended.any() or "final_info" not in infos:
            return _under(infos, keys)
        finals = _under(infos["final_info"], keys)
        if ended.all():  # some keys are there only where a decision was made
            return finals
        values = _under(infos, keys)
        return np.where(ended.reshape(-1, *[1] * (np.ndim(values) - 1)), finals, values)

    return told


def _under(infos: Any, keys: tuple[str, ...]) -> Any:
    for depth, key in enumerate(keys):
        known = [str(name) for name in infos if not str(name).startswith("_")] if isinstance(infos, dict) else []
        if not isinstance(infos, dict) or key not in infos:
            asked = ", ".join(map(repr, keys[: depth + 1]))
            nearest = "".join(f"; the nearest is {name!r}" for name in get_close_matches(str(key), known, 1, 0.0))
            raise KeyError(f"told({asked}): expected one of {', '.join(sorted(known)) or 'no more keys'}{nearest}")
        infos = infos[key]
    return infos


def rewards_by(
    function: Reward, rewards: np.ndarray, actions: np.ndarray, infos: dict, ended: np.ndarray
) -> np.ndarray:
    """What one's own reward pays, less what an intervention penalty takes off.

    Args:
      function: see `Decision`.
      rewards: `[E]`, of the environment, a penalty taken off.

    Raises:
      RewardFailed: the function does not answer with one finite number for each environment.
    """
    told = told_by(infos, ended)
    raw = np.asarray(told("raw_reward"), float)
    # copies, all of them: a function may work in place
    decision = Decision(raw.copy(), np.array(actions), ended.copy(), lambda *keys: copy.copy(told(*keys)))
    answer = function(decision)
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', function)}"
    try:
        paid = np.asarray(answer, float)
    except (TypeError, ValueError):  # texts, None among numbers, rows of unlike length
        returned = f"{type(answer).__name__} {reprlib.repr(answer)}"
        raise RewardFailed(f"reward {name}: returned {returned}; expected numbers, shape {raw.shape}") from None
    if paid.shape != raw.shape:
        raise RewardFailed(f"reward {name}: shape {paid.shape} for {len(raw)} environments; expected {raw.shape}")
    if not np.isfinite(paid).all():
        raise RewardFailed(f"reward {name}: {paid[~np.isfinite(paid)][0]}; expected finite numbers")
    return paid - (raw - rewards)
