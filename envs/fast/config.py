"""What an engine runs: a highway-env configuration, checked and turned into numbers.

The stock environment is built once and asked for its configuration, roads and spaces, so every
default and every override means what it means there.
"""

from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from highway_env import utils
from highway_env.envs.common.action import ContinuousAction, DiscreteMetaAction
from highway_env.envs.common.observation import ExitObservation, KinematicObservation, TimeToCollisionObservation
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.fast.state import REWARDS
from rss_shield.envs.roads.hostile import NO_VICE, vice_of
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, Network, compile_network
from rss_shield.envs.stock import AT_INTERSECTIONS, drivers_unchanged, make_stock

HIGHWAY, MERGE, TWO_WAY, EXIT, ROUNDABOUT, INTERSECTION = range(6)
KINEMATICS, TIME_TO_COLLISION = range(2)
PRESENCE, X, Y, VX, VY, HEADING, COS_H, SIN_H = range(8)
FEATURES = ("presence", "x", "y", "vx", "vy", "heading", "cos_h", "sin_h")

CONFIG = np.dtype(
    [
        ("scenario", "i8"),
        ("dt", "f8"),  # length of a frame [s]
        ("frames", "i8"),  # per decision
        ("period", "f8"),  # length of a decision [s]
        ("duration", "f8"),  # of an episode [s], inf = unlimited
        ("max_steps", "i8"),  # decisions of an episode, 0 = unlimited
        ("offroad_terminal", "?"),
        ("meta_actions", "?"),  # else acceleration and steering
        ("max_speed", "f8"),  # of a directly driven ego [m/s]
        ("min_speed", "f8"),
        # traffic
        ("acc_max", "f8"),  # [m/s^2]
        ("comfort_acc_max", "f8"),
        ("comfort_acc_min", "f8"),
        ("gap_braking", "f8"),  # what speeds are divided by in the desired gap
        ("distance_wanted", "f8"),  # [m]
        ("time_wanted", "f8"),  # [s]
        ("min_acc_gain", "f8"),  # [m/s^2]
        ("max_braking_imposed", "f8"),
        ("lane_change_delay", "f8"),  # [s]
        ("delta", "f8"),
        ("delta_low", "f8"),
        ("delta_high", "f8"),
        ("vice", "i8"),  # of everybody, see `envs.roads.hostile`
        ("bounded", "?"),  # in which they keep to the table's limits
        # scene
        ("traffic", "i8"),  # vehicles besides the ego
        ("traffic_checks", "?"),  # they look for collisions themselves
        ("ego_lane", "i8"),  # -1 = drawn
        ("ego_spacing", "f8"),
        ("traffic_spacing", "f8"),
        ("lanes_factor", "f8"),  # more lanes, denser traffic
        ("main_lane", "i8"),  # first lane of the road where the scene plays
        ("side_lane", "i8"),  # where others come from
        ("other_lane", "i8"),
        ("destination", "i8"),  # of the incoming car, -1 = drawn
        ("obstacle_x", "f8"),  # [m]
        ("obstacle_y", "f8"),
        ("end_x", "f8"),  # the episode ends beyond it [m]
        ("goal_lane", "i8"),  # reaching one of them is a success
        ("other_goal_lane", "i8"),
        # reward
        *[(f"weight_{k}", "f8") for k in range(REWARDS)],
        ("normalize_reward", "?"),
        ("reward_low", "f8"),
        ("reward_high", "f8"),
        ("speed_low", "f8"),  # [m/s]
        ("speed_high", "f8"),
        # observation
        ("observation", "i8"),
        ("rows", "i8"),  # observed vehicles, the ego included
        ("absolute", "?"),
        ("see_behind", "?"),
        ("obstacles", "?"),
        ("normalize", "?"),
        ("clips", "?"),
        ("exit_lane", "i8"),  # the ego's x counts along it, -1 = along the world
        ("speeds", "i8"),  # size of a time-to-collision grid
        ("lanes", "i8"),
        ("times", "i8"),
    ],
    align=True,
)

# an intersection, where traffic comes, goes and yields
FLOW = np.dtype(
    [
        ("arm", "i8"),  # lanes from one entry to the next
        ("destination", "i8"),  # of the ego, -1 = drawn
        ("warm_up_frames", "i8"),  # before the ego appears
        ("regulation_period", "i8"),  # frames between decisions on who yields
        ("spawn_probability", "f8"),  # of a new car after each decision
    ],
    align=True,
)


class Scenario(NamedTuple):
    """An environment ready to be run by the engine."""

    env_id: str
    config: np.ndarray  # `[1]` CONFIG
    flow: np.ndarray | None  # `[1]` FLOW at an intersection
    network: Network
    target_speeds: np.ndarray  # `[K]` of meta-actions [m/s]
    features: np.ndarray  # `[F]` observed features
    ranges: np.ndarray  # `[F, 2]` their ranges, nan = not scaled, -inf..inf = by the number of lanes
    labels: np.ndarray  # meta-action of each action, as in `DiscreteMetaAction.ACTIONS_ALL`
    connected: np.ndarray  # `[L, L]` may a car on one lane meet a car on another, for times to collision
    lane_odds: np.ndarray  # cumulative odds of the lanes that traffic starts on
    reward_names: tuple[str, ...]
    capacity: int  # road users at most
    observation_space: spaces.Space
    action_space: spaces.Space
    stock: Any  # the stock environment, without wrappers

    def commands(self, actions: np.ndarray) -> np.ndarray:
        """Acceleration [m/s^2] and steering [rad] of continuous actions `[E, A]`, as `[E, 2]` float64.

        The arithmetic is that of highway-env, in the type of the actions.
        """
        kind = self.stock.action_type
        if kind.clip:
            actions = np.clip(actions, -1, 1)
        out = np.zeros((len(actions), 2))
        if kind.longitudinal:
            out[:, 0] = utils.lmap(actions[:, 0], [-1, 1], kind.acceleration_range)
        if kind.lateral:
            out[:, 1] = utils.lmap(actions[:, -1], [-1, 1], kind.steering_range)
        return out


class Unsupported(ValueError):
    """A feature of highway-env that the engine does not have."""

    def __init__(self, what: str, expected: str) -> None:
        super().__init__(f"the fast engine does not support {what}; expected {expected}")


SCENARIOS = {
    "highway-v0": HIGHWAY,
    "highway-fast-v0": HIGHWAY,
    "merge-v0": MERGE,
    "merge-v1": MERGE,
    "two-way-v0": TWO_WAY,
    "exit-v0": EXIT,
    "exit-v1": EXIT,
    "roundabout-v0": ROUNDABOUT,
    "roundabout-v1": ROUNDABOUT,
    "intersection-v0": INTERSECTION,
    "intersection-v2": INTERSECTION,
}
_ARMS = ("o0", "o1", "o2", "o3")
_DESTINATIONS: dict[int, tuple[str, ...]] = {
    EXIT: ("3",),
    ROUNDABOUT: ("nxs", "exr", "sxr", "nxr"),
    INTERSECTION: _ARMS,
}
# Room at an intersection, at most. Behind an ego that stands still for 150 s, with a new car tried every
# second, the fullest of 256 environments held 58.
MOST_CARS = 64


def compile_scenario(
    env_id: str, config: dict | None = None, capacity: int | None = None, max_episode_steps: int | None = None
) -> Scenario:
    """Everything the engine needs to run an environment.

    Args:
      env_id: "highway-v0", ...
      config: as for `gymnasium.make`.
      capacity: road users that there is room for where traffic comes and goes. None = as many as can
        appear in an episode, at most `MOST_CARS`. The engine raises `OverflowError` when a car finds
        no room.
      max_episode_steps: decisions after which an episode is cut off; None = as many as in highway-env.

    Raises:
      ValueError: the environment or something in its configuration is not supported; the message
        names it.
    """
    if env_id not in SCENARIOS:
        raise Unsupported(f"env_id = {env_id!r}", f"one of {', '.join(SCENARIOS)}")
    scenario = SCENARIOS[env_id]
    asked = ((config or {}).get("action") or {}).get("type", "DiscreteMetaAction")
    if scenario in (MERGE, TWO_WAY, ROUNDABOUT) and asked != "DiscreteMetaAction":
        raise Unsupported(f"action type {asked} in {env_id}", "DiscreteMetaAction")  # nor does highway-env
    wrapped = make_stock(env_id, config=config, max_episode_steps=max_episode_steps)
    env: Any = wrapped.unwrapped
    given = env.config
    _check(given)
    record = np.zeros(1, CONFIG)
    record["scenario"] = scenario
    record["end_x"], record["exit_lane"] = np.inf, -1
    record["dt"] = 1 / given["simulation_frequency"]
    record["frames"] = int(given["simulation_frequency"] // given["policy_frequency"])
    record["period"] = 1 / given["policy_frequency"]
    record["max_steps"] = (wrapped.spec and wrapped.spec.max_episode_steps) or 0
    record["duration"] = given.get("duration", np.inf)
    _fill_traffic(record)
    record["vice"], record["bounded"] = vice_of(given["other_vehicles_type"]) or (NO_VICE, False)
    target_speeds, labels = _fill_action(record, env.action_type)
    features, ranges, connected = _fill_observation(record, env)
    number = {index: i for i, index in enumerate(env.road.network.lanes_dict())}
    reward_names = _FILL_SCENE[scenario](record, given, env, number)
    record["gap_braking"] = 2 * np.sqrt(-record["comfort_acc_max"] * record["comfort_acc_min"])
    network = compile_network(
        env.road.network,
        given["neighbour_vehicles_connected_lanes"],
        _DESTINATIONS.get(scenario, ()),
        lined_up=scenario != INTERSECTION,
    )
    if scenario != INTERSECTION:
        capacity = len(env.road.vehicles) + len(env.road.objects)
    elif capacity is None:
        decisions = record["duration"][0] / record["period"][0] + 2
        capacity = int(min(MOST_CARS, max(given["initial_vehicle_count"], 1) + 1 + np.ceil(decisions)))
    return Scenario(
        env_id,
        record,
        _flow(record["dt"][0], given, env, number) if scenario == INTERSECTION else None,
        network,
        target_speeds,
        features,
        ranges,
        labels,
        connected,
        _lane_odds(given) if scenario == EXIT else np.ones(1),
        reward_names,
        capacity,
        env.observation_space,
        env.action_space,
        env,
    )


def _check(given: dict) -> None:
    idm = "highway_env.vehicle.behavior.IDMVehicle"
    if given["other_vehicles_type"] != idm and vice_of(given["other_vehicles_type"]) is None:
        raise Unsupported(f"other_vehicles_type = {given['other_vehicles_type']!r}", f"{idm!r} or one of HOSTILE")
    if (IDMVehicle.LENGTH, IDMVehicle.WIDTH) != (CAR_LENGTH, CAR_WIDTH):
        raise Unsupported(
            f"vehicles of {IDMVehicle.LENGTH:g} m x {IDMVehicle.WIDTH:g} m", f"{CAR_LENGTH:g} m x {CAR_WIDTH:g} m"
        )
    if given.get("controlled_vehicles", 1) != 1:
        raise Unsupported(f"controlled_vehicles = {given['controlled_vehicles']}", "1")
    if given["manual_control"]:
        raise Unsupported("manual_control = True", "False")


def _fill_traffic(record) -> None:
    with drivers_unchanged():
        record["distance_wanted"] = IDMVehicle.DISTANCE_WANTED
        record["comfort_acc_max"], record["comfort_acc_min"] = IDMVehicle.COMFORT_ACC_MAX, IDMVehicle.COMFORT_ACC_MIN
    record["acc_max"], record["time_wanted"] = IDMVehicle.ACC_MAX, IDMVehicle.TIME_WANTED
    record["min_acc_gain"] = IDMVehicle.LANE_CHANGE_MIN_ACC_GAIN
    record["max_braking_imposed"] = IDMVehicle.LANE_CHANGE_MAX_BRAKING_IMPOSED
    record["lane_change_delay"] = IDMVehicle.LANE_CHANGE_DELAY
    record["delta"] = IDMVehicle.DELTA
    record["delta_low"], record["delta_high"] = IDMVehicle.DELTA_RANGE


def _fill_action(record, action_type) -> tuple[np.ndarray, np.ndarray]:
    record["max_speed"], record["min_speed"] = Vehicle.MAX_SPEED, Vehicle.MIN_SPEED
    if type(action_type) is DiscreteMetaAction:
        record["meta_actions"], record["speeds"] = True, len(action_type.target_speeds)
        numbers = {label: number for number, label in DiscreteMetaAction.ACTIONS_ALL.items()}
        labels = [numbers[action_type.actions[k]] for k in range(len(action_type.actions))]
        return np.asarray(action_type.target_speeds, float), np.array(labels, np.int64)
    if type(action_type) is ContinuousAction:
        if action_type.dynamical:
            raise Unsupported("action option dynamical = True", "False")
        if action_type.speed_range:
            record["min_speed"], record["max_speed"] = action_type.speed_range
        return np.zeros(1), np.zeros(0, np.int64)
    raise Unsupported(f"action type {type(action_type).__name__}", "DiscreteMetaAction or ContinuousAction")


def _fill_observation(record, env) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    seen = env.observation_type
    if type(seen) is TimeToCollisionObservation:
        return _fill_times(record, env)
    if type(seen) not in (KinematicObservation, ExitObservation):
        raise Unsupported(f"observation type {type(seen).__name__}", "Kinematics, ExitObservation or TimeToCollision")
    if seen.order != "sorted":
        raise Unsupported(f"observation option order = {seen.order!r}", "'sorted'")
    if seen.vehicles_count < 2:
        raise Unsupported(f"observation option vehicles_count = {seen.vehicles_count}", ">= 2")
    for name in seen.features:
        if name not in FEATURES:
            raise Unsupported(f"observed feature {name!r}", f"one of {', '.join(FEATURES)}")
        if name == "heading" and env.road.objects and seen.include_obstacles:
            raise Unsupported("observed feature 'heading' of obstacles", "include_obstacles = False")
    record["observation"], record["rows"] = KINEMATICS, seen.vehicles_count
    record["absolute"], record["see_behind"] = seen.absolute, seen.see_behind
    record["obstacles"], record["normalize"], record["clips"] = seen.include_obstacles, seen.normalize, seen.clip
    if type(seen) is ExitObservation:
        road = [i for i, index in enumerate(env.road.network.lanes_dict()) if index[:2] == ("1", "2")]
        record["obstacles"], record["exit_lane"] = False, road[-1]
    # an observation fills in its default ranges when it is first made
    defaults = {"x": 5 * Vehicle.MAX_SPEED, "vx": 2 * Vehicle.MAX_SPEED, "vy": 2 * Vehicle.MAX_SPEED, "y": np.inf}
    ranges = np.full((len(seen.features), 2), np.nan)
    asked = env.config["observation"].get("features_range")
    for k, name in enumerate(seen.features):
        if asked and name in asked:
            ranges[k] = asked[name]
        elif not asked and name in defaults:
            ranges[k] = -defaults[name], defaults[name]
    features = np.array([FEATURES.index(name) for name in seen.features], np.int64)
    return features, ranges, np.zeros((0, 0), bool)


def _fill_times(record, env) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if not record["meta_actions"]:
        raise Unsupported(f"TimeToCollision with {type(env.action_type).__name__}", "DiscreteMetaAction")
    if env.vehicle.route:
        raise Unsupported("TimeToCollision for an ego with a route", "Kinematics")
    network = env.road.network
    indices = list(network.lanes_dict())
    record["observation"] = TIME_TO_COLLISION
    record["lanes"] = max(len(network.all_side_lanes(index)) for index in indices)
    record["times"] = env.observation_space.shape[2]
    connected = np.array([[network.is_connected_road(a, b, depth=3) for b in indices] for a in indices])
    return np.zeros(0, np.int64), np.zeros((0, 2)), connected


def _lane_odds(given: dict) -> np.ndarray:
    """As `np.random.Generator.choice` turns the odds of `ExitEnv` into thresholds."""
    lanes = np.arange(given["lanes_count"])
    odds = (lanes / lanes.sum()).cumsum()
    return odds / odds[-1]


def _set_weights(record, given: dict, names: tuple[str, ...]) -> tuple[str, ...]:
    for k, name in enumerate(names):
        record[f"weight_{k}"] = given.get(name, 0)
    return names


def _fill_highway(record, given: dict, env, number: dict) -> tuple[str, ...]:
    record["offroad_terminal"] = given["offroad_terminal"]
    record["traffic"] = given["vehicles_count"]
    record["traffic_checks"] = env.road.vehicles[-1].check_collisions
    asked = given["initial_lane_id"]  # as Python indexes a list: -1 is the last lane
    record["ego_lane"] = -1 if asked is None else range(given["lanes_count"])[asked]
    record["ego_spacing"], record["traffic_spacing"] = given["ego_spacing"], 1 / given["vehicles_density"]
    record["lanes_factor"] = np.exp(-5 / 40 * given["lanes_count"])
    record["normalize_reward"] = given["normalize_reward"]
    record["reward_low"] = given["collision_reward"]
    record["reward_high"] = given["high_speed_reward"] + given["right_lane_reward"]
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]
    return _set_weights(record, given, ("collision_reward", "right_lane_reward", "high_speed_reward", "on_road_reward"))


def _fill_merge(record, given: dict, env, number: dict) -> tuple[str, ...]:
    record["main_lane"], record["side_lane"] = number["a", "b", 0], number["j", "k", 0]
    record["other_lane"] = number["b", "c", 2]
    record["obstacle_x"], record["obstacle_y"] = env.road.objects[0].position
    record["end_x"] = 370
    record["normalize_reward"] = True
    record["reward_low"] = given["collision_reward"] + given["merging_speed_reward"]
    record["reward_high"] = given["high_speed_reward"] + given["right_lane_reward"]
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]
    return _set_weights(
        record,
        given,
        ("collision_reward", "right_lane_reward", "high_speed_reward", "lane_change_reward", "merging_speed_reward"),
    )


def _fill_two_way(record, given: dict, env, number: dict) -> tuple[str, ...]:
    record["main_lane"], record["side_lane"] = number["a", "b", 0], number["b", "a", 0]
    return _set_weights(record, given, ("high_speed_reward", "left_lane_reward"))


def _fill_exit(record, given: dict, env, number: dict) -> tuple[str, ...]:
    record["traffic"] = given["vehicles_count"]
    record["ego_spacing"], record["traffic_spacing"] = given["ego_spacing"], 1 / given["vehicles_density"]
    record["main_lane"] = number["0", "1", 0]
    record["lanes_factor"] = np.exp(-5 / 40 * given["lanes_count"])
    record["goal_lane"] = number["1", "2", given["lanes_count"]]
    record["other_goal_lane"] = number["2", "exit", 0]
    record["normalize_reward"] = given["normalize_reward"]
    record["reward_low"], record["reward_high"] = given["collision_reward"], given["goal_reward"]
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]
    return _set_weights(record, given, ("collision_reward", "goal_reward", "high_speed_reward", "right_lane_reward"))


def _fill_roundabout(record, given: dict, env, number: dict) -> tuple[str, ...]:
    record["main_lane"] = number["ser", "ses", 0]
    record["side_lane"], record["other_lane"] = number["we", "sx", 0], number["eer", "ees", 0]
    asked = given["incoming_vehicle_destination"]
    record["destination"] = -1 if asked is None else range(3)[asked]
    record["normalize_reward"] = given["normalize_reward"]
    record["reward_low"], record["reward_high"] = given["collision_reward"], given["high_speed_reward"]
    return _set_weights(
        record, given, ("collision_reward", "high_speed_reward", "lane_change_reward", "on_road_reward")
    )


def _fill_intersection(record, given: dict, env, number: dict) -> tuple[str, ...]:
    for name, value in AT_INTERSECTIONS.items():
        record[name.lower()] = value
    record["main_lane"] = number["o0", "ir0", 0]
    record["traffic"] = given["initial_vehicle_count"]
    record["offroad_terminal"] = given["offroad_terminal"]
    record["normalize_reward"] = given["normalize_reward"]
    record["reward_low"], record["reward_high"] = given["collision_reward"], given["arrived_reward"]
    record["speed_low"], record["speed_high"] = given["reward_speed_range"]
    return _set_weights(record, given, ("collision_reward", "high_speed_reward", "arrived_reward", "on_road_reward"))


def _flow(dt: float, given: dict, env, number: dict) -> np.ndarray:
    flow = np.zeros(1, FLOW)
    entries = [number[f"o{k}", f"ir{k}", 0] for k in range(4)]
    flow["arm"] = entries[1] - entries[0]
    assert entries == list(range(entries[0], entries[3] + 1, entries[1] - entries[0]))
    asked = given["destination"]
    if asked and asked not in _ARMS:
        raise Unsupported(f"destination = {asked!r}", f"None or one of {', '.join(_ARMS)}")
    flow["destination"] = _ARMS.index(asked) if asked else -1
    flow["warm_up_frames"] = 3 * given["simulation_frequency"]
    flow["regulation_period"] = int(1 / dt / env.road.REGULATION_FREQUENCY)
    flow["spawn_probability"] = given["spawn_probability"]
    return flow


_FILL_SCENE = {
    HIGHWAY: _fill_highway,
    MERGE: _fill_merge,
    TWO_WAY: _fill_two_way,
    EXIT: _fill_exit,
    ROUNDABOUT: _fill_roundabout,
    INTERSECTION: _fill_intersection,
}
