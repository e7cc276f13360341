"""What works on every environment of highway-env, found out by trying: behind the shield there, and in the engine."""

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import gymnasium as gym
import highway_env  # noqa: F401  registers the environments
import numpy as np

from rss_shield.envs.make import make
from rss_shield.envs.make_vec import make_vec
from rss_shield.envs.stock import make_stock

DEFAULT = "as it is"
ACTIONS: dict[str, dict[str, Any]] = {  # how an agent may act: configuration of its action
    "meta-actions": {"type": "DiscreteMetaAction"},
    "continuous": {"type": "ContinuousAction"},
    "steering only": {"type": "ContinuousAction", "longitudinal": False},
    "throttle only": {"type": "ContinuousAction", "lateral": False},
    "discrete": {"type": "DiscreteAction"},
    "tyres that slip": {"type": "ContinuousAction", "dynamical": True},
}
AGENTS = "two agents"
SLIPPING, HERTZ = "tyres that slip", 60  # tried with frames as short as they need along lanes
OBSERVATIONS: dict[str, dict[str, Any]] = {
    "Kinematics": {"type": "Kinematics"},
    "TimeToCollision": {"type": "TimeToCollision"},
    "OccupancyGrid": {"type": "OccupancyGrid"},
    "LidarObservation": {"type": "LidarObservation"},
    "TupleObservation": {"type": "TupleObservation", "observation_configs": [{"type": "Kinematics"}]},
}


class Row(NamedTuple):
    """One environment: name of what was tried -> "" if it works, else the reason why not."""

    env_id: str
    shield: dict[str, str]  # on highway-env: `DEFAULT`, the names of `ACTIONS`, `AGENTS`
    engine: dict[str, str]  # likewise
    observations: dict[str, str]  # in the engine, the names of `OBSERVATIONS`


def environments() -> list[str]:
    """Every environment that highway-env registers, in the order of the alphabet."""
    return sorted(spec.id for spec in gym.registry.values() if str(spec.entry_point).startswith("highway_env."))


def probe(env_id: str) -> Row:
    """Try an environment. Nothing is listed anywhere: what is said here is what happens."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        configs = _configs(env_id)
        seen = {name: {"observation": config} for name, config in OBSERVATIONS.items()}
        return Row(
            env_id,
            {name: _tried(_step, env_id, config) for name, config in configs.items()},
            {name: _tried(_build, env_id, config) for name, config in configs.items()},
            {name: _tried(_build, env_id, config) for name, config in seen.items()},
        )


def _configs(env_id: str) -> dict[str, Mapping[str, Any] | None]:
    """Configurations to try; None = none is passed."""
    base: Any = make_stock(env_id).unwrapped
    default = base.config
    agent = default["action"].get("action_config", default["action"])
    # times to collision are read off meta-actions only
    changes = {"observation": {"type": "Kinematics"}} if default["observation"]["type"] == "TimeToCollision" else {}
    one: dict[str, dict[str, Any]] = {}
    for name, action in ACTIONS.items():
        kept = agent if agent["type"] == action["type"] == "DiscreteMetaAction" else {}  # its target speeds
        one[name] = {"action": {**kept, **action}} | ({} if name == "meta-actions" else changes)
        one[name] |= {"simulation_frequency": HERTZ} if name == SLIPPING else {}
        one[name] |= {"controlled_vehicles": 1} if default.get("controlled_vehicles", 1) > 1 else {}
    several = {
        "controlled_vehicles": 2,
        "action": {"type": "MultiAgentAction", "action_config": dict(agent)},
        "observation": {"type": "MultiAgentObservation", "observation_config": {"type": "Kinematics"}},
    }
    return {DEFAULT: None, **one, AGENTS: several}


def _step(env_id: str, config: Mapping[str, Any] | None) -> None:
    """One decision behind the shield on highway-env."""
    given: dict[str, Any] = {} if config is None else {"config": dict(config)}
    with _drawn_alike():
        _decide(env_id, given)


@contextmanager
def _drawn_alike() -> Iterator[None]:
    """Some environments draw from numpy's own generator, which no seed of theirs decides: whom a ring has room for."""
    before = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def _decide(env_id: str, given: dict[str, Any]) -> None:
    try:
        bare = make_stock(env_id, **given)
        bare.action_space.seed(0)
        bare.reset(seed=0)
        bare.step(bare.action_space.sample())
    except Exception as error:
        raise ValueError(f"without a shield highway-env says {_said(error)}") from None
    env = make(env_id, **given)
    env.action_space.seed(0)
    env.reset(seed=0)
    env.step(env.action_space.sample())


def _build(env_id: str, config: Mapping[str, Any] | None) -> None:
    """The engine, as far as it says what it does not support."""
    make_vec(env_id, 1, config=None if config is None else dict(config)).close()


def _tried(what: Callable[..., None], env_id: str, config: Mapping[str, Any] | None) -> str:
    try:
        what(env_id, config)
    except Exception as error:  # whatever the reason, it is told
        return shortened(_said(error), env_id)
    return ""


def shortened(reason: str, env_id: str) -> str:
    """A reason without what the row says anyhow."""
    if reason.startswith("the fast engine does not support env_id"):
        return "the engine does not have it"
    return re.sub(r"config = \{.*\}", "config", reason).replace(f" in {env_id}", "")


def _said(error: Exception) -> str:
    text = str(error).split("; expected")[0].split(": expected config")[0].replace("\n", " ")
    return text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}"


def refused(env_id: str, config: Mapping[str, Any] | None = None) -> str:
    """Why an environment cannot be driven behind the shield on highway-env, "" if it can."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _tried(_step, env_id, config or None)
