"""highway-env's own driver (IDM and MOBIL) as the ego, with a shield that watches it or overrides it."""

from functools import partial
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from highway_env.vehicle.behavior import IDMVehicle

from rss_shield.envs.highway.wrapper import ShieldWrapper
from rss_shield.envs.stock import make_stock

WANTED_SPEED = 30.0  # [m/s]


class IdmEgo(gym.Wrapper):
    """highway-env's own driver takes the place of the ego; actions change nothing."""

    def reset(self, *, seed=None, options=None):
        observation, info = self.env.reset(seed=seed, options=options)
        env: Any = self.env.unwrapped
        stock = env.vehicle
        driver = IDMVehicle.create_from(stock)
        driver.route, driver.target_speed = stock.route, WANTED_SPEED
        driver.target_speeds, driver.speed_index = stock.target_speeds, stock.speed_index  # some rewards ask for them
        env.road.vehicles[env.road.vehicles.index(stock)] = driver
        env.controlled_vehicles = [driver]
        env.action_type.controlled_vehicle = driver
        env.observation_type.observer_vehicle = driver
        return observation, info


def make_idm(env_id: str, shield: str = "monitor", config: dict | None = None, **options: Any) -> gym.Env:
    """An environment that drives itself.

    Args:
      env_id: as for `rss_shield.make`.
      shield: "monitor" or "override".
      config: as there; observed are always `Kinematics`, because others may ask for what only an agent's car has.
      options: of `ShieldWrapper`.
    """
    seen = {**(config or {}), "observation": {"type": "Kinematics"}}
    return ShieldWrapper(IdmEgo(make_stock(env_id, config=seen)), mode=shield, **options)


def make_idm_vec(env_id: str, num_envs: int, **options: Any) -> SyncVectorEnv:
    """Several of them side by side without autoreset; options as in `make_idm`."""
    return SyncVectorEnv([partial(make_idm, env_id, **options)] * num_envs, autoreset_mode=AutoresetMode.DISABLED)
