"""Hostile drivers on highway-env: whatever they do, the shielded ego is never to blame."""

import numpy as np
import pytest

from rss_shield import make
from rss_shield.envs.highway.hostile import HOSTILE, HostileVehicle

CROWD = {"vehicles_count": 6, "vehicles_density": 1.5, "lanes_count": 3, "duration": 20}
FASTER = 3


def play(driver, seed, policy, shield="override"):
    env = make("highway-fast-v0", shield=shield, config=CROWD | {"other_vehicles_type": HOSTILE[driver]})
    env.reset(seed=seed)
    assert sum(isinstance(v, HostileVehicle) for v in env.unwrapped.road.vehicles) == 6
    rng = np.random.default_rng(seed)
    ended = False
    while not ended:
        *_, terminated, truncated, info = env.step(FASTER if policy == "faster" else int(rng.integers(5)))
        ended = terminated or truncated
    return info["blame"], info["episode_broken_duties"]


@pytest.mark.parametrize("driver", HOSTILE)
def test_the_shielded_ego_is_never_to_blame(driver):
    played = [play(driver, seed, policy) for seed in (11, 12) for policy in ("faster", "random")]
    assert {blame for blame, _ in played} <= {"", "other", "inherited"}
    assert sum(broken for _, broken in played) == 0


def test_they_are_hostile_indeed():
    contacts = [driver for driver in HOSTILE if play(driver, 11, "faster", "monitor")[0] != ""]
    assert len(contacts) >= 7
