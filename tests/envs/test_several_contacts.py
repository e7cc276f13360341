"""Several contacts at once: the verdict that weighs most against the ego counts, on both backends."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from rss_shield import make, make_vec

CONFIG = {"policy_frequency": 5, "vehicles_count": 8, "lanes_count": 2, "duration": 25}
ENV, FASTER = "highway-fast-v0", 3


def frames_until_contact(seed):
    env = make(ENV, shield="monitor", config=CONFIG)
    env.reset(seed=seed)
    for frame in range(25 * 5):
        *_, terminated, truncated, info = env.step(FASTER)
        if info["blame"]:
            return frame, info["blame"], info["blame_evidence"]["partner"]
        if terminated or truncated:
            break
    return None


def accidents():
    """Episodes in which the ego drives into somebody, by its own fault: (seed, frame, partner)."""
    found = []
    for seed in range(20):
        contact = frames_until_contact(seed)
        if contact and contact[1] == "ego":
            found.append((seed, contact[0], contact[2]))
        if len(found) == 3:
            break
    return found


@pytest.fixture(scope="module")
def cases():
    found = accidents()
    assert len(found) == 3
    return found


def test_in_highway_env(cases):
    for seed, frame, partner in cases:
        env = make(ENV, shield="monitor", config=CONFIG)
        env.reset(seed=seed)
        for _ in range(frame):
            env.step(FASTER)
        road = env.unwrapped.road
        ego = env.unwrapped.vehicle
        late = next(k for k, v in reversed(list(enumerate(road.vehicles))) if k != partner and v is not ego)
        road.vehicles[late].position = ego.position + np.array([-3.0, 1.0])  # out of nowhere, into the ego
        *_, info = env.step(FASTER)
        assert (info["blame"], info["blame_evidence"]["partner"]) == ("ego", partner)


def test_in_the_engine(cases):
    for seed, frame, partner in cases:
        env = make_vec(ENV, 1, "monitor", config=CONFIG, autoreset_mode=AutoresetMode.DISABLED)
        env.reset(seed=seed)
        for _ in range(frame):
            env.step(np.array([FASTER]))
        cars, ego = env.engine.batch.cars[0], env.engine.batch.cars[0, 0]
        late = next(k for k in range(8, 0, -1) if k != partner)
        cars["x"][late], cars["y"][late] = ego["x"] - 3.0, ego["y"] + 1.0
        order = env.engine.batch.order[0]
        order[:] = order[np.argsort(cars["x"][order], kind="stable")]
        *_, info = env.step(np.array([FASTER]))
        evidence = info["blame_evidence"]
        assert (info["blame"][0], int(evidence["partner"][0])) == ("ego", partner)
