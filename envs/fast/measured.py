"""The measures of an episode in the engine, from its recording: off the hot path, and only where somebody asks."""

from typing import Any

import numpy as np

from rss_shield.envs.fast.recording import Log
from rss_shield.envs.fast.state import DIRECT, META
from rss_shield.envs.options import LANES, Settings
from rss_shield.shield.risk.meter import EpisodeMeter, Measures


def measures_of(log: Log, settings: Settings, partner: int = -1) -> Measures:
    """What `envs.highway.measured.EgoMeter` would say of the same episode, but for what only a shield knows.

    Args:
      log: of a whole episode.
      settings: of the shield that was there.
      partner: row of whom the ego touched, -1: nobody.
    """
    meter = EpisodeMeter(settings.table.dt, settings.scheme != LANES)
    for k, (cars, count) in enumerate(zip(log.cars, log.present, strict=True)):
        present = cars[:count]
        (ego,) = np.flatnonzero(np.isin(present["kind"], (META, DIRECT)))
        order = np.append(np.delete(np.arange(count), ego), ego)
        poses, boxes = (
            np.column_stack([present[name][order] for name in names])
            for names in (("x", "y", "heading", "speed"), ("length", "width"))
        )
        if present["crashed"][ego] or present["hit"][ego]:
            if partner >= 0:
                meter.touch(poses, int(np.flatnonzero(order == partner)[0]))
            break
        if k < len(log.cars) - 1:  # nobody decides any more on the state in which an episode ends
            meter.look(poses, boxes)
    return meter.measures


def columns(env: Any, e: int) -> dict[str, float]:
    """The measures of environment `e`, whose episode has just ended; `env.recording` has chosen it."""
    finished = env.recording.finished
    number = next(i for i in reversed(range(len(finished))) if finished[i].env == e)
    info = env.info(e)
    partner = int(info["blame_evidence"]["partner"]) if info["blame_evidence"] else -1
    measures = measures_of(finished.pop(number), env.settings, partner)
    return {name: float(value) for name, value in measures._asdict().items()}
