"""Engine states in real highway-env environments and back: for rendering, and for checking."""

import numpy as np
from highway_env.envs.common.action import MultiAgentAction
from highway_env.envs.common.observation import MultiAgentObservation
from highway_env.road.lane import AbstractLane
from highway_env.road.regulation import RegulatedRoad
from highway_env.utils import class_from_path
from highway_env.vehicle.behavior import IDMVehicle, LinearVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.fast.draws import generator_state, load_generator
from rss_shield.envs.fast.state import CAR, DIRECT, LINEAR_CAR, META, OBSTACLE, TRAFFIC
from rss_shield.envs.roads.hostile import NO_VICE
from rss_shield.envs.roads.network import CAR_LENGTH, CAR_WIDTH, Network

_GAINS = tuple(name for name in LINEAR_CAR.names or () if name not in (CAR.names or ()))


def show(env, cars: np.ndarray, network: Network, episode: np.ndarray | None = None) -> None:
    """Put road users into a highway-env environment of the same configuration.

    Afterwards it renders, steps and draws random numbers like the engine's environment.

    Args:
      env: the unwrapped stock environment, after a reset.
      cars: `[N]` CAR, for instance one row of a `Log`; trailing empty rows are ignored.
      network: of the engine's scenario.
      episode: EPISODE record; None keeps clock and generator of `env` and takes car 0 for the ego.
    """
    road = env.road
    indices = list(road.network.lanes_dict())
    cars = cars[cars["length"] > 0]
    obstacles = iter(road.objects)
    road.vehicles = []
    for car in cars:
        if car["kind"] == OBSTACLE:
            obstacle = next(obstacles)
            obstacle.position, obstacle.crashed = np.array([car["x"], car["y"]]), bool(car["crashed"])
        else:
            road.vehicles.append(_vehicle(env, car, indices, network))
    ego = 0 if episode is None else int(episode["ego"])
    agents = [road.vehicles[ego]]
    if isinstance(env.action_type, MultiAgentAction):
        own = [vehicle for car, vehicle in zip(cars, road.vehicles, strict=False) if car["kind"] in (META, DIRECT)]
        agents = own or agents
        for kind, vehicle in zip(env.action_type.agents_action_types, agents, strict=True):
            kind.controlled_vehicle = vehicle
    if isinstance(env.observation_type, MultiAgentObservation):
        for kind, vehicle in zip(env.observation_type.agents_observation_types, agents, strict=True):
            kind.observer_vehicle = vehicle
    env.controlled_vehicles = agents
    env.observation_type.observer_vehicle = env.action_type.controlled_vehicle = agents[0]
    if episode is not None:
        env.time = float(episode["time"])
        env.steps = int(episode["steps"]) * int(env.config["simulation_frequency"] // env.config["policy_frequency"])
        road.np_random.bit_generator.state = generator_state(episode)
        if isinstance(road, RegulatedRoad):
            road.steps = int(episode["road_frames"])


def _vehicle(env, car, indices, network: Network):
    """One highway-env vehicle."""
    pose = (env.road, [car["x"], car["y"]], float(car["heading"]), float(car["speed"]))
    if car["kind"] == TRAFFIC:
        vehicle = class_from_path(env.config["other_vehicles_type"])(*pose)
        if car["vice"] != NO_VICE:
            vehicle.vice, vehicle.heading = int(car["vice"]), float(car["heading"])
        if issubclass(type(vehicle), LinearVehicle):
            gains = [float(car[name]) for name in _GAINS]
            vehicle.ACCELERATION_PARAMETERS, vehicle.STEERING_PARAMETERS = gains[:3], gains[3:]
        vehicle.timer, vehicle.DELTA = float(car["timer"]), float(car["delta"])
        vehicle.enable_lane_change = bool(car["changes_lane"])
        if car["yields"]:
            vehicle.is_yielding, vehicle.yield_timer, vehicle.color = True, 0, RegulatedRoad.YIELDING_COLOR
    elif car["kind"] == META:
        vehicle = env.action_type.vehicle_class(*pose)
        vehicle.speed_index = int(car["speed_index"])
    else:
        vehicle = Vehicle(*pose)
    if car["kind"] != DIRECT:
        vehicle.target_lane_index = indices[car["target_lane"]]
        vehicle.target_speed = float(car["target_speed"])
        vehicle.route = _route(car, indices, network)
    vehicle.lane_index = indices[car["lane"]]
    vehicle.lane = env.road.network.get_lane(vehicle.lane_index)
    vehicle.action = {"steering": float(car["steering"]), "acceleration": float(car["acceleration"])}
    vehicle.crashed, vehicle.check_collisions = bool(car["crashed"]), bool(car["checks"])
    vehicle.impact = np.array([car["impact_x"], car["impact_y"]]) if car["hit"] else None
    return vehicle


def _route(car, indices, network: Network):
    """What is left of a car's route, as highway-env writes it."""
    if car["route"] < 0:
        return None
    steps = zip(network.route_roads[car["route"]], network.route_lanes[car["route"]], strict=True)
    left = [(road, lane) for road, lane in steps if road >= 0][car["route_step"] :]
    firsts = network.roads["first"]
    return [(*indices[firsts[road]][:2], None if lane < 0 else int(lane)) for road, lane in left]


def read(env, cars: np.ndarray, episode: np.ndarray, order: np.ndarray, network: Network) -> None:
    """Take over the state of a highway-env environment of the same configuration into the engine.

    Args:
      env: the unwrapped stock environment.
      cars: `[N]` CAR, overwritten.
      episode: EPISODE, changed.
      order: `[N]`, overwritten.
      network: of the engine's scenario.

    Raises:
      ValueError: a car follows a route that none plans here or is not of the stock size, or there are more road users
        than room.
    """
    road = env.road
    users = [*road.vehicles, *road.objects]
    if len(users) > len(cars):
        raise ValueError(f"{len(users)} road users; expected at most {len(cars)}")
    numbers = {index: i for i, index in enumerate(road.network.lanes_dict())}
    cars[:] = np.zeros(1, cars.dtype)
    for car, user in zip(cars, users, strict=False):
        _read_user(car, user, numbers, network)
    order[:] = np.argsort([u.position[0] for u in users] + [np.inf] * (len(cars) - len(users)), kind="stable")
    episode["cars"], episode["vehicles"] = len(users), len(road.vehicles)
    episode["ego"], episode["ended"] = road.vehicles.index(env.vehicle), False
    episode["time"] = env.time
    frames = int(env.config["simulation_frequency"] // env.config["policy_frequency"])
    episode["steps"] = env.steps // frames
    ranges = getattr(env.observation_type, "features_range", None) or {}
    if "y" in ranges:
        episode["observed_lanes"] = round(ranges["y"][1] / AbstractLane.DEFAULT_WIDTH)
    episode["road_frames"] = getattr(road, "steps", 0)
    load_generator(episode, road.np_random.bit_generator)


def _read_user(car, user, numbers, network: Network) -> None:
    car["x"], car["y"] = user.position
    car["heading"], car["speed"] = user.heading, user.speed
    car["cos"], car["sin"] = user.direction
    car["length"], car["width"] = user.LENGTH, user.WIDTH
    car["lane"] = car["target_lane"] = numbers[user.lane_index]
    car["crashed"], car["checks"], car["route"] = user.crashed, user.check_collisions, -1
    if not isinstance(user, Vehicle):
        car["kind"] = OBSTACLE
        return
    if (user.LENGTH, user.WIDTH) != (CAR_LENGTH, CAR_WIDTH):
        raise ValueError(
            f"vehicle of {user.LENGTH:g} m x {user.WIDTH:g} m: expected {CAR_LENGTH:g} m x {CAR_WIDTH:g} m, the size "
            "of every vehicle in the engine"
        )
    car["kind"] = DIRECT
    car["steering"], car["acceleration"] = user.action["steering"], user.action["acceleration"]
    car["hit"] = user.impact is not None
    if user.impact is not None:
        car["impact_x"], car["impact_y"] = user.impact
    if hasattr(user, "target_lane_index"):
        car["kind"] = META
        if user.route is not None:
            car["route"], car["route_step"] = _find_route(user.route, numbers, network)
        car["target_lane"], car["target_speed"] = numbers[user.target_lane_index], user.target_speed
        car["speed_index"] = getattr(user, "speed_index", 0)
    if isinstance(user, IDMVehicle):
        car["kind"] = TRAFFIC
        car["timer"], car["delta"], car["changes_lane"] = user.timer, user.DELTA, user.enable_lane_change
        car["yields"] = getattr(user, "is_yielding", False)
        car["vice"] = getattr(user, "vice", NO_VICE)
    if isinstance(user, LinearVehicle):
        for name, gain in zip(_GAINS, [*user.ACCELERATION_PARAMETERS, *user.STEERING_PARAMETERS], strict=True):
            car[name] = gain


def _find_route(route, numbers, network: Network) -> tuple[int, int]:
    """Row of the route tables that ends like a route of highway-env, and how many of its steps lie behind."""
    roads = [int(network.lanes["road"][numbers[origin, end, lane or 0]]) for origin, end, lane in route]
    ids = [-1 if lane is None else lane for _, _, lane in route]
    for row, (planned, planned_ids) in enumerate(zip(network.route_roads, network.route_lanes, strict=True)):
        length = int((planned >= 0).sum())
        behind = length - len(route)
        if behind >= 0 and (*planned[behind:length],) == (*roads,) and (*planned_ids[behind:length],) == (*ids,):
            return row, behind
    raise ValueError(f"a car follows the route {route}; expected one that a car plans in this environment")
