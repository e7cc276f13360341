"""Which environments the engine knows, each from its own file in `envs`, and which of them a kernel is to play."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from rss_shield.envs.fast.envs import exit as exiting
from rss_shield.envs.fast.envs import highway, intersection, merge, merge_generic, roundabout, two_way, u_turn
from rss_shield.envs.fast.rating import is_on_road
from rss_shield.shield._numba.compiled import inner, part

HIGHWAY, MERGE, TWO_WAY, EXIT, ROUNDABOUT, INTERSECTION, MERGE_GENERIC, U_TURN = range(8)
SCENARIOS = {
    "highway-v0": HIGHWAY,
    "highway-fast-v0": HIGHWAY,
    "merge-v0": MERGE,
    "merge-v1": MERGE,
    "merge-generic-v0": MERGE_GENERIC,
    "merge-generic-v1": MERGE_GENERIC,
    "two-way-v0": TWO_WAY,
    "exit-v0": EXIT,
    "exit-v1": EXIT,
    "u-turn-v0": U_TURN,
    "u-turn-v1": U_TURN,
    "roundabout-v0": ROUNDABOUT,
    "roundabout-v1": ROUNDABOUT,
    "intersection-v0": INTERSECTION,
    "intersection-v2": INTERSECTION,
    "intersection-multi-agent-v0": INTERSECTION,
    "intersection-multi-agent-v1": INTERSECTION,
    "intersection-multi-agent-v2": INTERSECTION,
}
_MODULES: dict[int, ModuleType] = {
    HIGHWAY: highway,
    MERGE: merge,
    MERGE_GENERIC: merge_generic,
    TWO_WAY: two_way,
    EXIT: exiting,
    U_TURN: u_turn,
    ROUNDABOUT: roundabout,
    INTERSECTION: intersection,
}


def describe_of(scenario: int) -> Callable[[Any, dict, Any, dict], None]:
    """The function that enters the configuration of a scenario."""
    return _MODULES[scenario].describe


def rewards_of(scenario: int) -> tuple[str, ...]:
    """Names of the components of its reward."""
    return _MODULES[scenario].REWARDS


def destinations_of(scenario: int) -> tuple[str, ...]:
    """Nodes that its cars plan their routes to."""
    return getattr(_MODULES[scenario], "DESTINATIONS", ())


@part
def make_scene(cars, episode, order, net, lanes, config, target_speeds, lane_odds, linear):
    """Populate the road of an environment where nobody comes and goes later.

    Args:
      cars: `[N]` CAR, overwritten.
      episode: EPISODE, its generator is advanced.
      order: `[N]` indices sorted by x, overwritten.
      net, lanes: the network and its LANE records.
      config: CONFIG.
      target_speeds: `[K]` of meta-actions [m/s].
      lane_odds, linear: of the `Scenario`.
    """
    episode.ego = episode.cars = episode.vehicles = 0
    if config.scenario == HIGHWAY:
        highway.make_scene(cars, episode, lanes, config, target_speeds, linear)
    elif config.scenario == MERGE:
        merge.make_scene(cars, episode, lanes, config, target_speeds)
    elif config.scenario == MERGE_GENERIC:
        merge_generic.make_scene(cars, episode, lanes, config, target_speeds)
    elif config.scenario == TWO_WAY:
        two_way.make_scene(cars, episode, lanes, config, target_speeds)
    elif config.scenario == EXIT:
        exiting.make_scene(cars, episode, net, lanes, config, target_speeds, lane_odds)
    elif config.scenario == U_TURN:
        u_turn.make_scene(cars, episode, net, lanes, config, target_speeds, linear)
    elif config.scenario == ROUNDABOUT:
        roundabout.make_scene(cars, episode, net, lanes, config, target_speeds, linear)
    episode.observed_lanes = lanes[cars[episode.ego].lane].siblings
    for i in range(episode.cars):
        order[i] = i


@inner
def rate(cars, episode, action, lanes, sight, config, step):
    """Reward of the last decision; its components go to `step`.

    Args:
      cars: `[N]` CAR.
      episode: EPISODE.
      action: of the agent, as highway-env compares it with lane changes; NO_ACTION = none yet.
      lanes: `[L]` LANE.
      sight: this frame's.
      config: CONFIG.
      step: STEP, changed.
    """
    ego = cars[episode.ego]
    step.reward_0 = 1.0 if ego.crashed else 0.0
    on_road = 1.0 if is_on_road(cars, episode.ego, lanes, sight) else 0.0
    changes_lane = 1.0 if action == 0 or action == 2 else 0.0
    if config.scenario == HIGHWAY:
        return highway.rate(ego, on_road, lanes, config, step)
    if config.scenario == MERGE or config.scenario == MERGE_GENERIC:
        return merge.rate(cars, episode, ego, changes_lane, lanes, config, step)
    if config.scenario == TWO_WAY:
        return two_way.rate(ego, lanes, config, step)
    if config.scenario == EXIT:
        return exiting.rate(ego, lanes, config, step)
    if config.scenario == INTERSECTION:
        return intersection.rate(cars, episode, ego, on_road, lanes, sight, config, step)
    if config.scenario == U_TURN:
        return u_turn.rate(ego, on_road, lanes, config, step)
    return roundabout.rate(ego, changes_lane, on_road, config, step)


@inner
def is_terminated(cars, episode, lanes, sight, config):
    """Is the state terminal?"""
    ego = cars[episode.ego]
    off_road = config.offroad_terminal and not is_on_road(cars, episode.ego, lanes, sight)
    arrived = config.scenario == INTERSECTION and intersection.has_arrived(cars, episode.ego, lanes, sight)
    return ego.crashed or ego.x > config.end_x or off_road or arrived


@inner
def is_terminated_together(cars, episode, egos, lanes, sight, config):
    """Is the state terminal for several agents, `egos` `[A]` EPISODE? Only intersections have them."""
    off_road = config.offroad_terminal and not is_on_road(cars, episode.ego, lanes, sight)
    return off_road or intersection.is_over(cars, egos, lanes, sight)
