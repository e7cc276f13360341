"""What an engine runs: a highway-env configuration, checked and turned into numbers.

The stock environment is built once and asked for its configuration, roads and spaces, so every
default and every override means what it means there.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from highway_env import utils
from highway_env.envs.common.action import ContinuousAction, DiscreteAction, DiscreteMetaAction, MultiAgentAction
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.fast.envs import exit as exiting
from rss_shield.envs.fast.envs import intersection, merge_generic
from rss_shield.envs.fast.linear_drivers import KINDS, usual_habits
from rss_shield.envs.fast.record import CONFIG
from rss_shield.envs.fast.record import Unsupported as Unsupported
from rss_shield.envs.fast.tasks import (
    EXIT,
    INTERSECTION,
    MERGE,
    MERGE_GENERIC,
    ROUNDABOUT,
    SCENARIOS,
    TWO_WAY,
    U_TURN,
    describe_of,
    destinations_of,
    rewards_of,
)
from rss_shield.envs.fast.views.describe import Glance, views_of
from rss_shield.envs.fast.views.record import View
from rss_shield.envs.roads.hostile import NO_VICE, vice_of
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, Network, compile_network
from rss_shield.envs.stock import check_given, drivers_unchanged, hands_out_rewards, make_stock


class Scenario(NamedTuple):
    """An environment ready to be run by the engine."""

    env_id: str
    config: np.ndarray  # `[1]` CONFIG
    flow: np.ndarray | None  # `[1]` FLOW at an intersection
    network: Network
    target_speeds: np.ndarray  # `[K]` of meta-actions [m/s]
    view: View  # what the kernel observes itself, or
    glances: tuple[Glance, ...]  # what is observed apart from it
    labels: np.ndarray  # meta-action of each action, as in `DiscreteMetaAction.ACTIONS_ALL`
    agents: int | None  # how many egos where each has an action of its own, None = there is one, with one
    apart: bool  # rewards are the agents' own, not one for all
    kind: Any  # highway-env's type of an agent's action
    choices: np.ndarray | None  # `[A, 2]` acceleration [m/s^2] and steering [rad] of each `DiscreteAction`
    lane_odds: np.ndarray  # cumulative odds of the lanes that traffic starts on
    linear: np.ndarray | None  # `[6]` as in `linear_drivers`, where the traffic is of that kind
    reward_names: tuple[str, ...]
    capacity: int  # road users at most
    observation_space: spaces.Space
    action_space: spaces.Space
    stock: Any  # the stock environment, without wrappers

    def commands(self, actions: np.ndarray) -> np.ndarray:
        """Acceleration [m/s^2] and steering [rad] of continuous actions `[E, A]`, as `[E, 2]` float64.

        The arithmetic is that of highway-env, in the type of the actions.
        """
        return _commands(self.kind, actions)


def compile_scenario(
    env_id: str, config: dict | None = None, capacity: int | None = None, max_episode_steps: int | None = None
) -> Scenario:
    """Everything the engine needs to run an environment.

    Args:
      env_id: "highway-v0", ...
      config: as for `gymnasium.make`.
      capacity: road users that there is room for where traffic comes and goes. None = as many as can
        appear in an episode, at most `intersection.MOST_CARS`. The engine raises `OverflowError` when a car
        finds no room.
      max_episode_steps: decisions after which an episode is cut off; None = as many as in highway-env.

    Raises:
      ValueError: the environment or something in its configuration is not supported; the message
        names it.
    """
    if env_id not in SCENARIOS:
        raise Unsupported(f"env_id = {env_id!r}", f"one of {', '.join(SCENARIOS)}, or backend 'highway-env'")
    scenario = SCENARIOS[env_id]
    asked = {} if config is None else config
    check_given(env_id, asked)
    _check_action(scenario, env_id, asked)
    if "other_vehicles_type" in asked:  # with some highway-env itself fails
        _check_traffic(asked["other_vehicles_type"])
    wrapped = make_stock(env_id, config=config, max_episode_steps=max_episode_steps)
    env: Any = wrapped.unwrapped
    given = env.config
    agents, apart = _agents_in(scenario, env), hands_out_rewards(wrapped)
    if apart and agents is None:
        raise Unsupported(f"one agent in {env_id}", "action type MultiAgentAction")
    kind = _checked(given, agents)
    action_type = env.action_type if agents is None else env.action_type.agents_action_types[0]
    record = np.zeros(1, CONFIG)
    record["scenario"], record["end_x"], record["agents"] = scenario, np.inf, agents or 1
    record["dt"] = 1 / given["simulation_frequency"]
    record["frames"] = int(given["simulation_frequency"] // given["policy_frequency"])
    record["period"] = 1 / given["policy_frequency"]
    record["max_steps"] = (wrapped.spec and wrapped.spec.max_episode_steps) or 0
    record["duration"] = given.get("duration", np.inf)
    _fill_traffic(record, kind)
    record["vice"], record["bounded"] = vice_of(given["other_vehicles_type"]) or (NO_VICE, False)
    target_speeds, labels, choices = _fill_action(record, action_type)
    number = {index: i for i, index in enumerate(env.road.network.lanes_dict())}
    describe_of(scenario)(record, given, env, number)
    record["gap_braking"] = 2 * np.sqrt(-record["comfort_acc_max"] * record["comfort_acc_min"])
    network = compile_network(
        env.road.network,
        given["neighbour_vehicles_connected_lanes"],
        destinations_of(scenario),
        lined_up=scenario != INTERSECTION,
    )
    view, glances = views_of(env, network)
    flow = None
    if scenario == INTERSECTION:
        flow = intersection.flow_of(record["dt"][0], given, env, number)
        capacity = intersection.room_for(record, given) if capacity is None else capacity
    elif scenario == MERGE_GENERIC:  # where some cars may find no room
        capacity = given["vehicles_count"] + merge_generic.RAMP_USERS
    else:
        capacity = len(env.road.vehicles) + len(env.road.objects)
    return Scenario(
        env_id,
        record,
        flow,
        network,
        target_speeds,
        view,
        glances,
        labels,
        agents,
        apart,
        action_type,
        choices,
        exiting.lane_odds(given) if scenario == EXIT else np.ones(1),
        usual_habits(kind),
        rewards_of(scenario),
        capacity,
        env.observation_space,
        env.action_space,
        env,
    )


def _check_action(scenario: int, env_id: str, config: dict) -> None:
    """Do observation and reward of the environment understand the action? In highway-env some do not."""
    asked = config.get("action") or {}
    if asked.get("type") == "MultiAgentAction":
        asked = asked.get("action_config") or {}
    kind = asked.get("type", "DiscreteMetaAction")
    two_axes = kind == "ContinuousAction" and asked.get("longitudinal", True) and asked.get("lateral", True)
    if kind != "DiscreteMetaAction" and scenario == TWO_WAY:
        raise Unsupported(f"action type {kind} in {env_id}", "DiscreteMetaAction")
    by_default = "TimeToCollision" if scenario in (TWO_WAY, U_TURN) else ""
    if kind != "DiscreteMetaAction" and (config.get("observation") or {}).get("type", by_default) == "TimeToCollision":
        raise Unsupported(f"observation type TimeToCollision with {kind}", "DiscreteMetaAction, or another observation")
    if two_axes and scenario in (MERGE, MERGE_GENERIC, ROUNDABOUT):
        raise Unsupported(
            f"action type {kind} in {env_id}",
            "DiscreteMetaAction, DiscreteAction, or ContinuousAction with longitudinal = False or lateral = False",
        )


def _check_traffic(asked: str) -> None:
    if asked not in KINDS and vice_of(asked) is None:
        raise Unsupported(f"other_vehicles_type = {asked!r}", f"one of {', '.join(KINDS)}, or one of HOSTILE")


def _agents_in(scenario: int, env: Any) -> int | None:
    """How many egos have an action of their own; None where there is one action."""
    if not isinstance(env.action_type, MultiAgentAction):
        return None
    count = len(env.controlled_vehicles)
    if scenario != INTERSECTION:
        raise Unsupported(f"controlled_vehicles = {count}", "1, or an intersection")
    if count < 1 or count != env.config["controlled_vehicles"]:
        raise Unsupported(f"controlled_vehicles = {env.config['controlled_vehicles']}", "a whole number from 1")
    return count


def _checked(given: dict, agents: int | None) -> type[IDMVehicle]:
    """The kind of the traffic, if the engine can run a configuration."""
    asked = given["other_vehicles_type"]
    _check_traffic(asked)
    if (IDMVehicle.LENGTH, IDMVehicle.WIDTH) != (CAR_LENGTH, CAR_WIDTH):
        raise Unsupported(
            f"vehicles of {IDMVehicle.LENGTH:g} m x {IDMVehicle.WIDTH:g} m", f"{CAR_LENGTH:g} m x {CAR_WIDTH:g} m"
        )
    if agents is not None and vice_of(asked) is not None:
        raise Unsupported(f"other_vehicles_type = {asked!r} with several agents", "drivers who mean no harm")
    if agents is None and given.get("controlled_vehicles", 1) != 1:
        raise Unsupported(f"controlled_vehicles = {given['controlled_vehicles']}", "1")
    if given["manual_control"]:
        raise Unsupported("manual_control = True", "False")
    return KINDS.get(asked, IDMVehicle)  # hostile drivers are IDM drivers but for one vice


def _fill_traffic(record, kind: type[IDMVehicle]) -> None:
    with drivers_unchanged():
        record["distance_wanted"] = kind.DISTANCE_WANTED
        record["comfort_acc_max"], record["comfort_acc_min"] = kind.COMFORT_ACC_MAX, kind.COMFORT_ACC_MIN
    record["acc_max"], record["time_wanted"] = kind.ACC_MAX, kind.TIME_WANTED
    record["min_acc_gain"] = kind.LANE_CHANGE_MIN_ACC_GAIN
    record["max_braking_imposed"] = kind.LANE_CHANGE_MAX_BRAKING_IMPOSED
    record["lane_change_delay"] = kind.LANE_CHANGE_DELAY
    record["delta"] = kind.DELTA
    record["delta_low"], record["delta_high"] = kind.DELTA_RANGE


def _fill_action(record, action_type) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Enter what an ego can do; returns target speeds, labels and choices of the `Scenario`."""
    record["max_speed"], record["min_speed"] = Vehicle.MAX_SPEED, Vehicle.MIN_SPEED
    if type(action_type) is DiscreteMetaAction:
        record["meta_actions"], record["speeds"] = True, len(action_type.target_speeds)
        numbers = {label: number for number, label in DiscreteMetaAction.ACTIONS_ALL.items()}
        labels = [numbers[action_type.actions[k]] for k in range(len(action_type.actions))]
        return np.asarray(action_type.target_speeds, float), np.array(labels, np.int64), None
    if type(action_type) not in (ContinuousAction, DiscreteAction):
        kinds = "DiscreteMetaAction, DiscreteAction or ContinuousAction"
        raise Unsupported(f"action type {type(action_type).__name__}", kinds)
    if action_type.dynamical:
        raise Unsupported("action option dynamical = True", "False")
    if action_type.speed_range:
        record["min_speed"], record["max_speed"] = action_type.speed_range
    return np.zeros(1), np.zeros(0, np.int64), _choices(action_type)


def _choices(action_type: ContinuousAction) -> np.ndarray | None:
    """What each `DiscreteAction` commands, `[A, 2]`, with highway-env's arithmetic; None if actions are numbers."""
    if type(action_type) is not DiscreteAction:
        return None
    box = ContinuousAction.space(action_type)
    axes = np.linspace(box.low, box.high, action_type.actions_per_axis).T
    return _commands(action_type, np.array([*product(*axes)]))


def _commands(action_type: ContinuousAction, actions: np.ndarray) -> np.ndarray:
    """Acceleration [m/s^2] and steering [rad] of actions `[E, A]`, as `[E, 2]` float64."""
    if action_type.clip:
        actions = np.clip(actions, -1, 1)
    out = np.zeros((len(actions), 2))
    if action_type.longitudinal:
        out[:, 0] = utils.lmap(actions[:, 0], [-1, 1], action_type.acceleration_range)
    if action_type.lateral:
        out[:, 1] = utils.lmap(actions[:, -1], [-1, 1], action_type.steering_range)
    return out
