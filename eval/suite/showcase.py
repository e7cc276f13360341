"""Episodes worth watching, as pages on which they play and as filmstrips: the worst and the most typical of an arm."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rss_shield.envs.highway.recorder import record_trace
from rss_shield.eval.arms import arm_named
from rss_shield.eval.replay import playback
from rss_shield.eval.run_folder import PAGES
from rss_shield.eval.viewer.filmstrip import write_filmstrip
from rss_shield.eval.viewer.page import write_replay_page
from rss_shield.shield.verdicts import AT_FAULT


def worth_watching(episodes: pd.DataFrame) -> dict[str, int]:
    """Which test episodes to show.

    Args:
      episodes: of one test, a row each; columns of `eval.rollout.evaluate`.

    Returns:
      "worst": seed of the episode that ended first by a contact that is the ego's fault, or by any contact, or else
      came nearest to one in time; "typical": of the one whose return is nearest to the median.
    """
    order = episodes.assign(
        kept=~episodes["blame"].isin(AT_FAULT), untouched=~episodes["crashed"].astype(bool), number=range(len(episodes))
    )
    order["until"] = np.where(order["untouched"], order["min_ttc"], order["time"])
    worst = order.sort_values(["kept", "untouched", "until", "number"]).iloc[0]
    median = episodes["return"].median()
    typical = episodes.iloc[int((episodes["return"] - median).abs().to_numpy().argmin())]
    return {"worst": int(worst["seed"]), "typical": int(typical["seed"])}


def show(
    tests: Mapping[str, pd.DataFrame],
    make: Callable[[str], Callable[[], Any]],
    folder: Path,
    arm: str,
    title: str,
    progress: Callable[[int], None] = lambda episodes: None,
) -> list[Path]:
    """Write the pages of one arm: every test of the same episode side by side, played again on highway-env.

    Args:
      tests: episodes of each test, with "seed" and "actions"; the first test says what is worth watching.
      make: test -> what builds its original environment.
      folder: of the run.
      arm: name, for the files.
      title: of the pages.
      progress: called with the episodes recorded so far.

    Returns:
      The files. Nothing is recorded for those that are there already.
    """
    files: list[Path] = []
    (folder / PAGES).mkdir(parents=True, exist_ok=True)
    for i, (kind, seed) in enumerate(worth_watching(next(iter(tests.values()))).items()):
        path = folder / PAGES / f"{arm_named(arm).file}-{kind}.html"
        if not path.exists():
            traces = [_traced(make(test), episodes, seed) for test, episodes in tests.items()]
            labels = [f"shield {test}" if test in ("off", "on") else test for test in tests]
            heading = f"{title}: {kind} episode, seed {seed}"
            write_filmstrip(traces, labels, path, heading)
            write_replay_page(traces, path, labels, heading)
        files.append(path)
        progress(len(tests) * (i + 1))
    return files


def shown(tests: Sequence[str]) -> int:
    """How many episodes `show` records."""
    return 2 * len(tests)


def _traced(make_env: Callable[[], Any], episodes: pd.DataFrame, seed: int) -> Any:
    env = make_env()
    try:
        actions = str(episodes.loc[episodes["seed"] == seed, "actions"].iloc[0])
        return record_trace(env, playback(actions), seed)
    finally:
        env.close()
