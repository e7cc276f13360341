"""highway-env's environments as they are, except that every episode ends and nothing is left behind in the process."""

import importlib
import warnings
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.wrappers import TimeLimit
from highway_env.envs.common.abstract import AbstractEnv, MultiAgentWrapper
from highway_env.envs.common.action import MultiAgentAction
from highway_env.envs.intersection_env import IntersectionEnv
from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.utils import class_from_path
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from rss_shield.envs.arguments import whole
from rss_shield.envs.known import check_known, warn

LONGEST_EPISODE = 100  # decisions, where highway-env sets no limit
LOWEST_FREQUENCY = 5  # of simulation where roads cross [Hz]
HIGHEST_FREQUENCY = 10_000  # of simulation [Hz]; a decision of highway-env then takes seconds
# what `IntersectionEnv` writes into the class of its traffic, and what `IDMVehicle` is defined with
AT_INTERSECTIONS = {"DISTANCE_WANTED": 7.0, "COMFORT_ACC_MAX": 6.0, "COMFORT_ACC_MIN": -3.0}
ELSEWHERE = {"DISTANCE_WANTED": 10.0, "COMFORT_ACC_MAX": 3.0, "COMFORT_ACC_MIN": -5.0}


def make_stock(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with a `TimeLimit` where there is no limit, and with drivers of its own (`Upkeep`).

    highway-env ends a merge when the ego is past it. An ego that has stopped behind a wreck never is.
    That there is a later version of an environment asked for by its version is not said, once for each of a batch; nor
    which version is made where none is asked for.

    Raises:
      ValueError: an argument that the environment does not have, a bad `max_episode_steps`, a configuration that it
        cannot run with, or more decisions than frames. Of a key that it does not know there is a warning.
    """
    if kwargs.get("max_episode_steps") is not None:
        kwargs["max_episode_steps"] = whole("max_episode_steps", kwargs["max_episode_steps"], 1)
    with suppress(Exception):  # `gymnasium.make` complains; a class that exists before is left as it is
        class_from_path(kwargs["config"]["other_vehicles_type"])
    with drivers_unchanged(), _rewards_of_any_action():
        if kwargs.get("config") is not None:
            check_given(env_id, kwargs["config"])
        env = _made(env_id, kwargs)
        unwrapped: Any = env.unwrapped
        if not isinstance(unwrapped, AbstractEnv):
            return env
        check_frequencies(unwrapped.config)
        Upkeep(unwrapped)
    limited = env.spec is not None and env.spec.max_episode_steps is not None
    return env if limited or _has_duration(unwrapped) else TimeLimit(env, LONGEST_EPISODE)


def check_given(env_id: str, config: Any) -> None:
    """Refuse a configuration that an environment of highway-env's kind cannot run with, and warn of unknown keys.

    Of others, and where only making it tells what it is, nothing is said.

    Raises:
      ValueError: see `envs.known.check_known`.
    """
    spec = gym.registry.get(env_id) if isinstance(env_id, str) else None
    creator = spec.entry_point if spec is not None else None
    kind = load_env_creator(creator) if isinstance(creator, str) else creator
    if isinstance(kind, type) and issubclass(kind, AbstractEnv):
        check_known(env_id, kind, config, partial(reward_names, env_id), warn)


def check_reset(env: Any, config: Any) -> None:
    """Refuse what a reset cannot begin an episode with: what an environment has, but for what replaces it.

    Raises:
      ValueError: see `envs.known.check_known` and `check_frequencies`.
    """
    _check_known_to(env, config)
    check_frequencies(env.config | dict(config or {}))


def _check_known_to(env: Any, config: Any) -> None:
    if config is not None:
        name = env.spec.id if env.spec is not None else type(env).__name__
        check_known(name, type(env), config, partial(reward_names, name), warn)


def reward_names(env_id: str) -> set[str]:
    """Parts of the reward of an environment: their weights can be configured where the default is nothing."""
    env = make_stock(env_id)
    env.reset(seed=0)
    info = env.step(env.action_space.sample())[4]
    env.close()
    return set(info.get("rewards", ()))


def _import_module_of(env_id: str) -> None:
    """Of "module:my-road-v0" the module, which registers it.

    Raises:
      ValueError: it is not there, or fails when it is imported.
    """
    module, colon, _ = str(env_id).partition(":")
    if not colon:
        return
    try:
        importlib.import_module(module)
    except Exception as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name and module.startswith(error.name)
        said = f"no module {error.name!r} here, nor installed" if missing else f"{type(error).__name__}: {error}"  # type: ignore[attr-defined]
        raise ValueError(f"env_id = {env_id!r}: {module} cannot be imported: {said}") from None


def _made(env_id: str, arguments: dict[str, Any]) -> gym.Env:
    _import_module_of(env_id)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*is out of date", DeprecationWarning)
        warnings.filterwarnings("ignore", ".*Using the latest versioned environment", UserWarning)
        try:
            return gym.make(env_id, **arguments)
        except TypeError as error:
            unknown = [name for name in arguments if f"unexpected keyword argument '{name}'" in str(error)]
            if not unknown:
                raise
            given = ", ".join(f"{name} = {arguments[name]!r}" for name in unknown)
            raise ValueError(f"{given}: unknown here; expected config, render_mode or max_episode_steps") from None
        except ZeroDivisionError:  # at an intersection, who yields is decided twice a second
            frequency = (arguments.get("config") or {}).get("simulation_frequency")
            if frequency is None or frequency >= LOWEST_FREQUENCY:
                raise
            raise ValueError(
                f"config simulation_frequency = {frequency}: expected >= {LOWEST_FREQUENCY} where roads cross"
            ) from None


@contextmanager
def _rewards_of_any_action():
    """Inside, merges and roundabouts can be made with continuous actions: their rewards ask which meta-action it is."""
    saved = {kind: vars(kind)["_rewards"] for kind in (MergeEnv, RoundaboutEnv)}

    def tolerant(kind):
        return lambda env, action: saved[kind](env, _meta(action))

    for kind in saved:
        kind._rewards = tolerant(kind)
    try:
        yield
    finally:
        for kind, rewards in saved.items():
            kind._rewards = rewards


def _meta(action: Any) -> Any:
    """A meta-action, or None for several numbers, which are none."""
    return None if np.size(action) > 1 else action


def check_frequencies(config: dict) -> None:
    """Does every decision last for a frame at least? Else nobody ever moves.

    Raises:
      ValueError: it does not, or one of the two is no frequency.
    """
    frames, decisions = config["simulation_frequency"], config["policy_frequency"]
    if not 0 < frames <= HIGHEST_FREQUENCY:
        raise ValueError(f"simulation_frequency = {frames!r}: expected a number > 0 and <= {HIGHEST_FREQUENCY} [Hz]")
    if not 0 < decisions <= frames:
        raise ValueError(
            f"policy_frequency = {decisions!r} with simulation_frequency = {frames!r}: "
            f"expected 0 < policy_frequency <= {frames:g} Hz, because a decision without a frame moves nobody"
        )


@contextmanager
def drivers_unchanged():
    """Inside, IDM drivers are as highway-env defines them; whatever is written into classes of vehicles is undone.

    An `IntersectionEnv` rewrites the class of its traffic, and so all traffic in the process.
    """
    saved = {kind: _own(kind) for kind in _kinds(Vehicle)}
    if _own(IDMVehicle) == AT_INTERSECTIONS:  # an intersection that was made elsewhere has left them behind
        _write(IDMVehicle, ELSEWHERE)
    try:
        yield
    finally:
        for kind, values in saved.items():
            _write(kind, values)


def _kinds(kind: type) -> set[type]:
    """A class and everything derived from it."""
    return {kind}.union(*map(_kinds, kind.__subclasses__()))


def _own(kind: type) -> dict[str, float]:
    return {name: vars(kind)[name] for name in ELSEWHERE if name in vars(kind)}


def _write(kind: type, values: dict[str, float]) -> None:
    for name in _own(kind):
        if name not in values:
            delattr(kind, name)
    for name, value in values.items():
        setattr(kind, name, value)


def _has_duration(env: Any) -> bool:
    """Does an environment end by itself when `duration` is over?"""
    return "duration" in type(env).default_config()


def hands_out_rewards(env: gym.Env) -> bool:
    """Does highway-env give each agent a reward of its own, in place of one for all?"""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, MultiAgentWrapper):
            return True
        env = env.env
    return False


class Upkeep:
    """What an environment needs besides highway-env's own code.

    Its traffic keeps the parameters that it started with, whatever other environments do to classes. Where highway-env
    does not look at `duration`, it ends the episode all the same; where it does not look at `controlled_vehicles`,
    several agents take the places of the first cars that drive the ego's way. These methods lie in the environment's
    own `__dict__`, so a deep copy or a pickle carries its own along.
    """

    def __init__(self, env: Any) -> None:
        self.env = env
        self._settle()
        env.configure, env._reset, env.change_vehicles = self.configure, self.reset, self.change_vehicles
        if isinstance(env, IntersectionEnv):
            env._spawn_vehicle = self.spawn_vehicle
        if not _has_duration(env):
            env._is_truncated = self.is_truncated
        if isinstance(env, (MergeEnv, RoundaboutEnv)):
            env._rewards = self.rewards
        if self._missing_agents() > 0:
            env.reset()

    # -- called by highway-env

    def configure(self, config: Any) -> None:
        """By hand, or at a reset: what holds for the configuration of `make` holds for this one."""
        _check_known_to(self.env, config)
        type(self.env).configure(self.env, config)

    def reset(self) -> None:
        check_frequencies(self.env.config)
        with drivers_unchanged():
            type(self.env)._reset(self.env)
            self._settle()
        self._seat_agents()

    def spawn_vehicle(self, *args, **kwargs):
        vehicle = type(self.env)._spawn_vehicle(self.env, *args, **kwargs)
        self._keep(vehicle)
        return vehicle

    def change_vehicles(self, vehicle_class_path: str):
        changed = type(self.env).change_vehicles(self.env, vehicle_class_path)
        for vehicle in changed.road.vehicles:
            self._keep(vehicle)
        return changed

    def is_truncated(self) -> bool:
        overdue = self.env.time >= self.env.config.get("duration", float("inf"))
        return bool(overdue or type(self.env)._is_truncated(self.env))

    def rewards(self, action: Any) -> dict[str, float]:
        return type(self.env)._rewards(self.env, _meta(action))

    # -- agents

    def _missing_agents(self) -> int:
        """How many more agents are asked for than highway-env has put on the road."""
        env = self.env
        if not isinstance(env.action_type, MultiAgentAction):
            return 0
        return env.config.get("controlled_vehicles", 1) - len(env.controlled_vehicles)

    def _seat_agents(self) -> None:
        env, missing = self.env, self._missing_agents()
        if missing <= 0:
            return
        vehicles, ego = env.road.vehicles, env.vehicle
        # rewards make no sense for oncoming cars
        places = [i for i, v in enumerate(vehicles) if isinstance(v, IDMVehicle) and v.direction @ ego.direction > 0.0]
        if missing > len(places):
            most = len(env.controlled_vehicles) + len(places)
            raise ValueError(f"controlled_vehicles = {env.config['controlled_vehicles']}: expected at most {most}")
        for i in places[:missing]:
            car = vehicles[i]
            agent = env.action_type.vehicle_class(env.road, car.position, car.heading, car.speed)
            agent.target_lane_index, agent.route = car.target_lane_index, car.route
            vehicles[i] = agent
            env.controlled_vehicles = [*env.controlled_vehicles, agent]

    # -- parameters of drivers

    def _settle(self) -> None:
        """Take them from the class, which the environment has just written them into."""
        self.kind = class_from_path(self.env.config["other_vehicles_type"])
        self.drivers = {name: getattr(self.kind, name) for name in ELSEWHERE if hasattr(self.kind, name)}
        for vehicle in self.env.road.vehicles:
            self._keep(vehicle)

    def _keep(self, vehicle: Any) -> None:
        """Give a vehicle what it would inherit from the class now."""
        if not isinstance(vehicle, self.kind):
            return
        kinds = type(vehicle).__mro__
        for name, value in self.drivers.items():
            if not any(name in vars(kind) for kind in kinds[: kinds.index(self.kind)]):
                vars(vehicle).setdefault(name, value)
