"""The roads as arrays."""

import numba
import numpy as np
import pytest

import rss_shield
from rss_shield.envs.roads.network import compile_network, distance, is_far, local_coordinates

_is_far = numba.njit(lambda lane, x, y, across, along: is_far(lane, x, y, across, along))
_distance = numba.njit(lambda lane, s, lateral: distance(lane, s, lateral))


@pytest.mark.slow
@pytest.mark.parametrize("env_id", ["intersection-v0", "roundabout-v0", "merge-v0"])
def test_who_is_far_from_a_lane_is_so_in_its_coordinates(env_id):
    env = rss_shield.make(env_id)
    env.reset(seed=0)
    lanes = compile_network(env.unwrapped.road.network, False).lanes
    rng = np.random.default_rng(0)
    found = far = 0
    for lane in lanes:
        low, high = (lane["left"] - 30, lane["low"] - 30), (lane["right"] + 30, lane["high"] + 30)
        for x, y in rng.uniform(low, high, (300, 2)):
            across, along = rng.uniform(0.0, 8.0, 2)
            s, lateral = local_coordinates(lane, x, y)
            near = abs(lateral) <= across and -along <= s <= lane["length"] + along
            assert not (near and _is_far(lane, x, y, across, along))
            assert not (_distance(lane, s, lateral) <= across and _is_far(lane, x, y, across, 0.0))
            far += not near
            found += _is_far(lane, x, y, across, along)
    assert found > 0.8 * far
    env.close()
