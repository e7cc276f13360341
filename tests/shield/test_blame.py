"""Def. 27 among the reckless: every contact has a culprit, and it is never the shielded ego.

The others break down, brake at 12 m/s^2, never brake, reverse, drive sideways into the ego at 4 m/s, swerve by
0.3 rad, stand as obstacles or do anything at all; a fifth starts at any angle.
"""

import collections

import pytest
from adversary import play, world

from rss_shield.shield.verdicts import VERDICTS

WORLDS = [(dt, bare) for dt in (1 / 15, 1 / 5) for bare in (False, True)]


def verdicts(episodes):
    return collections.Counter(VERDICTS[v] for v in episodes["verdict"][episodes["contact"] >= 0])


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
@pytest.mark.parametrize("start_safe", [True, False], ids=["safe at first sight", "in danger at first sight"])
def test_the_shielded_ego_is_never_to_blame_for_what_the_reckless_do(dt, start_safe):
    episodes = play(4000, world(dt=dt, frames=150, lawful=False, start_safe=start_safe), seed=2)
    counted = verdicts(episodes)
    assert set(counted) <= {"other", "inherited"}
    assert counted["other"] > 100
    assert (counted["inherited"] > 0) != start_safe
    assert episodes["broken"].sum() == 0


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
def test_an_unshielded_ego_among_the_reckless_always_leaves_a_culprit(dt):
    counted = verdicts(play(4000, world(dt=dt, frames=150, lawful=False, shielded=False), seed=3))
    assert counted["none"] == 0
    assert min(counted["ego"], counted["other"], counted["both"]) > 0


@pytest.mark.parametrize("dt", [1 / 15, 1 / 5])
def test_an_unshielded_ego_among_the_lawful_is_to_blame_itself(dt):
    episodes = play(2000, world(dt=dt, frames=150, shielded=False), seed=4)
    # an ego that has turned round looks different to the other, who then sees no danger and owes nothing
    agreed = episodes[episodes["disputed"] == 0]
    assert len(agreed) > 0.8 * len(episodes)
    counted = verdicts(agreed)
    assert counted["ego"] > 100
    assert set(counted) == {"ego"}
