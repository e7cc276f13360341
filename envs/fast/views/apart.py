"""Observations that are made between two calls of the engine's kernel."""

from collections.abc import Callable
from typing import Any

from rss_shield.envs.compiled import kernel
from rss_shield.envs.fast.frame import survey
from rss_shield.envs.fast.views.describe import Glance
from rss_shield.envs.fast.views.grid import look_grid
from rss_shield.envs.fast.views.lidar import look_lidar
from rss_shield.envs.fast.views.record import GRID, LIDAR
from rss_shield.envs.fast.views.usual import observe


@kernel
def look_usual(first, last, cars, episodes, net, sight, flow, view, target_speeds, period, which, start, out):
    """Arguments as in `views.grid.look_grid`; `sight` is working memory, `flow` as in `frame`."""
    for e in range(first, last):
        if which[e]:
            survey(cars[e], episodes[e], net, sight, flow)
            observe(cars[e], episodes[e], net, sight, view, target_speeds, period, out[e, start:])


def call_of(glance: Glance, world: Any, batch: Any, sight: Any, which: Any, out: Any) -> tuple[Callable, tuple]:
    """The kernel that makes an observation, and what it takes after the range of environments."""
    view, kind = glance.view, glance.view.record["kind"][0]
    end = which, glance.start, out
    if kind == GRID:
        return look_grid, (batch.cars, batch.episodes, world.network, view, *end)
    if kind == LIDAR:
        return look_lidar, (batch.cars, batch.episodes, sight, view, *end)
    period = float(world.config["period"][0])
    shared = batch.cars, batch.episodes, world.network, sight, world.flow, view, world.target_speeds, period
    return look_usual, (*shared, *end)
