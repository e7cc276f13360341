"""Test episodes of the compiled engine, played again on the original simulator.

Each is played with the actions recorded in the engine, so that a difference between the two would
show in its return, its length, the crash or the blame.
"""

import itertools
from collections.abc import Callable

import numpy as np
import pandas as pd

from rss_shield.eval.rollout import MakeEnv, Policy, run_episode

TOLERANCE = 1e-6  # of the return
KEYS = ["train", "test", "train_seed", "seed"]
COMPARED = ["return", "length", "crashed", "blame"]


def chosen(episodes: pd.DataFrame, count: int, seed: int) -> pd.DataFrame:
    """`count` of the episodes, drawn by `seed`, in their order; all of them if there are fewer."""
    rows = np.random.default_rng(seed).choice(len(episodes), min(count, len(episodes)), replace=False)
    return episodes.iloc[np.sort(rows)]


def replay(
    make_env: MakeEnv, episodes: pd.DataFrame, progress: Callable[[int], None] = lambda episodes: None
) -> pd.DataFrame:
    """Play episodes again.

    Args:
      make_env: builds the original environment.
      episodes: columns seed and actions, as in `eval.rollout.evaluate`.
      progress: called with the episodes done so far.

    Returns:
      One row per episode; columns as in `eval.rollout.run_episode`.
    """
    records = []
    for seed, actions in zip(episodes["seed"], episodes["actions"].astype(str), strict=True):
        records.append(run_episode(make_env, playback(actions), int(seed)))
        progress(len(records))
    return pd.DataFrame(records)


def playback(actions: str) -> Policy:
    """Takes the recorded actions one by one, and the last one again if the episode turns out longer."""
    recorded = [int(action) for action in actions.split()]
    upcoming = itertools.chain(recorded, itertools.repeat(recorded[-1]))
    return lambda observation: next(upcoming)


def compare(episodes: pd.DataFrame, replays: pd.DataFrame) -> pd.DataFrame:
    """What the engine said beside what the original simulator says.

    Args:
      episodes, replays: one row per episode; columns KEYS and COMPARED.

    Returns:
      One row per replay: KEYS, COMPARED, the same with the suffix "_replayed", and agrees: returns
      equal within TOLERANCE, all else equal.
    """
    columns = KEYS + COMPARED
    both = replays[columns].merge(episodes[columns], on=KEYS, suffixes=("_replayed", ""), validate="one_to_one")
    agrees = (both["return"] - both["return_replayed"]).abs() <= TOLERANCE
    for name in COMPARED[1:]:
        agrees &= both[name] == both[f"{name}_replayed"]
    return both[columns + [f"{name}_replayed" for name in COMPARED]].assign(agrees=agrees)


def verdict(compared: pd.DataFrame) -> str:
    """How many replays agree, and which do not, one line each."""
    lines = [
        f"Replayed on highway-env with the same actions: {compared['agrees'].sum()} of {len(compared)} test episodes "
        f"agree in return (within {TOLERANCE:g}), length, crash and blame."
    ]
    for row in compared[~compared["agrees"]].to_dict("records"):
        differences = [
            f"{name} {row[name]}, replayed {row[f'{name}_replayed']}"
            for name in COMPARED
            if row[name] != row[f"{name}_replayed"]
        ]
        where = f"train {row['train']}, test {row['test']}, training seed {row['train_seed']}, episode {row['seed']}"
        lines.append(f"  DISAGREES: {where}: {'; '.join(differences)}")
    return "\n".join(lines)
