"""What an environment of highway-env lets its agent see, as views."""

from typing import Any, NamedTuple

from highway_env.envs.common import observation as stock

from rss_shield.envs.fast.record import Unsupported
from rss_shield.envs.fast.views import grid, kinematics, lidar, times
from rss_shield.envs.fast.views.record import KINEMATICS, NONE, TIME_TO_COLLISION, View, empty_view
from rss_shield.envs.roads.network import Network

KNOWN = (
    "Kinematics, ExitObservation, TimeToCollision, OccupancyGrid, LidarObservation, or a TupleObservation or "
    "MultiAgentObservation of them"
)


class Glance(NamedTuple):
    """One of several observations that are made apart from the kernel, and its columns in the whole."""

    view: View
    start: int
    size: int
    agent: int = 0  # of several, who sees it


def views_of(env: Any, net: Network) -> tuple[View, tuple[Glance, ...]]:
    """What the kernel observes itself, and what is observed apart; one of the two is empty.

    Raises:
      Unsupported: an observation, or an option of it, that the engine does not have.
    """
    seen, asked = env.observation_type, env.config["observation"]
    several = list(_parts(seen, asked))
    if not several:
        view = _describe(seen, asked, env, net)
        if view.record["kind"][0] in (KINEMATICS, TIME_TO_COLLISION):
            return view, ()
        return empty_view(NONE), (Glance(view, 0, _size(seen)),)
    glances: list[Glance] = []
    each = type(seen) is stock.MultiAgentObservation
    for agent, (part, options) in enumerate(several):
        start = glances[-1].start + glances[-1].size if glances else 0
        glances.append(Glance(_describe(part, options, env, net), start, _size(part), agent if each else 0))
    return empty_view(NONE), tuple(glances)


def _parts(seen: Any, asked: dict[str, Any]) -> Any:
    """The observations that one consists of, with their configurations."""
    if type(seen) is stock.TupleObservation:
        return zip(seen.observation_types, asked["observation_configs"], strict=True)
    if type(seen) is stock.MultiAgentObservation:
        return [(part, asked["observation_config"]) for part in seen.agents_observation_types]
    return ()


def _describe(seen: Any, asked: dict[str, Any], env: Any, net: Network) -> View:
    if type(seen) in (stock.KinematicObservation, stock.ExitObservation):
        return kinematics.describe(seen, asked, env)
    if type(seen) is stock.TimeToCollisionObservation:
        return times.describe(seen.observe().shape[2], env, net)
    if type(seen) is stock.OccupancyGridObservation:
        return grid.describe(seen, asked)
    if type(seen) is stock.LidarObservation:
        return lidar.describe(seen)
    raise Unsupported(f"observation type {type(seen).__name__}", KNOWN)


def _size(seen: Any) -> int:
    size = 1
    for length in seen.space().shape:
        size *= length
    return size
